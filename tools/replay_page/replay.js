// Replays a run of verge: the road from above, the plans of each vehicle, and the results.
//
// Reads top-down: the run is unpacked, the state at any moment is a function of time, and drawing
// is a function of that state and the camera. Nothing is kept between two moments but the time,
// the camera and whether it plays, so scrubbing shows what playing shows. Lengths are metres and
// times seconds of the run; x and y are the map's, y up; px and py are the canvas's, y down.
"use strict";

const run = JSON.parse(document.getElementById("run").textContent);
const byId = (id) => document.getElementById(id);
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const dark = matchMedia("(prefers-color-scheme: dark)");

// The palette of Okabe and Ito first, as in the figures: for colour-blind people, and in grey.
const COLORS = ["#0072B2", "#D55E00", "#009E73", "#C0609B", "#A67608", "#2E9AD8", "#7B3294",
  "#8C510A", "#C51B7D", "#1B7837", "#4D4D9F", "#C66A0C", "#35978F", "#B2182B", "#4A9A50",
  "#2166AC"];
const ACTIONS = { KS: "keep speed", AC: "accelerate", DC: "decelerate", LCL: "change left",
  LCR: "change right" };
const MODES = { following: "follows the plan", departing: "departs from the plan",
  alone: "has no plan", stopping: "stops", none: "is silent" }; // of an on-vehicle unit
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const TRAIL_S = 2.5;        // [s] of path drawn behind a vehicle
const LOOK_AHEAD_S = 1.5;   // [s] of driving the automatic camera keeps in view
const SCALES = [0.4, 60];   // [px/m] least and most that zooming gives
const AUTO_SCALES = [2.8, 11]; // [px/m] what the automatic camera keeps within
const BLINK_HZ = 1.5;       // a turn signal's usual rate

// --- the run, unpacked --------------------------------------------------------------------------

// Undoes the second differences of replay_html.py.
function unpacked(packed, unit) {
  const values = new Float64Array(packed.length);
  let value = 0, step = 0;
  packed.forEach((number, i) => {
    if (i > 0) step += number;
    value = i > 0 ? value + step : number;
    values[i] = value * unit;
  });
  return values;
}

function unpackPart(part) {
  const found = { first: part.first, count: part.count, signs: [] };
  for (const name of ["x", "y", "speed", "acceleration"]) found[name] = unpacked(part[name], 1e-3);
  found.heading = unpacked(part.heading, 1e-4);
  part.signs.forEach(([row, lane, action, brake, turn], i) => {
    const end = i + 1 < part.signs.length ? part.signs[i + 1][0] : part.count;
    const sign = { lane, action, brake, turn };
    for (let k = row; k < end; ++k) found.signs.push(sign);
  });
  return found;
}

function unpackPath(path) {
  path.x = unpacked(path.x, 1e-3);
  path.y = unpacked(path.y, 1e-3);
  if (path.speed) path.speed = unpacked(path.speed, 1e-3);
}

const times = unpacked(run.times, 1e-3);
const START = times[0], END = times[times.length - 1];
const TICK = times.length > 1 ? times[1] - times[0] : 0.1;
for (const vehicle of run.vehicles) vehicle.parts = vehicle.parts.map(unpackPart);
for (const plan of run.plans) {
  plan.vehicles.forEach(unpackPath);
  plan.predictions.forEach(unpackPath);
}
const vehicles = new Map(run.vehicles.map((v) => [v.id, v]));
const planned = run.vehicles.filter((v) => v.controlled);
const humans = run.vehicles.filter((v) => !v.controlled);
const leading = planned.length ? planned : run.vehicles; // kept in view by the camera
planned.forEach((v, i) => { v.color = COLORS[i % COLORS.length]; });
const onBoard = planned.some((v) => v.modes.length); // vehicles have on-vehicle units

// --- the state at a moment ----------------------------------------------------------------------

// The last index whose value is not above t; 0 if all values are above t.
function lastBefore(count, valueAt, t) {
  let low = 0, high = count - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (valueAt(middle) <= t + 1e-6) low = middle; else high = middle - 1;
  }
  return low;
}

const tickAt = (t) => lastBefore(times.length, (i) => times[i], t);

// Where a vehicle is at t and what it shows; null while it is not in the scene.
function stateOf(vehicle, t) {
  const tick = tickAt(t);
  const part = vehicle.parts.find((p) => tick >= p.first && tick < p.first + p.count);
  if (!part) return null;
  const a = tick - part.first, b = Math.min(a + 1, part.count - 1);
  const span = tick + 1 < times.length ? times[tick + 1] - times[tick] : 1;
  const share = Math.min(1, Math.max(0, (t - times[tick]) / span));
  const between = (name) => part[name][a] + share * (part[name][b] - part[name][a]);
  return { ...part.signs[a], x: between("x"), y: between("y"), heading: between("heading"),
    speed: between("speed"), acceleration: between("acceleration") };
}

// The plan that is valid at t; null before the first.
function planAt(t) {
  if (!run.plans.length || run.plans[0].t > t + 1e-6) return null;
  return run.plans[lastBefore(run.plans.length, (i) => run.plans[i].t, t)];
}

// What the on-vehicle unit of a vehicle does at t; null before its first trajectory.
function modeAt(vehicle, t) {
  const known = vehicle.modes;
  if (!known.length || known[0][0] > t + 1e-6) return null;
  const [since, mode, reason, about, cycle] =
    known[lastBefore(known.length, (i) => known[i][0], t)];
  return { since, mode, reason, vehicle: about, cycle };
}

// A planned or predicted path from t on, as [[x, y], ...], beginning at the vehicle itself.
function pathAhead(path, since, t, state) {
  const ahead = [[state.x, state.y]];
  for (let i = 0; i < path.x.length; ++i) {
    if (since + i * path.dt > t + 1e-6) ahead.push([path.x[i], path.y[i]]);
  }
  return ahead;
}

// --- what is shown ------------------------------------------------------------------------------

const now = { t: START, playing: false, speed: 1 };
const camera = { mode: "auto", id: null, zoom: 1, x: 0, y: 0, scale: 4, angle: 0 };
const road = byId("road"), chart = byId("chart"), rewards = byId("rewards");
let palette = {}, dirty = true;

function readPalette() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["page", "card", "ink", "soft", "line", "ground", "asphalt", "paint", "edge",
    "mark", "human", "human-ink", "glass", "bad", "ks", "ac", "dc", "lcl", "lcr", "on-action",
    ...Object.keys(MODES)]) {
    palette[name] = style.getPropertyValue(`--${name}`).trim();
  }
}

// A vehicle's colour; lighter on the dark page, for contrast.
function colorOf(vehicle) {
  if (!vehicle.controlled) return palette.human;
  if (!dark.matches) return vehicle.color;
  const part = (at) => parseInt(vehicle.color.slice(at, at + 2), 16);
  return `rgb(${[1, 3, 5].map((at) => Math.round(part(at) * 0.72 + 255 * 0.28)).join(",")})`;
}

// Fits a canvas to its box and the screen's pixels; drawing is then in CSS pixels.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height, ratio };
}

// --- the camera ---------------------------------------------------------------------------------

// The map is turned so that a straight road lies level, or upright where the view is upright.
function viewAngle() {
  const upright = road.clientHeight > 0.85 * road.clientWidth;
  return upright && run.direction !== null ? run.direction - Math.PI / 2 : run.turn;
}

// The box around points in the turned map: {u, v} its middle, {wide, tall} its size.
function boxOf(points, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  let u0 = Infinity, u1 = -Infinity, v0 = Infinity, v1 = -Infinity;
  for (const [x, y] of points) {
    const u = c * x + s * y, v = c * y - s * x;
    u0 = Math.min(u0, u); u1 = Math.max(u1, u);
    v0 = Math.min(v0, v); v1 = Math.max(v1, v);
  }
  return { u: 0.5 * (u0 + u1), v: 0.5 * (v0 + v1), wide: u1 - u0, tall: v1 - v0 };
}

// Where the planned vehicles are at t and will soon be.
function mindedPoints(t) {
  const points = [];
  for (const vehicle of leading) {
    const state = stateOf(vehicle, t);
    if (!state) continue;
    const reach = LOOK_AHEAD_S * state.speed;
    points.push([state.x, state.y], [state.x + reach * Math.cos(state.heading),
      state.y + reach * Math.sin(state.heading)]);
  }
  return points;
}

// The automatic camera shows the weighted mean of the boxes around t; boxes near t weigh more. So
// it moves smoothly, also when one box jumps because a vehicle leaves.
function autoView(t, angle, width, height) {
  const sum = { u: 0, v: 0, wide: 0, tall: 0 };
  let weight = 0;
  for (let k = -6; k <= 6; ++k) {
    const points = mindedPoints(Math.min(END, Math.max(START, t + 0.4 * k)));
    if (!points.length) continue;
    const box = boxOf(points, angle), own = 7 - Math.abs(k);
    for (const name of Object.keys(sum)) sum[name] += own * box[name];
    weight += own;
  }
  if (!weight) return null;
  const u = sum.u / weight, v = sum.v / weight, c = Math.cos(angle), s = Math.sin(angle);
  const fit = Math.min(width / (sum.wide / weight + 24), height / (sum.tall / weight + 24));
  return { x: c * u - s * v, y: s * u + c * v,
    scale: Math.min(AUTO_SCALES[1], Math.max(AUTO_SCALES[0], fit)) };
}

function wholeView(angle, width, height) {
  const points = [];
  for (const vehicle of leading) {
    for (const part of vehicle.parts) {
      for (let i = 0; i < part.count; i += 5) points.push([part.x[i], part.y[i]]);
      points.push([part.x[part.count - 1], part.y[part.count - 1]]);
    }
  }
  const box = boxOf(points, angle), c = Math.cos(angle), s = Math.sin(angle);
  return { x: c * box.u - s * box.v, y: s * box.u + c * box.v,
    scale: Math.min(AUTO_SCALES[1], width / (box.wide + 30), height / (box.tall + 24)) };
}

function aimCamera(width, height) {
  camera.angle = viewAngle();
  if (camera.mode === "free") return;
  if (camera.mode === "whole") {
    Object.assign(camera, wholeView(camera.angle, width, height));
    return;
  }
  const view = autoView(now.t, camera.angle, width, height);
  const followed = camera.mode === "follow" && stateOf(vehicles.get(camera.id), now.t);
  if (followed) {
    Object.assign(camera, { x: followed.x, y: followed.y, scale: limited(7 * camera.zoom) });
  } else if (view && camera.mode === "auto") {
    Object.assign(camera, { x: view.x, y: view.y, scale: limited(view.scale * camera.zoom) });
  }
}

const limited = (scale) => Math.min(SCALES[1], Math.max(SCALES[0], scale));

function toScreen(x, y) {
  const c = Math.cos(camera.angle), s = Math.sin(camera.angle), k = camera.scale;
  const dx = x - camera.x, dy = y - camera.y;
  return [road.clientWidth / 2 + k * (c * dx + s * dy),
    road.clientHeight / 2 - k * (c * dy - s * dx)];
}

function toMap(px, py) {
  const c = Math.cos(camera.angle), s = Math.sin(camera.angle), k = camera.scale;
  const u = (px - road.clientWidth / 2) / k, v = (road.clientHeight / 2 - py) / k;
  return [camera.x + c * u - s * v, camera.y + s * u + c * v];
}

function setCamera(mode, id = null) {
  camera.mode = mode;
  camera.id = id;
  camera.zoom = 1;
  dirty = true;
}

// Zooms by a factor, around the point under the pointer, unless the camera follows a vehicle.
function zoomBy(factor, px = road.clientWidth / 2, py = road.clientHeight / 2) {
  if (camera.mode === "auto" || camera.mode === "follow") {
    camera.zoom *= limited(camera.scale * factor) / camera.scale;
  } else {
    const [x, y] = toMap(px, py);
    camera.mode = "free";
    camera.scale = limited(camera.scale * factor);
    const [nx, ny] = toMap(px, py);
    camera.x += x - nx;
    camera.y += y - ny;
  }
  dirty = true;
}

function panBy(dpx, dpy) {
  const [x0, y0] = toMap(0, 0), [x1, y1] = toMap(dpx, dpy);
  camera.mode = "free";
  camera.id = null;
  camera.x -= x1 - x0;
  camera.y -= y1 - y0;
  dirty = true;
}

// --- drawing the road ---------------------------------------------------------------------------

function pathOf(lines, closed) {
  const path = new Path2D();
  for (const [xs, ys] of lines) {
    const x = unpacked(xs, 1e-3), y = unpacked(ys, 1e-3);
    x.forEach((_, i) => { if (i) path.lineTo(x[i], y[i]); else path.moveTo(x[i], y[i]); });
    if (closed) path.closePath();
  }
  return path;
}

const painted = { areas: run.road.areas.map((line) => pathOf([line], true)),
  dashed: pathOf(run.road.dashed, false), solid: pathOf(run.road.solid, false) };
const arrow = new Path2D("M-2.2 -.09H.5V-.5L2.2 0L.5 .5V.09H-2.2Z");

// Lengths are metres of the map from here on, until the pen is restored.
function mapPen(pen, width, height) {
  const c = Math.cos(camera.angle), s = Math.sin(camera.angle), k = camera.scale;
  pen.translate(width / 2, height / 2);
  pen.transform(k * c, k * s, k * s, -k * c, 0, 0);
  pen.translate(-camera.x, -camera.y);
}

function drawRoad(pen) {
  const hair = 1 / camera.scale; // one pixel [m]
  pen.fillStyle = pen.strokeStyle = palette.asphalt;
  pen.lineWidth = hair;
  for (const area of painted.areas) { pen.fill(area); pen.stroke(area); }
  pen.fillStyle = palette.mark;
  if (camera.scale > 2.5) run.road.arrows.forEach((place) => drawArrow(pen, place));
  pen.strokeStyle = palette.paint;
  pen.lineWidth = Math.max(0.16, 1.2 * hair);
  pen.setLineDash([3, 4]);
  pen.stroke(painted.dashed);
  pen.setLineDash([]);
  pen.strokeStyle = palette.edge;
  pen.lineWidth = Math.max(0.16, 1.4 * hair);
  pen.stroke(painted.solid);
}

function drawArrow(pen, [x, y, heading, lane]) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(heading);
  pen.fill(arrow);
  pen.translate(-3.6, 0); // the lane's number stands before its arrow, upright on the screen
  pen.rotate(-heading + camera.angle);
  pen.scale(1, -1);
  pen.font = "600 1.7px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(lane, 0, 0.1);
  pen.restore();
}

// --- drawing vehicles ---------------------------------------------------------------------------

function strokePoints(pen, points) {
  if (points.length < 2) return;
  pen.beginPath();
  points.forEach(([x, y], i) => { if (i) pen.lineTo(x, y); else pen.moveTo(x, y); });
  pen.stroke();
}

function dot(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
}

function drawTrail(pen, vehicle) {
  const points = [];
  for (let t = Math.max(START, now.t - TRAIL_S); t < now.t; t += 0.25) {
    const state = stateOf(vehicle, t);
    if (state) points.push([state.x, state.y]);
  }
  const state = stateOf(vehicle, now.t);
  if (!state) return;
  points.push([state.x, state.y]);
  pen.globalAlpha = vehicle.controlled ? 0.3 : 0.25;
  pen.strokeStyle = colorOf(vehicle);
  pen.lineWidth = Math.max(0.5, 1.5 / camera.scale);
  strokePoints(pen, points);
  pen.globalAlpha = 1;
}

// The predicted path of an uncontrolled vehicle: faint, with a ring at its end.
function drawPrediction(pen, prediction, since) {
  const vehicle = vehicles.get(prediction.id), state = vehicle && stateOf(vehicle, now.t);
  if (!state) return;
  const points = pathAhead(prediction, since, now.t, state);
  pen.globalAlpha = 0.65;
  pen.strokeStyle = palette.human;
  pen.lineWidth = 1.5 / camera.scale;
  pen.setLineDash([4 / camera.scale, 4 / camera.scale]);
  strokePoints(pen, points);
  pen.setLineDash([]);
  const [x, y] = points[points.length - 1];
  pen.beginPath();
  pen.arc(x, y, 3 / camera.scale, 0, 2 * Math.PI);
  pen.stroke();
  pen.globalAlpha = 1;
}

// The trajectory that is driven, bold; then the places of the decision, a dot for each step.
function drawPlan(pen, plan, since) {
  const vehicle = vehicles.get(plan.id), state = vehicle && stateOf(vehicle, now.t);
  if (!state) return;
  const fallback = plan.status !== "planned";
  const ahead = pathAhead(plan, since, now.t, state);
  const later = plan.steps.filter((s) => s[7] && s[1] > plan.dt * plan.x.length)
    .map((s) => [s[7][0] * 1e-3, s[7][1] * 1e-3]);
  pen.save();
  pen.strokeStyle = pen.fillStyle = fallback ? palette.bad : colorOf(vehicle);
  pen.lineCap = pen.lineJoin = "round";
  pen.globalAlpha = 0.5;
  pen.lineWidth = 1.2 / camera.scale;
  pen.setLineDash([1 / camera.scale, 5 / camera.scale]);
  strokePoints(pen, [ahead[ahead.length - 1], ...later]);
  pen.setLineDash([]);
  for (const [x, y] of later) dot(pen, x, y, 2.6 / camera.scale);
  pen.globalAlpha = 0.85;
  pen.lineWidth = Math.max(0.42, 3 / camera.scale);
  if (fallback) pen.setLineDash([2, 1]);
  strokePoints(pen, ahead);
  pen.setLineDash([]);
  dot(pen, ...ahead[ahead.length - 1], Math.max(0.5, 4 / camera.scale));
  pen.restore();
}

function box(pen, x, y, width, height, radius) {
  pen.beginPath();
  if (pen.roundRect) pen.roundRect(x, y, width, height, radius);
  else pen.rect(x, y, width, height);
}

function blinkOn() {
  return !now.playing || calm.matches || (now.t * BLINK_HZ) % 1 < 0.6;
}

// A body to scale in its own frame, x forward, y to its left.
function drawBody(pen, vehicle, state) {
  const half = 0.5 * vehicle.length, side = 0.5 * vehicle.width, hair = 1 / camera.scale;
  pen.save();
  pen.translate(state.x, state.y);
  pen.rotate(state.heading);
  box(pen, -half, -side, vehicle.length, vehicle.width, 0.26 * vehicle.width);
  pen.fillStyle = colorOf(vehicle);
  pen.fill();
  const followed = camera.mode === "follow" && camera.id === vehicle.id;
  pen.strokeStyle = followed ? palette.ink : palette.card;
  pen.lineWidth = (followed ? 2.5 : 1) * hair;
  pen.stroke();
  const likely = likelyOf(vehicle);
  if (likely) words.push(likely);
  const unit = modeAt(vehicle, now.t);
  if (unit && unit.mode !== "following") { // a second outline around the body
    const away = 3.5 * hair;
    box(pen, -half - away, -side - away, vehicle.length + 2 * away, vehicle.width + 2 * away,
      0.26 * vehicle.width + away);
    pen.strokeStyle = palette[unit.mode];
    pen.lineWidth = 3 * hair;
    pen.stroke();
  }
  if (camera.scale > 3.5) {
    pen.fillStyle = palette.glass;
    box(pen, 0.5 * half, -0.8 * side, 0.2 * half, 1.6 * side, 0.12);
    pen.fill();
    box(pen, -0.8 * half, -0.7 * side, 0.12 * half, 1.4 * side, 0.1);
    pen.fill();
  }
  drawLights(pen, state, half, side);
  pen.restore();
}

function drawLights(pen, state, half, side) {
  const lamp = Math.max(0.5, 3 / camera.scale);
  if (state.brake) {
    pen.fillStyle = "#ff1f3a55"; // the glow on the road
    box(pen, -half - 1.6 * lamp, -side, 2 * lamp, 2 * side, lamp);
    pen.fill();
    pen.fillStyle = "#ff1530";
    for (const y of [-side, side - 1.3 * lamp]) {
      box(pen, -half - 0.2 * lamp, y, lamp, 1.3 * lamp, 0.2 * lamp);
      pen.fill();
    }
  }
  const to = state.turn === "left" || state.turn === 1 ? 1
    : state.turn === "right" || state.turn === -1 ? -1 : 0;
  if (to && blinkOn()) {
    for (const x of [-half + 0.3 * lamp, half - 0.3 * lamp]) {
      pen.fillStyle = "#ffab0050";
      dot(pen, x, to * side, 1.5 * lamp);
      pen.fillStyle = "#ffab00";
      dot(pen, x, to * (side - 0.1 * lamp), 0.72 * lamp);
    }
  }
}

// What an uncontrolled vehicle is most likely about to do, if that is not to keep on.
function likelyOf(vehicle) {
  const plan = vehicle.controlled ? null : planAt(now.t);
  const own = plan && plan.predictions.find((p) => p.id === vehicle.id);
  if (!own || !own.hypotheses) return "";
  const [name, weight] = Object.entries(own.hypotheses).reduce((a, b) => (b[1] > a[1] ? b : a));
  return name === "keeps_on" ? "" : `${name.replace("_", " ")} ${Math.round(100 * weight)} %`;
}

// Numbers are on the bodies if there is space, or else beside them; actions are beside the bodies.
// taken: where labels are already; the number of an uncontrolled vehicle is left out there.
function drawLabel(pen, vehicle, state, taken) {
  const [px, py] = toScreen(state.x, state.y);
  const heading = camera.angle - state.heading; // as the canvas turns: clockwise
  const upright = Math.abs(Math.sin(heading)) > 0.7;
  const words = [];
  if (!numberBody(pen, vehicle, px, py, heading, upright)
    && (vehicle.controlled || camera.scale > 3)) words.push(String(vehicle.id));
  if (vehicle.controlled && state.action && state.action !== "KS") words.push(state.action);
  const unit = modeAt(vehicle, now.t);
  if (unit && unit.mode !== "following") words.push(unit.mode === "none" ? "silent" : unit.mode);
  if (!words.length) return;
  const text = words.join(" ");
  pen.font = `${vehicle.controlled ? 700 : 500} 11px system-ui, sans-serif`;
  const wide = pen.measureText(text).width;
  const [along, across] = upright ? [vehicle.width, vehicle.length]
    : [vehicle.length, vehicle.width];
  const half = 0.5 * camera.scale * (Math.abs(Math.sin(heading)) * along
    + Math.abs(Math.cos(heading)) * across);
  const places = [1, -1].map((side) => (upright ? [px + side * (half + 5 + 0.5 * wide), py]
    : [px, py - side * (half + 9)]));
  const free = places.find(([x, y]) => !taken.some((t) =>
    Math.abs(t.x - x) < 0.5 * (t.wide + wide) && Math.abs(t.y - y) < 12));
  if (!free && !vehicle.controlled) return;
  const [x, y] = free || places[0];
  taken.push({ x, y, wide });
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  pen.lineWidth = 3.5;
  pen.strokeStyle = palette.asphalt;
  pen.strokeText(text, x, y);
  pen.fillStyle = vehicle.controlled ? colorOf(vehicle) : palette.soft;
  pen.fillText(text, x, y);
}

// Writes a vehicle's number on its body, level or along it; false if there is no space.
function numberBody(pen, vehicle, px, py, heading, upright) {
  const face = (size) => `700 ${size}px system-ui, sans-serif`;
  const size = Math.min(12, 0.8 * vehicle.width * camera.scale);
  pen.font = face(size);
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  const wide = pen.measureText(vehicle.id).width;
  const level = upright && wide <= 0.85 * vehicle.width * camera.scale;
  const fit = level ? size : size * Math.min(1, 0.58 * vehicle.length * camera.scale / wide);
  if (fit < 7.5) return false;
  pen.font = face(fit);
  let turned = level ? 0 : Math.atan2(Math.sin(heading), Math.cos(heading));
  if (Math.abs(turned) > Math.PI / 2 + 0.01) turned += Math.PI;
  pen.save();
  pen.translate(px, py);
  pen.rotate(turned);
  pen.fillStyle = vehicle.controlled && !dark.matches ? "#fff" : palette["human-ink"];
  pen.fillText(vehicle.id, 0, 0.5);
  pen.restore();
  return true;
}

function drawScene() {
  const { pen, width, height } = fitted(road);
  aimCamera(width, height);
  pen.fillStyle = palette.ground;
  pen.fillRect(0, 0, width, height);
  pen.save();
  mapPen(pen, width, height);
  drawRoad(pen);
  const plan = planAt(now.t);
  const present = [...humans, ...planned].map((v) => [v, stateOf(v, now.t)]).filter(([, s]) => s);
  for (const [vehicle] of present) drawTrail(pen, vehicle);
  if (plan) {
    for (const prediction of plan.predictions) drawPrediction(pen, prediction, plan.t);
    for (const vehicle of plan.vehicles) drawPlan(pen, vehicle, plan.t);
  }
  for (const [vehicle, state] of present) drawBody(pen, vehicle, state);
  pen.restore();
  const taken = [];
  for (const [vehicle, state] of present.reverse()) drawLabel(pen, vehicle, state, taken);
  showScale();
}

function showScale() {
  const length = [200, 100, 50, 20, 10, 5, 2, 1].find((l) => l * camera.scale < 120) || 1;
  byId("scale").firstElementChild.style.width = `${length * camera.scale}px`;
  byId("scale").lastElementChild.textContent = `${length} m`;
}

// --- the chart: speeds, and the actions driven --------------------------------------------------

const CHART = { left: 34, right: 40, top: 8, speeds: 150, gap: 24, strip: 15,
  row: onBoard ? 26 : 18 };

// Ticks of an axis: a round step that gives at most so many.
function roundStep(span, most) {
  const raw = span / most, power = Math.pow(10, Math.floor(Math.log10(raw)));
  return power * [1, 2, 5, 10].find((k) => k * power >= raw);
}

function speedRange() {
  let low = Infinity, high = -Infinity;
  for (const vehicle of run.vehicles) {
    for (const part of vehicle.parts) {
      for (const speed of part.speed) { low = Math.min(low, speed); high = Math.max(high, speed); }
    }
  }
  const room = Math.max(1, 0.1 * (high - low));
  return [low > 3 ? Math.max(0, low - room) : 0, high + room];
}

const [SLOW, FAST] = speedRange();
const chartX = (t, width) => CHART.left + (width - CHART.left - CHART.right) * (t - START)
  / Math.max(1e-9, END - START);
const chartY = (speed) => CHART.top + CHART.speeds * (1 - (speed - SLOW) / (FAST - SLOW));

function drawGrid(pen, width, height) {
  pen.strokeStyle = palette.line;
  pen.fillStyle = palette.soft;
  pen.lineWidth = 1;
  pen.font = "11px system-ui, sans-serif";
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  const step = roundStep(FAST - SLOW, 5);
  for (let v = Math.ceil(SLOW / step) * step; v <= FAST; v += step) {
    strokePoints(pen, [[CHART.left, chartY(v)], [width - CHART.right, chartY(v)]]);
    pen.fillText(String(Number(v.toFixed(3))), CHART.left - 7, chartY(v));
  }
  pen.textAlign = "center";
  const pace = roundStep(END - START, Math.max(3, width / 80));
  for (let t = Math.ceil(START / pace) * pace; t <= END + 1e-6; t += pace) {
    const x = chartX(t, width);
    strokePoints(pen, [[x, CHART.top], [x, height - 18]]);
    pen.fillText(`${Number(t.toFixed(3))} s`, x, height - 8);
  }
}

function drawSpeeds(pen, width) {
  for (const vehicle of [...humans, ...planned]) {
    pen.strokeStyle = colorOf(vehicle);
    pen.globalAlpha = vehicle.controlled ? 1 : 0.4;
    pen.lineWidth = vehicle.controlled ? 2 : 1;
    for (const part of vehicle.parts) {
      const points = [];
      part.speed.forEach((v, i) => points.push([chartX(times[part.first + i], width), chartY(v)]));
      strokePoints(pen, points);
    }
  }
  pen.globalAlpha = 1;
  const ends = planned.map((v) => {
    const part = v.parts[v.parts.length - 1];
    return { vehicle: v, y: chartY(part.speed[part.count - 1]) };
  }).sort((a, b) => a.y - b.y);
  spread(ends, Math.min(13, CHART.speeds / Math.max(1, ends.length)));
  pen.font = "700 11px system-ui, sans-serif";
  pen.textAlign = "left";
  for (const end of ends) {
    pen.fillStyle = colorOf(end.vehicle);
    pen.fillText(end.vehicle.id, width - CHART.right + 7, end.y);
  }
}

// Moves sorted labels apart until each keeps the gap, within the panel.
function spread(labels, gap) {
  labels.forEach((label, i) => {
    label.y = Math.max(label.y, i ? labels[i - 1].y + gap : CHART.top);
  });
  for (let i = labels.length - 1; i >= 0; --i) {
    const below = i + 1 < labels.length ? labels[i + 1].y - gap : CHART.top + CHART.speeds;
    labels[i].y = Math.min(labels[i].y, below);
  }
}

// [first tick, last tick + 1, action] of each stretch a vehicle drove one action.
function segmentsOf(vehicle) {
  const found = [];
  for (const part of vehicle.parts) {
    let first = 0;
    for (let i = 1; i <= part.count; ++i) {
      if (i < part.count && part.signs[i].action === part.signs[first].action) continue;
      const action = part.signs[first].action;
      if (action) found.push([part.first + first, part.first + i, action]);
      first = i;
    }
  }
  return found;
}

function drawStrips(pen, width) {
  planned.forEach((vehicle, row) => {
    const y = CHART.top + CHART.speeds + CHART.gap + row * CHART.row;
    pen.textAlign = "right";
    pen.font = "700 11px system-ui, sans-serif";
    pen.fillStyle = colorOf(vehicle);
    pen.fillText(vehicle.id, CHART.left - 7, y + 7.5);
    pen.textAlign = "center";
    pen.font = "11px system-ui, sans-serif";
    for (const [a, b, action] of segmentsOf(vehicle)) {
      const x0 = chartX(times[a], width), x1 = chartX(times[Math.min(b, times.length - 1)], width);
      pen.fillStyle = palette[action.toLowerCase()] || palette.ks;
      box(pen, x0, y, Math.max(1, x1 - x0 - 1), CHART.strip, 3);
      pen.fill();
      pen.fillStyle = palette["on-action"];
      if (x1 - x0 > 28) pen.fillText(action, 0.5 * (x0 + x1), y + 8);
    }
    pen.fillStyle = palette.bad;
    for (const plan of run.plans) {
      if (!plan.vehicles.some((v) => v.id === vehicle.id && v.status !== "planned")) continue;
      dot(pen, chartX(plan.t, width), y + CHART.strip - 1, 3);
    }
    drawModes(pen, width, vehicle, y + CHART.strip + 2);
  });
}

// The mode of the on-vehicle unit over time, as a band.
function drawModes(pen, width, vehicle, y) {
  const last = vehicle.parts[vehicle.parts.length - 1];
  const end = times[last.first + last.count - 1];
  vehicle.modes.forEach(([t, mode], i) => {
    const to = i + 1 < vehicle.modes.length ? vehicle.modes[i + 1][0] : end;
    const x0 = chartX(t, width), x1 = chartX(to, width);
    pen.fillStyle = palette[mode];
    if (x1 > x0) pen.fillRect(x0, y, Math.max(1, x1 - x0), 5);
  });
}

const backdrop = document.createElement("canvas"); // the chart without what moves
let backdropKey = "";

function drawChart() {
  const { pen, width, height, ratio } = fitted(chart);
  const key = `${width} ${height} ${ratio} ${dark.matches}`;
  if (key !== backdropKey) {
    backdropKey = key;
    backdrop.width = chart.width;
    backdrop.height = chart.height;
    const still = backdrop.getContext("2d");
    still.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawGrid(still, width, height);
    drawSpeeds(still, width);
    drawStrips(still, width);
  }
  pen.clearRect(0, 0, width, height);
  pen.drawImage(backdrop, 0, 0, width, height);
  drawPlannedSpeeds(pen, width);
  const x = chartX(now.t, width);
  pen.strokeStyle = palette.ink;
  pen.lineWidth = 1.5;
  strokePoints(pen, [[x, CHART.top - 4], [x, height - 18]]);
  for (const vehicle of planned) {
    const state = stateOf(vehicle, now.t);
    if (!state) continue;
    pen.fillStyle = palette.card;
    dot(pen, x, chartY(state.speed), 5);
    pen.fillStyle = colorOf(vehicle);
    dot(pen, x, chartY(state.speed), 3.5);
  }
}

// The speeds of the current plan, dashed, over the speeds that were driven.
function drawPlannedSpeeds(pen, width) {
  const plan = planAt(now.t);
  if (!plan) return;
  pen.save();
  pen.beginPath();
  pen.rect(CHART.left, CHART.top, width - CHART.left - CHART.right, CHART.speeds);
  pen.clip();
  pen.setLineDash([3, 3]);
  pen.lineWidth = 1.5;
  pen.strokeStyle = palette.ink;
  pen.globalAlpha = 0.7;
  for (const vehicle of plan.vehicles) {
    strokePoints(pen, [...vehicle.speed].map((v, i) =>
      [chartX(plan.t + i * vehicle.dt, width), chartY(v)]));
  }
  pen.restore();
}

// --- the decision -------------------------------------------------------------------------------

function make(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

const setText = (node, text) => { if (node.textContent !== text) node.textContent = text; };

function button(vehicle) {
  const node = make("button", { textContent: vehicle.id, title: `Follow vehicle ${vehicle.id}` });
  node.setAttribute("aria-label", `Follow vehicle ${vehicle.id}`);
  node.addEventListener("click", () => follow(vehicle.id));
  vehicle.button = node;
  return node;
}

function buildVehicles() {
  for (const vehicle of planned) {
    const row = { turns: [-1, 1].map(() => make("i", { className: "turn" })),
      brake: make("i", { className: "brake" }), wish: make("span", { className: "wish" }),
      pace: make("span", { className: "pace" }), strip: make("div", { className: "strip" }),
      words: make("span", {}), lane: make("small", {}), plan: undefined,
      patch: make("i", {}), unit: make("span", {}) };
    row.say = make("p", { className: "say" }, row.words, row.lane);
    row.mode = make("p", { className: "mode", hidden: !vehicle.modes.length }, row.patch, row.unit);
    vehicle.row = row;
    const lamps = make("span", { className: "lamps" }, row.turns[1], row.brake, row.turns[0]);
    const who = make("div", { className: "who" }, button(vehicle), row.wish, lamps, row.pace);
    byId("vehicles").append(make("li", {}, who, row.strip, row.say, row.mode));
  }
  byId("humans-box").hidden = !humans.length;
  byId("humans").append(...humans.map(button));
  byId("modes-title").hidden = !onBoard;
  for (const [word, meaning] of Object.entries(ACTIONS)) addLegend(word, `${word} ${meaning}`);
  const modes = new Set(planned.flatMap((v) => v.modes.map(([, mode]) => mode)));
  for (const [mode, meaning] of Object.entries(MODES)) {
    if (modes.has(mode)) addLegend(mode, `the on-vehicle unit ${meaning}`);
  }
}

// name: of a colour of the style.
function addLegend(name, meaning) {
  const patch = make("i", {});
  patch.style.background = `var(--${name.toLowerCase()})`;
  byId("legend").append(make("span", {}, patch, meaning));
}

// The mode of the on-vehicle unit, since when and why.
function showMode(vehicle) {
  const row = vehicle.row, unit = modeAt(vehicle, now.t);
  row.patch.style.background = unit ? `var(--${unit.mode})` : "none";
  if (!unit) {
    setText(row.unit, "the on-vehicle unit has sent no trajectory yet");
    return;
  }
  const why = unit.reason === "none" ? "" : `: ${unit.reason.replace(/_/g, " ")}`;
  const about = unit.vehicle === null ? "" : `, vehicle ${unit.vehicle}`;
  setText(row.unit, `the unit ${MODES[unit.mode]} since ${unit.since.toFixed(1)} s${why}${about}`);
}

function showVehicle(vehicle, plan) {
  const row = vehicle.row, state = stateOf(vehicle, now.t);
  const own = plan && plan.vehicles.find((v) => v.id === vehicle.id);
  vehicle.button.style.background = colorOf(vehicle);
  vehicle.button.style.color = dark.matches ? palette["human-ink"] : "#fff";
  showWish(vehicle);
  setText(row.pace, state ? `${state.speed.toFixed(1)} m/s` : "left");
  const turn = state ? { left: 1, right: -1 }[state.turn] || 0 : 0;
  row.turns[0].classList.toggle("on", turn === -1 && blinkOn());
  row.turns[1].classList.toggle("on", turn === 1 && blinkOn());
  row.brake.classList.toggle("on", Boolean(state && state.brake));
  if (row.plan !== own) buildStrip(vehicle, own);
  showMode(vehicle);
  if (!own) {
    setText(row.words, "no plan yet");
    setText(row.lane, "");
    return;
  }
  const since = now.t - plan.t, last = own.steps[own.steps.length - 1];
  const current = Math.max(0, own.steps.findIndex((s) => since < s[1] - 1e-6));
  [...row.strip.children].forEach((cell, i) => cell.classList.toggle("now", i === current));
  row.marker.style.left = `${100 * Math.min(1, since / last[1])}%`;
  const fallback = own.status !== "planned";
  row.say.classList.toggle("fallback", fallback);
  const step = own.steps[current];
  setText(row.words, fallback ? `Fallback: ${own.reason || "no reason given"} `
    : `${run.words[step[6]]} `);
  setText(row.lane, step[3] === null ? "" : `lane ${step[3]}`);
}

// The target lane of the vehicle, and a tick mark after it is reached.
function showWish(vehicle) {
  const wish = vehicle.row.wish, finish = (run.metrics && run.metrics.finish_time) || {};
  const at = finish[vehicle.id];
  const there = typeof at === "number" && now.t >= at - 1e-6;
  const words = vehicle.target === null ? vehicle.habit
    : `${vehicle.habit}, to lane ${vehicle.target}`;
  const key = `${words}${there}`;
  if (wish.dataset.key === key) return;
  wish.dataset.key = key;
  wish.replaceChildren(words);
  if (there) wish.append(make("b", { textContent: ` ✓ ${at.toFixed(1)} s` }));
}

function buildStrip(vehicle, own) {
  const row = vehicle.row;
  row.plan = own;
  row.marker = make("i", {});
  row.strip.setAttribute("role", "img");
  row.strip.setAttribute("aria-label", own
    ? `planned actions: ${own.steps.map((s) => ACTIONS[s[2]] || s[2]).join(", ")}` : "no plan");
  row.strip.replaceChildren(...(own ? own.steps : []).map((step) => {
    const cell = make("span", { textContent: step[2],
      title: `${step[0]} to ${step[1]} s: ${run.words[step[6]]}` });
    cell.style.flexGrow = step[1] - step[0];
    cell.style.background = `var(--${step[2].toLowerCase()})`;
    return cell;
  }), ...(own ? [row.marker] : []));
}

function facts(list, entries) {
  list.replaceChildren(...entries.map(([name, value, kind, note]) => {
    const value_node = make("dd", { className: kind || "" }, value);
    if (note) value_node.append(make("small", { textContent: note }));
    return make("div", {}, make("dt", { textContent: name }), value_node);
  }));
}

const known = (value) => typeof value === "number";

// The search report. A run of verge-publish has none, because vehicles receive only their plans.
function searchFacts(search) {
  if (!search.iterations && !search.nodes) {
    return [["Search report", "stays at the roadside unit", "", ""]];
  }
  const entries = [["Reward", known(search.reward) ? search.reward.toFixed(3) : "unknown"]];
  if (known(search.bound)) entries.push(["Bound", search.bound.toFixed(3)]);
  if (known(search.gap)) entries.push(["Within", `${(100 * search.gap).toFixed(1)} %`]);
  entries.push(["Nodes", String(search.nodes)], ["Iterations", String(search.iterations)]);
  if (known(search.nodes_first)) entries.push(["Found at", String(search.nodes_first)]);
  entries.push(["Depth", String(search.depth)],
    ["Complete", search.complete ? "yes" : "no", search.complete ? "good" : ""]);
  return entries;
}

let shownPlan;

function showDecision() {
  const plan = planAt(now.t);
  if (plan !== shownPlan) {
    shownPlan = plan;
    const number = run.plans.indexOf(plan) + 1;
    setText(byId("cycle"), plan ? `cycle ${number} of ${run.plans.length}, made at `
      + `${plan.t.toFixed(1)} s` : "none yet");
    facts(byId("search"), plan ? searchFacts(plan.search) : []);
  }
  for (const vehicle of planned) showVehicle(vehicle, plan);
}

const rated = run.plans.filter((p) => p.search.nodes && known(p.search.reward));

// The reward of each cycle's decision, its upper bound, and the present cycle.
function drawRewards() {
  rewards.hidden = rated.length < 2;
  if (rewards.hidden) return;
  const { pen, width, height } = fitted(rewards);
  const values = rated.flatMap((p) => [p.search.reward, p.search.bound]).filter(known);
  const low = Math.min(...values), high = Math.max(...values), span = Math.max(0.05, high - low);
  const x = (t) => 2 + (width - 4) * (t - START) / Math.max(1e-9, END - START);
  const y = (value) => 5 + (height - 10) * (1 - (value - low) / span);
  const line = (value) => rated.filter((p) => known(value(p))).flatMap((p) => {
    const next = run.plans[run.plans.indexOf(p) + 1];
    return [[x(p.t), y(value(p))], [x(next ? next.t : END), y(value(p))]];
  });
  pen.clearRect(0, 0, width, height);
  pen.lineWidth = 1;
  pen.strokeStyle = palette.soft;
  pen.setLineDash([2, 2]);
  strokePoints(pen, line((p) => p.search.bound));
  pen.setLineDash([]);
  pen.lineWidth = 1.6;
  pen.strokeStyle = palette.ink;
  strokePoints(pen, line((p) => p.search.reward));
  pen.globalAlpha = 0.35;
  strokePoints(pen, [[x(now.t), 0], [x(now.t), height]]);
  pen.globalAlpha = 1;
}

// --- how it went --------------------------------------------------------------------------------

const plural = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
const METRICS = {
  finish_time: ["In the target lane, mean", "s", 2],
  reached_time: ["On its centreline, mean", "s", 2],
  min_distance: ["Closest bodies", "m", 2], min_center_gap: ["Smallest centre gap", "m", 2],
  min_ttc: ["Least time to collision", "s", 2],
  max_abs_acceleration: ["Largest acceleration", "m/s²", 2],
  max_abs_jerk: ["Largest jerk", "m/s³", 2], max_abs_curvature: ["Largest curvature", "1/m", 4],
  nodes_mean: ["Nodes a cycle, mean", "", 0], collisions_human: ["Contacts among humans", "", 0],
  off_road: ["Off the road at the end", "", 0], standing: ["Standing at the end", "", 0],
  reordered: ["Circles of standing vehicles", "", 0],
  unstuck: ["Vehicles that stood without a cause", "", 0],
  cycle_ms: ["Planning a cycle, median", "ms", 1],
};

function metricEntry(key, value) {
  const [name, unit, digits] = METRICS[key] || [key.replace(/_/g, " "), "", 3];
  const text = (v) => (!known(v) ? "none" : unit ? `${v.toFixed(digits)}\u00a0${unit}`
    : v.toFixed(digits));
  if (value === null || typeof value !== "object") {
    return [name, typeof value === "boolean" ? (value ? "yes" : "no") : text(value)];
  }
  const each = Object.entries(value).filter(([id]) => vehicles.has(Number(id)));
  const note = each.map(([id, v]) => `${id}:\u00a0${known(v) ? text(v) : "not\u00a0reached"}`);
  if (key === "cycle_ms") {
    return [name, text(value.p50), "", `at most ${text(value.max)}`];
  }
  return [name, text(value.mean), "", note.join(" · ")];
}

// The seconds in each mode, over all vehicles, and how often a unit changed its mode.
function unitsEntry(units) {
  const sums = {};
  for (const [mode, value] of Object.values(units).flatMap(Object.entries)) {
    sums[mode] = (sums[mode] || 0) + value;
  }
  const note = Object.keys(MODES).filter((mode) => sums[mode])
    .map((mode) => `${mode}:\u00a0${sums[mode].toFixed(1)}\u00a0s`);
  return ["Changes of on-vehicle units' modes", String(sums.changes), "", note.join(" · ")];
}

function showMetrics() {
  const metrics = run.metrics || {};
  const entries = [];
  if ("success" in metrics) {
    entries.push(["Success", metrics.success ? "yes" : "no", metrics.success ? "good" : "bad",
      "every intention reached, no contact, none off the road or standing without a cause"]);
  }
  for (const [key, name] of [["collisions", "Collisions"], ["fallbacks", "Fallbacks"]]) {
    if (key in metrics) {
      entries.push([name, String(metrics[key]), metrics[key] ? "bad" : "good"]);
    }
  }
  for (const [key, value] of Object.entries(metrics)) {
    const apart = ["success", "collisions", "fallbacks"].includes(key);
    const planner = ["nodes_mean", "reordered", "unstuck"].includes(key);
    const unheard = planner && !known(value); // a run of verge-publish
    if (!apart && !unheard) {
      entries.push(key === "units" ? unitsEntry(value) : metricEntry(key, value));
    }
  }
  facts(byId("metrics"), entries.length ? entries : [["Metrics", "the run was cut short"]]);
  setText(byId("source"), run.source);
}

function showSummary() {
  const metrics = run.metrics || {}, box = byId("summary");
  setText(byId("name"), run.name);
  const words = [`${plural(planned.length, "vehicle")} planned jointly`,
    plural(humans.length, "human driver"), `${(END - START).toFixed(1)} s`];
  box.append(words.join(" · "));
  const add = (text, good) => box.append(" · ",
    make("span", { className: good ? "good" : "bad", textContent: text }));
  if ("reached_time" in metrics) {
    const reached = Object.values(metrics.reached_time).every((time) => time !== null)
      || Object.keys(metrics.reached_time).length === 1; // the mean alone: nobody changes lanes
    add(reached ? "every intention reached" : "not every intention reached", reached);
  }
  if ("collisions" in metrics) {
    add(metrics.collisions ? plural(metrics.collisions, "collision") : "no collision",
      !metrics.collisions);
  }
  for (const [key, text] of [["off_road", "off the road"], ["standing", "standing"]]) {
    if (metrics[key]) {
      add(`${metrics[key]} ${text} at the end`, false);
    }
  }
}

// --- time ---------------------------------------------------------------------------------------

function seek(t) {
  now.t = Math.min(END, Math.max(START, t));
  dirty = true;
}

function play(on) {
  if (on && now.t >= END - 1e-6) now.t = START;
  now.playing = on;
  byId("play").classList.toggle("playing", on);
  byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
  dirty = true;
}

// To the next tick in a direction, or with cycle set to the next decision.
function stepBy(direction, cycle) {
  play(false);
  if (!cycle) {
    const tick = tickAt(now.t), on = Math.abs(times[tick] - now.t) < 1e-6;
    const to = direction > 0 ? tick + 1 : on ? tick - 1 : tick;
    seek(times[Math.min(times.length - 1, Math.max(0, to))]);
    return;
  }
  const cycles = run.plans.map((p) => p.t).filter((t) => direction * (t - now.t) > 1e-6);
  if (cycles.length) seek(direction > 0 ? cycles[0] : cycles[cycles.length - 1]);
}

function setSpeed(speed) {
  now.speed = speed;
  byId("speed").value = String(speed);
}

function showControls() {
  byId("scrub").value = String(now.t);
  byId("scrub").setAttribute("aria-valuetext", `${now.t.toFixed(1)} seconds`);
  byId("clock").innerHTML = `<b>${now.t.toFixed(1)}</b><span> / ${END.toFixed(1)}</span> s`;
  byId("auto").setAttribute("aria-pressed", String(camera.mode === "auto"));
  byId("whole").setAttribute("aria-pressed", String(camera.mode === "whole"));
  for (const vehicle of run.vehicles) {
    const followed = camera.mode === "follow" && camera.id === vehicle.id;
    if (vehicle.button) vehicle.button.setAttribute("aria-pressed", String(followed));
  }
  showFollowing();
}

function showFollowing() {
  const line = byId("following"), vehicle = vehicles.get(camera.id);
  line.hidden = camera.mode !== "follow";
  if (line.hidden) return;
  const state = stateOf(vehicle, now.t);
  const who = vehicle.controlled ? vehicle.habit : vehicle.recorded ? "recorded human" : "human";
  setText(line, `Vehicle ${vehicle.id}, ${who}: ${state ? `${state.speed.toFixed(1)} m/s, `
    + `${state.acceleration < 0 ? "−" : "+"}${Math.abs(state.acceleration).toFixed(2)} m/s²`
    : "not in the scene"}`);
}

let lastFrame = null;

function frame(stamp) {
  if (now.playing) {
    // A page that was hidden continues from the same instant.
    if (lastFrame !== null) seek(now.t + Math.min(0.25, (stamp - lastFrame) / 1000) * now.speed);
    if (now.t >= END) play(false);
    dirty = true;
  }
  lastFrame = now.playing ? stamp : null;
  if (dirty) {
    dirty = false;
    drawScene();
    drawChart();
    drawRewards();
    showDecision();
    showControls();
  }
  requestAnimationFrame(frame);
}

// --- hands --------------------------------------------------------------------------------------

function follow(id) {
  if (camera.mode === "follow" && camera.id === id) setCamera("auto"); else setCamera("follow", id);
}

function followNext() {
  const ids = run.vehicles.filter((v) => stateOf(v, now.t)).map((v) => v.id);
  const at = camera.mode === "follow" ? ids.indexOf(camera.id) : -1;
  if (ids.length) setCamera("follow", ids[(at + 1) % ids.length]);
}

// The vehicle under a point of the canvas, or the nearest within a finger's width.
function pick(px, py) {
  let best = null, least = 22;
  for (const vehicle of run.vehicles) {
    const state = stateOf(vehicle, now.t);
    if (!state) continue;
    const [x, y] = toScreen(state.x, state.y);
    const apart = Math.max(0, Math.hypot(x - px, y - py) - 0.4 * vehicle.length * camera.scale);
    if (apart < least) { least = apart; best = vehicle.id; }
  }
  return best;
}

function listenToPointers() {
  const down = new Map(); // pointer id -> where it is
  let travelled = 0;
  const place = (event) => [event.offsetX, event.offsetY];
  const apart = () => {
    const [a, b] = [...down.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  road.addEventListener("pointerdown", (event) => {
    road.setPointerCapture(event.pointerId);
    if (!down.size) travelled = 0;
    down.set(event.pointerId, place(event));
  });
  road.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    const from = down.get(event.pointerId), to = place(event);
    travelled += Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (down.size === 2) {
      const before = apart();
      down.set(event.pointerId, to);
      zoomBy(apart() / Math.max(1, before), ...to);
      travelled = Infinity;
    } else {
      down.set(event.pointerId, to);
      if (travelled > 6) panBy(to[0] - from[0], to[1] - from[1]);
    }
  });
  road.addEventListener("pointerup", (event) => {
    down.delete(event.pointerId);
    const id = travelled <= 6 ? pick(...place(event)) : null;
    if (id !== null) follow(id);
  });
  road.addEventListener("pointercancel", (event) => down.delete(event.pointerId));
  road.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomBy(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
  }, { passive: false });
}

// Going to a time by pointing at a canvas that has time along it.
function listenForTime(canvas, timeAt) {
  const go = (event) => { if (event.buttons & 1) seek(timeAt(event.offsetX, canvas.clientWidth)); };
  canvas.addEventListener("pointerdown", go);
  canvas.addEventListener("pointermove", go);
}

const KEYS = {
  " ": () => play(!now.playing), ArrowLeft: (e) => stepBy(-1, e.shiftKey),
  ArrowRight: (e) => stepBy(1, e.shiftKey), Home: () => seek(START), End: () => seek(END),
  "+": () => zoomBy(1.25), "=": () => zoomBy(1.25), "-": () => zoomBy(0.8),
  0: () => setCamera("auto"), 9: () => setCamera("whole"), f: followNext,
  Escape: () => setCamera("auto"),
  "[": () => setSpeed(SPEEDS[Math.max(0, SPEEDS.indexOf(now.speed) - 1)]),
  "]": () => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, SPEEDS.indexOf(now.speed) + 1)]),
};

function listenToKeys() {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = event.target;
    if (at.tagName === "SELECT") return;
    if (event.key === " " && at.tagName === "BUTTON") return; // presses that button
    const act = KEYS[event.key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
  // A button pressed by a pointer loses the focus, so that the space key plays.
  addEventListener("click", (event) => {
    const pressed = event.target.closest("button");
    if (pressed && event.detail > 0) pressed.blur();
  });
}

function listenToControls() {
  const on = (id, act) => byId(id).addEventListener("click", act);
  on("play", () => play(!now.playing));
  on("back", (event) => stepBy(-1, event.shiftKey));
  on("forth", (event) => stepBy(1, event.shiftKey));
  on("auto", () => setCamera("auto"));
  on("whole", () => setCamera("whole"));
  on("closer", () => zoomBy(1.4));
  on("wider", () => zoomBy(1 / 1.4));
  Object.assign(byId("scrub"), { min: START, max: END, step: TICK, value: START });
  byId("scrub").addEventListener("input", (event) => seek(Number(event.target.value)));
  byId("speed").addEventListener("change", (event) => setSpeed(Number(event.target.value)));
}

// replay.html#t=4.2&follow=2 opens at that moment.
function readAddress() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (wish.has("t") && Number.isFinite(Number(wish.get("t")))) seek(Number(wish.get("t")));
  if (vehicles.has(Number(wish.get("follow"))) && wish.has("follow")) {
    setCamera("follow", Number(wish.get("follow")));
  }
  if (wish.has("whole")) setCamera("whole");
}

function start() {
  readPalette();
  showSummary();
  showMetrics();
  buildVehicles();
  const rows = planned.length * CHART.row;
  chart.style.height = `${CHART.top + CHART.speeds + CHART.gap + rows + 22}px`;
  listenToPointers();
  listenToControls();
  listenToKeys();
  listenForTime(chart, (x, width) => START + (END - START) * (x - CHART.left)
    / (width - CHART.left - CHART.right));
  listenForTime(rewards, (x, width) => START + (END - START) * x / width);
  const again = () => { dirty = true; };
  dark.addEventListener("change", () => { readPalette(); again(); });
  const watcher = new ResizeObserver(again);
  for (const canvas of [road, chart, rewards]) watcher.observe(canvas);
  addEventListener("hashchange", readAddress);
  readAddress();
  requestAnimationFrame(frame);
}

// For programs that control the page, and for its test.
window.verge = {
  get time() { return now.t; },
  get playing() { return now.playing; },
  get camera() { return { ...camera }; },
  start: START, end: END, ids: run.vehicles.map((v) => v.id),
  seek, play: () => play(true), pause: () => play(false), setSpeed, follow, setCamera,
  mode: (id) => modeAt(vehicles.get(id), now.t),
  vehicle: (id) => (vehicles.has(id) ? stateOf(vehicles.get(id), now.t) : null),
  screen: (id) => { const s = stateOf(vehicles.get(id), now.t); return s && toScreen(s.x, s.y); },
};

start();
