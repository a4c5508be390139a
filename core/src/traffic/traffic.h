/// The memory in which a stage computes the traffic of one scene. Nothing in it is needed after the
/// call of the stage, so decision and prediction can share one.
#ifndef VG_TRAFFIC_H
#define VG_TRAFFIC_H

#include "traffic/order.h"
#include "verge/def.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_traffic {
    vg_pairs* pairs;
    vg_model* model;
    vg_flow*  flows; ///< [3] the scene, and two states after it
    vg_order* order; ///< who passes conflict areas first
} vg_traffic;

/// Takes memory for def->vehicles_max vehicles on a road of def->road.lane_count lanes, 0: not
/// known. Null pointers where it does not fit, or the arena is measuring.
vg_traffic vg_traffic_take(vg_arena* arena, const verge_planner_def* def);

#ifdef __cplusplus
}
#endif

#endif
