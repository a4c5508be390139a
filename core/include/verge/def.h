/// The parameters of all stages, in one structure: seed, capacities, decision, trajectory.
#ifndef VERGE_DEF_H
#define VERGE_DEF_H

#include "verge/road.h"

#ifdef __cplusplus
extern "C" {
#endif

/// How the decision is searched and which plan is returned.
typedef enum verge_search {
    VERGE_SEARCH_PAPER = 0,  ///< the child of largest mean at each layer; no warm start
    VERGE_SEARCH_BEST = 1,   ///< the best complete plan found; warm start from the last plan
    VERGE_SEARCH_POLICY = 2, ///< each vehicle does what is best for it alone, as the search of BEST
                             ///< begins; warm start from the last plan. No tree and no memory for
                             ///< one; iterations, nodes_max and seed have no effect. For a vehicle
                             ///< that plans for itself on little memory
} verge_search;

/// Calls task(arg, 0) .. task(arg, count - 1), in any order, on any threads, and returns when all
/// calls have returned. The tasks share no data that they write.
typedef void verge_executor(void* context, void (*task)(void* arg, uint32_t index), void* arg,
                            uint32_t count);

/// How a planner is built. Start from verge_planner_default_def() and change single fields.
/// Defaults, ranges and meaning of the scalar fields: verge_planner_params().
typedef struct verge_planner_def {
    /// verge_planner_init() builds it. Stages take a built road; of this one they read lane_count
    /// alone, to keep memory for no more lanes than there are. 0: any road. A road with more lanes
    /// is refused (VERGE_ERR_CAPACITY).
    verge_road_def road;

    uint64_t seed;              ///< any value; seed of the only random generator
    uint32_t search;            ///< verge_search
    uint32_t iterations;        ///< [1]   search iterations per step
    uint32_t nodes_max;         ///< [1]   nodes of the tree
    uint32_t vehicles_max;      ///< [1]   largest number of vehicles in a step
    uint32_t controlled_max;    ///< [1]   largest number of controlled vehicles
    uint32_t threads;           ///< [1]   read by the owner of the executor, not by core

    // Decision (section 3.1; constants of section 4)
    double   step_s;            ///< [s]     length of a decision step
    uint32_t steps;             ///< [1]     decision steps; horizon = steps * step_s
    double   reaction_s;        ///< [s]     tau, Eq. 2 of VERGE_SEARCH_PAPER; of the alert zone in
                                ///<         both searches
    double   headway_s;         ///< [s]     MTH, the same
    double   change_gap;        ///< [m]     smallest gap, ahead and behind, that a lane change may
                                ///<         leave; smaller at speeds below
                                ///<         (change_gap - idm_gap) / idm_headway_s
    double   change_gap_wanted; ///< [m]     gap below which a lane change costs reward_room
    double   exploration;       ///< [1]     C_p, Eq. 1
    double   acceleration;      ///< [m/s^2] a_acc, Table 1: of VERGE_SEARCH_PAPER
    double   deceleration;      ///< [m/s^2] a_dec, Table 1: of VERGE_SEARCH_PAPER
    double   reward_target;     ///< [1]     weight: ends in the target lane
    double   reward_lane;       ///< [1]     weight: share of steps near the target centreline
    double   reward_consistency;///< [1]     weight: share of steps that repeat the action before
    double   reward_room;       ///< [1]     cost of a lane change that leaves no gap, in units of
                                ///<         one step's share of R_i (1 / steps); it falls to 0 at
                                ///<         change_gap_wanted
    double   cruise_share;      ///< [1]     share of the speed limit below which a step earns in
                                ///<         proportion to speed; of VERGE_SEARCH_PAPER
    double   target_distance;   ///< [m]     distance in the target lane after which a vehicle has
                                ///<         reached its target; a simulation of VERGE_SEARCH_PAPER
                                ///<         ends when all vehicles have
    double   switch_margin;     ///< [1]     gain in reward that is needed to replace the lane
                                ///<         changes of the last plan, times the share of vehicles
                                ///<         whose lane changes differ
    double   idm_gap;           ///< [m]     standstill gap of uncontrolled vehicles
    double   idm_headway_s;     ///< [s]     time headway of uncontrolled vehicles
    double   idm_acceleration;  ///< [m/s^2] acceleration of uncontrolled vehicles
    double   idm_comfort;       ///< [m/s^2] sqrt(a b) of the IDM's braking term
    double   idm_braking_max;   ///< [m/s^2] largest deceleration of uncontrolled vehicles

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
    uint32_t alert_continuous;  ///< [1]     1: its cost falls to zero at the edge of the zone
    // Limits of normal driving, exceeded only in an emergency.
    double   comfort_acceleration;  ///< [m/s^2]
    double   comfort_braking;       ///< [m/s^2]
    double   comfort_lateral;       ///< [m/s^2]
    double   comfort_jerk;          ///< [m/s^3] longitudinal
    double   clearance;         ///< [m]     free space kept around predicted bodies

    verge_executor* executor;   ///< null: the calling thread plans all vehicles, one by one
    void*    executor_context;

    uint32_t cookie;            ///< set by verge_planner_default_def(); do not change it
    uint64_t config;            ///< the same: VERGE_CONFIG of the caller
} verge_planner_def;

/// VERGE_CONFIG of the library.
uint64_t verge_library_config(void);

/// For bindings that do not compile this header: config is the VERGE_CONFIG whose sizes the caller
/// uses. The same holds for all functions whose name ends in _for.
verge_planner_def verge_planner_default_def_for(uint64_t config);

/// Every parameter at its default, for the capacities that the caller is compiled with.
static inline verge_planner_def verge_planner_default_def(void)
{
    return verge_planner_default_def_for(VERGE_CONFIG);
}

/// One scalar field of the def, for programs that read parameters by name (JSON, manuals).
typedef enum verge_param_kind {
    VERGE_PARAM_DOUBLE,
    VERGE_PARAM_U32,
    VERGE_PARAM_U64,
    VERGE_PARAM_SEARCH, ///< uint32_t; by name: "paper", "best", "policy"
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
/// @retval VERGE_ERR_CONFIG  *fault is "config": the caller was compiled with other capacities
/// @retval VERGE_ERR_ARGUMENT  def is null
verge_status verge_planner_check(const verge_planner_def* def, const char** fault);

#ifdef __cplusplus
}
#endif

#endif
