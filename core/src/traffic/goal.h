/// Where in its lane a vehicle drives: in the centre, or beside a body that stands partly in the
/// lane and leaves room enough. What lies wholly beside the lane, or blocks it, changes nothing.
#ifndef VG_GOAL_H
#define VG_GOAL_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Fills model->bodies from the vehicles that are VG_STATIC. A part of vg_model_from().
void vg_model_find_bodies(vg_model* model, const vg_flow* flow);

/// The d [m] at which a controlled slot is to drive on its way from where it is to this station of
/// its lane: 0 but where a body is to be passed.
float vg_lane_goal(const vg_model* model, const vg_flow* flow, uint32_t slot, float station);

/// The same for a lane that the slot changes to: one of the lanes beside its own.
float vg_goal_in(const vg_model* model, const vg_flow* flow, uint32_t slot, int32_t lane,
                 float station);

/// Lowers the speed limit of a controlled slot before and beside a body that it passes: 8 m/s, or
/// 5 m/s where less than half a metre is left between both.
void vg_goal_limit(const vg_model* model, vg_flow* flow, uint32_t slot);

#ifdef __cplusplus
}
#endif

#endif
