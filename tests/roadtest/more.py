#!/usr/bin/env python3
"""More families of road-test scenes, with the tools of generate.py: vehicles that pull out, cyclists,
a bus at its stop, tight weaving, signals, priority to the right, a stop sign, a full roundabout, a
convoy of trucks. usage: more.py OUT [--family F] [--seeds 1-4]"""
import argparse
import math
import sys

from generate import (LENGTH, WIDTH, Junction, Scene, bezier, build, by, compass, habit, roundabout_scene,
                      seeds, straights, write)

RED, YELLOW, GREEN = "red", "yellow", "green"


class RuledScene(Scene):
    """A scene whose lanes have priorities, and which has signals."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.signals = []

    def rule(self, ident, priority):
        next(lane for lane in self.lanes if lane["id"] == ident)["priority"] = priority

    def signal(self, lane, start, *phases):
        self.signals.append({"lane": lane, "start": round(start, 1),
                             "phases": [{"state": state, "seconds": round(s, 1)} for state, s in phases]})

    def document(self):
        document = super().document()
        if self.signals:
            document["signals"] = self.signals
        return document


# ---- beside the road ----

def pull_out(seed, draw):
    """A parked car sets off into the lane, slowly and just in time for somebody to brake."""
    limit = draw.span(8.3, 13.9)
    scene, x, begin = Scene("pull-out", seed, 30.0), draw.span(70, 100), draw.span(1.5, 4)
    scene.lane(0, [(0, 0), (400, 0)], limit, 5.0)
    scene.car(10, 0.4, 0.0, limit * draw.span(0.6, 0.9))
    way, top, rows = 14.0, limit * draw.span(0.5, 0.8), [[0, x, -1.5, 0.0, 0.0]]
    s = v = 0.0
    for i in range(61):
        share = min(1.0, s / way)
        slope = 0.0 if share in (0.0, 1.0) else 1.6 * 6 * share * (1 - share) / way
        rows.append([begin + 0.5 * i, x + s, -1.5 + 1.6 * share * share * (3 - 2 * share), math.atan(slope), v])
        after = min(top, v + 0.6)
        s, v = s + 0.5 * (v + after) / 2, after
    scene.tracked(rows)
    return scene.want(travel_min={"1": 90.0}, braking_max=5.0, standing_s_max=6.0)


def cyclist(seed, draw):
    """A cyclist at 5 m/s at the right edge; room to pass in the lane, or in the other one."""
    wide = seed % 2 == 0
    scene, limit = Scene("cyclist", seed, 45.0), draw.span(11, 14)
    if wide:
        scene.lane(0, [(0, 0), (600, 0)], limit, 5.4)
    else:
        straights(scene, 2, 600, limit)
    edge = -(5.4 if wide else WIDTH) / 2 + 0.6
    scene.car(10, 0.2 if wide else 0.0, 0.0, limit * draw.span(0.6, 0.9))
    rider = scene.steady(draw.span(50, 90), edge, draw.span(4.5, 5.5), length=1.8, width=0.6)
    return scene.want(ahead_of={"1": [rider, 35.0]}, braking_max=4.0, standing_s_max=1.0)


def bus_stop(seed, draw):
    """A bus stops in the right lane and goes on; the left lane has traffic with gaps."""
    scene, limit, hold = Scene("bus-stop", seed, 50.0), draw.span(11, 14), draw.span(8, 25)
    straights(scene, 2, 700, limit)
    x, v = draw.span(60, 90), draw.span(7, 9)
    brake, rows = v / 1.2, [[0, x, 0, 0, v]]
    for i in range(1, 11):
        t = brake * i / 10
        rows.append([t, x + v * t - 0.6 * t * t, 0, 0, v - 1.2 * t])
    stop = rows[-1]
    rows.append([stop[0] + hold, stop[1], 0, 0, 0])
    rows += [[rows[-1][0] + t, stop[1] + 0.5 * t * t, 0, 0, t] for t in (1, 2, 3, 4, 5, 6, 7, 8)]
    rows.append([rows[-1][0] + 30, rows[-1][1] + 240, 0, 0, 8])
    scene.car(15, 0, 0.0, v)
    scene.tracked(rows, length=12.0, width=2.5)
    for k in range(draw.randint(0, 3)):
        scene.human(-10 - 45 * k + draw.span(-5, 5), WIDTH, 0.0, limit * 0.9)
    for vehicle in scene.vehicles:
        vehicle["x"] = max(vehicle["x"], 5.0) if "track" not in vehicle else vehicle["x"]
    humans = [v for v in scene.vehicles if v["y"] > 1]
    for k, vehicle in enumerate(humans):
        vehicle["x"] = round(5.0 + 60.0 * k, 1)
    return scene.want(travel_min={"1": 180.0}, braking_max=4.0, follower_braking_max=3.5, standing_s_max=hold + 6)


def tight_weave(seed, draw):
    """Two pairs that have to cross each other's lane within 120 m."""
    scene, speed = Scene("tight-weave", seed, 40.0), draw.span(6, 9)
    out = draw.span(110, 140)
    scene.lane(0, [(0, 0), (out, 0)], 13.9, left=1, to=[2])
    scene.lane(1, [(0, WIDTH), (out, WIDTH)], 13.9, right=0, to=[3])
    scene.lane(2, bezier((out, 0), 0.0, (out + 200, -30), -0.15, step=8.0), 13.9)
    scene.lane(3, bezier((out, WIDTH), 0.0, (out + 200, WIDTH + 30), 0.15, step=8.0), 13.9)
    for k in range(2):
        scene.car(12 + 26 * k, WIDTH, 0.0, speed, target_lane=2)
        scene.car(12 + 26 * k + draw.span(5, 16), 0, 0.0, speed, target_lane=3)
    return scene.want(reached_by=by(scene, 36.0), lane_changes_max=1, standing_s_max=12.0, braking_max=5.0)


def truck_convoy(seed, draw):
    """Three trucks with one distance, up to a slower one and on behind it."""
    limit = draw.span(20, 25)
    scene, speed = Scene("truck-convoy", seed, 60.0), limit * draw.span(0.85, 0.95)
    straights(scene, 1, 1700, limit)
    for k in range(3):
        scene.car(20 + 45 * k, 0, 0.0, speed, length=12.0, width=2.5)
    scene.steady(20 + 90 + speed * draw.span(4, 6), 0, limit * draw.span(0.6, 0.7), length=12.0, width=2.5)
    return scene.want(time_gap={"3": [1.0, 2.7]}, braking_max=3.5, standing_s_max=0.5, say_mismatch_max=0.05)


# ---- rules ----

def ruled_junction(family, seed, draw, duration):
    scene = RuledScene(family, seed, duration)
    return scene, Junction(scene, compass(draw, 4, 0.1), draw.span(9, 13))


def box_of(junction):
    half = junction.box - 3.0
    return [[-half, -half], [half, -half], [half, half], [-half, half]]


def signals(seed, draw):
    """A crossing with signals in two phases; nobody enters at red, everybody gets through."""
    scene, junction = ruled_junction("signals", seed, draw, 90.0)
    green, start = draw.span(10, 16), draw.span(-10, 10)
    cycle = 2 * (green + 3 + 2)
    for k in range(4):
        scene.signal(1 + k, start + (k % 2) * cycle / 2, (GREEN, green), (YELLOW, 3), (RED, cycle - green - 3))
    for k in range(draw.randint(4, 8)):
        arm, place = k % 4, k // 4
        junction.place(arm, draw.span(18, 26) + 22 * place, draw.span(6, 9), (arm + draw.choice([1, 2, 3])) % 4,
                       habit=habit(draw))
    return scene.want(reached_by=by(scene, 86.0), braking_max=5.0, standing_s_max=cycle + 10,
                      keep_clear={"area": box_of(junction), "standing_s_max": 12.0})


def right_first(seed, draw):
    """Four arms, priority to the right; also all four at once."""
    scene, junction = ruled_junction("right-first", seed, draw, 60.0)
    for k in range(4):
        scene.rule(1 + k, "right-before-left")
    near = draw.span(14, 20)
    for k in range(4 if seed % 2 else 3):
        junction.place(k, near + draw.span(-2, 2), draw.span(6, 8), (k + 2) % 4, habit=habit(draw))
    return scene.want(reached_by=by(scene, 50.0), braking_max=5.0, standing_s_max=25.0,
                      keep_clear={"area": box_of(junction), "standing_s_max": 4.0})


def stop_sign(seed, draw):
    """A minor road with a stop line crosses a major one with humans on it."""
    scene, junction = ruled_junction("stop-sign", seed, draw, 70.0)
    for k in range(4):
        scene.rule(1 + k, "major" if k % 2 == 0 else "stop")
    junction.place(1, draw.span(20, 40), draw.span(6, 9), draw.choice([0, 3]))
    junction.place(3, draw.span(20, 40), draw.span(6, 9), 1)
    for k in range(3):
        junction.place(0, 12 + 22 * k + draw.span(-2, 2), 9.0, 2, control="human")
    return scene.want(reached_by=by(scene, 60.0), braking_max=5.0, standing_s_max=40.0)


def stream(junction, draw, arm, exit_arm, speed, count):
    """Humans one behind the other, with gaps of 2.5 to 8 s."""
    at = draw.span(5, 30)
    for _ in range(count):
        junction.place(arm, at, speed, exit_arm, control="human")
        at += LENGTH + speed * draw.span(2.5, 8.0)
        if at > 380:
            return


def left_across(seed, draw):
    """A left turn across a stream of humans, who have priority and need not brake for it."""
    scene, limit = RuledScene("left-across", seed, 70.0), draw.span(9, 13.9)
    junction = Junction(scene, compass(draw, 4, 0.1), draw.span(9, 13), reach=420.0, limit=limit)
    for k in range(4):
        scene.rule(1 + k, "none" if seed % 2 else "minor" if k % 2 else "major")
    junction.place(0, draw.span(15, 40), draw.span(6, 9), 3)
    stream(junction, draw, 2, 0, 0.95 * limit, 9)
    return scene.want(reached_by=by(scene, 60.0), follower_braking_max=2.0, braking_max=5.0)


def minor_across(seed, draw):
    """A car crosses a major road between humans of both directions."""
    scene, limit = RuledScene("minor-across", seed, 70.0), draw.span(9, 13.9)
    junction = Junction(scene, compass(draw, 4, 0.1), draw.span(9, 13), reach=420.0, limit=limit)
    for k in range(4):
        scene.rule(1 + k, "minor" if k % 2 else "major")
    junction.place(1, draw.span(15, 40), draw.span(6, 9), 3)
    for arm in (0, 2):
        stream(junction, draw, arm, 2 - arm, 0.95 * limit, 6)
    return scene.want(reached_by=by(scene, 60.0), follower_braking_max=2.0, braking_max=5.0)


def lawless(seed, draw):
    """A human on the minor road does not yield."""
    scene, junction = ruled_junction("lawless", seed, draw, 40.0)
    for k in range(4):
        scene.rule(1 + k, "major" if k % 2 == 0 else "minor")
    near = draw.span(35, 50)
    junction.place(0, near, 9.0, 2)
    junction.place(1, near + draw.span(-8, 8), 9.0, 3, control="human", yields=False)
    return scene.want(reached_by=by(scene, 36.0), standing_s_max=12.0, braking_max=8.0)


def roundabout_full(seed, draw):
    """20 vehicles, as many as the planner takes; four of them drive by themselves."""
    scene = roundabout_scene("roundabout-full", seed, draw, 4, 16)
    for k, vehicle in enumerate(list(scene.vehicles[12:16])):
        x, y, heading = vehicle["x"], vehicle["y"], vehicle["heading"]
        scene.human(x - 14 * math.cos(heading), y - 14 * math.sin(heading), heading, 4.0)
    scene.duration = 150.0
    return scene.want(reached_by=by(scene, 145.0), standing_s_max=70.0)


FAMILIES = {f.__name__.replace("_", "-"): f for f in (
    pull_out, cyclist, bus_stop, tight_weave, truck_convoy, signals, right_first, stop_sign, left_across,
    minor_across, lawless, roundabout_full)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out")
    parser.add_argument("--family", action="append", choices=sorted(FAMILIES))
    parser.add_argument("--seeds", type=seeds, default=seeds("1-4"))
    options = parser.parse_args()
    for family in options.family or FAMILIES:
        for seed in options.seeds:
            write(build(family, seed, families=FAMILIES), options.out)


if __name__ == "__main__":
    sys.exit(main())
