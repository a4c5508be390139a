#!/usr/bin/env python3
"""tools/demo: it runs any scenario from any folder and prints only lines that report a change.

Usage: e2e_demo.py --bin DIR
Exit status 77: skipped, where matplotlib or a private network is missing.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
LINE = re.compile(r" *([\d.]+) s  vehicle (\d+) +cycle \d+ +(\w+(?: \w+)?) +((?:\w\w+ )+) "
                  r"\(.*; lane (\d+), .*")


def demo(binaries, *options, cwd, status=0):
    done = subprocess.run([ROOT / "tools/demo", "--bin", binaries, *options], cwd=cwd, text=True,
                          capture_output=True, timeout=120)
    assert done.returncode == status, f"{options}: exit {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout, done.stderr


def lines_say_something_new(text):
    """No two successive lines of a vehicle have the same action, lane and status."""
    known, count = {}, 0
    for line in text.splitlines():
        found = LINE.match(line)
        if found:
            _, number, status, actions, lane = found.groups()
            told = (status, actions.split()[0], lane)
            assert known.get(number) != told, f"told before: {line}"
            known[number] = told
            count += 1
    assert set(known) == {"0", "2", "3"} and count <= 20, f"{count} lines:\n{text}"


def ends_with_the_result(text, name):
    end = text[text.index("== Result"):]
    assert re.search(r"^success: +(yes|no)$", end, re.MULTILINE), end
    picture, page, run = re.findall(r"^(?:picture|replay|run file): +(.*?)(?: \(.*\))?$", end,
                                    re.MULTILINE)
    for path in (picture, page, run):
        assert pathlib.Path(path).is_file() and pathlib.Path(path).stem == name, path
    assert text.endswith(f"{run}\n"), end
    last = json.loads(pathlib.Path(run).read_text().splitlines()[-1])
    assert ("yes" in end.splitlines()[1]) == last["metrics"]["success"]
    return picture, page, run


def units_drive_alone_while_the_roadside_daemon_is_dead(binaries, cwd):
    text, _ = demo(binaries, "--obu", "--seconds", "11", cwd=cwd)
    for number in (0, 2, 3):
        modes = re.findall(rf"^ +[\d.]+ s  vehicle {number} +mode (\w+)", text, re.MULTILINE)
        at = modes.index("following")
        assert "alone" in modes[at:] and modes[-1] == "following", f"{number}: {modes}\n{text}"
        assert f"on-vehicle unit of vehicle {number}: " in text, text
    assert text.index("Killing the roadside daemon") < text.index("roadside daemon again")
    assert "verge-rsu and each verge-obu ended with status 0" in text, text
    left = [path.parent.name for path in pathlib.Path("/proc").glob("[0-9]*/cmdline")
            if b"out/demo/obu-" in read_quietly(path)]
    assert not left, f"processes {left} are left"


def read_quietly(path):
    try:
        return path.read_bytes()
    except OSError:  # the process has ended
        return b""


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    binaries = os.path.abspath(parser.parse_known_args()[0].bin)
    try:
        import matplotlib  # pylint: disable=unused-import,import-outside-toplevel
    except ImportError:
        print("SKIPPED: python3-matplotlib is missing")
        return 77
    if subprocess.run([ROOT / "tests/support/in_network.sh", "--possible"], check=False).returncode:
        return 77
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder) / "a \"b\""
        place.mkdir()
        name = f"e2e {os.getpid()}"
        scenario = place / f"{name}.json"
        shutil.copy(ROOT / "apps/scenarios/ramp-case1.json", scenario)
        for given, cwd in ((str(scenario), "/"), (f"{place.name}/{name}.json", folder),
                           (f"./{name}.json", place)):
            text, _ = demo(binaries, "--scenario", given, "--seconds", "3", cwd=cwd)
            lines_say_something_new(text)
            made = ends_with_the_result(text, name)
            again = subprocess.run([os.path.join(binaries, "verge-replay"), made[2]], text=True,
                                   capture_output=True, check=False)
            assert again.returncode == 0, again
            for path in made:
                os.unlink(path)
        text, _ = demo(binaries, "--scenario", "ramp-case3", "--seconds", "2", cwd=folder)
        ends_with_the_result(text, "ramp-case3")
        units_drive_alone_while_the_roadside_daemon_is_dead(binaries, folder)
        (place / "none.json").write_text("{}")
        for given in ("nosuch", "none.json", "."):
            text, error = demo(binaries, "--scenario", given, cwd=place, status=2)
            assert text == "" and "expected" in error, error
    print("the demo takes any scenario from anywhere and ends with its result")
    return 0


if __name__ == "__main__":
    sys.exit(main())
