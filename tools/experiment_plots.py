#!/usr/bin/python3
"""Figures of the results of verge-experiment.

    experiment_plots.py [DIR] [--out DIR] [--no-runs]

Reads NAME.json of each experiment in DIR (default out/experiments) and draws NAME.png beside it, or
in the folder of --out. Then draws the runs that the experiments wrote there, with plot.py.
"""
import argparse
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from one_line import BadInput, read_json, told_in_one_line

# The palette of Okabe and Ito: readable for colour-blind people, and in grey.
METHODS = {"verge": "#0072B2", "decision-only": "#E69F00", "sequential": "#999999",
           "verge, search: paper": "#D55E00"}
HABITS = {"aggressive": "#D55E00", "normal": "#0072B2", "conservative": "#009E73"}
INK, FAINT = "#333338", "#D0D0D6"

# Table 3 of the paper for 2, 3 and 4 vehicles; its gaps on one measure, centre distance less 5 m.
PAPER = {
    "sequential": {"success": [1, 1, 0.7], "nodes": [1304.1, 1387.6, 1706.6],
                   "finish_time": [3.57, 3.57, 4.58], "min_center_gap": [4.34, 4.74, 5.02]},
    "decision-only": {"success": [1, 1, 0.9], "nodes": [1196.6, 1127.8, 1785.0],
                      "finish_time": [5.75, 4.95, 9.29], "min_center_gap": [8.41, 7.02, 7.54]},
    "verge": {"success": [1, 1, 1], "nodes": [1148.7, 1037.6, 1527.3],
              "finish_time": [5.68, 3.50, 8.93], "min_center_gap": [4.1, 5.8, 5.9]},
}
GAP_GOAL = {2: 8.41, 3: 7.02, 4: 7.54}     # [m] the paper's best column
TIME_GOAL = {2: 5.68, 3: 3.50, 4: 8.93}    # [s]
# Runs that the page shows (experiments.c), and more of them.
SHOWN = ["roundabout", "freeway-2av-as-stated-verge", "ramp-case-1-state-1.00-3000",
         "ramp-case-2-state-1.00-3000", "ramp-case-3-speeds-up"]
RUNS = ["freeway-2av-as-run-verge", "freeway-3av-as-run-verge", "freeway-4av-as-run-verge",
        "freeway-4av-as-run-decision-only", "freeway-4av-as-run-sequential",
        "ramp-case-1-state-0.00-3000", "ramp-case-2-state-0.00-3000", "ramp-case-3"]


def style():
    plt.rcParams.update({
        "font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False,
        "axes.edgecolor": INK, "axes.labelcolor": INK, "text.color": INK, "xtick.color": INK,
        "ytick.color": INK, "axes.grid": True, "grid.color": FAINT, "grid.linewidth": 0.6,
        "axes.axisbelow": True, "axes.titlesize": 10.5, "axes.titleweight": "bold",
        "axes.titlelocation": "left", "legend.frameon": False, "savefig.dpi": 150,
    })


def number(value):
    """A number, or not-a-number for null, which stands for "not measured"."""
    return np.nan if value is None else float(value)


def column(rows, key):
    return np.array([number(r[key]) for r in rows])


def save(figure, out, name, title):
    figure.suptitle(title, x=0.012, ha="left", fontsize=12.5, fontweight="bold")
    figure.savefig(out / f"{name}.png")
    plt.close(figure)
    print(out / f"{name}.png")


def freeway_table(rows, out):
    """Bars: means of all repeats. Whisker: the worst repeat. Diamond: the value of the paper."""
    most = max(r["repeats"] for r in rows)
    rows = [r for r in rows if r["repeats"] == most]
    measures = [("success", "success", None, "share of runs"),
                ("nodes", "nodes to the plan", "nodes_worst", "nodes"),
                ("finish_time", "finish time", "finish_worst", "s"),
                ("min_center_gap", "smallest gap (centres - 5 m)", "min_center_gap_worst", "m"),
                ("min_distance", "smallest clearance", "min_distance_worst", "m")]
    settings = ["as-stated", "as-run"]
    figure, axes = plt.subplots(2, len(measures), figsize=(16.5, 6.6), sharey="col")
    figure.subplots_adjust(left=0.045, right=0.995, top=0.86, bottom=0.115, wspace=0.22,
                           hspace=0.34)
    for line, setting in zip(axes, settings):
        for axis, (key, title, worst, unit) in zip(line, measures):
            for k, method in enumerate(["sequential", "decision-only", "verge"]):
                mine = sorted((r for r in rows if r["setting"] == setting
                               and r["method"] == method), key=lambda r: r["controlled"])
                x = np.arange(len(mine)) + 0.27 * (k - 1)
                mean = column(mine, key)
                axis.bar(x, mean, 0.25, color=METHODS[method], label=method)
                if worst:
                    axis.vlines(x, mean, column(mine, worst), color=INK, lw=1.1)
                    axis.plot(x, column(mine, worst), "_", color=INK, ms=7)
                if key in PAPER[method]:
                    axis.plot(x, PAPER[method][key], "D", ms=5, mfc="white", mec=INK, mew=1.1,
                              label="the paper" if k == 2 else None)
            if key == "min_distance":
                axis.axhline(1.0, color=INK, lw=0.9, ls=":")
            axis.axhline(0, color=INK, lw=0.8)
            axis.set_xticks(range(3), ["2", "3", "4"])
            axis.set_ylabel(unit)
            axis.set_title(title if setting == settings[0] else "")
            axis.grid(axis="x", visible=False)
    for line, setting in zip(axes, settings):
        line[0].annotate(setting, (0, 1), xytext=(-42, 16), textcoords="offset points",
                         xycoords="axes fraction", fontweight="bold", color="#6A6A72")
    for axis in axes[1]:
        axis.set_xlabel("controlled vehicles")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncol=4, bbox_to_anchor=(0.995, 0.985))
    save(figure, out, "freeway-table",
         f"Table 3, rerun: mean of {most:.0f} seeds, whiskers to the worst")


def pareto(rows, out):
    figure, axes = plt.subplots(1, 3, figsize=(15, 5.0), sharey=True)
    figure.subplots_adjust(left=0.05, right=0.99, top=0.83, bottom=0.12, wspace=0.07)
    for axis, controlled in zip(axes, (2, 3, 4)):
        mine = [r for r in rows if r["controlled"] == controlled]
        front = sorted((r for r in mine if r["front"]), key=lambda r: r["finish_time"])
        time, gap = column(mine, "finish_time"), column(mine, "min_center_gap")
        axis.axhspan(GAP_GOAL[controlled], 20, color="#EAF4EC", zorder=0)
        axis.axvline(TIME_GOAL[controlled], color=INK, lw=0.9, ls=":")
        axis.axhline(GAP_GOAL[controlled], color=INK, lw=0.9, ls=":")
        axis.vlines(time, column(mine, "min_center_gap_worst"), gap, color=FAINT, lw=1.2)
        axis.step(column(front, "finish_time"), column(front, "min_center_gap"), where="post",
                  color=METHODS["verge"], lw=1.4, label="front")
        axis.plot(time, gap, "o", color="#8FB8D8", ms=6, label="tried: room wanted [m], share of the limit")
        for k, r in enumerate(front):
            axis.annotate(f"{r['change_gap_wanted']:g}, {r['cruise_share']:g}",
                          (r["finish_time"], r["min_center_gap"]), fontsize=7.5,
                          xytext=(5, 7) if k % 2 else (-5, 7), textcoords="offset points",
                          ha="left" if k % 2 else "right")
        axis.plot(column(front, "finish_time"), column(front, "min_center_gap"), "o",
                  color=METHODS["verge"], ms=6)
        chosen = [r for r in mine if r["default"]]
        axis.plot(column(chosen, "finish_time"), column(chosen, "min_center_gap"), "*",
                  color="#D55E00", ms=15, mec="white", label="the default")
        axis.plot(TIME_GOAL[controlled], GAP_GOAL[controlled], "D", mfc="white", mec=INK, ms=7,
                  label="the paper's best, cell by cell")
        axis.set_title(f"{controlled} controlled vehicles")
        axis.set_xlabel("mean finish time [s]")
        low, high = np.nanmin(time), np.nanmax(time)
        axis.set_xlim(min(low, TIME_GOAL[controlled]) - 0.5, max(high, TIME_GOAL[controlled]) + 0.5)
    axes[0].set_ylim(0, 11)
    axes[0].set_ylabel("smallest gap, centres - 5 m [m]")
    axes[2].legend(loc="lower right", fontsize=8.5)
    save(figure, out, "pareto", "Finish time against gap: dot the mean, line down to the worst run")


def beyond(rows, out):
    kinds = []
    for r in rows:
        kind = (r["scenes"], r["controlled"], r["humans"])
        if kind not in kinds:
            kinds.append(kind)
    labels = [k[0].replace(", ", ",\n") + f"\n{k[1]:.0f} + {k[2]:.0f}" for k in kinds]
    methods = ["verge", "verge, search: paper", "decision-only", "sequential"]
    measures = [("success", "success", "share of runs", methods),
                ("reward", "decision quality X_flow, of the bound (dash)", "1", methods[:2]),
                ("finish_time", "finish time of those who finished", "s", methods),
                ("min_distance", "smallest clearance of bodies", "m", methods)]
    figure, axes = plt.subplots(2, 2, figsize=(16.5, 8.2))
    figure.subplots_adjust(left=0.045, right=0.995, top=0.88, bottom=0.085, wspace=0.1, hspace=0.42)
    for axis, (key, title, unit, shown) in zip(axes.flat, measures):
        width = 0.84 / len(shown)
        for m, method in enumerate(shown):
            mine = [next(r for r in rows if (r["scenes"], r["controlled"], r["humans"]) == k
                         and r["method"] == method) for k in kinds]
            x = np.arange(len(kinds)) + width * (m - 0.5 * (len(shown) - 1))
            axis.bar(x, column(mine, key), 0.92 * width, color=METHODS[method], label=method)
            if key == "reward":
                axis.hlines(column(mine, "bound"), x - 0.5 * width, x + 0.5 * width, color=INK)
        axis.set_xticks(range(len(kinds)), labels, fontsize=8)
        axis.set_title(title)
        axis.set_ylabel(unit)
        axis.grid(axis="x", visible=False)
    handles, names = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="upper right", ncol=4, bbox_to_anchor=(0.995, 0.985))
    save(figure, out, "beyond",
         f"More vehicles (controlled + humans), {rows[0]['repeats']:.0f} scenes each")


def diversity(rows, out):
    boxes = [r for r in rows if "quantity" in r]
    yields = [r for r in rows if "cooperation" in r]
    names = list(dict.fromkeys(r["quantity"] for r in boxes))
    figure, axes = plt.subplots(1, len(names) + 1, figsize=(17, 4.6),
                                gridspec_kw={"width_ratios": [1] * len(names) + [1.9]})
    figure.subplots_adjust(left=0.035, right=0.962, top=0.8, bottom=0.13, wspace=0.32)
    for axis, name in zip(axes, names):
        for k, (habit, color) in enumerate(HABITS.items()):
            r = next(r for r in boxes if r["quantity"] == name and r["habit"] == habit)
            axis.bxp([{"whislo": r["p05"], "q1": r["p25"], "med": r["p50"], "q3": r["p75"],
                       "whishi": r["p95"], "mean": r["mean"]}], positions=[k], widths=0.6,
                     showfliers=False, showmeans=True, patch_artist=True,
                     boxprops={"facecolor": color, "alpha": 0.75, "edgecolor": INK},
                     medianprops={"color": INK, "lw": 1.6},
                     meanprops={"marker": "o", "mfc": "white", "mec": INK, "ms": 4})
        axis.set_xticks(range(3), [h[:6] + "." if len(h) > 6 else h for h in HABITS], fontsize=8)
        axis.set_title(name.replace("magnitude of acceleration", "|acceleration|"), fontsize=9.5)
        axis.grid(axis="x", visible=False)
    axis = axes[-1]
    share, n = column(yields, "yields"), column(yields, "repeats")
    gamma = column(yields, "cooperation")
    error = 1.96 * np.sqrt(share * (1 - share) / n)
    axis.fill_between(gamma, share - error, share + error, color="#0072B2", alpha=0.15, lw=0)
    axis.plot(gamma, share, "o-", color="#0072B2", lw=1.8, label="lets the other in ahead of it")
    axis.set_ylim(0, 1)
    axis.set_xlabel("cooperation factor of the one who could yield")
    axis.set_ylabel("share of scenes")
    lost = axis.twinx()
    lost.spines["right"].set_visible(True)
    lost.grid(False)
    lost.plot(gamma, column(yields, "speed_given_up"), "s--", color="#D55E00", ms=4, lw=1.2)
    lost.set_ylabel("speed it gives up, mean [m/s]", color="#D55E00")
    lost.set_ylim(0, max(0.2, 1.6 * np.nanmax(column(yields, "speed_given_up"))))
    axis.set_title("who yields (band: 95 %)", fontsize=9.5)
    axis.legend(loc="upper left")
    save(figure, out, "diversity",
         "Habits: the same random scenes under the three (box 25-75 %, whiskers 5-95 %, dot mean)")


def ramp_cases(rows, out):
    orders = [r for r in rows if "2_ahead_of_4" in r]
    figure, axes = plt.subplots(1, 2, figsize=(12.5, 4.4))
    figure.subplots_adjust(left=0.065, right=0.99, top=0.8, bottom=0.14, wspace=0.2)
    for name, color, text in (("case 1", HABITS["aggressive"], "2 aggressive, 4 conservative"),
                              ("case 2", HABITS["conservative"], "2 conservative, 4 aggressive")):
        mine = [r for r in orders if r["habits"] == name]
        usual = [r for r in mine if r["iterations"] == 3000]
        more = [r for r in mine if r["iterations"] != 3000]
        axes[0].plot(column(usual, "state"), column(usual, "2_ahead_of_4"), "o-", color=color,
                     lw=1.8, label=f"{name}: {text}")
        axes[0].plot(column(more, "state"), column(more, "2_ahead_of_4"), "D", color=color, ms=9,
                     mfc="white", label=f"{name}, 20,000 iterations")
    axes[0].set_ylim(-0.05, 1.05)
    axes[0].set_xlabel("initial state: 0 the authors' of case 1, 1 of case 2")
    axes[0].set_ylabel("share of runs with 2 ahead of 4")
    axes[0].set_title("who is ahead in the target lane")
    axes[0].legend(loc="best", fontsize=8.5)
    human = [r for r in rows if "case" in r]
    x = np.arange(len(human))
    axes[1].bar(x - 0.2, column(human, "2_in_lane"), 0.36, color="#0072B2", label="vehicle 2")
    axes[1].bar(x + 0.2, column(human, "4_in_lane"), 0.36, color="#E69F00", label="vehicle 4")
    axes[1].set_xticks(x, [r["case"].split(", ", 1)[1] for r in human])
    axes[1].set_ylabel("in the target lane after [s]")
    axes[1].set_title("case 3: what the human in the gap does")
    axes[1].grid(axis="x", visible=False)
    axes[1].legend(loc="upper left", fontsize=8.5)
    save(figure, out, "ramp-cases", "The ramp: order by habits, and a human who speeds up")


def recorded(rows, out):
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.2), sharey=True)
    figure.subplots_adjust(left=0.14, right=0.99, top=0.83, bottom=0.12, wspace=0.08)
    y = np.arange(len(rows))
    for axis, key, title, color in (
            (axes[0], "intentions_reached", "intentions reached [share]", "#0072B2"),
            (axes[1], "reached_time", "reached after [s]; the recorded: within 10 s", "#009E73"),
            (axes[2], "min_distance_worst", "smallest clearance, worst run [m]", "#E69F00")):
        axis.barh(y, column(rows, key), 0.6, color=color)
        axis.set_title(title, fontsize=9.5)
        axis.grid(axis="y", visible=False)
        for k, r in enumerate(rows):
            text = f"{r['contacts_caused']:.0f} caused" if key == "min_distance_worst" else ""
            axis.annotate(text, (number(r[key]), k), xytext=(4, -3), textcoords="offset points",
                          fontsize=8)
    axes[2].set_xlim(0, 1.25 * max(0.1, np.nanmax(column(rows, "min_distance_worst"))))
    axes[1].axvline(10.0, color=INK, lw=0.9, ls=":")
    axes[0].set_yticks(y, [r["scene"] for r in rows])
    axes[0].invert_yaxis()
    save(figure, out, "recorded", "Recorded US-101 traffic, humans replayed")


def runs(folder, out, names):
    plot = pathlib.Path(__file__).with_name("plot.py")
    for name in names:
        run = folder / f"{name}.jsonl"
        if run.exists():
            subprocess.run([sys.executable, plot, run, out / f"{name}.png"], check=True)


FIGURES = (freeway_table, pareto, beyond, diversity, ramp_cases, recorded)


def rows_of(path):
    document = read_json(path, "a result of verge-experiment")
    if not isinstance(document, dict) or not isinstance(document.get("rows"), list):
        raise BadInput(f"{path}:rows: are missing, expected a result of verge-experiment")
    return document["rows"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", nargs="?", default="out/experiments", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, help="folder of the figures")
    parser.add_argument("--no-runs", action="store_true", help="leaves the runs out")
    given = parser.parse_args()
    out = given.out or given.folder
    paths = {draw: given.folder / f"{draw.__name__.replace('_', '-')}.json" for draw in FIGURES}
    if not any(path.exists() for path in paths.values()):
        raise BadInput(f"{given.folder}:folder: holds no results, expected what verge-experiment "
                       "--out writes")
    out.mkdir(parents=True, exist_ok=True)
    style()
    for draw, path in paths.items():
        rows = rows_of(path) if path.exists() else []
        try:
            if rows:
                draw(rows, out)
        except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
            raise BadInput(f"{path}:rows: unexpected or missing {error}, expected a result of "
                           "verge-experiment") from None
    runs(given.folder, out, SHOWN)
    if not given.no_runs:
        scenes = sorted(path.stem for path in given.folder.glob("recorded-*.jsonl"))
        runs(given.folder, out, RUNS + scenes)


if __name__ == "__main__":
    sys.exit(told_in_one_line(main))
