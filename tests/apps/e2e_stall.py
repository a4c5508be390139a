"""No slow file or reader stops the daemon: files that never end, readers that do not read, reloads
of large roads.

    python3 tests/apps/e2e_stall.py --bin build/bin [--only NAME]

Every case is a function whose name is its claim. The bus is loop:, which needs no network.
"""
import fcntl
import json
import math
import os
import signal
import subprocess
import sys
import time

from daemon_rig import Daemon, case_arguments, check, run_cases, shared_library, wait_for


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

def names_that_are_not_regular_files(rig):
    """A path of each kind that a program must not try to read to its end."""
    fifo, folder = rig.folder / "fifo", rig.folder / "folder"
    if not fifo.exists():
        os.mkfifo(fifo)
        folder.mkdir()
    return [fifo, folder, "/dev/zero"]


def a_file_that_is_not_regular_is_refused_at_the_start_with_one_line(rig):
    good = rig.config("good.json")
    for path in names_that_are_not_regular_files(rig):
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


def a_file_that_is_not_regular_is_refused_at_a_reload_and_cycles_continue(rig):
    config = rig.config(control="rsu.sock")
    with Daemon(rig, config) as rsu:
        for count, path in enumerate(names_that_are_not_regular_files(rig), start=1):
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


# ---- readers that do not read -------------------------------------------------------------

class Piped(Daemon):
    """A daemon whose standard error is a pipe that the test may leave unread."""

    def __init__(self, rig, config, *options):
        self.reader, self.writer = os.pipe()
        self.heard = b""
        self.process = subprocess.Popen(
            [str(rig.bin / "verge-rsu"), "--config", str(config), *map(str, options)],
            stderr=self.writer, stdout=subprocess.DEVNULL)
        self.log = os.fdopen(self.reader, "rb", buffering=0)
        os.set_blocking(self.reader, False)
        self.wait_for("READY")

    def text(self):
        while part := self.log.read(65536):
            self.heard += part
        return self.heard.decode()

    def fill(self):
        """Leaves no room for a byte, by an end of its own that does not wait."""
        end = os.open(f"/proc/self/fd/{self.writer}", os.O_WRONLY | os.O_NONBLOCK)
        for line in (b"filler" * 600 + b"\n", b"\n"):
            try:
                while os.write(end, line):
                    pass
            except BlockingIOError:
                pass
        os.close(end)


def an_unread_log_stops_nothing(rig):
    config = rig.config(control="rsu.sock", cycle_ms=20)
    with Piped(rig, config, "--log-level", "debug") as rsu:
        rsu.fill()
        for _ in range(3):
            rsu.signal(signal.SIGUSR1)
            cycles_go_on(rig, 50)
        check(ctl(rig, "reload")[0] == 0, "a reload")
        cycles_go_on(rig, 50)
        # Whoever reads again finds whole lines, those of the meantime among them.
        rsu.wait_for("event=config_applied")
        for line in rsu.text().splitlines():
            check(line == "" or line.startswith(("level=", "filler")), f"no whole line: {line!r}")
            check(line.count("level=") <= 1, f"two lines in one: {line!r}")
        check(rsu.text().count("event=statistics") == 3, "nothing was lost: it was not much")
        rsu.fill()
        cycles_go_on(rig)
        seconds, code = rsu.stop()
        check(code == 0 and seconds < 1.5, f"exit {code} after {seconds:.1f} s")


def a_log_whose_reader_is_gone_stops_nothing(rig):
    config = rig.config(control="rsu.sock", cycle_ms=20)
    with Piped(rig, config) as rsu:
        rsu.log.close()
        os.close(rsu.writer)
        rsu.signal(signal.SIGUSR1)
        wait_for(lambda: status(rig)["log_dropped"] > 0, "lost lines are counted")
        cycles_go_on(rig, 50)
        code, out, _ = ctl(rig, "status")
        check("lines of the log" in out, out)
        check(rsu.stop()[1] == 0, "stops")


def shrink(reader):
    """To the room of one page, which the system refuses while there is more in the pipe."""
    def done():
        try:
            while os.read(reader, 65536):
                pass
        except BlockingIOError:
            pass
        try:
            return fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)
        except OSError:
            return 0
    wait_for(done, "a smaller pipe")


def an_unread_recording_stops_nothing(rig):
    fifo = rig.folder / "record.fifo"
    os.mkfifo(fifo)
    config = rig.config(control="rsu.sock", cycle_ms=10, metrics={"file": "verge.prom"})
    with Daemon(rig, config, "--record", fifo) as rsu: # a FIFO without a reader is no obstacle
        wait_for(lambda: status(rig)["record_dropped"] > 0, "lost events are counted")
        wait_for(lambda: "record" in status(rig)["faults"], "and a fault")
        cycles_go_on(rig)
        wait_for(lambda: any(line.startswith("verge_record_dropped_total ") and
                             not line.endswith(" 0")
                             for line in (rig.folder / "verge.prom").read_text().splitlines()),
                 "in the figures, too")
        reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
        rsu.wait_for("event=record_dropped")
        check(os.read(reader, 4) == b"\xed\xa1\xda\x01", "it begins with a whole event")
        shrink(reader) # full within a second, and unread from here on
        before = status(rig)["record_dropped"]
        cycles_go_on(rig, 300)
        check(status(rig)["record_dropped"] == before, "they wait, with room for minutes of it")
        seconds, code = rsu.stop()
        check(code == 0 and seconds < 1.5, f"exit {code} after {seconds:.1f} s")
        check("event=record_cut" in rsu.text(), "it says that the end is missing")
        os.close(reader)


def a_metrics_file_on_a_disk_that_hangs_stops_nothing(rig):
    if rig.sanitized():
        return "not checked: the sanitizer wants no other library before it"
    config = rig.config(control="rsu.sock", cycle_ms=20, metrics={"file": "verge.prom"})
    with Daemon(rig, config, env={"LD_PRELOAD": shared_library(rig, "slow_rename")}) as rsu:
        time.sleep(1.5) # the first one is being written
        cycles_go_on(rig, 100)
        check(not (rig.folder / "verge.prom").exists(), "it hangs")
        seconds, code = rsu.stop()
        check(code == 0 and seconds < 1.5, f"exit {code} after {seconds:.1f} s")


# ---- a reload that takes time -------------------------------------------------------------

def large_road():
    """Takes the daemon most of a second to read and to build, on a quiet machine."""
    def lane(number):
        line = [[i, 100 * number + 3 * math.sin(i / 40)] for i in range(0, 1024)]
        return {"id": number, "centerline": line, "width": 3.5, "speed_limit": 20.0,
                "left": None, "right": None}
    return {"lanes": [lane(number) for number in range(64)]}


def a_reload_of_a_large_road_misses_no_cycle(rig):
    large = {"control": "rsu.sock", "cycle_ms": 200, "road": large_road()}
    with Daemon(rig, rig.config(**large)) as rsu:
        # Another program may keep a busy machine from a tick. It does not do so three times.
        for attempt in range(3):
            before = status(rig)["status"]
            for count in range(3):
                rig.config(**large, rsu_id=10 + 3 * attempt + count)
                code, out, error = ctl(rig, "reload")
                check(code == 0, f"{out} {error}")
                rsu.wait_for("event=config_applied", 3 * attempt + count + 1)
            after = status(rig)["status"]
            misses = after["deadline_misses"] - before["deadline_misses"]
            if misses == 0:
                break
        cycles = after["cycle"] - before["cycle"]
        check(misses == 0, f"{misses} misses in {cycles} cycles and three reloads")
        check(after["rsu_id"] == 12 + 3 * attempt, "in effect")


def a_reload_asked_for_during_another_one_follows_it_once(rig):
    large = {"control": "rsu.sock", "cycle_ms": 50, "road": large_road()}
    with Daemon(rig, rig.config(**large)) as rsu:
        for _ in range(10):
            rsu.signal(signal.SIGHUP)
            status(rig) # answered meanwhile
        rig.config(**large, rsu_id=9)
        code, out, error = ctl(rig, "reload") # joins the one that has not begun
        check(code == 0, f"{out} {error}")
        wait_for(lambda: status(rig)["status"]["rsu_id"] == 9, "what was written last")
        cycles_go_on(rig)
        # On a slow machine the first one may be over before the last signal came.
        check(2 <= rsu.text().count("event=config_applied") <= 3, rsu.text())


def stopping_does_not_wait_for_a_reload(rig):
    large = {"control": "rsu.sock", "road": large_road()}
    with Daemon(rig, rig.config(**large)) as rsu:
        rsu.signal(signal.SIGHUP)
        time.sleep(0.1)
        seconds, code = rsu.stop()
        check(code == 0 and seconds < 1.5, f"exit {code} after {seconds:.1f} s")
        check("event=stopped" in rsu.text(), rsu.text())


CASES = [
    a_file_that_is_not_regular_is_refused_at_the_start_with_one_line,
    a_file_that_is_not_regular_is_refused_at_a_reload_and_cycles_continue,
    an_unread_log_stops_nothing,
    a_log_whose_reader_is_gone_stops_nothing,
    an_unread_recording_stops_nothing,
    a_metrics_file_on_a_disk_that_hangs_stops_nothing,
    a_reload_of_a_large_road_misses_no_cycle,
    a_reload_asked_for_during_another_one_follows_it_once,
    stopping_does_not_wait_for_a_reload,
]

if __name__ == "__main__":
    args = case_arguments()
    sys.exit(run_cases(CASES, args.bin, args.only))
