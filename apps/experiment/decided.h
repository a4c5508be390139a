/// Decided states driven exactly, without a trajectory planner: the paper's "without planning".
/// Between two decided states the station is a cubic through both ends and speeds, and the lateral
/// offset is linear. The body is parallel to its lane, because decisions have no heading, and their
/// search assumes parallel bodies, too.
///
/// Decided states come from one of two sources. Decision-only: one joint search from the initial
/// state, receding as in the paper, whose plan is followed to the end. Sequential: the baseline
/// that decides one vehicle after another, the farthest along the road first.
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

/// From a plan for the present state of the world.
void decided_from_plan(decided* self, const world* start, const verge_plan* plan);

/// By the sequential baseline, on a road of parallel lanes. False: out of memory. The motion of the
/// humans is predicted once, by their own model, with every controlled vehicle at constant speed in
/// its lane. The iterations of the joint search are divided equally among the vehicles, so that
/// numbers of nodes can be compared.
bool decided_from_sequential(decided* self, const world* start, uint64_t seed);

/// Decision step `step` of a vehicle as a trajectory of 0.1 s points for world_follow().
void decided_trajectory(const decided* self, const verge_road* road, const decided_vehicle* vehicle,
                        uint32_t step, verge_vehicle_plan* plan);

#endif
