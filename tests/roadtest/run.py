#!/usr/bin/env python3
"""Generates scenes, runs verge-sim on each, judges, prints a table by family.
Exit status: 0 all pass, or, with --known FILE, none fails but the scenes named there; else 1. A scene
that passes although it is named has to leave the list; --strict makes that a failure, too."""
import argparse
import concurrent.futures
import json
import pathlib
import subprocess
import sys
import tempfile

import generate
import judge
import more

TIMEOUT = 300.0


def drive(path, sim):
    """Runs and judges one scene. The run stays only where it failed."""
    run, refusal = path.with_suffix(".jsonl"), path.with_suffix(".err")
    for old in (run, refusal):
        old.unlink(missing_ok=True)
    try:
        done = subprocess.run([sim, path, "--no-timing", "--out", run], capture_output=True, text=True,
                              timeout=TIMEOUT, check=False)
    except subprocess.TimeoutExpired:
        return {"scene": path.stem, "family": path.stem.rpartition("-")[0], "failures": [("run", "took too long")]}
    if done.returncode != 0:
        run.unlink(missing_ok=True)
        refusal.write_text(done.stderr if done.returncode == 2 else f"crashed\nstatus {done.returncode}\n{done.stderr}")
    result = judge.judge_file(path)
    if not result["failures"]:
        run.unlink(missing_ok=True)
    return result


def known_scenes(path):
    return {word for text in path.read_text().splitlines() for word in text.partition("#")[0].split()[:1]}


def write_known(path, results):
    failed = [(r["scene"], ", ".join(sorted({name for name, _ in r["failures"]}))) for r in results if r["failures"]]
    width = max([len(scene) for scene, _ in failed], default=0)
    path.write_text("# Scenes that fail today: name, what fails. A scene that starts to pass has to leave the list.\n"
                    + "".join(f"{scene:{width}}  # {what}\n" for scene, what in failed))


def seeds_of(options, family):
    """Without --seeds: ten of each family that has been there longest, four of the others."""
    return options.seeds or generate.seeds("1-10" if family in generate.FAMILIES else "1-4")


def run_all(description, families, stretch=0.0):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="the folder with verge-sim")
    parser.add_argument("--family", action="append", choices=sorted(families))
    parser.add_argument("--seeds", type=generate.seeds, help="1-10, of the families of more.py 1-4")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--known", type=pathlib.Path, help="scenes that fail today, one a line")
    parser.add_argument("--strict", action="store_true", help="a known failure that passes is a failure")
    parser.add_argument("--write-known", type=pathlib.Path, help="writes the scenes that fail there")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for scenes and failed runs")
    parser.add_argument("--json", type=pathlib.Path, help="writes the results there")
    options = parser.parse_args()
    sim = options.bin / "verge-sim"
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or pathlib.Path(scratch)
        paths = [generate.write(generate.build(family, seed, stretch, families), folder)
                 for family in options.family or families for seed in seeds_of(options, family)]
        results = []
        with concurrent.futures.ProcessPoolExecutor(options.jobs) as pool:
            for result in pool.map(drive, paths, [sim] * len(paths)):
                results.append(result)
                print(judge.line(result), flush=True)
    print("\n" + judge.table(results))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")
    failed = {r["scene"] for r in results if r["failures"]}
    if options.write_known:
        write_known(options.write_known, results)
    if options.known is None:
        return 1 if failed else 0
    known = known_scenes(options.known) & {r["scene"] for r in results}
    for scene in sorted(failed - known):
        print(f"regression: {scene} fails and is not known to")
    for scene in sorted(known - failed):
        print(f"unexpected pass: {scene} passes; take it off {options.known}")
    return 1 if failed - known or (options.strict and known - failed) else 0


if __name__ == "__main__":
    sys.exit(run_all(__doc__, generate.FAMILIES | more.FAMILIES))
