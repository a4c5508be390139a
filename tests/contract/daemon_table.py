"""Does every test that daemon.md names exist?

    python3 tests/contract/daemon_table.py SOURCE_FOLDER
"""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])
rows = [line.split("|")[1:3] for line in (source / "tests/contract/daemon.md").read_text().splitlines()
        if line.startswith("| ") and "shown by" not in line]
missing, named = [], 0
for promise, tests in rows:
    for part in re.split("[;,]", tests):
        name, _, case = (word.strip() for word in part.partition(":"))
        files = list((source / "tests").rglob(name))
        named += 1
        if len(files) != 1:
            missing.append(f"{promise.strip()}: no file {name}")
        elif case and not re.search(rf"\b{case}\b", files[0].read_text()):
            missing.append(f"{promise.strip()}: {name} has no {case}")
for line in missing:
    print(line, file=sys.stderr)
print(f"{len(rows)} promises, {named} tests named, {len(missing)} of them missing")
sys.exit(1 if missing or len(rows) < 20 else 0)
