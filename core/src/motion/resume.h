/// The rest of a vehicle's last plan, with a stop at its end: the first rung of the fallback. Where
/// sampling finds nothing new, the motion announced in the last cycle is often still without a
/// contact.
///
/// The last plan gives a line and speeds. The line begins at the first point of that plan and is
/// driven from where the vehicle is now, so that a small deviation from the plan does not matter.
#ifndef VG_RESUME_H
#define VG_RESUME_H

#include "motion/kinematics.h"
#include "motion/sampler.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Builds the line of the rear axle, and the vehicle's state on it. The path coordinate is the
/// distance from the first point. rear: the rear axle now, rear_axle [m] behind the centre. Returns
/// false, and an invalid state, if the job has no last plan of the same vehicle that is within its
/// horizon, that was no hard braking, and that the vehicle follows; or if that plan hardly moves.
bool vg_resume_path(vg_path* path, vg_state* state, const vg_job* job, const vg_motion* rear,
                    double rear_axle);

/// Deceleration of the centre t [s] from now, at `speed`: it follows the speed of the last plan,
/// and ends in a comfortable stop after its end. < 0: acceleration. [m/s^2]
double vg_resume_level(const vg_job* job, double t, double speed);

#ifdef __cplusplus
}
#endif

#endif
