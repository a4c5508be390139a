/// From a decision to what the sampler plans by: one segment for each run of equal actions.
#ifndef VG_SEGMENTS_H
#define VG_SEGMENTS_H

#include "motion/expected.h"
#include "motion/sampler.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The segments of a job inside the planning horizon, and the lane it changes to.
void vg_segments_from(const vg_expected* expected, vg_job* job);

/// A lane change under way ends when it was going to, `left` [s] from now, whatever the decision
/// calls the steps until then: begun anew with each decision it would never end. Does nothing where
/// the decision does not go to that lane (index) any more.
void vg_segments_finish_change(const vg_expected* expected, uint32_t lane, double left, vg_job* job);

#ifdef __cplusplus
}
#endif

#endif
