/// The scalar fields of the def in one table: unit, range and meaning; their defaults below it.

#include "base/scalar.h"
#include "verge/planner.h"

#include <assert.h>

enum { cookie = 0x76726765 }; // "vrge"

#define D(field, unit, min, max, text) \
    { #field, unit, VERGE_PARAM_DOUBLE, offsetof(verge_planner_def, field), min, max, text }
#define U(field, kind, min, max, text) \
    { #field, "1", kind, offsetof(verge_planner_def, field), min, max, text }

static const verge_param params[] = {
    U(seed, VERGE_PARAM_U64, 0, 18446744073709551615.0, "seed of the only random generator"),
    U(search, VERGE_PARAM_SEARCH, 0, 2,
      "\"best\": the best complete plan found, improved; \"paper\": the greedy plan of the tree; "
      "\"policy\": the greedy plan without a tree"),
    U(iterations, VERGE_PARAM_U32, 1, 1000000, "search iterations per step"),
    U(nodes_max, VERGE_PARAM_U32, 2, 1000000, "nodes of the search tree"),
    U(vehicles_max, VERGE_PARAM_U32, 1, VERGE_VEHICLES_MAX, "largest number of vehicles in a step"),
    U(controlled_max, VERGE_PARAM_U32, 1, VERGE_CONTROLLED_MAX,
      "largest number of controlled vehicles in a step"),
    U(threads, VERGE_PARAM_U32, 1, 16, "threads for the trajectories of one step"),
    D(step_s, "s", 0.25, 5.0, "length of a decision step"),
    U(steps, VERGE_PARAM_U32, 2, VERGE_STEPS_MAX, "decision steps; the horizon is steps * step_s"),
    D(reaction_s, "s", 0.05, 5.0,
      "reaction time tau of Eq. 2 (the paper's search) and of the alert zone"),
    D(headway_s, "s", 0.1, 10.0,
      "minimum time headway MTH of Eq. 2 (the paper's search) and of the alert zone"),
    D(change_gap, "m", 0.0, 100.0, "smallest gap, ahead and behind, that a lane change may leave"),
    D(change_gap_wanted, "m", 0.0, 100.0, "gap below which a lane change costs reward_room"),
    D(exploration, "1", 0.0, 10.0, "C_p of Eq. 1"),
    D(acceleration, "m/s^2", 0.05, 5.0, "a_acc of Table 1 (the paper's search)"),
    D(deceleration, "m/s^2", 0.05, 8.0, "a_dec of Table 1 (the paper's search)"),
    D(reward_target, "1", 0.0, 1.0, "part of R_i for ending in the target lane"),
    D(reward_lane, "1", 0.0, 1.0, "part of R_i for the share of steps near the target centreline"),
    D(reward_consistency, "1", 0.0, 1.0,
      "part of R_i for the share of steps that repeat the action before"),
    D(reward_room, "1", 0.0, 10.0, "cost of a change that leaves no gap, in rewards of one step"),
    D(cruise_share, "1", 0.05, 1.0,
      "share of the speed limit below which a step earns by its speed (the paper's search)"),
    D(target_distance, "m", 0.0, 1000.0,
      "distance in the target lanes after which a simulation may end (the paper's search)"),
    D(switch_margin, "1", 0.0, 1.0,
      "gain in reward that is needed to replace the lane changes of the last plan"),
    D(idm_gap, "m", 0.1, 20.0, "standstill gap of uncontrolled vehicles"),
    D(idm_headway_s, "s", 0.1, 10.0, "time headway of uncontrolled vehicles"),
    D(idm_acceleration, "m/s^2", 0.05, 5.0, "acceleration of uncontrolled vehicles"),
    D(idm_comfort, "m/s^2", 0.05, 10.0, "sqrt(a b) in the braking term of uncontrolled vehicles"),
    D(idm_braking_max, "m/s^2", 0.1, 12.0, "largest deceleration of uncontrolled vehicles"),
    U(points, VERGE_PARAM_U32, 11, VERGE_POINTS_MAX, "points of a trajectory"),
    D(point_s, "s", 0.02, 0.5, "time between points"),
    U(sample_speeds, VERGE_PARAM_U32, 2, VERGE_SAMPLE_SPEEDS_MAX, "end speeds of a segment"),
    U(sample_offsets, VERGE_PARAM_U32, 8, VERGE_SAMPLE_OFFSETS_MAX,
      "lateral end offsets of a segment, a multiple of 8"),
    D(region_speed, "m/s", 0.0, 20.0, "half width of a change segment's end speeds"),
    D(region_offset, "m", 0.0, 2.0, "half width of a change segment's end offsets"),
    D(keep_region_speed, "m/s", 0.0, 20.0, "half width of a keeping segment's end speeds"),
    D(keep_region_offset, "m", 0.0, 2.0, "half width of a keeping segment's end offsets"),
    D(alert_cost, "1", 0.0, 1000.0, "C_z of the alert zone"),
    U(alert_continuous, VERGE_PARAM_BOOL, 0, 1, "alert zone whose cost falls to zero at its edge"),
    D(comfort_acceleration, "m/s^2", 0.1, 11.5, "largest acceleration in normal driving"),
    D(comfort_braking, "m/s^2", 0.1, 11.5, "largest deceleration in normal driving"),
    D(comfort_lateral, "m/s^2", 0.1, 11.5, "largest lateral acceleration in normal driving"),
    D(comfort_jerk, "m/s^3", 0.1, 50.0, "largest longitudinal jerk in normal driving"),
    D(clearance, "m", 0.0, 5.0, "free space kept around predicted bodies"),
};
#undef D
#undef U

// The paper's value, or the capacity where it is smaller.
#define AT_MOST(value, capacity) ((value) < (capacity) ? (value) : (capacity))

uint64_t verge_library_config(void)
{
    return VERGE_CONFIG;
}

verge_planner_def verge_planner_default_def_for(uint64_t config)
{
    const verge_planner_def def = {
        .seed = 1,
        .search = VERGE_SEARCH_BEST,
        .iterations = 3000, // paper, section 4.1
        .nodes_max = VERGE_NODES_MAX,
        .vehicles_max = VERGE_VEHICLES_MAX,
        .controlled_max = VERGE_CONTROLLED_MAX,
        .threads = 1,
        .step_s = 1.5, // paper, section 4, and so on to deceleration
        .steps = AT_MOST(7, VERGE_STEPS_MAX),
        .reaction_s = 0.5,
        .headway_s = 3.0,
        .change_gap = 3.0, // this to reward_room: measured, tables and dense traffic, RESULTS.md
        .change_gap_wanted = 10.0,
        .exploration = 0.70710678118654752, // 1 / sqrt(2)
        .acceleration = 0.6,
        .deceleration = 0.6,
        .reward_target = 0.5, // the paper names these three parts without weights; the sum is 1
        .reward_lane = 0.3,
        .reward_consistency = 0.2,
        .reward_room = 2.0,
        .cruise_share = 1.0,
        .target_distance = 20.0,
        .switch_margin = 0.03,
        .idm_gap = 2.0, // this to idm_comfort: the values in the program of the paper's authors
        .idm_headway_s = 1.0,
        .idm_acceleration = 0.6,
        .idm_comfort = 1.104, // sqrt(0.73 * 1.67)
        .idm_braking_max = 4.5,
        .points = AT_MOST(31, VERGE_POINTS_MAX),
        .point_s = 0.1,
        .sample_speeds = AT_MOST(9, VERGE_SAMPLE_SPEEDS_MAX),
        .sample_offsets = 8,
        .region_speed = 0.7, // the authors' +-0.694 m/s and +-0.75 m
        .region_offset = 0.7,
        .keep_region_speed = 2.0,
        .keep_region_offset = 0.7,
        .alert_cost = 1.0,
        .alert_continuous = 0,
        .comfort_acceleration = 4.0, // to comfort_jerk: bounds of Apollo's planner
        .comfort_braking = 6.0,
        .comfort_lateral = 4.0,
        .comfort_jerk = 4.0,
        .clearance = 0.2,
        .cookie = cookie,
        .config = config,
    };
    return def;
}

const verge_param* verge_planner_params(uint32_t* count)
{
    if (count != NULL) {
        *count = (uint32_t)(sizeof params / sizeof params[0]);
    }
    return params;
}

static double value_of(const verge_planner_def* def, const verge_param* param)
{
    const char* field = (const char*)def + param->offset;
    switch (param->kind) {
    case VERGE_PARAM_DOUBLE: return *(const double*)(const void*)field;
    case VERGE_PARAM_U64: return 0.0; // every value is allowed
    case VERGE_PARAM_U32:
    case VERGE_PARAM_SEARCH:
    case VERGE_PARAM_BOOL: break;
    }
    return (double)*(const uint32_t*)(const void*)field;
}

static const char* first_fault(const verge_planner_def* def)
{
    for (uint32_t i = 0; i < sizeof params / sizeof params[0]; ++i) {
        const double value = value_of(def, &params[i]);
        if (!vg_finite(value) || value < params[i].min || value > params[i].max) {
            return params[i].name;
        }
    }
    if (def->sample_offsets % 8u != 0) {
        return "sample_offsets";
    }
    if (def->controlled_max > def->vehicles_max) {
        return "controlled_max";
    }
    if (vg_abs(def->reward_target + def->reward_lane + def->reward_consistency - 1.0) > 1e-9) {
        return "reward_target"; // the three parts sum to 1, so that R_i lies in [0, 1]
    }
    if ((double)def->steps * def->step_s < (double)(def->points - 1u) * def->point_s) {
        return "steps"; // the decision horizon must be at least as long as a trajectory
    }
    return NULL;
}

verge_status verge_planner_check(const verge_planner_def* def, const char** fault)
{
    if (def == NULL) {
        if (fault != NULL) {
            *fault = "def";
        }
        return VERGE_ERR_ARGUMENT;
    }
    const bool same_config = def->cookie != cookie || def->config == VERGE_CONFIG;
    const char* name = def->cookie != cookie ? "cookie" : same_config ? first_fault(def) : "config";
    if (fault != NULL) {
        *fault = name;
    }
    return name == NULL ? VERGE_OK : same_config ? VERGE_ERR_DEF : VERGE_ERR_CONFIG;
}
