#!/usr/bin/env python3
"""verge-publish: the lines that it prints while it runs, and the replay of its runs.

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

    def publish(self, *options, scenario=SCENARIO, bus=URL):
        return subprocess.Popen([self.bin / "verge-publish", scenario, "--bus", bus, *options],
                                text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def without_a_roadside_unit_one_line_says_so(rig):
    out, error = rig.publish("--duration", "7").communicate(timeout=60)
    check(error.count("\n") == 1 and f"no plan for 3 s on {URL}" in error and "expected" in error,
          f"told as {error!r}")
    check(out.startswith('{"scenario"'), "no plans to print")


def one_line_says_when_plans_begin_and_when_they_end(rig):
    publisher = rig.publish("--duration", "17")
    time.sleep(4.5)
    with Daemon(rig, rig.planning()) as rsu:
        time.sleep(2.5)
        rsu.stop()
    out, error = publisher.communicate(timeout=60)
    lines = error.splitlines()
    check(len(lines) == 3 and "no plan for 3 s" in lines[0] and "plans are received, after" in lines[1] and
          "no plan for 6 s" in lines[2], f"told as {error!r}")
    check(out.count("cancelled") == 3, "and the cancelled plans are changes")


def a_run_without_controlled_vehicles_gives_no_warning(rig):
    document = json.loads(SCENARIO.read_text())
    for vehicle in document["vehicles"]:
        vehicle["control"] = "human"
    humans = rig.folder / "humans.json"
    humans.write_text(json.dumps(document))
    _, error = rig.publish("--duration", "4", scenario=humans).communicate(timeout=60)
    check(error == "", f"told as {error!r}")


def the_options_print_changes_or_every_plan_or_none(rig):
    counts = {}
    with Daemon(rig, rig.planning()):
        for option in ("--quiet", None, "--all"):
            out, _ = rig.publish("--duration", "4", *([option] if option else [])).communicate(
                timeout=60)
            counts[option] = out.count(" cycle ")
    check(counts["--quiet"] == 0 and 3 <= counts[None] <= 40 and counts["--all"] >= 60, f"{counts}")


def replayed(rig, run, *options):
    return rig.run(rig.bin / "verge-replay", run, *options)


def recorded(rig, name, seconds, *options, **how):
    path = rig.folder / name
    out, error = rig.publish("--duration", str(seconds), "--quiet", "--out", path, *options,
                             **how).communicate(timeout=60)
    check(path.exists(), f"no run: {out} {error}")
    return path


def cycles_of(run):
    return [line["cycle"] for line in map(json.loads, run.read_text().splitlines())
            if "cycle" in line]


def a_run_replays_whatever_was_planned_before(rig):
    config = rig.planning()
    with Daemon(rig, config):
        for number in range(2):
            run = recorded(rig, f"run{number}.jsonl", 3)
            time.sleep(3)  # until the road is empty again
            cycles = len(cycles_of(run))
            check(cycles >= 20, f"{cycles} cycles")
            code, out, error = replayed(rig, run, "--config", config)
            check(code == 0 and f"{cycles} cycles, every digest is the same" in out and error == "",
                  f"run {number}: {code} {out} {error}")
    code, out, error = replayed(rig, run, "--config", config, "--seed", "9")
    check(code == 1 and "is the first that differs" in out, f"another seed: {code} {out} {error}")
    code, out, error = replayed(rig, run)
    check(code == 1 and "--config" in error, f"other parameters: {code} {out} {error}")
    return damaged_runs_are_refused_in_one_line(rig, run, config)


def damaged_runs_are_refused_in_one_line(rig, run, config):
    lines = run.read_text().splitlines(keepends=True)
    plans = [k for k, line in enumerate(lines) if '"cycle":' in line]
    short = rig.folder / "short.jsonl"
    short.write_text("".join(lines[:plans[5]]) + lines[plans[5]][:200])
    code, out, error = replayed(rig, short, "--config", config)
    check(code == 0 and "5 cycles" in out and "cut off" in error, f"{code} {out} {error}")
    gap = rig.folder / "gap.jsonl"
    gap.write_text("".join(lines[:plans[5]] + lines[plans[5] + 1:]))
    code, out, error = replayed(rig, gap, "--config", config)
    check(code == 0 and "every digest is the same" in out and "did not arrive" in error,
          f"{code} {out} {error}") # some cycles after the gap may come out the same
    for key in ("yaw_rates", "state_utimes", "valid_until_utime"):
        bad = rig.folder / f"no-{key}.jsonl"
        bad.write_text("".join(lines).replace(f'"{key}"', '"other"'))
        code, out, error = replayed(rig, bad, "--config", config)
        check(code == 2 and out == "" and f"{key}: is missing" in error and error.count("\n") == 1,
              f"without {key}: {code} {out} {error}")
    changed = rig.folder / "changed.jsonl"  # a vehicle was a millimetre elsewhere
    tick = json.loads(lines[1])
    tick["vehicles"][0][1] += 0.001
    changed.write_text(lines[0] + json.dumps(tick) + "\n" + "".join(lines[2:]))
    code, out, error = replayed(rig, changed, "--config", config)
    check(code == 1, f"another state, the same plans: {code} {out} {error}")


def a_run_with_the_parameters_of_its_scenario_needs_no_configuration(rig):
    with Daemon(rig, rig.planning(planner=None, cycle_ms=500)):
        run = recorded(rig, "run.jsonl", 3)
    code, out, error = replayed(rig, run)
    check(code == 0 and "every digest is the same" in out, f"{code} {out} {error}")


def a_run_replays_where_cycles_were_late(rig):
    config = rig.planning(planner=dict(QUICK, iterations=30000), cycle_ms=20)
    with Daemon(rig, config):
        run = recorded(rig, "run.jsonl", 4)
    lines = [json.loads(line) for line in run.read_text().splitlines()]
    late = sum("plan" in line and "cycle" not in line for line in lines)
    code, out, error = replayed(rig, run, "--config", config)
    check(code == 0 and "every digest is the same" in out and error == "", f"{code} {out} {error}")
    return None if late else "ok, but no cycle was late"


def a_run_on_dds_replays(rig):
    config = rig.planning(bus="dds:0")
    if "no DDS" in rig.run(rig.bin / "verge-rsu", "--config", config, "--check-config")[2]:
        return "built without DDS"
    with Daemon(rig, config):
        run = recorded(rig, "run.jsonl", 4, bus="dds:0")
    code, out, error = replayed(rig, run, "--config", config)
    check(code == 0 and "every digest is the same" in out, f"{code} {out} {error}")


def a_run_with_traffic_signals_replays(rig):
    scene = json.loads(SCENARIO.read_text())
    scene["signals"] = [{"lane": lane["id"], "start": -0.5, "phases": [
        {"state": "green", "seconds": 1.2}, {"state": "yellow", "seconds": 1}, {"state": "red", "seconds": 9}]}
        for lane in scene["road"]["lanes"]]
    lit = rig.folder / "lit.json"
    lit.write_text(json.dumps(scene))
    config = rig.planning()
    with Daemon(rig, config) as rsu:
        run = recorded(rig, "run.jsonl", 4, scenario=lit)
        check("other_map" not in rsu.text() and "states_refused" not in rsu.text(), rsu.text())
    code, out, error = replayed(rig, run, "--config", config)
    check(code == 0 and "every digest is the same" in out and error == "", f"{code} {out} {error}")


CASES = [
    a_run_replays_whatever_was_planned_before,
    a_run_with_traffic_signals_replays,
    a_run_with_the_parameters_of_its_scenario_needs_no_configuration,
    a_run_replays_where_cycles_were_late,
    a_run_on_dds_replays,
    without_a_roadside_unit_one_line_says_so,
    one_line_says_when_plans_begin_and_when_they_end,
    a_run_without_controlled_vehicles_gives_no_warning,
    the_options_print_changes_or_every_plan_or_none,
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
