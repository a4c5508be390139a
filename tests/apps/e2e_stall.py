"""Nothing that does not answer stops the daemon: files that never end, readers that do not read.

    python3 tests/apps/e2e_stall.py --bin build/bin [--only NAME]

Every case is a function named like its claim. The bus is loop:, which needs no network.
"""
import json
import os
import signal
import subprocess
import sys

from daemon_rig import ROAD, Daemon, case_arguments, check, run_cases, wait_for


def ctl(rig, *args):
    """verge-ctl's exit code, standard output and standard error."""
    return rig.run(rig.bin / "verge-ctl", "--socket", rig.folder / "rsu.sock", *args)


def status(rig):
    code, out, error = ctl(rig, "status", "--json")
    check(code == 0, error)
    return json.loads(out)


def cycles_go_on(rig, count=20):
    before = status(rig)["status"]["cycle"]
    wait_for(lambda: status(rig)["status"]["cycle"] >= before + count, f"{count} more cycles")


# ---- files that are none ------------------------------------------------------------------

def names_of_no_file(rig):
    """A path of each kind that a program must not try to read to its end."""
    fifo, folder = rig.folder / "fifo", rig.folder / "folder"
    if not fifo.exists():
        os.mkfifo(fifo)
        folder.mkdir()
    return [fifo, folder, "/dev/zero"]


def a_file_that_is_none_is_refused_at_the_start_with_one_line(rig):
    good = rig.config("good.json")
    for path in names_of_no_file(rig):
        commands = [["verge-rsu", "--config", path],
                    ["verge-rsu", "--config", rig.config("road.json", road=None,
                                                         road_file=str(path))],
                    ["verge-rsu", "--config", good, "--replay", path],
                    ["verge-replay", path, "--config", good], ["verge-replay", path],
                    ["verge-plan", path], ["verge-sim", path]]
        for name, *args in commands:
            code, out, error = rig.run(rig.bin / name, *args)
            check(code in (2, 66), f"{name} {args}: exit {code}: {error}")
            check(str(path) in error and error.count("\n") == 1, f"{name} {args}: {error!r}")


def a_file_that_is_none_is_refused_at_a_reload_and_cycles_go_on(rig):
    config = rig.config(control="rsu.sock")
    with Daemon(rig, config) as rsu:
        for count, path in enumerate(names_of_no_file(rig), start=1):
            rig.config(control="rsu.sock", road=None, road_file=str(path))
            code, out, _ = ctl(rig, "reload")
            check(code == 1 and str(path) in out, out)
            cycles_go_on(rig)
        config.unlink()
        os.mkfifo(config)
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("event=config_refused", count + 1)
        cycles_go_on(rig)
        seconds, code = rsu.stop()
        check(code == 0 and seconds < 1.0, f"exit {code} after {seconds:.1f} s")


CASES = [
    a_file_that_is_none_is_refused_at_the_start_with_one_line,
    a_file_that_is_none_is_refused_at_a_reload_and_cycles_go_on,
]

if __name__ == "__main__":
    args = case_arguments()
    sys.exit(run_cases(CASES, args.bin, args.only))
