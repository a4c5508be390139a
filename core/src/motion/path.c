/// The reference path of one vehicle: consecutive lanes joined to one line. Where the survey has a
/// step between two lanes (a merge, a diverge, a gap), the step in position and direction is faded
/// out over some metres away from the anchor lane. So the anchor lane is unchanged and the path is
/// smooth.
#include "motion/path.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

enum { PIECES_MAX = 32, SMOOTHING = 6 }; // points to either side that a knot is smoothed over
static const double fade_length = 15.0;   // [m] over which a step fades
static const double fade_per_metre = 20.0; // [m] more for every metre of step

/// A lane within the path.
typedef struct piece {
    const vg_lane* lane;
    double start;         ///< [m] path coordinate of its s = 0
    // The step at its end towards the anchor, in position and in direction.
    double x, y, xs, ys;
    double fade;          ///< [m]
} piece;

typedef struct pieces {
    piece    before[PIECES_MAX], behind[PIECES_MAX]; ///< walking away from the anchor
    uint32_t before_count, behind_count;
} pieces;

static void set_knots(vg_path* path, const pieces* all);
static void solve(vg_path* path);
static void even_out(vg_path* path);
static void collect_behind(pieces* all, const struct verge_road* road, uint32_t lane,
                           int32_t target, double s_to);
static void collect_before(pieces* all, const struct verge_road* road, uint32_t lane,
                           double s_from);
static void set_step(piece* self, const vg_reference* held, const vg_reference* own);
static void point_of(const pieces* all, double s, double* x, double* y);
static void fade(const piece* self, double distance, double direction, double* x, double* y);

void vg_paths_take(vg_path paths[2], vg_arena* arena, uint32_t knots_max)
{
    VERGE_ASSERT(knots_max >= 8 && knots_max <= VG_PATH_KNOTS_MAX);
    double* h = vg_arena_take(arena, knots_max * sizeof *h);
    double* work = vg_arena_take(arena, knots_max * sizeof *work);
    for (uint32_t k = 0; k < 2; ++k) {
        vg_path* path = &paths[k];
        double** const arrays[] = { &path->x, &path->y, &path->xss, &path->yss };
        for (uint32_t i = 0; i < sizeof arrays / sizeof arrays[0]; ++i) {
            *arrays[i] = vg_arena_take(arena, knots_max * sizeof(double));
        }
        path->knots_max = knots_max;
        path->h = h;
        path->work = work;
    }
}

void vg_path_build(vg_path* path, const struct verge_road* road, uint32_t lane, int32_t target,
                   double s_from, double s_to)
{
    VERGE_ASSERT(lane < road->lane_count && target < (int32_t)road->lane_count);
    VERGE_ASSERT(vg_finite(s_from) && vg_finite(s_to));

    const double length_max = VG_KNOT_SPACING * (double)(path->knots_max - 1u);
    const double length = vg_clamp(s_to - s_from, 4.0, length_max);
    pieces all;
    all.before[0] = all.behind[0] = (piece){ .lane = &road->lanes[lane] };
    all.before_count = all.behind_count = 1;
    collect_behind(&all, road, lane, target, s_from + length);
    collect_before(&all, road, lane, s_from);

    const double intervals = length / VG_KNOT_SPACING;
    const uint32_t whole = (uint32_t)intervals; // 4 .. knots_max - 1
    path->knot_count = whole + ((double)whole < intervals ? 2u : 1u);
    path->knot_spacing = length / (double)(path->knot_count - 1);
    path->start = s_from;
    path->anchor = lane;
    set_knots(path, &all);
    solve(path);
    even_out(path);
    solve(path);
}

static void solve(vg_path* path)
{
    vg_spline_solve(path->x, path->h, path->knot_count, NULL, path->xss, path->work);
    vg_spline_solve(path->y, path->h, path->knot_count, NULL, path->yss, path->work);
}

/// Derivative of a cubic by its parameter at both ends and in the middle of an interval.
typedef struct slopes {
    double from, middle, to;
} slopes;

static slopes slopes_of(const double* x, const double* xss, double h)
{
    const double mean = (x[1] - x[0]) / h;
    return (slopes){ mean - h * (2.0 * xss[0] + xss[1]) / 6.0, mean + h * (xss[0] - xss[1]) / 24.0,
                     mean + h * (xss[0] + 2.0 * xss[1]) / 6.0 };
}

static double hypotenuse(double x, double y)
{
    return vg_sqrt(x * x + y * y);
}

/// Length of the interval behind knot i, less the knot spacing. [m]
static double excess_of(const vg_path* path, uint32_t i)
{
    const double h = path->knot_spacing;
    const slopes x = slopes_of(&path->x[i], &path->xss[i], h);
    const slopes y = slopes_of(&path->y[i], &path->yss[i], h);
    return h * ((hypotenuse(x.from, y.from) + 4.0 * hypotenuse(x.middle, y.middle)
                 + hypotenuse(x.to, y.to)) / 6.0 - 1.0);
}

/// Moves the knots along the path until they are one knot spacing of length apart, because speeds
/// and bends are derivatives by the path coordinate. The knot at the start of the anchor stays, or
/// the first one.
static void even_out(vg_path* path)
{
    const double h = path->knot_spacing;
    const uint32_t last = path->knot_count - 1u;
    const uint32_t kept = (uint32_t)vg_clamp(-path->start / h, 0.0, (double)last);
    double excess = 0.0; // of the length from the kept knot to knot i
    for (uint32_t i = 0; i < kept; ++i) {
        excess -= excess_of(path, i);
    }
    for (uint32_t i = 0; i <= last; ++i) {
        const uint32_t k = i < last ? i : i - 1u;
        const slopes x = slopes_of(&path->x[k], &path->xss[k], h);
        const slopes y = slopes_of(&path->y[k], &path->yss[k], h);
        const double dx = i < last ? x.from : x.to, dy = i < last ? y.from : y.to;
        const double share = excess / vg_max(hypotenuse(dx, dy), 0.1);
        path->h[i] = -share * dx; // all are moved afterwards: the slopes are those of now
        path->work[i] = -share * dy;
        excess += excess_of(path, k);
    }
    for (uint32_t i = 0; i <= last; ++i) {
        path->x[i] += path->h[i];
        path->y[i] += path->work[i];
        path->h[i] = h;
    }
}

/// The knots. Where a straight lane meets a bend, curvature begins at once, and no steering follows
/// that. Smoothed, it begins over some metres. The shares are 2 B - B * B of the binomial shares
/// B = (1, 6, 15, 20, 15, 6, 1) / 64: they leave parabolas as they are, so the path stays on the
/// line of a bend.
static void set_knots(vg_path* path, const pieces* all)
{
    static const double shares[SMOOTHING + 1] = {
        1636.0 / 4096.0, 1128.0 / 4096.0, 273.0 / 4096.0, -92.0 / 4096.0,
        -66.0 / 4096.0, -12.0 / 4096.0, -1.0 / 4096.0,
    };
    double x[2 * SMOOTHING + 1] = { 0.0 }, y[2 * SMOOTHING + 1] = { 0.0 };
    for (uint32_t i = 0; i < path->knot_count + 2u * SMOOTHING; ++i) {
        for (uint32_t k = 0; k < 2 * SMOOTHING; ++k) {
            x[k] = x[k + 1];
            y[k] = y[k + 1];
        }
        const double s = path->start + path->knot_spacing * ((double)i - SMOOTHING);
        point_of(all, s, &x[2 * SMOOTHING], &y[2 * SMOOTHING]);
        if (i < 2 * SMOOTHING) {
            continue;
        }
        const uint32_t knot = i - 2u * SMOOTHING;
        path->h[knot] = path->knot_spacing;
        path->x[knot] = shares[0] * x[SMOOTHING];
        path->y[knot] = shares[0] * y[SMOOTHING];
        for (uint32_t k = 1; k <= SMOOTHING; ++k) {
            path->x[knot] += shares[k] * (x[SMOOTHING - k] + x[SMOOTHING + k]);
            path->y[knot] += shares[k] * (y[SMOOTHING - k] + y[SMOOTHING + k]);
        }
    }
}

static void collect_behind(pieces* all, const struct verge_road* road, uint32_t lane,
                           int32_t target, double s_to)
{
    while (all->behind_count < PIECES_MAX) {
        const piece* last = &all->behind[all->behind_count - 1];
        const double end = last->start + last->lane->length;
        const int32_t next = vg_road_next(road, lane, target);
        if (end >= s_to || next < 0) {
            break;
        }
        lane = (uint32_t)next;
        double x, y;
        vg_reference held = vg_lane_at(last->lane, last->lane->length);
        piece* added = &all->behind[all->behind_count];
        *added = (piece){ .lane = &road->lanes[lane] };
        const vg_reference own = vg_lane_at(added->lane, 0.0);
        const double gap = (own.x - held.x) * held.cos_heading
                           + (own.y - held.y) * held.sin_heading;
        added->start = end + vg_max(gap, 0.0);
        point_of(all, added->start, &x, &y); // straight across a gap, with the rest of all steps
        held.x = x;
        held.y = y;
        set_step(added, &held, &own);
        all->behind_count++;
    }
}

static void collect_before(pieces* all, const struct verge_road* road, uint32_t lane,
                           double s_from)
{
    while (all->before_count < PIECES_MAX) {
        const piece* first = &all->before[all->before_count - 1];
        const int32_t before = vg_lane_before(road, lane);
        if (first->start <= s_from || before < 0) {
            break;
        }
        lane = (uint32_t)before;
        double x, y;
        vg_reference held = vg_lane_at(first->lane, 0.0);
        piece* added = &all->before[all->before_count];
        *added = (piece){ .lane = &road->lanes[lane] };
        const vg_reference own = vg_lane_at(added->lane, added->lane->length);
        const double gap = (held.x - own.x) * held.cos_heading
                           + (held.y - own.y) * held.sin_heading;
        const double end = first->start - vg_max(gap, 0.0);
        added->start = end - added->lane->length;
        point_of(all, end, &x, &y);
        held.x = x;
        held.y = y;
        set_step(added, &held, &own);
        all->before_count++;
    }
}

static void set_step(piece* self, const vg_reference* held, const vg_reference* own)
{
    self->x = held->x - own->x;
    self->y = held->y - own->y;
    self->xs = held->cos_heading - own->cos_heading;
    self->ys = held->sin_heading - own->sin_heading;
    self->fade = fade_length + fade_per_metre * vg_sqrt(self->x * self->x + self->y * self->y);
}

/// The path at s: the point of its lane, moved by the rest of every step from there to the anchor.
static void point_of(const pieces* all, double s, double* x, double* y)
{
    const bool ahead = s >= 0.0;
    const piece* list = ahead ? all->behind : all->before;
    const uint32_t count = ahead ? all->behind_count : all->before_count;
    uint32_t at = 0;
    // The last piece that has begun (ahead), or the last one whose end is not yet passed (back).
    while (at + 1 < count && (ahead ? list[at + 1].start <= s
                                    : list[at + 1].start + list[at + 1].lane->length >= s)) {
        ++at;
    }
    const vg_reference here = vg_lane_at(list[at].lane, s - list[at].start);
    *x = here.x;
    *y = here.y;
    for (uint32_t i = 1; i <= at; ++i) {
        const double joint = ahead ? list[i].start : list[i].start + list[i].lane->length;
        fade(&list[i], ahead ? s - joint : joint - s, ahead ? 1.0 : -1.0, x, y);
    }
}

/// Adds the rest of a step, `distance` [m] behind it: a cubic that begins with position and slope
/// of the step and ends with 0 for both.
static void fade(const piece* self, double distance, double direction, double* x, double* y)
{
    const double u = distance / self->fade;
    if (u >= 1.0) {
        return;
    }
    const double rest = 1.0 - u;
    const double position = rest * rest * (1.0 + 2.0 * u);
    const double slope = direction * self->fade * u * rest * rest;
    *x += position * self->x + slope * self->xs;
    *y += position * self->y + slope * self->ys;
}
