"""The daemon on a bus with other participants: signed LCM, an allow list, DDS Security. A
participant without a key or a certificate can neither send nor receive, and the log states the reason.

    python3 tests/apps/e2e_secure.py --bin build/bin [--only NAME]

Signatures are made and checked here by Python's own hmac, the frames by hand; certificates come
from tools/certs. Exit status 0: passed; 1: failed; 77: skipped, because lcm-gen, openssl or
a private network is missing on this machine.
"""
import hashlib
import hmac
import json
import os
import pathlib
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

import e2e_lcm
from daemon_rig import (Daemon, QUICK, Rig, SOURCE, case_arguments, check, run_cases,
                        shared_library, wait_for)

GROUP = ("239.255.76.67", 7667)
URL = "lcm:udpm://239.255.76.67:7667?ttl=0"
RAMP = SOURCE / "apps/scenarios/ramp-case1.json"
MAGIC, TRAILER = b"VGH1", 40


# ---- signed LCM, once more ------------------------------------------------------------------

class Signer:
    """One end that holds a key, with a sender's number of its own."""

    def __init__(self, number, key):
        self.number, self.key = number, key
        self.sender, self.stamp = os.urandom(8), 0

    def sign(self, event, shift=0.0):
        """The trailer for channel, NUL and payload; shift [s] sets the clock wrong."""
        self.stamp = max(self.stamp + 1, int((time.time() + shift) * 1e6))
        head = MAGIC + struct.pack(">I", self.number) + self.sender + struct.pack(">q", self.stamp)
        return head + hmac.new(self.key, event + head, hashlib.sha256).digest()[:16]


def signature_holds(key, event, trailer):
    code = hmac.new(key, event + trailer[:-16], hashlib.sha256).digest()[:16]
    return trailer[:4] == MAGIC and code == trailer[-16:]


class Wire:
    """A sender with an address of its own, and an ear on the group."""

    def __init__(self, address="127.0.0.1"):
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.out.bind((address, 0))
        self.out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self.ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ear.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.ear.bind(GROUP)
        self.ear.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                            socket.inet_aton(GROUP[0]) + socket.inet_aton("0.0.0.0"))
        self.ear.setblocking(False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.out.close()
        self.ear.close()

    def send(self, event, trailer=b""):
        datagram = b"LC02" + bytes(4) + event + trailer
        self.out.sendto(datagram, GROUP)
        return datagram

    def send_state(self, vehicle, signer=None, shift=0.0):
        """The vehicle's state of now; the datagram."""
        event = b"VERGE_STATE\0" + encoded(vehicle)
        return self.send(event, signer.sign(event, shift) if signer else b"")

    def heard(self):
        """(channel, event, rest behind the header) of every datagram that waits."""
        while True:
            try:
                datagram = self.ear.recv(2048)
            except BlockingIOError:
                return
            event = datagram[8:]
            yield event.split(b"\0", 1)[0].decode(), event

    def plans(self, key=None):
        """The vehicles that have plans waiting; with a key every plan must be signed with it."""
        numbers = set()
        for channel, event in self.heard():
            if channel != "VERGE_PLAN":
                continue
            if key is not None:
                check(len(event) <= 1472 - 8, "one datagram")
                check(signature_holds(key, event[:-TRAILER], event[-TRAILER:]), "signed plans")
            plan = verge.vehicle_plan_t.decode(event[11:]) # passes over what stands behind it
            check(e2e_lcm.signed(e2e_lcm.crc(plan)) == plan.crc32, "crc32")
            if plan.status != e2e_lcm.CANCELLED:
                numbers.add(plan.vehicle_id)
        return numbers


def encoded(vehicle):
    state = vehicle.now()
    state.crc32 = 0
    state.crc32 = e2e_lcm.signed(e2e_lcm.crc(state))
    return state.encode()


def write_key(path, key=None, mode=0o600):
    key = os.urandom(32) if key is None else key
    path.write_text(key.hex() + "\n")
    path.chmod(mode)
    return key


def signing_is_built(rig):
    key = rig.folder / "probe.key"
    write_key(key)
    config = rig.config(bus=URL, lcm={"keys": [{"id": 1, "file": str(key)}]})
    return "no OpenSSL" not in rig.run(rig.bin / "verge-rsu", "--config", config,
                                       "--check-config")[2]


def check_told(rsu, cause):
    rsu.wait_for(f"was refused as {cause}: ")


# ---- cases: LCM -----------------------------------------------------------------------------

def signed_vehicles_are_planned_and_all_others_are_not(rig):
    ours, daemons = write_key(rig.folder / "one.key"), write_key(rig.folder / "two.key")
    config = rig.config(bus=URL, cycle_ms=100, metrics={"file": "figures.prom"}, lcm={
        "allow": ["127.0.0.0/25"], "sign_with": 2, "window_ms": 2000,
        "keys": [{"id": 1, "file": "one.key"}, {"id": 2, "file": "two.key"}]})
    good, forger, unknown = Signer(1, ours), Signer(1, os.urandom(32)), Signer(9, ours)
    late, outside = Signer(1, ours), Signer(1, ours)
    friends = [e2e_lcm.Vehicle(1, 40, 0), e2e_lcm.Vehicle(2, 40, 1)]
    others = {number: e2e_lcm.Vehicle(number, 200 + number, 0) for number in range(71, 77)}
    planned, replays = set(), []
    with Daemon(rig, config) as rsu, Wire("127.0.0.2") as wire, Wire("127.0.0.9") as thief, \
            Wire("127.0.0.200") as stranger:

        def a_tenth():
            for vehicle in friends:
                replays.append(wire.send_state(vehicle, good))
            thief.send_state(others[71])
            thief.send_state(others[72], forger)
            thief.send_state(others[73], unknown)
            thief.send_state(others[74], late, -2.5)
            thief.send_state(others[75], late, 2.5)
            stranger.send_state(others[76], outside)
            for datagram in replays[-4:]:
                thief.out.sendto(datagram, GROUP)
            time.sleep(0.1)
            planned.update(wire.plans(daemons))
            return planned >= {1, 2}
        wait_for(a_tenth, "plans for those who sign")
        for _ in range(20):
            a_tenth()
        check(planned == {1, 2}, f"planned: {planned}")
        for cause in ("unsigned", "forged", "unknown_key", "untimely", "not_allowed", "replayed"):
            check_told(rsu, cause)
            name = f'verge_strangers_total{{reason="{cause}"}}'
            wait_for(lambda: figure(rig, name) > 0, name)
        check("from 127.0.0.200:" in rsu.text(), "the stranger's address is told")
        told = rsu.text().count("event=bus_complaint")
        check(told <= 6 * 4, f"{told} lines for some hundred refusals")
        check(rsu.stop()[1] == 0, "stops")
        statuses = [verge.rsu_status_t.decode(event[13:]) for channel, event in wire.heard()
                    if channel == "VERGE_STATUS"]
        check(statuses and statuses[-1].rx_malformed >= 100, "refusals are counted")
        check(statuses[-1].vehicles_seen <= 2 and statuses[-1].rx_id_conflict == 0, "and unseen")


def a_vehicle_without_keys_is_planned_by_a_daemon_without_keys(rig):
    """Signed states are accepted on an open bus; another program reads the daemon's log."""
    signer, vehicle = Signer(1, os.urandom(32)), e2e_lcm.Vehicle(4, 40, 0)
    with Daemon(rig, rig.config(bus=URL, cycle_ms=100)) as rsu, Wire() as wire:
        def planned():
            wire.send_state(vehicle, signer)
            time.sleep(0.1)
            return 4 in wire.plans()
        wait_for(planned, "a plan for a vehicle whose signature nobody checks")
        check(rsu.stop()[1] == 0, "stops")


def a_replaced_key_takes_effect_with_sighup(rig):
    path = rig.folder / "one.key"
    old = Signer(1, write_key(path))
    config = rig.config(bus=URL, cycle_ms=100, lcm={"keys": [{"id": 1, "file": "one.key"}]})
    with Daemon(rig, config) as rsu, Wire() as wire:
        def planned(signer, vehicle):
            wire.send_state(vehicle, signer)
            time.sleep(0.1)
            return vehicle.number in wire.plans()
        wait_for(lambda: planned(old, e2e_lcm.Vehicle(1, 40, 0)), "a plan under the first key")
        new = Signer(1, write_key(path, mode=0o640))
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_refused")
        check("chmod 600" in rsu.text(), "a key that others can read is refused with the remedy")
        wait_for(lambda: planned(old, e2e_lcm.Vehicle(2, 80, 0)), "the first key still holds")
        path.chmod(0o600)
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_applied")
        wait_for(lambda: planned(new, e2e_lcm.Vehicle(3, 120, 0)), "a plan under the second key")
        list(wire.heard())
        number = e2e_lcm.Vehicle(4, 160, 0)
        check(not any(planned(old, number) for _ in range(10)), "the first key is worth nothing")
        check_told(rsu, "forged")


def signing_and_checking_allocate_nothing(rig):
    if b"__asan_init" in (rig.bin / "verge-rsu").read_bytes():
        return "left out: a sanitizer brings a heap of its own"
    key = write_key(rig.folder / "one.key")
    guard, counts = shared_library(rig, "heap_guard"), rig.folder / "heap.txt"
    config = rig.config(bus=URL, cycle_ms=20, planner=dict(QUICK, iterations=20), lcm={
        "allow": ["127.0.0.1"], "keys": [{"id": 1, "file": "one.key"}], "sign_with": 1})
    signer, vehicle = Signer(1, key), e2e_lcm.Vehicle(1, 40, 0)
    forger, thief = Signer(1, os.urandom(32)), e2e_lcm.Vehicle(2, 80, 0)
    env = {"LD_PRELOAD": guard, "HEAP_GUARD_FILE": str(counts)}
    with Daemon(rig, config, env=env) as rsu, Wire() as wire:
        plans = 0

        def drive(count):
            nonlocal plans
            wire.send_state(vehicle, signer)
            wire.send_state(thief, forger)
            time.sleep(0.1)
            plans += sum(channel == "VERGE_PLAN" for channel, _ in wire.heard())
            return plans >= count
        wait_for(lambda: drive(1), "plans")
        check_told(rsu, "forged")
        rsu.signal(signal.SIGUSR2)
        wait_for(lambda: drive(plans + 1), "a plan that is counted")
        wait_for(lambda: drive(400), "400 signed plans", 60)
        rsu.signal(signal.SIGUSR2)
        text = wait_for(lambda: counts.exists() and counts.read_text(), "the guard's counts").split()
        check(text[:4] == ["allocations", "0", "frees", "0"], " ".join(text))


def keys_that_cannot_work_are_refused_with_the_remedy(rig):
    write_key(rig.folder / "good.key")
    write_key(rig.folder / "open.key", mode=0o644)
    write_key(rig.folder / "short.key", os.urandom(31))
    wrong = [({"keys": [{"id": 1, "file": "open.key"}]}, "lcm.keys[0].file: ", "chmod 600"),
             ({"keys": [{"id": 1, "file": "none.key"}]}, "none.key", "cannot be read"),
             ({"keys": [{"id": 1, "file": "short.key"}]}, "short.key", "openssl rand -hex 32"),
             ({"keys": [{"id": 1, "file": "good.key"}], "sign_with": 2}, "lcm.sign_with", "id of"),
             ({"keys": [{"id": 1, "file": "good.key"}] * 2}, "lcm.keys[1].id", "of its own"),
             ({"allow": ["10.1.2.3/16"]}, "lcm.allow[0]: ", "10.1.0.0/16"),
             ({"keys": [{"id": 1, "path": "good.key"}]}, "lcm.keys[0].path", "expected"),
             ({"secret": 1}, "lcm.secret", "expected")]
    for lcm, field, remedy in wrong:
        config = rig.config(bus=URL, lcm=lcm)
        for options in (["--check-config"], []):
            code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, *options)
            check(code == 78 and field in error and remedy in error and error.count("\n") == 1,
                  f"{lcm}: exit {code}, told as {error!r}")
    config = rig.config(bus=URL, lcm={"keys": [{"id": 1, "file": "good.key"}], "sign_with": 1})
    code, out, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--print-config")
    check(json.loads(out)["lcm"]["keys"][0]["file"] == str(rig.folder / "good.key"), error)


def open_buses_give_a_warning(rig):
    """Where the kernel has no veth, what needs a second interface is left out."""
    two = subprocess.run("ip link add ours type veth peer name theirs && ip link set ours up && "
                         "ip link set theirs up && ip address add 10.9.0.1/24 dev ours", shell=True,
                         capture_output=True).returncode == 0
    write_key(rig.folder / "one.key")
    signed = {"keys": [{"id": 1, "file": "one.key"}]}
    plain, far = URL, URL.replace("ttl=0", "ttl=1")
    cases = [({"bus": plain}, None), ({"bus": far}, "lcm.keys"), ({"bus": "loop:"}, None),
             ({"bus": far, "lcm": signed}, None),
             ({"bus": far, "lcm": {"allow": ["10.0.0.0/8"]}}, "lcm.keys")]
    if dds_is_built(rig):
        cases += [({"bus": "dds:0"}, None), ({"bus": [plain, "dds:0"]}, None),
                  ({"bus": "dds:0", "dds": {"interfaces": ["127.0.0.1"]}}, None)]
        cases += [({"bus": "dds:0", "dds": {"interfaces": ["ours"]}}, "dds.security")] if two else []
    for document, word in cases:
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config", rig.config(**document),
                                 "--check-config")
        check(code == 0, f"{document}: exit {code}: {error}")
        check((word is None and error == "") or (word is not None and "warning" in error and
              word in error and error.count("\n") == 1), f"{document}: told as {error!r}")
    if two:
        subprocess.run("ip route del 224.0.0.0/4; ip route add 224.0.0.0/4 dev ours", shell=True,
                       check=True)
        try:
            told = {bus: rig.run(rig.bin / "verge-rsu", "--config", rig.config(bus=bus),
                                 "--check-config")[2] for bus in (plain, far)}
        finally:
            subprocess.run("ip route del 224.0.0.0/4; ip route add 224.0.0.0/4 dev lo; "
                           "ip link del ours", shell=True, check=True)
        for bus, error in told.items():
            check("warning" in error and "lcm.keys" in error and "routed to ours" in error and
                  "ip route add 239.255.76.67 dev lo" in error, f"a network's route: {error!r}")
        # What is so already is no advice.
        check("ttl=0 and" in told[far] and "ttl=0 and" not in told[plain] and
              "ttl=0 keeps only" in told[plain], f"advice: {told}")
    return None if two else "ok, but without a second interface"


# ---- cases: DDS -----------------------------------------------------------------------------

def dds_is_built(rig):
    error = rig.run(rig.bin / "verge-rsu", "--config", rig.config("dds.json", bus="dds:0"),
                    "--check-config")[2]
    return "no DDS" not in error


def certificates(rig, name, *participants):
    """A set of its own by tools/certs."""
    folder = rig.folder / name
    subprocess.run([SOURCE / "tools/certs", "--out", folder, *participants], check=True,
                   stdout=subprocess.DEVNULL)
    return folder


def secured(rig, papers, name="rsu.json", **changes):
    """The daemon's configuration with the certificates of `rsu`; a change replaces one of them."""
    security = json.loads((papers / "rsu.options.json").read_text())["dds"]["security"]
    security = {key: str(papers / path) for key, path in security.items()}
    security.update({key: str(path) for key, path in changes.items()})
    return rig.config(name, bus="dds:0", cycle_ms=200, dds={"security": security},
                      road=None, road_file=str(RAMP), metrics={"file": "figures.prom"})


def figure(rig, name):
    """A number of the daemon's metrics file; 0 while there is none."""
    path = rig.folder / "figures.prom"
    lines = path.read_text().splitlines() if path.exists() else []
    return next((float(line.split()[-1]) for line in lines if line.startswith(name + " ")), 0.0)


class Publisher:
    """verge-publish in the background; how many plans came to its vehicles."""

    def __init__(self, rig, options=None, duration=60):
        command = [rig.bin / "verge-publish", RAMP, "--bus", "dds:0", "--all",
                   "--duration", duration]
        command += ["--bus-options", options] if options else []
        self.out = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen([str(word) for word in command], stdout=self.out,
                                        stderr=self.out)

    def text(self):
        self.out.seek(0)
        return self.out.read()

    def plans(self):
        return self.text().count(" cycle ")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.out.close()


class Tap:
    """Everything that crosses loopback."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0800))
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.socket.setblocking(False)

    def packets_with(self, *words):
        """(packets that hold one of the words, all packets) since the last time."""
        hits = count = 0
        while True:
            try:
                packet = self.socket.recv(65536)
            except BlockingIOError:
                return hits, count
            count += 1
            hits += any(word in packet for word in words)


def two_participants_with_certificates_communicate_encrypted(rig):
    papers = certificates(rig, "ours")
    # The name of a type, as discovery sends it, and the length and width of every vehicle.
    # Not the names of topics: the permissions contain them, and permissions are sent in the clear.
    words = (b"vehicle_state_t", struct.pack("<2f", 5.0, 2.0))
    tap = Tap()
    clear = rig.config("clear.json", bus="dds:0", cycle_ms=200, road=None, road_file=str(RAMP))
    for config, options in ((clear, None), (secured(rig, papers), papers / "vehicle.options.json")):
        tap.packets_with()
        with Daemon(rig, config) as rsu, Publisher(rig, options) as vehicles:
            wait_for(lambda: vehicles.plans() >= 9, "plans for everyone", 40)
            rsu.wait_for("to=running")
            took, code = rsu.stop()
            check(code == 0, f"stops: exit {code} after {took:.1f} s")
        hits, count = tap.packets_with(*words)
        check(count >= 50, f"{count} packets were seen")
        check((hits > 0) == (options is None), f"{hits} of {count} packets can be read, {options}")


def an_observer_receives_all_and_a_renewed_certificate_takes_effect_with_sighup(rig):
    papers = certificates(rig, "ours", "rsu", "vehicle", "watch:observer")

    def check_heard(what):
        code, out, error = rig.run(rig.bin / "verge-echo", "dds:0", "--bus-options",
                                   papers / "watch.options.json", "--json", "--count", "40")
        check(code == 0, f"{what}: exit {code}: {error}")
        kinds = {json.loads(line)["kind"] for line in out.splitlines()}
        check(kinds >= {"state", "plan"}, f"{what}: only {kinds}")
    with Daemon(rig, secured(rig, papers)) as rsu, \
            Publisher(rig, papers / "vehicle.options.json") as vehicles:
        wait_for(lambda: vehicles.plans() >= 3, "plans", 40)
        check_heard("with the first certificate")
        (papers / "rsu.crt.pem").write_text("torn")
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_refused")
        check("rsu.crt.pem: is no certificate" in rsu.text(), "told which file")
        before = vehicles.plans()
        wait_for(lambda: vehicles.plans() >= before + 9, "plans under the old one", 40)
        (papers / "rsu.crt.pem").unlink()
        certificates(rig, "ours")
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_applied")
        before = vehicles.plans()
        wait_for(lambda: vehicles.plans() >= before + 9, "plans under the new one", 40)
        check_heard("with the second certificate")
        check(rsu.stop()[1] == 0, "stops")


def other_participants_neither_receive_nor_send_and_the_log_says_why(rig):
    ours, foreign = certificates(rig, "ours"), certificates(rig, "foreign")
    # Rights of one's own making: a good certificate, permissions by an authority of one's own.
    rights = rig.folder / "rights"
    shutil.copytree(ours, rights)
    for path in rights.glob("permissions_ca.*"):
        path.unlink()
    certificates(rig, "rights")
    strangers = {
        "no certificate": (None, "it has no certificate"),
        "another authority with the same names": (
            foreign / "vehicle.options.json", "certificate signature failure"),
        "rights of one's own making": (rights / "vehicle.options.json", "permissions from plugin"),
    }
    for name, (options, reason) in strangers.items():
        (rig.folder / "figures.prom").unlink(missing_ok=True) # the last daemon's
        with Daemon(rig, secured(rig, ours)) as rsu, Publisher(rig, options) as stranger:
            rsu.wait_for(reason)
            wait_for(lambda: figure(rig, "verge_cycles_total") > 10, "two seconds of cycles")
            check(figure(rig, 'verge_rx_total{result="accepted"}') == 0, f"{name}: it is heard")
            began = time.monotonic()
            with Publisher(rig, ours / "vehicle.options.json") as friend:
                # Long after the messages of the member arrived, those of the outsider still do not.
                wait_for(lambda: friend.plans() >= 30, f"plans for the friend, beside {name}", 40)
            check(stranger.process.poll() is None, f"{name}: it ended:\n{stranger.text()}")
            check(stranger.plans() == 0, f"{name}: it hears plans:\n{stranger.text()}")
            lines = rsu.text().count("event=bus_complaint")
            seconds = time.monotonic() - began + 10
            check(lines <= 5 + 0.5 * seconds, f"{name}: {lines} lines in {seconds:.0f} s")
            check("id_conflict" not in rsu.text(), f"{name}: its vehicles were heard, too")
            check(rsu.stop()[1] == 0, "stops")


def without_the_right_to_publish_the_daemon_does_not_start(rig):
    papers = certificates(rig, "ours", "rsu", "vehicle", "watch:observer")
    code, _, error = rig.run(rig.bin / "verge-publish", RAMP, "--bus", "dds:0", "--bus-options",
                             papers / "watch.options.json")
    check(code == 2 and "watch.permissions.p7s does not grant" in error, f"{code}: {error!r}")
    for who in ("watch", "vehicle"):
        config = secured(rig, papers, certificate=papers / f"{who}.crt.pem",
                         key=papers / f"{who}.key.pem",
                         permissions=papers / f"{who}.permissions.p7s")
        for options in (["--check-config"], []):
            code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, *options)
            check(code == 78 and "does not grant" in error, f"{who}: {code}: {error!r}")


def unusable_certificates_are_refused_with_the_remedy(rig):
    ours, foreign = certificates(rig, "ours"), certificates(rig, "foreign")
    shutil.copy(ours / "rsu.key.pem", ours / "open.key.pem")
    (ours / "open.key.pem").chmod(0o644)
    subprocess.run(["sh", "-c", "openssl req -new -key rsu.key.pem -subj /O=verge/CN=rsu -out old.csr"
                    " && openssl x509 -req -days -1 -in old.csr -CA identity_ca.crt.pem -CAkey "
                    "identity_ca.key.pem -CAcreateserial -out old.crt.pem"], cwd=ours, check=True,
                   capture_output=True)
    wrong = [({"key": ours / "open.key.pem"}, "chmod 600"),
             ({"key": ours / "none.pem"}, "cannot be read"),
             ({"key": ours / "vehicle.key.pem"}, "does not belong to the private key"),
             ({"certificate": ours / "old.crt.pem"}, "has expired on "),
             ({"certificate": foreign / "rsu.crt.pem", "key": foreign / "rsu.key.pem"},
              "is not signed by the authority"),
             ({"identity_ca": ours / "none.pem"}, "cannot be read"),
             ({"governance": foreign / "governance.p7s"}, "permissions_ca"),
             ({"permissions": ours / "vehicle.permissions.p7s"}, "CN=rsu,O=verge"),
             ({"permissions": ours / "rsu.permissions.xml"}, "is no signed document")]
    for changes, remedy in wrong:
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config", secured(rig, ours, **changes),
                                 "--check-config")
        check(code == 78 and remedy in error and error.count("\n") == 1 and
              any(f"dds.security.{field}: {path}: " in error for field, path in
                  {**changes, "certificate": changes.get("certificate", ours / "rsu.crt.pem")}
                  .items()), f"{changes}: exit {code}, told as {error!r}")
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", secured(rig, ours),
                             "--check-config")
    check(code == 0 and error == "", f"the good ones: exit {code}: {error!r}")


def certificates_near_their_expiry_give_a_warning_and_work(rig):
    papers = certificates(rig, "ends", "--days", "20", "rsu")
    config = secured(rig, papers)
    code, _, error = rig.run(rig.bin / "verge-rsu", "--config", config, "--check-config")
    check(code == 0 and error.count("\n") == 1 and
          f"warning: dds.security.certificate: {papers / 'rsu.crt.pem'}: ends on " in error,
          f"exit {code}: {error!r}")
    with Daemon(rig, config) as rsu:
        rsu.wait_for("event=certificate_expires days=19 ")
        wait_for(lambda: figure(rig, "verge_cycles_total") > 15, "three seconds of cycles")
        check(rsu.text().count("certificate_expires") == 1, f"told once:\n{rsu.text()}")
        certificates(rig, "ends", "--days", "60", "rsu") # renews what ends within a month
        rsu.signal(signal.SIGHUP)
        rsu.wait_for("config_applied")
        cycles = figure(rig, "verge_cycles_total")
        wait_for(lambda: figure(rig, "verge_cycles_total") > cycles + 15, "three seconds more")
        check(rsu.text().count("certificate_expires") == 1, f"renewed:\n{rsu.text()}")
        check(rsu.stop()[1] == 0, "stops")
    error = rig.run(rig.bin / "verge-rsu", "--config", config, "--check-config")[2]
    check(error == "", f"renewed: {error!r}")


def an_open_bus_beside_a_secured_one_gives_a_warning(rig):
    papers = certificates(rig, "ours")
    write_key(rig.folder / "one.key")
    security = json.loads((papers / "rsu.options.json").read_text())["dds"]["security"]
    dds = {"security": {key: str(papers / path) for key, path in security.items()}}
    signed = {"keys": [{"id": 1, "file": "one.key"}]}
    near, far = URL, URL.replace("ttl=0", "ttl=1")
    lax = papers / "lax.p7s" # secured, but admits participants without a certificate
    subprocess.run(["sh", "-c", "sed 's,participants>false,participants>true,' governance.xml >lax.xml"
                    " && openssl smime -sign -text -in lax.xml -out lax.p7s -signer "
                    "permissions_ca.crt.pem -inkey permissions_ca.key.pem"], cwd=papers, check=True,
                   capture_output=True)
    open_dds = {"interfaces": ["verge9"], "security": dict(dds["security"], governance=str(lax))}
    cases = [({"bus": [far, "dds:0"], "dds": dds}, (far, "dds:0")),
             ({"bus": ["dds:0", far], "dds": dds}, (far, "dds:0")),
             ({"bus": [near, "dds:0"], "dds": open_dds, "lcm": signed}, ("dds:0", near)),
             ({"bus": [far, "dds:0"], "dds": dds, "lcm": signed}, None),
             ({"bus": [near, "dds:0"], "dds": dds}, None),
             ({"bus": [far, "dds:0"]}, None), ({"bus": far, "dds": dds}, None)]
    for document, pair in cases:
        code, _, error = rig.run(rig.bin / "verge-rsu", "--config", rig.config(**document),
                                 "--check-config")
        told = [line for line in error.splitlines() if "secure both buses" in line]
        check(code == 0 and len(told) == (pair is not None), f"{document}: exit {code}: {error!r}")
        check(pair is None or f"can reach {pair[0]}, and" in told[0] and
              f"vehicle of {pair[1]}, which" in told[0], f"{document}: told as {told}")


LCM_CASES = [
    signed_vehicles_are_planned_and_all_others_are_not,
    a_vehicle_without_keys_is_planned_by_a_daemon_without_keys,
    a_replaced_key_takes_effect_with_sighup,
    signing_and_checking_allocate_nothing,
    keys_that_cannot_work_are_refused_with_the_remedy,
    open_buses_give_a_warning,
]
DDS_CASES = [
    two_participants_with_certificates_communicate_encrypted,
    an_observer_receives_all_and_a_renewed_certificate_takes_effect_with_sighup,
    other_participants_neither_receive_nor_send_and_the_log_says_why,
    without_the_right_to_publish_the_daemon_does_not_start,
    unusable_certificates_are_refused_with_the_remedy,
    certificates_near_their_expiry_give_a_warning_and_work,
    an_open_bus_beside_a_secured_one_gives_a_warning,
]


def main():
    args = case_arguments() # Python's lcm is not used
    for tool in ("lcm-gen", "openssl"):
        if shutil.which(tool) is None:
            e2e_lcm.skip(f"{tool} is missing (tools/setup installs it)")
    e2e_lcm.enter_network()
    with tempfile.TemporaryDirectory() as name:
        subprocess.run(["lcm-gen", "-p", "--ppath", name, SOURCE / "transport/types/verge.lcm"],
                       check=True)
        sys.path.insert(0, name)
        global verge
        import verge
        e2e_lcm.verge = verge

        rig = Rig(args.bin, name)
        if not signing_is_built(rig):
            e2e_lcm.skip("this build has no OpenSSL")
        cases = LCM_CASES
        if dds_is_built(rig):
            cases = LCM_CASES + DDS_CASES
        else:
            print("this build has no DDS: its cases are left out", flush=True)
        return run_cases(cases, args.bin, args.only)


if __name__ == "__main__":
    sys.exit(main())
