"""The daemon from outside, on a real LCM bus, with another project's LCM client as the vehicles.

    python3 tests/apps/e2e_lcm.py --bin build/bin [--lcm-python VENV] [--only NAME]

Exit status 0: passed; 1: failed (reason on standard error); 77: skipped, because the Python
package lcm, lcm-gen or a private network is missing on this machine.
Every case is a function whose name is its claim. The types are made by lcm-gen from
transport/types/verge.lcm, so that names, order and checksums of the fields are compared with an
independent implementation.
"""
import collections
import json
import math
import os
import pathlib
import random
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request
import zlib

import daemon_rig
from daemon_rig import (QUICK, SOURCE, Daemon, case_arguments, check, run_cases,
                        shared_library)
from e2e_operators import ctl

URL = "udpm://239.255.76.67:7667?ttl=0"
GROUP = ("239.255.76.67", 7667)
CANCELLED = 3
OVERRUN = 6 # a reason

def skip(why):
    print("SKIPPED: " + why, file=sys.stderr)
    sys.exit(77)


class Rig(daemon_rig.Rig):
    """On LCM, ten cycles a second."""

    BUS, CYCLE_MS = "lcm:" + URL, 100


class Bus:
    """The vehicles' side: publishes states, collects plans and statuses."""

    def __init__(self, url=URL):
        self.lcm = lcm.LCM(url)
        self.plans, self.statuses = [], []
        self.overruns = [] # what goes out when a cycle is late: on a busy machine, or on purpose
        self.lcm.subscribe("VERGE_PLAN", lambda _, data: self.on_plan(
            (time.time(), verge.vehicle_plan_t.decode(data), data)))
        self.lcm.subscribe("VERGE_STATUS", lambda _, data: self.statuses.append(
            (time.time(), verge.rsu_status_t.decode(data), data)))

    def on_plan(self, heard):
        (self.overruns if heard[1].reason == OVERRUN else self.plans).append(heard)

    def send(self, state):
        state.crc32 = 0
        state.crc32 = signed(crc(state))
        self.lcm.publish("VERGE_STATE", state.encode())

    def listen(self, seconds):
        until = time.monotonic() + seconds
        while True:
            left = until - time.monotonic()
            if left <= 0:
                return
            if select.select([self.lcm.fileno()], [], [], left)[0]:
                self.lcm.handle()

    def drive(self, vehicles, seconds, hz=10):
        """Publishes every vehicle's state at hz, listening in between."""
        began = time.monotonic()
        for tick in range(int(seconds * hz)):
            for vehicle in vehicles:
                self.send(vehicle.now())
            self.listen(max(0.0, began + (tick + 1) / hz - time.monotonic()))


def crc(message):
    return zlib.crc32(message.encode()[8:-4])


def signed(number):
    return struct.unpack(">i", struct.pack(">I", number))[0]


class Vehicle:
    """Drives straight ahead at constant speed and follows no plan."""

    def __init__(self, number, x, lane, speed=15.0, controlled=True, target=-1):
        self.number, self.x0, self.y = number, x, 3.75 * lane
        self.speed, self.controlled, self.target = speed, controlled, target
        self.began, self.sequence = time.time(), 0

    def now(self):
        state = verge.vehicle_state_t()
        now = time.time()
        self.sequence += 1
        state.utime = int(now * 1e6)
        state.vehicle_id, state.sequence = self.number, self.sequence
        state.controlled = 1 if self.controlled else 0
        state.x, state.y = self.x0 + self.speed * (now - self.began), self.y
        state.speed, state.yaw_rate = self.speed, math.nan
        state.length, state.width = 5.0, 2.0
        state.position_sigma = state.cooperation = math.nan
        state.target_lane, state.habit, state.followed_cycle = self.target, 1, -1
        return state


def three_and_a_human():
    return [Vehicle(1, 40, 0), Vehicle(2, 40, 1), Vehicle(3, 120, 0, target=1),
            Vehicle(8, 120, 1, controlled=False)]


def digests_of(bus):
    """cycle -> digest, of the planned messages."""
    digests = {}
    for _, plan, _ in bus.plans:
        if plan.status != CANCELLED:
            known = digests.setdefault(plan.cycle, plan.digest)
            check(known == plan.digest, f"cycle {plan.cycle} has two digests")
    return digests


# ---- cases ----------------------------------------------------------------------------------

def without_a_bus_it_says_what_to_do_and_exits_69(rig):
    config = rig.config()
    for program in (["verge-rsu", "--config", config],
                    ["verge-publish", SOURCE / "apps/scenarios/ramp-case1.json", "--bus",
                     "lcm:" + URL, "--quiet"]):
        code, _, error = rig.run("unshare", "-n", rig.bin / program[0], *program[1:])
        check(code == 69, f"{program[0]}: exit {code}, expected 69: {error}")
        check("ip route add" in error, f"{program[0]} does not say what to do: {error}")
    code, _, error = rig.run("unshare", "-n", rig.bin / "verge-rsu", "--config", config,
                             "--check-config")
    check(code == 0 and "warning" in error and "ip route add" in error,
          f"--check-config: exit {code}, told as {error!r}")


def wrong_options_and_configurations_have_their_exit_codes(rig):
    rsu = rig.bin / "verge-rsu"
    check(rig.run(rsu)[0] == 64, "no --config: 64")
    check(rig.run(rsu, "--config", rig.config(), "--bogus")[0] == 64, "unknown option: 64")
    for number, told in (("-1", "not a whole number"), ("x", "not a whole number"),
                         ("0", "1 to 2147483647"), ("9" * 30, "at most"), ("9" * 30 + "x", "digits")):
        code, _, error = rig.run(rsu, "--config", rig.config(), "--cycles", number)
        check(code == 64 and told in error, f"--cycles {number}: exit {code}, told as {error!r}")
    check(rig.run(rsu, "--config", rig.folder / "no.json")[0] == 66, "no config file: 66")
    check(rig.run(rsu, "--config", rig.config(), "--replay", rig.folder / "no.log")[0] == 66,
          "no log: 66")
    check(rig.run(rsu, "--config", rig.config(road=None, road_file="no.json"))[0] == 66,
          "no road file: 66")
    wrong = [({"bogus": 1}, "bogus"), ({"cycle_ms": 9}, "cycle_ms"), ({"bus": "tcp:x"}, "bus"),
             ({"bus": "lcm:udpm://nonsense"}, "nonsense"), ({"road": None}, "road"),
             ({"planner": {"iterations": 0}}, "iterations"), ({"format": "x"}, "format"),
             ({"planner": {"bogus": 1}}, "bogus"), ({"freshness": {"fresh_ms": 1}}, "fresh_ms"),
             ({"freshness": {"fresh_ms": 500, "obstacle_ms": 400}}, "obstacle_ms"),
             ({"rsu_id": "one"}, "rsu_id"), ({"bus": "dds:231"}, "0 to 230"),
             ({"dds": {"domain": 1}}, "domain"), ({"lcm": {"bogus": 1}}, "bogus"),
             ({"dds": {"interfaces": [""]}}, "dds.interfaces[0]")]
    for change, name in wrong:
        code, _, error = rig.run(rsu, "--config", rig.config(**change), "--check-config")
        check(code == 78, f"{change}: exit {code}, expected 78")
        check(name in error and error.count("\n") == 1, f"{change}: told as {error!r}")
    for key in ("freshness", "planner", "road", "road_file", "bus", "rsu_id", "cycle_ms"):
        document = json.loads(rig.config().read_text())
        null = rig.folder / "null.json"
        null.write_text(json.dumps({**document, key: None}))
        code, _, error = rig.run(rsu, "--config", null, "--check-config")
        check(code == 78 and error.startswith(f"{null}:{key}: ") and error.count("\n") == 1,
              f"{key} null: exit {code}, told as {error!r}")


def the_printed_configuration_is_the_configuration(rig):
    rsu = rig.bin / "verge-rsu"
    code, out, error = rig.run(rsu, "--config", rig.config(), "--check-config")
    check(code == 0 and out.count(" B ") >= 3, f"memory budget: {out!r} {error!r}")
    code, out, error = rig.run(rsu, "--config", rig.config(), "--print-config")
    document = json.loads(out)
    check(code == 0 and document["planner"]["iterations"] == 60, error)
    check(len(document["planner"]) > 30, "every planner parameter is there")
    again = rig.folder / "printed.json"
    again.write_text(out)
    check(rig.run(rsu, "--config", again, "--print-config")[1] == out, "it prints itself")
    example = SOURCE / "apps/scenarios/rsu-ramp.json"
    code, out, error = rig.run(rsu, "--config", example, "--check-config")
    check(code == 0, "the example is right")
    lanes = [line for line in out.splitlines() if line.startswith("lane ")]
    check(len(lanes) == 4 and all(" m/s" in line for line in lanes), f"a line a lane: {out!r}")
    check("road.lanes[" not in error, f"nothing is odd about its road: {error!r}")
    road = {"lanes": [{"id": 7, "centerline": [[0, 0], [60, 0], [40, 60]], "width": 3.5,
                       "speed_limit": 14, "left": 8},
                      {"id": 8, "centerline": [[0, 40], [60, 40]], "width": 3.5, "speed_limit": 14}]}
    code, out, error = rig.run(rsu, "--config", rig.config(road=road), "--check-config")
    check(code == 0 and "road.lanes[0].centerline: warning: bends with a radius of" in error
          and "road.lanes[0].left: warning: lane 8 " in error, f"an odd road: {error!r}")
    out = rig.run(rsu, "--config", example, "--print-config")[1]
    again.write_text(out)
    check(rig.run(rsu, "--config", again, "--print-config", cwd="/")[1] == out, "anywhere")


def one_plan_a_vehicle_a_cycle_and_it_replays_to_the_same_digests(rig):
    config, log = rig.config(), rig.folder / "live.lcmlog"
    tapped = rig.folder / "tapped.lcmlog"
    tap = subprocess.Popen(["lcm-logger", "--lcm-url=" + URL, "-f", "-q", str(tapped)],
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with Daemon(rig, config, "--record", log) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 4.0)
        cycles = collections.Counter(p.cycle for _, p, _ in bus.plans)
        full = [c for c, n in cycles.items() if n == 3]
        check(len(cycles) >= 30, f"{len(cycles)} cycles in 4 s at 100 ms")
        # The first cycles may fall between the vehicles' first messages.
        check(len(full) >= len(cycles) - 2, f"cycles without a plan for each: {cycles}")
        seen = sorted(cycles)
        check(seen[-1] - seen[0] + 1 == len(seen), "no cycle is missing")
        judge_plans(bus, vehicles)
        judge_status(bus)
        took, code = rsu.stop()
        bus.listen(0.3)
        check(code == 0 and took < 1.0, f"SIGTERM: exit {code} in {took:.2f} s")
        last = {p.vehicle_id: p.status for _, p, _ in bus.plans}
        check(last == {1: CANCELLED, 2: CANCELLED, 3: CANCELLED}, f"cancelled at stop: {last}")
        check(bus.statuses[-1][1].state == 4, "the last status says stopping")
    tap.send_signal(signal.SIGINT)
    tap.wait(timeout=5)

    live = digests_of(bus)
    code, out, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", log)
    check(code == 0, error)
    lines = [json.loads(line) for line in out.splitlines()]
    replayed = {line["cycle"]: line["digest"] for line in lines if line["vehicles"] > 0}
    expected = {cycle: f"{digest & (2**64 - 1):016x}" for cycle, digest in live.items()}
    check(replayed == expected, "the recording replays to the live digests")

    code, out, error = rig.run(rig.bin / "verge-replay", log, "--config", config)
    check(code == 0 and "same" in out, f"verge-replay: {code} {out} {error}")
    spoiled = {**os.environ, "LD_PRELOAD": shared_library(rig, "rounding")}
    code, again, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", log,
                                 env=spoiled)
    check(code == 0 and [json.loads(line) for line in again.splitlines()] == lines,
          "a library that changes how numbers are rounded changes no digest")
    code, out, error = rig.run(rig.bin / "verge-replay", log, "--config", config, env=spoiled)
    check(code == 0 and "same" in out, f"nor for verge-replay: {code} {out} {error}")
    other = rig.config("other.json", planner=dict(QUICK, steps=5, iterations=30))
    code, out, _ = rig.run(rig.bin / "verge-replay", log, "--config", other)
    check(code == 1 and "cycle" in out, f"another configuration: {code} {out}")

    runs = [rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", tapped)
            for _ in range(2)]
    check(runs[0][0] == 0 and runs[0][1] == runs[1][1], "lcm-logger's log replays the same twice")
    lines = [json.loads(line) for line in runs[0][1].splitlines()]
    check(sum(line["vehicles"] == 3 for line in lines) >= 30, "and has its plans")
    check(all(line["utime"] % 100000 == 0 for line in lines), "at multiples of cycle_ms")

    # The replay may itself be recorded, and that recording replays.
    again = rig.folder / "again.lcmlog"
    code, out, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--replay", tapped,
                               "--record", again)
    check(code == 0 and rig.run(rig.bin / "verge-replay", again, "--config", config)[0] == 0,
          "a recorded replay replays")


def judge_plans(bus, vehicles):
    """Every plan message by itself, against what its vehicle said of itself."""
    in_time = sum(plan.point_count == 31 for _, plan, _ in bus.plans)
    check(in_time > 0.8 * len(bus.plans), f"only {in_time} of {len(bus.plans)} plans in time")
    by_id = {vehicle.number: vehicle for vehicle in vehicles}
    for arrival, plan, data in bus.plans:
        check(len(data) + 8 + len("VERGE_PLAN") + 1 <= 1472, "one datagram")
        check(signed(crc(plan)) == plan.crc32, "crc32")
        check(by_id[plan.vehicle_id].controlled, "plans only for those who ask")
        check(plan.rsu_id == 5 and plan.status in (0, 1, 2), f"status {plan.status}")
        check(0 < plan.point_count <= 31 and 0 < plan.action_count <= 10, "counts")
        check(plan.valid_until_utime > plan.utime, "valid for a while")
        if plan.point_count < 31:
            continue # it was late: it begins where it still holds
        check(0 <= plan.utime - plan.state_utime <= 300000, "from a fresh state")
        check(abs(arrival * 1e6 - plan.utime) < 2e6, "of now")
        vehicle = by_id[plan.vehicle_id]
        x = vehicle.x0 + vehicle.speed * (plan.utime * 1e-6 - vehicle.began)
        check(abs(plan.points[0].x - x) < 0.01, f"point 0 is at {plan.points[0].x}, not {x}")
        check(abs(plan.points[0].y - vehicle.y) < 1e-6, "point 0 is where it is")
        ends = [plan.actions[i].t1_ms for i in range(plan.action_count)]
        check(ends[0] > 0 and ends == sorted(ends), "actions in the order of time")


def judge_status(bus):
    states = [status.state for _, status, _ in bus.statuses]
    check(states[-1] == 2, f"running in the end: {states}")
    times = [arrival for arrival, _, _ in bus.statuses]
    check(max(b - a for a, b in zip(times, times[1:])) < 1.5, "a status each second")
    status = bus.statuses[-1][1]
    check(signed(crc(status)) == status.crc32, "crc32")
    check(status.vehicles_seen == 4 and status.vehicles_controlled == 3, "who is there")
    check(status.version == 100 and status.rsu_id == 5, "version, id")
    check(status.plans_sent > 80 and status.rx_accepted > 100, "counted")
    check(0 < status.arena_peak_bytes <= status.arena_size_bytes, "arena")
    check(status.map_crc32 != 0 and status.config_crc32 != 0, "checksums")
    check(0 < status.cycle_us_last <= status.cycle_us_max, "cycle times")


def a_silent_vehicle_is_cancelled_once_and_planned_again_when_it_sends(rig):
    log = rig.folder / "silent.lcmlog"
    with Daemon(rig, rig.config(), "--record", log) as rsu:
        bus = Bus()
        first, second = Vehicle(1, 40, 0), Vehicle(2, 40, 1)
        bus.drive([first, second], 1.0)
        bus.plans.clear()
        bus.drive([second], 2.5)
        told = [(at, p) for at, p, _ in bus.plans if p.vehicle_id == 1]
        cancelled = [p for _, p in told if p.status == CANCELLED]
        check(len(cancelled) == 1 and told[-1][1] is cancelled[0], f"{len(cancelled)} cancelled")
        check(cancelled[0].reason == 7 and cancelled[0].point_count == 0, "for its age")
        check(sum(p.vehicle_id == 2 for _, p, _ in bus.plans) >= 20, "the other one goes on")
        bus.drive([first, second], 0.5)
        rsu.signal(signal.SIGINT) # which stops it like SIGTERM
        check(rsu.process.wait(20) == 0, "stops")
        bus.listen(0.3)
        last = {p.vehicle_id: p.status for _, p, _ in bus.plans}
        check(last == {1: CANCELLED, 2: CANCELLED}, f"cancelled at stop: {last}")
        check(bus.statuses[-1][1].state == 4, "the last status says stopping")
    cycles = cycles_until_planned(log, 1)
    check(cycles <= 2, f"{cycles} cycles until it was planned again")


def hostile_traffic_is_counted_and_no_plan_is_missing(rig):
    rng = random.Random(1)
    with Daemon(rig, rig.config()) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 1.0)
        attacker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        attacker.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        good = vehicles[0].now()
        good.crc32 = signed(crc(good))
        frame = struct.pack(">II", 0x4c433032, 1) + b"VERGE_STATE\0" + good.encode()

        def bad_state(**changes):
            state = vehicles[0].now()
            for name, value in changes.items():
                setattr(state, name, value)
            bus.send(state)

        bus.plans.clear()
        for _ in range(20):
            for _ in range(40):
                kind = rng.randrange(4)
                if kind == 0:
                    data = rng.randbytes(rng.randrange(1, 1400))
                elif kind == 1:
                    data = frame[:rng.randrange(len(frame))]
                elif kind == 2:
                    data = bytearray(frame)
                    data[rng.randrange(28, len(data))] ^= 1 << rng.randrange(8)
                else:
                    data = struct.pack(">IIIIHH", 0x4c433033, 7, 100, 0xfffffff0, 1, 3) + frame
                attacker.sendto(bytes(data), GROUP)
            bad_state(x=math.nan)
            bad_state(speed=-3.0)
            bad_state(y=500.0, vehicle_id=99)
            bad_state(protocol_version=9, vehicle_id=98)
            bad_state(utime=int(time.time() * 1e6) + 10**6)
            bad_state(utime=int(time.time() * 1e6) - 10**7)
            bus.drive(vehicles, 0.1)
        bus.drive(vehicles, 1.2)
        status = bus.statuses[-1][1]
        check(status.rx_malformed >= 300, f"malformed {status.rx_malformed}")
        check(status.rx_version >= 10, f"unknown version {status.rx_version}")
        check("event=unknown_version protocol_version=9 expected=1" in rsu.text(), "it is named")
        check(all(plan.protocol_version == 1 and plan.map_crc32 == status.map_crc32
                  for _, plan, _ in bus.plans), "plans state version and road")
        for name in ("rx_out_of_range", "rx_off_map", "rx_future", "rx_stale"):
            check(getattr(status, name) > 0, f"{name} counted")
        cycles = collections.Counter(p.cycle for _, p, _ in bus.plans)
        seen = sorted(cycles)
        check(seen[-1] - seen[0] + 1 == len(seen), "no cycle was lost")
        # The first and the last may be cut by our own listening.
        check(all(cycles[c] == 3 for c in seen[1:-1]), f"a plan was lost: {cycles}")
        check(rsu.stop()[1] == 0, "and it stops in order")


def sighup_swaps_a_good_configuration_and_keeps_the_old_one_on_error(rig):
    config = rig.config()
    with Daemon(rig, config) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 1.2)
        before = bus.statuses[-1][1]
        config.write_text("{ not json")
        rsu.signal(signal.SIGHUP)
        bus.drive(vehicles, 1.2)
        status = bus.statuses[-1][1]
        check(status.config_crc32 == before.config_crc32, "the old one holds")
        check(status.state == 3 and status.fault != 0, "and it says so")
        check("config_refused" in rsu.text(), "in the log, too")
        rig.config(rsu_id=6, cycle_ms=200)
        rsu.signal(signal.SIGHUP)
        bus.drive(vehicles, 0.5)
        bus.plans.clear()
        bus.drive(vehicles, 2.0)
        status = bus.statuses[-1][1]
        check(status.config_crc32 != before.config_crc32 and status.state == 2, "the new one")
        check(all(p.rsu_id == 6 for _, p, _ in bus.plans), "the new id")
        cycles = {p.cycle for _, p, _ in bus.plans}
        check(8 <= len(cycles) <= 12, f"{len(cycles)} cycles in 2 s, expected 10")


def sighup_may_name_another_bus(rig):
    with Daemon(rig, rig.config(), "--log-level", "error") as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 0.5)
        check(len(bus.plans) > 0, "plans here")
        rig.config(bus="lcm:" + URL.replace("7667", "7669"))
        rsu.signal(signal.SIGHUP)
        bus.drive(vehicles, 0.5)
        bus.plans.clear()
        bus.drive(vehicles, 0.5)
        check(bus.plans == [], "no plans here any more")
        there = Bus(URL.replace("7667", "7669"))
        there.drive(vehicles, 1.0)
        check(len(there.plans) >= 20, f"{len(there.plans)} plans there")
        check(rsu.stop()[1] == 0, "stops")


def a_long_planning_step_does_not_delay_stopping(rig):
    slow = dict(iterations=1000000, nodes_max=1000000, steps=16)
    with Daemon(rig, rig.config(cycle_ms=20, planner=slow)) as rsu:
        bus = Bus()
        bus.drive(three_and_a_human(), 1.5)
        status = bus.statuses[-1][1]
        check(status.deadline_misses > 0 and status.state == 3, "it says that it is late")
        took, code = rsu.stop()
        check(code == 0 and took < 1.0, f"SIGTERM: exit {code} in {took:.2f} s")


def cycles_until_planned(log, number):
    """In a recording, after the vehicle's last silence of a second: how many cycles began between
    its first accepted state and its first plan."""
    last, cycles, planned = None, None, False
    for event in lcm.EventLog(str(log)):
        if event.channel == "VERGE_STATE":
            if verge.vehicle_state_t.decode(event.data).vehicle_id == number:
                if last is not None and event.timestamp - last > 1000000:
                    cycles, planned = 0, False
                last = event.timestamp
        elif event.channel == "VERGE_CYCLE" and cycles is not None and not planned:
            cycles += struct.unpack(">i", event.data[24:28])[0] == 0 # an overrun is no cycle
        elif event.channel == "VERGE_PLAN" and cycles is not None:
            plan = verge.vehicle_plan_t.decode(event.data)
            planned = planned or (plan.vehicle_id == number and plan.status != CANCELLED)
    check(cycles is not None and planned, f"vehicle {number} fell silent and was planned again")
    return cycles


def plans_resume_within_two_cycles_when_the_bus_comes_back(rig):
    def ip(*args):
        subprocess.run(["ip", *args], check=True)
    log = rig.folder / "back.lcmlog"
    with Daemon(rig, rig.config(control="rsu.sock"), "--record", log) as rsu:
        bus = Bus()
        vehicles = [Vehicle(1, 40, 0), Vehicle(2, 40, 1)]
        bus.drive(vehicles, 1.0)
        try:
            ip("link", "set", "lo", "down")
            time.sleep(2.5)
            check(rsu.process.poll() is None, "it lives without a bus")
            check("bus_trouble" in rsu.text(), "and says so:\n" + rsu.text())
            counters = json.loads(ctl(rig, "status", "--json")[1])["counters"]
            check(counters["bus_errors"] > 0, f"and counts: {counters}")
        finally:
            ip("link", "set", "lo", "up")
            subprocess.run(["ip", "route", "replace", "224.0.0.0/4", "dev", "lo"], check=True)
        time.sleep(1.2) # it looks for its bus once a second
        bus = Bus()
        for vehicle in vehicles:
            vehicle.sequence = 0
        bus.drive(vehicles, 2.0)
        check({p.vehicle_id for _, p, _ in bus.plans} == {1, 2}, "plans for both again")
        check(rsu.stop()[1] == 0, "stops")
    for vehicle in vehicles:
        cycles = cycles_until_planned(log, vehicle.number)
        check(cycles <= 2, f"{cycles} cycles until vehicle {vehicle.number} was planned")


def a_thousand_cycles_allocate_nothing(rig):
    guard = shared_library(rig, "heap_guard")
    counts = rig.folder / "heap.txt"
    env = dict(os.environ, LD_PRELOAD=str(guard), HEAP_GUARD_FILE=str(counts))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    control = rig.folder / "heap.sock"
    config = rig.config(cycle_ms=20, planner=dict(QUICK, iterations=20, threads=2),
                        control=str(control), log_format="json",
                        metrics={"listen": f"127.0.0.1:{port}", "file": "heap.prom"})
    with Daemon(rig, config, "--record", rig.folder / "heap.lcmlog", env=env) as rsu:
        bus = Bus()
        vehicles = three_and_a_human()
        bus.drive(vehicles, 0.5)
        first = bus.plans[-1][1].cycle
        rsu.signal(signal.SIGUSR2)
        for _ in range(20): # operators look on all the while
            bus.drive(vehicles, 1.025)
            for what in ("status", "vehicles", "plans"):
                code, out, error = rig.run(rig.bin / "verge-ctl", what, "--socket", control)
                check(code == 0, error)
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
                check(b"verge_plans_sent_total" in answer.read(), "figures")
            rsu.signal(signal.SIGUSR1)
        rsu.signal(signal.SIGUSR2)
        bus.drive(vehicles, 0.5)
        cycles = bus.plans[-1][1].cycle - first
        check(cycles >= 1000, f"{cycles} cycles")
        check(counts.exists(), "the guard wrote its counts")
        text = counts.read_text().split()
        check(text[:4] == ["allocations", "0", "frees", "0"], " ".join(text))


def a_recording_that_cannot_be_written_ends_and_planning_goes_on(rig):
    with Daemon(rig, rig.config(), "--record", "/dev/full") as rsu:
        bus = Bus()
        bus.drive(three_and_a_human(), 1.5)
        check("record_ended" in rsu.text(), "it says so")
        check(bus.statuses[-1][1].state == 3, "degraded")
        check(len(bus.plans) >= 30, "planning goes on")
        check(rsu.stop()[1] == 0, "stops")
    code = rig.run(rig.bin / "verge-rsu", "--config", rig.config(), "--record", "/no/such/x")[0]
    check(code == 71, f"no place to record to: exit {code}, expected 71")


def the_closed_loop_drives_by_its_plans(rig):
    out = rig.folder / "run.jsonl"
    config = SOURCE / "apps/scenarios/rsu-ramp.json"
    with Daemon(rig, config) as rsu:
        code, text, error = rig.run(
            rig.bin / "verge-publish", SOURCE / "apps/scenarios/ramp-case1.json", "--bus",
            "lcm:" + URL, "--duration", "8", "--out", out)
        check(code == 0, error)
        # A plan that says the same as the one before has no line.
        planned = set(re.findall(r"vehicle (\d+) +cycle \d+ +planned", text))
        check(planned == {"0", "2", "3"}, "a line for each change of a plan:\n" + text)
        check(json.loads(text[text.index("{"):])["latency"]["state_to_plan_ms"]["count"] >= 30,
              "a plan for each vehicle in each cycle:\n" + text)
        metrics = json.loads(text[text.index("{"):])["metrics"]
        check(metrics["collisions"] == 0, f"collisions: {metrics}")
        check(rsu.stop()[1] == 0, "stops")
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    check(lines[0]["format"] == "verge-run/1" and "metrics" in lines[-1], "a run file")
    check(sum("vehicles" in line for line in lines) == 81, "a line a tick")
    check(sum("plan" in line for line in lines) >= 12, "a line a cycle")


CASES = [
    without_a_bus_it_says_what_to_do_and_exits_69,
    wrong_options_and_configurations_have_their_exit_codes,
    the_printed_configuration_is_the_configuration,
    one_plan_a_vehicle_a_cycle_and_it_replays_to_the_same_digests,
    a_silent_vehicle_is_cancelled_once_and_planned_again_when_it_sends,
    hostile_traffic_is_counted_and_no_plan_is_missing,
    sighup_swaps_a_good_configuration_and_keeps_the_old_one_on_error,
    sighup_may_name_another_bus,
    a_long_planning_step_does_not_delay_stopping,
    plans_resume_within_two_cycles_when_the_bus_comes_back,
    a_recording_that_cannot_be_written_ends_and_planning_goes_on,
    the_closed_loop_drives_by_its_plans,
    a_thousand_cycles_allocate_nothing,
]


# ---- set-up ---------------------------------------------------------------------------------

def enter_lcm_python(venv):
    """Continues in the interpreter that has the Python package lcm, if there is one."""
    try:
        import lcm  # noqa: F401
        return
    except ImportError:
        pass
    python = pathlib.Path(venv or "") / "bin" / "python3"
    if not venv or not python.exists() or os.environ.get("VERGE_E2E_INSIDE"):
        skip("the Python package lcm is missing (tools/setup makes a venv with it)")
    os.environ["VERGE_E2E_INSIDE"] = "1"
    os.execv(python, [str(python), *sys.argv])


def enter_network():
    """Continues in a network of its own unless this one is one already (loopback only)."""
    names = [name for _, name in socket.if_nameindex()]
    route = subprocess.run(["ip", "route", "show", "224.0.0.0/4"], capture_output=True, text=True)
    if names == ["lo"] and "dev lo" in route.stdout:
        return
    os.execv(SOURCE / "tests/support/in_network.sh",
             ["in_network.sh", sys.executable, *sys.argv])


def main(cases):
    """Runs the cases in a private network. Other files with cases on an LCM bus call it, too."""
    args = case_arguments()
    if shutil.which("lcm-gen") is None or shutil.which("lcm-logger") is None:
        skip("lcm-gen or lcm-logger is missing (tools/setup installs them)")
    enter_network()
    enter_lcm_python(args.lcm_python)
    with tempfile.TemporaryDirectory() as name:
        subprocess.run(["lcm-gen", "-p", "--ppath", name, SOURCE / "transport/types/verge.lcm"],
                       check=True)
        sys.path.insert(0, name)
        global lcm, verge
        import lcm
        import verge
        return run_cases(cases, args.bin, args.only, Rig)


if __name__ == "__main__":
    sys.exit(main(CASES))
