/// Straightening out: a slow vehicle that is turned against its lane, or whose wheel is turned,
/// drives on along the lane. Polynomials across the lane do not describe this motion: a vehicle
/// that is turned by 60 degrees comes back within a few metres, in which the wheel turns to its
/// limit and back. So the motion is simulated: a driver steers towards the lane, as fast and as far
/// as the steering allows, at walking speed. A vehicle that stands close behind another one comes
/// out into the lane beside it in the same way, and a corner that is sharper than the steering is
/// driven as near to its line as can be.
#ifndef VG_STRAIGHTEN_H
#define VG_STRAIGHTEN_H

#include "motion/workspace.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Can a vehicle be driven so? It is slow and pulls no trailer.
bool vg_straighten_can(const vg_workspace* ws, const vg_job* job);

/// Has it to be? It is turned against its lane, or its wheel is.
bool vg_straighten_applies(vg_workspace* ws, const vg_job* job);

/// The lane towards which it steers: that of a change that begins at once, else its own.
uint32_t vg_straighten_lane(const vg_job* job);

/// Is a body ahead in the vehicle's own lane so close that it has to come out at once?
bool vg_straighten_is_close(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);

/// Writes the trajectory to body and motion, with its cost. False: it would touch another body, now
/// or a few seconds later, or swing too far out of the lanes. The vehicle moves only as far as the
/// decision expects it to.
bool vg_straighten(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks, uint32_t lane);

#ifdef __cplusplus
}
#endif

#endif
