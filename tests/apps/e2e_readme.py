#!/usr/bin/env python3
"""Claim: the commands in README.md give the output shown there.

Runs each command of a console block that starts with build/ or grep, and compares its output with the
lines below the command. A line with only … stands for any lines. Commands that build, install or
run in real time are not run.

Usage: e2e_readme.py --bin DIR
"""
import argparse
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def sessions():
    """[(command, expected lines)] of all console blocks."""
    text = (ROOT / "README.md").read_text()
    for block in re.findall(r"^```console\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, *lines = part.splitlines()
            yield command.partition(" #")[0].strip(), lines


def agrees(expected, printed):
    pattern = "".join(r"(?:.*\n)*" if line.strip() == "…" else re.escape(line) + "\n"
                      for line in expected)
    return re.fullmatch(pattern, printed) is not None


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    build = parser.parse_known_args()[0].bin.resolve().parent
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        (place / "apps").symlink_to(ROOT / "apps")
        (place / "build").symlink_to(build)
        for command, expected in sessions():
            if not command.startswith(("build/", "grep ")):
                continue
            done = subprocess.run(shlex.split(command), cwd=place, capture_output=True, text=True,
                                  check=True)
            assert agrees(expected, done.stdout), f"{command} prints:\n{done.stdout}"
            count += 1
    assert count >= 4, f"only {count} commands were run"
    print(f"{count} commands of README.md print what it says")


sys.exit(main())
