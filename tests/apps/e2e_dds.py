"""The daemon on DDS, with another project's DDS client as the vehicles, in its default set-up.

    python3 tests/apps/e2e_dds.py --bin build/bin [--lcm-python VENV] [--only NAME]

Exit status 0: passed; 1: failed (reason on standard error); 77: skipped, because the Python
packages cyclonedds or lcm, lcm-gen or a private network are missing on this machine.
The types are read from transport/types/verge.idl, as any other client would read them; checksums
and fields are compared with those that lcm-gen makes from verge.lcm.
"""
import collections
import json
import math
import os
import pathlib
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time

import e2e_lcm
from e2e_lcm import (CANCELLED, SOURCE, URL, Bus, Daemon, Vehicle, check, crc, shared_library, signed,
                     skip)

DDS = "dds:0"
ID_CONFLICT = 6
TOPICS = {"VERGE_STATE": "vehicle_state_t", "VERGE_PLAN": "vehicle_plan_t",
          "VERGE_STATUS": "rsu_status_t"}


# ---- the client -----------------------------------------------------------------------------

def types_of_the_idl():
    """Every struct of verge.idl as a class of the Python client, by name."""
    from cyclonedds.idl import annotations, make_idl_struct, types
    basic = {"short": types.int16, "long": types.int32, "long long": types.int64,
             "float": types.float32, "double": types.float64}
    found = {}
    text = (SOURCE / "transport/types/verge.idl").read_text()
    for name, body in re.findall(r"@final\nstruct (\w+) \{(.*?)\n\};", text, re.DOTALL):
        fields, keys = {}, {}
        for key, kind, field, count in re.findall(
                r"^    (@key )?([a-z_ ]+?) _?(\w+)(?:\[(\d+)\])?;", body, re.MULTILINE):
            one = basic.get(kind) or found[kind]
            fields[field] = types.array[one, int(count)] if count else one
            if key:
                keys[field] = {"key": True}
        found[name] = annotations.final(
            make_idl_struct(name, "verge." + name, fields, field_annotations=keys))
    return found


class DdsBus:
    """The vehicles' side, as e2e_lcm.Bus: publishes states, collects plans and statuses."""

    def __init__(self, domain=0):
        from cyclonedds.core import Policy, Qos
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration
        self.types = types_of_the_idl()
        self.participant = DomainParticipant(domain)
        last = Policy.History.KeepLast(1)
        reliable = Policy.Reliability.Reliable(duration(milliseconds=100))

        def topic(name):
            return Topic(self.participant, name, self.types[TOPICS[name]])
        self.writer = DataWriter(self.participant, topic("VERGE_STATE"), Qos(
            Policy.Reliability.BestEffort, last))
        self.plan_reader = DataReader(self.participant, topic("VERGE_PLAN"), Qos(reliable, last))
        self.status_reader = DataReader(self.participant, topic("VERGE_STATUS"), Qos(
            reliable, Policy.Durability.TransientLocal, last))
        self.plans, self.statuses = [], []

    def send(self, state, checksum=True):
        if checksum:
            state.crc32 = 0
            state.crc32 = signed(crc(state))
        kind = self.types["vehicle_state_t"]
        self.writer.write(kind(**{name: getattr(state, name) for name in kind.__annotations__}))

    def take(self):
        """What has come, as (time, LCM message)."""
        for reader, into, make in ((self.plan_reader, self.plans, e2e_lcm.verge.vehicle_plan_t),
                                   (self.status_reader, self.statuses, e2e_lcm.verge.rsu_status_t)):
            for sample in reader.take(64):
                if not hasattr(sample, "crc32"):
                    continue # only tells that its writer left
                message = make()
                for name in make.__slots__:
                    value = getattr(sample, name)
                    if name in ("actions", "passes", "stops", "points"):
                        value = [self.part(name, one) for one in value]
                    setattr(message, name, value)
                # What goes out when a cycle is late is no cycle's plan.
                if getattr(message, "reason", None) != e2e_lcm.OVERRUN:
                    into.append((time.time(), message))

    @staticmethod
    def part(name, sample):
        kinds = {"actions": e2e_lcm.verge.plan_action_t, "points": e2e_lcm.verge.plan_point_t,
                 "passes": e2e_lcm.verge.plan_pass_t, "stops": e2e_lcm.verge.plan_stop_t}
        part = kinds[name]()
        for field in kinds[name].__slots__:
            setattr(part, field, getattr(sample, field))
        return part

    def listen(self, seconds):
        until = time.monotonic() + seconds
        while True:
            self.take()
            left = until - time.monotonic()
            if left <= 0:
                return
            time.sleep(min(0.005, left))

    def drive(self, vehicles, seconds, hz=10, beside=None):
        """Publishes every vehicle's state at hz, listening in between; beside: on that bus, too."""
        began = time.monotonic()
        for tick in range(int(seconds * hz)):
            for vehicle in vehicles:
                state = vehicle.now()
                self.send(state)
                if beside is not None:
                    beside.send(state)
            self.listen(max(0.0, began + (tick + 1) / hz - time.monotonic()))
            while beside is not None and select.select([beside.lcm.fileno()], [], [], 0)[0]:
                beside.lcm.handle()

    def meet(self, vehicles):
        """Drives until the first plan comes: the two sides have found each other."""
        until = time.monotonic() + 30
        while not self.plans:
            check(time.monotonic() < until, "no plan within 30 s")
            self.drive(vehicles, 0.2)


def two():
    return [Vehicle(1, 40, 0), Vehicle(2, 40, 1)]


# ---- cases ----------------------------------------------------------------------------------

def a_client_in_default_set_up_gets_a_plan_for_each_vehicle_each_cycle(rig):
    with Daemon(rig, rig.config(bus=DDS)) as rsu:
        bus = DdsBus()
        vehicles = e2e_lcm.three_and_a_human()
        bus.meet(vehicles)
        bus.drive(vehicles, 0.5)
        bus.plans.clear()
        bus.drive(vehicles, 4.0)
        cycles = collections.Counter(plan.cycle for _, plan in bus.plans)
        seen = sorted(cycles)
        check(len(cycles) >= 30, f"{len(cycles)} cycles in 4 s at 100 ms")
        check(seen[-1] - seen[0] + 1 == len(seen), f"a cycle is missing: {seen}")
        check(all(cycles[c] == 3 for c in seen[1:-1]), f"a plan is missing: {cycles}")
        for _, plan in bus.plans:
            check(signed(crc(plan)) == plan.crc32, "the checksum is LCM's")
            check(plan.rsu_id == 5 and plan.status in (0, 1, 2), f"status {plan.status}")
            check(0 <= plan.utime - plan.state_utime <= 300000, "from a fresh state")
            vehicle = {v.number: v for v in vehicles}[plan.vehicle_id]
            x = vehicle.x0 + vehicle.speed * (plan.utime * 1e-6 - vehicle.began)
            check(abs(plan.points[0].x - x) < 0.01, f"point 0 is at {plan.points[0].x}, not {x}")
        status = bus.statuses[-1][1]
        check(signed(crc(status)) == status.crc32 and status.state == 2, "running")
        check(status.vehicles_seen == 4 and status.vehicles_controlled == 3, "who is there")
        late = DdsBus()
        late.listen(0.9)
        check(late.statuses, "the last status is for whoever comes later, too")
        took, code = rsu.stop()
        bus.listen(0.3)
        check(code == 0 and took < 1.0, f"SIGTERM: exit {code} in {took:.2f} s")
        last = {plan.vehicle_id: plan.status for _, plan in bus.plans}
        check(last == {1: CANCELLED, 2: CANCELLED, 3: CANCELLED}, f"cancelled at stop: {last}")
        check(bus.statuses[-1][1].state == 4, "the last status says stopping")


def cyclonedds_ls_sees_the_topics(rig):
    with Daemon(rig, rig.config(bus=DDS)):
        tool = pathlib.Path(sys.executable).parent / "cyclonedds"
        environment = dict(os.environ, COLUMNS="160", NO_COLOR="1")
        code, out, error = rig.run(sys.executable, tool, "ls", "--suppress-progress-bar",
                                   env=environment)
        check(code == 0, error)
        for topic, kind in TOPICS.items():
            check(topic in out and "verge::" + kind in out, f"{topic} is not in\n{out}")


def wrong_and_impossible_states_are_counted_and_no_plan_is_missing(rig):
    with Daemon(rig, rig.config(bus=DDS)) as rsu:
        bus = DdsBus()
        good = two()
        bus.meet(good)
        stranger = DdsBus()
        for _ in range(20):
            for number, changes in enumerate(({"x": math.nan}, {"speed": -16.0}, {"y": 500.0},
                                              {"utime": int(time.time() * 1e6) + 10 ** 6})):
                state = Vehicle(90 + number, 40, 0).now()
                for name, value in changes.items():
                    setattr(state, name, value)
                stranger.send(state)
            false = Vehicle(80, 40, 0).now()
            false.crc32 = 1
            stranger.send(false, checksum=False)
            bus.drive(good, 0.1)
        bus.plans.clear()
        bus.drive(good, 1.5)
        status = bus.statuses[-1][1]
        for name in ("rx_malformed", "rx_out_of_range", "rx_off_map", "rx_future"):
            check(getattr(status, name) > 0, f"{name} counted")
        check(status.vehicles_seen == 2, "nobody who is not there")
        cycles = collections.Counter(plan.cycle for _, plan in bus.plans)
        check(all(cycles[c] == 2 for c in sorted(cycles)[1:-1]), f"a plan was lost: {cycles}")
        check(rsu.stop()[1] == 0, "stops")


def a_vehicle_heard_on_both_buses_is_one_vehicle(rig):
    log = rig.folder / "both.lcmlog"
    config = rig.config(bus=["lcm:" + URL, DDS])
    with Daemon(rig, config, "--record", log) as rsu:
        by_dds, by_lcm = DdsBus(), Bus()
        vehicles = two()
        by_dds.meet(vehicles)
        for bus in (by_dds, by_lcm):
            bus.plans.clear()
        by_dds.drive(vehicles, 3.0, beside=by_lcm)
        status = by_dds.statuses[-1][1]
        check(status.vehicles_seen == 2 and status.vehicles_controlled == 2, "two, not four")
        check(status.rx_id_conflict == 0, f"{status.rx_id_conflict} conflicts")
        check(status.rx_duplicate >= 20, f"{status.rx_duplicate} duplicates: the slower bus")
        check(by_lcm.statuses[-1][1].vehicles_seen == 2, "the same is told on the other bus")

        def digests(bus):
            return {p.cycle: (p.digest, p.plans_in_cycle) for _, p, *_ in bus.plans}
        one, other = digests(by_dds), digests(by_lcm)
        common = one.keys() & other.keys()
        check(len(common) >= 20, f"plans on both buses: {len(common)} cycles")
        check(all(one[c] == other[c] and one[c][1] == 2 for c in common), "the same plans")

        # One on this bus, one on that: they are planned jointly.
        by_dds.plans.clear()
        for _ in range(20):
            by_dds.send(vehicles[0].now())
            by_lcm.send(vehicles[1].now())
            by_dds.listen(0.1)
        joint = [p.plans_in_cycle for _, p in by_dds.plans if p.status != CANCELLED]
        check(joint and joint[-1] == 2, f"planned jointly: {joint[-5:]}")
        check("event=id_conflict" not in rsu.text(), rsu.text())
        check("states_refused" not in rsu.text(), "what two buses say twice is no trouble")
        check(rsu.stop()[1] == 0, "stops")
    code, out, error = rig.run(rig.bin / "verge-replay", log, "--config", config)
    check(code == 0 and "same" in out, f"the recording replays: {code} {out} {error}")


def a_second_sender_of_an_id_is_refused_and_reported_on_both_buses(rig):
    with Daemon(rig, rig.config(bus=["lcm:" + URL, DDS])) as rsu:
        by_dds, by_lcm = DdsBus(), Bus()
        honest = two()
        by_dds.meet(honest)
        by_dds.drive(honest, 1.0, beside=by_lcm)
        check(by_dds.statuses[-1][1].rx_id_conflict == 0, "no conflict yet")
        for thief in (DdsBus(), Bus()):
            before = by_dds.statuses[-1][1].rx_id_conflict
            copy = Vehicle(1, 0, 0)
            until = time.monotonic() + 20
            while by_dds.statuses[-1][1].rx_id_conflict == before:
                check(time.monotonic() < until, "no conflict within 20 s")
                copy.x0, copy.began = honest[0].x0, honest[0].began # it fits perfectly
                by_dds.drive(honest, 0.1, beside=by_lcm)
                thief.send(copy.now())
            thief = None
        check(by_dds.statuses[-1][1].fault == ID_CONFLICT, "told as a fault")
        began, before = time.monotonic(), by_dds.statuses[-1][1].rx_id_conflict
        thief = Bus()
        while by_dds.statuses[-1][1].rx_id_conflict < before + 20: # it goes on for seconds
            check(time.monotonic() < began + 60, "20 conflicts")
            by_dds.drive(honest, 0.1, beside=by_lcm)
            thief.send(copy.now())
        seconds = time.monotonic() - began
        lines = [line for line in rsu.text().splitlines() if "event=id_conflict" in line]
        guid = r"refused_sender=([0-9a-f]{8}:){3}[0-9a-f]{8}$"
        check(any("bus=" + DDS in line and re.search(guid, line) for line in lines),
              f"the log names the bus and the writer: {lines}")
        check(any(re.search(r"bus=lcm:.* refused_sender=[\d.]+:\d+$", line)
                  for line in lines), f"and the sender's address: {lines}")
        check(len(lines) <= 2 + 2 * (1 + seconds / 10), f"once a bus in ten seconds: {lines}")
        check(rsu.stop()[1] == 0, "stops")


def sighup_adds_a_bus_and_takes_one_away(rig):
    with Daemon(rig, rig.config(bus="lcm:" + URL)) as rsu:
        by_lcm, by_dds = Bus(), DdsBus()
        vehicles = two()
        by_dds.drive(vehicles, 1.0, beside=by_lcm)
        check(by_lcm.plans and not by_dds.plans, "plans on LCM alone")
        rig.config(bus=["lcm:" + URL, DDS])
        rsu.signal(signal.SIGHUP)
        by_dds.meet(vehicles)
        rig.config(bus=[DDS], dds={"interfaces": ["127.0.0.1"]}) # the same domain, made anew
        rsu.signal(signal.SIGHUP)
        by_dds.drive(vehicles, 2.0, beside=by_lcm)
        by_lcm.plans.clear()
        by_dds.plans.clear()
        by_dds.drive(vehicles, 1.0, beside=by_lcm)
        check(by_dds.plans and not by_lcm.plans, "plans on DDS alone")
        status = by_dds.statuses[-1][1]
        rig.config(bus=[DDS], dds={"interfaces": ["verge9"]})
        rsu.signal(signal.SIGHUP)
        by_dds.drive(vehicles, 1.5)
        check("verge9" in rsu.text() and "config_refused" in rsu.text(), rsu.text())
        check(by_dds.statuses[-1][1].config_crc32 == status.config_crc32, "the old one holds")
        check(rsu.stop()[1] == 0, "stops")


def plans_resume_when_the_interface_comes_back(rig):
    def ip(*args):
        subprocess.run(["ip", *args], check=True)
    with Daemon(rig, rig.config(bus=DDS)) as rsu:
        bus = DdsBus()
        vehicles = two()
        bus.meet(vehicles)
        try:
            ip("link", "set", "lo", "down")
            bus.drive(vehicles, 3.0)
            check(rsu.process.poll() is None, "it lives without a bus")
            check("bus_trouble" in rsu.text() and "lo is down" in rsu.text(), rsu.text())
        finally:
            ip("link", "set", "lo", "up")
            subprocess.run(["ip", "route", "replace", "224.0.0.0/4", "dev", "lo"], check=True)
        bus.plans.clear()
        bus.meet(vehicles)
        check(rsu.stop()[1] == 0, "stops")


def every_message_fits_one_frame(rig):
    """Listens to all packets on the loopback interface, as the owner of this network may."""
    sniffer = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0800))
    sniffer.bind(("lo", 0))
    sniffer.settimeout(0.2)
    sizes, going = [], True

    def listen():
        while going:
            try:
                packet = sniffer.recv(65536)
            except socket.timeout:
                continue
            if packet[23] == socket.IPPROTO_UDP and packet[42:46] == b"RTPS":
                sizes.append(len(packet) - 42)
    thread = threading.Thread(target=listen)
    with Daemon(rig, rig.config(bus=DDS)):
        bus = DdsBus()
        vehicles = two()
        bus.meet(vehicles)
        thread.start()
        bus.drive(vehicles, 1.5)
        going = False
        thread.join()
    check(sizes and max(sizes) > 1200, f"no plan was seen: {sizes[-5:]}")
    check(max(sizes) <= 1472, f"a datagram of {max(sizes)} bytes")


def the_planning_thread_allocates_nothing(rig):
    guard = shared_library(rig, "heap_guard")
    config = rig.config(bus=DDS, cycle_ms=20, planner=dict(e2e_lcm.QUICK, iterations=20))
    for thread, expected in (("verge-plan", True), ("verge-rsu", False)):
        counts = rig.folder / f"heap-{thread}.txt"
        env = dict(os.environ, LD_PRELOAD=str(guard), HEAP_GUARD_FILE=str(counts),
                   HEAP_GUARD_THREAD=thread)
        with Daemon(rig, config, env=env) as rsu:
            bus = DdsBus()
            vehicles = two()
            bus.meet(vehicles)
            first = bus.plans[-1][1].cycle
            rsu.signal(signal.SIGUSR2)
            bus.drive(vehicles, 5.0)
            rsu.signal(signal.SIGUSR2)
            bus.drive(vehicles, 0.5)
            check(bus.plans[-1][1].cycle - first >= 200, "cycles")
            text = counts.read_text().split()
            free_of_it = text[:4] == ["allocations", "0", "frees", "0"]
            # Where DDS publishes it allocates: that shows the guard tells threads apart.
            check(free_of_it == expected, f"{thread}: {' '.join(text)}")


def the_closed_loop_drives_by_its_plans(rig):
    config = rig.config(bus=DDS, road=None, cycle_ms=500, planner={},
                        road_file=str(SOURCE / "apps/scenarios/ramp-case1.json"))
    options = rig.folder / "options.json"
    options.write_text('{ "dds": { "interfaces": ["lo"] } }')
    with Daemon(rig, config) as rsu:
        code, text, error = rig.run(
            rig.bin / "verge-publish", SOURCE / "apps/scenarios/ramp-case1.json", "--bus", DDS,
            "--bus-options", options, "--duration", "8", "--all")
        check(code == 0, error)
        check(text.count(" cycle ") >= 30, "a line for each vehicle and plan:\n" + text)
        result = json.loads(text[text.index("{"):])
        check(result["metrics"]["collisions"] == 0, text[-2000:])
        for name in ("state_to_plan_ms", "plan_to_here_ms"):
            waits = result["latency"][name]
            check(waits["count"] >= 30 and 0 < waits["p50"] <= waits["p99"] <= waits["max"],
                  f"{name}: {waits}")
        # A cycle's plan is due well before the next cycle begins.
        check(result["latency"]["plan_to_here_ms"]["p50"] < 500, f"{result['latency']}")
        check(rsu.stop()[1] == 0, "stops")
    options.write_text('{ "dds": { "interface": ["lo"] } }')
    code, _, error = rig.run(rig.bin / "verge-publish",
                             SOURCE / "apps/scenarios/ramp-case1.json", "--bus", DDS,
                             "--bus-options", options)
    check(code == 2 and "dds" in error and error.count("\n") == 1, f"{code} {error!r}")


CASES = [
    a_client_in_default_set_up_gets_a_plan_for_each_vehicle_each_cycle,
    cyclonedds_ls_sees_the_topics,
    wrong_and_impossible_states_are_counted_and_no_plan_is_missing,
    a_vehicle_heard_on_both_buses_is_one_vehicle,
    a_second_sender_of_an_id_is_refused_and_reported_on_both_buses,
    sighup_adds_a_bus_and_takes_one_away,
    plans_resume_when_the_interface_comes_back,
    every_message_fits_one_frame,
    the_planning_thread_allocates_nothing,
    the_closed_loop_drives_by_its_plans,
]


def main():
    e2e_lcm.enter_network()
    venv = sys.argv[sys.argv.index("--lcm-python") + 1] if "--lcm-python" in sys.argv else None
    e2e_lcm.enter_lcm_python(venv)
    try:
        import cyclonedds.core # noqa: F401
    except ImportError:
        skip("the Python package cyclonedds is missing (tools/setup --check makes a venv with it)")
    return e2e_lcm.main(CASES)


if __name__ == "__main__":
    sys.exit(main())
