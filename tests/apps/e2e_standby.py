"""Two roadside units for one road: one sends the plans, the other one stands by and takes over.

    python3 tests/apps/e2e_standby.py --bin build/bin [--lcm-python VENV] [--only NAME]

Exit status as e2e_lcm.py. A plan is told to be of the one or the other unit by its rsu_id, or, if
both have the same, by its cycle: the units count from their own starts, which are seconds apart.
"""
import contextlib
import json
import sys

import daemon_rig
import e2e_lcm
from daemon_rig import Daemon, SOURCE, check, wait_for
from e2e_secure import write_key

CYCLE_S = 0.5
RAMP = SOURCE / "apps/scenarios/ramp-case1.json"


class Unit(Daemon):
    """A daemon with a control socket and a log of its own."""

    def __init__(self, rig, name, *options, **changes):
        self.rig, self.socket = rig, rig.folder / f"{name}.sock"
        config = rig.config(f"{name}.json", cycle_ms=int(CYCLE_S * 1000),
                            control=f"{name}.sock", **changes)
        super().__init__(rig, config, *options, log=f"{name}.log")

    def status(self):
        code, text, error = self.rig.run(self.rig.bin / "verge-ctl", "status", "--json",
                                         "--socket", self.socket)
        check(code == 0, error)
        return json.loads(text)

    def wait_until(self, what, condition, meanwhile=lambda: None):
        def holds():
            meanwhile()
            return condition(self.status())
        wait_for(holds, what)

    def words(self):
        return self.rig.run(self.rig.bin / "verge-ctl", "status", "--socket", self.socket)[1]


def stands_by(status):
    return status["standby"] and "other_rsu" in status["faults"] and status["state"] == "degraded"


def leads(status):
    return not status["standby"] and status["others"] == []


def gap_s(before, after):
    """From the instant of one plan to that of another one."""
    return (after.utime - before.utime) * 1e-6


def check_takes_over(last, first):
    """The first plan is due a cycle after the last one; three cycles of silence are allowed. A
    quarter of a cycle is for a busy machine."""
    check(gap_s(last, first) <= 4.25 * CYCLE_S, f"{gap_s(last, first)} s without a plan")


def split(plans, of_second):
    """(those of the first unit, those of the second unit)"""
    return ([plan for _, plan, _ in plans if not of_second(plan)],
            [plan for _, plan, _ in plans if of_second(plan)])


# ---- cases ----------------------------------------------------------------------------------

def of_one_id_the_later_unit_is_silent_and_takes_over(rig):
    bus, vehicles = e2e_lcm.Bus(), e2e_lcm.three_and_a_human()
    with Unit(rig, "first") as first:
        bus.drive(vehicles, 3)
        check("other_rsu" not in first.text(), "a unit does not take itself for another one")
        check(first.status()["others"] == [], "nor in its status")
        check(bus.plans, "the first unit plans")
        record = rig.folder / "second.lcmlog"
        with Unit(rig, "second", "--record", record) as second:
            second.wait_until("stands by", stands_by, lambda: bus.drive(vehicles, 0.2))
            bus.drive(vehicles, 2)
            started = second.status()["status"]["start_utime"]

            def of_second(plan):
                return plan.utime - plan.cycle * CYCLE_S * 1e6 > started - 0.5 * CYCLE_S * 1e6
            check(split(bus.plans, of_second)[1] == [], "the second unit sends no plan")
            check(second.status()["status"]["vehicles_controlled"] == 3, "it plans all the same")
            check(second.status()["status"]["plans_sent"] == 0, "and counts none as sent")
            check(second.status()["counters"]["messages_withheld"] >= 9, "but as withheld")
            for unit, other in ((first, "second"), (second, "first")):
                lines = [line for line in unit.text().split("\n") if "event=other_rsu " in line]
                check(len(lines) == 1, f"one line about the {other} unit: {lines}")
                check("rsu_id=5 same_id=true" in lines[0] and "sender=" in lines[0], lines[0])
                check("other_rsu" in unit.status()["faults"], "both report the fault")
            check("event=stands_by" in second.text(), "the second says so in its log")
            check("this one stands by" in second.words(), second.words())
            check(not first.status()["standby"], "the first does not stand by")
            check(any(s.fault == 8 for _, s, _ in bus.statuses), "and on the bus")

            first.process.kill()
            second.wait_until("takes over", leads, lambda: bus.drive(vehicles, 0.2))
            bus.drive(vehicles, 1)
            before, after = split(bus.plans, of_second)
            check(after, "the second unit sends plans")
            check_takes_over(before[-1], after[0])
            check({p.vehicle_id for p in after} == {1, 2, 3}, "for every vehicle")
            check(all(plan.status != e2e_lcm.CANCELLED for plan in before + after),
                  "nothing is cancelled")
            check("event=takes_over" in second.text(), "it says so in its log")
            check("event=other_rsu_silent rsu_id=5" in second.text(), "and why")
            check(second.stop()[1] == 0, "stops")
            code, text, error = rig.run(rig.bin / "verge-replay", record, "--config",
                                        rig.folder / "second.json")
            check(code == 0, f"what it planned in silence replays, too: {text}{error}")


def a_second_unit_with_signatures_stands_by_and_takes_over(rig):
    write_key(rig.folder / "one.key")
    keys = {"sign_with": 1, "window_ms": 2000, "keys": [{"id": 1, "file": "one.key"}]}
    bus = e2e_lcm.Bus()
    with Unit(rig, "first", lcm=keys) as first, Unit(rig, "second", lcm=keys) as second, \
            Unit(rig, "stranger", rsu_id=1) as stranger:
        second.wait_until("stands by", stands_by)
        bus.listen(2)
        others = first.status()["others"]
        check([other["rsu_id"] for other in others] == [5], f"unsigned units count: {others}")
        first.process.kill()
        second.wait_until("takes over", leads)
        check(stranger.stop()[1] == 0 and second.stop()[1] == 0, "stop")


def of_two_ids_the_lower_one_sends_and_gets_its_vehicles_back(rig):
    bus, vehicles = e2e_lcm.Bus(), e2e_lcm.three_and_a_human()

    def drive():
        bus.drive(vehicles, 0.2)

    with contextlib.ExitStack() as stack:
        high = stack.enter_context(Unit(rig, "high", rsu_id=7))
        wait_for(lambda: drive() or bus.plans, "a plan")
        low = stack.enter_context(Unit(rig, "low", rsu_id=3))
        high.wait_until("stands by", stands_by, drive)
        check("event=other_rsu rsu_id=3 same_id=false" in high.text(), high.text())
        check(low.status()["others"][0]["leads"] is False, "the lower one knows that it leads")
        bus.plans.clear()
        bus.drive(vehicles, 2)
        check({plan.rsu_id for _, plan, _ in bus.plans} == {3}, "the lower one sends")
        check("this one stands by" in high.words() and "rsu_id 3 (leads)" in high.words(),
              high.words())

        low.process.kill()
        high.wait_until("takes over", leads, drive)
        bus.drive(vehicles, 1)
        before, after = split(bus.plans, lambda plan: plan.rsu_id == 7)
        check_takes_over(before[-1], after[0])

        again = stack.enter_context(Unit(rig, "again", rsu_id=3))
        high.wait_until("stands by again", stands_by, drive)
        bus.plans.clear()
        bus.drive(vehicles, 2)
        check({plan.rsu_id for _, plan, _ in bus.plans} == {3}, "the lower one sends again")
        check(again.stop()[1] == 0, "stops")
        bus.drive(vehicles, 2)
        before, after = split(bus.plans, lambda plan: plan.rsu_id == 7)
        check(before[-1].status == e2e_lcm.CANCELLED, "it cancels its plans when it stops")
        check(gap_s(before[-1], after[0]) <= 1.25 * CYCLE_S, "and is replaced in the next cycle")
        check(all(plan.status != e2e_lcm.CANCELLED for plan in after), "the other cancels nothing")
        check(high.stop()[1] == 0, "stops")


def never_lets_a_unit_send_and_both_report_the_other_one(rig):
    bus, vehicles = e2e_lcm.Bus(), e2e_lcm.three_and_a_human()
    with Unit(rig, "low", rsu_id=3) as low, Unit(rig, "high", rsu_id=7, standby="never") as high:
        def both():
            bus.drive(vehicles, 0.2)
            return all("other_rsu" in unit.status()["faults"] for unit in (low, high))
        wait_for(both, "both units report the other one")
        bus.plans.clear()
        bus.drive(vehicles, 2)
        check({plan.rsu_id for _, plan, _ in bus.plans} == {3, 7}, "both send")
        check(not high.status()["standby"], "never stands by")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", rig.config(standby="always"),
                             "--check-config")
    check(code == 78 and "standby" in error and "lower_id or never" in error, f"{code} {error!r}")


def a_second_unit_on_dds_stands_by_and_takes_over(rig):
    if rig.run(rig.bin / "verge-rsu", "--config", rig.config(bus="dds:0"), "--check-config")[0]:
        return "skipped, DDS is not built in"
    changes = {"bus": "dds:0", "road": None, "road_file": str(RAMP)}

    def drive(seconds):
        code, _, error = rig.run(rig.bin / "verge-publish", RAMP, "--bus", "dds:0", "--duration",
                                 seconds, "--quiet")
        check(code == 0, error)

    with Unit(rig, "first", **changes) as first, Unit(rig, "second", **changes) as second:
        second.wait_until("stands by", stands_by)
        drive("4")
        sent = second.status()
        check(first.status()["status"]["plans_sent"] > 0, "the first unit sends plans")
        check(sent["status"]["plans_sent"] == 0 and sent["counters"]["messages_withheld"] > 0,
              f"the second unit sends none: {sent}")
        first.process.kill()
        second.wait_until("takes over", leads)
        drive("3")
        check(second.status()["status"]["plans_sent"] > 0, "the second unit sends plans")
        check(second.stop()[1] == 0, "stops")


CASES = [
    of_one_id_the_later_unit_is_silent_and_takes_over,
    a_second_unit_with_signatures_stands_by_and_takes_over,
    of_two_ids_the_lower_one_sends_and_gets_its_vehicles_back,
    never_lets_a_unit_send_and_both_report_the_other_one,
    a_second_unit_on_dds_stands_by_and_takes_over,
]

if __name__ == "__main__":
    sys.exit(e2e_lcm.main(CASES))
