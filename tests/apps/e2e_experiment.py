#!/usr/bin/env python3
"""verge-experiment: its rows, exit codes and bytes, and gates on its results.

The gates limit successes, clearances and X_flow with fixed seeds, never times.
--slow is for a build with sanitizers, which is about twenty times slower: it runs one scene of each
kind instead of the gates, whose plans are the same bits in every build (tests/determinism).
Usage: e2e_experiment.py --bin DIR [--slow] [--lcm-python DIR]
"""
import argparse
import glob
import json
import math
import os
import re
import signal
import subprocess
import tempfile
import time

from e2e_cli import check_numbers

TABLE = ["setting", "controlled", "method", "repeats", "success", "nodes", "finish_time",
         "min_center_gap", "min_distance"]


def run(program, *arguments, status=0):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=280)
    assert done.returncode == status, \
        f"{arguments}: exit {done.returncode}, expected {status}: {done.stderr}"
    if status == 2:
        assert re.fullmatch(r"[^\n]+:[^\n]+: [^\n]+\n", done.stderr), repr(done.stderr)
        assert done.stdout == "", "a table beside an error"
    else:
        assert done.stderr == "", done.stderr  # no progress where there is no terminal
    return done


def rows_of(program, folder, name, repeats, *more):
    path = os.path.join(folder, f"{name}-rows.json")
    run(program, "--only", name, "--repeats", str(repeats), "--out", folder, "--json", path, *more)
    for written in glob.glob(os.path.join(folder, "*.json")):
        with open(written, encoding="utf-8") as file:
            check_numbers(file.read())
    with open(path, encoding="utf-8") as file:
        document = json.load(file)
    with open(os.path.join(folder, f"{name}.json"), encoding="utf-8") as file:
        assert json.load(file) == document, "--json differs from the folder's file"
    assert document["experiment"] == name
    return document["rows"]


def check_bad_input(program, folder):
    blocked = os.path.join(folder, "blocked")
    with open(blocked, "w", encoding="utf-8"):
        pass
    for arguments in (["--only", "nothing"], ["--repeats", "0"], ["--repeats", "x"],
                      ["--seed", "-1"], ["--out", os.path.join(blocked, "below")],
                      ["--json", os.path.join(blocked, "f.json"), "--out", folder], ["--no-such"]):
        run(program, *arguments, status=2)
    listed = run(program, "--list").stdout.split("\n")
    assert any(line.startswith("freeway-table ") for line in listed), listed


def check_interrupt(program, folder, repeats=3):
    """What had finished is whole; the one under way has left no rows; nothing half-written."""
    out = os.path.join(folder, "interrupted")
    process = subprocess.Popen([program, "--repeats", str(repeats), "--out", out], text=True,
                               stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    limit = time.monotonic() + 240
    while not os.path.exists(os.path.join(out, "freeway-table.json")):
        assert time.monotonic() < limit and process.poll() is None, "it ended too early"
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 1 and "interrupted" in errors, (process.returncode, errors)
    for name in os.listdir(out):
        assert name.endswith((".json", ".md", ".jsonl")), f"left behind: {name}"
        if name.endswith(".json"):
            with open(os.path.join(out, name), encoding="utf-8") as file:
                assert json.load(file)["rows"]


def check_same_bytes(program, folder):
    """The same rows on one processor as on all."""
    everywhere = rows_of(program, os.path.join(folder, "all"), "freeway-table", 2)
    os.makedirs(os.path.join(folder, "one"), exist_ok=True)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        alone = rows_of(program, os.path.join(folder, "one"), "freeway-table", 2)
    finally:
        os.sched_setaffinity(0, before)
    assert everywhere == alone
    for name in os.listdir(os.path.join(folder, "one")):
        if name.endswith(".jsonl"):
            with open(os.path.join(folder, "one", name), "rb") as a, \
                    open(os.path.join(folder, "all", name), "rb") as b:
                assert a.read() == b.read(), name


def gate_table(program, folder):
    rows = rows_of(program, folder, "freeway-table", 10)
    for row in rows:
        assert all(key in row for key in TABLE), sorted(row)
    assert {(r["setting"], r["controlled"], r["method"]) for r in rows} == {
        (s, n, m) for s in ("as-stated", "as-run") for n in (2, 3, 4)
        for m in ("verge", "decision-only", "sequential")}
    for row in rows:
        if row["method"] == "verge":
            assert row["success"] == 1.0, row
            assert row["min_distance_worst"] >= 1.0, row  # bodies never closer than 1 m


def gate_quality(program, folder):
    """The default search against its bound, and its arrivals against those of the paper's search."""
    rows = rows_of(program, folder, "beyond", 3, "--scenes")
    kinds = {(r["scenes"], r["controlled"], r["humans"]) for r in rows}
    lead, below, success = [], [], []
    for kind in sorted(kinds):
        mine, paper = ({r["method"]: r for r in rows
                        if (r["scenes"], r["controlled"], r["humans"]) == kind}[method]
                       for method in ("verge", "verge, search: paper"))
        assert mine["reward"] <= mine["bound"], mine
        below.append(mine["below_bound"])
        assert mine["collisions"] == 0, mine
        success.append(mine["success"])
        if kind[0] != "freeway" and kind[1] == 8:
            # Each search has a reward of its own, so what counts is when vehicles arrive. [s]
            lead.append(paper["finish_time"] - mine["finish_time"])
    assert sum(lead) / len(lead) >= 1.0, lead
    # The bound drives each vehicle alone. What others cost has a large part in the reward by time: of
    # the vehicles ahead in the path each counts that is slower.
    assert sum(below) / len(below) <= 0.28, below
    assert sum(success) / len(success) >= 0.85, success  # of 200 scenes each: RESULTS.md


def gate_regret(program, folder):
    """The first decision in dense traffic: without a conflict, near the best known, below the bound."""
    rows = rows_of(program, folder, "regret", 2)
    mean = lambda budget: sum(r["regret"] for r in rows if r["iterations"] == budget) / len(rows)
    assert mean(300) > mean(3000) >= mean(10000), rows
    for row in rows:
        assert row["bound_above_best"] >= 0.0, row
        if row["iterations"] >= 3000:
            assert row["with_a_conflict"] == 0 and row["regret"] <= 0.02, row


def sign_test(more, less):
    """Chance of so many more out of the pairs that differ, if neither way were likelier."""
    pairs = int(more + less)
    return sum(math.comb(pairs, k) for k in range(int(more), pairs + 1)) / 2 ** pairs


def gate_yielding(program, folder):
    """A more cooperative vehicle yields more often, in paired scenes."""
    rows = [r for r in rows_of(program, folder, "diversity", 60) if "cooperation" in r]
    share = {r["cooperation"]: r["yields"] for r in rows}
    low, middle, high = ((share[a] + share[b]) / 2 for a, b in ((0, 0.1), (0.25, 0.5), (0.9, 1)))
    assert low <= middle <= high, share
    for row in rows:
        if row["cooperation"] >= 0.9:
            assert sign_test(row["only_now"], row["only_at_0"]) < 0.01, row
    assert all(r["success"] >= 0.95 for r in rows), rows


def gate_cases(program, folder):
    rows = rows_of(program, folder, "ramp-cases", 12)
    orders = [r for r in rows if "2_ahead_of_4" in r]
    assert len(orders) == 14
    for row in orders:
        assert row["success"] >= 0.9, row
        if (row["habits"], row["state"]) in (("case 1", 0), ("case 2", 1)): # the authors' own
            assert row["success"] == 1.0, row
    # From the authors' state of case 2, the order of the vehicles depends on which of them is
    # aggressive. The rewards of the two orders are nearly equal, so not every search finds the
    # better one.
    ahead = {r["habits"]: r["2_ahead_of_4"] for r in orders if r["state"] == 1}
    assert ahead["case 1"] >= 0.6 and ahead["case 2"] <= 0.25, ahead
    human = {r["case"]: r for r in rows if "case" in r}
    speeds_up, keeps = human["case 3, speeds up at 1 s"], human["case 3, keeps 6 m/s"]
    for row in human.values():
        assert row["collisions"] == 0, row
        # Not all arrive within 20 s where the human speeds up beside the vehicle: 5 of 12 seeds do.
        assert row["success"] >= (0.3 if row is speeds_up else 1.0), row
    assert speeds_up["2_puts_off"] == 1.0 and speeds_up["latest_after"] <= 0.5, speeds_up
    assert speeds_up["2_in_lane"] > keeps["2_in_lane"] + 1.5, (speeds_up, keeps)
    for row in rows_of(program, folder, "roundabout", 3):
        assert row["success"] == 1.0 and row["longest_halt"] < 5.0, row


def check_interrupt_soon(program, folder):
    """The interrupt, and the rows of the experiment that had finished before it."""
    check_interrupt(program, folder, repeats=1)
    with open(os.path.join(folder, "interrupted", "freeway-table.json"), encoding="utf-8") as file:
        for row in json.load(file)["rows"]:
            assert all(key in row for key in TABLE), sorted(row)
            assert row["method"] != "verge" or row["success"] == 1.0, row


def check_one_of_each(program, folder):
    """One scene of each kind of two more experiments."""
    for name in ("roundabout", "diversity"):
        assert rows_of(program, folder, name, 1), name


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--slow", action="store_true", help="one scene of each kind, no gates")
    parser.add_argument("--lcm-python", help="not used")
    options = parser.parse_args()
    program = os.path.join(options.bin, "verge-experiment")
    checks = (check_bad_input, check_interrupt, check_same_bytes, gate_table, gate_quality,
              gate_regret, gate_yielding, gate_cases)
    if options.slow:
        checks = (check_bad_input, check_interrupt_soon, check_one_of_each)
    with tempfile.TemporaryDirectory() as folder:
        for check in checks:
            start = time.monotonic()
            check(program, folder)
            print(f"{check.__name__}: {time.monotonic() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
