#!/usr/bin/env python3
"""Claim: the JSON schemas and the programs agree on what a scenario and a configuration are.

Everything shipped is accepted by both. For every key of a whole document, found by walking the
schema: an unknown neighbour, a wrong type, a value beyond either end of its range and, where it is
required, its absence are refused by both; the ends themselves by neither. The keys a program
names when it refuses an unknown one are those of the schema. Rules that a schema cannot express
(limits in order, lanes that exist) are checked by the program only: the schema accepts every
document that the program accepts.

Usage: e2e_schema.py --bin DIR
"""
import argparse
import copy
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    import jsonschema
except ImportError:
    print("SKIPPED: Python's jsonschema is missing (Debian: python3-jsonschema)")
    sys.exit(77)

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SCHEMA = ROOT / "apps/schema"


class Kind:
    """A kind of document: its schema, and the program that reads it."""

    def __init__(self, name, command, refusals, work):
        self.path = SCHEMA / f"{name}.schema.json"
        self.schema = json.loads(self.path.read_text())
        jsonschema.Draft202012Validator.check_schema(self.schema)
        resolver = jsonschema.RefResolver(self.path.as_uri(), self.schema)
        self.validator = jsonschema.Draft202012Validator(self.schema, resolver=resolver)
        self.command, self.refusals, self.work = command, refusals, work
        self.tried = 0

    def schema_accepts(self, document):
        return self.validator.is_valid(document)

    def program(self, document, text=None):
        """What the program says against it; None: it accepts."""
        path = self.work / "document.json"
        path.write_text(json.dumps(document) if text is None else text)
        done = subprocess.run([str(part) for part in (*self.command, path)],
                              capture_output=True, text=True, timeout=120, check=False)
        self.tried += 1
        if done.returncode == 0:
            return None
        assert done.returncode in self.refusals, (done.returncode, done.stderr)
        assert done.stderr.count("\n") == 1, done.stderr
        return done.stderr.strip()

    def both_refuse(self, document, why):
        assert not self.schema_accepts(document), f"{self.path.name} accepts {why}"
        said = self.program(document)
        assert said, f"{self.command[0].name} accepts {why}"
        return said

    def resolve(self, part, root=None):
        root = root or self.schema
        while "$ref" in part:
            file, _, pointer = part["$ref"].partition("#")
            root = json.loads((SCHEMA / file).read_text()) if file else root
            part = root
            for name in pointer.strip("/").split("/"):
                part = part[name]
        return part, root


def changed(document, path, value):
    """A copy with the value at path; value is ... : without it."""
    copied = copy.deepcopy(document)
    at = copied
    for step in path[:-1]:
        at = at[step]
    if value is ...:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return copied


def check_value(kind, document, path, part):
    """One value of a document that both accept, and its schema."""
    where = ".".join(map(str, path))
    wrong = [True] if part.get("type") != "boolean" and "oneOf" not in part else ["x"]
    if "enum" in part or "const" in part:
        wrong.append("none of these")
    for value in wrong:
        kind.both_refuse(changed(document, path, value), f"{where} = {value!r}")
    if "minimum" not in part:
        return
    low, high = part["minimum"], part["maximum"]
    step = 1 if "integer" in part["type"] else max(1e-3, abs(high) * 1e-6)
    for value in (low - step, high + step):
        said = kind.both_refuse(changed(document, path, value), f"{where} = {value}")
        assert "expected" in said, said
    for value in (low, high):
        edge = changed(document, path, value)
        assert kind.schema_accepts(edge), f"{where} = {value}"
        said = kind.program(edge)
        # Other rules may forbid an end of the range (lanes that exist, sums); its range must not.
        assert said is None or not re.search(rf"is {re.escape(f'{value:.12g}')}, expected [-\d]",
                                             said), said


def walk(kind, document, path, part, root):
    part, root = kind.resolve(part, root)
    at = document
    for step in path:
        at = at[step]
    if isinstance(at, dict):
        for option in part.get("oneOf", []):
            option, _ = kind.resolve(option, root)
            if "properties" in option:
                part = option
        said = kind.both_refuse(changed(document, [*path, "unheard_of"], 1),
                                f"an unknown key in {path}")
        listed = re.search(r"expected one of: ?(.*)", said)
        if listed:
            keys = set(part["properties"])
            told = set(filter(None, listed.group(1).split(", ")))
            assert keys == told, \
                f"{kind.path.name}, {path}: only in one of schema and program: {keys ^ told}"
        else:
            assert "expected a planner parameter" in said, said
        for name in part.get("required", []):
            kind.both_refuse(changed(document, [*path, name], ...), f"no {name} in {path}")
        for name, value in part["properties"].items():
            if name in at:
                walk(kind, document, [*path, name], value, root)
        return
    if isinstance(at, list):
        kind.both_refuse(changed(document, path, {"0": 1}), f"an object as {path}")
        if at and isinstance(at[0], dict):
            walk(kind, document, [*path, 0], part["items"], root)
        return
    check_value(kind, document, path, part)


def check_example(kind, page):
    """The example of a manual page is a document as good as any."""
    text = (ROOT / "apps/man" / page).read_text().split(".Sh EXAMPLES")[1]
    document = json.loads(text.split(".Bd -literal\n")[1].split(".Ed")[0])
    assert kind.schema_accepts(document) and kind.program(document) is None, page


def check_configurations(binaries, work, daemon, plain, wrong, more):
    """The configurations of verge-rsu or verge-obu. wrong: [(key, value, what that is)];
    more: values of keys that are null by default."""
    kind = Kind(daemon, [binaries / daemon, "--check-config", "--config"], (66, 78), work)
    short = daemon.removeprefix("verge-")
    shipped = [*ROOT.glob(f"apps/scenarios/{short}-*.json"), *ROOT.glob(f"apps/site/{short}*.json")]
    assert len(shipped) >= 2
    for path in shipped:
        assert kind.schema_accepts(json.loads(path.read_text())), path
    # The configuration in force names every key there is, with its default.
    printed = json.loads(subprocess.run(
        [binaries / daemon, "--config", plain, "--print-config"],
        capture_output=True, text=True, check=True).stdout)
    printed["road"] = json.loads((ROOT / "apps/site/road.json").read_text())["road"]
    del printed["road_file"]
    # A secured unit, with the files tools/certs makes. They lie where the document will.
    subprocess.run([ROOT / "tools/certs", "--out", work], check=True, capture_output=True)
    secured = json.loads((work / "rsu.options.json").read_text())
    printed["dds"] = {"interfaces": ["lo"], "peers": ["127.0.0.1"], **secured["dds"]}
    printed["lcm"] = {"allow": ["10.1.0.0/16"], "window_ms": 500, **secured["lcm"]}
    printed |= more
    assert kind.schema_accepts(printed) and kind.program(printed) is None, kind.program(printed)
    properties, _ = kind.resolve(kind.schema)
    for name in ("planner", "freshness"):
        assert list(kind.schema["$defs"][name]["properties"]) == list(printed[name])
        for key, value in printed[name].items():
            default = kind.schema["$defs"][name]["properties"][key]["default"]
            assert default == value or abs(default - value) < 1e-6, (key, default, value)
    for name, value in printed.items():
        if name in more:
            continue
        told = properties["properties"][name].get("default", value)
        assert told == value, (name, told, value)
    walk(kind, printed, [], kind.schema, kind.schema)
    (work / "road.json").write_text((ROOT / "apps/site/road.json").read_text())
    check_example(kind, f"{daemon}.json.5")
    for document, why in (
            ({**printed, "road_file": "road.json"}, "two roads"),
            (changed(printed, ["road"], ...), "no road"),
            (changed(printed, ["bus"], "serial:1"), "an unknown bus"),
            (changed(printed, ["bus"], []), "no bus at all"),
            (changed(printed, ["bus"], ["loop:1", "serial:1"]), "an unknown bus among two"),
            (changed(printed, ["bus"], ["loop:1", "loop:1"]), "one bus twice"),
            (changed(printed, ["bus"], [f"loop:{i}" for i in range(5)]), "five buses"),
            (changed(printed, ["realtime", "cpus"], [2000]), "a processor beyond the last"),
            *((changed(printed, [key], value), why) for key, value, why in wrong),
            (changed(printed, ["lcm", "allow"], [1]), "a network that is a number"),
            (changed(printed, ["lcm", "keys", 0, "file"], ""), "a key without a name"),
            (changed(printed, ["dds", "peers"], "127.0.0.1"), "peers that are no list"),
            (changed(printed, ["log_format"], "xml"), "an unknown format of the log"),
            ([printed], "a list")):
        kind.both_refuse(document, why)
    return kind.tried


def check_scenarios(binaries, work):
    kind = Kind("verge-scenario", [binaries / "verge-plan"], (2,), work)
    shipped = [path for path in ROOT.glob("apps/scenarios/*.json")
               if not path.name.startswith("rsu-")]
    assert len(shipped) >= 11
    for path in shipped:
        errors = list(kind.validator.iter_errors(json.loads(path.read_text())))
        assert not errors, f"{path}: {errors[0].message}"
    lane = {"id": 0, "centerline": [[0, 0], [300, 0]], "width": 3.5, "speed_limit": 15,
            "left": None, "right": None, "successors": []}
    whole = {
        "format": "verge-scenario/1", "name": "whole", "source": "this test",
        "road": {"lanes": [lane]},
        "vehicles": [{"id": 1, "control": "controlled", "x": 20, "y": 0, "heading": 0, "speed": 10,
                      "acceleration": 0, "length": 5, "width": 2, "target_lane": 0,
                      "body": {"kind": "car", "length": 5, "width": 2, "rear_axle": 1.4,
                               "wheelbase": 2.6, "steer_max": 0.6, "steer_rate_max": 0.4,
                               "acceleration_max": 4, "speed_switch": 7, "braking_max": 9,
                               "lateral_max": 8, "speed_max": 50, "hitch": 2.4,
                               "trailer_length": 4, "trailer_width": 2, "trailer_axle": 3,
                               "trailer_front": 1},
                      "habit": {"cooperation": 0.5, "weights": dict.fromkeys(
                          ("curvature", "heading", "offset", "acceleration", "jerk", "obstacle"),
                          1)}},
                     {"id": 2, "control": "human", "x": 60, "y": 0, "heading": 0, "speed": 10,
                      "acceleration": 0, "length": 5, "width": 2,
                      "track": [[0, 60, 0, 0, 10], [1, 70, 0, 0, 10]]}],
        "planner": {"iterations": 20}, "simulation": {"duration": 1, "replan": 0.5}}
    assert kind.schema_accepts(whole) and kind.program(whole) is None, kind.program(whole)
    walk(kind, whole, [], kind.schema, kind.schema)
    check_example(kind, "verge-scenario.5")
    human = whole["vehicles"][1]
    for document, why in (
            (changed(whole, ["vehicles", 0, "track"], human["track"]), "a track it cannot follow"),
            (changed(whole, ["vehicles", 1, "track"], [[0, 60, 0, 0]]), "a row without speed"),
            (changed(whole, ["vehicles", 1, "track"], []), "a track without rows"),
            (changed(whole, ["vehicles", 0, "habit"], "reckless"), "an unknown habit"),
            (changed(whole, ["vehicles", 0, "body"], "tank"), "an unknown body"),
            (changed(whole, ["vehicles", 0, "body"], ["car"]), "a body that is a list"),
            (changed(whole, ["vehicles", 1, "length"], ...), "a vehicle without a length"),
            (changed(whole, ["vehicles", 1, "width"], ...), "a vehicle without a width"),
            (changed(whole, ["vehicles", 0, "habit"], {"cooperation": 1}), "half a habit"),
            (changed(whole, ["road", "lanes", 0, "centerline"], [[0, 0]]), "a lane of one point"),
            (changed(whole, ["road", "lanes", 0, "centerline"], [[0, 0, 0], [1, 0, 0]]), "heights"),
            (changed(whole, ["road", "lanes"], []), "no lane"),
            (changed(whole, ["format"], "verge-scenario/2"), "a later format"),
            (changed(whole, ["vehicles", 0, "target_lane"], "left"), "a lane by its side"),
            (whole["vehicles"], "a list")):
        kind.both_refuse(document, why)
    # The planner object of both schemas is one.
    rsu = json.loads((SCHEMA / "verge-rsu.schema.json").read_text())
    assert rsu["$defs"]["planner"] == kind.schema["$defs"]["planner"]
    return kind.tried


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--lcm-python")
    binaries = parser.parse_args().bin.resolve()
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        tried = check_configurations(
            binaries, work, "verge-rsu", ROOT / "apps/scenarios/rsu-ramp.json",
            [("rsu_id", 1.5, "half a unit"), ("rsu_id", None, "no unit")], {})
        plain = work / "obu.json"
        plain.write_text(json.dumps({"format": "verge-obu/1", "vehicle_id": 7, "bus": "loop:",
                                     "road_file": str(ROOT / "apps/site/road.json")}))
        tried += check_configurations(
            binaries, work, "verge-obu", plain,
            [("vehicle_id", None, "no vehicle"), ("vehicle_id", "7", "a vehicle by name"),
             ("rsu_id", -1, "a unit below 0"), ("rsu_id", 1.5, "half a unit"),
             ("state", "serial:1", "an unknown bus of states"), ("state", "", "an empty URL"),
             ("trajectory", "", "an empty URL"), ("trajectory", ["loop:1"], "a list of buses"),
             ("planner", {"controlled_max": 2}, "two vehicles to drive")],
            {"repeat": {"planner": {"iterations": 100}}})
        tried += check_scenarios(binaries, work)
    subprocess.run([ROOT / "tools/documents", binaries, "--check"], check=True)
    print(f"{tried} documents tried on the programs")


main()
