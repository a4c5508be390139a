"""What the daemon does when planning takes longer than a cycle, on a real LCM bus.

    python3 tests/apps/e2e_deadline.py --bin build/bin [--lcm-python VENV] [--only NAME]

Every case is a function whose name is its claim. A large budget makes planning slow. It is measured
first, because builds and machines differ in speed by a factor of fifty. The cases wait for events,
not for fixed times.
Exit status 77: skipped, as in e2e_lcm.py, whose vehicles and bus these are.
"""
import collections
import json
import os
import signal
import sys
import time

import e2e_lcm
from daemon_rig import Manager, check
from e2e_lcm import CANCELLED, QUICK, Bus, Daemon, digests_of, three_and_a_human
from e2e_operators import ctl

BRAKE = 2


def drive_until(bus, vehicles, condition, what, seconds=60):
    until = time.monotonic() + seconds
    while not condition():
        check(time.monotonic() < until, f"not within {seconds} s: {what}")
        bus.drive(vehicles, 0.2)


def iterations_for(rig, seconds):
    """The search budget with which a cycle takes about so long."""
    with Daemon(rig, rig.config("slow.json", cycle_ms=1000, planner=dict(QUICK, iterations=2000))):
        bus, vehicles = Bus(), three_and_a_human()
        drive_until(bus, vehicles, lambda: any(status.vehicles_controlled == 3 and
                                               status.cycle_us_last > 0
                                               for _, status, _ in bus.statuses), "a cycle")
        spent = bus.statuses[-1][1].cycle_us_last
    return max(300, min(1000000, int(2000 * seconds * 1e6 / spent)))


def a_late_plan_is_bridged_by_the_rest_of_the_last_one(rig):
    log = rig.folder / "late.lcmlog"
    slow = dict(QUICK, iterations=iterations_for(rig, 0.35))
    config = rig.config(cycle_ms=100, planner=slow, control="rsu.sock")
    with Daemon(rig, config, "--record", log) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()

        def bridged():
            return [plan for _, plan, _ in bus.overruns if plan.status == 0]
        drive_until(bus, vehicles, lambda: len(bridged()) >= 15 and len(digests_of(bus)) >= 6,
                    "plans that are late, and what bridges them")
        whole = {(plan.cycle, plan.vehicle_id): plan for _, plan, _ in bus.plans}
        compared = 0
        for rest in bridged():
            plan = whole.get((rest.cycle, rest.vehicle_id))
            if plan is None:
                continue # heard before we listened
            check(rest.digest == plan.digest, "the digest of the plan it comes from")
            check(rest.valid_until_utime == plan.valid_until_utime, "it ends when that ends")
            dropped = (rest.utime - plan.utime) // (plan.dt_ms * 1000)
            check(dropped >= 0 and rest.point_count == plan.point_count - dropped, "elapsed points")
            ours = [(p.x, p.y, p.speed) for p in rest.points[:rest.point_count]]
            check(ours == [(p.x, p.y, p.speed) for p in plan.points[dropped:plan.point_count]],
                  "point for point")
            compared += 1
        check(compared >= 10, f"{compared} compared")
        status = bus.statuses[-1][1]
        check(status.deadline_misses >= 5 and status.state == 3 and status.fault == 4,
              f"counted and told: {status.deadline_misses} {status.state} {status.fault}")
        check(status.plans_sent > len(bus.plans) / 2, "and sent plans are counted")
        counters = json.loads(ctl(rig, "status", "--json")[1])["counters"]
        check(counters["overruns"] >= 15, f"what bridges them is counted: {counters}")
        check(rsu.stop()[1] == 0, "stops")
        bus.listen(0.3)
    code, out, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", log)
    check(code == 0, error)
    lines = [json.loads(line) for line in out.splitlines()]
    replayed = {line["cycle"]: line["digest"] for line in lines if line["vehicles"] > 0}
    for cycle, digest in digests_of(bus).items():
        check(replayed[cycle] == f"{digest & (2**64 - 1):016x}", f"cycle {cycle} replays")
    code, out, error = rig.run(rig.bin / "verge-replay", log, "--config", config)
    check(code == 0 and "same" in out, f"verge-replay: {code} {out} {error}")


def no_tick_is_silent_and_no_plan_means_braking(rig):
    short = dict(QUICK, points=11) # a plan is over after a second
    slow = dict(short, iterations=iterations_for(rig, 4.0), steps=16)
    config = rig.config(cycle_ms=100, planner=short)
    with Daemon(rig, config) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 1.0)
        rig.config(cycle_ms=100, planner=slow)
        rsu.signal(signal.SIGHUP)
        drive_until(bus, vehicles, lambda: {plan.status for _, plan, _ in bus.overruns} >= {0, BRAKE},
                    "first the rest of the last plans, then braking")
        first = next(at for at, plan, _ in bus.overruns)
        heard = collections.defaultdict(list)
        for at, plan, _ in sorted(bus.plans + bus.overruns, key=lambda entry: entry[0]):
            if at >= first and plan.status != CANCELLED:
                heard[plan.vehicle_id].append(at)
        check(set(heard) == {1, 2, 3}, f"everyone who asks: {set(heard)}")
        for number, times in heard.items():
            gap = max(b - a for a, b in zip(times, times[1:]))
            check(gap < 1.0, f"vehicle {number} heard nothing for {gap:.2f} s")
        for _, plan, _ in bus.overruns:
            if plan.status == BRAKE and plan.point_count == 31:
                check(plan.points[30].speed < plan.points[0].speed, "it brakes")
        check(rsu.stop()[1] == 0, "stops")
        bus.listen(0.3)
        last = {plan.vehicle_id: plan.status for _, plan, _ in bus.plans + bus.overruns
                if plan.status == CANCELLED}
        check(set(last) == {1, 2, 3}, f"and stopping cancels it all: {last}")


def a_planner_that_hangs_stops_the_watchdog_signal(rig):
    manager = Manager(str(rig.folder / "watchdog"))
    env = {**os.environ, "NOTIFY_SOCKET": manager.name, "WATCHDOG_USEC": "2000000"}
    # A search that takes seconds is as good as one that never ends.
    endless = dict(QUICK, iterations=1000000, steps=16)
    with Daemon(rig, rig.config(cycle_ms=100, planner=endless), env=env) as rsu:
        for _ in range(5):
            manager.wait_for("WATCHDOG=1")
        bus, vehicles = Bus(), three_and_a_human()
        began = time.monotonic()
        manager.silent_for(0.05) # what was sent before
        drive_until(bus, vehicles, lambda: bus.statuses and
                    bus.statuses[-1][1].deadline_misses >= 15, "cycles that take many ticks")
        ticks = (time.monotonic() - began) * 10 + 2
        fed = sum("WATCHDOG" in text for text in manager.silent_for(0.05))
        check(fed <= ticks - 15, f"{fed} feeds in {ticks:.0f} ticks of which 15 found it at work")
        check(rsu.process.poll() is None, "the main thread goes on all the while")


CASES = [
    a_late_plan_is_bridged_by_the_rest_of_the_last_one,
    no_tick_is_silent_and_no_plan_means_braking,
    a_planner_that_hangs_stops_the_watchdog_signal,
]


if __name__ == "__main__":
    sys.exit(e2e_lcm.main(CASES))
