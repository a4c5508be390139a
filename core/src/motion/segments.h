/// Converts a decision to segments for the sampler: one segment for each run of equal actions.
#ifndef VG_SEGMENTS_H
#define VG_SEGMENTS_H

#include "motion/expected.h"
#include "motion/sampler.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The segments of a job inside the planning horizon, and the lane it changes to.
void vg_segments_from(const vg_expected* expected, vg_job* job);

/// Continues a lane change to `lane` (index) that ends `left` [s] from now as planned when it
/// began. Without this, each new decision would begin the change again and it would never end.
/// Nothing changes if the decision does not lead to that lane any more.
void vg_segments_finish_change(const vg_expected* expected, uint32_t lane, double left,
                               vg_job* job);

#ifdef __cplusplus
}
#endif

#endif
