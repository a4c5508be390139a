/// Target regions (section 3.2.2): the end states of a segment that are sampled, a region around
/// the end state of the decision. The region of lane keeping is larger. It always includes the
/// hardest braking that the jerk limit allows, so that a vehicle can yield in its lane.
#ifndef VG_TARGET_H
#define VG_TARGET_H

#include "motion/sampler.h"
#include "motion/batch.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Cost of the difference between end speed and decided speed, per point [1/(m/s)^2]. The cost of
/// the paper has no such term, and without one the cheapest candidate for AC is the slowest of the
/// region. With 10, a vehicle whose decision gains 0.9 m/s gains about 0.75 m/s. The term orders
/// the candidates and is not part of the cost reported.
#define VG_DECISION_PULL 10.0
/// The same where the vehicle brakes without the limits of normal driving.
#define VG_DECISION_PULL_HARD 50.0
/// The same for the end offset of a lane change, for which the paper has no offset term. Without
/// it a lane change would always end at the near edge of its region. Per point [1/m^2].
#define VG_DECISION_PULL_OFFSET 1.0

/// Deceleration towards a speed limit below the present speed: coasting. [m/s^2]
#define VG_LIMIT_BRAKING 1.5

/// Fills legs, penalties and offsets of a batch for one segment of duration T from a state. The end
/// speeds are lowered behind bodies ahead (follow.h) and above the speed limit.
/// reference: the lane of the path, whose speed limit applies.
void vg_target_sample(vg_batch* batch, const vg_job* job, const vg_limits* limits,
                      const vg_segment* segment, const vg_path* path, uint32_t reference,
                      const vg_state* start, double T, const verge_tracks* tracks, bool emergency);

#ifdef __cplusplus
}
#endif

#endif
