#!/usr/bin/env python3
"""Judges runs of verge-sim against what is expected of them. Shares no code with the planner.
usage: judge.py [--json] SCENE.json|FOLDER ...   beside each scene: NAME.expect.json, and NAME.jsonl
(the run) or NAME.err (the refusal).     judge.py --self-test"""
import argparse
import collections
import json
import math
import pathlib
import sys
import tempfile

DT = 0.1
SUBSTEPS = 10
REAR_AXLE = 1.4227      # [m] behind the centre of a car
CAR = 5.5               # [m] longer bodies roll about an axle of their own: judged where the scene states it
STANDING = 0.3          # [m/s]
FREE_WAY = 15.0         # [m]
BORDER = 0.3            # [m]
LINE = 1.0              # [m] over a stop line is still a stop
CELL = 0.5              # [m] of the squares in which vehicles cross
CROSSING = (0.5, 2.6)   # [rad] at smaller angles one follows the other, at larger ones they pass each other
PASSING = (0.5, 1.0)    # [s] between the body of one and that of the other: both planned, one not
PASSING_SLACK = 0.2     # [s] of ticks and squares
ACCELERATION = (-8.0, 4.0)
JERK = 15.0


# ---- geometry ----

def corners(x, y, heading, length, width):
    c, s = math.cos(heading), math.sin(heading)
    return [(x + a * c - b * s, y + a * s + b * c) for a, b in
            ((length / 2, width / 2), (-length / 2, width / 2), (-length / 2, -width / 2), (length / 2, -width / 2))]


def separation(p, q):
    """Of two convex polygons: the widest gap along a normal of an edge; negative: they overlap."""
    widest = -math.inf
    for polygon in (p, q):
        for (ax, ay), (bx, by) in zip(polygon, polygon[1:] + polygon[:1]):
            norm = math.hypot(bx - ax, by - ay)
            nx, ny = (by - ay) / norm, (ax - bx) / norm
            a = [x * nx + y * ny for x, y in p]
            b = [x * nx + y * ny for x, y in q]
            widest = max(widest, min(b) - max(a), min(a) - max(b))
    return widest


def angle_between(a, b):
    return abs(math.remainder(a - b, math.tau))


def blend(a, b, share):
    turn = math.remainder(b.heading - a.heading, math.tau)
    return a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.heading + share * turn


Place = collections.namedtuple("Place", "s d heading beyond")


class Lane:
    def __init__(self, doc):
        self.id, self.width, self.limit = doc["id"], doc["width"], doc["speed_limit"]
        self.left, self.right, self.to = doc.get("left"), doc.get("right"), doc.get("successors") or []
        self.segments, s = [], 0.0
        for (ax, ay), (bx, by) in zip(doc["centerline"], doc["centerline"][1:]):
            length = math.hypot(bx - ax, by - ay)
            if length > 0:
                self.segments.append((s, ax, ay, (bx - ax) / length, (by - ay) / length, length))
                s += length
        self.length = s
        points = doc["centerline"]
        self.box = (min(p[0] for p in points), max(p[0] for p in points),
                    min(p[1] for p in points), max(p[1] for p in points))

    def near(self, x, y, margin):
        a, b, c, d = self.box
        return a - margin <= x <= b + margin and c - margin <= y <= d + margin

    def project(self, x, y, reach=0.0):
        """The nearest place; the ends are continued straight by `reach`. d grows to the left."""
        best, last = None, len(self.segments) - 1
        for i, (s, ax, ay, ux, uy, length) in enumerate(self.segments):
            along = (x - ax) * ux + (y - ay) * uy
            held = min(max(along, -reach if i == 0 else 0.0), length + reach if i == last else length)
            px, py = ax + held * ux, ay + held * uy
            distance = math.hypot(x - px, y - py)
            if best is None or distance < best[0]:
                sign = math.copysign(1.0, ux * (y - ay) - uy * (x - ax))
                beyond = max(0.0, -along if i == 0 else 0.0, along - length if i == last else 0.0)
                best = distance, Place(s + held, sign * distance, math.atan2(uy, ux), beyond)
        return best[1]

    def at(self, s):
        for start, ax, ay, ux, uy, length in self.segments:
            if s <= start + length:
                break
        return ax + (s - start) * ux, ay + (s - start) * uy


class Road:
    def __init__(self, docs):
        self.lanes = {doc["id"]: Lane(doc) for doc in docs}

    def onward(self, ident):
        """The lane and all that continue it."""
        seen, todo = set(), [ident]
        while todo:
            k = todo.pop()
            if k in self.lanes and k not in seen:
                seen.add(k)
                todo += self.lanes[k].to
        return seen

    def inside(self, x, y, tolerance):
        for lane in self.lanes.values():
            # 10 m straight beyond its ends, too: where vehicles enter and leave
            if lane.near(x, y, 12.0) and abs(lane.project(x, y, 10.0).d) <= lane.width / 2 + tolerance:
                return True
        return False

    def lane_of(self, state, last):
        """Follows a vehicle from lane to lane; at equal right it stays, then goes on, then changes."""
        own = self.lanes.get(last)
        if own is None:
            return min(self.lanes, key=lambda k: self.misfit(k, state, 0.0))
        beside = [n for n in (own.left, own.right) if n is not None]
        ahead = own.to + [s for n in beside for s in self.lanes[n].to]
        penalty = {last: 0.0, **{k: 0.05 for k in ahead}, **{k: 0.3 for k in beside}}
        return min(penalty, key=lambda k: self.misfit(k, state, penalty[k]))

    def misfit(self, k, state, penalty):
        place = self.lanes[k].project(state.x, state.y)
        return abs(place.d) + penalty + 3.0 * (angle_between(place.heading, state.heading) > 1.2)

    def way(self, ident, state, target, reach):
        """Points each metre up to `reach` ahead along the lane and those that lead to the target;
        None where a lane ends before."""
        goal = self.onward(target) if target in self.lanes else set()
        lane, points = self.lanes[ident], []
        s = lane.project(state.x, state.y).s
        for _ in range(int(reach)):
            s += 1.0
            while s > lane.length:
                s -= lane.length
                onward = [k for k in lane.to if target in self.onward(k) or k in goal] or lane.to
                if not onward:
                    return points if lane.left is None and lane.right is None else None
                lane = self.lanes[onward[0]]
            points.append(lane.at(s))
        return points


State = collections.namedtuple("State", "t x y heading speed acceleration action")


class Run:
    def __init__(self, scene, lines):
        self.road = Road(scene["road"]["lanes"])
        self.signals = scene.get("signals", [])
        self.vehicles = {v["id"]: v for v in scene["vehicles"]}
        self.controlled = [k for k, v in self.vehicles.items() if v["control"] == "controlled"]
        self.duration = scene["simulation"]["duration"]
        self.ticks, self.status = [], collections.defaultdict(list)
        self.plans = []  # (time, {vehicle: its plan})
        for line in lines:
            doc = json.loads(line)
            if "vehicles" in doc:
                self.ticks.append({row[0]: State(doc["t"], *row[1:6], row[7]) for row in doc["vehicles"]})
            elif "plan" in doc:
                self.plans.append((doc["t"], {plan["id"]: plan for plan in doc["plan"]["vehicles"]}))
                for plan in doc["plan"]["vehicles"]:
                    self.status[plan["id"]].append((doc["t"], plan["status"]))
        self.lane = {k: [] for k in self.vehicles}
        self.track = {k: [tick[k] for tick in self.ticks if k in tick] for k in self.vehicles}
        for k, states in self.track.items():
            last = None
            for state in states:
                last = self.road.lane_of(state, last)
                self.lane[k].append(last)

    def body(self, k, state):
        return corners(state.x, state.y, state.heading, self.vehicles[k]["length"], self.vehicles[k]["width"])

    def fallback(self, k, t):
        status = "planned"
        for since, what in self.status[k]:
            if since > t + 1e-6:
                break
            status = what
        return status == "fallback"

    def left(self, k):
        return bool(self.ticks) and k not in self.ticks[-1]

    def last(self, k):
        return self.track[k][-1]


# ---- what holds everywhere ----

def contacts(run):
    found = {}
    for before, after in zip(run.ticks, run.ticks[1:]):
        both = [k for k in before if k in after]
        for i, a in enumerate(both):
            for b in both[:i]:
                pair = (b, a)
                if pair in found or not (a in run.controlled or b in run.controlled):
                    continue
                size = [run.vehicles[k] for k in pair]
                reach = sum(v["length"] + v["width"] for v in size) / 2 + before[a].speed * DT + before[b].speed * DT
                if math.hypot(before[a].x - before[b].x, before[a].y - before[b].y) > reach:
                    continue
                for step in range(SUBSTEPS + 1):
                    poses = [blend(before[k], after[k], step / SUBSTEPS) for k in pair]
                    if separation(*(corners(*pose, v["length"], v["width"]) for pose, v in zip(poses, size))) < -0.01:
                        found[pair] = before[a].t
                        break
    for (b, a), t in sorted(found.items(), key=lambda item: item[1]):
        if not (excused(run, a, b, t) or excused(run, b, a, t)):
            yield f"contact of {b} and {a} at {t:.1f} s"


def excused(run, own, other, t):
    """A human drove into it: it stood; or from behind, and it had neither changed lanes before his
    nose nor braked hard."""
    if own not in run.controlled or other in run.controlled:
        return False
    recent = [(s, lane) for s, lane in zip(run.track[own], run.lane[own]) if t - 5.0 <= s.t <= t + 1e-6]
    if all(s.speed < 0.1 for s, _ in recent if s.t >= t - 1.0):
        return True
    mine, his = recent[-1][0], [s for s in run.track[other] if s.t <= t + 1e-6][-1]
    behind = (his.x - mine.x) * math.cos(mine.heading) + (his.y - mine.y) * math.sin(mine.heading)
    changed = any(b in (run.road.lanes[a].left, run.road.lanes[a].right)
                  for (_, a), (_, b) in zip(recent, recent[1:]))
    return (behind < -run.vehicles[own]["length"] / 2 and his.speed > mine.speed
            and angle_between(his.heading, mine.heading) < 0.8 and not changed
            and min(s.acceleration for s, _ in recent if s.t >= t - 2.0) > -3.0)


def rear_axle(vehicle):
    """How far behind the centre the axle is that rolls along the heading; None: not known."""
    body = vehicle.get("body")
    if isinstance(body, dict) and "rear_axle" in body:
        return body["rear_axle"]
    return REAR_AXLE if vehicle["length"] <= CAR and body in (None, "car") else None


def motion(run):
    low, high = ACCELERATION
    for k in run.controlled:
        worst = {}

        def note(what, size, text):
            if size > worst.get(what, (0.0, ""))[0]:
                worst[what] = size, f"{text} ({k})"

        half = min(run.vehicles[k]["length"] / 2, 2.5)
        rear = rear_axle(run.vehicles[k])
        for a, b in zip(run.track[k], run.track[k][1:]):
            measured = (b.speed - a.speed) / DT
            for value in (b.acceleration, measured):
                over = max(value - high, low - value)
                if over > 0.1:
                    note("acceleration", over, f"acceleration {value:.1f} at {b.t:.1f} s")
            jerk = abs(b.acceleration - a.acceleration) / DT
            fallback = run.fallback(k, a.t) or run.fallback(k, b.t)
            if jerk > JERK and min(a.speed, b.speed) > STANDING and not fallback:
                note("jerk", jerk, f"jerk {jerk:.0f} at {b.t:.1f} s")
            step = math.hypot(b.x - a.x, b.y - a.y)
            if abs(step - (a.speed + b.speed) / 2 * DT) > 0.1:
                note("jump", step, f"jump of {step:.2f} m at {b.t:.1f} s")
            elif min(a.speed, b.speed) > 2.0 and rear is not None:
                dx = b.x - a.x - rear * (math.cos(b.heading) - math.cos(a.heading))
                dy = b.y - a.y - rear * (math.sin(b.heading) - math.sin(a.heading))
                middle = a.heading + math.remainder(b.heading - a.heading, math.tau) / 2
                slip = angle_between(math.atan2(dy, dx), middle)
                if slip > 0.03:
                    note("slip", slip, f"slip {slip:.3f} rad at {b.t:.1f} s")
            for along in (-half, 0.0, half):
                x, y = b.x + along * math.cos(b.heading), b.y + along * math.sin(b.heading)
                if not run.road.inside(x, y, BORDER):
                    note("road", 1.0, f"off the road at {b.t:.1f} s")
        yield from (text for _, text in worst.values())


# ---- what the plans say, and how vehicles cross ----

def reasons(run):
    """Who stands says why."""
    for k in run.controlled:
        i, silent = 0, []
        for state in run.track[k]:
            while i + 1 < len(run.plans) and run.plans[i + 1][0] <= state.t + 1e-6:
                i += 1
            plan = run.plans[i][1].get(k) if run.plans else None
            if state.speed < STANDING and plan is not None and not plan.get("why"):
                silent.append(state.t)
        if silent:
            yield f"stands without a reason at {silent[0]:.1f} s, {len(silent) * DT:.1f} s in all ({k})"


def order(run):
    """The passes of a cycle have no circle: again and again somebody goes who waits for nobody left."""
    for t, plans in run.plans:
        after = {k: {p["after"] for p in plan.get("passes", [])} for k, plan in plans.items()}
        while after:
            free = [k for k, others in after.items() if not others & set(after)]
            if not free:
                yield f"a circle of passes at {t:.1f} s: {sorted(after)}"
                return
            for k in free:
                del after[k]


def shows(program, t):
    """What a signal shows, by its phases."""
    left = (t - program.get("start", 0.0)) % sum(phase["seconds"] for phase in program["phases"])
    for phase in program["phases"]:
        if left < phase["seconds"]:
            return phase["state"]
        left -= phase["seconds"]
    return program["phases"][-1]["state"]


def red_light(run):
    """No planned vehicle's nose passes the end of a lane, but by a metre, while its signal is red."""
    for program in run.signals:
        lane = run.road.lanes[program["lane"]]
        for k in run.controlled:
            nose = run.vehicles[k]["length"] / 2
            for a, b, on in zip(run.track[k], run.track[k][1:], run.lane[k]):
                before, after = (lane.project(s.x, s.y, nose + 2.0).s + nose - LINE for s in (a, b))
                red = all(shows(program, t) == "red" for t in (a.t - 0.2, a.t, b.t))
                if on == lane.id and before <= lane.length < after and red:
                    yield f"drives on at red at {a.t:.1f} s ({k})"


def squares(state, vehicle):
    """The squares under a body."""
    c, s = math.cos(state.heading), math.sin(state.heading)
    along, across = (max(2, math.ceil(vehicle[key] / (0.9 * CELL)) + 1) for key in ("length", "width"))
    found = set()
    for i in range(along):
        a = vehicle["length"] * (i / (along - 1) - 0.5)
        for j in range(across):
            b = vehicle["width"] * (j / (across - 1) - 0.5)
            found.add((math.floor((state.x + a * c - b * s) / CELL), math.floor((state.y + a * s + b * c) / CELL)))
    return found


def encroachment(run):
    """Time between the body of one vehicle and that of another in a square that both cross."""
    headings = [s.heading for track in run.track.values() for s in track[::5]]
    if not headings or all(angle_between(h, headings[0]) < CROSSING[0] for h in headings):
        return
    stays = collections.defaultdict(list)  # square: [first instant, last instant, vehicle, heading]
    for k, track in run.track.items():
        last = {}
        for state in track:
            for square in squares(state, run.vehicles[k]):
                stay = last.get(square)
                if stay is not None and state.t - stay[1] < 1.5 * DT:
                    stay[1] = state.t
                else:
                    last[square] = [state.t, state.t, k, state.heading]
                    stays[square].append(last[square])
    worst = {}
    for row in stays.values():
        row.sort()
        for first, second in zip(row, row[1:]):
            pair, time = (first[2], second[2]), second[0] - first[1]
            planned = sum(k in run.controlled for k in pair)
            if first[2] != second[2] and planned and CROSSING[0] < angle_between(first[3], second[3]) < CROSSING[1] \
                    and time < PASSING[planned == 1] - PASSING_SLACK:
                worst[pair] = min(worst.get(pair, (math.inf, 0.0)), (time, second[0]))
    for (a, b), (time, t) in sorted(worst.items(), key=lambda item: item[1]):
        yield f"{b} crosses {max(time, 0.0):.1f} s behind {a} at {t:.1f} s"


# ---- what a scene expects ----

def longest(flags):
    best = now = 0
    for flag in flags:
        now = now + 1 if flag else 0
        best = max(best, now)
    return best * DT


def controlled_check(check):
    def over_all(run, limit):
        for k in run.controlled:
            if run.track[k]:
                yield from check(run, limit, k)
    return over_all


@controlled_check
def standing_s_max(run, limit, k):
    longest_s = longest(s.speed < STANDING for s in run.track[k])
    if longest_s > limit:
        yield f"stood {longest_s:.0f} s ({k})"


@controlled_check
def stuck_s_max(run, limit, k):
    if longest(s.speed < STANDING for s in run.track[k]) <= limit:
        return
    flags = []
    for state, lane, tick in zip(run.track[k], run.lane[k], (t for t in run.ticks if k in t)):
        flags.append(state.speed < STANDING and not waits(run, k, state, lane, tick))
    longest_s = longest(flags)
    if longest_s > limit:
        yield f"stuck {longest_s:.0f} s with a free way ({k})"


def waits(run, k, state, lane, tick):
    """Has a reason to stand: a signal, somebody in its way or moving nearby, or a lane that ends."""
    if any(program["lane"] == lane and shows(program, state.t) in ("red", "yellow") for program in run.signals):
        return True
    others = [(n, s) for n, s in tick.items() if n != k]
    if any(s.speed > STANDING and math.hypot(s.x - state.x, s.y - state.y) < 40 for _, s in others):
        return True
    nose = run.vehicles[k]["length"] / 2
    way = run.road.way(lane, state, run.vehicles[k].get("target_lane"), nose + FREE_WAY)
    if way is None:
        return True
    half = run.vehicles[k]["width"] / 2 + 0.2
    close = [run.body(n, s) for n, s in others if math.hypot(s.x - state.x, s.y - state.y) < 40]
    return any(separation(corners(x, y, 0.0, 2 * half, 2 * half), body) < 0
               for x, y in way[int(nose):] for body in close)


@controlled_check
def braking_max(run, limit, k):
    hardest = -min(s.acceleration for s in run.track[k])
    if hardest > limit + 0.05:
        yield f"braked {hardest:.1f} ({k})"


@controlled_check
def lane_changes_max(run, limit, k):
    lanes = run.lane[k]
    changes = sum(b in (run.road.lanes[a].left, run.road.lanes[a].right) for a, b in zip(lanes, lanes[1:]) if a != b)
    if changes > limit:
        yield f"{changes} lane changes ({k})"


def follower_braking_max(run, limit):
    for k, v in run.vehicles.items():
        if v["control"] == "human" and "track" not in v and len(run.track[k]) > 1:
            hardest = max((a.speed - b.speed) / DT for a, b in zip(run.track[k], run.track[k][1:]))
            if hardest > limit + 0.05:
                yield f"a human had to brake {hardest:.1f} ({k})"


def first_in(run, k, goal, offset=0.6):
    for state in run.track[k]:
        for ident in goal:
            place = run.road.lanes[ident].project(state.x, state.y)
            if abs(place.d) <= offset and place.beyond < 0.1 and angle_between(place.heading, state.heading) < 0.8:
                return state
    return None


def reached_by(run, limits):
    for k, limit in limits.items():
        state = first_in(run, int(k), run.road.onward(run.vehicles[int(k)]["target_lane"]))
        if state is None:
            yield f"target not reached ({k})"
        elif state.t > limit:
            yield f"target reached late, {state.t:.0f} s ({k})"


def ends_in_lane(run, limits):
    for k, lanes in limits.items():
        if run.lane[int(k)][-1] not in {n for lane in lanes for n in run.road.onward(lane)}:
            yield f"ended in lane {run.lane[int(k)][-1]} ({k})"


def passes(run, limits):
    for k, (x, limit) in limits.items():
        if not any(s.x >= x and s.t <= limit for s in run.track[int(k)]):
            yield f"did not get past ({k})"


def ahead_of(run, limits):
    for k, (other, limit) in limits.items():
        own, room = int(k), (run.vehicles[int(k)]["length"] + run.vehicles[other]["length"]) / 2
        if not any(own in t and other in t and t[own].x - t[other].x > room and t[own].t <= limit for t in run.ticks):
            yield f"did not overtake ({k})"


def travel_min(run, limits):
    for k, limit in limits.items():
        track = run.track[int(k)]
        way = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in zip(track, track[1:]))
        if way < limit and not run.left(int(k)):
            yield f"drove {way:.0f} m, expected {limit:.0f} ({k})"


def speed_ratio(run, limits):
    for k, want in limits.items():
        limit = run.road.lanes[run.lane[int(k)][0]].limit
        track = run.track[int(k)]
        top = max(s.speed for s in track) / limit
        if top > want["max"]:
            yield f"drove {100 * top:.0f} % of the limit ({k})"
        there = next((s.t for s in track if s.speed >= want["min"] * limit), None)
        if there is None or there > want["by"]:
            yield f"reached {100 * max(s.speed for s in track if s.t <= want['by']) / limit:.0f} % of the limit ({k})"
        elif min(s.speed for s in track if s.t >= there) < want["hold"] * limit:
            yield f"fell below {100 * want['hold']:.0f} % of the limit again ({k})"


def time_gap(run, limits):
    for k, (low, high) in limits.items():
        own, gaps = int(k), []
        for tick in run.ticks:
            if own not in tick or tick[own].speed <= 8.0 or tick[own].t < 10.0 or abs(tick[own].acceleration) > 0.5:
                continue
            me = tick[own]
            c, s = math.cos(me.heading), math.sin(me.heading)
            ahead = []
            for n, o in tick.items():
                bodies = (run.vehicles[n]["length"] + run.vehicles[own]["length"]) / 2
                gap = (o.x - me.x) * c + (o.y - me.y) * s - bodies
                if n != own and gap > 0 and abs((o.y - me.y) * c - (o.x - me.x) * s) < 1.5:
                    ahead.append((gap, o))
            if ahead:
                gap, leader = min(ahead)
                if abs(leader.speed - me.speed) < 0.7:
                    gaps.append(gap / me.speed)
        if len(gaps) >= 20:
            middle = sorted(gaps)[len(gaps) // 2]
            if not low <= middle <= high:
                yield f"time gap {middle:.1f} s ({k})"


def say_mismatch_max(run, limit):
    """AC while braking, DC while speeding up (by over 0.3 m/s^2), KS while doing either by over 1."""
    seen = wrong = 0
    for k in run.controlled:
        track = run.track[k]
        for i in range(1, len(track) - 2):
            if track[i].speed < 0.5 or track[i].action not in ("AC", "DC", "KS"):
                continue
            measured = (track[i + 2].speed - track[i - 1].speed) / (3 * DT)
            seen += 1
            wrong += {"AC": measured < -0.3, "DC": measured > 0.3, "KS": abs(measured) > 1.0}[track[i].action]
    if seen and wrong / seen > limit:
        yield f"said otherwise than it drove {100 * wrong / seen:.0f} % of the time"


def merge_speed_diff_max(run, limit):
    for k in run.controlled:
        target = run.vehicles[k].get("target_lane")
        entered = next((s for s, lane in zip(run.track[k], run.lane[k]) if lane == target), None)
        if entered is None:
            continue
        tick = next(t for t in run.ticks if k in t and t[k].t == entered.t)
        for n, other in tick.items():
            lane = run.road.lanes[target]
            if n != k and abs(lane.project(other.x, other.y).d) < lane.width / 2 \
                    and math.hypot(other.x - entered.x, other.y - entered.y) < 60 \
                    and abs(other.speed - entered.speed) > limit:
                yield f"merged at {entered.speed:.0f} m/s beside {other.speed:.0f} ({k})"
                break


def keep_clear(run, want):
    area = [tuple(p) for p in want["area"]]
    for k in run.controlled:
        stood = longest(s.speed < STANDING and separation(run.body(k, s), area) < -0.1 for s in run.track[k])
        if stood > want["standing_s_max"]:
            yield f"stood {stood:.0f} s where the crossing is to be kept clear ({k})"


CHECKS = {f.__name__: f for f in (ahead_of, ends_in_lane, follower_braking_max, keep_clear,
                                  merge_speed_diff_max, passes, reached_by, say_mismatch_max, speed_ratio,
                                  time_gap, travel_min)}
CHECKS |= {"standing_s_max": standing_s_max, "stuck_s_max": stuck_s_max, "braking_max": braking_max,
           "lane_changes_max": lane_changes_max}
ALWAYS = (contacts, motion, reasons, order, red_light, encroachment)
ABOUT = ("format", "scene", "family", "contacts", "refusal_ok")


def judge(scene, expect, lines=None, refusal=None):
    """The list of failures: (expectation, text)."""
    if refusal is not None:
        clear = len(refusal.strip().splitlines()) == 1 and ":road" in refusal  # a line that names the road
        return [] if expect.get("refusal_ok") and clear else [("refused", refusal.strip().split(".json:")[-1][:120])]
    run = Run(scene, lines)
    if not run.ticks:
        return [("run", "empty run")]
    failures = [(check.__name__, text) for check in ALWAYS for text in check(run)]
    for name, limit in expect.items():
        if name in CHECKS:
            failures += [(name, text) for text in CHECKS[name](run, limit)]
        elif name not in ABOUT:
            failures.append(("expectation", f"unknown: {name}"))
    return failures


def judge_file(path):
    path = pathlib.Path(path)
    expect = json.loads(path.with_suffix(".expect.json").read_text())
    run, refusal = path.with_suffix(".jsonl"), path.with_suffix(".err")
    if refusal.exists():
        failures = judge(None, expect, refusal=refusal.read_text())
    elif run.exists():
        with run.open() as lines:
            failures = judge(json.loads(path.read_text()), expect, lines)
    else:
        failures = [("run", "no run")]
    return {"scene": path.stem, "family": expect["family"], "failures": failures}


def line(result):
    texts = [text for _, text in result["failures"]]
    return f"{'FAIL' if texts else 'pass'} {result['scene']}" + (": " + "; ".join(texts[:4]) if texts else "")


def table(results):
    families = collections.defaultdict(list)
    for result in results:
        families[result["family"]].append(result)
    rows = [f"{'family':20} {'scenes':>6} {'passed':>6} {'share':>6}  most common failure"]
    for family, group in [*families.items(), ("all", results)]:
        passed = sum(not r["failures"] for r in group)
        names = (name for r in group for name in sorted({n for n, _ in r["failures"]}))
        common = collections.Counter(names).most_common(3)
        rows.append(f"{family:20} {len(group):6} {passed:6} {100 * passed / max(1, len(group)):5.0f}%  "
                    + ", ".join(f"{name} {count}" for name, count in common))
    return "\n".join(rows)


# ---- self-test ----

def self_test():
    lanes = [{"id": i, "centerline": [[0, 3.5 * i], [600, 3.5 * i]], "width": 3.5, "speed_limit": 15.0,
              "left": 1 - i if i == 0 else None, "right": 0 if i else None, "successors": []} for i in (0, 1)]
    body = {"length": 4.8, "width": 1.9}
    scene = {"road": {"lanes": lanes}, "simulation": {"duration": 30.0},
             "vehicles": [{"id": 1, "control": "controlled", "target_lane": 0, **body},
                          {"id": 2, "control": "human", "length": 2.0, "width": 0.6}]}
    expect = {"family": "self-test", "contacts": 0, "stuck_s_max": 8.0, "standing_s_max": 10.0, "braking_max": 3.0,
              "lane_changes_max": 0, "travel_min": {"1": 200.0}, "say_mismatch_max": 0.05, "reached_by": {"1": 1.0}}

    def ticks(change=None, plans=()):
        lines = list(map(json.dumps, plans))
        for i in range(300):
            rows = [[1, 20.0 + i, 0.0, 0.0, 10.0, 0.0, 0, "KS", False, "none"],
                    [2, 500.0, -40.0, math.pi / 2, 0.0, 0.0, 0, None, False, "none"]]
            if change:
                change(i, rows)
            lines.append(json.dumps({"t": round(i * DT, 1), "vehicles": rows}))
        return lines

    def between_ticks(i, v):  # a fast narrow one crosses just behind the nose, between two ticks
        if i >= 100:
            v[1][1:5] = [122.2, -3.5 + 7.0 * (i - 100), math.pi / 2, 70.0]

    def cut(at, **columns):
        index = {"x": 1, "y": 2, "heading": 3, "speed": 4, "acceleration": 5, "action": 7}
        def change(i, v):
            if i in at:
                for name, value in columns.items():
                    v[0][index[name]] = value(i) if callable(value) else value
        return change

    def stand(i, v):
        if i >= 150:
            v[0][1], v[0][4] = 170.0, 0.0

    planted = {
        "contacts": between_ticks,
        "jump": cut(range(150, 300), x=lambda i: 22.0 + i),
        "acceleration": cut([150], acceleration=-9.0),
        "jerk": cut([150], acceleration=2.0),
        "slip": cut(range(100, 120), heading=0.06),
        "off the road": cut(range(100, 300), y=-2.3),
        "stuck": stand,
        "said": cut(range(300), action="AC", speed=lambda i: 10.0 - 0.04 * i, x=lambda i: 20 + i - 0.0002 * i * i),
        "lane changes": cut(range(100, 300), y=3.5),
        "not reached": cut(range(300), y=1.0),
    }
    clean = judge(scene, expect, ticks())
    wrong = [f"clean run: {clean}"] if clean else []
    for name, change in planted.items():
        texts = " ".join(f"{a} {b}" for a, b in judge(scene, expect, ticks(change)))
        print(f"{'caught' if name in texts else 'MISSED'} {name}: {texts[:90]}")
        wrong += [] if name in texts else [name]
    def plan(ident, why, *after):
        return {"id": ident, "status": "planned", "why": why, "passes": [{"area": [0, 1], "after": k} for k in after]}

    both = {**scene, "vehicles": [scene["vehicles"][0], {"id": 2, "control": "controlled", "length": 2.0, "width": 0.6}]}
    lone = {"family": "self-test", "contacts": 0}
    for name, want, run_of, lines in (
            ("reasons", True, scene, ticks(stand, [{"t": 0.0, "plan": {"vehicles": [plan(1, None)]}}])),
            ("reasons", False, scene, ticks(stand, [{"t": 0.0, "plan": {"vehicles": [plan(1, {"code": "x"})]}}])),
            ("order", True, both, ticks(None, [{"t": 0.0, "plan": {"vehicles": [plan(1, None, 2), plan(2, None, 1)]}}])),
            ("order", False, both, ticks(None, [{"t": 0.0, "plan": {"vehicles": [plan(1, None, 2, 7), plan(2, None)]}}]))):
        found = any(a == name for a, _ in judge(run_of, lone, lines))
        print(f"{'as planted' if found == want else 'WRONG'} {name} {want}")
        wrong += [] if found == want else [f"{name} {want}"]

    for state in ("red", "green"):
        lit = {**scene, "signals": [{"lane": 0, "phases": [{"state": state, "seconds": 9.0}]}]}
        lit["road"] = {"lanes": [{**lanes[0], "centerline": [[0, 0], [150, 0]]}, lanes[1]]}
        found = any(a == "red_light" for a, _ in judge(lit, lone, ticks()))
        print(f"{'as planted' if found == (state == 'red') else 'WRONG'} red_light {state}")
        wrong += [] if found == (state == "red") else [f"red_light {state}"]
        lit = {**scene, "signals": lit["signals"]}
        found = any(a == "stuck_s_max" for a, _ in judge(lit, {**lone, "stuck_s_max": 8.0}, ticks(stand)))
        print(f"{'as planted' if found == (state == 'green') else 'WRONG'} stuck at {state}")
        wrong += [] if found == (state == "green") else [f"stuck at {state}"]

    def crossing_behind(gap):
        rows = []
        for i in range(300):
            y = 100.0 - i + 10.0 * gap
            rows.append(json.dumps({"t": round(i * DT, 1), "vehicles": [
                [1, 20.0 + i, 0.0, 0.0, 10.0, 0.0, 0, "KS", False, "none"],
                [2, 117.6, y, -math.pi / 2, 10.0, 0.0, 0, "KS", False, "none"]]}))
        return rows

    for gap, want in ((0.1, True), (1.6, False)):
        found = any(a == "encroachment" for a, _ in judge(both, lone, crossing_behind(gap)))
        print(f"{'as planted' if found == want else 'WRONG'} encroachment {want}")
        wrong += [] if found == want else [f"encroachment {want}"]
    with tempfile.TemporaryDirectory() as folder:  # files, as given
        path = pathlib.Path(folder, "a.json")
        path.write_text(json.dumps(scene))
        path.with_suffix(".expect.json").write_text(json.dumps(expect))
        wrong += [] if judge_file(path)["failures"] else ["a missing run"]
        path.with_suffix(".err").write_text("a.json:road: is wrong, expected better")
        wrong += [] if judge_file(path)["failures"] else ["a refusal"]
    print("self-test", "failed: " + ", ".join(wrong) if wrong else "passed")
    return 1 if wrong else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="*", type=pathlib.Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    options = parser.parse_args()
    if options.self_test:
        return self_test()
    scenes = [p for path in options.paths for p in (sorted(path.glob("*.json")) if path.is_dir() else [path])
              if not p.name.endswith(".expect.json")]
    if not scenes:
        parser.error("no scenes")
    results = [judge_file(path) for path in scenes]
    if options.json:
        print(json.dumps(results, indent=1))
    else:
        print("\n".join(map(line, results)), table(results), sep="\n\n")
    return 1 if any(r["failures"] for r in results) else 0


if __name__ == "__main__":
    sys.exit(main())
