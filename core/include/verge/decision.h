/// The first stage: what all controlled vehicles do, jointly, for the next seconds.
///
///     verge_decider* decider;
///     verge_decider_init(&decider, &def, memory, verge_decider_memory_size(&def));
///     verge_decision decision = verge_decision_make(vehicles, 16);
///     static verge_commitment commitment; // all zero: nothing was decided before
///     verge_decide(decider, &scene, &commitment, &decision);
///
/// A decision is plain data: the trajectory stage (trajectory.h) takes one from verge_decide(), from
/// a message or written by hand. apps/examples/own_decision.c writes its own.
///
/// Memory      The caller owns it; nothing is allocated. See verge_decider_memory_size().
/// Threads     One decider serves one thread at a time.
#ifndef VERGE_DECISION_H
#define VERGE_DECISION_H

#include "verge/scene.h"

#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/// One decision step of one vehicle: what it does from t0 to t1 and the state expected at t1.
typedef struct verge_action_step {
    verge_action action;
    int32_t lane_id;        ///< the lane at t1
    double  t0, t1;         ///< [s] from the plan's utime
    double  s, d, v;        ///< [m], [m], [m/s] expected at t1, in lane_id
    double  distance;       ///< [m] driven along the lanes from t0 to t1
    bool    brake_light;
    int32_t turn_signal;    ///< -1 right, 0 none, 1 left
    int32_t ahead_id;       ///< vehicle expected directly ahead at t1 in its path, -1 none
    int32_t behind_id;      ///< vehicle expected directly behind at t1, -1 none
} verge_action_step;

/// Writes the step as one sentence a passenger understands ("changing to the right lane behind
/// vehicle 3"), always null-terminated, at most size bytes. Returns the length written.
size_t verge_action_say(const verge_action_step* step, char* text, size_t size);

/// What one vehicle does: consecutive steps from t0 = 0 of the first on.
typedef struct verge_vehicle_decision {
    int32_t  vehicle_id;
    uint32_t step_count; ///< 0 .. VERGE_STEPS_MAX; at least the planning horizon long
    verge_action_step steps[VERGE_STEPS_MAX];
} verge_vehicle_decision;

/// Of two vehicles that use the same area: which one passes it first.
typedef struct verge_passing {
    int32_t first_id, second_id;
    int32_t first_lane_id, second_lane_id; ///< lanes that share the area
} verge_passing;

/// How the search went.
typedef struct verge_search_report {
    uint32_t iterations;  ///< done: always the budget
    uint32_t nodes;       ///< created
    uint32_t nodes_first; ///< created until the returned plan was first found
    uint32_t depth;       ///< deepest node
    uint32_t pruned;      ///< joint actions refused for a conflict
    uint32_t unexpanded;  ///< iterations that found the node pool full and went on without a node
    double   reward;      ///< [1] X_flow of the returned plan, in [0, 1] (Eq. 5)
    double   bound;       ///< [1] X_flow that no plan of this cycle exceeds
    bool     complete;    ///< every intention is reached within the horizon of the returned plan
} verge_search_report;

/// The joint decision. The arrays are the caller's.
typedef struct verge_decision {
    int64_t  utime;                    ///< [us] t = 0 of all steps: that of the scene
    uint32_t vehicle_count;            ///< controlled vehicles on the road
    uint32_t vehicles_max;             ///< length of `vehicles`
    verge_vehicle_decision* vehicles;  ///< ascending ids
    uint32_t passing_count;            ///< 0: no order is stated
    uint32_t passings_max;             ///< length of `passings`; may be 0
    verge_passing* passings;           ///< may be null where passings_max is 0
    verge_search_report search;        ///< zero where no search was made
} verge_decision;

/// A decision of nobody, in an array of vehicles_max elements that outlives it; no order of passing.
static inline verge_decision verge_decision_make(verge_vehicle_decision* vehicles, uint32_t vehicles_max)
{
    verge_decision decision;
    memset(&decision, 0, sizeof decision);
    decision.vehicles_max = vehicles_max;
    decision.vehicles = vehicles;
    return decision;
}

/// The decision of a vehicle, null if there is none.
const verge_vehicle_decision* verge_decision_of(const verge_decision* decision, int32_t vehicle_id);

/// What was decided before, so that the next decision keeps to it unless a better one pays
/// (verge_planner_def.switch_margin). Zero-filled: nothing yet. The caller keeps it from step to
/// step; verge_decide() reads and replaces it. One with counts beyond the capacities is ignored.
typedef struct verge_commitment {
    uint64_t decisions;     ///< made so far: each draws from a random stream of its own
    int64_t  utime;         ///< [us] when the actions below were decided first
    uint32_t step_count, vehicle_count;
    int32_t  vehicle_ids[VERGE_CONTROLLED_MAX];
    uint8_t  actions[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX]; ///< verge_action
} verge_commitment;

typedef struct verge_decider verge_decider;

/// Bytes verge_decider_init() needs; 0 where the def is not valid. Grows with nodes_max,
/// vehicles_max and controlled_max.
size_t verge_decider_memory_size(const verge_planner_def* def);

/// memory: aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_MEMORY  *decider is null
verge_status verge_decider_init(verge_decider** decider, const verge_planner_def* def, void* memory,
                                size_t size);

/// Searches joint actions (section 3.1 of the paper) for all controlled vehicles of the scene that
/// are on the road. The result depends on the arguments and the def only.
/// @retval VERGE_ERR_CAPACITY  more vehicles than the def or the decision holds; nothing is changed
verge_status verge_decide(verge_decider* decider, const verge_scene* scene, verge_commitment* commitment,
                          verge_decision* decision);

/// Most nodes in any search so far, and bytes a node took in the last one.
void verge_decider_nodes(const verge_decider* decider, uint32_t* nodes_peak, uint32_t* bytes_per_node);

#ifdef __cplusplus
}
#endif

#endif
