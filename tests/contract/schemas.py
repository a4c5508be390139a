"""Claim: verge.lcm and verge.idl say the same, what the list of fields says, and the IDL keeps the
rules that spare its clients.

    schemas.py SOURCE_DIR

Same structs, same fields, in the same order, of the same types and array sizes; the keys are the
vehicle's or the unit's id; no 8-bit integers, no array of arrays, nothing of variable length, every
struct final; and tools/messages would write both as they are. (That the two compilers also lay the
fields out alike is the C compiler's to say: the static assertions of dds_types.c.)
"""
import pathlib
import re
import subprocess
import sys

IDL_TYPE = {"short": "int16_t", "long": "int32_t", "long long": "int64_t", "float": "float",
            "double": "double"}
KEYS = {"vehicle_state_t": ["vehicle_id"], "vehicle_plan_t": ["vehicle_id"],
        "rsu_status_t": ["rsu_id"], "lane_signal_t": ["lane"],
        "vehicle_trajectory_t": ["vehicle_id"], "plan_action_t": [],
        "plan_pass_t": [], "plan_stop_t": [], "plan_point_t": []}


def bare(text):
    return re.sub(r"\s*//[^\n]*", "", text)


def structs_of_lcm(text):
    """[(struct, [(type, field, array size or "")])]"""
    found = re.findall(r"struct (\w+)\s*\{(.*?)\}", bare(text), re.DOTALL)
    return [(name, re.findall(r"(\w+)\s+(\w+)(?:\[(\d+)\])?;", body)) for name, body in found]


def structs_of_idl(text):
    """The same in LCM's words, and the keys by struct."""
    found, keys = [], {}
    text = bare(text)
    structs = re.findall(r"(@final\s+)?struct (\w+)\s*\{(.*?)\}", text, re.DOTALL)
    for final, name, body in structs:
        assert final, f"{name} is not @final"
        fields, keys[name] = [], []
        for line in filter(None, map(str.strip, body.split(";"))):
            match = re.fullmatch(r"(@key )?([a-z_ ]+?) _?(\w+)(?:\[(\d+)\])?", line)
            assert match, f"{name}: not in our part of IDL: {line}"
            key, kind, field, size = match.groups()
            assert kind in IDL_TYPE or kind in (n for n, _ in found), f"{name}.{field}: {kind}"
            fields.append((IDL_TYPE.get(kind, kind), field, size or ""))
            keys[name] += [field] if key else []
        found.append((name, fields))
    return found, keys


def main():
    root = pathlib.Path(sys.argv[1])
    lcm = structs_of_lcm((root / "transport/types/verge.lcm").read_text())
    idl, keys = structs_of_idl((root / "transport/types/verge.idl").read_text())
    assert [name for name, _ in lcm] == [name for name, _ in idl], (lcm, idl)
    count = 0
    for (name, fields), (_, others) in zip(lcm, idl):
        for one, other in zip(fields, others):
            assert one == other, f"{name}: {one} in verge.lcm, {other} in verge.idl"
            count += 1
        assert len(fields) == len(others), f"{name}: {len(fields)} fields and {len(others)}"
    assert keys == KEYS, keys
    assert len(lcm) == len(KEYS) and count > 90, f"only {len(lcm)} structs with {count} fields were found"
    subprocess.run([root / "tools/messages", "--check"], check=True)
    print(f"{len(lcm)} structs, {count} fields")


main()
