"""The painted lines of a road, from the lanes of a scenario, for plot.py and replay_html.py.

Lanes are surveyed polylines with neighbours. Drawn are: the area of each lane, a dashed line where
two neighbours run side by side, a solid line at other edges, and no line where lanes overlap.
All lengths in metres.
"""
import math

import numpy as np

RESAMPLE = 1.0  # [m] between points of a lane edge


class Frame:
    """Turns the map so that a long straight road is horizontal and is driven to the right.

    angle: of the turn [rad], 0 if the road is nearly horizontal or has no main direction.
    direction: the main direction of driving [rad], None where there is none.
    """

    def __init__(self, points, forward):
        self.angle, self.direction = 0.0, None
        centred = points - points.mean(axis=0)
        _, size, axes = np.linalg.svd(centred, full_matrices=False)
        if size[0] > 4.0 * size[1]:
            axis = axes[0] if axes[0] @ forward >= 0.0 else -axes[0]
            self.direction = math.atan2(axis[1], axis[0])
            self.angle = self.direction if abs(self.direction) > math.radians(12.0) else 0.0
        c, s = math.cos(self.angle), math.sin(self.angle)
        self.matrix = np.array([[c, -s], [s, c]])

    def turn(self, points):
        return points @ self.matrix


class Lane:
    """A lane's centreline and edges at even spacing, turned by a frame where one is given."""

    def __init__(self, data, frame=None):
        self.id, self.width = data["id"], data["width"]
        self.left, self.right = data.get("left"), data.get("right")
        points = np.array(data["centerline"], dtype=float)
        points = frame.turn(points) if frame else points
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self.length = way[-1]
        count = max(2, int(way[-1] / RESAMPLE) + 1)
        at = np.linspace(0.0, way[-1], count)
        self.centre = np.column_stack([np.interp(at, way, points[:, k]) for k in (0, 1)])
        tangent = np.gradient(self.centre, axis=0)
        self.tangent = tangent / np.hypot(*tangent.T)[:, None]
        self.normal = np.column_stack([-self.tangent[:, 1], self.tangent[:, 0]])

    def edge(self, side):
        return self.centre + side * 0.5 * self.width * self.normal

    def outline(self):
        return np.vstack([self.edge(1.0), self.edge(-1.0)[::-1]])

    def distance(self, points):
        """From each point to the centreline, and whether it lies beside it (not past an end)."""
        apart = np.hypot(points[:, None, 0] - self.centre[None, :, 0],
                         points[:, None, 1] - self.centre[None, :, 1])
        nearest = apart.argmin(axis=1)
        away = points - self.centre[nearest]
        forward = away[:, 0] * self.normal[nearest, 1] - away[:, 1] * self.normal[nearest, 0]
        past = ((nearest == 0) & (forward < -0.5)) | (
            (nearest == len(self.centre) - 1) & (forward > 0.5))
        return apart.min(axis=1), ~past


def runs_of(mask):
    """Stretches [first, last] of a mask that are true, at least two points long."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(a, b) for a, b in zip(edges[::2], edges[1::2]) if b - a >= 2]


def painted_lines(lanes):
    """(dashed, solid): the lines on the road, each an array of points."""
    by_id = {lane.id: lane for lane in lanes}
    dashed, solid = [], []
    for lane in lanes:
        for side, name in ((1.0, lane.left), (-1.0, lane.right)):
            more_dashed, more_solid = edge_lines(lane, by_id.get(name), side, lanes)
            dashed += more_dashed
            solid += more_solid
    return dashed, solid


def edge_lines(lane, neighbour, side, lanes):
    """Dashed where the neighbour runs beside, solid elsewhere, nothing inside another lane."""
    edge = lane.edge(side)
    beside = np.zeros(len(edge), dtype=bool)
    if neighbour is not None:
        apart, along = neighbour.distance(lane.centre)
        usual = 0.5 * (lane.width + neighbour.width)
        beside = (apart > usual - 0.9) & (apart < usual + 1.2) & along
    covered = np.zeros(len(edge), dtype=bool)
    for other in lanes:
        if other is not lane and other is not neighbour:
            apart, along = other.distance(edge)
            covered |= (apart < 0.5 * other.width - 0.15) & along
    merged = covered.copy()  # the neighbour's own area counts only where it is not beside
    if neighbour is not None:
        apart, along = neighbour.distance(edge)
        merged |= (apart < 0.5 * neighbour.width - 0.15) & along
    shared = side > 0.0 or neighbour is None  # drawn once, by the lane to its right
    dashed = [edge[a:b] for a, b in runs_of(beside & ~covered)] if shared else []
    return dashed, [edge[a:b] for a, b in runs_of(~beside & ~merged)]
