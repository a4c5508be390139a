#!/usr/bin/python3
"""Draws a run: the path, the decisions and the speed of each vehicle.

Top: the road as surveyed, to scale. A controlled vehicle is a coloured path. Its body is drawn
every two seconds, with the time inside, and with brake lights and turn signals. Each action is named
where it begins. Uncontrolled vehicles are grey. A long road is split into rows; each row continues
the one above. With --at, the road is drawn once for each instant instead: every body where it is
then, with its number, and the path of the last two seconds behind it. That shows dense traffic, in
which paths cover each other. Below: the speeds, and the action of each controlled vehicle over
time. A narrow band below the actions is the mode of the vehicle's on-vehicle unit, if it has one.

The run file is that of verge-sim and verge-publish, format verge-run/1.
"""
import math
import sys

sys.dont_write_bytecode = True  # the folder of an installed program is not to be written to

try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Patch, Polygon
except ImportError as error:
    sys.exit(f"plot.py: {error}, expected Debian's python3-matplotlib (/usr/bin/python3)")

from one_line import BadInput, told_in_one_line, two_files
from road_lines import Frame, Lane, painted_lines
from run_file import check_row, read_run

FIGURE_WIDTH = 13.0     # [in]
SIDE = 0.62             # [in] left of every panel
LEGEND = 1.55           # [in] right of the speed panel
ROAD_HEIGHT_MAX = 7.0   # [in] one row of road
MARK_S = 2.0            # [s] between two drawn bodies
MARGIN = 9.0            # [m] of road shown before and after the paths
MARGIN_SIDE = 3.5       # [m] shown beside the road, for labels
TRAIL_S = 2.0           # [s] of path behind a body drawn at an instant
BETWEEN = 0.25          # [in] between two columns of instants
INSTANTS_MAX = 12       # pictures of the road on one page
HELP_AT = f"  {'--at SECONDS':18} draws the road at these instants, as in 0,2.5,5\n"

# The palette of Okabe and Ito first: readable for colour-blind people, and in grey.
COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#7B3294", "#8C510A",
          "#C51B7D", "#1B7837", "#4D4D9F", "#E08214", "#35978F", "#B2182B", "#5AAE61", "#2166AC"]
ACTION_COLORS = {"KS": "#D9D9D9", "AC": "#8FCB8B", "DC": "#F08A7E", "LCL": "#7FB3E6",
                 "LCR": "#F5C061"}
ACTION_NAMES = {"KS": "keep speed", "AC": "accelerate", "DC": "decelerate",
                "LCL": "change left", "LCR": "change right"}
MODE_COLORS = {"following": "#1F7A6B", "departing": "#E8710A", "alone": "#6A3D9A",
               "stopping": "#C8102E", "none": "#26262B"}
MODE_NAMES = {"following": "follows the plan", "departing": "departs from it",
              "alone": "has no plan", "stopping": "stops", "none": "is silent"}
ASPHALT, PAINT, EDGE = "#E6E6E8", "#9A9AA0", "#5B5B62"
HUMAN, HUMAN_BODY, HUMAN_TEXT = "#77777D", "#B5B5BA", "#4A4A50"


class Track:
    """One vehicle over the run."""

    def __init__(self, info):
        self.id = info["id"]
        self.controlled = info["control"] == "controlled"
        self.length, self.width = info["length"], info["width"]
        self.color = HUMAN
        self.rows, self.signs, self.fallbacks = [], [], []
        self.modes = []  # [(instant, mode of the on-vehicle unit from then on)]

    def finish(self, frame):
        """After the last tick: columns of numbers, in the frame of the picture."""
        rows = np.array(self.rows, dtype=float)
        self.t, self.speed = rows[:, 0], rows[:, 4]
        self.xy = frame.turn(rows[:, 1:3])
        self.heading = rows[:, 3] - frame.angle

    def tick(self, instant):
        """Index of the tick at an instant [s], the nearest one; None where there is none then."""
        index = int(np.argmin(np.abs(self.t - instant)))
        return index if abs(self.t[index] - instant) < 0.051 else None

    def segments(self):
        """[(first tick, last tick + 1, action)], neighbours with one action merged."""
        found, first = [], 0
        for i in range(1, len(self.signs) + 1):
            if i == len(self.signs) or self.signs[i][0] != self.signs[first][0]:
                if self.signs[first][0] in ACTION_COLORS:
                    found.append((first, i, self.signs[first][0]))
                first = i
        return found


    def mode_spans(self):
        """[(begin, end, mode)]; spans of one mode that differ in its reason are merged."""
        found = []
        for t, mode in self.modes:
            if not found or found[-1][1] != mode:
                found.append((t, mode))
        ends = [t for t, _ in found[1:]] + [max(self.t[-1], self.t[0])]
        return [(t, end, mode) for (t, mode), end in zip(found, ends) if end > t]


class Run:
    """Everything the picture needs from a run file."""

    def __init__(self, path):
        read_run(path, self.begin, self.add)
        self.tracks = {i: t for i, t in sorted(self.tracks.items()) if t.rows}
        if not self.tracks:
            raise BadInput(f"{path}:file: no vehicle moves in this run, expected at least one")
        driven = [t for t in self.tracks.values() if t.controlled] or list(self.tracks.values())
        points = np.array([row[1:3] for t in driven for row in t.rows])
        forward = sum(np.subtract(t.rows[-1][1:3], t.rows[0][1:3]) for t in driven)
        self.frame = Frame(points, forward)
        for track in self.tracks.values():
            track.finish(self.frame)
        self.controlled = [t for t in self.tracks.values() if t.controlled]
        self.humans = [t for t in self.tracks.values() if not t.controlled]
        for i, track in enumerate(self.controlled):
            track.color = COLORS[i % len(COLORS)]
        self.lanes = [Lane(lane, self.frame) for lane in self.surveyed]
        self.t_end = max(0.1, *(t.t[-1] for t in self.tracks.values()))  # a run may be one tick

    def begin(self, scenario):
        self.name, self.metrics = scenario["name"], {}
        self.tracks = {v["id"]: Track(v) for v in scenario["vehicles"]}
        self.surveyed = scenario["road"]["lanes"]
        self.lanes = [Lane(lane) for lane in self.surveyed]  # a fault of theirs is told as such

    def add(self, line):
        self.metrics = line.get("metrics", self.metrics)
        for row in line.get("vehicles", []):
            check_row(row)
            track = self.tracks[row[0]]
            track.rows.append([line["t"], *row[1:5]])
            track.signs.append((row[7], row[8], row[9]))
        if "unit" in line:
            mode = line["unit"]["mode"]
            MODE_COLORS[mode]  # a mode that is not known is a fault of the file
            self.tracks[line["unit"]["id"]].modes.append((line["t"], mode))
        for plan in line.get("plan", {}).get("vehicles", []):
            if plan["status"] == "fallback" and plan["id"] in self.tracks:
                self.tracks[plan["id"]].fallbacks.append(line["t"])


def view_of(run, points, aspect):
    """(x0, x1, y0, y1): the points with a margin, at least `aspect` times as wide as high."""
    margin = np.array([MARGIN, MARGIN_SIDE])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    for lane in run.lanes:  # the road beside the paths in its whole width
        both = np.vstack([lane.edge(1.0), lane.edge(-1.0)])
        inside = both[(both[:, 0] > low[0]) & (both[:, 0] < high[0])]
        near = inside[(inside[:, 1] > low[1] - 9.0) & (inside[:, 1] < high[1] + 9.0)]
        if len(near):
            low[1] = min(low[1], near[:, 1].min() - MARGIN_SIDE)
            high[1] = max(high[1], near[:, 1].max() + MARGIN_SIDE)
    width, height = high - low
    if width < aspect * height:  # a tall view: show more of the surroundings at its sides
        middle, half = 0.5 * (low[0] + high[0]), 0.5 * aspect * height
        low[0], high[0] = middle - half, middle + half
    return low[0], high[0], low[1], high[1]


def rows_of(view):
    """Cuts a long view into rows; each row repeats a little of the one before."""
    x0, x1, y0, y1 = view
    count = min(4, max(1, round((x1 - x0) / (y1 - y0) / 4.8)))
    length = (x1 - x0) / count
    return [(x0 + i * length - (3.0 if i else 0.0), x0 + (i + 1) * length, y0, y1)
            for i in range(count)]


# --- the road -----------------------------------------------------------------------------------

def draw_road(axes, lanes):
    for lane in lanes:
        axes.add_patch(Polygon(lane.outline(), closed=True, facecolor=ASPHALT, edgecolor=ASPHALT,
                               linewidth=0.8, zorder=1))
    dashed, solid = painted_lines(lanes)
    for line in dashed:
        axes.plot(*line.T, color=PAINT, linewidth=1.1, dashes=(7, 6), zorder=2)
    for line in solid:
        axes.plot(*line.T, color=EDGE, linewidth=1.3, solid_capstyle="butt", zorder=2)


# --- vehicles -----------------------------------------------------------------------------------

def corners(track, index, x0, x1, y0, y1):
    """A rectangle in the vehicle's own frame, x forward, as map points."""
    c, s = math.cos(track.heading[index]), math.sin(track.heading[index])
    own = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return own @ np.array([[c, s], [-s, c]]) + track.xy[index]


def draw_body(axes, track, index, alpha, text, scale, size_of_text=0.575):
    """size_of_text: height of the letters, as a share of the body's width."""
    half_l, half_w = 0.5 * track.length, 0.5 * track.width
    face = track.color if track.controlled else HUMAN_BODY
    level = (6.0 if track.controlled else 4.0) + 0.001 * index  # later bodies lie on earlier ones
    axes.add_patch(Polygon(corners(track, index, -half_l, half_l, -half_w, half_w), closed=True,
                           facecolor=face, edgecolor="white", linewidth=0.7, alpha=alpha,
                           zorder=level))
    _, brake, turn = track.signs[index]
    if track.controlled and brake:
        tail = corners(track, index, -half_l, -half_l + 0.5, -half_w, half_w)
        axes.add_patch(Polygon(tail, closed=True, facecolor="#E3000F", linewidth=0,
                               zorder=level))
    for side, names in ((1.0, ("left", 1)), (-1.0, ("right", -1))):
        if track.controlled and turn in names:
            y0, y1 = sorted((side * half_w, side * (half_w - 0.65)))
            for x0 in (-half_l, half_l - 0.9):
                axes.add_patch(Polygon(corners(track, index, x0, x0 + 0.9, y0, y1), closed=True,
                                       facecolor="#FFB000", linewidth=0, zorder=level))
    size = size_of_text * track.width * scale * 72.0
    if text and size >= 4.0:
        upright = (math.degrees(track.heading[index]) + 90.0) % 180.0 - 90.0
        axes.text(*track.xy[index], text, rotation=upright, rotation_mode="anchor", ha="center",
                  va="center_baseline", fontsize=min(8.5, size),
                  color="white" if track.controlled else HUMAN_TEXT, zorder=level, clip_on=True)


def mark_ticks(track):
    """Ticks at whole multiples of MARK_S; a vehicle that hardly moves is not drawn again."""
    whole = np.round(track.t / MARK_S) * MARK_S
    marks = []
    for i in np.flatnonzero(np.abs(track.t - whole) < 1e-6):
        if not marks or np.hypot(*(track.xy[i] - track.xy[marks[-1]])) > 0.3 * track.length:
            marks.append(int(i))
    return marks


def draw_vehicle(axes, track, t_end, scale):
    style = dict(linewidth=0.9, zorder=3, alpha=0.55)
    if track.controlled:
        style = dict(linewidth=2.0, zorder=5, alpha=0.9)
    axes.plot(*track.xy.T, color=track.color, solid_capstyle="round", **style)
    for index in mark_ticks(track):
        fade = 0.35 + 0.55 * track.t[index] / max(t_end, 1e-9)
        if not track.controlled:
            fade *= 0.75
        text = f"{track.t[index]:g}" if index > 0 else ""
        draw_body(axes, track, index, fade, text, scale)


def draw_start(axes, track, scale):
    """The vehicle's number, in a disc on its first body."""
    weight = 1.0 if track.controlled else 0.85
    radius = weight * max(1.35, 0.105 / scale)
    fontsize = weight * (8.5 if len(str(track.id)) < 3 else 6.5)
    axes.add_patch(Circle(track.xy[0], radius, facecolor="white", zorder=9,
                          edgecolor=track.color if track.controlled else HUMAN, linewidth=1.6))
    axes.text(*track.xy[0], str(track.id), ha="center", va="center_baseline", fontsize=fontsize,
              fontweight="bold", color=track.color if track.controlled else HUMAN_TEXT, zorder=10,
              clip_on=True)


class Labels:
    """Places words beside the paths where nothing else is written."""

    def __init__(self, axes, view, scale, tracks):
        self.axes, self.view, self.scale = axes, view, scale
        self.taken = [(x - 1.4, x + 1.4, y - 1.4, y + 1.4) for t in tracks for x, y in t.xy[:1]]
        self.paths = np.vstack([t.xy[::3] for t in tracks])
        bodies = [t.xy[i] for t in tracks for i in mark_ticks(t)]
        self.bodies = np.array(bodies)

    def cost(self, box):
        """How much a box would cover: labels and bodies count more than paths."""
        x0, x1, y0, y1 = box
        if x0 < self.view[0] or x1 > self.view[1] or y0 < self.view[2] or y1 > self.view[3]:
            return math.inf
        if any(x0 < b and a < x1 and y0 < d and c < y1 for a, b, c, d in self.taken):
            return math.inf

        def hits(points, grow):
            x, y = points.T
            return int(np.sum((x > x0 - grow) & (x < x1 + grow)
                              & (y > y0 - 0.5 * grow) & (y < y1 + 0.5 * grow)))
        return hits(self.paths, 0.3) + 8 * hits(self.bodies, 2.0)

    def put(self, track, index, word):
        """Tries places around the path at this tick. If none is free, the label is left out."""
        fontsize = 7.5
        half_w = (0.31 * len(word) * fontsize + 2.5) / 72.0 / self.scale
        half_h = (0.5 * fontsize + 1.6) / 72.0 / self.scale
        c, s = math.cos(track.heading[index]), math.sin(track.heading[index])
        best = None
        for steps in (1.4, 2.3, 3.3, 4.5, 6.1):
            away = 0.5 * track.width + steps * half_h
            for side in (1.0, -1.0):
                for along in (0.0, half_w, -half_w, 2.0 * half_w):
                    x = track.xy[index, 0] + along * c - side * away * s
                    y = track.xy[index, 1] + along * s + side * away * c
                    box = (x - half_w, x + half_w, y - half_h, y + half_h)
                    cost = self.cost(box) + 0.6 * away / half_h + 0.2 * abs(along) / half_w
                    if best is None or cost < best[0]:
                        best = (cost, x, y, box)
        if best[0] < math.inf:
            self.write(track, index, word, best, fontsize)

    def write(self, track, index, word, place, fontsize):
        _, x, y, box = place
        self.taken.append(box)
        self.axes.annotate(
            word, track.xy[index], (x, y), ha="center", va="center", fontsize=fontsize,
            color=track.color, fontweight="bold", zorder=11, annotation_clip=True,
            bbox=dict(boxstyle="round,pad=0.16", facecolor="white", alpha=0.88,
                      edgecolor=track.color, linewidth=0.7),
            arrowprops=dict(arrowstyle="-", color=track.color, linewidth=0.7, shrinkA=0,
                            shrinkB=0))


def label_actions(axes, run, view, scale):
    """Places the labels of lane changes first, because they matter most where space is short."""
    inside = [t for t in run.tracks.values()
              if np.any((t.xy[:, 0] > view[0]) & (t.xy[:, 0] < view[1]))]
    labels = Labels(axes, view, scale, inside)
    wanted = [(not word.startswith("LC"), track.t[a], track.id, track, a, word)
              for track in run.controlled for k, (a, b, word) in enumerate(track.segments())
              if b - a > 3 and not (k == 0 and word == "KS")]  # the initial KS needs no label
    for *_, track, index, word in sorted(wanted, key=lambda w: w[:3]):
        x, y = track.xy[index]
        if view[0] <= x <= view[1] and view[2] <= y <= view[3]:
            labels.put(track, index, word)


# --- speeds and actions over time ---------------------------------------------------------------

def spread(values, gap):
    """Moves labels apart so that neighbours keep the gap; order and middle are kept."""
    order = np.argsort(values, kind="stable")
    placed = np.array(values, dtype=float)
    for _ in range(200):
        moved = False
        for a, b in zip(order, order[1:]):
            short = gap - (placed[b] - placed[a])
            if short > 1e-9:
                placed[a] -= 0.5 * short
                placed[b] += 0.5 * short
                moved = True
        if not moved:
            break
    return placed


def draw_speeds(axes, run):
    for track in run.humans:
        axes.plot(track.t, track.speed, color="#C4C4C9", linewidth=1.0, zorder=2)
    for track in run.controlled:
        axes.plot(track.t, track.speed, color=track.color, linewidth=2.0, zorder=3)
    fastest = max(t.speed.max() for t in run.tracks.values())
    slowest = min(t.speed.min() for t in run.tracks.values())
    room = max(1.0, 0.12 * (fastest - slowest))
    low, high = max(0.0, slowest - room) if slowest > 3.0 else 0.0, fastest + room
    axes.set(ylim=(low, high), ylabel="speed [m/s]")
    ends = [t.speed[-1] for t in run.controlled]
    places = spread(ends, 0.062 * (high - low))
    places -= max(0.0, places.max(initial=low) - high)
    for track, y in zip(run.controlled, places):
        axes.annotate(f"vehicle {track.id}", (track.t[-1], track.speed[-1]),
                      (run.t_end * 1.012, y), annotation_clip=False, fontsize=8.5,
                      fontweight="bold", color=track.color, va="center")
    tidy(axes)
    axes.tick_params(labelbottom=False)


def draw_actions(axes, run, row, track):
    # Above the band of modes, if there is one.
    middle, height = (row - 0.12, 0.54) if track.modes else (row, 0.74)
    for a, b, word in track.segments():
        t0 = track.t[a]
        t1 = track.t[b] if b < len(track.t) else track.t[-1]
        axes.barh(middle, t1 - t0, left=t0, height=height, color=ACTION_COLORS[word],
                  edgecolor="white", linewidth=0.8)
        if (t1 - t0) / run.t_end > 0.026 + 0.004 * len(word):
            axes.text(0.5 * (t0 + t1), middle, word, ha="center", va="center_baseline",
                      fontsize=7.5, color="#303036")


def draw_strips(axes, run):
    for row, track in enumerate(run.controlled):
        draw_actions(axes, run, row, track)
        for t0, t1, mode in track.mode_spans():
            axes.barh(row + 0.27, t1 - t0, left=t0, height=0.2, color=MODE_COLORS[mode])
        axes.plot(track.fallbacks, [row - 0.4] * len(track.fallbacks), linestyle="none",
                  marker="v", markersize=5, color="#B00020", clip_on=False, zorder=4)
    axes.set(yticks=range(len(run.controlled)), xlabel="time [s]",
             yticklabels=[str(t.id) for t in run.controlled],
             ylim=(len(run.controlled) - 0.5, -0.5), ylabel="vehicle")
    tidy(axes)
    axes.tick_params(axis="y", length=0)
    for label, track in zip(axes.get_yticklabels(), run.controlled):
        label.set(color=track.color, fontweight="bold")
    axes.legend(handles=legend_of(run), loc="upper left", bbox_to_anchor=(1.008, 1.02),
                frameon=False, fontsize=8, handlelength=1.0, handleheight=1.0, borderaxespad=0.0)


def legend_of(run):
    used = {word for t in run.controlled for _, _, word in t.segments()}
    modes = {mode for t in run.controlled for _, _, mode in t.mode_spans()}
    handles = [Patch(color=ACTION_COLORS[w], label=f"{w}  {ACTION_NAMES[w]}")
               for w in ACTION_COLORS if w in used]
    handles += [Patch(color=MODE_COLORS[m], label=f"unit {MODE_NAMES[m]}")
                for m in MODE_COLORS if m in modes]
    if run.humans:
        handles.append(Line2D([], [], color="#C4C4C9", label="speed of a human"))
    if any(t.fallbacks for t in run.controlled):
        handles.append(Line2D([], [], linestyle="none", marker="v", markersize=5, color="#B00020",
                              label="fallback planned"))
    return handles


# --- the page -----------------------------------------------------------------------------------

def tidy(axes):
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#A8A8AE")
    axes.tick_params(labelsize=8, color="#A8A8AE", labelcolor="#4A4A50")
    axes.xaxis.label.set(size=9, color="#303036")
    axes.yaxis.label.set(size=9, color="#303036")


def plural(count, noun):
    return f"{count} {noun}" + ("" if count == 1 else "s")


def subtitle(run):
    words = [f"{plural(len(run.controlled), 'vehicle')} planned jointly",
             plural(len(run.humans), "human driver"), f"{run.t_end:.1f} s"]
    known = run.metrics
    if "reached_time" in known:
        times = [time for name, time in known["reached_time"].items() if name != "mean"]
        words.append("an intention not reached" if None in times else "every intention reached")
    if "collisions" in known:
        words.append(plural(known["collisions"], "collision") if known["collisions"]
                     else "no collision")
    for name, text in (("off_road", "off the road"), ("standing", "standing")):
        if known.get(name):
            words.append(f"{known[name]} {text} at the end")
    if known.get("min_distance") is not None:
        words.append(f"closest bodies {known['min_distance']:.2f} m")
    if known.get("fallbacks"):
        words.append(plural(known["fallbacks"], "fallback"))
    return "  ·  ".join(words)


class Paths:
    """The road once along the run, in rows: paths, bodies every MARK_S, and actions."""
    legend = f"bodies every {MARK_S:g} s, time inside"
    columns, aspect = 1, 1.7

    def __init__(self, run):
        self.run = run
        points = np.vstack([t.xy for t in run.controlled or run.humans])
        self.views = rows_of(view_of(run, points, self.aspect))

    def draw(self, axes, number, scale):
        draw_map(axes, self.run, self.views[number], scale, number == len(self.views) - 1)


class Instants:
    """The road once for each instant: where the bodies are, and the paths they come from."""
    legend = f"numbers of vehicles, paths of the last {TRAIL_S:g} s"

    def __init__(self, run, instants):
        self.run, self.instants = run, instants
        points = np.vstack([t.xy[i] for t in run.tracks.values() for at in instants
                            for i in [t.tick(at)] if i is not None])
        view = view_of(run, points, 1.0)
        self.columns = 2 if view[1] - view[0] < 3.0 * (view[3] - view[2]) else 1
        self.views = [view] * len(instants)

    def draw(self, axes, number, scale):
        draw_instant(axes, self.run, self.views[number], scale, self.instants[number])


def draw_page(run, road, out):
    view = road.views[0]
    width = (FIGURE_WIDTH - SIDE - 0.25 - (road.columns - 1) * BETWEEN) / road.columns
    row_height = min(ROAD_HEIGHT_MAX, width * (view[3] - view[2]) / (view[1] - view[0]))
    scale = row_height / (view[3] - view[2])  # [in] a metre
    rows = -(-len(road.views) // road.columns)
    modes = any(track.modes for track in run.controlled)
    strip_height = max(1.2, (0.36 if modes else 0.27) * len(run.controlled),
                       0.167 * len(legend_of(run)) - 0.4)
    head, speed_height, gap = 0.95, 2.1, 0.36
    height = head + rows * (row_height + gap) + 0.25 + speed_height + 0.14 + strip_height + 0.6
    figure = plt.figure(figsize=(FIGURE_WIDTH, height), facecolor="white")

    def panel(top, tall, right, left=SIDE):
        return figure.add_axes([left / FIGURE_WIDTH, 1.0 - (top + tall) / height,
                                (FIGURE_WIDTH - left - right) / FIGURE_WIDTH, tall / height])

    figure.text(SIDE / FIGURE_WIDTH, 1.0 - 0.4 / height, run.name, fontsize=17, fontweight="bold",
                color="#202026", va="center")
    figure.text(SIDE / FIGURE_WIDTH, 1.0 - 0.72 / height, subtitle(run), fontsize=10,
                color="#5B5B62", va="center")
    figure.text(1.0 - 0.25 / FIGURE_WIDTH, 1.0 - 0.40 / height,
                f"{road.legend}  ·  red: brake lights  ·  amber: signal",
                fontsize=8.5, color="#8A8A90", va="center", ha="right")
    for number in range(len(road.views)):
        row, column = divmod(number, road.columns)
        left = SIDE + column * (width + BETWEEN)
        axes = panel(head + row * (row_height + gap), row_height, FIGURE_WIDTH - left - width, left)
        road.draw(axes, number, scale)
    top = head + rows * (row_height + gap) + 0.25
    speeds = panel(top, speed_height, LEGEND)
    draw_speeds(speeds, run)
    strips = panel(top + speed_height + 0.14, strip_height, LEGEND)
    draw_strips(strips, run)
    for axes in (speeds, strips):
        axes.set_xlim(0.0, run.t_end)
        axes.grid(axis="x", color="#EDEDF0", linewidth=0.8)
        axes.set_axisbelow(True)
    speeds.grid(axis="y", color="#EDEDF0", linewidth=0.8)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out, dpi=140)


def draw_instant(axes, run, view, scale, instant):
    """The bodies at one instant. Brake lights and signals are those of this tick."""
    axes.set(xlim=view[:2], ylim=view[2:], aspect="equal", xticks=[], yticks=[])
    draw_road(axes, run.lanes)
    for track in run.humans + run.controlled:
        index = track.tick(instant)
        if index is not None:
            trail = track.xy[(track.t > instant - TRAIL_S) & (track.t < instant + 1e-6)]
            axes.plot(*trail.T, color=track.color, linewidth=2.0, alpha=0.7, zorder=3)
            draw_body(axes, track, index, 1.0, str(track.id), scale, 0.9)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.text(0.004, 0.99, f"{instant:g} s", transform=axes.transAxes, fontsize=10,
              fontweight="bold", color="#303036", va="top", zorder=12)


def draw_map(axes, run, view, scale, last):
    axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
    draw_road(axes, run.lanes)
    for track in run.humans + run.controlled:
        draw_vehicle(axes, track, run.t_end, scale)
    for track in run.humans + run.controlled:
        if view[0] < track.xy[0, 0] < view[1] and view[2] < track.xy[0, 1] < view[3]:
            draw_start(axes, track, scale)
    label_actions(axes, run, view, scale)
    tidy(axes)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0, labelleft=False)
    if last:
        turned = f" along the road (map turned by {math.degrees(-run.frame.angle):.0f}°)"
        axes.set_xlabel("x [m]" if run.frame.angle == 0.0 else "[m]" + turned, labelpad=2)


def asked_instants():
    """The instants of --at, which is taken out of the command line; none without it."""
    if "--at" not in sys.argv:
        return []
    place = sys.argv.index("--at")
    given = "".join(sys.argv[place + 1:place + 2])
    del sys.argv[place:place + 2]
    try:
        instants = [float(word) for word in given.split(",")]
    except ValueError:
        instants = []
    if not 0 < len(instants) <= INSTANTS_MAX or not all(map(math.isfinite, instants)):
        raise BadInput(f"plot.py:--at: is \"{given}\", expected 1 to {INSTANTS_MAX} instants [s] "
                       "with commas between them")
    return instants


def main():
    instants = asked_instants()
    source, out = two_files(__doc__, "RUN.jsonl OUT.png", HELP_AT)
    if out.suffix[1:] not in matplotlib.figure.FigureCanvasBase.get_supported_filetypes():
        raise BadInput(f"{out}:file: ends in \"{out.suffix}\", expected .png, .svg or .pdf")
    run = Run(source)
    for instant in instants:
        if all(track.tick(instant) is None for track in run.tracks.values()):
            raise BadInput(f"plot.py:--at: no vehicle drives at {instant:g} s, expected an instant "
                           f"from 0 to {run.t_end:g} s")
    draw_page(run, Instants(run, instants) if instants else Paths(run), out)


if __name__ == "__main__":
    sys.exit(told_in_one_line(main))
