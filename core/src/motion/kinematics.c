/// See kinematics.h: profiles, then lateral polynomials (links), then conversions of motion.
#include "motion/kinematics.h"

#include "base/contract.h"

/// Shortest length of a link by distance. [m]
static const double link_distance_min = 10.0;
/// Share of the steering rate that a link may use. The rest is for the bends of the road and for
/// the difference between the ends of the link and its middle. [1]
static const double link_steer_share = 0.95;
/// A link is lengthened at most by this factor beyond its leg, in steps of the second factor. [1]
static const double link_stretch_max = 4.0;
static const double link_stretch_step = 1.05;
/// Links that move the vehicle farther aside than this change lane [m]; at walking speed they may
/// end after this share of the distance [1].
static const double link_change = 1.0, link_change_share = 0.5;
/// Largest lateral acceleration of a link, below the comfort limit of 4. [m/s^2]
static const double link_lateral_max = 3.2;
/// Largest curvature of a link by distance, relative to its line. [1/m]
static const double link_bend_max = 0.2;
/// Share of the limits of the body that both may use; the line itself may be curved. [1]
static const double link_limit_share = 0.5;

static vg_profile stop_smoothly(const vg_state* start, double T);
static void link(vg_leg* leg, const vg_axis_state* here, double shortest, double offset,
                 double speed);
static double link_strain(const vg_leg* leg, const vg_axis_state* from, double T, double offset,
                          double speed);
static void link_at(const vg_quintic* link, double x, double out[4]);

vg_limits vg_limits_of(const verge_body* body)
{
    double sine, cosine;
    vg_sincos(body->steer_max, &sine, &cosine);
    const double curvature = sine / cosine / body->wheelbase;
    return (vg_limits){
        .rear_axle = body->rear_axle,
        .wheelbase = body->wheelbase,
        .steer_rate_max = body->steer_rate_max,
        .curvature_max = curvature,
        .lateral_max = body->lateral_max,
        .per_curvature = 1.0 / curvature,
        .per_steer_rate = 1.0 / body->steer_rate_max,
        .per_speed_switch = 1.0 / body->speed_switch,
        .per_acceleration = 1.0 / body->acceleration_max,
        .per_speed = 1.0 / body->speed_max,
        .per_braking_squared = 1.0 / (body->braking_max * body->braking_max),
        .lateral_share = body->braking_max / body->lateral_max,
        .has_trailer = body->trailer_length > 0.0,
    };
}

vg_profile vg_profile_to_speed(const vg_state* start, double v1, double T)
{
    VERGE_ASSERT(T > 0.0 && v1 >= 0.0);
    if (v1 <= 0.0) {
        return stop_smoothly(start, T);
    }
    // a(T) = 0 and v(T) = v1; the free end position makes the quintic a quartic:
    // s(T) - s(0) = T (v0 + v1) / 2 + T^2 a0 / 12.
    const double dv = v1 - start->s_t, a = start->s_tt;
    vg_profile profile = { .count = 1 };
    profile.pieces[0] = (vg_piece){ 0.0, start->s, start->s_t, a,
                                    (6.0 * dv - 4.0 * a * T) / (T * T),
                                    (6.0 * a * T - 12.0 * dv) / (T * T * T) };
    return profile;
}

/// v(u) = (1 - u)^2 (v0 + (2 v0 + a0 T) u), u = t / T, is >= 0 while 3 v0 + a0 T >= 0.
static vg_profile stop_smoothly(const vg_state* start, double T)
{
    const double v = start->s_t;
    const double a = v > 1e-6 ? start->s_tt : 0.0;
    const double end = a < 0.0 ? vg_min(T, 3.0 * v / -a) : T;
    vg_profile profile = { .count = 1 };
    if (v <= 1e-6 || end < 1e-3) {
        profile.pieces[0] = (vg_piece){ .s = start->s };
        return profile;
    }
    profile.pieces[0] = (vg_piece){ 0.0, start->s, v, a,
                                    (-6.0 * v - 4.0 * a * end) / (end * end),
                                    (6.0 * a * end + 12.0 * v) / (end * end * end) };
    profile.pieces[1] = (vg_piece){ .t = end, .s = vg_profile_at(&profile, end).s };
    profile.count = 2;
    return profile;
}

vg_piece vg_profile_at(const vg_profile* profile, double t)
{
    VERGE_ASSERT(profile->count >= 1 && profile->count <= VG_PIECES_MAX);
    uint32_t i = profile->count - 1;
    while (i > 0 && t < profile->pieces[i].t) {
        --i;
    }
    const vg_piece* p = &profile->pieces[i];
    const double h = t - p->t;
    vg_piece at;
    at.t = t;
    at.s = p->s + h * (p->v + h * (p->a / 2.0 + h * (p->j / 6.0 + h * p->snap / 24.0)));
    at.v = p->v + h * (p->a + h * (p->j / 2.0 + h * p->snap / 6.0));
    at.a = p->a + h * (p->j + h * p->snap / 2.0);
    at.j = p->j + h * p->snap;
    at.snap = p->snap;
    return at;
}

void vg_leg_link(vg_leg* leg, const vg_state* start, double T, double offset)
{
    double slowest = start->s_t, fastest = start->s_t;
    for (uint32_t i = 1; i <= 20; ++i) { // 20 samples suffice for a speed that is cubic in time
        const double v = vg_profile_at(&leg->profile, T * i / 20.0).v;
        slowest = vg_min(slowest, v);
        fastest = vg_max(fastest, v);
    }
    if (slowest < VERGE_SPEED_SLOW) {
        const double distance = vg_profile_at(&leg->profile, T).s - start->s;
        vg_leg_link_by_distance(leg, start, distance, offset, vg_max(fastest, 0.5));
        return;
    }
    leg->s_start = start->s;
    leg->by_distance = false;
    const double v = start->s_t;
    const vg_axis_state here = { start->d, start->d1 * v,
                                 start->d2 * v * v + start->d1 * start->s_tt };
    link(leg, &here, T, offset, slowest);
}

void vg_leg_link_by_distance(vg_leg* leg, const vg_state* start, double distance, double offset,
                             double speed)
{
    VERGE_ASSERT(speed > 0.0);
    leg->s_start = start->s;
    leg->by_distance = true;
    const vg_axis_state here = { start->d, start->d1, start->d2 };
    // A lane change at walking speed turns as soon as steering and comfort allow it.
    const double share = vg_abs(offset - start->d) > link_change ? link_change_share : 1.0;
    link(leg, &here, vg_max(share * distance, link_distance_min), offset, speed);
}

/// The shortest link within the limits of steering and comfort, else the one nearest to them.
static void link(vg_leg* leg, const vg_axis_state* here, double shortest, double offset,
                 double speed)
{
    VERGE_ASSERT(shortest > 0.0);
    double least = VG_HUGE;
    leg->span = shortest;
    for (double span = shortest; span <= link_stretch_max * shortest && least > 1.0;
         span *= link_stretch_step) {
        const double strain = link_strain(leg, here, span, offset, speed);
        if (strain < least) {
            least = strain;
            leg->span = span;
        }
    }
    const vg_axis_state none = { 0.0, 0.0, 0.0 }, one = { 1.0, 0.0, 0.0 };
    leg->base = vg_quintic_between(*here, none, leg->span);
    leg->shape = vg_quintic_between(none, one, leg->span);
}

/// Largest ratio of the link to `offset` to the limits of steering rate and comfort; above 1 a
/// limit is exceeded. Steering rate limits the third derivative at both ends, comfort the second.
static double link_strain(const vg_leg* leg, const vg_axis_state* from, double T, double offset,
                          double speed)
{
    const double rise = offset - from->position, v = from->velocity, a = from->acceleration;
    const double first = 60.0 * rise / (T * T * T) - 36.0 * v / (T * T) - 9.0 * a / T;
    const double last = 60.0 * rise / (T * T * T) - 24.0 * v / (T * T) - 3.0 * a / T;
    const double third = vg_max(vg_abs(first), vg_abs(last));
    // Peak of the second derivative of a link from rest to rest: 10 / sqrt(3) rise / T^2.
    const double second = 5.7735 * vg_abs(rise - 0.5 * v * T) / (T * T);
    const vg_limits* limits = leg->limits;
    const double rate = link_steer_share * limits->steer_rate_max / limits->wheelbase; // [1/(m s)]
    const double lateral = vg_min(link_lateral_max, link_limit_share * limits->lateral_max);
    const double bend = vg_min(link_bend_max, link_limit_share * limits->curvature_max);
    const double third_max = leg->by_distance ? rate / speed : rate * speed * speed;
    const double second_max = leg->by_distance ? vg_min(lateral / (speed * speed), bend) : lateral;
    return vg_max(third / third_max, second / second_max);
}

/// Offset and three derivatives of a link, at x from its start.
static void link_at(const vg_quintic* link, double x, double out[4])
{
    const vg_axis_sample at = vg_quintic_at(link, x);
    out[0] = at.position;
    out[1] = at.velocity;
    out[2] = at.acceleration;
    out[3] = at.jerk;
}

/// The lateral polynomials at x. Where the link has ended, base and all derivatives are 0.
static void set_links(const vg_leg* leg, double x, vg_row* row)
{
    if (x >= leg->span) {
        row->shape[0] = 1.0;
        return;
    }
    link_at(&leg->base, x, row->base);
    link_at(&leg->shape, x, row->shape);
}

/// Converts derivatives by time to derivatives by distance.
static void convert_to_distance(double d[4], const vg_piece* at)
{
    const double iv = 1.0 / at->v;
    const double d1 = d[1] * iv;
    const double d2 = (d[2] - d1 * at->a) * iv * iv;
    const double d3 = (d[3] - 3.0 * d2 * at->v * at->a - d1 * at->j) * iv * iv * iv;
    d[1] = d1;
    d[2] = d2;
    d[3] = d3;
}

vg_row vg_leg_row(const vg_leg* leg, double t)
{
    VERGE_ASSERT(leg->span > 0.0);
    const vg_piece at = vg_profile_at(&leg->profile, t);
    vg_row row = { .line = vg_path_at(leg->path, at.s),
                   .s = at.s, .s_t = at.v, .s_tt = at.a, .s_ttt = at.j };
    const double x = leg->by_distance ? at.s - leg->s_start : t;
    set_links(leg, x, &row);
    if (!leg->by_distance && x < leg->span) {
        convert_to_distance(row.base, &at);
        convert_to_distance(row.shape, &at);
    }
    return row;
}

vg_row vg_leg_place(const vg_leg* leg, double s)
{
    VERGE_ASSERT(leg->by_distance && leg->span > 0.0);
    vg_row row = { .line = vg_path_at(leg->path, s), .s = s, .s_t = 1.0 };
    set_links(leg, s - leg->s_start, &row);
    return row;
}

vg_motion vg_motion_of(const vg_rear* rear)
{
    return (vg_motion){ rear->x, rear->y, vg_atan2(rear->sin_heading, rear->cos_heading),
                        vg_max(rear->speed, 0.0), rear->acceleration, rear->curvature };
}

vg_state vg_state_of(const vg_path* path, const vg_motion* rear, double s_guess)
{
    vg_state state = { .s = vg_path_project(path, rear->x, rear->y, s_guess) };
    const vg_reference at = vg_path_at(path, state.s);
    double sine, cosine;
    vg_sincos(rear->heading, &sine, &cosine);
    const double c = cosine * at.cos_heading + sine * at.sin_heading;
    const double s = sine * at.cos_heading - cosine * at.sin_heading;
    state.d = (rear->y - at.y) * at.cos_heading - (rear->x - at.x) * at.sin_heading;
    const double k = at.curvature, q = 1.0 - k * state.d;
    if (c < 0.2 || q < VG_FRAME_MIN) {
        return state; // more than 78 degrees from the line, or 1 - curvature * d is too small
    }
    const double tangent = s / c;
    state.d1 = q * tangent;
    const double bend = at.curvature_rate * state.d + k * state.d1;
    const double turn = rear->curvature * q / c - k; // derivative of the relative heading by s
    state.d2 = -bend * tangent + q / (c * c) * turn;
    state.s_t = rear->speed * c / q;
    state.s_tt = (rear->acceleration * c
                  - state.s_t * state.s_t * (q * tangent * turn - bend)) / q;
    state.valid = true;
    return state;
}

vg_motion vg_motion_of_centre(const vg_motion* rear, double curvature_t, double rear_axle)
{
    // The centre moves with (v, curvature v a) in the body's frame, a the distance of the axle.
    const double a = rear_axle;
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

vg_motion vg_motion_of_rear(const vg_motion* centre, double rear_axle)
{
    const double a = rear_axle;
    // Yaw rate over speed of a car's centre is below 0.5 / m. Measured states may have more. At 1 /
    // a the vehicle turns about its rear axle and the ratio is not defined.
    const double limit = 0.95 / vg_max(a, 1e-3);
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
