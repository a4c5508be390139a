/// Decided states driven exactly, without a trajectory planner: what the paper calls "without
/// planning". Between two decided states speed changes evenly (a cubic through both ends) and
/// the lateral offset linearly. The body stays parallel to its lane: decisions know no heading,
/// and the bodies their search keeps apart are parallel, too.
///
/// Two sources of decided states: one joint search from the initial state (decision-only: the
/// search itself is receding, as the paper's; its plan is then followed to the end), and the
/// sequential baseline, vehicle by vehicle in order of their way along the road, farthest first.
#ifndef VERGE_EXPERIMENT_DECIDED_H
#define VERGE_EXPERIMENT_DECIDED_H

#include "common/world.h"

typedef struct decided_state {
    int32_t lane_id;
    double  s, d, v; ///< [m], [m], [m/s]
} decided_state;

/// One vehicle's decisions from t = 0 on.
typedef struct decided_vehicle {
    int32_t  id;
    uint32_t step_count;
    decided_state     states[VERGE_STEPS_MAX + 1]; ///< 0: at the start
    verge_action_step steps[VERGE_STEPS_MAX];      ///< lights and names
} decided_vehicle;

typedef struct decided {
    double   step_s;         ///< [s]
    uint32_t vehicle_count;
    decided_vehicle vehicles[VERGE_CONTROLLED_MAX];
    uint32_t nodes, nodes_first;
} decided;

/// From a plan made for the world as it is.
void decided_from_plan(decided* self, const world* start, const verge_plan* plan);

/// By the sequential baseline. The road must be one of parallel lanes. False: out of memory.
/// Humans are predicted once, by the model they move by, with every controlled vehicle keeping
/// its speed and lane. The iteration budget is that of the joint search, shared out evenly, so
/// that nodes compare.
bool decided_from_sequential(decided* self, const world* start, uint64_t seed);

/// Decision step `step` of a vehicle as a trajectory of 0.1 s points for world_follow().
void decided_trajectory(const decided* self, const verge_road* road, const decided_vehicle* vehicle,
                        uint32_t step, verge_vehicle_plan* plan);

#endif
