/// See stop.h.
#include "motion/stop.h"

#include "base/contract.h"

/// Duration of the lateral motion to the offset, at the speed of the start. [s]
/// The wheel turns back over at least this distance, and no faster than points of a trajectory show.
/// [m], [s]
static const double unwind_least = 1.0, unwind_least_s = 0.1;
static const double centring_s = 3.0;
/// Share of the limits that is used: the rest is for the steps of the integration. [1]
static const double limit_share = 0.98;
/// Speeds below this are no divisors: steering at walking pace. [m/s]
static const double slow = 0.5;

static vg_rear place_at(const vg_leg* leg, double offset, double s);
static double next_acceleration(const vg_stop* stop, const vg_rear* here, double h);

void vg_stop_in_lane(vg_leg* leg, const vg_path* path, const vg_limits* limits,
                     const vg_state* state, double offset)
{
    VERGE_ASSERT(state->valid);
    *leg = (vg_leg){ .path = path, .limits = limits };
    vg_leg_link_by_distance(leg, state, centring_s * state->s_t, offset,
                            vg_max(state->s_t, slow));
}

/// Heading after `at` of `length` metres over which a curvature falls to 0.
static void heading_at(double start, double curvature, double at, double length, double* sine,
                       double* cosine)
{
    vg_sincos(start + curvature * at * (1.0 - 0.5 * at / length), sine, cosine);
}

/// The line of a wheel that turns back. The position follows from the heading by Simpson's rule.
static void unwind(vg_path* path, const vg_motion* rear, double curvature, double length)
{
    const double h = length / (double)(VG_STOP_KNOTS - 1);
    path->knot_count = VG_STOP_KNOTS;
    path->knot_spacing = h;
    path->start = 0.0;
    path->anchor = 0;
    double x = rear->x, y = rear->y, sine, cosine;
    vg_sincos(rear->heading, &sine, &cosine);
    double x_slopes[2] = { cosine }, y_slopes[2] = { sine };
    for (uint32_t i = 0; i < VG_STOP_KNOTS; ++i) {
        const double at = h * (double)i;
        path->x[i] = x;
        path->y[i] = y;
        path->h[i] = h;
        x_slopes[1] = cosine;
        y_slopes[1] = sine;
        double middle_s, middle_c, end_s, end_c;
        heading_at(rear->heading, curvature, at + 0.5 * h, length, &middle_s, &middle_c);
        heading_at(rear->heading, curvature, at + h, length, &end_s, &end_c);
        x += h / 6.0 * (cosine + 4.0 * middle_c + end_c);
        y += h / 6.0 * (sine + 4.0 * middle_s + end_s);
        sine = end_s;
        cosine = end_c;
    }
    vg_spline_solve(path->x, path->h, path->knot_count, x_slopes, path->xss, path->work);
    vg_spline_solve(path->y, path->h, path->knot_count, y_slopes, path->yss, path->work);
}

void vg_stop_straight(vg_leg* leg, vg_path* path, const vg_limits* limits, const vg_motion* rear)
{
    VERGE_ASSERT(path->knots_max >= VG_STOP_KNOTS);
    const double v = vg_max(rear->speed, slow);
    const double most = limit_share
                        * vg_min(limits->curvature_max, limits->lateral_max / (v * v));
    const double curvature = vg_clamp(rear->curvature, -most, most);
    // An acceleration at the start still gains speed: a^2 / 2 j.
    const double gain = vg_square(vg_max(rear->acceleration, 0.0)) / (2.0 * VG_JERK_MAX);
    const double per_metre =
        limit_share * limits->steer_rate_max / (limits->wheelbase * (v + gain));
    const double shortest = vg_max(unwind_least, unwind_least_s * v);
    unwind(path, rear, curvature, vg_max(vg_abs(curvature) / per_metre, shortest));
    *leg = (vg_leg){ .path = path, .limits = limits, .by_distance = true, .span = 1.0 };
}

vg_stop vg_stop_from(const vg_leg* leg, double offset, double speed, double acceleration,
                     double level, double jerk)
{
    VERGE_ASSERT(leg->by_distance && leg->span > 0.0);
    VERGE_ASSERT(speed >= 0.0 && jerk > 0.0);
    return (vg_stop){ .leg = leg, .offset = offset, .level = level, .jerk = jerk,
                      .speed_max = VG_HUGE, .s = leg->s_start,
                      .place = place_at(leg, offset, leg->s_start), .speed = speed,
                      .acceleration = acceleration };
}

/// The rear axle at s, with derivatives by the distance along the path instead of time.
static vg_rear place_at(const vg_leg* leg, double offset, double s)
{
    const vg_row row = vg_leg_place(leg, s);
    return vg_rear_of(&row, offset);
}

/// Speed of the centre over that of the rear axle. [1]
static double ratio_of(const vg_stop* stop, const vg_rear* place)
{
    return vg_sqrt(1.0 + vg_square(stop->leg->limits->rear_axle * place->curvature));
}

vg_rear vg_stop_at(const vg_stop* stop)
{
    vg_rear rear = stop->place;
    const double ratio = ratio_of(stop, &rear);
    const double v = stop->speed / ratio;
    const double axle = stop->leg->limits->rear_axle;
    rear.curvature_t *= v / rear.speed; // rear.speed is the distance driven per metre of the path
    rear.speed = v;
    rear.acceleration = (stop->acceleration
                         - v * rear.curvature * rear.curvature_t * axle * axle / ratio) / ratio;
    rear.jerk = stop->rate;
    return rear;
}

/// Moves s by a distance of the centre, by the midpoint rule.
static void move(vg_stop* stop, double distance)
{
    if (distance == 0.0) {
        return; // it stands
    }
    const double half = 0.5 * distance / (stop->place.speed * ratio_of(stop, &stop->place));
    const vg_rear middle = place_at(stop->leg, stop->offset, stop->s + half);
    stop->s += distance / (middle.speed * ratio_of(stop, &middle));
    stop->place = place_at(stop->leg, stop->offset, stop->s);
}

void vg_stop_advance(vg_stop* stop, double h)
{
    VERGE_ASSERT(h > 0.0 && h <= VG_STOP_STEP + 1e-12);
    const vg_rear here = vg_stop_at(stop);
    const double v0 = stop->speed, a0 = stop->acceleration;
    const double a1 = next_acceleration(stop, &here, h);
    const double v1 = v0 + 0.5 * h * (a0 + a1);
    if (v1 <= 0.0) {
        move(stop, 0.5 * h * v0);
        stop->speed = stop->acceleration = stop->rate = 0.0;
        return;
    }
    move(stop, 0.5 * h * (v0 + v1) + h * h / 12.0 * (a0 - a1));
    stop->speed = v1;
    stop->acceleration = a1;
    stop->rate = (a1 - a0) / h;
}

static double next_acceleration(const vg_stop* stop, const vg_rear* here, double h)
{
    const vg_limits* limits = stop->leg->limits;
    const double a = stop->acceleration;
    const double lateral = here->speed * here->speed * here->curvature * limits->lateral_share;
    const double grip = 1.0 / limits->per_braking_squared - lateral * lateral;
    const double tyres = limit_share * vg_sqrt(vg_max(grip, 0.0));
    const double soon = vg_max(stop->speed + a * h, 0.0);
    double wanted = 0.0;
    if (stop->level > 0.0) {
        // Released in time: from the speed v, with jerk j, by a deceleration of sqrt(2 j v).
        wanted = -vg_min(vg_min(stop->level, tyres), vg_sqrt(2.0 * stop->jerk * soon));
    } else if (stop->level < 0.0) {
        const double engine = limit_share
                              / (limits->per_acceleration
                                 * vg_max(1.0, here->speed * limits->per_speed_switch));
        const double room = vg_max(stop->speed_max - soon, 0.0);
        wanted = vg_min(vg_min(-stop->level, tyres),
                        vg_min(engine, vg_sqrt(2.0 * stop->jerk * room)));
    }
    const double jerk = a > 0.0 && wanted <= 0.0 ? VG_JERK_MAX : stop->jerk;
    return vg_clamp(wanted, a - jerk * h, a + jerk * h);
}
