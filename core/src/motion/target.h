/// Target regions (section 3.2.2): where a segment may end. The decision's one end state becomes
/// a region around it; lane keeping gets a larger one, which always reaches down to the hardest
/// braking the jerk limit allows, so that a vehicle can yield in its lane.
#ifndef VG_TARGET_H
#define VG_TARGET_H

#include "motion/sampler.h"
#include "motion/batch.h"

#ifdef __cplusplus
extern "C" {
#endif

/// No trajectory of ours changes its acceleration faster: what brakes can build up. [m/s^3]
#define VG_JERK_MAX 12.0

/// Holds a trajectory to its decision: cost of a missed end speed, per point [1/(m/s)^2]. The
/// paper's cost has no such term, and without one the cheapest answer to AC is to stay as slow
/// as the region allows. With 10 a vehicle told to gain 0.9 m/s gains about 0.75. It orders the
/// candidates and is not part of the cost reported.
#define VG_DECISION_PULL 10.0
/// The same for the end offset of a change, where the paper's offset term is off: without it a
/// change would end at the near edge of its region, always. Per point [1/m^2].
#define VG_DECISION_PULL_OFFSET 1.0

/// Slowing down towards a speed limit that is lower than the speed driven. [m/s^2] coasting
#define VG_LIMIT_BRAKING 1.5

/// Fills legs, penalties and offsets of a batch for one segment of length T from a state, between
/// the batch's instants. The region comes down where someone is ahead (follow.h), and where the
/// vehicle is faster than the speed limit.
/// reference: the lane the path follows, whose speed limit holds.
void vg_target_sample(vg_batch* batch, const vg_job* job, const vg_limits* limits,
                      const vg_segment* segment, const vg_path* path, uint32_t reference,
                      const vg_state* start, double T, const verge_tracks* tracks, bool emergency);

#ifdef __cplusplus
}
#endif

#endif
