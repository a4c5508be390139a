#!/usr/bin/env python3
"""The bus unix: with verge-echo, verge-publish and the Python programs of transport/README.md.

    python3 tests/apps/e2e_unix.py --bin build/bin [--only NAME]

Every case is a function whose name is its claim. Exit status 77: lcm-gen is missing.
"""
import json
import os
import re
import shutil
import signal
import subprocess
import sys

from daemon_rig import SOURCE, case_arguments, check, run_cases, wait_for

RAMP = SOURCE / "apps/scenarios/ramp-case1.json"


def programs_of_the_readme(rig):
    """(what sends, what receives), with the module of the messages beside them."""
    subprocess.run(["lcm-gen", "-p", "--ppath", rig.folder,
                    SOURCE / "transport/types/verge.lcm"], check=True)
    text = (SOURCE / "transport/README.md").read_text()
    paths = []
    for program in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        paths.append(rig.folder / f"{len(paths)}.py")
        paths[-1].write_text(program)
    check(len(paths) == 2, f"{len(paths)} Python programs")
    return paths


class Started:
    """A running program that has bound the socket."""

    def __init__(self, rig, *command):
        self.path = rig.folder / "own"
        self.process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        wait_for(self.path.is_socket, f"{command} receives")

    def end(self, number=None):
        """(exit code, standard output, standard error)"""
        if number is not None:
            self.process.send_signal(number)
        out, error = self.process.communicate(timeout=20)
        return self.process.returncode, out, error


def echo(rig, *options):
    return Started(rig, rig.bin / "verge-echo", f"unix:{rig.folder / 'own'}", *options)


def publish(rig, *options):
    return [rig.bin / "verge-publish", RAMP, "--bus", f"unix:{rig.folder / 'own'}", *options]


def the_program_of_the_readme_that_sends_is_heard(rig):
    sends, _ = programs_of_the_readme(rig)
    heard = echo(rig, "--json", "--count", "1")
    code, _, error = rig.run(sys.executable, sends, heard.path)
    check(code == 0, error)
    code, out, error = heard.end()
    state = json.loads(out)["message"]
    check(code == 0 and (state["vehicle_id"], state["x"], state["speed"]) == (7, 120, 20), out)
    check("0 malformed" in error, error)
    check(not heard.path.exists(), "the socket is removed")


def the_program_of_the_readme_that_receives_hears_a_vehicle(rig):
    _, receives = programs_of_the_readme(rig)
    heard = Started(rig, sys.executable, receives, rig.folder / "own")
    code, _, error = rig.run(*publish(rig, "--send-only", "--duration", "0.5"))
    check(code == 0, error)
    code, out, error = heard.end()
    vehicles = {str(vehicle["id"]) for vehicle in json.loads(RAMP.read_text())["vehicles"]}
    check(code == 0 and out.strip() in vehicles, f"{out} {error}")


def a_receiver_starts_later_and_after_a_kill_while_a_sender_runs(rig):
    sender = subprocess.Popen(publish(rig, "--send-only"), stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True)
    check("no program receives there" in sender.stderr.readline(), "a line that says so")
    first = echo(rig)
    wait_for(lambda: first.process.stdout.readline().startswith("state "), "a state")
    first.end(signal.SIGKILL)
    check(first.path.is_socket(), "the killed one leaves its socket")
    second = echo(rig, "--count", "20")
    code, out, error = second.end()
    check(code == 0 and out.count("state ") == 20, f"{code} {out} {error}")
    sender.send_signal(signal.SIGTERM)
    sender.communicate(timeout=20)


def a_program_for_both_directions_is_told_why_it_cannot_use_it(rig):
    code, _, error = rig.run(*publish(rig))
    check(code == 2 and "one direction" in error and error.count("\n") == 1, error)
    config = rig.config(bus=f"unix:{rig.folder / 'own'}")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--check-config")
    check(code == 78 and "one direction" in error and error.count("\n") == 1, error)
    check(os.listdir(rig.folder) == ["rsu.json"], "no socket is left")


CASES = [
    the_program_of_the_readme_that_sends_is_heard,
    the_program_of_the_readme_that_receives_hears_a_vehicle,
    a_receiver_starts_later_and_after_a_kill_while_a_sender_runs,
    a_program_for_both_directions_is_told_why_it_cannot_use_it,
]

if __name__ == "__main__":
    arguments = case_arguments()
    if shutil.which("lcm-gen") is None:
        print("SKIPPED: lcm-gen is missing (tools/setup installs it)", file=sys.stderr)
        sys.exit(77)
    sys.exit(run_cases(CASES, arguments.bin, arguments.only))
