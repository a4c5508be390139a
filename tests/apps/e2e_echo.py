"""verge-echo, the tables of verge-ctl and the metrics, with vehicles on a real LCM bus.

    python3 tests/apps/e2e_echo.py --bin build/bin [--lcm-python VENV] [--only NAME]

Every case is a function whose name is its claim. Exit status 77: skipped, as in e2e_lcm.py, whose
vehicles and bus these are.
"""
import json
import math
import signal
import subprocess
import sys
import time
import urllib.request

import e2e_lcm
from daemon_rig import check
from e2e_lcm import SOURCE, URL, Bus, Daemon, three_and_a_human
from e2e_operators import figures, free_port


class Echo:
    """A running verge-echo."""

    def __init__(self, rig, *options, url="lcm:" + URL):
        self.out = open(rig.folder / "echo.out", "w+")
        self.process = subprocess.Popen([rig.bin / "verge-echo", url, *options], stdout=self.out,
                                        stderr=subprocess.PIPE, text=True)
        time.sleep(0.3) # to have joined

    def end(self):
        """Ctrl-C: (exit code, lines, the summary)."""
        self.process.send_signal(signal.SIGINT)
        summary = self.process.stderr.read()
        code = self.process.wait(10)
        self.out.seek(0)
        lines = self.out.read().splitlines()
        self.out.close()
        return code, lines, summary


def ctl(rig, *args):
    return rig.run(rig.bin / "verge-ctl", *args, "--socket", rig.folder / "rsu.sock")


def what_is_on_the_bus_is_printed_and_summed_up(rig):
    words = Echo(rig)
    with Daemon(rig, rig.config()):
        bus = Bus()
        bus.drive(three_and_a_human(), 2.0)
    code, lines, summary = words.end()
    kinds = {kind: sum(line.startswith(kind) for line in lines)
             for kind in ("state ", "plan ", "status ")}
    check(code == 0 and all(count > 0 for count in kinds.values()), f"{kinds} {summary}")
    check(summary.startswith(f"verge-echo: {kinds['state ']} states, {kinds['plan ']} plans, "
                             f"{kinds['status ']} status; 0 malformed"), summary)
    check(any("vehicle 1 " in line and "planned" in line for line in lines), lines[-5:])


def as_json_every_field_is_what_was_sent(rig):
    fields = Echo(rig, "--json")
    with Daemon(rig, rig.config()):
        bus = Bus()
        bus.drive(three_and_a_human(), 2.0)
    code, lines, _ = fields.end()
    heard = [json.loads(line) for line in lines]
    check(code == 0 and {entry["kind"] for entry in heard} == {"state", "plan", "status"}, "kinds")
    sent = {(plan.vehicle_id, plan.utime): plan for _, plan, _ in bus.plans}
    compared = 0
    for entry in heard:
        message = entry["message"]
        key = (message.get("vehicle_id"), message["utime"])
        if entry["kind"] != "plan" or key not in sent:
            continue
        plan = sent[key]
        compared += 1
        check(message["digest"] == f"{plan.digest & (2**64 - 1):016x}", "digest")
        check(message["crc32"] == f"{plan.crc32 & (2**32 - 1):08x}", "crc32")
        check(len(message["points"]) == plan.point_count, "points")
        for ours, theirs in zip(message["points"], plan.points):
            check(ours["x"] == theirs.x and abs(ours["speed"] - theirs.speed) < 1e-6, "a point")
        check([a["t1_ms"] for a in message["actions"]] ==
              [a.t1_ms for a in plan.actions[:plan.action_count]], "actions")
    check(compared >= 10, f"{compared} plans compared")


def it_ends_at_its_count_or_at_the_end_of_a_log(rig):
    with Daemon(rig, rig.config()):
        echo = Echo(rig, "--plans", "--count", "7")
        bus, vehicles = Bus(), three_and_a_human()
        while echo.process.poll() is None:
            bus.drive(vehicles, 0.2)
        echo.out.seek(0)
        lines = echo.out.read().splitlines()
        check(echo.process.returncode == 0 and len(lines) == 7, lines)
        check(all(line.startswith("plan ") for line in lines), lines)
    # A recording ends, too.
    log = rig.folder / "echo.lcmlog"
    with Daemon(rig, rig.config(), "--record", log) as rsu:
        bus.drive(vehicles, 1.0)
        rsu.stop()
    code, out, error = rig.run(rig.bin / "verge-echo", f"log:{log}")
    check(code == 0 and out.count("state ") >= 10 and "states" in error, error)


def on_dds_it_takes_the_same_options_as_the_daemon(rig):
    dds = {"interfaces": ["lo"]}
    options = rig.folder / "bus.json"
    options.write_text(json.dumps({"dds": dds}))
    config = rig.config(bus="dds:7", dds=dds, road=None, cycle_ms=200,
                        road_file=str(SOURCE / "apps/scenarios/ramp-case1.json"))
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--check-config")
    if "no DDS" in error:
        return
    with Daemon(rig, config):
        echo = Echo(rig, "--json", "--bus-options", options, url="dds:7")
        code, _, error = rig.run(rig.bin / "verge-publish",
                                 SOURCE / "apps/scenarios/ramp-case1.json", "--bus", "dds:7",
                                 "--bus-options", options, "--duration", "4", "--quiet")
        check(code == 0, error)
    code, lines, summary = echo.end()
    kinds = {json.loads(line)["kind"] for line in lines}
    check(code == 0 and kinds == {"state", "plan", "status"}, f"{kinds} {summary}")
    options.write_text('{"dds": {"interface": "lo"}}')
    code, _, error = rig.run(rig.bin / "verge-echo", "dds:7", "--bus-options", options)
    check(code == 64 and "dds.interface" in error and error.count("\n") == 1, error)


def refused_senders_are_reported_with_the_reason(rig):
    options = rig.folder / "bus.json"
    options.write_text('{"lcm": {"allow": ["10.9.9.9"]}}')
    words = Echo(rig, "--bus-options", options)
    Bus().drive(three_and_a_human(), 1.0)
    code, lines, told = words.end()
    check(code == 0 and not lines and "not in lcm.allow" in told, f"{code}: {lines}: {told}")


def wrong_use_has_its_exit_codes(rig):
    echo = rig.bin / "verge-echo"
    for wrong in ([], ["lcm:" + URL, "--bogus"], ["lcm:" + URL, "--count", "0"], ["tcp:x"],
                  ["lcm:" + URL, "--bus-options", rig.folder / "no.json"]):
        code, _, error = rig.run(echo, *wrong)
        check(code == 64 and error.count("\n") == 1, f"{wrong}: {code} {error}")
    code, _, error = rig.run("unshare", "-n", echo, "lcm:" + URL)
    check(code == 69 and "ip route add" in error, error)
    log = rig.folder / "echo.lcmlog"
    code, _, error = rig.run("sh", "-c", f"{echo} log:{log} > /dev/full") if log.exists() else (1, "", "")
    check(code == 1, f"no room to print: {code} {error}")


def verge_ctl_shows_vehicles_and_plans(rig):
    with Daemon(rig, rig.config(control="rsu.sock")) as rsu:
        bus, vehicles = Bus(), three_and_a_human()
        bus.drive(vehicles, 1.0)
        code, out, error = ctl(rig, "vehicles")
        rows = {int(line.split()[0]): line.split() for line in out.splitlines()[1:]}
        check(code == 0 and set(rows) == {1, 2, 3, 8}, out + error)
        check(rows[8][1] == "-" and rows[1][1] in ("planned", "keep_lane", "brake"), out)
        check(rows[2][3] == "1" and rows[1][3] == "0", "their lanes")
        seen = json.loads(ctl(rig, "vehicles", "--json")[1])["vehicles"]
        check(seen[0]["id"] == 1 and seen[0]["controlled"] and 0 <= seen[0]["age_ms"] <= 300, seen)
        bus.drive(vehicles, 0.3)
        code, out, _ = ctl(rig, "plans")
        check(code == 0 and out.count("\n") == 4 and " to 1" in out, out)
        plans = json.loads(ctl(rig, "plans", "--json")[1])["plans"]
        check(plans and not any("crc32" in plan for plan in plans), "a checksum is the bus's")
        check([plan["vehicle_id"] for plan in plans] == [1, 2, 3], "of each")
        bus.listen(0.3)
        sent = {(plan.vehicle_id, plan.utime) for _, plan, _ in bus.plans}
        check(all((plan["vehicle_id"], plan["utime"]) in sent for plan in plans), "as sent")
        check(rsu.stop()[1] == 0, "stops")


class Standing(e2e_lcm.Vehicle):
    """Stands, whatever its plan says. A heading of None: it sends neither heading nor speed."""

    def __init__(self, number, x, y, heading=0.0, **more):
        super().__init__(number, x, 0, speed=0.0, **more)
        self.y, self.heading = y, heading

    def now(self):
        state = super().now()
        if self.heading is None:
            state.heading = state.speed = math.nan
        else:
            state.heading = self.heading
        return state


# One lane after another: only on such a road are standing vehicles watched.
STREET = {"lanes": [
    {"id": 0, "centerline": [[0, 0], [900, 0]], "width": 3.75, "speed_limit": 25.0, "left": None,
     "right": None, "successors": [1]},
    {"id": 1, "centerline": [[900, 0], [1900, 0]], "width": 3.75, "speed_limit": 25.0,
     "left": None, "right": None}]}


def ring(radius=8.1):
    """A ring of two lanes, and as many standing vehicles as leave no room to begin."""
    def at(angle):
        return [radius * math.cos(angle), radius * math.sin(angle)]
    lanes = [{"id": half, "centerline": [at(math.pi * (half + k / 16)) for k in range(17)],
              "width": 3.5, "speed_limit": 8.0, "left": None, "right": None,
              "successors": [1 - half]} for half in (0, 1)]
    angles = [math.tau * (i + 0.25) / 8 for i in range(8)]
    return {"lanes": lanes}, [Standing(i + 1, *at(angle), math.remainder(angle + math.pi / 2, math.tau))
                              for i, angle in enumerate(angles)]


def counters_of(rig):
    return json.loads(ctl(rig, "status", "--json")[1])["counters"]


def drive_until(bus, vehicles, condition, what):
    until = time.monotonic() + 20
    while not condition():
        check(time.monotonic() < until, f"not within 20 s: {what}")
        bus.drive(vehicles, 0.5)


def what_the_status_message_has_no_field_for_is_counted(rig):
    port = free_port()
    served = {"control": "rsu.sock", "metrics": {"listen": f"127.0.0.1:{port}"}, "road": STREET}
    config = rig.config(**served)
    with Daemon(rig, config) as rsu:
        bus = Bus()
        lost = Standing(1, 100, 0.0, target=77) # a lane that the road does not have
        blind = Standing(2, 200, 0.0, None)
        gone = e2e_lcm.Vehicle(3, 300, 0)
        bus.drive([lost, blind, gone], 0.5)
        bus.lcm.publish("SOMETHING_ELSE", b"hello")
        drive_until(bus, [lost, blind], lambda: counters_of(rig)["unstuck"] == 1, "it stood for 3 s")
        counters = counters_of(rig)
        for name in ("states_unknown_target", "states_incomplete", "plans_cancelled", "candidates",
                     "cycles_planned", "bus_received", "bus_published", "bus_foreign"):
            check(counters[name] > 0, f"{name}: {counters}")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
            values = figures(answer.read().decode())
        check(all(values[f"verge_{name}_total"] >= count for name, count in counters.items()),
              f"{counters} {values}")
        check(values["verge_unstuck_total"] == 1, f"{values}")
        _, out, _ = ctl(rig, "status")
        for words in ("0 circles reordered, 1 vehicles unstuck", " with an unknown target; ", " without heading or speed"):
            check(words in out, f"{words}: {out}")
        rsu.wait_for("event=standstill new=1 reordered=0 unstuck=1")
        rsu.signal(signal.SIGUSR1)
        rsu.wait_for("event=statistics")
        check(" unstuck=1 " in rsu.text() and " cancelled=0 " not in rsu.text(), rsu.text())
        # A new configuration brings a new planner; what was counted stays.
        rig.config(**served, rsu_id=6)
        check(ctl(rig, "reload")[0] == 0, "accepted")
        drive_until(bus, [lost], lambda: counters_of(rig)["unstuck"] == 2, "with the new planner")
        check(rsu.stop()[1] == 0, "stops")


def a_circle_of_standing_vehicles_is_counted(rig):
    road, vehicles = ring()
    with Daemon(rig, rig.config(control="rsu.sock", road=road)) as rsu:
        bus = Bus()
        drive_until(bus, vehicles, lambda: counters_of(rig)["reordered"] > 0, "all wait")
        check("0 circles" not in ctl(rig, "status")[1], "for people")
        rsu.wait_for("event=standstill")
        check(rsu.stop()[1] == 0, "stops")


CASES = [
    what_is_on_the_bus_is_printed_and_summed_up,
    as_json_every_field_is_what_was_sent,
    it_ends_at_its_count_or_at_the_end_of_a_log,
    on_dds_it_takes_the_same_options_as_the_daemon,
    refused_senders_are_reported_with_the_reason,
    wrong_use_has_its_exit_codes,
    verge_ctl_shows_vehicles_and_plans,
    what_the_status_message_has_no_field_for_is_counted,
    a_circle_of_standing_vehicles_is_counted,
]

if __name__ == "__main__":
    sys.exit(e2e_lcm.main(CASES))
