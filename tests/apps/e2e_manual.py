#!/usr/bin/env python3
"""Claim: the manual pages and the completions agree with the programs.

Every program has a page; the options of --help are those of its page, by name and by the name of
their value, in the same order; completion offers each of them. Every fault of the daemon,
every reason of a fallback, every mode of an on-vehicle unit and every reason of a mode stands in
verge(7) with its number. mandoc gives no warning. Every page
that another one names exists.

Usage: e2e_manual.py --bin DIR
"""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PAGES = sorted((ROOT / "apps/man").iterdir())
FOREIGN = {"systemd 1", "systemctl 1", "journalctl 1", "systemd.unit 5", "openssl 1"}


def options_of(program):
    """[(name, value name or "")] as --help lists them."""
    text = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    return re.findall(r"^  --([a-z-]+)(?: ([A-Z][\w.:/|-]*))? +\S", text, re.MULTILINE)


def check_program(program):
    told = options_of(program)
    assert ("help", "") in told and ("version", "") in told, told
    pages = [page for page in PAGES if page.name in (program.name + ".1", program.name + ".8")]
    assert len(pages) == 1, f"{program.name} has {len(pages)} manual pages"
    page = pages[0].read_text()
    written = re.findall(r"^\.It Fl Fl ([a-z-]+)(?: Ar (\S+))?$", page, re.MULTILINE)
    assert written == told, f"{pages[0].name}: {written}, but --help: {told}"
    return told


def complete(program, previous, current):
    script = f'source "$1"; _verge "$2" "$3" "$4"; printf "%s\\n" "${{COMPREPLY[@]}}"'
    done = subprocess.run(
        ["bash", "-c", script, "bash", ROOT / "apps/completion/verge.bash", program, current,
         previous], capture_output=True, text=True, check=True, cwd=ROOT)
    return done.stdout.split()


def check_completion(program, told):
    offered = complete(program, program.name, "--")
    assert offered == ["--" + name for name, _ in told], (program.name, offered)
    for name, kind in told:
        assert complete(program, program.name, "--" + name) or name in offered
        if kind == "LEVEL":
            assert complete(program, "--" + name, "w") == ["warning"]
        elif kind == "DIR":
            assert complete(program, "--" + name, "app") == ["apps"]
        elif kind == "N":
            assert complete(program, "--" + name, "") == []
        elif kind.endswith(".json") or kind == "FILE":
            assert complete(program, "--" + name, "READ") == ["README.md"], (program.name, name)
    usage = subprocess.run([program, "--help"], capture_output=True, text=True,
                           check=True).stdout.split("\n")[0]
    argument = usage.partition("] ")[2]
    if "|" in argument:
        assert complete(program, program.name, "") == argument.split("|")
    elif argument.endswith(".json"):
        assert complete(program, program.name, "READ") == ["README.md"]
    source = (ROOT / "apps/completion/verge.bash").read_text()
    assert re.search(rf"\b{program.name}\b", source.split("complete -o")[1]), program.name


def check_codes(section, source, prefix, least=7):
    """The numbered list of a section of verge(7) is the enum of a header."""
    codes = re.findall(rf"^ +{prefix}(\w+) = (\d+),", (ROOT / source).read_text(), re.MULTILINE)
    codes = [(number, name.lower()) for name, number in codes]
    page = (ROOT / "apps/man/verge.7").read_text().split(f".Sh {section}\n")[1].split(".Sh ")[0]
    told = re.findall(r"^\.It (\d+) , Cm (\w+)$", page, re.MULTILINE)
    assert len(codes) >= least and told in (codes, codes[1:]), \
        f"verge.7, {section}: {told}, but {source}: {codes}"


def check_references():
    existing = {f"{page.stem} {page.suffix[1:]}" for page in PAGES}
    for page in PAGES:
        for name in re.findall(r"^\.Xr (\S+ \d)", page.read_text(), re.MULTILINE):
            assert name in existing | FOREIGN, f"{page.name} names {name}, which is no page of ours"


def check_mandoc():
    if not shutil.which("mandoc"):
        print("mandoc is missing (Debian: mandoc): the pages' form is not checked")
        return
    for page in PAGES:
        done = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", page],
                              capture_output=True, text=True, check=False)
        assert done.returncode == 0 and not done.stdout, done.stdout


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--lcm-python")
    programs = sorted(parser.parse_args().bin.resolve().glob("verge-*"))
    assert len(programs) >= 7, programs
    for program in programs:
        check_completion(program, check_program(program))
    check_codes("FAULTS", "apps/rsu/status.h", "RSU_FAULT_")
    check_codes("FALLBACKS", "core/include/verge/trajectory.h", "VERGE_REASON_")
    check_codes("MODES", "transport/include/verge/wire.h", "WIRE_(?!UNIT_)", 4)
    check_codes("MODE REASONS", "transport/include/verge/wire.h", "WIRE_UNIT_")
    check_references()
    check_mandoc()
    print(f"{len(programs)} programs, {len(PAGES)} pages")


sys.exit(main())
