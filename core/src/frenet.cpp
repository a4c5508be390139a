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

#include "linear.hpp"
#include "scalar.h"

#include <stddef.h>

namespace {

/// A uniform cubic spline through the plane, whoever owns its knots.
struct line {
    const double *x, *y, *xss, *yss;
    uint32_t knot_count;
    double   knot_spacing; ///< [m]
    double   start;        ///< [m] coordinate of knot 0
};

/// Position and three derivatives by the coordinate.
struct line_sample {
    Vector2d r, rs, rss, rsss;
};

} // namespace

static Matrix2d frame_of(const vg_reference* at);
static Vector2d seen_from(const vg_reference* at, double x, double y);
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
    const double d = seen_from(at, motion->x, motion->y).y();
    const double scale = 1.0 - at->curvature * d;
    VERGE_ASSERT(scale > 0.0);

    double sine, cosine;
    vg_sincos(motion->heading, &sine, &cosine);
    const double speed = motion->speed < 1e-9 ? 0.0 : motion->speed;
    const double turn = motion->curvature * speed * speed; // acceleration to the left
    const Matrix2d body = frame_of(at).transpose() * vg_frame(cosine, sine);
    const Vector2d velocity = speed * body.col(0);
    const Vector2d acceleration = body * Vector2d(motion->acceleration, turn);

    vg_frenet frenet;
    frenet.s = s;
    frenet.d = d;
    frenet.s_t = velocity.x() / scale;
    frenet.d_t = velocity.y();
    frenet.s_tt = (acceleration.x() + at->curvature_rate * frenet.s_t * frenet.s_t * d
                   + 2.0 * at->curvature * frenet.s_t * frenet.d_t) / scale;
    frenet.d_tt = acceleration.y() - at->curvature * frenet.s_t * frenet.s_t * scale;
    return frenet;
}

vg_motion vg_motion_from_frenet(const vg_reference* at, const vg_frenet* frenet,
                                double heading_slow)
{
    const double scale = 1.0 - at->curvature * frenet->d;
    VERGE_ASSERT(scale > 0.0);

    const Matrix2d frame = frame_of(at);
    const Vector2d position = Vector2d(at->x, at->y) + frenet->d * frame.col(1);
    const Vector2d velocity(frenet->s_t * scale, frenet->d_t);
    const Vector2d acceleration(frenet->s_tt * scale
                                    - at->curvature_rate * frenet->s_t * frenet->s_t * frenet->d
                                    - 2.0 * at->curvature * frenet->s_t * frenet->d_t,
                                frenet->d_tt + at->curvature * frenet->s_t * frenet->s_t * scale);

    vg_motion motion;
    motion.x = position.x();
    motion.y = position.y();
    motion.speed = vg_sqrt(velocity.squaredNorm());
    if (motion.speed < 1e-6) {
        double sine, cosine;
        vg_sincos(heading_slow, &sine, &cosine);
        const Vector2d ahead = frame.transpose() * Vector2d(cosine, sine);
        motion.heading = heading_slow;
        motion.acceleration = acceleration.dot(ahead);
        motion.curvature = 0.0;
        return motion;
    }
    // One arctangent of the velocity in the plane, not a sum of two angles.
    const Vector2d course = frame * velocity;
    motion.heading = vg_atan2(course.y(), course.x());
    motion.acceleration = velocity.dot(acceleration) / motion.speed;
    motion.curvature = vg_cross(velocity, acceleration)
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

static Matrix2d frame_of(const vg_reference* at)
{
    return vg_frame(at->cos_heading, at->sin_heading);
}

/// How far (x, y) lies ahead and to the left of the line's point `at`. [m]
static Vector2d seen_from(const vg_reference* at, double x, double y)
{
    return frame_of(at).transpose() * (Vector2d(x, y) - Vector2d(at->x, at->y));
}

static line line_of_lane(const vg_lane* lane)
{
    VERGE_ASSERT(lane != NULL && lane->knot_count >= 2);
    return line{lane->x, lane->y, lane->xss, lane->yss, lane->knot_count, lane->knot_spacing, 0.0};
}

static line line_of_path(const vg_path* path)
{
    VERGE_ASSERT(path != NULL && path->knot_count >= 2);
    return line{path->x, path->y, path->xss, path->yss, path->knot_count, path->knot_spacing,
                path->start};
}

/// The cubic between `knot` and the next, u metres behind `knot`.
static line_sample line_sample_at(const line* self, uint32_t knot, double u)
{
    VERGE_ASSERT(knot + 1 < self->knot_count);
    const double h = self->knot_spacing;
    const Vector2d r0(self->x[knot], self->y[knot]);
    const Vector2d r1(self->x[knot + 1], self->y[knot + 1]);
    const Vector2d rss0(self->xss[knot], self->yss[knot]);
    const Vector2d rss1(self->xss[knot + 1], self->yss[knot + 1]);
    const Vector2d rs0 = (r1 - r0) / h - h * (2.0 * rss0 + rss1) / 6.0;

    line_sample at;
    at.rsss = (rss1 - rss0) / h;
    at.rss = rss0 + u * at.rsss;
    at.rs = rs0 + u * (rss0 + 0.5 * u * at.rsss);
    at.r = r0 + u * (rs0 + u * (0.5 * rss0 + u * at.rsss / 6.0));
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
    const line_sample p = line_sample_at(self, knot, inside - self->knot_spacing * (double)knot);
    const double norm = vg_sqrt(p.rs.squaredNorm());
    const Vector2d tangent = p.rs / norm;
    const Vector2d r = p.r + (way - inside) * tangent;

    vg_reference at = {r.x(), r.y(), tangent.x(), tangent.y(), 0.0, 0.0};
    if (vg_abs(way - inside) < 1e-9) { // the end itself has its curvature, rounding or not
        const double cube = norm * norm * norm;
        at.curvature = vg_cross(p.rs, p.rss) / cube;
        at.curvature_rate = vg_cross(p.rs, p.rsss) / cube
                            - 3.0 * at.curvature * p.rs.dot(p.rss) / (norm * norm);
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
            const double ahead = seen_from(&at, x, y).x();
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
        const Vector2d seen = seen_from(&at, x, y);
        const double ahead = seen.x();
        const double d = seen.y();
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
