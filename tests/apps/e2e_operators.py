"""The operator interfaces of a running daemon: verge-ctl and its socket, metrics, signals.

    python3 tests/apps/e2e_operators.py --bin build/bin [--only NAME]

Every case is a function whose name is its claim. The bus is loop:, which needs no network; the
tables of vehicles and plans are tested in e2e_echo.py.
"""
import json
import os
import resource
import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.error
import urllib.request

from daemon_rig import QUICK, ROAD, Daemon, check, case_arguments, run_cases, wait_for


def ctl(rig, *args):
    return rig.run(rig.bin / "verge-ctl", *args, "--socket", rig.folder / "rsu.sock")


def wait_for_fault(rig, fault):
    """Whatever others are active, such as a deadline on a busy machine. "none": no fault at all."""
    def told():
        document = json.loads(ctl(rig, "status", "--json")[1])
        active = document["faults"] or ["none"]
        check(active[0] == document["fault"], f"the worst first: {active} {document['fault']}")
        return fault in active and document
    return wait_for(told, f"fault {fault}")


def talk(path, request, keep_open=False):
    """A client of our own: the answer, or the socket to go on with."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.connect(str(path)) # waits while the queue is full
    client.settimeout(10)
    client.sendall(request)
    if keep_open:
        return client
    answer = b""
    while part := client.recv(65536):
        answer += part
    return answer


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def figures(text):
    """name{labels} -> value, of Prometheus's text format; each with its HELP and TYPE before it."""
    values, told = {}, set()
    for line in text.splitlines():
        if line.startswith("# TYPE"):
            told.add(line.split()[2])
        elif not line.startswith("#"):
            name, value = line.rsplit(" ", 1)
            check(name.split("{")[0] in told, f"{name} has a type")
            values[name] = float(value)
    return values


# ---- the control socket -------------------------------------------------------------------

def verge_ctl_shows_the_state_for_people_and_for_programs(rig):
    with Daemon(rig, rig.config(control="rsu.sock")) as rsu:
        wait_for(lambda: "waiting" in ctl(rig, "status")[1], "waiting for input")
        code, out, error = ctl(rig, "status")
        check(code == 0 and "rsu_id 5: waiting" in out and "loop:" in out, out + error)
        code, out, _ = ctl(rig, "status", "--json")
        document = json.loads(out)
        check(code == 0 and document["state"] == "waiting" and document["fault"] == "none", out)
        check(document["status"]["rsu_id"] == 5 and document["cycle_ms"] == 50, out)
        check(json.loads(ctl(rig, "vehicles", "--json")[1])["vehicles"] == [], "nobody is there")
        check(json.loads(ctl(rig, "plans", "--json")[1]) == {"plans": []}, "nor planned for")
        for word in ("vehicles", "plans"):
            code, out, _ = ctl(rig, word)
            check(code == 0 and out.count("\n") == 1, f"a table's head alone: {out!r}")
        check(rsu.stop()[1] == 0, "stops")


def reload_answers_whether_the_configuration_was_taken(rig):
    config = rig.config(control="rsu.sock")
    with Daemon(rig, config) as rsu:
        rig.config(control="rsu.sock", rsu_id=8)
        code, out, _ = ctl(rig, "reload")
        check(code == 0 and out.startswith("accepted"), out)
        wait_for(lambda: "rsu_id 8" in ctl(rig, "status")[1], "the new one in effect")
        config.write_text("{ \"format\": \"verge-rsu/1\", \"bogus\": 1 }")
        code, out, _ = ctl(rig, "reload")
        check(code == 1 and out.startswith("refused") and "bogus" in out, out)
        code, out, _ = ctl(rig, "reload", "--json")
        document = json.loads(out)
        check(code == 1 and document["accepted"] is False and "bogus" in document["reason"], out)
        wait_for_fault(rig, "config")
        check(rsu.stop()[1] == 0, "stops")


def verge_ctl_says_what_is_wrong_by_its_exit_code(rig):
    check(ctl(rig, "status")[0] == 69, "no socket: 69")
    code, _, error = ctl(rig, "status")
    check("expected a running verge-rsu" in error and error.count("\n") == 1, error)
    for wrong in ([], ["bogus"], ["status", "plans"], ["status", "--bogus"]):
        check(ctl(rig, *wrong)[0] == 64, f"{wrong}: 64")
    check(rig.run(rig.bin / "verge-ctl", "status", "--socket", "x" * 200)[0] == 64, "64")
    with Daemon(rig, rig.config(control="rsu.sock")) as rsu:
        check(ctl(rig, "status")[0] == 0, "0")
        check(rsu.stop()[1] == 0, "stops")
    check(ctl(rig, "status")[0] == 69, "a daemon that is gone: 69")
    # Somebody else's socket.
    path = rig.folder / "rsu.sock"
    other = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    other.bind(str(path))
    other.listen(1)
    child = subprocess.Popen([rig.bin / "verge-ctl", "status", "--socket", path],
                             stderr=subprocess.PIPE, text=True)
    end, _ = other.accept()
    end.recv(100)
    end.sendall(b"220 smtp\n")
    end.close()
    check(child.wait(10) == 69 and "no answer of a verge-rsu or verge-obu" in child.stderr.read(), "69")


def obeyed(text):
    """Characters that a terminal obeys, line breaks aside."""
    return [c for c in text if c != "\n" and (ord(c) < 32 or 127 <= ord(c) < 160)]


def control_sequences_of_a_server_do_not_reach_the_terminal(rig):
    path = rig.folder / "rsu.sock"
    other = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    other.bind(str(path))
    other.listen(1)
    with Daemon(rig, rig.config("b.json", control="b.sock")) as rsu:
        wait_for(lambda: "waiting" in rig.run(rig.bin / "verge-ctl", "status", "--socket",
                                              rig.folder / "b.sock")[1], "a cycle")
        good = json.loads(rig.run(rig.bin / "verge-ctl", "status", "--json", "--socket",
                                  rig.folder / "b.sock")[1])
    evil = "\x1b[2J\x1b]0;owned\x07\x9b31m\x7f\x08\r"
    status = dict(good, version=evil, state=evil, bus=evil, faults=[evil])
    status["status"] = dict(good["status"], config_crc32=evil, map_crc32=evil)
    status["status"]["rx_" + evil] = 5
    status["strangers"] = {evil: 5}
    plan = {"vehicle_id": 1, "status": 0, "cycle": 1, "points": [], evil: evil,
            "actions": [{"action": 99, "t1_ms": 1}]}
    vehicle = {"id": 1, "plan": evil, "age_ms": 1, "lane": 0, "target_lane": 0, "x": 0, "y": 0,
               "heading": 0, "speed": evil}
    answers = [("status", json.dumps(status)), ("status", json.dumps(status, ensure_ascii=False)),
               ("status", json.dumps(dict(good, status=evil))), ("status", evil),
               ("status", '{"' + evil + '": 1, "' + evil + '": 2}'), ("status", '{"a": ' + evil),
               ("status", json.dumps({evil: 1})), ("vehicles", json.dumps({"vehicles": [vehicle]})),
               ("plans", json.dumps({"plans": [plan]})), ("plans", json.dumps({"plans": evil})),
               ("reload", json.dumps({"accepted": False, "reason": evil})),
               ("reload", json.dumps({"accepted": evil, "reason": 1}))]
    for word, answer in answers:
        for options in ([], ["--json"]):
            child = subprocess.Popen([rig.bin / "verge-ctl", word, "--socket", path, *options],
                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            end, _ = other.accept()
            end.recv(100)
            end.sendall(answer.encode())
            end.close()
            out, error = (part.decode() for part in child.communicate(timeout=10))
            check(not obeyed(out) and not obeyed(error), f"{word} {options} {answer!r}: {out!r} {error!r}")
            if options and out:
                check(json.loads(out) == json.loads(answer, strict=False), "the same document")


def the_socket_is_for_its_group_and_is_not_left_behind(rig):
    path = rig.folder / "rsu.sock"
    config = rig.config(control="rsu.sock")
    with Daemon(rig, config) as rsu:
        check(stat.S_IMODE(path.stat().st_mode) == 0o660, oct(path.stat().st_mode))
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config)
        check(code == 71 and "another daemon" in error and error.count("\n") == 1, error)
        check(ctl(rig, "status")[0] == 0, "the first one goes on")
        rsu.process.kill()
        rsu.process.wait()
        check(path.exists(), "killed, it leaves its socket")
    with Daemon(rig, config) as rsu:
        check(ctl(rig, "status")[0] == 0, "and the next one replaces it")
        check(rsu.stop()[1] == 0, "stops")
    check(not path.exists(), "removed")
    path.write_text("a file of somebody's")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config)
    check(code == 71 and "no socket" in error, error)
    check(path.read_text() == "a file of somebody's", "left alone")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config",
                             rig.config(control=str(rig.folder / "no" / "folder.sock")))
    check(code == 71 and "control" in error and "folder" in error, error)


def clients_that_misbehave_delay_no_other_client(rig):
    path = rig.folder / "rsu.sock"
    with Daemon(rig, rig.config(control="rsu.sock", cycle_ms=20)) as rsu:
        check(b"unknown request" in talk(path, b"bogus\n"), "unknown")
        check(b"unknown request" in talk(path, b"x" * 5000), "too long")
        check(b"unknown request" in talk(path, b"a\0b\n"), "not a text")
        check(b"version" in talk(path, b"status\nplans\n"), "the first line counts")
        began = time.monotonic()
        silent = [talk(path, b"sta", keep_open=True) for _ in range(8)]
        status = json.loads(ctl(rig, "status", "--json")[1])["status"] # waits for their end
        ticks = (time.monotonic() - began) * 50
        check(ticks > 50 and status["cycle"] > 0.5 * ticks,
              f"cycles went on: {status['cycle']} in {ticks:.0f} ticks")
        for client in silent:
            client.close()
        # One that asks for much and never reads.
        deaf = [talk(path, b"status\n", keep_open=True) for _ in range(4)]
        check(ctl(rig, "status")[0] == 0, "others are served")
        for client in deaf:
            client.close()
        for _ in range(50):
            client = talk(path, b"status\n", keep_open=True)
            client.close()
        check(rsu.process.poll() is None and ctl(rig, "status")[0] == 0, "it lives")
        check(rsu.stop()[1] == 0, "stops")


# ---- Prometheus ---------------------------------------------------------------------------

NAMES = ["verge_build_info", "verge_start_time_seconds", "verge_state", "verge_fault",
         'verge_fault_active{fault="record"}',
         "verge_cycles_total", "verge_vehicles_seen", "verge_vehicles_controlled",
         'verge_cycle_seconds{stat="p99"}', "verge_deadline_misses_total",
         "verge_plans_sent_total", "verge_fallbacks_total", "verge_log_dropped_total",
         "verge_record_dropped_total", "verge_overruns_total", "verge_reordered_total",
         "verge_unstuck_total", "verge_states_unknown_target_total", "verge_bus_errors_total",
         'verge_rx_total{result="accepted"}', 'verge_rx_total{result="id_conflict"}',
         'verge_strangers_total{reason="forged"}', 'verge_arena_bytes{stat="size"}', "verge_nodes_peak"]


def figures_are_served_over_http_and_agree_with_the_status(rig):
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    config = rig.config(metrics={"listen": f"127.0.0.1:{port}"}, control="rsu.sock")
    with Daemon(rig, config) as rsu:
        # The planner's figures are those after a cycle.
        wait_for(lambda: json.loads(ctl(rig, "status", "--json")[1])["status"]["cycle"] > 0,
                 "a cycle")
        with urllib.request.urlopen(url + "/metrics", timeout=10) as answer:
            check(answer.status == 200, "200")
            check(answer.headers["Content-Type"].startswith("text/plain; version=0.0.4"), "type")
            values = figures(answer.read().decode())
        for name in NAMES:
            check(name in values or any(known.startswith(name + "{") for known in values), name)
        status = json.loads(ctl(rig, "status", "--json")[1])["status"]
        check(values['verge_arena_bytes{stat="size"}'] == status["arena_size_bytes"], "the same")
        check(values["verge_start_time_seconds"] * 1e6 - status["start_utime"] < 1, "the same")
        check(0 <= values["verge_cycles_total"] <= status["cycle"] + 1, "cycles")
        for path, method, code in (("/", "GET", 404), ("/metricsx", "GET", 404),
                                   ("/metrics", "POST", 405), ("/metrics", "HEAD", 405)):
            try:
                urllib.request.urlopen(urllib.request.Request(url + path, method=method),
                                       timeout=10)
                check(False, f"{method} {path} was answered")
            except urllib.error.HTTPError as answer:
                check(answer.code == code, f"{method} {path}: {answer.code}")
        for nonsense in (b"\r\n\r\n", b"x" * 4000, b"GET\r\n\r\n", b"\0\0\0\0"):
            with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
                client.sendall(nonsense)
                check(client.recv(100).startswith(b"HTTP/1.1 4"), nonsense[:10])
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config",
                                 rig.config("b.json", metrics={"listen": f"127.0.0.1:{port}"}))
        check(code == 71 and "metrics.listen" in error, error)
        check(rsu.stop()[1] == 0, "stops")


def the_metrics_file_is_whole_whenever_it_is_read(rig):
    path = rig.folder / "verge.prom"
    with Daemon(rig, rig.config(metrics={"file": "verge.prom"})) as rsu:
        wait_for(path.exists, "the file")
        seen = set()
        until = time.monotonic() + 20
        while len(seen) < 3:
            values = figures(path.read_text())
            check(all(n in values or any(k.startswith(n + "{") for k in values) for n in NAMES),
                  "a half was read")
            seen.add(values["verge_cycles_total"])
            check(time.monotonic() < until, "renewed each second")
        check(stat.S_IMODE(path.stat().st_mode) == 0o644 or os.umask(os.umask(0)) != 0o022, "mode")
        check(rsu.stop()[1] == 0, "stops")
        check(figures(path.read_text())["verge_state"] == 4, "the last one says stopping")
        check(not (rig.folder / "verge.prom.tmp").exists(), "nothing half is left")
    with Daemon(rig, rig.config(metrics={"file": "no/folder.prom"})) as rsu:
        rsu.wait_for("metrics_failed")
        time.sleep(2.2)
        check(rsu.text().count("metrics_failed") == 1, "told once, and it lives")
        check(rsu.stop()[1] == 0, "stops")


# ---- signals, reload ----------------------------------------------------------------------

def sigusr1_puts_the_statistics_into_the_log(rig):
    with Daemon(rig, rig.config(), "--log-level", "error") as rsu:
        rsu.signal(signal.SIGUSR1)
        rsu.wait_for("event=statistics state=")
        check("nodes_peak=0" in rsu.text(), rsu.text())
        check(rsu.stop()[1] == 0, "stops")


def a_reload_that_needs_a_restart_is_refused_with_the_remedy(rig):
    longer = {"lanes": [dict(ROAD["lanes"][0], left=None,
                             centerline=[[x, 0] for x in range(0, 1900, 10)])]}
    cases = [({"planner": dict(QUICK, nodes_max=512)}, "nodes_max"),
             ({"planner": dict(QUICK, vehicles_max=32)}, "memory"),
             ({"planner": dict(QUICK, controlled_max=4)}, "memory"),
             ({"road": longer}, "road"), ({"control": None}, "control"),
             ({"control": "other.sock"}, "control"),
             ({"metrics": {"file": "x"}}, "metrics.file"),
             ({"metrics": {"listen": "127.0.0.1:9464"}}, "metrics.listen"),
             ({"realtime": {"priority": 3}}, "realtime.priority"),
             ({"realtime": {"lock_memory": True}}, "realtime.lock_memory"),
             ({"realtime": {"cpus": [0]}}, "realtime.cpus")]
    with Daemon(rig, rig.config(control="rsu.sock")) as rsu:
        before = json.loads(ctl(rig, "status", "--json")[1])["status"]["config_crc32"]
        for change, word in cases:
            rig.config(**{"control": "rsu.sock", **change})
            code, out, _ = ctl(rig, "reload", "--json")
            reason = json.loads(out)["reason"]
            check(code == 1 and word in reason and "restarted" in reason, f"{change}: {reason}")
        status = wait_for_fault(rig, "config")
        check(status["status"]["config_crc32"] == before, "the old one holds")
        check(status["state"] == "degraded", "and it says so")
        # What leaves sizes and ends alone is taken, and ends the fault.
        rig.config(control="rsu.sock", planner=dict(QUICK, iterations=80, threads=2),
                   cycle_ms=60, log_format="json")
        check(ctl(rig, "reload")[0] == 0, "accepted")
        wait_for_fault(rig, "none")
        rsu.wait_for('"event":"config_applied"')
        check(rsu.stop()[1] == 0, "stops")


# ---- a full disk --------------------------------------------------------------------------

def a_full_disk_ends_the_recording_and_nothing_else(rig):
    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))
    log = rig.folder / "small.lcmlog"
    config = rig.config(cycle_ms=20, control="rsu.sock")
    with Daemon(rig, config, "--record", log, preexec_fn=small_files) as rsu:
        rsu.wait_for("record_ended")
        check(log.stat().st_size <= 8192, "as far as there was room")
        status = wait_for_fault(rig, "record")
        check(status["state"] == "degraded", status)
        check("record (2)" in ctl(rig, "status")[1], "in words, too")
        cycle = status["status"]["cycle"]
        wait_for(lambda: json.loads(ctl(rig, "status", "--json")[1])["status"]["cycle"] > cycle + 20,
                 "cycles go on")
        check(rsu.stop()[1] == 0, "stops")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", log)
    check(code == 0, f"what is there replays: {error}")


CASES = [
    verge_ctl_shows_the_state_for_people_and_for_programs,
    reload_answers_whether_the_configuration_was_taken,
    verge_ctl_says_what_is_wrong_by_its_exit_code,
    control_sequences_of_a_server_do_not_reach_the_terminal,
    the_socket_is_for_its_group_and_is_not_left_behind,
    clients_that_misbehave_delay_no_other_client,
    figures_are_served_over_http_and_agree_with_the_status,
    the_metrics_file_is_whole_whenever_it_is_read,
    sigusr1_puts_the_statistics_into_the_log,
    a_reload_that_needs_a_restart_is_refused_with_the_remedy,
    a_full_disk_ends_the_recording_and_nothing_else,
]

if __name__ == "__main__":
    args = case_arguments()
    sys.exit(run_cases(CASES, args.bin, args.only))
