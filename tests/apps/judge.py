"""An independent judge of plan documents and runs: reads the emitted numbers only.

Bodies are rectangles tested on separating axes. Motion is judged as that of a kinematic
single-track vehicle about its rear axle. Between two points the speed is the cubic Hermite curve of
the points' speeds and accelerations, and the heading that of the headings and yaw rates. Every
10 ms they give steering angle and accelerations, and their integral must lead to the next point.
The numbers of the bodies are those of core/src/body.c or those that a body states itself.
"""
import json
import os
import subprocess

import numpy as np

# length, width, rear_axle, wheelbase [m], steer_max [rad], steer_rate_max [rad/s],
# acceleration_max [m/s^2], speed_switch [m/s], braking_max, lateral_max [m/s^2], speed_max [m/s]
NUMBERS = ("length", "width", "rear_axle", "wheelbase", "steer_max", "steer_rate_max",
           "acceleration_max", "speed_switch", "braking_max", "lateral_max", "speed_max")
KINDS = {
    "car": (5, 2, 1.4227, 2.5789, np.arctan(0.702 * 2.5789), 0.4, 11.5, 7.319, 11.5, 11.5, 50.8),
    "van": (6.89, 2.17, 1.465, 3.95, 0.73, 0.4, 3.5, 8, 8, 6, 44),
    "bus": (12, 2.55, 2.65, 5.8, 0.89, 0.4, 1.5, 8, 7, 4.5, 27.8),
    "truck": (10.1, 2.55, 1.73, 5.3, 0.71, 0.4, 1.5, 8, 7, 4, 25),
    "articulated": (6.08, 2.55, 2.19, 3.8, 0.68, 0.4, 1, 8, 6.5, 3.5, 25),
    "motorcycle": (2.2, 0.8, 0.78, 1.45, 0.6, 0.8, 6, 15, 8, 8, 50),
    "bicycle": (1.8, 0.65, 0.55, 1.07, 0.8, 1, 1, 4, 4.5, 4, 12),
}
SPEED_SLOW = 2.0                                 # [m/s] below it a point 0 knows no curvature
SLACK = 1.02                                     # of limits: cubic curves are not the planner's
SUBSTEPS = 10


def wrap(angle):
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


# ---- bodies ---------------------------------------------------------------------------------

def separation(a, b, size_a, size_b):
    """Largest gap [m] over the four axes of rectangles (n x (x, y, heading)); negative: overlap.

    Also the index of that axis: 0, 1 along and across a; 2, 3 along and across b.
    """
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    gap = []
    for of in (a, b):
        for turn in (0.0, np.pi / 2):
            axis = np.stack([np.cos(of[:, 2] + turn), np.sin(of[:, 2] + turn)], axis=1)
            reach = sum(0.5 * (size[0] * np.abs(axis[:, 0] * np.cos(body[:, 2])
                                                + axis[:, 1] * np.sin(body[:, 2]))
                               + size[1] * np.abs(axis[:, 1] * np.cos(body[:, 2])
                                                  - axis[:, 0] * np.sin(body[:, 2])))
                        for body, size in ((a, size_a), (b, size_b)))
            gap.append(np.abs(np.sum((b[:, :2] - a[:, :2]) * axis, axis=1)) - reach)
    gap = np.array(gap)
    return gap.max(axis=0), gap.argmax(axis=0)


def first_overlap(a, b, size_a, size_b, slack=1e-9):
    """Index of the first sample at which two bodies overlap, or None."""
    count = min(len(a), len(b))
    hit = np.flatnonzero(separation(a[:count], b[:count], size_a, size_b)[0] < -slack)
    return int(hit[0]) if len(hit) else None


def between(poses, substeps=SUBSTEPS):
    """Poses with `substeps` steps from each to the next, straight in x, y, heading."""
    share = np.linspace(0.0, 1.0, substeps, endpoint=False)[None, :, None]
    step = np.diff(poses, axis=0)
    step[:, 2] = wrap(step[:, 2])
    filled = poses[:-1, None, :] + share * step[:, None, :]
    return np.concatenate([filled.reshape(-1, poses.shape[1]), poses[-1:]])


def overlap_faults(plan, sizes):
    """Bodies of one document that overlap although none of them has a fallback."""
    bodies = {v["id"]: np.array(v["trajectory"]["points"])[:, 1:4] for v in plan["vehicles"]}
    planned = [v["id"] for v in plan["vehicles"] if v["status"] == "planned"]
    fallback = set(bodies) - set(planned)
    bodies.update((p["id"], np.array(p["points"])[:, 1:4]) for p in plan["predictions"])
    for i, one in enumerate(planned):
        for other in bodies:
            if other in fallback or other == one or other in planned[:i]:
                continue
            k = first_overlap(bodies[one], bodies[other], sizes[one], sizes[other])
            if k is not None:
                yield f"{one} and {other} overlap at point {k}"


# ---- motion ---------------------------------------------------------------------------------

def kind_by_size(length, width):
    if length < 3.5 and width <= 1.2:
        return "bicycle" if length <= 2 else "motorcycle"
    return next((kind for most, kind in ((5.5, "car"), (7.5, "van"), (12, "truck"))
                 if length <= most), "bus")


def body_of(vehicle):
    """The numbers of a scenario's vehicle: its own, else its kind's at its length."""
    given = vehicle.get("body", {})
    given = {"kind": given} if isinstance(given, str) else given
    length = vehicle.get("length", given.get("length"))
    width = vehicle.get("width", given.get("width"))
    kind = given.get("kind") or kind_by_size(length, width)
    body = dict(zip(NUMBERS, KINDS[kind]))
    typical = body["length"] if kind != "car" else np.clip(length or 5, 3.5, 5.5)
    share = (length or typical) / typical
    body.update(length=length or body["length"], width=width or body["width"], rear_axle=body["rear_axle"] * share,
                wheelbase=body["wheelbase"] * share)
    body.update((name, given[name]) for name in NUMBERS if name in given)
    return body


def hermite(p0, m0, p1, m1, h, u):
    """Cubic Hermite curve over a step h at shares u: values and derivatives by time."""
    c2, c3 = 3 * (p1 - p0) - h * (2 * m0 + m1), -2 * (p1 - p0) + h * (m0 + m1)
    return (p0 + u * (h * m0 + u * (c2 + u * c3)),
            (h * m0 + u * (2 * c2 + 3 * u * c3)) / h)


def rear_axle(points, h, behind):
    """x, y, heading, speed, acceleration, yaw rate of the rear axle, a row a step and end."""
    ends = []
    rate = np.diff(points[:, 6]) / h
    for end in (points[:-1], points[1:]):
        heading, at_centre = end[:, 3], end[:, 6]
        cosine = np.sqrt(1 - (behind * at_centre) ** 2)  # of the slip angle at the centre
        curvature, speed = at_centre / cosine, end[:, 4] * cosine
        # d/dt of speed / cosine: the centre also speeds up by swinging about the rear axle.
        swing = speed * curvature * (rate / cosine ** 3) * behind ** 2 * cosine
        ends.append((end[:, 1] - behind * np.cos(heading),
                     end[:, 2] - behind * np.sin(heading), heading, speed,
                     (end[:, 5] - swing) * cosine, speed * curvature))
    return ends


def motion_faults(trajectory, body):
    """What a body could not do along a trajectory; nothing where it can be driven."""
    points = np.array(trajectory["points"])
    h, t = trajectory["dt"], points[:-1, 0]

    def fault(bad, value, text):
        if bad.any():
            k = np.unravel_index(np.argmax(bad), bad.shape)
            yield f"{text}: {np.broadcast_to(value, bad.shape)[k]:.5f} at t = {t[k[0]]:.2f}"

    (x0, y0, th0, v0, a0, w0), (x1, y1, th1, v1, a1, w1) = rear_axle(points, h, body["rear_axle"])
    yield from fault(points[:, 4] < 0, points[:, 4], "speed below 0")
    yield from fault(points[:, 4] > body["speed_max"], points[:, 4], "speed above the body's")
    u = np.linspace(0, 1, SUBSTEPS + 1)[None, :]

    def column(values):
        return values[:, None]
    turn = wrap(th1 - th0)
    v, a = hermite(column(v0), column(a0), column(v1), column(a1), h, u)
    th, w = hermite(column(th0), column(w0), column(th0 + turn), column(w1), h, u)
    # Stops end within a step, with a jolt that no smooth curve draws: not judged below 0.5 m/s.
    moving = (v0 > 0.5) & (v1 > 0.5)
    ends = np.abs(v1 - v0 - 0.5 * h * (a0 + a1))
    yield from fault(moving & (ends > 3.1 * h * h), ends, "speed does not follow acceleration")
    ends = np.abs(turn - 0.5 * h * (w0 + w1))
    yield from fault(ends > 1.5e-3, ends, "heading does not follow yaw rate")
    simpson = np.array([1, 4] + [2, 4] * (SUBSTEPS // 2 - 1) + [1]) * (h / SUBSTEPS / 3)
    off = np.hypot(x1 - x0 - (v * np.cos(th)) @ simpson, y1 - y0 - (v * np.sin(th)) @ simpson)
    yield from fault(off > np.where(moving, 2e-3, 2e-2), off, "does not arrive at its next point")

    moving = np.broadcast_to(moving[:, None], v.shape)
    pull = np.hypot(a / body["braking_max"], v * w / body["lateral_max"])
    yield from fault(pull > SLACK, pull, "outside the ellipse of braking and lateral acceleration")
    engine = body["acceleration_max"] * np.minimum(1, body["speed_switch"] / np.maximum(v, 0.1))
    yield from fault(a > SLACK * engine, a, "accelerates harder than the engine can")
    curvature_max = np.tan(body["steer_max"]) / body["wheelbase"]
    curvature = np.where(moving, w / np.maximum(v, 0.1), 0)
    yield from fault(np.abs(curvature) > SLACK * curvature_max, curvature, "bend too tight")
    steer_rate = np.diff(np.arctan(body["wheelbase"] * curvature), axis=1) / (h / SUBSTEPS)
    allowed = 1.03 * body["steer_rate_max"] + 0.02 / np.maximum(v[:, 1:], 0.1)
    yield from fault(moving[:, 1:] & (np.abs(steer_rate) > allowed), steer_rate, "steers too fast")


# ---- programs, their documents -----------------------------------------------------------------

def run(binaries, name, *arguments):
    """What a program prints, parsed; an AssertionError with its words where it fails."""
    command = [os.path.join(binaries, name), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{command}: exit {done.returncode}: {done.stderr}"
    return json.loads(done.stdout)


def read_lines(path):
    with open(path, encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def scale():
    """How many times the usual seeds to take: a third of VERGE_TEST_SCALE, because a seed here is a
    whole closed-loop run, and at least 1. tools/check --long: 3."""
    return max(1, round(float(os.environ.get("VERGE_TEST_SCALE", "1")) / 3))


# ---- plans and runs ---------------------------------------------------------------------------

def sizes_of(scenario):
    bodies = {v["id"]: body_of(v) for v in scenario["vehicles"]}
    return {number: (body["length"], body["width"]) for number, body in bodies.items()}


def plan_faults(plan, scenario, motion=True):
    yield from overlap_faults(plan, sizes_of(scenario))
    bodies = {v["id"]: body_of(v) for v in scenario["vehicles"]}
    for vehicle in plan["vehicles"] if motion else []:
        for fault in motion_faults(vehicle["trajectory"], bodies[vehicle["id"]]):
            yield f"vehicle {vehicle['id']} ({vehicle['status']}) {fault}"


def joint_faults(vehicle, before, time_before, row, time):
    """A plan begins where its vehicle is: with the state of the tick and the bend it drove in."""
    first = vehicle["trajectory"]["points"][0]
    if first[1:6] != row[1:6]:
        yield f"begins at {first[1:6]}, its vehicle is at {row[1:6]}"
    if before is not None and row[4] > SPEED_SLOW:
        index = round((time - time_before) / before["trajectory"]["dt"])
        bend = before["trajectory"]["points"][index][6]
        if abs(bend - first[6]) > 1e-6:
            yield f"begins with curvature {first[6]}, its vehicle drives {bend}"


def run_faults(lines, scenario, motion=True):
    """Every plan of a run, and that each begins where the last one has led its vehicle."""
    rows, plans, last_time = {}, {}, 0.0
    for line in lines:
        if "vehicles" in line:
            rows[round(line["t"], 6)] = {row[0]: row for row in line["vehicles"]}
    for line in lines:
        if "plan" not in line:
            continue
        time = line["t"]
        here = rows[round(time, 6)]
        for fault in plan_faults(line["plan"], scenario, motion):
            yield f"plan at {time}: {fault}"
        for vehicle in line["plan"]["vehicles"]:
            number = vehicle["id"]
            for fault in joint_faults(vehicle, plans.get(number), last_time, here[number], time):
                yield f"plan at {time}: vehicle {number} {fault}"
        plans, last_time = {v["id"]: v for v in line["plan"]["vehicles"]}, time


def poses_of(lines):
    """Vehicle id -> (index of its first tick, n x (x, y, heading, speed)) of a run."""
    poses = {}
    ticks = [line for line in lines if "vehicles" in line]
    for k, line in enumerate(ticks):
        for row in line["vehicles"]:
            poses.setdefault(row[0], (k, []))[1].append(row[1:5])
    return {number: (first, np.array(rows)) for number, (first, rows) in poses.items()}


def contacts(lines, scenario):
    """(tick, controlled id, other id, whose fault) of the first contact of every pair.

    Whose: of two controlled vehicles "both"; else of the one that closed the gap. Along the
    lane that is the one behind; across it, the one that moved towards the other faster.
    """
    sizes = sizes_of(scenario)
    controlled = {v["id"] for v in scenario["vehicles"] if v["control"] == "controlled"}
    poses = poses_of(lines)
    for one in sorted(controlled & set(poses)):
        for other in sorted(poses):
            if other == one or (other in controlled and other < one):
                continue
            begin = max(poses[one][0], poses[other][0])
            a, b = (poses[n][1][begin - poses[n][0]:] for n in (one, other))
            count = min(len(a), len(b))
            if count < 2:
                continue
            a, b = between(a[:count]), between(b[:count])
            k = first_overlap(a, b, sizes[one], sizes[other])
            if k is None:
                continue
            whose = "both" if other in controlled else fault_of(one, other, a[k], b[k], sizes)
            yield begin + k / SUBSTEPS, one, other, whose


def fault_of(one, other, a, b, sizes):
    _, axis = separation(a, b, sizes[one], sizes[other])
    direction = (a, b)[axis[0] // 2][2]
    along = np.array([np.cos(direction), np.sin(direction)])
    way = b[:2] - a[:2]
    if axis[0] % 2 == 0:
        return one if way @ along > 0 else other
    across = np.array([-along[1], along[0]])
    across *= np.sign(way @ across)
    speed_a, speed_b = (p[3] * np.array([np.cos(p[2]), np.sin(p[2])]) @ across for p in (a, b))
    return one if speed_a > -speed_b else other
