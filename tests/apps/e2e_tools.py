#!/usr/bin/env python3
"""The Python tools: unusable input gives one line on standard error and exit status 2.

Every tool gets a missing file, an empty one, a folder, a FIFO, bytes that are not text, JSON of
another kind, a run that was cut off, and wrong arguments. No tool may end in a traceback, hang, or
leave a file behind.
Usage: e2e_tools.py --bin DIR
"""
import argparse
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TOOLS = ROOT / "tools"
SCENARIO = ROOT / "apps/scenarios/ramp-case1.json"


def run(tool, *arguments):
    # From a folder of their own: a tool finds its files by itself.
    return subprocess.run([sys.executable, TOOLS / tool, *map(str, arguments)], text=True,
                          capture_output=True, timeout=120, cwd="/")


def refused(tool, *arguments):
    done = run(tool, *arguments)
    told = f"{tool} {' '.join(map(str, arguments))}: exit {done.returncode}: {done.stderr!r}"
    assert done.returncode == 2 and done.stdout == "", told
    assert re.fullmatch(r"[^\n]+:[^\n]+: [^\n]+, expected [^\n]+\n", done.stderr) or \
        re.fullmatch(r"[^\n]+:[^\n]+: expected [^\n]+\n", done.stderr), told
    return done.stderr


def bad_files(folder, run_text):
    """Files that are no run, no scenario and no result."""
    files = {"missing": None, "empty": b"", "blank": b"\n \n", "object": b'{"a": 1}', "list": b"[1]",
             "number": b"7", "text": b"hello\n", "garbage": random.Random(1).randbytes(4000),
             "deep": b"[" * 100000,
             "no-scenario": b'{"format": "verge-run/1"}\n',
             "wrong-scenario": b'{"format": "verge-run/1", "scenario": 3}\n',
             "cut-head": run_text[:1000].encode()}
    paths = []
    for name, data in files.items():
        paths.append(folder / name)
        if data is not None:
            paths[-1].write_bytes(data)
    paths += [folder / "folder", folder / "fifo"]
    paths[-2].mkdir()
    os.mkfifo(paths[-1])
    return paths


def files_that_are_not_runs_are_refused(folder, bad):
    for tool, end in (("plot.py", "png"), ("replay_html.py", "html")):
        out = folder / f"out.{end}"
        for path in bad:
            assert str(path) in refused(tool, path, out), path
            assert not out.exists()
        for wrong in ([], [SCENARIO], [SCENARIO, out, out], ["--what", SCENARIO]):
            refused(tool, *wrong)


def damaged_runs_are_refused_by_their_line(folder, run_text):
    lines = run_text.splitlines()
    tick = next(i for i, line in enumerate(lines) if '"vehicles":[[' in line)
    row = json.loads(lines[tick])
    damages = {"short-row": {**row, "vehicles": [row["vehicles"][0][:7]]},
               "stranger": {**row, "vehicles": [[77, *row["vehicles"][0][1:]]]},
               "text": {**row, "vehicles": [[*row["vehicles"][0][:1], "x",
                                             *row["vehicles"][0][2:]]]},
               "no-time": {"vehicles": row["vehicles"]}, "no-rows": {**row, "vehicles": 5},
               "plan": {"t": 0.0, "plan": {"vehicles": [{"id": 0}]}},
               "unit": {"t": 0.0, "unit": {"id": 77, "mode": "alone"}},
               "mode": {"t": 0.0, "unit": {"id": 0, "mode": "asleep", "reason": "none",
                                           "vehicle": None, "cycle": None}}}
    for name, damage in damages.items():
        path = folder / f"damaged-{name}"
        path.write_text("\n".join([*lines[:tick], json.dumps(damage), *lines[tick + 1:]]))
        for tool, end in (("plot.py", "png"), ("replay_html.py", "html")):
            told = refused(tool, path, folder / f"damaged.{end}")
            assert f"{path}:{tick + 1}:" in told, told


def a_run_cut_off_is_shown_as_far_as_it_goes(folder, run_text):
    path = folder / "cut.jsonl"
    for size in (len(run_text) // 10, len(run_text) - 30):
        path.write_text(run_text[:size])
        for tool, end in (("plot.py", "png"), ("replay_html.py", "html")):
            out = folder / f"cut.{end}"
            done = run(tool, path, out)
            assert done.returncode == 0 and out.stat().st_size > 1000, done.stderr
            assert "cut off" in done.stderr and done.stderr.count("\n") == 1, done.stderr


def instants_are_drawn_and_others_refused(folder, good):
    out = folder / "instants.png"
    for arguments in ([good, out, "--at"], ["--at", "", good, out], ["--at", "x", good, out],
                      ["--at", "1,,2", good, out], ["--at", "nan", good, out],
                      ["--at", "-1", good, out], ["--at", "0,1000", good, out],
                      ["--at", ",".join("1" * 13), good, out], ["--at", "0", good]):
        refused("plot.py", *arguments)
        assert not out.exists(), arguments
    sizes = []
    for given in ("1", "1,1,1", "1,1,1,1,1"):
        done = run("plot.py", "--at", given, good, out)
        assert done.returncode == 0 and done.stderr == "", done
        png = out.read_bytes()
        sizes.append(int.from_bytes(png[20:24], "big"))  # the height, of the PNG's header
    assert sizes[0] < sizes[1] < sizes[2], f"a panel for each instant: heights {sizes}"


def modes_of_on_vehicle_units_are_drawn(folder, run_text):
    """A band of its colour for each mode that occurs, and none without units."""
    modes = {"following": (0x1F, 0x7A, 0x6B), "departing": (0xE8, 0x71, 0x0A),
             "alone": (0x6A, 0x3D, 0x9A), "stopping": (0xC8, 0x10, 0x2E),
             "none": (0x26, 0x26, 0x2B)}
    run_file, out = folder / "modes.jsonl", folder / "modes.png"
    for count in (0, 2, 5):
        lines = [json.dumps({"t": 1.0 + 2.0 * k, "unit": {
            "id": 2, "mode": mode, "reason": "none", "vehicle": None, "cycle": None}})
            for k, mode in enumerate(list(modes)[:count])]
        run_file.write_text(run_text + "\n".join(lines) + "\n")
        done = run("plot.py", run_file, out)
        assert done.returncode == 0 and done.stderr == "", done
        pixels = (matplotlib.image.imread(out)[..., :3] * 255.0).round()
        drawn = [mode for mode, color in modes.items()
                 if (pixels == color).all(axis=-1).sum() > 1000]
        assert drawn == list(modes)[:count], f"{count} modes: {drawn}"


def help_and_version_are_printed(folder):
    del folder
    for tool in ("plot.py", "replay_html.py"):
        version = run(tool, "--version")
        assert version.returncode == 0 and re.fullmatch(rf"{tool} [0-9.]+\n", version.stdout)
        told = run(tool, "--help")
        assert told.returncode == 0 and f"{tool} [options] RUN.jsonl OUT." in told.stdout, told


def other_tools_refuse_what_they_cannot_use(folder, bad):
    for path in bad:
        if path.name not in ("object", "no-scenario"):
            told = run("scenario_to_c.py", path)
            assert "Traceback" not in told.stderr and told.stderr.count("\n") <= 1, told
            assert told.returncode == (0 if path.name in ("list", "number", "wrong-scenario") else 2)
    broken = folder / "broken.json"
    broken.write_text('{"format": "verge-scenario/1", "road": {"lanes": [{"id": 0}]}}')
    done = run("scenario_to_c.py", broken)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done
    refused("scenario_to_c.py")
    for path in bad:
        results = folder / "results" / path.name
        results.mkdir(parents=True)
        refused("experiment_plots.py", results)
        if path.is_file():
            (results / "beyond.json").write_bytes(path.read_bytes())
            refused("experiment_plots.py", results)
        assert sorted(p.name for p in results.iterdir()) == (["beyond.json"] if path.is_file()
                                                            else [])
    (results / "beyond.json").write_text('{"rows": [{"a": 1}]}')
    refused("experiment_plots.py", results)
    refused("experiment_plots.py", folder / "nowhere")
    assert not (folder / "nowhere").exists()
    refused("latency", folder)
    refused("documents", folder)
    refused("documents")
    refused("messages", "--help")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options, _ = parser.parse_known_args()
    try:
        global matplotlib  # pylint: disable=global-statement
        import matplotlib.image  # pylint: disable=import-outside-toplevel
    except ImportError:
        print("SKIPPED: python3-matplotlib is missing")
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        good = folder / "good.jsonl"
        subprocess.run([os.path.join(options.bin, "verge-sim"), SCENARIO, "--no-timing", "--out",
                        good], check=True, stdout=subprocess.DEVNULL)
        text = good.read_text()
        bad = bad_files(folder, text)
        files_that_are_not_runs_are_refused(folder, bad)
        damaged_runs_are_refused_by_their_line(folder, text)
        a_run_cut_off_is_shown_as_far_as_it_goes(folder, text)
        instants_are_drawn_and_others_refused(folder, good)
        modes_of_on_vehicle_units_are_drawn(folder, text)
        help_and_version_are_printed(folder)
        other_tools_refuse_what_they_cannot_use(folder, bad)
    print("the tools tell in one line what they cannot use")
    return 0


if __name__ == "__main__":
    sys.exit(main())
