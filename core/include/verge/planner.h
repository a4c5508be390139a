/// Joint decision and trajectory planner for one flow of vehicles.
///
///     verge_planner_def def = verge_planner_default_def();
///     def.road = my_road;
///     verge_planner* planner;
///     verge_planner_init(&planner, &def, memory, verge_planner_memory_size(&def));
///     verge_planner_step(planner, utime, vehicles, vehicle_count, &plan);
///
/// Memory      The caller owns it. All of it is taken in verge_planner_init(); no later call
///             allocates. Dropping the memory ends the planner: there is nothing to destroy.
/// Threads     One planner serves one thread at a time; distinct planners share nothing. The
///             trajectories of one step may be spread over threads by the caller's executor.
/// Time        The planner reads no clock. Its budget counts iterations.
/// Sameness    The same def, and the same steps in the same order, give the same plans, bit for
///             bit, on every machine, compiler and number of threads. A planner remembers its
///             last plan (to keep to it unless a better one pays), so the order of steps counts.
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

/// Bytes verge_planner_init() needs for this def, road included; 0 if the def or its road is
/// refused. Fast beside verge_planner_init(): nothing is fitted here.
size_t verge_planner_memory_size(const verge_planner_def* def);

/// One line of the memory budget: what for, and how many bytes.
typedef struct verge_memory_term {
    const char* text;
    size_t      size;
} verge_memory_term;
enum { VERGE_MEMORY_TERMS = 8 };

/// The budget behind verge_planner_memory_size(), term by term.
void verge_planner_memory_terms(const verge_planner_def* def, verge_memory_term terms[VERGE_MEMORY_TERMS]);

/// Builds a planner in the caller's memory, aligned to 64 bytes. The road is fitted here.
/// @retval VERGE_ERR_DEF, VERGE_ERR_ROAD, VERGE_ERR_MEMORY  *planner is null
verge_status verge_planner_init(verge_planner** planner, const verge_planner_def* def,
                                void* memory, size_t size);

/// Decides for all controlled vehicles jointly and plans a trajectory for each.
/// vehicles: any order; the plan does not depend on it. utime: t = 0 of the plan, the instant
/// the vehicles' states are valid at.
/// Every controlled vehicle gets a trajectory: where none is acceptable, a fallback that says why.
/// @retval VERGE_ERR_CAPACITY, VERGE_ERR_VEHICLE, VERGE_ERR_DUPLICATE  plan unchanged
/// Vehicles off the road are not an error: uncontrolled ones are predicted straight ahead.
verge_status verge_planner_step(verge_planner* planner, int64_t utime, const verge_vehicle* vehicles,
                                uint32_t vehicle_count, verge_plan* plan);

/// The road as built. Valid as long as the planner.
const verge_road* verge_planner_road(const verge_planner* planner);

/// The vehicles of the last successful step, ordered by id, each with its lane; empty before the
/// first step and after a reset. Valid until the next step.
const verge_scene* verge_planner_scene(const verge_planner* planner);

/// Forgets the last plan: the next step starts as the first one did.
void verge_planner_reset(verge_planner* planner);

typedef struct verge_counters {
    size_t   arena_size;      ///< [B] given
    size_t   arena_peak;      ///< [B] used at most
    uint32_t nodes_peak;      ///< most nodes in any step
    uint32_t nodes_max;       ///< capacity
    uint32_t bytes_per_node;  ///< with the vehicle count of the last step
    uint64_t steps;           ///< successful calls of verge_planner_step()
    uint64_t fallbacks;       ///< in all steps
    uint64_t unexpanded;      ///< in all steps: iterations that found the tree full
    uint64_t candidates;      ///< trajectories evaluated in all steps
} verge_counters;

verge_counters verge_planner_counters(const verge_planner* planner);

#ifdef __cplusplus
}
#endif

#endif
