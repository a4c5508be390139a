/// The motion of one candidate: a longitudinal profile s(t), a lateral polynomial d, and the exact
/// motion of the rear axle that follows from both (Werling et al. 2010, in the frame of the line).
///
/// Lateral motion is a function of distance: d(s) and its derivatives. At speeds above
/// VERGE_SPEED_SLOW it is planned in time, d(t), and converted to d(s). So the same formulas are
/// valid at standstill and on a motorway. The polynomial is linear in its end offset,
///     d = base + offset * shape,
/// so candidates that share a profile differ in one multiplication only (vg_row). The loop over
/// offsets has neither look-ups nor trigonometry.
#ifndef VG_KINEMATICS_H
#define VG_KINEMATICS_H

#include "geometry/quintic.h"
#include "motion/path.h"
#include "base/scalar.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Smallest 1 - curvature * d: below it the point is too near the line's centre of curvature. [1]
#define VG_FRAME_MIN 0.1

/// Largest jerk of any trajectory: the rate at which brakes build up their force. [m/s^3]
#define VG_JERK_MAX 12.0

/// Motion of a point in the plane.
typedef struct vg_motion {
    double x, y, heading;  ///< [m], [m], [rad]
    double speed;          ///< [m/s] >= 0
    double acceleration;   ///< [m/s^2] along the path
    double curvature;      ///< [1/m]
} vg_motion;

/// The limits of a body for the inner loop of the sampler: reciprocals, so that a ratio is a
/// product.
typedef struct vg_limits {
    double rear_axle, wheelbase;   ///< [m]
    double steer_rate_max;         ///< [rad/s]
    double curvature_max;          ///< [1/m] of the rear axle
    double lateral_max;            ///< [m/s^2]
    double per_curvature, per_steer_rate, per_speed_switch, per_acceleration, per_speed;
    double per_braking_squared;    ///< [s^4/m^2]
    double lateral_share;          ///< [1] largest braking over largest lateral acceleration
    bool   has_trailer;
} vg_limits;

vg_limits vg_limits_of(const verge_body* body);

/// The motion of the centre from that of the rear axle, and back; the axle is `rear_axle` [m]
/// behind the centre. The curvature is yaw rate over speed of the point, the heading that of the
/// body. curvature_t: rate of the rear axle's curvature [1/(m s)], for the exact acceleration of
/// the centre. The conversion back assumes a rate of 0 and limits the curvature.
vg_motion vg_motion_of_centre(const vg_motion* rear, double curvature_t, double rear_axle);
vg_motion vg_motion_of_rear(const vg_motion* centre, double rear_axle);

/// Position of the rear axle on a path: distance with derivatives by time, offset with derivatives
/// by distance. All of them are defined at standstill.
typedef struct vg_state {
    double s, s_t, s_tt;  ///< [m], [m/s] >= 0, [m/s^2]
    double d, d1, d2;     ///< [m], [1], [1/m]: d, dd/ds, d2d/ds2
    bool   valid;         ///< false: the body is across the line, or 1 - curvature * d is too small
} vg_state;

/// s(t) in up to two pieces of constant snap; the last one has no end.
enum { VG_PIECES_MAX = 2 };
typedef struct vg_piece {
    double t, s, v, a, j, snap;
} vg_piece;
typedef struct vg_profile {
    uint32_t count;
    vg_piece pieces[VG_PIECES_MAX];
} vg_profile;

/// One end speed of one segment: its candidates differ in their end offset only.
typedef struct vg_leg {
    const vg_path* path;
    const vg_limits* limits; ///< of the vehicle that drives it
    vg_profile profile;   ///< t = 0 at the start of the segment
    double s_start;       ///< [m]
    bool   by_distance;   ///< the lateral polynomial is d(s); else d(t)
    double span;          ///< [m] or [s] after which the offset is reached
    vg_quintic base;      ///< from the start state to offset 0, by distance or time
    vg_quintic shape;     ///< from rest at offset 0 to rest at offset 1
} vg_leg;

/// One leg at one instant.
typedef struct vg_row {
    vg_reference line;
    double s, s_t, s_tt, s_ttt;
    double base[4], shape[4]; ///< d and its first three derivatives by distance
} vg_row;

/// The rear axle at one instant.
typedef struct vg_rear {
    double x, y, cos_heading, sin_heading;
    double d;               ///< [m] from the line
    double cos_off, sin_off;///< [1] of the heading against the line's
    double speed, acceleration, jerk;
    double curvature, curvature_t; ///< [1/m], [1/(m s)]
    double frame;           ///< [1] 1 - curvature_r * d, before it is guarded
    double d1, d2;          ///< [1], [1/m]
} vg_rear;

/// State on a path of a rear axle that moves like this, near coordinate s.
vg_state vg_state_of(const vg_path* path, const vg_motion* rear, double s_guess);
vg_motion vg_motion_of(const vg_rear* rear);

/// Jerk-optimal profile from (s, v, a) to speed v1 and acceleration 0 after T, with free end
/// position. With v1 = 0 it never moves backwards: it stops earlier if the present deceleration
/// requires it.
vg_profile vg_profile_to_speed(const vg_state* start, double v1, double T);
/// End speed of the profile to a speed above 0 that begins with this jerk, from (v, a). [m/s]
static inline double vg_profile_end_speed(double v, double a, double T, double jerk)
{
    return v + (4.0 * a * T + jerk * T * T) / 6.0;
}
vg_piece vg_profile_at(const vg_profile* profile, double t);

/// Chooses the lateral polynomials of a leg of duration T that ends near an offset: by time, or by
/// distance at low speed. They are longer than T if the steering requires it; the lateral motion
/// then continues beyond the leg.
void vg_leg_link(vg_leg* leg, const vg_state* start, double T, double offset);
/// The same by distance at any speed, `distance` long or longer. speed: the highest one. [m], [m/s]
void vg_leg_link_by_distance(vg_leg* leg, const vg_state* start, double distance, double offset,
                             double speed);
vg_row vg_leg_row(const vg_leg* leg, double t);
/// The leg at s, without a profile: derivatives are by s, as at a speed of 1 along the line. Only
/// for lateral motion by distance.
vg_row vg_leg_place(const vg_leg* leg, double s);

/// Motion of the rear axle. Without branches, so that loops over offsets are vectorized. The second
/// derivative of the line's curvature is taken as 0.
static inline vg_rear vg_rear_of(const vg_row* row, double offset)
{
    const double k = row->line.curvature, k1 = row->line.curvature_rate;
    const double d  = row->base[0] + offset * row->shape[0];
    const double d1 = row->base[1] + offset * row->shape[1];
    const double d2 = row->base[2] + offset * row->shape[2];
    const double d3 = row->base[3] + offset * row->shape[3];

    // (q, d1) is the derivative of the position by s, in the frame of the line; m is its length.
    const double frame = 1.0 - k * d;
    const double q  = vg_max(frame, 0.5 * VG_FRAME_MIN);
    const double q1 = -(k1 * d + k * d1);
    const double q2 = -(2.0 * k1 * d1 + k * d2);
    const double m  = vg_sqrt(q * q + d1 * d1);
    const double im = 1.0 / m;
    const double m1 = (q * q1 + d1 * d2) * im;
    const double m2 = (q1 * q1 + q * q2 + d2 * d2 + d1 * d3 - m1 * m1) * im;

    // Curvature is the cross product of first and second derivative over m^3.
    const double along = q1 - k * d1, across = d2 + k * q;
    const double cross = q * across - d1 * along;
    const double cross1 = q1 * across + q * (d3 + k1 * q + k * q1)
                        - d2 * along - d1 * (q2 - k1 * d1 - k * d2);
    const double im3 = im * im * im;
    const double c = q * im, s = d1 * im;
    const double v = row->s_t;

    vg_rear rear;
    rear.x = row->line.x - d * row->line.sin_heading;
    rear.y = row->line.y + d * row->line.cos_heading;
    rear.cos_heading = row->line.cos_heading * c - row->line.sin_heading * s;
    rear.sin_heading = row->line.sin_heading * c + row->line.cos_heading * s;
    rear.d = d;
    rear.cos_off = c;
    rear.sin_off = s;
    rear.speed = v * m;
    rear.acceleration = row->s_tt * m + v * v * m1;
    rear.jerk = row->s_ttt * m + 3.0 * v * row->s_tt * m1 + v * v * v * m2;
    rear.curvature = cross * im3;
    rear.curvature_t = (cross1 - 3.0 * cross * m1 * im) * im3 * v;
    rear.frame = frame;
    rear.d1 = d1;
    rear.d2 = d2;
    return rear;
}

/// Largest ratio of a quantity to its limit of the body; above 1 a limit is exceeded. s_t: speed
/// along the line. [m/s]
static inline double vg_hard_ratio(const vg_limits* limits, const vg_rear* rear, double s_t)
{
    const double v = rear->speed, a = rear->acceleration;
    const double lateral = v * v * rear->curvature * limits->lateral_share;
    const double bend = limits->wheelbase * rear->curvature;
    const double steer = vg_abs(limits->wheelbase * rear->curvature_t / (1.0 + bend * bend));
    double worst = vg_abs(rear->curvature) * limits->per_curvature;
    worst = vg_max(worst, steer * limits->per_steer_rate);
    worst = vg_max(worst, a * vg_max(1.0, v * limits->per_speed_switch)
                              * limits->per_acceleration);
    worst = vg_max(worst, (a * a + lateral * lateral) * limits->per_braking_squared);
    worst = vg_max(worst, v * limits->per_speed);
    worst = rear->frame < VG_FRAME_MIN ? 1e9 : worst;
    return s_t < -1e-9 ? 1e9 : worst;
}

/// Limits of normal driving, as reciprocals so that a ratio is a product.
typedef struct vg_comfort {
    double acceleration, braking, lateral, jerk;
} vg_comfort;

static inline double vg_comfort_ratio(const vg_comfort* limit, const vg_rear* rear)
{
    const double a = rear->acceleration;
    double worst = vg_abs(rear->speed * rear->speed * rear->curvature) * limit->lateral;
    worst = vg_max(worst, a * limit->acceleration);
    worst = vg_max(worst, -a * limit->braking);
    return vg_max(worst, vg_abs(rear->jerk) * limit->jerk);
}

#ifdef __cplusplus
}
#endif

#endif
