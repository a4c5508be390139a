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

/// BEST: sets the losses at the root, from which those of plans are counted. reached: slots (bits)
/// that have been in their target lane and may leave it to overtake.
void vg_flow_begin(vg_model* model, const vg_flow* root, uint32_t reached);

/// BEST: what the vehicle at slot loses by the way it has driven for t [s] since the root, against
/// driving alone at the speeds of the road: time, and what its state at the end costs further. [s]
float vg_flow_loss(const vg_model* model, const vg_flow* flow, uint32_t slot, float t);

/// BEST. The largest R_i that any plan of a slot can earn from this root: what lane changes cost that
/// it cannot do without. [1]
double vg_reward_most(const vg_model* model, const vg_flow* root, uint32_t slot);

#ifdef __cplusplus
}
#endif

#endif
