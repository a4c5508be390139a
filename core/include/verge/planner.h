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
#include "verge/road.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct verge_planner verge_planner;

/// How the decision is searched and which plan is returned.
typedef enum verge_search {
    VERGE_SEARCH_PAPER = 0,  ///< greedy child of maximum mean at each layer, nothing remembered
    VERGE_SEARCH_BEST = 1,   ///< best complete plan seen, warm start from the last plan
} verge_search;

/// Runs task(arg, 0) .. task(arg, count - 1), in any order, on any threads, and returns when all
/// are done. The tasks share nothing.
typedef void verge_executor(void* context, void (*task)(void* arg, uint32_t index), void* arg,
                            uint32_t count);

/// How a planner is built. Start from verge_planner_default_def() and change what differs.
/// Defaults, ranges and meaning of the scalar fields: verge_planner_params().
typedef struct verge_planner_def {
    verge_road_def road;

    uint64_t seed;              ///< any value; the whole source of randomness
    uint32_t search;            ///< verge_search
    uint32_t iterations;        ///< [1]   search iterations a step
    uint32_t nodes_max;         ///< [1]   nodes of the tree
    uint32_t vehicles_max;      ///< [1]   vehicles seen at once
    uint32_t controlled_max;    ///< [1]   vehicles planned at once
    uint32_t threads;           ///< [1]   for whoever provides the executor; core does not read it

    // Decision (section 3.1; constants of section 4)
    double   step_s;            ///< [s]     length of a decision step
    uint32_t steps;             ///< [1]     decision steps; horizon = steps * step_s
    double   reaction_s;        ///< [s]     tau, Eq. 2
    double   headway_s;         ///< [s]     MTH, Eq. 2
    double   change_gap;        ///< [m]     free way, ahead and behind, that a change leaves; less below
                                ///<         (change_gap - idm_gap) / idm_headway_s
    double   change_gap_wanted; ///< [m]     what it would rather leave: less of it costs reward_room
    double   exploration;       ///< [1]     C_p, Eq. 1
    double   acceleration;      ///< [m/s^2] a_acc, Table 1
    double   deceleration;      ///< [m/s^2] a_dec, Table 1
    double   reward_target;     ///< [1]     weight: ends in the target lane
    double   reward_lane;       ///< [1]     weight: share of steps in the target lane near its centre
    double   reward_consistency;///< [1]     weight: share of steps that repeat the action before
    double   reward_room;       ///< [1]     steps' shares (1 / steps) of R_i lost by a change that leaves
                                ///<         no room, less by one that leaves some of change_gap_wanted
    double   cruise_share;      ///< [1]     of the speed limit; below it a step earns in proportion
    double   target_distance;   ///< [m]     driven in the target lane by all: a simulation may end
    double   switch_margin;     ///< [1]     reward by which other lane changes must beat the last plan's,
                                ///<         in shares of those whose changes are others
    double   idm_gap;           ///< [m]     standstill gap of uncontrolled vehicles
    double   idm_headway_s;     ///< [s]
    double   idm_acceleration;  ///< [m/s^2]
    double   idm_comfort;       ///< [m/s^2] sqrt(a b) of the IDM's braking term
    double   idm_braking_max;   ///< [m/s^2] floor of the IDM's deceleration

    // Trajectory (section 3.2)
    uint32_t points;            ///< [1]     points of a trajectory
    double   point_s;           ///< [s]     between points
    uint32_t sample_speeds;     ///< [1]     end speeds of a segment
    uint32_t sample_offsets;    ///< [1]     lateral end offsets of a segment, multiple of 8
    double   region_speed;      ///< [m/s]   half width of the target region of a segment
    double   region_offset;     ///< [m]     half width of the target region of a segment
    double   keep_region_speed; ///< [m/s]   the same for lane keeping
    double   keep_region_offset;///< [m]
    double   alert_cost;        ///< [1]     C_z of the alert zone
    uint32_t alert_continuous;  ///< [1]     1: the variant that is continuous at the zone's edge
    double   comfort_acceleration;  ///< [m/s^2] limits of normal driving that only
    double   comfort_braking;       ///< [m/s^2] an emergency may exceed
    double   comfort_lateral;       ///< [m/s^2]
    double   comfort_jerk;          ///< [m/s^3] longitudinal
    double   clearance;         ///< [m]     free space kept around predicted bodies

    verge_executor* executor;   ///< null: one after the other in the caller's thread
    void*    executor_context;

    uint32_t cookie;            ///< set by verge_planner_default_def(); leave it alone
} verge_planner_def;

verge_planner_def verge_planner_default_def(void);

/// One scalar field of the def, for whoever reads parameters by name (JSON, manuals).
typedef enum verge_param_kind {
    VERGE_PARAM_DOUBLE,
    VERGE_PARAM_U32,
    VERGE_PARAM_U64,
    VERGE_PARAM_SEARCH, ///< uint32_t; by name "paper" or "best"
    VERGE_PARAM_BOOL,   ///< uint32_t 0 or 1; by name true or false
} verge_param_kind;

typedef struct verge_param {
    const char*      name;     ///< the field's name, also the JSON key
    const char*      unit;     ///< "s", "m/s", ...; "1" for none
    verge_param_kind kind;
    size_t           offset;   ///< in verge_planner_def
    double           min, max; ///< allowed values, both inclusive
    const char*      text;     ///< one sentence
} verge_param;

/// The table of all scalar fields, in the order of the def. Static lifetime.
const verge_param* verge_planner_params(uint32_t* count);

/// Checks every parameter against its range and the relations between them.
/// @retval VERGE_ERR_DEF  *fault (may be null) is the parameter's name
verge_status verge_planner_check(const verge_planner_def* def, const char** fault);

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

/// Is this vehicle acceptable to verge_planner_step(), on its own?
/// VERGE_ERR_VEHICLE, or VERGE_ERR_OFF_ROAD where its centre lies on no lane (see there).
verge_status verge_planner_check_vehicle(const verge_planner* planner, const verge_vehicle* vehicle);

/// The road as built. Valid as long as the planner.
const verge_road* verge_planner_road(const verge_planner* planner);

/// Forgets the last plan: the next step starts as the first one did.
void verge_planner_reset(verge_planner* planner);

/// Moves every uncontrolled vehicle on by dt [s] as the planner predicts it (IDM in its lane,
/// the leader may be controlled); controlled ones are left as they are. For simulators.
void verge_planner_advance_humans(verge_planner* planner, verge_vehicle* vehicles, uint32_t vehicle_count,
                                  double dt);

/// Do two vehicles' bodies (oriented rectangles grown by their margins) touch?
bool verge_vehicles_overlap(const verge_vehicle* a, const verge_vehicle* b);
/// Smallest distance between two bodies [m]; 0 where they touch.
double verge_vehicles_distance(const verge_vehicle* a, const verge_vehicle* b);

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
