#!/usr/bin/env python3
"""Every shipped scenario, with several seeds, succeeds, and an independent judge finds no fault.

Single plans: no bodies overlap, every trajectory can be driven by the car. Runs: the same of the
plan of each cycle, each plan begins at the state of its vehicle, no vehicles touch, and every
intention is reached without a fallback. The judge itself is tested first: it has to find the
faults that are injected into good plans.
Usage: e2e_scenarios.py --bin DIR
"""
import argparse
import copy
import json
import pathlib
import sys
import tempfile

import judge

SCENARIOS = pathlib.Path(__file__).resolve().parents[2] / "apps/scenarios"


def find(plan, number):
    return next(v for v in plan["vehicles"] if v["id"] == number)


def break_plan(plan, number, change):
    broken = copy.deepcopy(plan)
    change(find(broken, number)["trajectory"]["points"])
    return broken


def the_judge_finds_injected_faults(plan, scenario):
    """Each kind of fault is put into a good plan and has to be found."""
    assert list(judge.plan_faults(plan, scenario)) == [], "the plan to break is not good"
    one, other = (v["id"] for v in plan["vehicles"][:2])

    def scaled(column, factor):
        def change(points):
            for point in points:
                point[column] *= factor
        return change

    def moved(points):
        points[10][1] += 0.02

    def turned(points):
        points[10][3] += 0.01

    def bent(points):
        for k, point in enumerate(points):
            point[6] += 0.05 * (k % 2)

    def onto_other(points):
        points[20][1:4] = find(plan, other)["trajectory"]["points"][20][1:4]

    for what, change in (("arrive", moved), ("heading does not", turned),
                         ("arrive", scaled(4, 1.02)), ("steers", bent),
                         ("speed above", scaled(4, 10.0)), ("overlap", onto_other)):
        found = list(judge.plan_faults(break_plan(plan, one, change), scenario))
        assert any(what in fault for fault in found), f"the judge missed: {what}: {found}"
    for k, x, expected in ((0, 4.9, True), (0, 5.1, False), (1.5, 3.6, False), (0.7, 3.9, True)):
        touch = judge.first_overlap([[0, 0, 0]], [[x, 0, k]], (5, 2), (5, 2)) is not None
        assert touch == expected, f"two cars {x} m apart, turned by {k}: overlap {touch}"


def the_judge_of_runs_finds_injected_faults(lines, scenario):
    """A good run loses a plan's true beginning; two cars drive into each other."""
    broken = copy.deepcopy(lines)
    plan = [line["plan"] for line in broken if "plan" in line][3]
    plan["vehicles"][0]["trajectory"]["points"][0][1] += 1e-6
    assert any("begins at" in fault for fault in judge.run_faults(broken, scenario, False))
    plan["vehicles"][0]["trajectory"]["points"][0][6] += 1e-3
    assert any("with curvature" in fault for fault in judge.run_faults(broken, scenario, False))

    def drive(speed_of_1, speed_of_2):
        two = [{"id": n, "control": c, "length": 5, "width": 2}
               for n, c in ((1, "controlled"), (2, "human"))]
        return [{"vehicles": [[1, speed_of_1 * 0.1 * k, 0, 0, speed_of_1],
                              [2, 20 + speed_of_2 * 0.1 * k, 1, 0, speed_of_2]]}
                for k in range(60)], {"vehicles": two}
    assert list(judge.contacts(*drive(10, 10))) == []
    [(tick, one, other, whose)] = judge.contacts(*drive(10, 5))
    assert (one, other, whose) == (1, 2, 1) and abs(tick - 30) < 0.2, (tick, one, other, whose)


def judge_run(binaries, path, scenario, seed, folder):
    out = pathlib.Path(folder) / "run.jsonl"
    metrics = judge.run(binaries, "verge-sim", path, "--seed", seed, "--out", out)["metrics"]
    lines = judge.read_lines(out)
    yield from judge.run_faults(lines, scenario)
    for tick, one, other, _ in judge.contacts(lines, scenario):
        yield f"{one} and {other} touch at tick {tick}"
    if not metrics["success"] or metrics["fallbacks"] or metrics["collisions"]:
        yield f"success {metrics['success']}, {metrics['fallbacks']} fallbacks, " \
              f"{metrics['collisions']} collisions, reached {metrics['reached_time']}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options, _ = parser.parse_known_args()
    paths = [p for p in sorted(SCENARIOS.glob("*.json"))
             if json.loads(p.read_text())["format"] == "verge-scenario/1"]
    assert len(paths) >= 11
    first = json.loads(paths[0].read_text())
    the_judge_finds_injected_faults(judge.run(options.bin, "verge-plan", paths[0]), first)
    count = plans = 0
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "run.jsonl"
        judge.run(options.bin, "verge-sim", paths[0], "--out", out)
        the_judge_of_runs_finds_injected_faults(judge.read_lines(out), first)
        for path in paths:
            scenario = json.loads(path.read_text())
            faults = []
            for seed in range(1, 1 + 5 * judge.scale()):
                plan = judge.run(options.bin, "verge-plan", path, "--seed", seed)
                faults += [f"verge-plan, seed {seed}: {f}"
                           for f in judge.plan_faults(plan, scenario)]
                plans += 1
            for seed in range(1, 1 + 3 * judge.scale()):
                faults += [f"verge-sim, seed {seed}: {f}"
                           for f in judge_run(options.bin, path, scenario, seed, folder)]
                plans += 1
            for fault in faults[:5]:
                print(f"{path.name}: {fault}", file=sys.stderr)
            count += len(faults)
    print(f"{len(paths)} scenarios, {plans} plans and runs, {count} faults")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
