"""The daemon as a service: its notifications to the service manager and its log, without a bus.

    python3 tests/apps/e2e_service.py --bin build/bin [--only NAME]

Every case is a function whose name is its claim. The bus is loop:, which needs no network: cycles
run without vehicles.
"""
import json
import os
import re
import signal
import subprocess
import sys
import time

from daemon_rig import (QUICK, SOURCE, Daemon, Manager, case_arguments, check, run_cases,
                        shared_library, wait_for)


# ---- the service manager ------------------------------------------------------------------

def the_manager_is_notified_of_start_reload_and_stop(rig):
    for name in (str(rig.folder / "notify"), b"\0verge-test-%d" % os.getpid()):
        manager = Manager(name)
        config = rig.config()
        with Daemon(rig, config, env={"NOTIFY_SOCKET": manager.name}) as rsu:
            manager.wait_for("READY=1")
            manager.wait_for("STATUS=waiting: 0 of 0 vehicles planned")
            for document, event in ((None, "config_applied"), ("{", "config_refused")):
                if document is not None:
                    config.write_text(document)
                else:
                    rig.config(rsu_id=7)
                before = time.monotonic_ns() // 1000
                rsu.signal(signal.SIGHUP)
                lines = manager.wait_for("RELOADING=1").split("\n")
                check(lines[0] == "RELOADING=1" and lines[1].startswith("MONOTONIC_USEC="), lines)
                stamp = int(lines[1].split("=")[1])
                check(before <= stamp <= time.monotonic_ns() // 1000, f"{before} {stamp}")
                manager.wait_for("READY=1")
                rsu.wait_for(event)
            # A deadline that was missed on a busy machine may stand before it.
            while "config" not in manager.wait_for("STATUS=degraded: 0 of 0 vehicles planned, fault"):
                pass
            check(rsu.stop()[1] == 0, "stops")
            manager.wait_for("STOPPING=1")
        check(not any("WATCHDOG" in text for text in manager.heard), "nobody asked for that")


def the_status_text_is_sent_when_it_changes_and_not_each_second(rig):
    manager = Manager(str(rig.folder / "notify"))
    with Daemon(rig, rig.config(), env={"NOTIFY_SOCKET": manager.name}):
        texts = [manager.wait_for("STATUS=")] + manager.silent_for(2.5)
        # On a busy machine a deadline may come and go; what comes must be new each time.
        check(all(now != before for now, before in zip(texts[1:], texts)), texts)


def completed_cycles_feed_the_watchdog(rig):
    manager = Manager(str(rig.folder / "notify"))
    env = {"NOTIFY_SOCKET": manager.name, "WATCHDOG_USEC": "2000000"}
    with Daemon(rig, rig.config(cycle_ms=20), env=env) as rsu:
        for _ in range(50): # waiting for input, it still runs its cycles
            manager.wait_for("WATCHDOG=1")
        check("watchdog_short" not in rsu.text(), rsu.text())
    # Another process's watchdog is not ours to feed.
    with Daemon(rig, rig.config(cycle_ms=20), env={**env, "WATCHDOG_PID": "1"}):
        manager.heard.clear()
        manager.wait_for("STATUS=")
        check(not any("WATCHDOG" in text for text in manager.heard), manager.heard)
    with Daemon(rig, rig.config(cycle_ms=2000), env=env) as rsu:
        check("watchdog_short" in rsu.text(), "one late cycle would have it killed, and it says so")


def without_a_manager_it_works_as_well(rig):
    nobody = str(rig.folder / "nobody-listens")
    for name, usable in (("", True), (nobody, True), ("no/path", False), ("/" + "x" * 200, False)):
        with Daemon(rig, rig.config(), env={"NOTIFY_SOCKET": name}) as rsu:
            check(("notify_unusable" in rsu.text()) != usable, rsu.text())
            check(rsu.stop()[1] == 0, "stops")


# ---- the log ------------------------------------------------------------------------------

def the_log_is_text_or_json_with_the_same_pairs(rig):
    config = rig.config()
    with Daemon(rig, config) as rsu:
        config.write_text("{\"format\": \"verge-rsu/1\", \"bogus\\\\\": 1}")
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_refused")
        check(rsu.stop()[1] == 0, "stops")
        text = rsu.text().splitlines()
    rig.config()
    with Daemon(rig, config, "--log-format", "json") as rsu:
        config.write_text("{\"format\": \"verge-rsu/1\", \"bogus\\\\\": 1}")
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_refused")
        check(rsu.stop()[1] == 0, "stops")
        documents = [json.loads(line) for line in rsu.text().splitlines()]
    ready = next(d for d in documents if d["event"] == "READY")
    check(ready["level"] == "info" and ready["cycle_ms"] == 50, ready)
    check(isinstance(ready["planner_bytes"], int) and isinstance(ready["version"], str), ready)
    check(ready["map_crc32"].startswith("0x"), "a checksum is a text, whatever its digits")
    line = next(t for t in text if "event=READY" in t)
    check([pair.split("=")[0] for pair in line.split(" ")] == list(ready), f"{line} {ready}")
    refused = next(d for d in documents if d["event"] == "config_refused")
    check("bogus\\" in refused["reason"], refused)
    # The configuration may state it, too; the option takes precedence.
    with Daemon(rig, rig.config(log_format="json")) as rsu:
        check(all(json.loads(line) for line in rsu.text().splitlines()), rsu.text())
    with Daemon(rig, rig.config(log_format="json"), "--log-format", "text") as rsu:
        check(rsu.text().startswith("level="), rsu.text())
    check(rig.run(rig.bin / "verge-rsu", "--config", config, "--log-format", "xml")[0] == 64, "64")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", rig.config(log_format="xml"))
    check(code == 78 and "log_format" in error and error.count("\n") == 1, error)


def lines_to_the_journal_carry_their_priority(rig):
    config = rig.config()
    log = rig.folder / "journal"
    with open(log, "wb") as end:
        facts = os.fstat(end.fileno())
        for stream, marked in ((f"{facts.st_dev}:{facts.st_ino}", True), ("1:1", False)):
            end.truncate(0)
            end.seek(0)
            rsu = subprocess.Popen([str(rig.bin / "verge-rsu"), "--config", str(config)],
                                   stderr=end, env={**os.environ, "JOURNAL_STREAM": stream})
            try:
                wait_for(lambda: "READY" in log.read_text(), "READY")
                config.write_text("{")
                rsu.send_signal(signal.SIGHUP)
                wait_for(lambda: "config_refused" in log.read_text(), "config_refused")
            finally:
                rsu.terminate()
                rsu.wait()
            rig.config()
            lines = log.read_text().replace("\0", "").splitlines()
            for line in lines:
                priority = "<3>" if "level=error" in line else "<6>"
                check(line.startswith(priority + "level=" if marked else "level="), line)
            check(any("level=error" in line for line in lines), lines)


# ---- what it asks of the system -----------------------------------------------------------

def planning_threads_and_no_others_have_the_priority_and_processors_asked_for(rig):
    if rig.run("chrt", "-f", "7", "true")[0] != 0:
        return "not checked: this machine refuses SCHED_FIFO"
    cpu = max(os.sched_getaffinity(0))
    config = rig.config(realtime={"priority": 7, "cpus": [cpu]}, planner=dict(QUICK, threads=2))
    with Daemon(rig, config) as rsu:
        chosen = {tid for tid in rsu.threads()
                  if os.sched_getscheduler(tid) == os.SCHED_FIFO}
        check(len(chosen) == 2, f"the planning thread and its helper: {chosen} of {rsu.threads()}")
        check("verge-plan" in {rsu.threads()[tid] for tid in chosen}, rsu.threads())
        for tid in chosen:
            check(os.sched_getparam(tid).sched_priority == 7, "its priority")
            check(os.sched_getaffinity(tid) == {cpu}, "its processors")
        check(os.sched_getscheduler(rsu.process.pid) == os.SCHED_OTHER, "input and output")
        check(os.sched_getaffinity(rsu.process.pid) == os.sched_getaffinity(0), "anywhere")
        check(rsu.stop()[1] == 0, "stops")


def with_locked_memory_no_thread_waits_for_a_page(rig):
    if rig.sanitized():
        return "not checked: the sanitizer keeps memory from being locked"
    config = rig.config(cycle_ms=10, realtime={"lock_memory": True}, control="rsu.sock")
    if rig.run(rig.bin / "verge-rsu", "--config", config, "--cycles", "1")[0] == 71:
        return "not checked: this machine refuses to lock so much"
    with Daemon(rig, config) as rsu:
        def faults():
            tasks = rsu.threads()
            return sum(sum(map(int, open(f"/proc/{rsu.process.pid}/task/{tid}/stat").read()
                               .rsplit(")")[1].split()[7:11:2])) for tid in tasks)
        time.sleep(1.5) # the first status message has gone out
        before = faults()
        time.sleep(2.0)
        check(faults() == before, f"{faults() - before} page faults in 200 cycles")
        status = open(f"/proc/{rsu.process.pid}/status").read()
        locked = int(status.split("VmLck:")[1].split()[0])
        check(locked > 5000, f"{locked} KiB are locked")


def memory_is_locked_within_the_stack_that_the_unit_allows(rig):
    if rig.sanitized():
        return "not checked: the sanitizer keeps memory from being locked"
    unit = SOURCE / "apps/systemd/daemon.service.in"
    stack, = re.findall(r"^LimitSTACK=(\d+)K$", unit.read_text(), re.M)
    code, _, error = rig.run("prlimit", f"--stack={int(stack) << 10}", rig.bin / "verge-rsu",
                             "--config", rig.config(cycle_ms=10, realtime={"lock_memory": True}),
                             "--cycles", "2")
    check(code == 0 or code == 71 and "LimitMEMLOCK" in error, f"exit {code}: {error}")


def reloads_leave_no_memory_behind(rig):
    if rig.sanitized():
        return "not checked: the sanitizer keeps freed memory for a while"
    with Daemon(rig, rig.config(planner=None)) as rsu:
        def resident():
            status = open(f"/proc/{rsu.process.pid}/status").read()
            return int(status.split("VmRSS:")[1].split()[0])
        before = resident()
        for count in range(1, 9):
            rsu.signal(signal.SIGHUP)
            rsu.wait_for("event=config_applied", count)
            time.sleep(0.3) # each is logged: five lines a second at most
        after = resident()
        check(after < before + 3000, f"{before} KiB, after eight reloads {after} KiB")


def what_the_system_refuses_ends_the_start_with_71_and_says_what_to_do(rig):
    plain = ["unshare", "-r", "prlimit", "--memlock=65536", "--rtprio=0"]
    if rig.run(*plain, "true")[0] != 0:
        return "not checked: this machine refuses a user namespace"
    cases = [({"priority": 9}, "realtime.priority", "LimitRTPRIO=9"),
             ({"cpus": [1023]}, "realtime.cpus", "nproc")]
    if not rig.sanitized():
        cases.append(({"lock_memory": True}, "realtime.lock_memory", "LimitMEMLOCK"))
    for realtime, key, remedy in cases:
        code, _, error = rig.run(*plain, rig.bin / "verge-rsu", "--config",
                                 rig.config(realtime=realtime))
        check(code == 71, f"{key}: exit {code}: {error}")
        check(key in error and remedy in error and error.count("\n") == 1, error)


def a_changed_floating_point_mode_is_corrected_and_logged_once(rig):
    if rig.sanitized():
        return "not checked: the sanitizer wants no other library before it"
    library = shared_library(rig, "rounding")
    config = rig.config(cycle_ms=10)
    with Daemon(rig, config, env={"LD_PRELOAD": library}) as rsu:
        rsu.wait_for("floating_corrected when=start")
        check(rsu.stop()[1] == 0, "stops")
    # In the planning thread, again and again.
    late = {"LD_PRELOAD": library, "ROUNDING_LATE": "1"}
    with Daemon(rig, config, "--cycles", "50", env=late) as rsu:
        check(rsu.process.wait(timeout=20) == 0, "it stops by itself")
        check("floating_corrected when=cycle" in rsu.text(), rsu.text())
        check(rsu.text().count("floating_corrected") == 1, rsu.text())


# ---- configuration ------------------------------------------------------------------------

def what_the_daemon_cannot_serve_is_refused_by_name(rig):
    wrong = [({"control": 1}, "control"), ({"control": ""}, "control"),
             ({"control": "/" + "x" * 120}, "control"), ({"metrics": {"bogus": 1}}, "bogus"),
             ({"metrics": {"listen": "0.0.0.0:9464"}}, "metrics.listen"),
             ({"metrics": {"listen": "10.0.0.1:9464"}}, "metrics.listen"),
             ({"metrics": {"listen": "[::]:9464"}}, "metrics.listen"),
             ({"metrics": {"listen": "127.0.0.1"}}, "metrics.listen"),
             ({"metrics": {"listen": "127.0.0.1:0"}}, "metrics.listen"),
             ({"metrics": {"listen": "127.0.0.1:70000"}}, "metrics.listen"),
             ({"metrics": {"listen": 9464}}, "metrics.listen"),
             ({"metrics": {"listen": "x" * 500}}, "metrics.listen"),
             ({"metrics": {"file": ""}}, "metrics.file"), ({"metrics": []}, "metrics"),
             ({"realtime": {"priority": 100}}, "realtime.priority"),
             ({"realtime": {"priority": -1}}, "realtime.priority"),
             ({"realtime": {"lock_memory": 1}}, "realtime.lock_memory"),
             ({"realtime": {"cpus": [-1]}}, "realtime.cpus[0]"),
             ({"realtime": {"cpus": [0, 5000]}}, "realtime.cpus[1]"),
             ({"realtime": {"cpus": list(range(70))}}, "realtime.cpus"),
             ({"realtime": {"bogus": 1}}, "bogus"), ({"log_format": "xml"}, "log_format")]
    for change, name in wrong:
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config", rig.config(**change),
                                 "--check-config")
        check(code == 78 and name in error and error.count("\n") == 1, f"{change}: {code} {error}")


def the_printed_configuration_prints_itself(rig):
    config = rig.config(control="rsu.sock", metrics={"listen": "[::1]:9464", "file": "m.prom"},
                        realtime={"priority": 4, "lock_memory": True, "cpus": [0, 1]},
                        log_format="json")
    code, out, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--print-config")
    check(code == 0, error)
    document = json.loads(out)
    check(document["control"] == str(rig.folder / "rsu.sock"), "relative to its file")
    check(document["metrics"] == {"listen": "[::1]:9464", "file": str(rig.folder / "m.prom")}, out)
    check(document["realtime"] == {"priority": 4, "lock_memory": True, "cpus": [0, 1]}, out)
    config.write_text(out)
    check(rig.run(rig.bin / "verge-rsu", "--config", config, "--print-config", cwd="/")[1] == out,
          "anywhere")
    full = subprocess.run([rig.bin / "verge-rsu", "--config", config, "--print-config"],
                          stdout=open("/dev/full", "w"), stderr=subprocess.PIPE, text=True)
    check(full.returncode == 70 and full.stderr.count("\n") == 1, f"no room: {full}")


CASES = [
    the_manager_is_notified_of_start_reload_and_stop,
    the_status_text_is_sent_when_it_changes_and_not_each_second,
    completed_cycles_feed_the_watchdog,
    without_a_manager_it_works_as_well,
    the_log_is_text_or_json_with_the_same_pairs,
    lines_to_the_journal_carry_their_priority,
    planning_threads_and_no_others_have_the_priority_and_processors_asked_for,
    with_locked_memory_no_thread_waits_for_a_page,
    memory_is_locked_within_the_stack_that_the_unit_allows,
    reloads_leave_no_memory_behind,
    what_the_system_refuses_ends_the_start_with_71_and_says_what_to_do,
    a_changed_floating_point_mode_is_corrected_and_logged_once,
    what_the_daemon_cannot_serve_is_refused_by_name,
    the_printed_configuration_prints_itself,
]

if __name__ == "__main__":
    args = case_arguments()
    sys.exit(run_cases(CASES, args.bin, args.only))
