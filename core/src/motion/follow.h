/// Keeping a distance: how fast a segment may end behind the bodies that are ahead in its path,
/// so that a comfortable braking ends def->idm_gap behind the nearest of them. The alert zone of
/// Eq. 8 cannot do that: its depth D_s (Eq. 2) vanishes at standstill.
#ifndef VG_FOLLOW_H
#define VG_FOLLOW_H

#include "motion/kinematics.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Braking a vehicle counts on behind others. [m/s^2] what adaptive cruise controls do at ease
#define VG_FOLLOW_BRAKING 2.0

/// One segment for which a distance is kept.
typedef struct vg_following {
    const vg_path*   path;
    const verge_tracks* tracks;
    uint32_t own;          ///< index of the own track
    double   rear_axle;    ///< [m] behind the own centre
    uint32_t start, last;  ///< instants of the trajectory the segment lies between
    double   T;            ///< [s] its length
    double   gap;          ///< [m] bumper to bumper at standstill
    double   clearance;    ///< [m] to both sides within which a body is in the path
} vg_following;

/// Highest end speed [m/s] from which braking [m/s^2] keeps the gap to everyone who is ahead at
/// the segment's start, goes the same way or stands, and is in the path at its end. Below zero:
/// the vehicle has to stop earlier, after T v0 / (v0 - speed). VG_HUGE: nobody is near.
double vg_follow_speed(const vg_following* following, const vg_state* from, double braking);

#ifdef __cplusplus
}
#endif

#endif
