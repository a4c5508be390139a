/// Joint decision and trajectory planner for one flow of vehicles.
///
///     verge_planner_def def = verge_planner_default_def();
///     def.road = my_road;
///     verge_planner* planner;
///     verge_planner_init(&planner, &def, memory, verge_planner_memory_size(&def));
///     verge_planner_step(planner, utime, vehicles, vehicle_count, &plan);
///
/// Memory      The caller owns it. All of it is taken in verge_planner_init(); no later call
///             allocates. A planner holds no other resource: it ends when its memory is freed.
/// Threads     One planner serves one thread at a time; distinct planners share nothing. The
///             trajectories of one step may be spread over threads by the caller's executor.
/// Time        The planner reads no clock. Its budget counts iterations.
/// Determinism The same def, and the same steps in the same order, give the same plans, bit for
///             bit, on every machine, compiler and number of threads. The order of the steps
///             matters, because a planner uses its last plan in the next step.
///             Precondition: the calling thread, and the threads of the executor, round to nearest,
///             as every platform does by default. Whether they flush subnormal numbers to zero
///             (FTZ, DAZ) does not matter.
#ifndef VERGE_PLANNER_H
#define VERGE_PLANNER_H

#include "verge/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct verge_planner verge_planner;

/// Size of the memory for verge_planner_init() [B], road included; 0 if the def or its road is not
/// valid. Much faster than verge_planner_init(), because no road is fitted.
size_t verge_planner_memory_size(const verge_planner_def* def);

/// One line of the memory budget.
typedef struct verge_memory_term {
    const char* text; ///< use of the memory; static lifetime
    size_t      size; ///< [B]
} verge_memory_term;
enum { VERGE_MEMORY_TERMS = 8 };

/// The terms whose sum is verge_planner_memory_size(); all zero if the def or its road is not
/// valid.
void verge_planner_memory_terms(const verge_planner_def* def,
                                verge_memory_term terms[VERGE_MEMORY_TERMS]);

/// Builds a planner in the caller's memory, which must be aligned to 64 bytes, and fits the road.
/// @retval VERGE_ERR_DEF, VERGE_ERR_CONFIG, VERGE_ERR_ROAD, VERGE_ERR_MEMORY  *planner is null
verge_status verge_planner_init(verge_planner** planner, const verge_planner_def* def,
                                void* memory, size_t size);

/// Decides for all controlled vehicles jointly and plans a trajectory for each.
/// utime: the instant of the vehicles' states, and t = 0 of the plan. vehicles: in any order; the
/// plan does not depend on it.
/// Every controlled vehicle gets a trajectory. If no sampled trajectory is acceptable, it is a
/// fallback with its reason. Vehicles off the road are not an error: controlled ones brake straight
/// ahead, uncontrolled ones are predicted straight ahead.
/// @retval VERGE_ERR_CAPACITY, VERGE_ERR_VEHICLE, VERGE_ERR_DUPLICATE  plan unchanged
/// @retval VERGE_ERR_CONFIG  the caller was compiled with other capacities; the plan is unchanged
/// @retval VERGE_ERR_ARGUMENT  a null pointer; the plan is unchanged
static inline verge_status verge_planner_step(verge_planner* planner, int64_t utime,
                                              const verge_vehicle* vehicles, uint32_t vehicle_count,
                                              verge_plan* plan);
verge_status verge_planner_step_for(uint64_t config, verge_planner* planner, int64_t utime,
                                    const verge_vehicle* vehicles, uint32_t vehicle_count,
                                    verge_plan* plan);

/// Plans again what another planner has planned, from its decision: verge_planner_step() without
/// the search. A vehicle does so with the decision that a roadside unit has sent to it and to its
/// neighbours. Every trajectory is the one of that planner, to the last bit, if these are the same:
///
///   - the version, the road, and the def but for seed, search budget, threads and executor;
///   - the scene: vehicles, the lane of each, signals (verge_planner_scene() of that planner);
///   - the decision, as rounded by verge_decision_round();
///   - the plans of that planner's last step, as rounded by verge_vehicle_plan_round(). Only those
///     of vehicles that are controlled again are used.
///
/// scene: on the road of this planner, placed by verge_scene_place(). decision: of every controlled
/// vehicle on the road. last: may be null if last_count is 0; the planner's own last plan is not
/// used. The planner remembers scene and plan as after a step, and a later verge_planner_step()
/// goes on from them.
/// @retval VERGE_ERR_DEF       the decision is one that verge_predict() or verge_plan_vehicle()
///                             rejects, or lacks a vehicle; the vehicles of the plan are not valid
/// @retval VERGE_ERR_CAPACITY  more vehicles, controlled vehicles or last plans than the def holds;
///                             the plan is unchanged
/// @retval VERGE_ERR_CONFIG    the caller was compiled with other capacities; the plan is unchanged
/// @retval VERGE_ERR_ARGUMENT  a null pointer, or the scene is not as scene.h says, or has another
///                             road; the plan is unchanged
static inline verge_status verge_planner_repeat(verge_planner* planner, const verge_scene* scene,
                                                const verge_decision* decision,
                                                const verge_vehicle_plan* last,
                                                uint32_t last_count, verge_plan* plan);
verge_status verge_planner_repeat_for(uint64_t config, verge_planner* planner,
                                      const verge_scene* scene, const verge_decision* decision,
                                      const verge_vehicle_plan* last, uint32_t last_count,
                                      verge_plan* plan);

/// Sets the traffic signals as they are at utime, for the steps that follow, until they are set
/// again. A later step counts the time to the next change from its own utime. A signal whose change
/// has passed, with no newer state, counts as red. Within a plan, red is expected to change to
/// green, and green and yellow to what stops a vehicle.
/// signals: in any order, copied; at most one a lane. signal_count 0: there are none, as at the
/// start.
/// @retval VERGE_ERR_SIGNAL    see verge_signals_check(); the signals are unchanged
/// @retval VERGE_ERR_ARGUMENT  a null pointer; the signals are unchanged
verge_status verge_planner_set_signals(verge_planner* planner, int64_t utime,
                                       const verge_signal* signals, uint32_t signal_count);

/// The road as built. Valid as long as the planner.
const verge_road* verge_planner_road(const verge_planner* planner);

/// The vehicles of the last successful step, ordered by id, each with its lane; empty before the
/// first step and after a reset. Valid until the next step.
const verge_scene* verge_planner_scene(const verge_planner* planner);

/// Forgets the last plan: the next step starts as the first one did.
void verge_planner_reset(verge_planner* planner);

/// Totals since verge_planner_init(); a reset does not clear them.
typedef struct verge_counters {
    size_t   arena_size;      ///< [B] memory given to the planner
    size_t   arena_peak;      ///< [B] largest part of it in use
    uint32_t nodes_peak;      ///< largest number of nodes in any step
    uint32_t nodes_max;       ///< capacity; 0 with VERGE_SEARCH_POLICY, which has no tree
    uint32_t bytes_per_node;  ///< with the vehicle count of the last step
    uint64_t steps;           ///< successful calls of verge_planner_step()
    uint64_t fallbacks;       ///< in all steps
    uint64_t unexpanded;      ///< iterations without a new node because the tree was full
    uint64_t candidates;      ///< trajectories evaluated in all steps
    uint64_t reordered;       ///< circles of standing vehicles that got a new order, in all steps
    uint64_t unstuck;         ///< vehicles that stood for 3 s without a cause, in all steps
} verge_counters;

verge_counters verge_planner_counters(const verge_planner* planner);

// Compiled by the caller, with the sizes that the caller sees.

static inline verge_status verge_planner_step(verge_planner* planner, int64_t utime,
                                              const verge_vehicle* vehicles, uint32_t vehicle_count,
                                              verge_plan* plan)
{
    return verge_planner_step_for(VERGE_CONFIG, planner, utime, vehicles, vehicle_count, plan);
}

static inline verge_status verge_planner_repeat(verge_planner* planner, const verge_scene* scene,
                                                const verge_decision* decision,
                                                const verge_vehicle_plan* last,
                                                uint32_t last_count, verge_plan* plan)
{
    return verge_planner_repeat_for(VERGE_CONFIG, planner, scene, decision, last, last_count, plan);
}

#ifdef __cplusplus
}
#endif

#endif
