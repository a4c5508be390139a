#!/usr/bin/env python3
"""Recorded traffic of US-101: controlled vehicles among recorded vehicles, which do not react.

Verge plans and drives every recorded case; an independent judge finds no overlap within a plan
document, no trajectory a car could not drive, no contact between controlled vehicles, and no
recorded vehicle that a controlled one runs into. The number of reached intentions is printed but
not checked: the recorded vehicles do not react, so a lane change may be impossible.

The recordings are not part of the repository. The test looks for them in VERGE_SHARED/data/us101
(default: ../shared/data/us101 beside the repository). Without them it is skipped (exit 77).
Usage: e2e_us101.py --bin DIR
"""
import argparse
import json
import os
import pathlib
import sys
import tempfile

import judge

SHARED = pathlib.Path(os.environ.get(
    "VERGE_SHARED", pathlib.Path(__file__).resolve().parents[3] / "shared"))


def judge_case(binaries, path, seed, folder):
    """Faults, contacts that others caused, intentions reached, intentions."""
    scenario = json.loads(path.read_text())
    plan = judge.run(binaries, "verge-plan", path, "--seed", seed)
    faults = [f"verge-plan: {fault}" for fault in judge.plan_faults(plan, scenario)]
    out = pathlib.Path(folder) / "run.jsonl"
    metrics = judge.run(binaries, "verge-sim", path, "--seed", seed, "--out", out)["metrics"]
    lines = judge.read_lines(out)
    faults += judge.run_faults(lines, scenario)
    suffered = 0
    for tick, one, other, whose in judge.contacts(lines, scenario):
        if whose == other:
            suffered += 1
        else:
            faults.append(f"{one} runs into {other} at tick {tick:.1f}")
    if (metrics["collisions"] > 0) != (suffered > 0 or any("runs into" in f for f in faults)):
        faults.append(f"verge-sim counts {metrics['collisions']} collisions, we do not")
    reached = [t for number, t in metrics["reached_time"].items() if number != "mean"]
    return faults, suffered, sum(t is not None for t in reached), len(reached)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options, _ = parser.parse_known_args()
    paths = sorted((SHARED / "data/us101").glob("*.json"))
    if not paths:
        print(f"SKIPPED: no recordings in {SHARED / 'data/us101'}", file=sys.stderr)
        return 77
    count = 0
    totals = [0, 0, 0]
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            for seed in range(1, 1 + 2 * judge.scale()):
                faults, *numbers = judge_case(options.bin, path, seed, folder)
                totals = [a + b for a, b in zip(totals, numbers)]
                print(f"{path.name}, seed {seed}: {numbers[1]} of {numbers[2]} intentions reached,"
                      f" {numbers[0]} times run into by a recorded driver")
                for fault in faults[:5]:
                    print(f"{path.name}, seed {seed}: {fault}", file=sys.stderr)
                count += len(faults)
    print(f"{len(paths)} recordings: {totals[1]} of {totals[2]} intentions reached, "
          f"{totals[0]} contacts by others, {count} faults")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
