"""Claim: traffic recorded on the bus replays to the same digests every time, also on aarch64.

    daemon.py BIN_DIR SOURCE_DIR WORK_DIR ARM64_DIR     (in a private network: in_network.sh)

Records live traffic twice at once, by `verge-rsu --record` and by lcm-logger, and replays both
logs by this machine's programs and by the same programs built for aarch64, run by qemu. Beside
them runs of verge-sim. ARM64_DIR holds libcjson for aarch64, unpacked there by tools/setup.
Exit 77 where a compiler, the emulator, the library or lcm-logger is missing.
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

BUS = "lcm:udpm://239.255.76.67:7667?ttl=0"
SECONDS = 8
QEMU = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]


def skip(why):
    print(f"SKIPPED: {why}", file=sys.stderr)
    sys.exit(77)


def build_for_aarch64(source, build, arm64):
    """The programs by the project's own build files, with the cross compiler."""
    compiler = "aarch64-linux-gnu-"
    for tool in (compiler + "g++", QEMU[0], "lcm-logger"):
        if shutil.which(tool) is None:
            skip(f"{tool} is not installed (tools/setup --check)")
    if not (arm64 / "usr/include/cjson/cJSON.h").exists():
        skip(f"no libcjson for aarch64 in {arm64} (tools/setup --check, with a network)")
    environment = dict(os.environ, PKG_CONFIG_SYSROOT_DIR=str(arm64),
                       PKG_CONFIG_LIBDIR=str(arm64 / "usr/lib/aarch64-linux-gnu/pkgconfig"))
    commands = [
        ["cmake", "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
         "-DCMAKE_SYSTEM_NAME=Linux", "-DCMAKE_SYSTEM_PROCESSOR=aarch64",
         f"-DCMAKE_C_COMPILER={compiler}gcc", f"-DCMAKE_CXX_COMPILER={compiler}g++",
         "-DVERGE_BUILD_TESTS=OFF", "-DVERGE_OPENSSL=OFF", "-DVERGE_DDS=OFF"],
        ["cmake", "--build", build, "--target", "verge-rsu", "verge-replay", "-j", "2"]]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        if done.returncode != 0:
            sys.exit(done.stdout[-3000:] + done.stderr[-3000:])
    return build / "bin"


def wait_for(what, process, deadline=20):
    until = time.monotonic() + deadline
    while not what():
        if process.poll() is not None or time.monotonic() > until:
            sys.exit("the recording could not be made: a program ended or was not ready in time")
        time.sleep(0.02)


def record(binaries, config, scenario, folder):
    """Two logs of the same live traffic: the daemon's own and lcm-logger's."""
    own, tapped, said = folder / "own.lcmlog", folder / "tapped.lcmlog", folder / "rsu.txt"
    with open(said, "w") as errors:
        rsu = subprocess.Popen([binaries / "verge-rsu", "--config", config, "--record", own],
                               stderr=errors)
        logger = subprocess.Popen(["lcm-logger", f"--lcm-url={BUS[4:]}", "-f", "-q", tapped],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_for(lambda: "READY" in said.read_text(), rsu)
            wait_for(tapped.exists, logger)
            subprocess.run([binaries / "verge-publish", scenario, "--bus", BUS, "--quiet",
                            "--duration", str(SECONDS)], check=True, stdout=subprocess.DEVNULL)
            rsu.send_signal(signal.SIGTERM)
            if rsu.wait(timeout=10) != 0:
                sys.exit("verge-rsu did not stop in order")
            logger.send_signal(signal.SIGINT)
            logger.wait(timeout=10)
        finally:
            for process in (rsu, logger):
                if process.poll() is None:
                    process.kill()
                    process.wait()
    return own, tapped


def output_of(command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{command}: exit {done.returncode}: {done.stdout[-500:]}{done.stderr[-500:]}")
    return done.stdout


def main():
    binaries, source, work, arm64 = (pathlib.Path(argument) for argument in sys.argv[1:5])
    foreign = build_for_aarch64(source, work / "daemon-aarch64", arm64)
    config = source / "apps/scenarios/rsu-ramp.json"
    scenario = source / "apps/scenarios/ramp-case1.json"
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        logs = record(binaries, config, scenario, folder)
        for log in logs:
            replay = ["verge-rsu", "--config", config, "--replay", log]
            once, again = (output_of([binaries / replay[0], *replay[1:]]) for _ in range(2))
            there = output_of([*QEMU, foreign / replay[0], *replay[1:]])
            cycles = [json.loads(line) for line in once.splitlines()]
            planned = sum(cycle["vehicles"] > 0 for cycle in cycles)
            if planned < SECONDS:
                sys.exit(f"{log.name}: only {planned} cycles have plans")
            if once != again:
                sys.exit(f"{log.name}: two replays here differ")
            for line, other in zip(once.splitlines(), there.splitlines()):
                if line != other:
                    sys.exit(f"{log.name}: here {line}, on aarch64 {other}")
            if once != there:
                sys.exit(f"{log.name}: the replay on aarch64 has another number of cycles")
            print(f"{log.name}: {planned} cycles, the same digests here, again and on aarch64")
        # These compare with the digests of the live run and of the simulation.
        recordings = [[logs[0], "--config", config]]
        for name in ("ramp-case1", "freeway-4av-2hv", "roundabout"):
            run = folder / f"{name}.jsonl"
            output_of([binaries / "verge-sim", source / f"apps/scenarios/{name}.json",
                       "--out", run])
            recordings.append([run])
        for recording in recordings:
            print(output_of([*QEMU, foreign / "verge-replay", *recording]).strip(), "(aarch64)")


main()
