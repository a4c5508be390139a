/// Straightening out: a slow vehicle that is turned against its lane, or whose wheel is turned,
/// drives on along the lane. Polynomials across the lane do not describe this motion: a vehicle
/// that is turned by 60 degrees comes back within a few metres, in which the wheel turns to its
/// limit and back. So the motion is simulated: a driver steers towards the lane, as fast and as far
/// as the steering allows, at walking speed.
#ifndef VG_STRAIGHTEN_H
#define VG_STRAIGHTEN_H

#include "motion/workspace.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Is this a vehicle for it: slow, and turned against its lane or with its wheel turned?
bool vg_straighten_applies(vg_workspace* ws, const vg_job* job);

/// Writes the trajectory to body and motion, with its cost. False: it would touch another body or
/// swing too far out of the lane. The vehicle keeps its lane whatever was decided; it moves only as
/// far as the decision expects it to.
bool vg_straighten(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);

#ifdef __cplusplus
}
#endif

#endif
