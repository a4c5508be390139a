"""Shared parts of the tests of the daemon as a service: processes and sockets, without a bus."""
import argparse
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

# Two straight lanes of 2 km.
ROAD = {"lanes": [
    {"id": 0, "centerline": [[0, 0], [1900, 0]], "width": 3.75, "speed_limit": 25.0,
     "left": 1, "right": None},
    {"id": 1, "centerline": [[0, 3.75], [1900, 3.75]], "width": 3.75, "speed_limit": 25.0,
     "left": None, "right": 0}]}
# A small budget: these cases are about the daemon, not about how good its plans are.
QUICK = {"iterations": 60, "nodes_max": 256, "sample_speeds": 3, "sample_offsets": 8}


def check(good, what):
    if not good:
        raise AssertionError(what)


def wait_for(condition, what, seconds=20):
    """The condition's first true value; fails where it does not come."""
    until = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        check(time.monotonic() < until, f"not within {seconds} s: {what}")
        time.sleep(0.02)


class Rig:
    """Binaries and a folder of its own."""

    BUS, CYCLE_MS = "loop:", 50 # of the configurations it writes

    def __init__(self, binaries, folder):
        self.bin = pathlib.Path(binaries).resolve()
        self.folder = pathlib.Path(folder)

    def sanitized(self):
        """The address sanitizer locks no memory and wants to be loaded first."""
        return b"__asan_init" in (self.bin / "verge-rsu").read_bytes()

    def config(self, name="rsu.json", **changes):
        document = {"format": "verge-rsu/1", "rsu_id": 5, "bus": self.BUS, "road": ROAD,
                    "cycle_ms": self.CYCLE_MS, "planner": dict(QUICK)}
        document.update(changes)
        path = self.folder / name
        path.write_text(json.dumps({k: v for k, v in document.items() if v is not None}))
        return path

    def run(self, *args, **kwargs):
        """A program to its end: (exit code, standard output, standard error)."""
        done = subprocess.run([str(a) for a in args], capture_output=True, text=True, timeout=60,
                              **kwargs)
        return done.returncode, done.stdout, done.stderr


SOURCE = pathlib.Path(__file__).resolve().parents[2]


def shared_library(rig, name):
    """Builds tests/support/NAME.c for LD_PRELOAD."""
    library = rig.folder / f"{name}.so"
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-fno-builtin", "-o", library,
                    SOURCE / "tests/support" / f"{name}.c", "-lm", "-ldl"], check=True)
    return str(library)


class Daemon:
    """A running verge-rsu that has said READY."""

    def __init__(self, rig, config, *options, env=None, stdin=None, log="rsu.log", **popen):
        self.path = rig.folder / log
        self.log = open(self.path, "w+b")
        self.process = subprocess.Popen(
            [str(rig.bin / self.PROGRAM), "--config", str(config), *map(str, options)],
            stderr=self.log, stdout=subprocess.DEVNULL,
            env=None if env is None else {**os.environ, **env}, **popen)

        def ready():
            check(self.process.poll() is None, f"{self.PROGRAM} ended before READY:\n" + self.text())
            return "READY" in self.text()
        wait_for(ready, "READY")

    PROGRAM = "verge-rsu"  # a class of another daemon has another one

    def text(self):
        return self.path.read_text()

    def threads(self):
        """Thread id -> name."""
        tasks = pathlib.Path(f"/proc/{self.process.pid}/task")
        return {int(task.name): (task / "comm").read_text().strip() for task in tasks.iterdir()}

    def wait_for(self, words, count=1):
        wait_for(lambda: self.text().count(words) >= count, f"{words}\n{self.text()}")

    def signal(self, number):
        self.process.send_signal(number)

    def stop(self):
        """SIGTERM: (seconds it took, exit code)."""
        began = time.monotonic()
        self.signal(signal.SIGTERM)
        code = self.process.wait(timeout=20)
        return time.monotonic() - began, code

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.log.close()


class Manager:
    """The service manager's end of $NOTIFY_SOCKET."""

    def __init__(self, name):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(name)
        self.name = name if isinstance(name, str) else "@" + name[1:].decode()
        self.heard = []

    def wait_for(self, line, seconds=20):
        """Listens until a datagram has a line that starts so; the datagram."""
        until = time.monotonic() + seconds
        while True:
            self.socket.settimeout(max(0.01, until - time.monotonic()))
            try:
                text = self.socket.recv(4096).decode()
            except socket.timeout:
                raise AssertionError(f"no {line} within {seconds} s, only {self.heard[-5:]}")
            self.heard.append(text)
            if any(part.startswith(line) for part in text.split("\n")):
                return text

    def silent_for(self, seconds):
        """What still came in that time."""
        until = time.monotonic() + seconds
        came = []
        while time.monotonic() < until:
            self.socket.settimeout(max(0.01, until - time.monotonic()))
            try:
                came.append(self.socket.recv(4096).decode())
            except socket.timeout:
                break
        return came


def case_arguments():
    """What every file of cases is called with."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--lcm-python")
    parser.add_argument("--only", default="")
    return parser.parse_args()


def run_cases(cases, binaries, only="", kind=Rig):
    """Each case in a folder of its own, on a rig of this kind; the process's exit code."""
    failed = 0
    for case in cases:
        if only not in case.__name__:
            continue
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as name:
            rig = kind(binaries, name)
            try:
                word = case(rig) or "ok"
            except (AssertionError, subprocess.TimeoutExpired, OSError) as trouble:
                failed += 1
                word = f"FAILED: {trouble!r}"
                for log in rig.folder.glob("*.log"):
                    print(f"{log.name}:\n{log.read_text()[-3000:]}", file=sys.stderr)
        print(f"{time.monotonic() - began:5.1f} s  {case.__name__}: {word}", flush=True)
    return 1 if failed else 0
