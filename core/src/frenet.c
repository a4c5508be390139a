/// Reference line and plane. A point of the plane is r(s) + d n(s); differentiated twice in time,
///
///     velocity      along  s_t (1 - k d)                          across  d_t
///     acceleration  along  s_tt (1 - k d) - k' s_t^2 d - 2 k s_t d_t
///                   across d_tt + k s_t^2 (1 - k d)
///
/// with k the line's curvature and k' its rate. Speed, course, acceleration and curvature follow
/// by rotating these two vectors; it is Werling's closed form without the division by s_t that
/// makes his d' and d'' blow up at standstill.
#include "frenet.h"

#include "contract.h"
#include "scalar.h"

#include <stddef.h>

/// A uniform cubic spline through the plane, whoever owns its knots.
typedef struct line {
    const double *x, *y, *xss, *yss;
    uint32_t knot_count;
    double   knot_spacing; ///< [m]
    double   start;        ///< [m] coordinate of knot 0
} line;

/// Position and three derivatives by the coordinate.
typedef struct line_sample {
    double x, y, xs, ys, xss, yss, xsss, ysss;
} line_sample;

static line line_of_lane(const vg_lane* lane);
static line line_of_path(const vg_path* path);
static line_sample line_sample_at(const line* self, uint32_t knot, double u);
static vg_reference line_at(const line* self, double s);
static double line_project(const line* self, double x, double y, double s_guess);
static uint32_t line_nearest_knot(const line* self, double x, double y);
static uint32_t line_walk_to_nearest(const line* self, double x, double y, double s_guess);
static double line_knot_distance_squared(const line* self, uint32_t knot, double x, double y);
static double line_refine(const line* self, double x, double y, double low, double high);

vg_reference vg_path_at(const vg_path* path, double s)
{
    const line self = line_of_path(path);
    return line_at(&self, s);
}

vg_reference vg_lane_at(const vg_lane* lane, double s)
{
    const line self = line_of_lane(lane);
    return line_at(&self, s);
}

double vg_path_project(const vg_path* path, double x, double y, double s_guess)
{
    const line self = line_of_path(path);
    return line_project(&self, x, y, s_guess);
}

double vg_lane_project(const vg_lane* lane, double x, double y, double s_guess)
{
    const line self = line_of_lane(lane);
    return line_project(&self, x, y, s_guess);
}

vg_frenet vg_frenet_from_motion(const vg_reference* at, double s, const vg_motion* motion)
{
    const double dx = motion->x - at->x;
    const double dy = motion->y - at->y;
    const double d = dy * at->cos_heading - dx * at->sin_heading;
    const double scale = 1.0 - at->curvature * d;
    VERGE_ASSERT(scale > 0.0);

    double sine, cosine;
    vg_sincos(motion->heading, &sine, &cosine);
    const double along = cosine * at->cos_heading + sine * at->sin_heading;
    const double across = sine * at->cos_heading - cosine * at->sin_heading;
    const double speed = motion->speed < 1e-9 ? 0.0 : motion->speed;
    const double turn = motion->curvature * speed * speed; // acceleration to the left
    const double a_along = motion->acceleration * along - turn * across;
    const double a_across = motion->acceleration * across + turn * along;

    vg_frenet frenet;
    frenet.s = s;
    frenet.d = d;
    frenet.s_t = speed * along / scale;
    frenet.d_t = speed * across;
    frenet.s_tt = (a_along + at->curvature_rate * frenet.s_t * frenet.s_t * d
                   + 2.0 * at->curvature * frenet.s_t * frenet.d_t) / scale;
    frenet.d_tt = a_across - at->curvature * frenet.s_t * frenet.s_t * scale;
    return frenet;
}

vg_motion vg_motion_from_frenet(const vg_reference* at, const vg_frenet* frenet,
                                double heading_slow)
{
    const double scale = 1.0 - at->curvature * frenet->d;
    VERGE_ASSERT(scale > 0.0);

    const double along = frenet->s_t * scale;
    const double across = frenet->d_t;
    const double a_along = frenet->s_tt * scale
                           - at->curvature_rate * frenet->s_t * frenet->s_t * frenet->d
                           - 2.0 * at->curvature * frenet->s_t * frenet->d_t;
    const double a_across = frenet->d_tt + at->curvature * frenet->s_t * frenet->s_t * scale;

    vg_motion motion;
    motion.x = at->x - frenet->d * at->sin_heading;
    motion.y = at->y + frenet->d * at->cos_heading;
    motion.speed = vg_sqrt(along * along + across * across);
    if (motion.speed < 1e-6) {
        double sine, cosine;
        vg_sincos(heading_slow, &sine, &cosine);
        const double ahead = cosine * at->cos_heading + sine * at->sin_heading;
        const double aside = sine * at->cos_heading - cosine * at->sin_heading;
        motion.heading = heading_slow;
        motion.acceleration = a_along * ahead + a_across * aside;
        motion.curvature = 0.0;
        return motion;
    }
    // One arctangent of the velocity in the plane, not a sum of two angles.
    motion.heading = vg_atan2(along * at->sin_heading + across * at->cos_heading,
                              along * at->cos_heading - across * at->sin_heading);
    motion.acceleration = (along * a_along + across * a_across) / motion.speed;
    motion.curvature = (along * a_across - across * a_along)
                       / (motion.speed * motion.speed * motion.speed);
    return motion;
}

vg_motion vg_motion_of_centre(const vg_motion* rear, double curvature_t)
{
    // The centre moves with (v, curvature v a) in the body's frame, a the distance of the axle.
    const double a = VERGE_REAR_AXLE;
    const double ratio = vg_sqrt(1.0 + vg_square(a * rear->curvature));
    double sine, cosine;
    vg_sincos(rear->heading, &sine, &cosine);

    vg_motion centre;
    centre.x = rear->x + a * cosine;
    centre.y = rear->y + a * sine;
    centre.heading = rear->heading;
    centre.speed = rear->speed * ratio;
    centre.acceleration = rear->acceleration * ratio
                          + rear->speed * rear->curvature * curvature_t * a * a / ratio;
    centre.curvature = rear->curvature / ratio;
    return centre;
}

vg_motion vg_motion_of_rear(const vg_motion* centre)
{
    const double a = VERGE_REAR_AXLE;
    // Yaw rate over speed of a car's centre is below 0.5 / m (VERGE_CURVATURE_MAX); measured
    // states may claim more, up to a spin about the rear axle, where the ratio has no answer.
    const double limit = 0.95 / a;
    const double curvature = vg_clamp(centre->curvature, -limit, limit);
    const double ratio = 1.0 / vg_sqrt(1.0 - vg_square(a * curvature));
    double sine, cosine;
    vg_sincos(centre->heading, &sine, &cosine);

    vg_motion rear;
    rear.x = centre->x - a * cosine;
    rear.y = centre->y - a * sine;
    rear.heading = centre->heading;
    rear.speed = centre->speed / ratio;
    rear.acceleration = centre->acceleration / ratio;
    rear.curvature = curvature * ratio;
    return rear;
}

static line line_of_lane(const vg_lane* lane)
{
    VERGE_ASSERT(lane != NULL && lane->knot_count >= 2);
    return (line){ .x = lane->x, .y = lane->y, .xss = lane->xss, .yss = lane->yss,
                   .knot_count = lane->knot_count, .knot_spacing = lane->knot_spacing,
                   .start = 0.0 };
}

static line line_of_path(const vg_path* path)
{
    VERGE_ASSERT(path != NULL && path->knot_count >= 2);
    return (line){ .x = path->x, .y = path->y, .xss = path->xss, .yss = path->yss,
                   .knot_count = path->knot_count, .knot_spacing = path->knot_spacing,
                   .start = path->start };
}

/// The cubic between `knot` and the next, u metres behind `knot`.
static line_sample line_sample_at(const line* self, uint32_t knot, double u)
{
    VERGE_ASSERT(knot + 1 < self->knot_count);
    const double h = self->knot_spacing;
    const double *x = self->x + knot, *y = self->y + knot;
    const double *xss = self->xss + knot, *yss = self->yss + knot;

    line_sample at;
    at.xsss = (xss[1] - xss[0]) / h;
    at.ysss = (yss[1] - yss[0]) / h;
    const double xs0 = (x[1] - x[0]) / h - h * (2.0 * xss[0] + xss[1]) / 6.0;
    const double ys0 = (y[1] - y[0]) / h - h * (2.0 * yss[0] + yss[1]) / 6.0;
    at.x = x[0] + u * (xs0 + u * (0.5 * xss[0] + u * at.xsss / 6.0));
    at.y = y[0] + u * (ys0 + u * (0.5 * yss[0] + u * at.ysss / 6.0));
    at.xs = xs0 + u * (xss[0] + 0.5 * u * at.xsss);
    at.ys = ys0 + u * (yss[0] + 0.5 * u * at.ysss);
    at.xss = xss[0] + u * at.xsss;
    at.yss = yss[0] + u * at.ysss;
    return at;
}

static vg_reference line_at(const line* self, double s)
{
    VERGE_ASSERT(vg_finite(s));
    const double end = self->knot_spacing * (double)(self->knot_count - 1);
    const double way = s - self->start;
    const double inside = vg_clamp(way, 0.0, end);
    const double intervals = inside / self->knot_spacing; // 0 .. knot_count - 1
    uint32_t knot = (uint32_t)intervals;
    if (knot > self->knot_count - 2) {
        knot = self->knot_count - 2;
    }
    const double u = inside - self->knot_spacing * (double)knot;
    const line_sample p = line_sample_at(self, knot, u);

    const double norm = vg_sqrt(p.xs * p.xs + p.ys * p.ys);
    vg_reference at;
    at.cos_heading = p.xs / norm;
    at.sin_heading = p.ys / norm;
    at.x = p.x + (way - inside) * at.cos_heading;
    at.y = p.y + (way - inside) * at.sin_heading;
    at.curvature = 0.0;
    at.curvature_rate = 0.0;
    if (vg_abs(way - inside) < 1e-9) { // the end itself has its curvature, rounding or not
        const double cube = norm * norm * norm;
        at.curvature = (p.xs * p.yss - p.ys * p.xss) / cube;
        at.curvature_rate = (p.xs * p.ysss - p.ys * p.xsss) / cube
                            - 3.0 * at.curvature * (p.xs * p.xss + p.ys * p.yss) / (norm * norm);
    }
    return at;
}

static double line_project(const line* self, double x, double y, double s_guess)
{
    const uint32_t knot = s_guess == s_guess ? line_walk_to_nearest(self, x, y, s_guess)
                                             : line_nearest_knot(self, x, y);
    const uint32_t last = self->knot_count - 1;
    const uint32_t first = knot == 0 ? 0 : knot - 1;
    const uint32_t second = knot == last ? last : knot + 1;
    const double low = self->start + self->knot_spacing * (double)first;
    const double high = self->start + self->knot_spacing * (double)second;
    for (int end = 0; end < 2; ++end) { // beyond an end the line is straight
        const double s = end == 0 ? low : high;
        if (end == 0 ? first == 0 : second == last) {
            const vg_reference at = line_at(self, s);
            const double ahead = (x - at.x) * at.cos_heading + (y - at.y) * at.sin_heading;
            if (end == 0 ? ahead <= 0.0 : ahead >= 0.0) {
                return s + ahead;
            }
        }
    }
    return line_refine(self, x, y, low, high);
}

/// Exact over all knots. Distances change by at most one spacing from knot to knot, so a knot
/// that is far off lets us skip as many as cannot be nearer than the best one so far.
static uint32_t line_nearest_knot(const line* self, double x, double y)
{
    uint32_t best = 0;
    double best_distance = vg_sqrt(line_knot_distance_squared(self, 0, x, y));
    for (uint32_t i = 1; i < self->knot_count;) {
        const double distance = vg_sqrt(line_knot_distance_squared(self, i, x, y));
        if (distance < best_distance) {
            best = i;
            best_distance = distance;
        }
        // 1.01: a spline's knots may lie a hair further apart than their arc.
        const double skip = (distance - best_distance) / (1.01 * self->knot_spacing);
        i += skip >= (double)self->knot_count ? self->knot_count : skip > 1.0 ? (uint32_t)skip : 1;
    }
    return best;
}

static uint32_t line_walk_to_nearest(const line* self, double x, double y, double s_guess)
{
    const uint32_t last = self->knot_count - 1;
    const double way = (s_guess - self->start) / self->knot_spacing + 0.5;
    uint32_t knot = (uint32_t)vg_clamp(way, 0.0, (double)last);
    double here = line_knot_distance_squared(self, knot, x, y);
    for (uint32_t step = 0; step < last; ++step) {
        uint32_t next = knot;
        double there = here;
        if (knot > 0 && line_knot_distance_squared(self, knot - 1, x, y) < there) {
            next = knot - 1;
            there = line_knot_distance_squared(self, next, x, y);
        }
        if (knot < last && line_knot_distance_squared(self, knot + 1, x, y) < there) {
            next = knot + 1;
            there = line_knot_distance_squared(self, next, x, y);
        }
        if (next == knot) {
            break;
        }
        knot = next;
        here = there;
    }
    return knot;
}

static double line_knot_distance_squared(const line* self, uint32_t knot, double x, double y)
{
    return vg_square(self->x[knot] - x) + vg_square(self->y[knot] - y);
}

/// Root of ahead(s) = (p - r(s)) . r'(s) in [low, high], which falls through zero at the nearest
/// point: Newton's method, kept inside the bracket by bisection.
static double line_refine(const line* self, double x, double y, double low, double high)
{
    double s = 0.5 * (low + high);
    for (int round = 0; round < 60; ++round) {
        const vg_reference at = line_at(self, s);
        const double dx = x - at.x;
        const double dy = y - at.y;
        const double ahead = dx * at.cos_heading + dy * at.sin_heading;
        const double d = dy * at.cos_heading - dx * at.sin_heading;
        if (ahead > 0.0) {
            low = s;
        } else {
            high = s;
        }
        const double slope = 1.0 - at.curvature * d;
        double next = slope > 0.0 ? s + ahead / slope : 0.5 * (low + high);
        if (!(next >= low && next <= high)) {
            next = 0.5 * (low + high);
        }
        const double step = vg_abs(next - s);
        s = next;
        if (step < 1e-13 || high - low < 1e-13) {
            break;
        }
    }
    return s;
}
