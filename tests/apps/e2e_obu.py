#!/usr/bin/env python3
"""Closed loops of separate processes: a roadside unit, an on-vehicle unit in each controlled
vehicle, and verge-publish, which moves the vehicles as these units say.

    python3 tests/apps/e2e_obu.py --bin build/bin [--only NAME]

VERGE_TEST_LONG=1 drives more scenes, each on both buses. Exit status 77: skipped, where a private
network is missing.
"""
import json
import os
import signal
import subprocess
import sys
import time

import daemon_rig
from daemon_rig import SOURCE, Daemon, case_arguments, check, run_cases

BUSES = {"lcm": "lcm:udpm://239.255.76.67:7667?ttl=0", "dds": "dds:0"}
SWERVE = SOURCE / "tests/apps/swerve.json"


def shipped(name):
    return SOURCE / f"apps/scenarios/{name}.json"


class Obu(Daemon):
    """A running verge-obu."""

    PROGRAM = "verge-obu"


class Loop:
    """The processes of one run."""

    def __init__(self, rig, scenario, bus="lcm", cycle_ms=500):
        self.rig, self.scenario, self.bus = rig, scenario, BUSES[bus]
        self.scene = json.loads(scenario.read_text())
        planner = self.scene.get("planner", {})
        self.rsu = rig.config(bus=self.bus, road=None, road_file=str(scenario), planner=planner,
                              cycle_ms=cycle_ms)
        self.controlled = [v["id"] for v in self.scene["vehicles"]
                           if v["control"] == "controlled"]

    def obu(self, number):
        return self.rig.config(f"obu-{number}.json", format="verge-obu/1", rsu_id=None,
                               vehicle_id=number, bus=self.bus, road=None, planner=None,
                               road_file=str(self.scenario), cycle_ms=None)

    def drive(self, seconds=None, gap=None):
        """(lines of the run, what verge-publish printed at the end). gap: (begin, end) [s] between
        which there is no roadside unit."""
        run = self.rig.folder / "run.jsonl"
        units = [Obu(self.rig, self.obu(number), log=f"obu-{number}.log")
                 for number in self.controlled]
        rsu = Daemon(self.rig, self.rsu)
        publisher = subprocess.Popen(
            [self.rig.bin / "verge-publish", self.scenario, "--bus", self.bus, "--units",
             "--quiet", "--out", run, *(["--duration", str(seconds)] if seconds else [])],
            text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            if gap:
                time.sleep(gap[0])
                rsu.signal(signal.SIGKILL)
                rsu.process.wait()
                time.sleep(gap[1] - gap[0])
                rsu = Daemon(self.rig, self.rsu)
            out, error = publisher.communicate(timeout=120)
            check(publisher.returncode == 0, error)
            for daemon in [rsu, *units]:
                took, code = daemon.stop()
                check(code == 0 and took < 2.0, f"{daemon.path}: {code} after {took:.1f} s")
        finally:
            publisher.kill()
            for daemon in [rsu, *units]:
                daemon.__exit__()
        lines = [json.loads(line) for line in run.read_text().splitlines()]
        return lines, json.loads(out)


def modes_of(lines, number):
    """[(t, mode, reason, vehicle)]"""
    return [(line["t"], *(line["unit"][key] for key in ("mode", "reason", "vehicle")))
            for line in lines if line.get("unit", {}).get("id") == number]


def share_following(lines, end, number):
    """Of the time from the first plan on, which comes within 2.5 s."""
    told = modes_of(lines, number)
    first = next(t for t, mode, *_ in told if mode == "following")
    check(first <= 2.5, f"vehicle {number}: {told}")
    spent = {mode: time for mode, time in end["metrics"]["units"][str(number)].items()
             if mode != "changes"}
    check(spent.get("none", 0.0) <= 0.3, f"vehicle {number} had no trajectory: {spent}")
    return spent["following"] / (sum(spent.values()) - (first - told[0][0]))


def driven(rig, name, bus, seconds=None):
    """All intentions are reached without a contact, and plans are followed nearly always."""
    loop = Loop(rig, shipped(name), bus)
    lines, end = loop.drive(seconds)
    metrics, counts = end["metrics"], end["trajectories"]
    check(metrics["success"] and metrics["collisions"] == 0, f"{metrics}")
    check(counts["far"] <= 0.02 * counts["driven"] and counts["invalid"] == 0, f"{counts}")
    least = min(share_following(lines, end, number) for number in loop.controlled)
    check(least >= 0.85, f"following {least:.2f} of the time: {metrics['units']}")
    return (f"ok, following {100 * least:.0f} % of the time at least, "
            f"{sum(u['changes'] for u in metrics['units'].values())} changes of modes, from a "
            f"state to its trajectory {end['latency']['state_to_trajectory_ms']['p50']:.0f} ms")


def the_ramp_on_lcm(rig):
    return driven(rig, "ramp-case1", "lcm", 12)


def the_crossing_on_lcm(rig):
    return driven(rig, "crossing", "lcm")


def the_freeway_on_dds(rig):
    return driven(rig, "freeway-4av-2hv", "dds", 12)


def the_roundabout_on_lcm(rig):
    return driven(rig, "roundabout", "lcm")


def the_crossing_on_dds(rig):
    return driven(rig, "crossing", "dds")


def the_freeway_on_lcm(rig):
    return driven(rig, "freeway-4av-2hv", "lcm", 12)


def vehicles_drive_alone_while_the_roadside_unit_is_dead(rig):
    loop = Loop(rig, shipped("ramp-case1"))
    lines, end = loop.drive(seconds=12, gap=(2.0, 6.0))
    metrics = end["metrics"]
    check(metrics["success"] and metrics["collisions"] == 0, f"{metrics}")
    for number in loop.controlled:
        told = modes_of(lines, number)
        alone = [t for t, mode, *_ in told if mode == "alone" and t > 1.5]
        back = [t for t, mode, *_ in told if mode == "following" and t > 5.0]
        check(alone and 2.5 <= alone[0] <= 5.5, f"vehicle {number} alone: {told}")
        check(back and 6.0 <= back[0] <= 8.5, f"vehicle {number} follows again: {told}")
        check(not any(mode == "none" for _, mode, *_ in told), f"vehicle {number}: {told}")
    spent = metrics["units"]
    return f"ok, alone for {max(u['alone'] for u in spent.values()):.1f} s at most"


def a_unit_departs_where_a_human_driver_swerves_between_two_cycles(rig):
    loop = Loop(rig, SWERVE, cycle_ms=1000)
    lines, end = loop.drive()
    metrics = end["metrics"]
    check(metrics["collisions"] == 0 and metrics["min_distance"] > 0.2, f"{metrics}")
    told = modes_of(lines, 1)
    departed = [entry for entry in told if entry[1:] == ("departing", "contact", 2)]
    check(departed, f"vehicle 1: {told}")
    check(told[-1][1] == "following", f"and follows again: {told}")
    return f"ok, from {departed[0][0]} s, smallest distance {metrics['min_distance']:.2f} m"


CASES = [
    the_ramp_on_lcm,
    the_crossing_on_lcm,
    the_freeway_on_dds,
    vehicles_drive_alone_while_the_roadside_unit_is_dead,
    a_unit_departs_where_a_human_driver_swerves_between_two_cycles,
]
LONG = [the_roundabout_on_lcm, the_crossing_on_dds, the_freeway_on_lcm]


def main():
    options = case_arguments()
    if "VERGE_E2E_NETWORK" not in os.environ:
        os.environ["VERGE_E2E_NETWORK"] = "1"
        here = SOURCE / "tests/support/in_network.sh"
        os.execv(here, [here, sys.executable, *sys.argv])
    cases = CASES + (LONG if os.environ.get("VERGE_TEST_LONG") or options.only else [])
    return run_cases(cases, options.bin, options.only, daemon_rig.Rig)


if __name__ == "__main__":
    sys.exit(main())
