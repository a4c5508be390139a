#!/usr/bin/env python3
"""Claim: a vehicle of any kind, given by name, by numbers or by size alone, is planned round a
corner and beside others with its own axles, and no vehicle drives through a trailer.

Each plan and run is judged with the body of the scenario's vehicle (judge.py): its rear axle, its
steering, its acceleration. The path of a trailer is integrated here from that of its tractor.
Messages of a bus and a planner without capacity for one more body refuse a trailer.
Usage: e2e_bodies.py --bin DIR
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import judge

TRAILER = {"hitch": 1.46, "length": 13.6, "width": 2.55, "axle": 7.65, "front": 1.6}


def corner(radius):
    """A lane straight on for 60 m, round by 90 degrees to the left, straight on for 120 m."""
    angles = np.linspace(0, np.pi / 2, 24)
    round_it = [[60 + radius * np.sin(a), radius - radius * np.cos(a)] for a in angles]
    return ([[x, 0] for x in range(0, 60, 5)] + round_it
            + [[60 + radius, radius + y] for y in range(5, 125, 5)])


def scenario(name, lanes, vehicles, duration):
    lanes = [{"id": i, "centerline": line, "width": 4.5, "speed_limit": 13,
              "left": i + 1 if i + 1 < len(lanes) else None, "right": i - 1 if i else None}
             for i, line in enumerate(lanes)]
    return {"format": "verge-scenario/1", "name": name, "road": {"lanes": lanes},
            "vehicles": vehicles, "planner": {"iterations": 300},
            "simulation": {"duration": duration}}


def vehicle(number, x, y, speed, control="controlled", **more):
    return {"id": number, "control": control, "x": x, "y": y, "heading": 0, "speed": speed,
            "acceleration": 0, **more}


def corners():
    bodies = [{"body": kind} for kind in judge.KINDS]
    bodies += [{"length": length, "width": 2.5} for length in (6.5, 9, 11.9, 14)]
    bodies += [{"body": {"kind": "truck", "rear_axle": 2.4, "wheelbase": 6, "steer_max": 0.6}},
               {"length": 4.5, "width": 1.8, "body": {"rear_axle": 1.1}}]
    for radius in (12, 20):
        for body in bodies:
            start = 5 if body.get("body") == "bicycle" else 8
            yield scenario(f"corner of {radius} m, {json.dumps(body)}", [corner(radius)],
                           [vehicle(1, 20, 0, start, **body)], 20)


def traffic():
    lanes = [[[0, 0], [500, 0]], [[0, 4], [500, 4]]]
    yield scenario("changes around an articulated truck", lanes, [
        vehicle(1, 100, 0, 8, "human", body="articulated"),
        vehicle(2, 88, 4, 8, length=5, width=2, target_lane=0),
        vehicle(3, 60, 0, 11, length=5, width=2, target_lane=1)], 20)
    yield scenario("an articulated truck that changes", lanes, [
        vehicle(1, 80, 0, 9, body="articulated", target_lane=1),
        vehicle(2, 62, 4, 9, "human", length=5, width=2),
        vehicle(3, 130, 0, 7, "human", body="bus")], 32)  # it lets the car pass first


def trailer_poses(poses):
    """x, y, heading of the trailer behind n x (x, y, heading) of a tractor, 0.1 s apart."""
    heading, out = poses[0, 2], []
    fine = judge.between(poses, 20)
    hitch = fine[:, :2] - TRAILER["hitch"] * np.stack([np.cos(fine[:, 2]), np.sin(fine[:, 2])], 1)
    middle = TRAILER["front"] - TRAILER["length"] / 2
    for k, at in enumerate(hitch):
        if k > 0:
            move = at - hitch[k - 1]
            heading += (np.cos(heading) * move[1] - np.sin(heading) * move[0]) / TRAILER["axle"]
        if k % 20 == 0:
            out.append([at[0] + middle * np.cos(heading), at[1] + middle * np.sin(heading), heading])
    return np.array(out)


def trailer_faults(lines, document):
    sizes, poses = judge.sizes_of(document), judge.poses_of(lines)
    for one in document["vehicles"]:
        if one.get("body") != "articulated":
            continue
        first, tractor = poses[one["id"]]
        trailer = trailer_poses(tractor[:, :3])
        for other in set(sizes) - {one["id"]}:
            begin, body = poses[other]
            assert begin == first == 0
            k = judge.first_overlap(trailer, body[:, :3], (TRAILER["length"], TRAILER["width"]),
                                    sizes[other])
            if k is not None:
                yield f"{other} is in the trailer of {one['id']} at tick {k}"


def refusal_faults(binaries, path):
    """Programs that must refuse an articulated truck, in one line that names the vehicle."""
    document = scenario("refused", [corner(20)], [vehicle(1, 20, 0, 8, body="articulated")], 10)
    small = {**document, "planner": {"vehicles_max": 1, "controlled_max": 1}}
    for program, more, refused in (("verge-publish", ["--bus", "loop:1"], document),
                                   ("verge-plan", [], small)):
        path.write_text(json.dumps(refused))
        done = subprocess.run([f"{binaries}/{program}", *more, path], capture_output=True, text=True,
                              timeout=60, check=False)
        if done.returncode != 2 or done.stdout or done.stderr.count("\n") != 1 \
                or "vehicles[0]" not in done.stderr or "trailer" not in done.stderr:
            yield f"{program}: exit {done.returncode}: {done.stdout}{done.stderr}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options, _ = parser.parse_known_args()
    count = runs = 0
    with tempfile.TemporaryDirectory() as folder:
        path, out = pathlib.Path(folder, "scenario.json"), pathlib.Path(folder, "run.jsonl")
        for document in [*corners(), *traffic()]:
            path.write_text(json.dumps(document))
            metrics = judge.run(options.bin, "verge-sim", path, "--out", out)["metrics"]
            lines = judge.read_lines(out)
            faults = [*judge.run_faults(lines, document), *trailer_faults(lines, document)]
            faults += [f"{a} and {b} touch" for _, a, b, _ in judge.contacts(lines, document)]
            if not metrics["success"] or metrics["collisions"] or metrics["fallbacks"]:
                faults.append(f"metrics: {metrics}")
            # What the run says of its scenario is what was read.
            assert lines[0]["scenario"]["vehicles"] == document["vehicles"], document["name"]
            for fault in faults[:3]:
                print(f"{document['name']}: {fault}", file=sys.stderr)
            count += len(faults)
            runs += 1
        for fault in refusal_faults(options.bin, path):
            print(fault, file=sys.stderr)
            count += 1
    print(f"{runs} runs, {count} faults")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
