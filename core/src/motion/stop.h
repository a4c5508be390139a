/// The stopping continuation: how a vehicle slows down, up to standstill, along the way it drives.
///
///     vg_leg leg;
///     vg_stop_in_lane(&leg, path, &limits, &state, goal);    // where: a line across the lane
///     vg_stop stop = vg_stop_from(&leg, goal, v, a, level, jerk);
///     vg_stop_advance(&stop, 0.01);                          // when: step by step
///     vg_rear rear = vg_stop_at(&stop);
///
/// Where the vehicle drives depends on distance only, when it is there on the profile. The profile
/// is planned for the centre of the body, along the distance that the centre drives. A profile
/// along the reference line would not do: beside a bend of curvature k the speed is 1 - k d times
/// that along the line, so a vehicle that brakes along the line can speed up.
///
/// Deceleration builds up and ends with limited jerk, never exceeds `level`, and leaves the tyres
/// what the bend needs of them (vg_limits.per_braking_squared). A vehicle never moves faster than
/// it began, except by the acceleration it has, which ends at VG_JERK_MAX. The motion is integrated
/// in steps of at most VG_STOP_STEP.
///
/// The fallback (fallback.c) is made of these: along the lane, along the line of the last plan
/// (resume.h), or straight ahead.
#ifndef VG_STOP_H
#define VG_STOP_H

#include "motion/kinematics.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Longest step of the integration. [s]
#define VG_STOP_STEP 0.01

/// A vehicle on its way to standstill.
typedef struct vg_stop {
    const vg_leg* leg;    ///< by distance; its profile is not used
    double offset;        ///< [m] end offset of the leg
    double level;         ///< [m/s^2] largest deceleration; < 0: accelerates up to speed_max
    double jerk;          ///< [m/s^3]
    double speed_max;     ///< [m/s]
    double s;             ///< [m] coordinate of the rear axle on the leg's path
    vg_rear place;        ///< the rear axle there, with derivatives by the distance along the path
    double speed, acceleration, rate; ///< of the centre: [m/s], [m/s^2], [m/s^3]
} vg_stop;

/// The way from a state to an offset in the lane, as short as steering and comfort allow, and at
/// least as long as the distance of three seconds.
void vg_stop_in_lane(vg_leg* leg, const vg_path* path, const vg_limits* limits,
                     const vg_state* state, double offset);

/// The way straight ahead: the wheel is turned back from the curvature it has to straight, at the
/// rate that the steering allows at the speed of `rear`. Curvature and lateral acceleration only
/// fall, so a vehicle within the limits of its body can always drive it. The path of the leg is
/// built in `path`, which needs VG_STOP_KNOTS knots.
void vg_stop_straight(vg_leg* leg, vg_path* path, const vg_limits* limits, const vg_motion* rear);
enum { VG_STOP_KNOTS = 33 };

/// Begins at the start of a leg. speed, acceleration: of the centre of the body.
vg_stop vg_stop_from(const vg_leg* leg, double offset, double speed, double acceleration,
                     double level, double jerk);

/// Motion of the rear axle now.
vg_rear vg_stop_at(const vg_stop* stop);

/// Goes on by h <= VG_STOP_STEP. [s]
void vg_stop_advance(vg_stop* stop, double h);

#ifdef __cplusplus
}
#endif

#endif
