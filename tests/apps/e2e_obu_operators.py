#!/usr/bin/env python3
"""The on-vehicle unit as a service, and against bad input: options, configuration, signals,
verge-ctl, metrics, log, local sockets; plans and states of strangers.

    python3 tests/apps/e2e_obu_operators.py --bin build/bin [--lcm-python VENV] [--only NAME]

Every case is a function whose name is its claim. The vehicle and the roadside unit are played here,
with Python's LCM client. Exit status as in e2e_lcm.py.
"""
import json
import os
import re
import signal
import socket
import struct
import sys
import time
import urllib.request

import e2e_lcm
import e2e_secure
from daemon_rig import QUICK, Daemon, check, shared_library, wait_for
from e2e_operators import figures, free_port

OWN = 7
LCM = "lcm:" + e2e_lcm.URL


class Obu(Daemon):
    """A running verge-obu."""

    PROGRAM = "verge-obu"

    def __init__(self, rig, config, *options, **more):
        super().__init__(rig, config, *options, log="obu.log", **more)


def configuration(rig, **changes):
    """Vehicle 7 with sockets for own states and trajectories; null removes a key."""
    return rig.config("obu.json", **{
        "format": "verge-obu/1", "rsu_id": None, "vehicle_id": OWN, "cycle_ms": 50,
        "state": f"unix:{rig.folder / 'own'}", "trajectory": f"unix:{rig.folder / 'made'}",
        "control": "obu.sock", "planner": dict(QUICK), **changes})


def obu(rig, *args):
    return rig.run(rig.bin / "verge-obu", *args)


def ctl(rig, *args):
    return rig.run(rig.bin / "verge-ctl", *args, "--socket", rig.folder / "obu.sock")


def status(rig):
    code, out, error = ctl(rig, "status", "--json")
    check(code == 0, error)
    return json.loads(out)


def with_checksum(message):
    message.crc32 = 0
    message.crc32 = e2e_lcm.signed(e2e_lcm.crc(message))
    return message.encode()


class Cabin:
    """The programs of the vehicle: localisation, which says that it drives straight ahead, and a
    controller, which only looks at the trajectories."""

    def __init__(self, rig, x=100.0):
        self.path = str(rig.folder / "own")
        self.vehicle = e2e_lcm.Vehicle(OWN, x, 0)
        self.out = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.ear = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.ear.bind(str(rig.folder / "made"))
        self.ear.setblocking(False)
        self.heard = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.out.close()
        self.ear.close()

    def x_at(self, seconds):
        return self.vehicle.x0 + self.vehicle.speed * (seconds - self.vehicle.began)

    def listen(self):
        while True:
            try:
                channel, _, body = self.ear.recv(4096)[8:].partition(b"\0")
            except BlockingIOError:
                return
            check(channel == b"VERGE_TRAJECTORY", channel)
            made = e2e_lcm.verge.vehicle_trajectory_t.decode(body)
            check(e2e_lcm.signed(e2e_lcm.crc(made)) == made.crc32, "crc32")
            check(made.vehicle_id == OWN, "of the own vehicle")
            self.heard.append(made)

    def drive(self, seconds, each=None):
        """States at 20 Hz for a while; `each` is called beside each of them."""
        for _ in range(round(seconds * 20)):
            body = with_checksum(self.vehicle.now())
            head = b"LC02" + struct.pack(">I", self.vehicle.sequence)
            try:
                self.out.sendto(head + b"VERGE_STATE\0" + body, self.path)
            except BlockingIOError:
                pass # it is busy: a state is lost
            if each:
                each()
            time.sleep(0.05)
            self.listen()

    def modes(self):
        return [(made.mode, made.mode_reason) for made in self.heard]


FOLLOWING, ALONE = 0, 2 # modes
NEVER_HEARD, OTHER_MAP, OTHER_VERSION = 3, 7, 8 # their reasons


class Rsu:
    """Plays the roadside unit: plans for the vehicle of a cabin, along its way at its speed."""

    def __init__(self, cabin, map_crc32, send, rsu_id=1):
        self.cabin, self.map_crc32, self.send, self.rsu_id = cabin, map_crc32, send, rsu_id
        self.cycle = self.utime = 0

    def plan(self, ahead=0.0, **changes):
        """ahead [m]: a plan that is not where the vehicle is."""
        self.cycle += 1
        now = time.time()
        plan = e2e_lcm.verge.vehicle_plan_t()
        plan.utime = self.utime = int(now * 1e6)
        plan.valid_until_utime = plan.utime + 3000000
        plan.rsu_id, plan.cycle, plan.plans_in_cycle = self.rsu_id, self.cycle, 1
        plan.vehicle_id, plan.state_utime = OWN, plan.utime - 50000
        plan.protocol_version, plan.map_crc32 = 1, self.map_crc32
        plan.why_vehicle = plan.why_lane = -1
        plan.action_count = 1
        plan.actions[0].t1_ms, plan.actions[0].speed, plan.actions[0].distance = 3000, 15.0, 45.0
        plan.point_count, plan.dt_ms, plan.digest = 31, 100, self.cycle
        for i, point in enumerate(plan.points):
            point.x = self.cabin.x_at(now + 0.1 * i) + ahead
            point.speed = 15.0
        for name, value in changes.items():
            setattr(plan, name, value)
        self.send(with_checksum(plan))


def map_of(rig, config):
    out = obu(rig, "--config", config, "--check-config")[1]
    return e2e_lcm.signed(int(re.search(r"map_crc32 0x([0-9a-f]{8})", out).group(1), 16))


def sender():
    """Sends plans on LCM, as another program than any other sender."""
    bus = e2e_lcm.lcm.LCM(e2e_lcm.URL)
    return lambda body: bus.publish("VERGE_PLAN", body)


# ---- options and configuration -------------------------------------------------------------

def wrong_options_and_configurations_have_their_exit_codes(rig):
    good = configuration(rig)
    check(obu(rig)[0] == 64, "no --config: 64")
    check(obu(rig, "--config", good, "--bogus")[0] == 64, "unknown option: 64")
    check(obu(rig, "--config", good, "--cycles", "0")[0] == 64, "no cycles: 64")
    check(obu(rig, "--config", rig.folder / "no.json")[0] == 66, "no file: 66")
    check(obu(rig, "--config", rig.folder)[0] in (66, 78), "a folder")
    check(obu(rig, "--config", configuration(rig, road=None, road_file="no.json"))[0] == 66,
          "no road file: 66")
    wrong = [({"vehicle_id": None}, "vehicle_id"), ({"vehicle_id": -1}, "vehicle_id"),
             ({"bogus": 1}, "bogus"), ({"state": "serial:1"}, "state"),
             ({"trajectory": "tcp:1"}, "trajectory"), ({"state": "unix:" + "x" * 200}, "unix:"),
             ({"bus": "lcm:udpm://nonsense"}, "nonsense"), ({"bus": f"unix:{rig.folder}/x"},
             "one direction"), ({"cycle_ms": 10}, "cycle_ms"),
             ({"format": "verge-rsu/1"}, "format"), ({"planner": {"controlled_max": 2}}, "controlled_max"), ({"repeat": 1}, "repeat")]
    for change, name in wrong:
        for options in (["--check-config"], []):
            code, _, error = obu(rig, "--config", configuration(rig, **change), *options)
            check(code == 78 and name in error and error.count("\n") == 1,
                  f"{change} {options}: exit {code}, told as {error!r}")


def the_printed_configuration_is_the_configuration(rig):
    config = configuration(rig)
    code, out, error = obu(rig, "--config", config, "--check-config")
    check(code == 0 and error == "" and out.count(" B ") == 4, f"memory: {out!r} {error!r}")
    check(not (rig.folder / "own").exists(), "no socket is left")
    code, out, error = obu(rig, "--config", config, "--print-config")
    document = json.loads(out)
    check(code == 0 and document["vehicle_id"] == OWN and document["planner"]["iterations"] == 60,
          error)
    again = rig.folder / "printed.json"
    again.write_text(out)
    check(obu(rig, "--config", again, "--print-config")[1] == out, "it prints itself")
    fewer = configuration(rig, planner={"vehicles_max": 4})
    planner = json.loads(obu(rig, "--config", fewer, "--print-config")[1])["planner"]
    check(planner["vehicles_max"] == 4 and planner["controlled_max"] == 1
          and planner["search"] == "policy", f"{planner}")


def without_a_bus_it_says_what_to_do_and_exits_69(rig):
    config = configuration(rig)
    code, _, error = rig.run("unshare", "-n", rig.bin / "verge-obu", "--config", config)
    check(code == 69 and "ip route add" in error, f"exit {code}: {error}")
    code, _, error = rig.run("unshare", "-n", rig.bin / "verge-obu", "--config", config,
                             "--check-config")
    check(code == 0 and "warning" in error and "ip route add" in error, f"exit {code}: {error}")
    with Obu(rig, config):
        other = configuration(rig, control=None)
        code, _, error = obu(rig, "--config", other)
        check(code == 69 and "own" in error and error.count("\n") == 1, f"exit {code}: {error}")
        code, _, error = obu(rig, "--config", other, "--check-config")
        check(code == 0 and ":state: warning: " in error, f"exit {code}: {error}")


# ---- the service ---------------------------------------------------------------------------

def it_ends_within_a_second_and_starts_again_also_after_a_kill(rig):
    config = configuration(rig)
    sockets = [rig.folder / "own", rig.folder / "obu.sock"]
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGKILL, signal.SIGTERM):
        with Obu(rig, config) as unit, Cabin(rig) as cabin:
            cabin.drive(0.5)
            check(len(cabin.heard) >= 3, f"{len(cabin.heard)} trajectories:\n{unit.text()}")
            began = time.monotonic()
            unit.signal(number)
            code = unit.process.wait(timeout=20)
            took = time.monotonic() - began
            check(took < 1.0, f"{number}: {took:.2f} s")
            killed = number == signal.SIGKILL
            check(code == (-number if killed else 0), f"{number}: exit {code}")
            check([path.exists() for path in sockets] == [killed, killed], "sockets")
            check(killed or "event=stopped" in unit.text(), unit.text())
        (rig.folder / "made").unlink()


def sighup_takes_a_good_configuration_and_keeps_the_old_one_on_error(rig):
    config = configuration(rig)
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        cabin.drive(0.5)
        first = status(rig)
        configuration(rig, rsu_id=4, log_format="json", cycle_ms=100)
        unit.signal(signal.SIGHUP)
        cabin.drive(0.5)
        unit.wait_for('"event":"config_applied"')
        second = status(rig)
        check(second["cycle_ms"] == 100 and second["config_crc32"] != first["config_crc32"],
              f"{second}")
        check(second["trajectories"]["alone"] >= first["trajectories"]["alone"], "counters stay")
        wrong = [({"vehicle_id": 8}, "vehicle_id"), ({"state": None}, "state"),
                 ({"trajectory": None}, "trajectory"), ({"control": "other.sock"}, "control"),
                 ({"bogus": 1}, "bogus"), ({"planner": dict(QUICK, vehicles_max=12)}, "memory")]
        for change, name in wrong:
            configuration(rig, **change)
            code, out, _ = ctl(rig, "reload", "--json")
            check(code == 1 and name in json.loads(out)["reason"], f"{change}: {out}")
        unit.wait_for('"event":"config_refused"', 3) # more are held back
        check(status(rig)["config_crc32"] == second["config_crc32"], "the old one holds")
        count = len(cabin.heard)
        cabin.drive(0.5)
        check(len(cabin.heard) >= count + 3, "trajectories go on")
        sequences = [made.sequence for made in cabin.heard]
        check(sequences == sorted(set(sequences)), f"sequence: {sequences}")
        check(unit.stop()[1] == 0, "stops")


def verge_ctl_shows_mode_vehicles_and_plan(rig):
    config = configuration(rig)
    crc, other = map_of(rig, config), e2e_lcm.Vehicle(2, 160, 1)
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        bus, rsu = e2e_lcm.Bus(), Rsu(cabin, crc, sender())
        code, out, _ = ctl(rig, "status")
        check(code == 0 and "vehicle 7: stopping, no_position" in out, out)
        check("own state        none" in out and "plan             none" in out, out)

        def beside():
            bus.send(other.now())
            rsu.plan()
        cabin.drive(1.0, beside)
        code, out, _ = ctl(rig, "status")
        check(code == 0 and "verge-obu" in out and "vehicle 7: following, none" in out, out)
        check("of roadside unit 1\n" in out and "neighbours       1\n" in out, out)
        check(f"bus              {LCM}\n" in out, out)
        document = status(rig)
        check(document["mode"] == "following" and document["rsu_id"] == 1
              and document["trajectories"]["following"] > 3 and document["plans"]["accepted"] >= 15,
              f"{document}")
        code, out, _ = ctl(rig, "vehicles")
        rows = {line.split()[0]: line.split() for line in out.splitlines()[1:]}
        check(code == 0 and set(rows) == {"7", "2"}, out)
        check(rows["7"][1] == "planned" and rows["2"][1] == "-" and rows["2"][3] == "1", out)
        code, out, _ = ctl(rig, "plans")
        check(code == 0 and out.count("\n") == 2 and "planned" in out and "KS to 3.0 s" in out, out)
        check(unit.stop()[1] == 0, "stops")


def figures_are_served_over_http_and_in_a_file(rig):
    port = free_port()
    config = configuration(rig, metrics={"listen": f"127.0.0.1:{port}", "file": "figures.prom"})
    names = ["verge_build_info", "verge_unit_mode", "verge_unit_reason", "verge_unit_neighbours",
             'verge_unit_trajectories_total{mode="alone"}', 'verge_rx_total{result="accepted"}',
             'verge_unit_plans_total{result="other_map"}', 'verge_strangers_total{reason="forged"}',
             'verge_cycle_seconds{stat="p99"}', "verge_deadline_misses_total",
             "verge_log_dropped_total", "verge_unit_own_id_elsewhere_total",
             "verge_unit_bus_errors_total"]
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        cabin.drive(1.3)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
            served = figures(answer.read().decode())
        written = figures((rig.folder / "figures.prom").read_text())
        for values in (served, written):
            for name in names:
                check(any(known.split("{")[0] == name or known == name for known in values), name)
        check(served["verge_unit_mode"] == ALONE and served["verge_unit_reason"] == NEVER_HEARD,
              f"{served}")
        check(served['verge_unit_trajectories_total{mode="alone"}'] >= 10, f"{served}")
        page = (e2e_lcm.SOURCE / "apps/man/verge-obu.8").read_text()
        told = set(re.findall(r"\bverge_\w+", page)) | {
            "verge_unit_bus_" + rest for rest in ("published_total", "malformed_total",
                                                  "foreign_total", "errors_total", "lost_total")}
        missing = {name.split("{")[0] for name in served} - told
        check(not missing, f"verge-obu(8) does not name {missing}")
        check(unit.stop()[1] == 0, "stops")


def each_line_of_the_log_is_json_on_request_and_a_mode_is_logged_once(rig):
    with Obu(rig, configuration(rig), "--log-format", "json") as unit, Cabin(rig) as cabin:
        cabin.drive(0.7)
        time.sleep(2.5) # no position any more
        cabin.drive(0.3)
        unit.signal(signal.SIGUSR1)
        unit.wait_for("statistics")
        check(unit.stop()[1] == 0, "stops")
        lines = [json.loads(line) for line in unit.text().splitlines()]
    modes = [(line["from"], line["to"], line["reason"]) for line in lines
             if line["event"] == "mode"]
    check(modes == [("none", "alone", "never_heard"), ("alone", "stopping", "no_position"),
                    ("stopping", "alone", "never_heard")], f"{modes}")
    events = [line["event"] for line in lines]
    check(events[0] == "READY" and "statistics" in events and events[-1] == "stopped", f"{events}")


# ---- bad input -----------------------------------------------------------------------------

def a_plan_of_another_map_or_version_is_not_followed(rig):
    config = configuration(rig)
    crc = map_of(rig, config)
    cases = [({"map_crc32": crc ^ 1}, OTHER_MAP, "other_map"),
             ({"map_crc32": 0}, OTHER_MAP, "other_map"),
             ({"protocol_version": 2}, OTHER_VERSION, "other_version")]
    for change, reason, name in cases:
        with Obu(rig, config) as unit, Cabin(rig) as cabin:
            rsu = Rsu(cabin, crc, sender())
            cabin.drive(1.0, lambda: rsu.plan(**change))
            told = cabin.modes()
            check(told[-1] == (ALONE, reason) and {mode for mode, _ in told} == {ALONE}, f"{told}")
            counts = status(rig)["plans"]
            check(counts["accepted"] == 0 and counts[name] >= 15, f"{change}: {counts}")
            unit.wait_for(f"event=plan_refused reason={name}")
            check(unit.text().count("event=plan_refused") <= 2, unit.text())
            rsu.plan()
            cabin.drive(0.5, rsu.plan)
            check(cabin.modes()[-1][0] == FOLLOWING, f"a right plan is followed: {cabin.modes()}")
            check(unit.stop()[1] == 0, "stops")
        (rig.folder / "made").unlink()


def forged_plans_on_signed_lcm_move_nothing(rig):
    e2e_secure.verge = e2e_lcm.verge
    if not e2e_secure.signing_is_built(rig):
        return "left out: this build has no OpenSSL"
    key = e2e_secure.write_key(rig.folder / "one.key")
    config = configuration(rig, lcm={"keys": [{"id": 1, "file": "one.key"}], "sign_with": 1})
    good, forger = e2e_secure.Signer(1, key), e2e_secure.Signer(1, os.urandom(32))
    crc = map_of(rig, config)
    with Obu(rig, config) as unit, Cabin(rig) as cabin, e2e_secure.Wire() as ours, \
            e2e_secure.Wire("127.0.0.9") as thief:
        seen = []

        def event(body):
            return b"VERGE_PLAN\0" + body
        rsu = Rsu(cabin, crc, lambda body: seen.append(
            ours.send(event(body), good.sign(event(body)))))
        unsigned = Rsu(cabin, crc, lambda body: thief.send(event(body)), 0)
        forged = Rsu(cabin, crc, lambda body: thief.send(event(body), forger.sign(event(body))), 0)

        def strangers():
            unsigned.plan()
            forged.plan()
        cabin.drive(0.6, strangers)
        check({mode for mode, _ in cabin.modes()} == {ALONE}, f"{cabin.modes()}")
        check(status(rig)["plans"] == dict.fromkeys(status(rig)["plans"], 0), "no plan is seen")
        first = len(cabin.heard)

        def all_of_them():
            rsu.plan()
            strangers()
            thief.out.sendto(seen[max(0, len(seen) - 2)], e2e_secure.GROUP) # a replay
        cabin.drive(1.5, all_of_them)
        told = cabin.heard[first + 6:]
        check(len(told) >= 15 and {made.mode for made in told} == {FOLLOWING}, f"{cabin.modes()}")
        check({made.rsu_id for made in told} == {1}, "only the unit with the key")
        counts = status(rig)
        for cause in ("unsigned", "forged", "replayed"):
            check(counts["strangers"][cause] >= 10, f"{cause}: {counts['strangers']}")
            unit.wait_for(f"was refused as {cause}: ")
        check("unsigned" in ctl(rig, "status")[1], "verge-ctl shows them")
        check(counts["plans"]["accepted"] <= rsu.cycle, f"{counts['plans']}")
        states = [event for channel, event in ours.heard() if channel == "VERGE_STATE"]
        check(len(states) >= 20 and all(e2e_secure.signature_holds(
            key, part[:-e2e_secure.TRAILER], part[-e2e_secure.TRAILER:]) for part in states),
            "the forwarded states are signed")
        check(unit.stop()[1] == 0, "stops")


def without_a_certificate_a_roadside_unit_on_secured_dds_is_not_heard(rig):
    """Three roadside units plan for the vehicle, whose states they receive on LCM; the vehicle
    receives plans on DDS."""
    if not e2e_secure.dds_is_built(rig):
        return "left out: this build has no DDS"
    ours, foreign = (e2e_secure.certificates(rig, name, "rsu", "vehicle")
                     for name in ("ours", "foreign"))

    def security(papers, who):
        options = json.loads((papers / f"{who}.options.json").read_text())["dds"]["security"]
        return {"security": {key: str(papers / path) for key, path in options.items()}}
    config = configuration(rig, bus="dds:0", dds=security(ours, "vehicle"))
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        bus = e2e_lcm.Bus()

        def on_lcm():
            bus.send(cabin.vehicle.now())
            bus.listen(0.01)
        for dds, mode in ((None, ALONE), (security(foreign, "rsu"), ALONE),
                          (security(ours, "rsu"), FOLLOWING)):
            rsu_config = rig.config("rsu.json", bus=[LCM, "dds:0"], dds=dds, cycle_ms=200)
            with Daemon(rig, rsu_config):
                until = time.monotonic() + (20 if mode == FOLLOWING else 4)
                while time.monotonic() < until and (FOLLOWING, 0) not in cabin.modes():
                    cabin.drive(0.2, on_lcm)
                check(len(bus.plans) > 0 or mode == FOLLOWING, "the roadside unit plans for it")
                bus.plans.clear()
                check(cabin.modes()[-1][0] == mode, f"{dds}: {cabin.modes()}\n{unit.text()}")
            if mode == ALONE:
                check(status(rig)["plans"]["accepted"] == 0, "no plan is seen")
        check("event=bus_complaint" in unit.text(), unit.text())
        check(unit.stop()[1] == 0, "stops")


def senders_that_babble_or_use_the_id_of_the_roadside_unit_do_not_replace_its_plans(rig):
    config = configuration(rig)
    crc = map_of(rig, config)
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        rsu, twin = Rsu(cabin, crc, sender()), Rsu(cabin, crc, sender())
        later = Rsu(cabin, crc, sender(), 2)
        bus = e2e_lcm.Bus()
        crowd = [e2e_lcm.Vehicle(number, 1500, 1) for number in range(200, 260)]
        cabin.drive(0.5, rsu.plan)

        def babble():
            rsu.plan()
            rsu.plan(ahead=30.0, utime=rsu.utime + 1000)
            rsu.cycle -= 1
            for _ in range(30): # 600 a second of each
                twin.plan(ahead=30.0)
                later.plan(ahead=30.0)
            for vehicle in crowd:
                bus.send(vehicle.now())
        first = len(cabin.heard)
        began = time.monotonic()
        cabin.drive(1.5, babble)
        took = time.monotonic() - began
        told = [made for made in cabin.heard[first:]]
        check({made.mode for made in told} <= {FOLLOWING}, f"{cabin.modes()}")
        counts = status(rig)
        for name, least in (("same_id", 500), ("other_rsu", 500), ("too_soon", 25)):
            check(counts["plans"][name] >= least, f"{name}: {counts['plans']}")
        check(len(told) >= 0.8 * took / 0.05, f"{len(told)} trajectories in {took:.1f} s")
        check(counts["counters"]["left_out"] > 0, "the nearest vehicles only")
        check(unit.text().count("event=plan_refused") <= 6, unit.text())
        check(unit.stop()[1] == 0, "stops")


def the_own_id_from_another_sender_does_not_move_the_vehicle(rig):
    config = configuration(rig)
    with Obu(rig, config) as unit, Cabin(rig) as cabin:
        bus, ghost = e2e_lcm.Bus(), e2e_lcm.Vehicle(OWN, 900, 1)
        cabin.drive(1.5, lambda: bus.send(ghost.now()))
        off = [abs(made.points[0].x - cabin.x_at(made.utime * 1e-6)) for made in cabin.heard]
        check(len(off) >= 15 and max(off) < 3.0, f"{max(off):.1f} m")
        check({mode for mode, _ in cabin.modes()} == {ALONE}, f"{cabin.modes()}")
        counts = status(rig)
        check(counts["counters"]["own_id_elsewhere"] >= 20, f"{counts}")
        check(counts["neighbours"] == 0, f"{counts}")
        unit.wait_for("event=own_id_elsewhere")
        check(unit.stop()[1] == 0, "stops")


def states_that_are_no_messages_or_of_others_change_nothing_on_the_own_socket(rig):
    with Obu(rig, configuration(rig)) as unit, Cabin(rig) as cabin:
        other = e2e_lcm.Vehicle(9, 100, 0)

        def rubbish():
            for datagram in (b"", b"LC02", os.urandom(200),
                             b"LC02" + bytes(4) + b"VERGE_STATE\0" + with_checksum(other.now())):
                try:
                    cabin.out.sendto(datagram, cabin.path)
                except BlockingIOError:
                    pass
        cabin.drive(1.0, rubbish)
        check({mode for mode, _ in cabin.modes()} == {ALONE}, f"{cabin.modes()}")
        counts = status(rig)
        check(counts["neighbours"] == 0 and counts["counters"]["bus_malformed"] >= 20, f"{counts}")
        check(unit.stop()[1] == 0, "stops")


# ---- memory --------------------------------------------------------------------------------

def cycles_on_lcm_allocate_nothing(rig):
    if rig.sanitized():
        return "left out: a sanitizer brings a heap of its own"
    guard, counts = shared_library(rig, "heap_guard"), rig.folder / "heap.txt"
    port = free_port()
    config = configuration(rig, cycle_ms=20, log_format="json", planner=dict(QUICK, iterations=20),
                           metrics={"listen": f"127.0.0.1:{port}", "file": "heap.prom"})
    crc = map_of(rig, config)
    env = {"LD_PRELOAD": guard, "HEAP_GUARD_FILE": str(counts)}
    with Obu(rig, config, env=env) as unit, Cabin(rig) as cabin:
        bus, rsu = e2e_lcm.Bus(), Rsu(cabin, crc, sender())
        others = [e2e_lcm.Vehicle(2, 130, 0), e2e_lcm.Vehicle(3, 80, 1)]

        def alone():
            for vehicle in others:
                bus.send(vehicle.now())

        def planned():
            alone()
            rsu.plan()
        cabin.drive(0.5, planned)
        unit.signal(signal.SIGUSR2)
        first = status(rig)["counters"]["cycles"]
        for each in (planned, alone, lambda: rsu.plan(ahead=5.0), planned, lambda: None):
            cabin.drive(2.0, each)
            for what in ("status", "vehicles", "plans"):
                check(ctl(rig, what)[0] == 0, what)
            urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10).read()
            unit.signal(signal.SIGUSR1)
        time.sleep(2.5) # and without a position, and with a full queue of trajectories
        last = status(rig)
        cycles = last["counters"]["cycles"] - first
        unit.signal(signal.SIGUSR2)
        text = wait_for(lambda: counts.exists() and counts.read_text(), "the counts").split()
        check(cycles >= 500 and min(last["trajectories"].values()) > 0, f"{last}")
        check(last["counters"]["bus_errors"] > 0, f"{last}")
        check(text[:4] == ["allocations", "0", "frees", "0"], " ".join(text))


CASES = [
    wrong_options_and_configurations_have_their_exit_codes,
    the_printed_configuration_is_the_configuration,
    without_a_bus_it_says_what_to_do_and_exits_69,
    it_ends_within_a_second_and_starts_again_also_after_a_kill,
    sighup_takes_a_good_configuration_and_keeps_the_old_one_on_error,
    verge_ctl_shows_mode_vehicles_and_plan,
    figures_are_served_over_http_and_in_a_file,
    each_line_of_the_log_is_json_on_request_and_a_mode_is_logged_once,
    a_plan_of_another_map_or_version_is_not_followed,
    forged_plans_on_signed_lcm_move_nothing,
    without_a_certificate_a_roadside_unit_on_secured_dds_is_not_heard,
    senders_that_babble_or_use_the_id_of_the_roadside_unit_do_not_replace_its_plans,
    the_own_id_from_another_sender_does_not_move_the_vehicle,
    states_that_are_no_messages_or_of_others_change_nothing_on_the_own_socket,
    cycles_on_lcm_allocate_nothing,
]

if __name__ == "__main__":
    sys.exit(e2e_lcm.main(CASES))
