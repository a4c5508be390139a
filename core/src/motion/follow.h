/// Distance keeping: the highest end speed of a segment from which comfortable braking ends
/// def->idm_gap behind the nearest body ahead in the path. The alert zone of Eq. 8 does not ensure
/// this: its depth D_s (Eq. 2) is 0 at standstill.
#ifndef VG_FOLLOW_H
#define VG_FOLLOW_H

#include "motion/kinematics.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Braking assumed behind other vehicles: comfortable braking of an adaptive cruise control.
/// [m/s^2]
#define VG_FOLLOW_BRAKING 2.0

/// The inputs for one segment.
typedef struct vg_following {
    const vg_path*   path;
    const verge_tracks* tracks;
    uint32_t own;          ///< index of the own track
    double   rear_axle;    ///< [m] behind the own centre
    uint32_t start, last;  ///< first and last instant of the segment in the trajectory
    double   T;            ///< [s] duration of the segment
    double   gap;          ///< [m] between the bodies at standstill
    double   clearance;    ///< [m] lateral gap below which a body is in the path
    double   offset;       ///< [m] of the own body from the path at the end of the segment
    double   driven;       ///< [m] decided for the segment: it leads past bodies that enter the path
                           ///< behind it; 0: not known
} vg_following;

/// The inputs for a trajectory that stays on one path up to the horizon.
vg_following vg_following_to_horizon(const verge_planner_def* def, const vg_path* path,
                                     const verge_tracks* tracks, uint32_t own, double rear_axle);

/// Highest end speed [m/s] from which braking [m/s^2] keeps the gap to all bodies that are ahead at
/// the start of the segment, are in the path at its end, and stand or move along it, either way.
/// One that enters the path during the segment, behind where the own centre is then, is not ahead.
/// Below zero: the vehicle has to stop earlier, after T v0 / (v0 - speed). VG_HUGE: no body is
/// near.
double vg_follow_speed(const vg_following* following, const vg_state* from, double braking);

#ifdef __cplusplus
}
#endif

#endif
