/// The reward of a joint plan: the three parts of R_i (section 3.1.4) and X_flow (Eq. 5).
#ifndef VG_REWARD_H
#define VG_REWARD_H

#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Adds the reward that each controlled slot earns by its action from `before` to `next`.
void vg_flow_earn(const vg_model* model, const vg_flow* before, const vg_moves* moves,
                  vg_flow* next, const uint8_t* actions);

/// All controlled vehicles with a target have driven target_distance in their target lanes.
bool vg_flow_terminal(const vg_model* model, const vg_flow* flow);

/// The vehicle is in its target lane, or in a lane that continues it, and within VG_REACHED_OFFSET
/// of its centre.
bool vg_flow_in_target(const vg_model* model, const vg_flow* flow, uint32_t slot);

/// X_flow (Eq. 5) of a simulation that ended in this flow after `step` of def->steps steps.
/// whole: it reached the horizon or a terminal flow. If not, the remaining steps earn nothing.
double vg_flow_reward(const vg_model* model, const vg_flow* flow, uint32_t step, bool whole);

#ifdef __cplusplus
}
#endif

#endif
