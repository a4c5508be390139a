#!/usr/bin/env python3
"""The replay page, in a headless browser: it shows the content of the run file at any instant.

Positions, sentences and lights on the page are compared with the run file as Python reads it, for
runs of verge-sim and for runs made here. Without a browser (tools/setup --long installs one) only
the generation of the page is tested.
Usage: e2e_replay_html.py --bin DIR
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, os.path.join(ROOT, "tests", "support"))
import chromium  # noqa: E402

MAKER = os.path.join(ROOT, "tools", "replay_html.py")
MILLIMETRE = 0.00051  # [m] half of what the page rounds to
COLUMNS = ["t", "x", "y", "heading", "speed", "acceleration", "curvature", "jerk"]


# --- runs ---------------------------------------------------------------------------------------

def lane(number, y, left, right, length=400.0):
    return {"id": number, "centerline": [[0.0, y], [length, y]], "width": 3.75,
            "speed_limit": 30.0, "left": left, "right": right, "successors": []}


def vehicle(number, control, **more):
    return {"id": number, "control": control, "x": 0.0, "y": 0.0, "heading": 0.0, "speed": 10.0,
            "acceleration": 0.0, "length": 5.0, "width": 2.0, **more}


def head(vehicles, lanes, name="made here"):
    scenario = {"format": "verge-scenario/1", "name": name, "source": "this test",
                "road": {"lanes": lanes}, "vehicles": vehicles, "planner": {"seed": 1},
                "simulation": {"duration": 1.0}}
    return {"format": "verge-run/1", "scenario": scenario, "dt": 0.1}


def planned(number, x, say, status="planned"):
    """A plan as a vehicle hears it: without what stays at the roadside unit."""
    steps = [{"t0": 1.5 * k, "t1": 1.5 * k + 1.5, "action": "KS", "lane": 0, "s": None, "d": None,
              "v": 10.0, "brake_light": False, "turn_signal": "none", "say": f"{say} {k}"}
             for k in range(3)]
    points = [[0.1 * k, x + k, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0] for k in range(31)]
    return {"id": number, "status": status, "reason": "nothing was acceptable", "actions": steps,
            "trajectory": {"dt": 0.1, "columns": COLUMNS, "points": points},
            "cost": {"total": None}}


def plan_line(t, vehicles, predictions=()):
    return {"t": t, "plan": {"format": "verge-plan/1", "utime": 0, "digest": "0" * 16,
                             "search": {"iterations": 0, "nodes": 0, "reward": 0.0, "depth": 0,
                                        "complete": False},
                             "vehicles": vehicles, "predictions": list(predictions)}}


def unit_line(t, number, mode, reason="none", about=None, cycle=None):
    return {"t": t, "unit": {"id": number, "mode": mode, "reason": reason, "vehicle": about,
                             "cycle": cycle}}


def modes_run():
    """One vehicle that stands still, whose unit is in each mode for a second from 1 s on."""
    lines = lights_run()
    lines.append(lines[-1] | {"t": 5.9})
    return lines + [unit_line(1.0, 0, "following", cycle=8),
                    unit_line(2.0, 0, "departing", "contact", 4, 9),
                    unit_line(3.0, 0, "alone", "silent"),
                    unit_line(4.0, 0, "stopping", "no_position"), unit_line(5.0, 0, "none")]


def lights_run():
    """One vehicle that stands still: dark for 1 s, braking for 1 s, then left, then right."""
    def signs(t):
        return (1.0 <= t < 2.0, "left" if 2.0 <= t < 3.0 else "right" if t >= 3.0 else "none")
    ticks = [{"t": k / 10, "vehicles": [[0, 100.0, 0.0, 0.0, 0.0, 0.0, 0, "KS", *signs(k / 10)]]}
             for k in range(41)]
    return [head([vehicle(0, "controlled")], [lane(0, 0.0, None, None)]), *ticks]


def large_run():
    """Sixty vehicles for sixty seconds, a quarter of them planned, none at an even speed."""
    def row(k, t):
        x = 9.0 * k + 20.0 * t + 3.0 * math.sin(t + k)
        lights = (math.sin(t + k) > 0.8, "left" if k % 4 == 0 and t % 9.0 < 3.0 else "none")
        return [k, x, 3.75 * (k % 4) + 0.3 * math.sin(0.7 * t + k), 0.01 * math.cos(t),
                20.0 + 3.0 * math.cos(t + k), -3.0 * math.sin(t + k), k % 4,
                "KS" if k % 4 == 0 else None, *lights]
    lanes = [lane(k, 3.75 * k, k + 1 if k < 3 else None, k - 1 if k else None, 2000.0)
             for k in range(4)]
    lines = [head([vehicle(k, "human" if k % 4 else "controlled") for k in range(60)], lanes)]
    for tick in range(601):
        t = tick / 10
        lines.append({"t": t, "vehicles": [row(k, t) for k in range(60)]})
        if tick % 5 == 0:
            believed = [{"id": k, "points": [[m / 10, *row(k, t + m / 10)[1:4]] for m in range(31)]}
                        for k in range(60) if k % 4]
            plans = [planned(k, row(k, t)[1], f"vehicle {k} at {t}") for k in range(0, 60, 4)]
            lines.append(plan_line(t, plans, believed))
    return lines


def write(path, lines):
    with open(path, "w", encoding="utf-8") as out:
        out.writelines(json.dumps(line) + "\n" for line in lines)
    return path


def read(path):
    with open(path, encoding="utf-8") as source:
        return [json.loads(line) for line in source]


def simulated(program, scenario, folder):
    run = os.path.join(folder, f"{scenario}.jsonl")
    subprocess.run([program, os.path.join(ROOT, "apps", "scenarios", f"{scenario}.json"),
                    "--no-timing", "--out", run], check=True, stdout=subprocess.DEVNULL,
                   timeout=200)
    return run


def made(run, status=0):
    """The page of a run, and what its maker said."""
    page = os.path.splitext(run)[0] + ".html"
    done = subprocess.run([sys.executable, MAKER, run, page], capture_output=True, text=True,
                          timeout=200)
    assert done.returncode == status, f"{run}: exit {done.returncode}: {done.stderr}"
    assert done.stdout == "", done.stdout
    if status:
        assert done.stderr.count("\n") == 1 and run in done.stderr, repr(done.stderr)
        assert not os.path.exists(page), "half a page beside an error"
    return page, done.stderr


# --- the maker ----------------------------------------------------------------------------------

def bad_input_is_refused_with_one_line(folder):
    good = lights_run()
    row = [0, 1.0, 0.0, 0.0, 0.0, 0.0, 0, "KS", False, "none"]
    bad = {"empty": [], "not-a-run": [{"format": "verge-plan/1"}], "nobody": good[:1],
           "short-row": [*good, {"t": 9.0, "vehicles": [row[:7]]}],
           "stranger": [*good, {"t": 9.0, "vehicles": [[77, *row[1:]]]}],
           "not-finite": [*good, {"t": 9.0, "vehicles": [[0, math.nan, *row[2:]]]}],
           "no-mode": [*good, unit_line(1.0, 0, "sleeping")],
           "unit-of-a-stranger": [*good, unit_line(1.0, 77, "alone")],
           "no-road": [{"format": "verge-run/1", "scenario": {"name": "x"}}]}
    for name, lines in bad.items():
        made(write(os.path.join(folder, f"bad-{name}.jsonl"), lines), status=2)
    made(os.path.join(folder, "bad-missing.jsonl"), status=2)
    broken = os.path.join(folder, "bad-middle.jsonl")
    with open(broken, "w", encoding="utf-8") as out:
        out.write(json.dumps(good[0]) + '\n{"t": 0.0, "veh\n' + json.dumps(good[1]) + "\n")
    made(broken, status=2)


def a_run_cut_short_replays_to_its_last_whole_line(folder):
    text = "".join(json.dumps(line) + "\n" for line in lights_run())
    path = os.path.join(folder, "short.jsonl")
    with open(path, "w", encoding="utf-8") as out:
        out.write(text[:-30])
    page, said = made(path)
    assert "cut off" in said and said.count("\n") == 1, said
    return page


# --- the page -----------------------------------------------------------------------------------

def state(browser, number):
    return browser.value(f"verge.vehicle({number})")


def seek(browser, t):
    browser.value(f"verge.seek({t})")
    browser.settle()


def pixels(browser):
    return browser.value("document.getElementById('road').toDataURL()")


def near(browser, number, red, green, blue, side=0):
    """How many of the canvas's pixels around a vehicle are of about that colour; with side 1 or
    -1 only those to its left or right (its heading is the screen's right)."""
    return browser.value(f"""(() => {{
      const canvas = document.getElementById("road"), [x, y] = verge.screen({number});
      const k = canvas.width / canvas.clientWidth, reach = Math.ceil(6 * verge.camera.scale);
      const copy = new OffscreenCanvas(canvas.width, canvas.height)
        .getContext("2d", {{ willReadFrequently: true }});
      copy.drawImage(canvas, 0, 0);
      const image = copy.getImageData(Math.round(k * (x - reach)),
        Math.round(k * (y - reach)), Math.round(2 * k * reach), Math.round(2 * k * reach));
      let count = 0;
      for (let i = 0; i < image.data.length; i += 4) {{
        const row = Math.floor(i / 4 / image.width) - image.height / 2;
        const [r, g, b] = image.data.slice(i, i + 3);
        if (row * {side} <= 0 && Math.abs(r - {red}) + Math.abs(g - {green})
          + Math.abs(b - {blue}) < 40) ++count;
      }}
      return count; }})()""")


def positions_are_those_of_the_run(browser, run):
    ticks = [line for line in read(run) if "vehicles" in line]
    for line in ticks[::23] + ticks[-1:]:
        states = browser.value(f"verge.seek({line['t']}), verge.ids.map(id => verge.vehicle(id))")
        for number, x, y, heading, speed, _, on, action, brake, turn in line["vehicles"]:
            shown = states[sorted(row[0] for row in ticks[0]["vehicles"]).index(number)]
            assert abs(shown["x"] - x) < MILLIMETRE and abs(shown["y"] - y) < MILLIMETRE, \
                f"t {line['t']}, vehicle {number}: ({x}, {y}) is shown as {shown}"
            apart = math.remainder(shown["heading"] - heading, 2 * math.pi)
            assert abs(apart) < 1e-4 and abs(shown["speed"] - speed) < MILLIMETRE
            assert [shown[k] for k in ("lane", "action", "brake", "turn")] == \
                [on, action, brake, turn]
    a, b = ticks[10], ticks[11]
    browser.value(f"verge.seek({0.5 * (a['t'] + b['t'])})")
    for before, after in zip(a["vehicles"], b["vehicles"]):
        assert abs(state(browser, before[0])["x"] - 0.5 * (before[1] + after[1])) < 2 * MILLIMETRE


def sentences_are_those_of_the_plan(browser, run):
    plans = [line for line in read(run) if "plan" in line]
    for line in plans[::9]:
        seek(browser, line["t"] + 0.2)
        shown = browser.value("[...document.querySelectorAll('#vehicles li')].map(row => ["
                              "row.querySelector('button').textContent,"
                              "row.querySelector('.say').textContent,"
                              "[...row.querySelectorAll('.strip span')].map(s => s.textContent),"
                              "row.querySelector('.strip .now').textContent])")
        wanted = {str(v["id"]): v["actions"] for v in line["plan"]["vehicles"]}
        assert len(shown) == len(wanted) > 0
        for number, say, actions, now in shown:
            assert actions == [step["action"] for step in wanted[number]]
            assert now == wanted[number][0]["action"]
            assert say.startswith(wanted[number][0]["say"]), say
        search = line["plan"]["search"]
        text = browser.value("document.getElementById('search').textContent")
        assert f"Nodes{search['nodes']}" in text, text
        assert f"Reward{search['reward']:.3f}" in text, text


def scrubbing_moves_the_vehicles(browser):
    """By the slider itself, as a hand does: its keys, and its input event."""
    seek(browser, 0.0)
    before, picture = state(browser, 0), pixels(browser)
    browser.value("(() => { const s = document.getElementById('scrub'); s.value = 8;"
                  "s.dispatchEvent(new Event('input')); })()")
    browser.settle()
    after = state(browser, 0)
    assert abs(browser.value("verge.time") - 8.0) < 1e-6
    assert math.hypot(after["x"] - before["x"], after["y"] - before["y"]) > 20.0
    assert pixels(browser) != picture
    assert "8.0" in browser.value("document.getElementById('clock').textContent")
    seek(browser, 0.0)
    assert pixels(browser) == picture, "the same moment looks different after scrubbing back"


def vehicles_are_drawn_where_they_are(browser):
    """The first planned vehicle's own blue is under it, and gone from there once it has left."""
    browser.value("verge.setCamera('whole')")
    for t in (0.0, 5.0, 11.0):
        seek(browser, t)
        assert near(browser, 0, 0x00, 0x72, 0xB2) > 20, f"vehicle 0 is not drawn at t {t}"
    browser.value("verge.setCamera('auto')")


def playing_advances_time(browser):
    seek(browser, 0.0)
    assert not browser.value("verge.playing")
    browser.key(" ", "Space")
    browser.until("verge.time > 0.3")
    assert browser.value("verge.playing")
    assert browser.value("document.getElementById('play').getAttribute('aria-label')") == "Pause"
    browser.key(" ", "Space")
    held = browser.value("verge.time")
    browser.settle()
    assert not browser.value("verge.playing") and browser.value("verge.time") == held
    browser.value("document.getElementById('speed').value = '8';"
                  "document.getElementById('speed').dispatchEvent(new Event('change'));"
                  "document.getElementById('play').click()")
    browser.until("!verge.playing")
    assert browser.value("verge.time === verge.end"), "it stopped before the end"
    browser.value("verge.play()")
    browser.settle()
    assert browser.value("verge.time < verge.end"), "playing at the end does not begin again"
    browser.value("verge.pause()")
    browser.value("verge.setSpeed(1)")


def arrows_step_one_tick(browser):
    seek(browser, 4.0)
    for key, shift, wanted in (("ArrowRight", False, 4.1), ("ArrowRight", False, 4.2),
                               ("ArrowLeft", False, 4.1), ("ArrowRight", True, 4.5),
                               ("ArrowLeft", True, 4.0), ("End", False, 20.0),
                               ("ArrowRight", False, 20.0), ("Home", False, 0.0)):
        browser.key(key, shift=shift)
        assert abs(browser.value("verge.time") - wanted) < 1e-6, (key, browser.value("verge.time"))


def a_click_follows_and_wheel_and_drag_move_the_camera(browser):
    seek(browser, 3.0)
    place = "(() => { const r = document.getElementById('road').getBoundingClientRect();" \
            "const [x, y] = verge.screen(3);" \
            "return [r.left + x, r.top + y, r.width, r.height]; })()"
    browser.click(*browser.value(place)[:2])
    assert browser.value("verge.camera.mode") == "follow" and browser.value("verge.camera.id") == 3
    seek(browser, 9.0)
    x, y = browser.value("verge.screen(3)")
    _, _, wide, tall = browser.value(place)
    assert abs(x - wide / 2) < 1 and abs(y - tall / 2) < 1, "the camera lost whom it follows"
    assert browser.value("document.getElementById('following').textContent").startswith("Vehicle 3")
    scale = browser.value("verge.camera.scale")
    browser.mouse("mouseWheel", wide / 2, tall / 2, deltaX=0, deltaY=-300)
    browser.settle()
    browser.until(f"verge.camera.scale > {1.2 * scale}")
    browser.key("Escape")
    assert browser.value("verge.camera.mode") == "auto"
    x, y = browser.value("verge.screen(0)")
    browser.mouse("mousePressed", 300, 400, button="left", buttons=1, clickCount=1)
    for step in range(1, 6):
        browser.mouse("mouseMoved", 300 + 20 * step, 400 + 10 * step, button="left", buttons=1)
    browser.mouse("mouseReleased", 400, 450, button="left", buttons=0, clickCount=1)
    browser.settle()
    nx, ny = browser.value("verge.screen(0)")
    assert browser.value("verge.camera.mode") == "free"
    assert 60 < nx - x <= 101 and 30 < ny - y <= 51, (nx - x, ny - y)
    browser.value("verge.setCamera('auto')")


def lights_are_drawn(browser):
    browser.value("verge.setCamera('follow', 0)")
    red, amber = (0xFF, 0x15, 0x30), (0xFF, 0xAB, 0x00)
    wanted = {0.5: (False, False, False), 1.5: (True, False, False), 2.5: (False, True, False),
              3.5: (False, False, True)}
    for t, (brake, left, right) in wanted.items():
        seek(browser, t)
        lit = (near(browser, 0, *red), near(browser, 0, *amber, side=1),
               near(browser, 0, *amber, side=-1))
        assert [count > 8 for count in lit] == [brake, left, right], f"t {t}: {lit}"


def modes_of_units_are_shown(browser, folder):
    """In words, around the body, and as a band of the chart."""
    browser.open(made(write(os.path.join(folder, "modes.jsonl"), modes_run()))[0])
    wanted = {0.5: ("no trajectory yet", None), 1.5: ("follows the plan since 1.0 s", None),
              2.5: ("departs from the plan since 2.0 s: contact, vehicle 4", (0xD9, 0x65, 0x0A)),
              3.5: ("has no plan since 3.0 s: silent", (0x6A, 0x3D, 0x9A)),
              4.5: ("stops since 4.0 s: no position", (0xC8, 0x10, 0x2E)),
              5.5: ("is silent since 5.0 s", (0x26, 0x26, 0x2B))}
    colors = [color for _, color in wanted.values() if color]
    for t, (words, color) in wanted.items():
        seek(browser, t)
        text = browser.value("document.querySelector('.mode').textContent")
        assert text.endswith(words), f"t {t}: {text}"
        around = [near(browser, 0, *other) > 40 for other in colors]
        assert around == [other == color for other in colors], f"t {t}: {around}"
    for color in [(0x1F, 0x7A, 0x6B), *colors]:
        count = browser.value(f"""(() => {{
          const chart = document.getElementById("chart");
          const copy = new OffscreenCanvas(chart.width, chart.height)
            .getContext("2d", {{ willReadFrequently: true }});
          copy.drawImage(chart, 0, 0);
          const {{ data }} = copy.getImageData(0, 0, chart.width, chart.height);
          let count = 0;
          for (let i = 0; i < data.length; i += 4) {{
            if ({' && '.join(f'data[i + {k}] === {color[k]}' for k in range(3))}) ++count;
          }}
          return count; }})()""")
        assert count > 200, f"{color} in the chart: {count} pixels"
    legend = browser.value("document.getElementById('legend').textContent")
    assert "the on-vehicle unit departs from the plan" in legend, legend


def without_units_no_mode_is_shown(browser):
    assert browser.value("[...document.querySelectorAll('.mode')].every(p => p.hidden)")
    assert "unit" not in browser.value("document.getElementById('legend').textContent")
    assert browser.value("document.getElementById('modes-title').hidden")


def the_page_fits_small_windows(browser):
    """On a phone, a tablet and a desktop, the road and its controls are within the window."""
    for width, height in ((360, 740), (390, 844), (844, 390), (820, 1180), (1440, 900)):
        browser.size(width, height, touch=width < 900)
        browser.settle()
        assert browser.value("document.documentElement.scrollWidth") <= width, f"{width} wide"
        box = browser.value("(() => { const b = document.getElementById('play')"
                            ".getBoundingClientRect(); return [b.left, b.right]; })()")
        assert box[0] >= 0 and box[1] <= width
        tall = browser.value("document.getElementById('road').clientHeight")
        assert tall > 150 and browser.value("verge.camera.scale") > 0
        assert near(browser, 0, 0x00, 0x72, 0xB2) > 10, f"vehicle 0 not seen at {width}x{height}"
    browser.size(1280, 800)


def the_page_has_a_dark_scheme(browser):
    ground = []
    for dark in (False, True):
        browser.dark(dark)
        browser.settle()
        ground.append(browser.value(
            "(() => { const copy = new OffscreenCanvas(9, 9).getContext('2d');"
            "copy.drawImage(document.getElementById('road'), 0, 0);"
            "return copy.getImageData(3, 3, 1, 1).data[0]; })()"))
    browser.dark(False)
    assert ground[0] > 180 and ground[1] < 70, ground


def everything_has_a_name(browser):
    """Of what can be pressed or looked at, a screen reader says what it is."""
    nameless = browser.value("[...document.querySelectorAll('button, input, select, canvas')]"
                             ".filter(n => !(n.getAttribute('aria-label') || n.textContent).trim())"
                             ".map(n => n.outerHTML)")
    assert nameless == [], nameless


def names_are_text(browser, folder):
    name = '</script><script>window.broken = 1</script><!-- <b>"&amp;'
    lines = lights_run()
    lines[0]["scenario"]["name"] = lines[0]["scenario"]["source"] = name
    lines.insert(2, plan_line(0.0, [planned(0, 100.0, name)]))
    lines.append(plan_line(3.0, [planned(0, 100.0, name, status="fallback")]))
    browser.open(made(write(os.path.join(folder, "names.jsonl"), lines))[0])
    assert browser.value("document.getElementById('name').textContent") == name
    assert browser.value("document.title").startswith(name)
    assert browser.value("window.broken === undefined")
    assert name in browser.value("document.querySelector('.say').textContent")
    seek(browser, 3.5)
    assert "Fallback: nothing was acceptable" in browser.value(
        "document.querySelector('.say').textContent")


def large_runs_replay(browser, folder):
    run = write(os.path.join(folder, "large.jsonl"), large_run())
    page, _ = made(run)
    assert os.path.getsize(page) < 0.15 * os.path.getsize(run), os.path.getsize(page)
    browser.open(page)
    positions_are_those_of_the_run(browser, run)
    for t in (0.0, 31.4, 60.0):
        seek(browser, t)
        assert browser.value("document.querySelectorAll('#vehicles li').length") == 15


def leaving_and_coming_back(browser, folder):
    """A vehicle that is away for a while is neither drawn nor guessed meanwhile."""
    lines = [head([vehicle(0, "controlled"), vehicle(1, "human")], [lane(0, 0.0, None, None)])]
    for k in range(31):
        rows = [[0, 10.0 + k, 0.0, 0.0, 10.0, 0.0, 0, None, False, "none"]]
        if not 10 <= k < 20:
            rows.append([1, 50.0 + k, 0.0, 0.0, 10.0, 0.0, 0, None, False, "none"])
        lines.append({"t": k / 10, "vehicles": rows})
    browser.open(made(write(os.path.join(folder, "away.jsonl"), lines))[0])
    for t, there in ((0.5, True), (1.5, False), (2.5, True)):
        seek(browser, t)
        assert (state(browser, 1) is not None) == there, t
    browser.value("verge.follow(1)")
    seek(browser, 1.5)
    assert "not in the scene" in browser.value("document.getElementById('following').textContent")


def in_the_browser(browser, run, page, short, folder):
    browser.size(1280, 800)
    browser.dark(False)
    browser.open(page)
    positions_are_those_of_the_run(browser, run)
    sentences_are_those_of_the_plan(browser, run)
    scrubbing_moves_the_vehicles(browser)
    vehicles_are_drawn_where_they_are(browser)
    playing_advances_time(browser)
    arrows_step_one_tick(browser)
    without_units_no_mode_is_shown(browser)
    a_click_follows_and_wheel_and_drag_move_the_camera(browser)
    everything_has_a_name(browser)
    the_page_fits_small_windows(browser)
    the_page_has_a_dark_scheme(browser)
    browser.open(page + "#t=7.5&follow=2")
    assert browser.value("verge.time") == 7.5 and browser.value("verge.camera.id") == 2
    browser.open(short)
    assert abs(browser.value("verge.end") - 3.9) < 1e-6
    lights_are_drawn(browser)
    modes_of_units_are_shown(browser, folder)
    names_are_text(browser, folder)
    leaving_and_coming_back(browser, folder)
    large_runs_replay(browser, folder)
    assert browser.complaints == [], browser.complaints
    strangers = [url for url in browser.requests
                 if not url.startswith((f"file://{folder}", "data:", "about:"))]
    assert strangers == [], f"the page asked for {strangers}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options, _ = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        bad_input_is_refused_with_one_line(folder)
        short = a_run_cut_short_replays_to_its_last_whole_line(folder)
        run = simulated(os.path.join(options.bin, "verge-sim"), "ramp-case1", folder)
        page, _ = made(run)
        if not chromium.program():
            print("SKIPPED: no headless browser here; tools/setup --long installs one")
            return 77
        with chromium.Chromium() as browser:
            in_the_browser(browser, run, page, short, folder)
    print("the replay page shows what its run file says")
    return 0


if __name__ == "__main__":
    sys.exit(main())
