/// From a decision to what people read (action steps) and what the sampler plans by (jobs).
#ifndef VG_GUIDE_H
#define VG_GUIDE_H

#include "decide/mcts.h"
#include "motion/sampler.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The action steps of one planned slot. ids[slot]: vehicle id.
void vg_guide_actions(const vg_model* scene, const vg_decision* decision, uint32_t slot,
                      const int32_t* ids, verge_vehicle_plan* plan);

/// The segments of one planned slot inside the planning horizon: one for each run of equal
/// actions.
void vg_guide_segments(const vg_model* scene, const vg_decision* decision, uint32_t slot, vg_job* job);

/// A change that is under way ends when it was going to, `left` [s] from now, whatever the decision
/// calls the steps until then: begun anew with each decision it would never be over. Does nothing
/// where the decision does not go to that lane (index) any more.
void vg_guide_finish_change(const vg_model* scene, const vg_decision* decision, uint32_t slot, uint32_t lane,
                            double left, vg_job* job);

/// For a vehicle on no lane: it slows down where it is.
void vg_guide_off_road(const verge_planner_def* def, const verge_vehicle* vehicle,
                       verge_vehicle_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
