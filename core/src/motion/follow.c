/// See follow.h.
#include "motion/follow.h"
#include "base/contract.h"
#include "motion/trailer.h"

/// Bodies slower than this stand: their heading does not matter. [m/s]
static const double standing = 0.5;
/// Cosine of the angle to the path up to which a body moves along it, either way: 60 degrees. [1]
static const double same_direction = 0.5;
/// Bodies farther ahead than the own stopping distance and this are ignored. [m]
static const double reach_reserve = 30.0;
/// Shortest duration of a stop. [s]
static const double stop_min = 1e-2;

static bool in_path(const vg_following* f, const vg_state* from, const verge_track* other);
static double distance_behind(const vg_following* f, const vg_state* from, const verge_track* other,
                              double reach, double* speed);
static double end_speed(double distance, double leader, const vg_state* from, double T, double b);
static double stop_within(double distance, const vg_state* from, double T);

vg_following vg_following_to_horizon(const verge_planner_def* def, const vg_path* path,
                                     const verge_tracks* tracks, uint32_t own, double rear_axle)
{
    const uint32_t last = def->points - 1;
    return (vg_following){ path, tracks, own, rear_axle, 0, last, def->point_s * last, def->idm_gap,
                           def->clearance, 0.0, 0.0 };
}

double vg_follow_speed(const vg_following* f, const vg_state* from, double braking)
{
    VERGE_ASSERT(f->T > 0.0 && braking > 0.0);
    VERGE_ASSERT(f->start < f->last && f->last < VERGE_POINTS_MAX);
    const double v = from->s_t;
    const double reach = v * f->T + v * v / (2.0 * braking) + reach_reserve;
    double least = VG_HUGE;
    for (uint32_t j = 0; j < f->tracks->count; ++j) {
        if (j == f->own || j == vg_trailer_of(f->tracks, f->own)) {
            continue;
        }
        double leader = 0.0;
        const double distance = distance_behind(f, from, &f->tracks->of[j], reach, &leader);
        if (distance < VG_HUGE) {
            least = vg_min(least, end_speed(distance, leader, from, f->T, braking));
        }
    }
    return least;
}

/// Is the body in the path at the start of the segment, up to the turn of its heading?
static bool in_path(const vg_following* f, const vg_state* from, const verge_track* other)
{
    const verge_track* own = &f->tracks->of[f->own];
    const double x = other->x[f->start], y = other->y[f->start];
    const vg_reference here = vg_path_at(f->path, from->s);
    const double dx = x - here.x, dy = y - here.y;
    const double s = vg_path_project(f->path, x, y, from->s + vg_sqrt(dx * dx + dy * dy));
    const vg_reference at = vg_path_at(f->path, s);
    const double d = (y - at.y) * at.cos_heading - (x - at.x) * at.sin_heading;
    return vg_abs(d) <= own->half_width + other->half_length + f->clearance;
}

/// Distance up to the gap behind another body at the end of the segment [m], and the speed of that
/// body along the path at that time, below 0 if it comes closer; VG_HUGE: the body is not ahead in
/// the path.
static double distance_behind(const vg_following* f, const vg_state* from, const verge_track* other,
                              double reach, double* speed)
{
    const verge_track* own = &f->tracks->of[f->own];
    const vg_reference here = vg_path_at(f->path, from->s);
    const double x0 = other->x[f->start] - here.x, y0 = other->y[f->start] - here.y;
    const double x = other->x[f->last] - here.x, y = other->y[f->last] - here.y;
    const double far = vg_sqrt(x * x + y * y);
    if (x0 * here.cos_heading + y0 * here.sin_heading < f->rear_axle || far > reach) {
        return VG_HUGE;
    }
    const double s = vg_path_project(f->path, other->x[f->last], other->y[f->last],
                                     from->s + far);
    const vg_reference at = vg_path_at(f->path, s);
    const double d = (other->y[f->last] - at.y) * at.cos_heading
                   - (other->x[f->last] - at.x) * at.sin_heading;
    const double c = other->cos_heading[f->last], n = other->sin_heading[f->last];
    const double along = c * at.cos_heading + n * at.sin_heading;
    const double across = vg_abs(n * at.cos_heading - c * at.sin_heading);
    const double reach_left = other->half_length * across + other->half_width * vg_abs(along);
    const double reach_ahead = other->half_length * vg_abs(along) + other->half_width * across;
    const double v = other->speed[f->last];
    if (vg_abs(d - f->offset) > own->half_width + reach_left + f->clearance
        || (vg_abs(along) < same_direction && vg_abs(v) > standing)) {
        return VG_HUGE;
    }
    if (s < from->s + f->rear_axle + f->driven && !in_path(f, from, other)) {
        return VG_HUGE;
    }
    *speed = vg_abs(v) > standing ? v * along : vg_max(v * along, 0.0);
    return s - reach_ahead - f->gap - (from->s + f->rear_axle + own->half_length);
}

/// Solves v^2 - leader^2 = 2 b (distance - driven) for the end speed v. A profile to v has the
/// length driven = T (v0 + v) / 2 + T^2 a0 / 12 (kinematics.h). A body that comes closer does so
/// until this vehicle stands, for v / b: v^2 + 2 v |leader| = 2 b (distance - driven).
static double end_speed(double distance, double leader, const vg_state* from, double T, double b)
{
    const double rest = distance - T * (0.5 * from->s_t + T * from->s_tt / 12.0);
    const double away = vg_max(leader, 0.0), closer = vg_max(-leader, 0.0);
    const double c = away * away + 2.0 * b * rest;
    if (c >= 0.0) {
        const double B = b * T + 2.0 * closer;
        return 2.0 * c / (B + vg_sqrt(B * B + 4.0 * c));
    }
    return from->s_t * (1.0 - T / stop_within(distance + away * away / (2.0 * b), from, T));
}

/// Duration of a stop of this length, at most T: solves distance = t v0 / 2 + t^2 a0 / 12.
static double stop_within(double distance, const vg_state* from, double T)
{
    const double v = 0.5 * from->s_t;
    const double under = v * v + from->s_tt * distance / 3.0;
    if (distance <= 0.0 || v <= 0.0) {
        return stop_min;
    }
    return under < 0.0 ? T : vg_clamp(2.0 * distance / (v + vg_sqrt(under)), stop_min, T);
}
