#!/usr/bin/python3
"""Makes a page that replays a run: one HTML file, opened from disk, without a network.

The run file is that of verge-sim and verge-publish, format verge-run/1. An incomplete file is
replayed as far as it goes. Text, style and program of the page are in replay_page/. This script
adds the run in a compact form: lengths are rounded to millimetres and written as second
differences, which have one or two digits for smooth motion. A minute of sixty vehicles takes about
2 MB.

Exit status: 0 done, 2 wrong usage or input (one line on standard error).
"""
import html
import json
import math
import pathlib
import re
import sys

sys.dont_write_bytecode = True  # the folder of an installed program is not to be written to

try:
    import numpy as np
except ImportError as error:
    sys.exit(f"replay_html.py: {error}, expected Debian's python3-numpy (/usr/bin/python3)")

from one_line import BadInput, told_in_one_line, two_files
from road_lines import Frame, Lane, painted_lines
from run_file import check_row, read_run

PAGE = pathlib.Path(__file__).resolve().parent / "replay_page"
ARROW_EVERY = 60.0      # [m] between two arrows painted on a lane
DRAWN_DT = 0.3          # [s] between the points of a planned path that are kept, at least
STRAIGHT = 0.01         # [m] a painted line may deviate from its surveyed points
STATE = {"x": 1e3, "y": 1e3, "heading": 1e4, "speed": 1e3, "acceleration": 1e3}  # units per SI unit
METRIC_DIGITS = 6
MODES = ("following", "departing", "alone", "stopping", "none")  # of on-vehicle units


# --- small numbers ------------------------------------------------------------------------------

def packed(values, unit=1e3):
    """Rounded to 1/unit, then: the first value, the first step, and how each step differs."""
    whole = [round(value * unit) for value in values]
    steps = [b - a for a, b in zip(whole, whole[1:])]
    return whole[:1] + steps[:1] + [b - a for a, b in zip(steps, steps[1:])]


def packed_line(points):
    return [packed(column) for column in zip(*points)]


def tidy(value):
    """Numbers of a report, rounded for reading; a number that is not finite becomes null."""
    if isinstance(value, dict):
        return {key: tidy(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [tidy(inner) for inner in value]
    if isinstance(value, float):
        return float(f"{value:.{METRIC_DIGITS}g}") if math.isfinite(value) else None
    return value


def unwound(angles):
    """The same headings without jumps of a whole turn, so that they can be interpolated."""
    found = list(angles[:1])
    for angle in angles[1:]:
        found.append(found[-1] + math.remainder(angle - found[-1], 2.0 * math.pi))
    return found


def simplified(line):
    """A polyline without the points that lie on the straight between their neighbours."""
    keep = np.zeros(len(line), dtype=bool)
    keep[[0, -1]] = True
    pending = [(0, len(line) - 1)]
    while pending:
        a, b = pending.pop()
        if b - a < 2:
            continue
        chord = line[b] - line[a]
        length = max(1e-9, math.hypot(*chord))
        away = line[a + 1:b] - line[a]
        apart = np.abs(away[:, 0] * chord[1] - away[:, 1] * chord[0]) / length
        worst = int(apart.argmax())
        if apart[worst] > STRAIGHT:
            keep[a + 1 + worst] = True
            pending += [(a, a + 1 + worst), (a + 1 + worst, b)]
    return line[keep]


# --- the run ------------------------------------------------------------------------------------

def habit_word(habit):
    if isinstance(habit, dict):
        share = habit.get("cooperation")
        return "own habit" if share is None else f"own habit, cooperation {share:g}"
    return habit or "normal"


class Vehicle:
    """One vehicle over the run: the ranges of ticks in which it was present."""

    def __init__(self, info):
        self.info, self.parts, self.modes = info, [], []

    def add(self, tick, row):
        check_row(row)
        if not self.parts or tick != self.parts[-1][0] + len(self.parts[-1][1]):
            self.parts.append((tick, []))
        self.parts[-1][1].append(row)

    def document(self):
        info = self.info
        return {"id": info["id"], "controlled": info["control"] == "controlled",
                "length": info["length"], "width": info["width"],
                "target": info.get("target_lane"), "habit": habit_word(info.get("habit")),
                "recorded": "track" in info, "modes": self.modes,
                "parts": [self.part(first, rows) for first, rows in self.parts]}

    def add_mode(self, t, unit):
        """A change of the mode of its on-vehicle unit, its reason, or the vehicle of the reason."""
        if unit["mode"] not in MODES:
            raise ValueError(f"mode {unit['mode']}")
        self.modes.append([t, unit["mode"], unit["reason"], unit["vehicle"], unit["cycle"]])

    @staticmethod
    def part(first, rows):
        columns = dict(zip(STATE, zip(*(row[1:6] for row in rows))))
        columns["heading"] = unwound(columns["heading"])
        part = {name: packed(columns[name], unit) for name, unit in STATE.items()}
        signs = [[i, *row[6:10]] for i, row in enumerate(rows)
                 if i == 0 or row[6:10] != rows[i - 1][6:10]]
        return {"first": first, "count": len(rows), "signs": signs, **part}


class Words:
    """Stores each sentence once; other places refer to it by number."""

    def __init__(self):
        self.numbers = {}

    def number(self, text):
        return self.numbers.setdefault(text, len(self.numbers))


# --- plans --------------------------------------------------------------------------------------

def drawn_points(points, dt):
    """Fewer points of a path, at least DRAWN_DT apart; the page joins them by straight lines."""
    stride = max(1, round(DRAWN_DT / dt))
    return stride * dt, points[::stride]


def place_on(lane, along, aside):
    """The map position of an expected state; beyond the end of the lane, straight ahead."""
    if lane is None or along is None or aside is None:
        return None
    at = min(max(along / lane.length, 0.0), 1.0) * (len(lane.centre) - 1)
    i = min(int(at), len(lane.centre) - 2)
    point = lane.centre[i] + (at - i) * (lane.centre[i + 1] - lane.centre[i])
    point = point + max(0.0, along - lane.length) * lane.tangent[-1] + aside * lane.normal[i]
    return [round(1e3 * float(value)) for value in point]


def planned_vehicle(plan, lanes, words):
    trajectory = plan["trajectory"]
    dt, points = drawn_points(trajectory["points"], trajectory["dt"])
    column = {name: i for i, name in enumerate(trajectory["columns"])}
    steps = [[a["t0"], a["t1"], a["action"], a["lane"], a["turn_signal"], int(a["brake_light"]),
              words.number(a["say"]), place_on(lanes.get(a["lane"]), a.get("s"), a.get("d"))]
             for a in plan["actions"]]
    return {"id": plan["id"], "status": plan["status"], "reason": plan.get("reason"), "dt": dt,
            "steps": steps, "cost": tidy(plan.get("cost", {}).get("total")),
            **{name: packed([p[column[name]] for p in points]) for name in ("x", "y", "speed")}}


def predicted_vehicle(prediction):
    points = prediction["points"]
    dt, points = drawn_points(points, points[1][0] - points[0][0] if len(points) > 1 else 1.0)
    return {"id": prediction["id"], "dt": dt, "hypotheses": tidy(prediction.get("hypotheses")),
            "x": packed([p[1] for p in points]), "y": packed([p[2] for p in points])}


def plan_document(t, plan, lanes, words):
    return {"t": t, "search": tidy(plan.get("search", {})), "digest": plan.get("digest"),
            "vehicles": [planned_vehicle(v, lanes, words) for v in plan["vehicles"]],
            "predictions": [predicted_vehicle(p) for p in plan.get("predictions", [])
                            if p["points"]]}


# --- the road -----------------------------------------------------------------------------------

def arrows_of(lane):
    """[x, y, heading, lane] of the arrows painted on a lane, none where it is short."""
    count = int(lane.length // ARROW_EVERY)
    at = [int((k + 0.5) / count * (len(lane.centre) - 1)) for k in range(count)]
    return [[round(float(lane.centre[i, 0]), 2), round(float(lane.centre[i, 1]), 2),
             round(math.atan2(lane.tangent[i, 1], lane.tangent[i, 0]), 4), lane.id] for i in at]


def road_document(lanes):
    dashed, solid = painted_lines(lanes)

    def lines(points):
        return [packed_line(simplified(line)) for line in points]
    return {"areas": lines([lane.outline() for lane in lanes]), "dashed": lines(dashed),
            "solid": lines(solid), "arrows": [a for lane in lanes for a in arrows_of(lane)]}


def frame_of(vehicles):
    """How the map is turned for the screen, from the paths of the controlled vehicles."""
    driven = [v for v in vehicles if v.info["control"] == "controlled"] or vehicles
    points = np.array([row[1:3] for v in driven for _, rows in v.parts for row in rows])
    forward = sum(np.subtract(v.parts[-1][1][-1][1:3], v.parts[0][1][0][1:3]) for v in driven)
    return Frame(points, forward)


class Run:
    """The lines of a run file, sorted by their kind."""

    def __init__(self, path):
        read_run(path, self.begin, self.add)
        self.vehicles = [v for _, v in sorted(self.by_id.items()) if v.parts]
        if not self.vehicles:
            raise BadInput(f"{path}:file: no vehicle moves in this run, expected at least one")

    def begin(self, scenario):
        self.name, self.source = scenario["name"], scenario.get("source", "")
        self.lanes = [Lane(lane) for lane in scenario["road"]["lanes"]]
        self.lane_by_id = {lane.id: lane for lane in self.lanes}
        self.by_id = {info["id"]: Vehicle(info) for info in scenario["vehicles"]}
        self.times, self.plans, self.metrics, self.words = [], [], None, Words()

    def add(self, line):
        if "vehicles" in line:
            for row in line["vehicles"]:
                self.by_id[row[0]].add(len(self.times), row)
            self.times.append(line["t"])
        elif "plan" in line:
            plan = plan_document(line["t"], line["plan"], self.lane_by_id, self.words)
            self.plans.append(plan)
        elif "unit" in line:
            self.by_id[line["unit"]["id"]].add_mode(line["t"], line["unit"])
        elif "metrics" in line:
            self.metrics = line["metrics"]

    def document(self):
        """The run in the form that the page reads."""
        frame = frame_of(self.vehicles)
        direction = None if frame.direction is None else round(frame.direction, 6)
        return {"name": self.name, "source": self.source, "turn": round(frame.angle, 6),
                "direction": direction, "times": packed(self.times),
                "road": road_document(self.lanes),
                "vehicles": [v.document() for v in self.vehicles], "plans": self.plans,
                "words": list(self.words.numbers), "metrics": tidy(self.metrics)}


# --- the page -----------------------------------------------------------------------------------

def page(document):
    """The template with its parts filled in. No text of a run can end the script around it."""
    data = json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    parts = {"title": html.escape(f"{document['name']} - verge replay"), "run": data,
             "style": (PAGE / "replay.css").read_text(encoding="utf-8"),
             "program": (PAGE / "replay.js").read_text(encoding="utf-8")}
    template = (PAGE / "replay.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def main():
    source, out = two_files(__doc__, "RUN.jsonl OUT.html")
    text = page(Run(source).document())
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(told_in_one_line(main))
