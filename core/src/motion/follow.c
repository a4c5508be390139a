/// See follow.h.
#include "motion/follow.h"
#include "motion/trailer.h"

/// Bodies slower than this are waited for whichever way they point. [m/s]
#define STANDING 0.5
/// Cosine of the angle within which another heading is the same way: 60 degrees.
#define SAME_WAY 0.5
/// Nobody farther ahead than this beyond what own braking needs has to be looked at. [m]
#define LOOK_BEYOND 30.0
/// The shortest stop. [s]
#define STOP_MIN 1e-2

static double room_behind(const vg_following* f, const vg_state* from, const verge_track* other,
                          double reach, double* speed);
static double end_speed(double room, double leader, const vg_state* from, double T, double b);
static double stop_within(double room, const vg_state* from, double T);

double vg_follow_speed(const vg_following* f, const vg_state* from, double braking)
{
    const double v = from->s_t;
    const double reach = v * f->T + v * v / (2.0 * braking) + LOOK_BEYOND;
    double least = VG_HUGE;
    for (uint32_t j = 0; j < f->tracks->count; j += 1) {
        if (j == f->own || j == vg_trailer_of(f->tracks, f->own)) {
            continue;
        }
        double leader = 0.0;
        const double room = room_behind(f, from, &f->tracks->of[j], reach, &leader);
        if (room < VG_HUGE) {
            least = vg_min(least, end_speed(room, leader, from, f->T, braking));
        }
    }
    return least;
}

/// Way [m] up to the gap behind another body at the end of the segment, and its speed then along
/// the path; VG_HUGE: it is not ahead in the path.
static double room_behind(const vg_following* f, const vg_state* from, const verge_track* other,
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
    if (vg_abs(d) > own->half_width + reach_left + f->clearance
        || (along < SAME_WAY && v > STANDING)) {
        return VG_HUGE;
    }
    *speed = v * vg_max(along, 0.0);
    return s - reach_ahead - f->gap - (from->s + f->rear_axle + own->half_length);
}

/// Solves v^2 - leader^2 = 2 b (room - way) for the end speed v, where a profile to v is
/// way = T (v0 + v) / 2 + T^2 a0 / 12 long (kinematics.h).
static double end_speed(double room, double leader, const vg_state* from, double T, double b)
{
    const double rest = room - T * (0.5 * from->s_t + T * from->s_tt / 12.0);
    const double c = leader * leader + 2.0 * b * rest;
    if (c >= 0.0) {
        return 2.0 * c / (b * T + vg_sqrt(b * b * T * T + 4.0 * c));
    }
    return from->s_t * (1.0 - T / stop_within(room + leader * leader / (2.0 * b), from, T));
}

/// Time of a stop that is `room` long, at most T: solves room = t v0 / 2 + t^2 a0 / 12.
static double stop_within(double room, const vg_state* from, double T)
{
    const double v = 0.5 * from->s_t;
    const double under = v * v + from->s_tt * room / 3.0;
    if (room <= 0.0 || v <= 0.0) {
        return STOP_MIN;
    }
    return under < 0.0 ? T : vg_clamp(2.0 * room / (v + vg_sqrt(under)), STOP_MIN, T);
}
