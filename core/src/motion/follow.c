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

/// A body at one instant, in terms of the path.
typedef struct place {
    double s, d;          ///< [m] of its centre
    double along;         ///< [1] cosine of its heading against the path
    double ahead, left;   ///< [m] half sides of the box that holds it
} place;

static place place_of(const vg_path* path, const verge_track* body, uint32_t instant, double guess)
{
    const double x = body->x[instant], y = body->y[instant];
    const double c = body->cos_heading[instant], n = body->sin_heading[instant];
    const double s = vg_path_project(path, x, y, guess);
    const vg_reference at = vg_path_at(path, s);
    const double along = c * at.cos_heading + n * at.sin_heading;
    const double across = vg_abs(n * at.cos_heading - c * at.sin_heading);
    return (place){
        .s = s, .d = vg_left_of(&at, x, y), .along = along,
        .ahead = body->half_length * vg_abs(along) + body->half_width * across,
        .left = body->half_length * across + body->half_width * vg_abs(along),
    };
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
    const place end = place_of(f->path, other, f->last, from->s + far);
    const double v = other->speed[f->last], side = own->half_width + f->clearance;
    if (vg_abs(end.d - f->offset) > side + end.left
        || (vg_abs(end.along) < same_direction && vg_abs(v) > standing)) {
        return VG_HUGE;
    }
    if (end.s < from->s + f->rear_axle + f->driven) {
        const place begin =
            place_of(f->path, other, f->start, from->s + vg_sqrt(x0 * x0 + y0 * y0));
        if (vg_abs(begin.d) > side + begin.left) {
            return VG_HUGE; // it enters the path behind this vehicle
        }
    }
    *speed = vg_abs(v) > standing ? v * end.along : vg_max(v * end.along, 0.0);
    return end.s - end.ahead - f->gap - (from->s + f->rear_axle + own->half_length);
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
