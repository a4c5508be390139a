#!/usr/bin/env python3
"""verge-plan, verge-sim, verge-replay and verge-bench: their documents, exit codes and bytes.

Parses and checks the output of the programs with Python's own json and mathematics.
Usage: e2e_cli.py --bin DIR [--scenarios DIR]
"""
import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
COLUMNS = ["t", "x", "y", "heading", "speed", "acceleration", "curvature", "jerk"]
METRICS = ["success", "collisions", "finish_time", "reached_time", "min_distance",
           "min_center_gap", "min_ttc", "max_abs_acceleration", "max_abs_jerk",
           "max_abs_curvature", "fallbacks", "nodes_mean", "reordered", "unstuck"]


def run(program, *arguments, status=0):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=300)
    assert done.returncode == status, \
        f"{program} {arguments}: exit {done.returncode}, expected {status}: {done.stderr}"
    if status == 2:
        assert re.fullmatch(r"[^\n]+:[^\n]+: [^\n]+\n", done.stderr), repr(done.stderr)
        assert done.stdout == "", "half a document beside an error"
    return done.stdout


def check_numbers(text):
    """Every number of a document is written with the fewest digits that read back the same."""
    def digits(number):
        return number.lstrip("-").split("e")[0].replace(".", "").strip("0")
    plain = re.sub(r'"(?:[^"\\]|\\.)*"', '""', text)
    for number in set(re.findall(r"-?\d[-+.0-9eE]*", plain)):
        assert digits(number) == digits(repr(float(number))), f"{number} has digits too many"
        assert number != "-0", "minus zero"


def corners(x, y, heading, length, width):
    c, s = math.cos(heading), math.sin(heading)
    return [(x + a * c - b * s, y + a * s + b * c)
            for a, b in ((length / 2, width / 2), (-length / 2, width / 2),
                         (-length / 2, -width / 2), (length / 2, -width / 2))]


def overlap(one, other, slack=1e-9):
    """Separating axes of two rectangles given by their corners."""
    for a, b in ((one, other), (other, one)):
        for i in range(2):
            ax, ay = a[i + 1][0] - a[i][0], a[i + 1][1] - a[i][1]
            p = [x * ax + y * ay for x, y in a]
            q = [x * ax + y * ay for x, y in b]
            if max(p) <= min(q) + slack or max(q) <= min(p) + slack:
                return False
    return True


def check_plan(plan, scenario):
    assert plan["format"] == "verge-plan/1" and plan["scenario"] == scenario["name"]
    assert re.fullmatch("[0-9a-f]{16}", plan["digest"])
    size = {v["id"]: (v["length"], v["width"]) for v in scenario["vehicles"]}
    bodies = {}
    for vehicle in plan["vehicles"]:
        assert vehicle["status"] in ("planned", "fallback")
        assert vehicle["status"] == "planned" or len(vehicle["reason"]) > 10
        actions, trajectory = vehicle["actions"], vehicle["trajectory"]
        assert actions and trajectory["columns"] == COLUMNS
        for before, after in zip(actions, actions[1:]):
            assert abs(before["t1"] - after["t0"]) < 1e-9, "a hole in the action sequence"
        for action in actions:
            assert action["action"] in ("KS", "AC", "DC", "LCL", "LCR")
            assert action["turn_signal"] in ("left", "none", "right") and action["say"]
        why = vehicle["why"]
        assert why is None or (set(why) == {"code", "text", "vehicle", "area"} and why["text"]), why
        stands = any(point[4] < 0.3 for point in vehicle["trajectory"]["points"][:10])
        assert why is not None or not stands, f"vehicle {vehicle['id']} stands without a reason"
        assert all(set(one) == {"area", "after"} and one["after"] != vehicle["id"]
                   for one in vehicle["passes"]) and len(vehicle["passes"]) <= 4
        assert set(vehicle["changed"]) <= {"first", "status", "action", "why", "order"}
        for k, point in enumerate(trajectory["points"]):
            assert len(point) == 8 and all(isinstance(p, (int, float)) for p in point), point
            assert abs(point[0] - k * trajectory["dt"]) < 1e-9
        total = sum(v for k, v in vehicle["cost"].items() if k != "total")
        assert abs(total - vehicle["cost"]["total"]) <= 1e-6 * max(1.0, abs(total))
        bodies[vehicle["id"]] = [p[1:4] for p in trajectory["points"]]
    for prediction in plan["predictions"]:
        assert prediction["id"] not in bodies
        bodies[prediction["id"]] = [p[1:4] for p in prediction["points"]]
        likely = prediction["hypotheses"]
        assert set(likely) == {"keeps_on", "speeds_up", "yields", "insists", "changes_lane"}, likely
        assert all(p >= 0.0 for p in likely.values()) and abs(sum(likely.values()) - 1.0) < 1e-5
    fallback = {v["id"] for v in plan["vehicles"] if v["status"] == "fallback"}
    planned = [v["id"] for v in plan["vehicles"]]
    for one in planned:
        for other in bodies:
            if one == other or fallback & {one, other}:
                continue
            for k, (a, b) in enumerate(zip(bodies[one], bodies[other])):
                assert not overlap(corners(*a, *size[one]), corners(*b, *size[other])), \
                    f"{one} and {other} overlap at point {k}"


def check_start(plan, scenario):
    controlled = {v["id"]: v for v in scenario["vehicles"] if v["control"] == "controlled"}
    assert sorted(controlled) == sorted(v["id"] for v in plan["vehicles"])
    for vehicle in plan["vehicles"]:
        first, start = vehicle["trajectory"]["points"][0], controlled[vehicle["id"]]
        for column, name in ((1, "x"), (2, "y"), (3, "heading"), (4, "speed"), (5, "acceleration")):
            assert first[column] == start[name], (vehicle["id"], name, first[column], start[name])


def check_run(path, scenario, printed):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    check_numbers(text)
    lines = [json.loads(line) for line in text.splitlines()]
    head, last = lines[0], lines[-1]
    assert head["format"] == "verge-run/1" and head["dt"] == 0.1
    assert head["scenario"]["road"] == scenario["road"]
    assert "iterations" in head["scenario"]["planner"] and "seed" in head["scenario"]["planner"]
    assert last["metrics"] == printed
    plans, plan_time, ticks = {}, 0.0, 0
    for line in lines[1:-1]:
        if "plan" in line:
            check_plan(line["plan"], scenario)
            plans = {v["id"]: v for v in line["plan"]["vehicles"]}
            plan_time = line["t"]
            continue
        assert abs(line["t"] - ticks * 0.1) < 1e-9
        for row in line["vehicles"]:
            assert len(row) == 10 and row[7] in ("KS", "AC", "DC", "LCL", "LCR", None)
            index = round((line["t"] - plan_time) * 10)
            if row[0] in plans and index > 0:
                assert row[1:6] == plans[row[0]]["trajectory"]["points"][index][1:6], \
                    f"vehicle {row[0]} is not on its trajectory at {line['t']}"
        ticks += 1
    assert ticks == round(scenario["simulation"]["duration"] * 10) + 1


def check_replay(program, path, folder, seed):
    """The recorded seed replays, another does not; both say the same when asked again."""
    assert "every digest is the same" in run(program, path)
    assert run(program, path, "--seed", str(seed)) == run(program, path)
    # Some seeds find the very same plans.
    differs = next(k for k in range(seed + 1, seed + 20) if subprocess.run(
        [program, path, "--seed", str(k)], capture_output=True, check=False).returncode == 1)
    other = run(program, path, "--seed", str(differs), status=1)
    assert "is the first that differs" in other
    assert other == run(program, path, f"--seed={differs}", status=1)
    run(program, path, "--seed", "-1", status=2)
    run(program, os.path.join(folder, "none.jsonl"), status=2)
    run(program, path, "--config", path, status=2)  # a run of verge-sim has its own
    run(program, __file__, status=2)  # neither a run nor a log
    with open(path, encoding="utf-8") as file:
        text = file.read()
    cut = os.path.join(folder, "cut.jsonl")
    with open(cut, "w", encoding="utf-8") as file:
        file.write(text[:len(text) // 2])
    assert re.search(r"[1-9]\d* cycles, every digest", run(program, cut)), "up to where it was cut"
    os.unlink(cut)


def check_replay_with_signals(folder, path, programs):
    """A replay plans with the signals of the run; here every lane turns from green to red."""
    with open(path, encoding="utf-8") as file:
        scenario = json.load(file)
    lit = os.path.join(folder, "lit.json")
    phases = [{"state": "green", "seconds": 1.2}, {"state": "red", "seconds": 9}]
    signals = [{"lane": lane["id"], "start": -0.5, "phases": phases}
               for lane in scenario["road"]["lanes"]]
    with open(lit, "w", encoding="utf-8") as file:
        json.dump(scenario | {"signals": signals}, file)
    recorded = os.path.join(folder, "lit.jsonl")
    run(programs["sim"], lit, "--no-timing", "--out", recorded)
    with open(recorded, encoding="utf-8") as file:
        assert '"code":"signal"' in file.read(), "a vehicle waits for a signal"
    assert "every digest is the same" in run(programs["replay"], recorded)
    os.unlink(lit)
    os.unlink(recorded)


def check_standard_output(folder, commands):
    """Where it cannot be written: status 1 and a line that says so."""
    for command in commands:
        for output in ("/dev/full", None):
            with open(output or os.devnull, "wb") as out:
                done = subprocess.run(
                    command, stdout=out, stderr=subprocess.PIPE, text=True, check=False,
                    cwd=folder, preexec_fn=None if output else lambda: os.close(1))
            assert done.returncode == 1 and re.fullmatch(
                r"verge-\w+:standard output: cannot be written \(.*\), expected .*\n",
                done.stderr), f"{command}: {done.returncode} {done.stderr!r}"


def untimed(document):
    """A benchmark document without what a clock or the build decides."""
    timed = ("machine", "build", "iterations_per_s", "candidates_per_s", "ms_p50", "ms_p99",
             "ms_max")
    return {key: [{k: v for k, v in row.items() if k not in timed} for row in value]
            for key, value in document.items() if key in ("search", "sampler", "cycle")}


def check_bench(program):
    texts = [run(program, "--quick", *seed) for seed in ([], ["--seed", "1"], ["--seed=2"])]
    check_numbers(texts[0])
    plain, same, other = map(json.loads, texts)
    assert plain["format"] == "verge-bench/1"
    assert untimed(plain) == untimed(same), "the default seed of scenes and searches is 1"
    rewards = [[row["reward"] for row in document["search"]] for document in (plain, other)]
    assert all(a != b for a, b in zip(*rewards)), f"another seed, the same scenes: {rewards}"
    run(program, "--quick", "--seed", "one", status=2)


def check_standing_vehicles(folder, sim_program):
    """A ring so full of standing vehicles that all wait for one another: counted as a circle."""
    def at(angle):
        return [8.1 * math.cos(angle), 8.1 * math.sin(angle)]
    lanes = [{"id": half, "centerline": [at(math.pi * (half + k / 16)) for k in range(17)],
              "width": 3.5, "speed_limit": 8, "successors": [1 - half]} for half in (0, 1)]
    vehicles = []
    for number in range(4):  # as many as a small configuration takes
        angle = math.tau * (number + 0.25) / 4
        x, y = at(angle)
        vehicles.append({"id": number, "control": "controlled", "x": x, "y": y, "speed": 0,
                         "heading": math.remainder(angle + math.pi / 2, math.tau),
                         "acceleration": 0, "length": 11, "width": 2})
    path = os.path.join(folder, "ring.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"format": "verge-scenario/1", "name": "ring", "road": {"lanes": lanes},
                   "vehicles": vehicles, "simulation": {"duration": 4}}, file)
    metrics = json.loads(run(sim_program, path))["metrics"]
    assert metrics["reordered"] > 0, metrics
    os.remove(path)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--scenarios", default=os.path.join(HERE, "../../apps/scenarios"))
    # Options of the other end-to-end tests are none of ours.
    options, _ = parser.parse_known_args()
    plan_program = os.path.join(options.bin, "verge-plan")
    sim_program = os.path.join(options.bin, "verge-sim")
    names = sorted(n for n in os.listdir(options.scenarios)
                   if n.startswith(("freeway", "ramp", "roundabout")) and n.endswith(".json"))
    assert len(names) >= 8
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            path = os.path.join(options.scenarios, name)
            with open(path, encoding="utf-8") as file:
                scenario = json.load(file)
            text = run(plan_program, path)
            assert text == run(plan_program, path), "two runs, two documents"
            check_plan(json.loads(text), scenario)
            check_start(json.loads(text), scenario)
            check_numbers(text)
        path = os.path.join(options.scenarios, "ramp-case1.json")
        with open(path, encoding="utf-8") as file:
            scenario = json.load(file)
        runs = [os.path.join(folder, n) for n in ("a.jsonl", "b.jsonl")]
        outputs = [run(sim_program, path, "--no-timing", "--out", r) for r in runs]
        assert outputs[0] == outputs[1]
        check_numbers(outputs[0])
        with open(runs[0], "rb") as a, open(runs[1], "rb") as b:
            assert a.read() == b.read(), "two runs, two run files"
        printed = json.loads(outputs[0])["metrics"]
        assert set(METRICS) <= set(printed) and "cycle_ms" not in printed
        check_run(runs[0], scenario, printed)
        check_replay(os.path.join(options.bin, "verge-replay"), runs[0], folder,
                     scenario["planner"].get("seed", 1))
        check_replay_with_signals(folder, os.path.join(options.scenarios, "roundabout.json"), {
            name: os.path.join(options.bin, f"verge-{name}") for name in ("sim", "replay")})
        check_standing_vehicles(folder, sim_program)
        check_bench(os.path.join(options.bin, "verge-bench"))
        scene = os.path.abspath(path)
        programs = [os.path.abspath(os.path.join(options.bin, f"verge-{name}"))
                    for name in ("plan", "sim", "replay", "bench", "publish", "experiment")]
        check_standard_output(folder, [[programs[0], scene], [programs[1], scene],
                                       [programs[2], runs[0]], [programs[3], "--quick"]] +
                              [[p, o] for p in programs for o in ("--help", "--version")])
        timed = json.loads(run(sim_program, path))["metrics"]
        assert set(timed.pop("cycle_ms")) == {"p50", "p99", "max"} and timed == printed
        assert run(plan_program, path, "--seed", "99") == run(plan_program, path, "--seed=99")
        broken = os.path.join(folder, "broken.json")
        with open(broken, "w", encoding="utf-8") as file:
            file.write('{ "format": "verge-scenario/1", ')
        for program in (plan_program, sim_program):
            assert run(program, "--version").startswith("verge-")
            assert "usage" in run(program, "--help")
            for wrong in ([], ["--nonsense", path], [path, path], [broken], ["--seed", "x", path],
                          [os.path.join(folder, "none.json")]):
                run(program, *wrong, status=2)
        run(sim_program, broken, "--out", os.path.join(folder, "c.jsonl"), status=2)
        run(sim_program, path, "--out", os.path.join(folder, "no/folder"), status=2)
        run(os.path.join(options.bin, "verge-bench"), "--quick", "--scenarios", folder, status=2)
        left = sorted(os.listdir(folder))
        assert left == ["a.jsonl", "b.jsonl", "broken.json"], f"left behind: {left}"
    print(f"{len(names)} scenarios, plan documents, run files, exit codes: as documented")
    return 0


if __name__ == "__main__":
    sys.exit(main())
