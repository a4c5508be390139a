"""Claim: verge-plan prints the golden digest of each scenario, and the same bytes twice.

    verge_plan.py BIN_DIR SOURCE_DIR
"""
import json
import pathlib
import subprocess
import sys


def main():
    binary = pathlib.Path(sys.argv[1]) / "verge-plan"
    source = pathlib.Path(sys.argv[2])
    golden = {}
    for line in (source / "tests/golden.txt").read_text().splitlines():
        if not line.startswith("#"):
            name, cycle, digest = line.split()
            if cycle == "0":
                golden[name] = digest
    faults = 0
    for name, digest in golden.items():
        command = [binary, source / f"apps/scenarios/{name}.json", "--no-timing"]
        runs = [subprocess.run(command, capture_output=True, check=False) for _ in range(2)]
        if runs[0].returncode != 0:
            print(f"{name}: exit {runs[0].returncode}: {runs[0].stderr.decode()}", file=sys.stderr)
            faults += 1
            continue
        actual = json.loads(runs[0].stdout)["digest"]
        if actual != digest:
            print(f"{name}: digest {actual}, golden {digest}", file=sys.stderr)
            faults += 1
        if runs[0].stdout != runs[1].stdout:
            print(f"{name}: two runs printed different bytes", file=sys.stderr)
            faults += 1
    print(f"{len(golden)} scenarios planned by verge-plan, {faults} differ")
    return 1 if faults or not golden else 0


sys.exit(main())
