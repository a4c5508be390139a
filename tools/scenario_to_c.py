"""Turns scenario files into C tables, so that a program without JSON can plan them.

    scenario_to_c.py SCENARIO.json... > scenarios.c

The tables contain the state at t = 0, in the order of the file, as verge-plan reads it. Numbers
have all their digits, so that the C compiler reads the same values as the JSON reader. The tables
are included by tests/determinism/digest_main.c.
"""
import math
import pathlib
import sys

from one_line import BadInput, read_json, told_in_one_line

HABITS = {"aggressive": 0, "normal": 1, "conservative": 2}
WEIGHTS = ("curvature", "heading", "offset", "acceleration", "jerk", "obstacle")
INSTANT = 1e-6           # [s] instants closer than this are equal
ACCELERATION_MAX = 15.0  # [m/s^2] larger values are measurement noise
SEARCH = {"paper": "VERGE_SEARCH_PAPER", "best": "VERGE_SEARCH_BEST",
          "policy": "VERGE_SEARCH_POLICY"}


def number(value):
    return repr(float(value))


def lane_id(value):
    return "VERGE_NO_LANE" if value is None else str(int(value))


def stretches(lane, side):
    given = lane.get(f"change_{side}")
    if given is None:
        return ""
    rows = ", ".join(f"{{{number(a)}, {number(b)}}}" for a, b in given)
    text = f", .change_{side}_given = true, .change_{side}_count = {len(given)}"
    return text + (f", .change_{side} = {{{rows}}}" if given else "")


def lane_tables(name, lanes):
    for index, lane in enumerate(lanes):
        points = ",\n    ".join(f"{{{number(x)}, {number(y)}}}" for x, y in lane["centerline"])
        yield f"static const double {name}_points_{index}[][2] = {{\n    {points}}};"
    yield f"static const verge_lane_def {name}_lanes[] = {{"
    for index, lane in enumerate(lanes):
        next_lanes = lane.get("successors", [])
        ids = f", .successors = {{{', '.join(map(str, next_lanes))}}}" if next_lanes else ""
        yield (
            f"    {{.id = {lane['id']}, .points = {name}_points_{index},"
            f" .point_count = {len(lane['centerline'])},\n"
            f"     .width = {number(lane['width'])},"
            f" .speed_limit = {number(lane['speed_limit'])},\n"
            f"     .left = {lane_id(lane.get('left'))}, .right = {lane_id(lane.get('right'))},\n"
            f"     .successor_count = {len(next_lanes)}{ids}"
            f"{stretches(lane, 'left')}{stretches(lane, 'right')}}},"
        )
    yield "};"


def wrapped(angle):
    """Into (-pi, pi]; an angle that is inside stays as it is."""
    while angle > math.pi:
        angle -= 2.0 * math.pi
    while angle <= -math.pi:
        angle += 2.0 * math.pi
    return angle


def at_start(vehicle):
    """The vehicle at t = 0, or None where its track enters later or has left.

    The arithmetic of scenario_track_at() in apps/common/scenario.c, operation by operation.
    """
    track = vehicle.get("track")
    if not track:
        return {**vehicle, "heading": wrapped(float(vehicle["heading"])), "yaw_rate": None}
    if track[0][0] > INSTANT or track[-1][0] < -INSTANT:
        return None
    after = 1 if len(track) > 1 else 0
    while after + 1 < len(track) and track[after][0] <= 0.0:
        after += 1
    start, end = track[max(after - 1, 0)], track[after]
    step = float(end[0] - start[0])
    share = min(max((0.0 - start[0]) / step, 0.0), 1.0) if step > 0.0 else 0.0
    from_heading, to_heading = wrapped(float(start[3])), wrapped(float(end[3]))
    turn = wrapped(to_heading - from_heading)
    now = {**vehicle, "yaw_rate": None}
    for key, k in (("x", 1), ("y", 2), ("speed", 4)):
        now[key] = start[k] + share * (end[k] - start[k])
    now["heading"] = wrapped(from_heading + share * turn)
    if step > 0.0:
        rate = (end[4] - start[4]) / step
        now["acceleration"] = min(max(rate, -ACCELERATION_MAX), ACCELERATION_MAX)
        now["yaw_rate"] = turn / step
    return now


def vehicle_row(vehicle):
    habit = vehicle.get("habit", "normal")
    weights = [0.0] * len(WEIGHTS)
    cooperation = 0.0
    kind = -1
    if isinstance(habit, dict):
        cooperation = habit["cooperation"]
        weights = [habit["weights"][key] for key in WEIGHTS]
    else:
        kind = HABITS[habit]
    target = vehicle.get("target_lane")
    return (
        f"    {{{vehicle['id']}, {'true' if vehicle['control'] == 'controlled' else 'false'},"
        f" {number(vehicle['x'])}, {number(vehicle['y'])}, {number(vehicle['heading'])},\n"
        f"     {number(vehicle['speed'])}, {number(vehicle['acceleration'])},"
        f" {'NAN' if vehicle['yaw_rate'] is None else number(vehicle['yaw_rate'])},"
        f" {number(vehicle['length'])}, {number(vehicle['width'])}, {lane_id(target)},\n"
        f"     {kind}, {number(cooperation)}, {{{', '.join(map(number, weights))}}}}},"
    )


def assignment(key, value):
    if key == "search":
        return f"    def->search = {SEARCH[value]};"
    if isinstance(value, bool):
        return f"    def->{key} = {int(value)};"
    return f"    def->{key} = {value if isinstance(value, int) else number(value)};"


def scenario(path, data):
    name = "s_" + "".join(c if c.isalnum() else "_" for c in path.stem)
    yield f"// {path.name}"
    yield from lane_tables(name, data["road"]["lanes"])
    vehicles = [v for v in map(at_start, data["vehicles"]) if v is not None]
    yield f"static const vehicle_row {name}_vehicles[] = {{"
    yield from map(vehicle_row, vehicles)
    yield "};"
    yield f"static void {name}_def(verge_planner_def* def)\n{{"
    planner = data.get("planner", {})
    yield from (assignment(key, value) for key, value in planner.items())
    yield "" if planner else "    (void)def;"
    yield "}\n"
    return (
        f'    {{"{path.stem}", {name}_lanes, {len(data["road"]["lanes"])}, {name}_vehicles,'
        f" {len(vehicles)}, {name}_def}},"
    )


def table_row(path, data):
    """Prints the tables of a scenario; returns its row in the table of scenarios."""
    lines = scenario(path, data)
    try:
        while True:
            print(next(lines))
    except StopIteration as end:
        return end.value
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise BadInput(f"{path}:document: unexpected or missing {error}, expected format "
                       "verge-scenario/1") from None


def main():
    if not sys.argv[1:] or sys.argv[1].startswith("--"):
        raise BadInput("scenario_to_c.py:arguments: missing, expected scenario files")
    print("// Made by tools/scenario_to_c.py; edit the scenarios instead.")
    table = []
    for path in sorted(map(pathlib.Path, sys.argv[1:]), key=lambda p: p.stem):
        data = read_json(path, "a scenario (format verge-scenario/1)")
        if isinstance(data, dict) and data.get("format") == "verge-scenario/1":
            table.append(table_row(path, data))
    print("static const scenario scenarios[] = {")
    print("\n".join(table))
    print("};")


sys.exit(told_in_one_line(main))
