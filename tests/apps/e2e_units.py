#!/usr/bin/env python3
"""verge-publish with on-vehicle units: their trajectories are driven, and their modes recorded.

    python3 tests/apps/e2e_units.py --bin build/bin [--lcm-python VENV] [--only NAME]

The units are made here, in another language: each sends the plan of its vehicle again, as its own
trajectory. Exit status 77: skipped, as in e2e_lcm.py.
"""
import json
import subprocess
import sys
import threading
import time

import e2e_lcm
from daemon_rig import SOURCE, Daemon, check

SCENARIO = SOURCE / "apps/scenarios/ramp-case1.json"
FOLLOWING, ALONE = 0, 2
SILENT = 4  # a reason


class Units(threading.Thread):
    """The units of all vehicles. mode: of the trajectories; aside: [m] to the left of the plan;
    running: they send."""

    def __init__(self):
        super().__init__(daemon=True)
        self.lcm = e2e_lcm.lcm.LCM(e2e_lcm.URL)
        self.lcm.subscribe("VERGE_PLAN", self.on_plan)
        self.lcm.subscribe("VERGE_STATE", self.on_state)
        self.plans, self.followed, self.sequence = {}, [], 0
        self.mode, self.aside, self.running, self.ended = FOLLOWING, 0.0, True, False

    def on_plan(self, _, data):
        plan = e2e_lcm.verge.vehicle_plan_t.decode(data)
        if plan.point_count:
            self.plans[plan.vehicle_id] = plan

    def on_state(self, _, data):
        state = e2e_lcm.verge.vehicle_state_t.decode(data)
        self.followed.append(state.followed_cycle)

    def run(self):
        due = time.monotonic()
        while not self.ended:
            due += 0.1
            while time.monotonic() < due:
                self.lcm.handle_timeout(max(1, int(1000 * (due - time.monotonic()))))
            if self.running:
                self.sequence += 1
                for plan in self.plans.values():
                    self.send(plan)

    def send(self, plan):
        """The rest of a plan as a trajectory that is valid for 0.5 s."""
        passed = max(0, (int(time.time() * 1e6) - plan.utime) // (1000 * plan.dt_ms))
        rest = plan.points[passed:plan.point_count]
        if len(rest) < 2:
            return
        made = e2e_lcm.verge.vehicle_trajectory_t()
        made.utime = plan.utime + 1000 * passed * plan.dt_ms
        made.valid_until_utime = made.utime + 500000
        made.vehicle_id, made.sequence, made.dt_ms = plan.vehicle_id, self.sequence, plan.dt_ms
        made.mode, made.mode_reason = self.mode, SILENT if self.mode == ALONE else 0
        made.mode_vehicle = made.why_vehicle = made.why_lane = made.lane = -1
        made.rsu_id, made.followed_cycle = plan.rsu_id, plan.cycle if self.mode != ALONE else -1
        made.protocol_version, made.point_count = 1, len(rest)
        for to, point in zip(made.points, rest):
            for name in ("x", "y", "heading", "speed", "acceleration", "curvature"):
                setattr(to, name, getattr(point, name))
            to.y += self.aside
        made.crc32 = e2e_lcm.signed(e2e_lcm.crc(made))
        self.lcm.publish("VERGE_TRAJECTORY", made.encode())

    def stop(self):
        self.ended = True
        self.join()


def driven(rig, units, phases, *options):
    """A run of verge-publish; phases: [(seconds, what to change of the units)]. (lines of the run,
    what was printed at the end, lines printed before)."""
    run = rig.folder / "run.jsonl"
    road = json.loads(SCENARIO.read_text())["road"]
    with Daemon(rig, rig.config(road=road, planner=None, cycle_ms=500)):
        units.start()
        seconds = sum(phase[0] for phase in phases)
        publisher = subprocess.Popen(
            [rig.bin / "verge-publish", SCENARIO, "--bus", rig.BUS, "--out", run, "--duration",
             str(seconds), *options], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for seconds, changes in phases:
            vars(units).update(changes)
            time.sleep(seconds)
        out, error = publisher.communicate(timeout=60)
        units.stop()
    check(publisher.returncode == 0, error)
    end = out.index('{"scenario"')
    lines = [json.loads(line) for line in run.read_text().splitlines()]
    return lines, json.loads(out[end:]), out[:end]


def modes_of(lines, number):
    return [line["unit"]["mode"] for line in lines
            if "unit" in line and line["unit"]["id"] == number]


def rows_of(lines, number):
    """(t, row) of one vehicle at each tick."""
    return [(line["t"], row) for line in lines for row in line.get("vehicles", [])
            if row[0] == number]


def trajectories_are_driven_refused_where_they_are_far_and_replaced_by_braking(rig):
    units = Units()
    lines, end, printed = driven(rig, units, [
        (3.0, {}),                  # following
        (1.5, {"aside": 3.0}),      # refused; what is valid ends after half a second
        (2.0, {"aside": 0.0, "mode": ALONE}),
        (4.5, {"running": False})], "--units")
    counts, metrics = end["trajectories"], end["metrics"]
    check(counts["driven"] > 100 and counts["far"] > 20, f"{counts}")
    check(counts["invalid"] == counts["early"] == 0, f"{counts}")
    latency = end["latency"]["state_to_trajectory_ms"]
    check(latency["count"] == 0, f"no state is named in these trajectories: {latency}")
    for number in (0, 2, 3):
        modes = modes_of(lines, number)
        check(modes == ["following", "none", "alone", "none"], f"vehicle {number}: {modes}")
        spent = metrics["units"][str(number)]
        check(spent["changes"] == 3 and spent["following"] > 2.5 and spent["alone"] > 1.5 and
              spent["none"] > 3.5, f"vehicle {number}: {spent}")
        speeds = [row[4] for _, row in rows_of(lines, number)]
        check(speeds[-1] == 0.0, f"vehicle {number} stands at the end: {speeds[-5:]}")
        check(all(b - a > -0.31 for a, b in zip(speeds[-30:], speeds[-29:])), f"{speeds[-30:]}")
        check(f"vehicle {number}   mode alone, silent\n" in printed, printed)
    check(metrics["collisions"] == 0 and metrics["off_road"] == 0, f"{metrics}")
    code, out, error = rig.run(rig.bin / "verge-replay", rig.folder / "run.jsonl")
    check(code == 0 and "every digest is the same" in out, f"replay: {code} {out} {error}")
    check(sum(cycle >= 0 for cycle in units.followed) > 50, "states name the cycle they follow")
    check(units.followed[-3:] == [-1, -1, -1], "and none without a unit")


def without_the_option_plans_are_driven_where_a_unit_is_silent(rig):
    lines, end, _ = driven(rig, Units(), [(2.0, {}), (4.0, {"running": False})])
    for number in (0, 2, 3):
        modes = modes_of(lines, number)
        check(modes == ["following", "none"], f"vehicle {number}: {modes}")
        speed = rows_of(lines, number)[-1][1][4]
        check(speed > 5.0, f"vehicle {number} drives on: {speed} m/s")
    check(end["metrics"]["collisions"] == 0, f"{end}")


def plans_alone_are_not_driven_where_units_are_expected(rig):
    lines, end, _ = driven(rig, Units(), [(6.0, {"running": False})], "--units")
    check(not any("unit" in line for line in lines) and "units" not in end["metrics"], "no modes")
    check(any("plan" in line for line in lines), "there are plans")
    for number in (0, 2, 3):
        speed = rows_of(lines, number)[-1][1][4]
        check(speed == 0.0, f"vehicle {number} stands: {speed} m/s")


CASES = [
    trajectories_are_driven_refused_where_they_are_far_and_replaced_by_braking,
    without_the_option_plans_are_driven_where_a_unit_is_silent,
    plans_alone_are_not_driven_where_units_are_expected,
]

if __name__ == "__main__":
    sys.exit(e2e_lcm.main(CASES))
