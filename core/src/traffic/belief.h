/// What the uncontrolled vehicles of a scene may be about to do: hypotheses, weighed by what each
/// vehicle did since the last time (verge_beliefs).
///
/// Weights     From update to update a weight is multiplied by how well its hypothesis explains
///             the acceleration and the lateral speed since then, and moves a tenth of the way to
///             what is usual (prior). So it is mostly the last second that counts.
/// Use         rank.c lets a vehicle go first that is not believed to yield; the plan document
///             shows all weights.
#ifndef VG_BELIEF_H
#define VG_BELIEF_H

#include "traffic/order.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Weighs the hypotheses anew for all uncontrolled vehicles of a scene. Those that were not there
/// for two seconds are forgotten. order: with its shared areas, null: there are none.
void vg_belief_update(verge_beliefs* beliefs, const vg_model* model, const vg_flow* flow,
                      const verge_scene* scene, const vg_order* order);

/// The belief about a vehicle, null: there is none.
const verge_belief* vg_belief_of(const verge_beliefs* beliefs, int32_t id);

#ifdef __cplusplus
}
#endif

#endif
