#!/usr/bin/env python3
"""verge-publish from outside: what it says while it runs, and that what it recorded replays.

    python3 tests/apps/e2e_publish.py --bin build/bin [--only NAME]

Exit status 77: skipped, where a private network is missing.
"""
import json
import os
import pathlib
import subprocess
import sys
import time

import daemon_rig
from daemon_rig import QUICK, SOURCE, Daemon, case_arguments, check, run_cases

SCENARIO = SOURCE / "apps/scenarios/ramp-case1.json"
URL = "lcm:udpm://239.255.76.67:7667?ttl=0"


class Rig(daemon_rig.Rig):
    """On LCM, the road of the scenario, ten cycles a second."""

    BUS, CYCLE_MS = URL, 100

    def planning(self, **changes):
        road = json.loads(SCENARIO.read_text())["road"]
        return self.config(road=road, **changes)

    def publish(self, *options, scenario=SCENARIO):
        return subprocess.Popen([self.bin / "verge-publish", scenario, "--bus", URL, *options],
                                text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def without_a_roadside_unit_it_says_so_once(rig):
    out, error = rig.publish("--duration", "7").communicate(timeout=60)
    check(error.count("\n") == 1 and f"no plan for 3 s on {URL}" in error and "expected" in error,
          f"told as {error!r}")
    check(out.startswith('{"scenario"'), "no plans to print")


def it_says_when_plans_come_and_when_they_end(rig):
    publisher = rig.publish("--duration", "17")
    time.sleep(4.5)
    with Daemon(rig, rig.planning()) as rsu:
        time.sleep(2.5)
        rsu.stop()
    out, error = publisher.communicate(timeout=60)
    lines = error.splitlines()
    check(len(lines) == 3 and "no plan for 3 s" in lines[0] and "plans come, after" in lines[1] and
          "no plan for 6 s" in lines[2], f"told as {error!r}")
    check(out.count("cancelled") == 3, "and the cancelled plans are changes")


def nobody_who_asks_for_nothing_is_kept_waiting(rig):
    document = json.loads(SCENARIO.read_text())
    for vehicle in document["vehicles"]:
        vehicle["control"] = "human"
    humans = rig.folder / "humans.json"
    humans.write_text(json.dumps(document))
    _, error = rig.publish("--duration", "4", scenario=humans).communicate(timeout=60)
    check(error == "", f"told as {error!r}")


def it_prints_changes_or_every_plan_or_none(rig):
    counts = {}
    with Daemon(rig, rig.planning()):
        for option in ("--quiet", None, "--all"):
            out, _ = rig.publish("--duration", "4", *([option] if option else [])).communicate(
                timeout=60)
            counts[option] = out.count(" cycle ")
    check(counts["--quiet"] == 0 and 3 <= counts[None] <= 40 and counts["--all"] >= 60, f"{counts}")


CASES = [
    without_a_roadside_unit_it_says_so_once,
    it_says_when_plans_come_and_when_they_end,
    nobody_who_asks_for_nothing_is_kept_waiting,
    it_prints_changes_or_every_plan_or_none,
]


def main():
    options = case_arguments()
    if "VERGE_E2E_NETWORK" not in os.environ:
        os.environ["VERGE_E2E_NETWORK"] = "1"
        here = SOURCE / "tests/support/in_network.sh"
        os.execv(here, [here, sys.executable, *sys.argv])
    return run_cases(CASES, options.bin, options.only, Rig)


if __name__ == "__main__":
    sys.exit(main())
