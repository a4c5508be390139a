/// The result of a planning step: for each controlled vehicle an action sequence a human can
/// read and a trajectory a vehicle can follow; for every other vehicle what was believed of it.
#ifndef VERGE_PLAN_H
#define VERGE_PLAN_H

#include "verge/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Values are those of the wire.
typedef enum verge_plan_status {
    VERGE_PLANNED = 0,
    VERGE_FALLBACK_KEEP_LANE = 1, ///< no sampled trajectory was acceptable: keeps its lane
    VERGE_FALLBACK_BRAKE = 2,     ///< no sampled trajectory was acceptable: brakes in its lane
    VERGE_CANCELLED = 3,          ///< never made by the planner; sent by the daemon
} verge_plan_status;

/// Why a plan is a fallback. Values are those of the wire.
typedef enum verge_reason {
    VERGE_REASON_NONE = 0,
    VERGE_REASON_NO_FEASIBLE = 1,   ///< every candidate broke a kinematic limit
    VERGE_REASON_COLLISION = 2,     ///< every feasible candidate met a predicted body
    VERGE_REASON_JOINT = 3,         ///< every candidate met the trajectory of another planned vehicle
    VERGE_REASON_OVERLAP_NOW = 4,   ///< the body overlaps another one already
    VERGE_REASON_OFF_ROAD = 5,      ///< not on a lane: brakes straight ahead
    VERGE_REASON_OVERRUN = 6,       ///< set by the daemon: the cycle ran out of time
    VERGE_REASON_STALE = 7,         ///< set by the daemon: the vehicle's state is too old
} verge_reason;

/// A sentence for a reason, never null.
const char* verge_reason_text(verge_reason reason);

/// One decision step of one vehicle: what it does from t0 to t1 and the state expected at t1.
typedef struct verge_action_step {
    verge_action action;
    int32_t lane_id;        ///< the lane at t1
    double  t0, t1;         ///< [s] from the plan's utime
    double  s, d, v;        ///< [m], [m], [m/s] expected at t1, in lane_id
    bool    brake_light;
    int32_t turn_signal;    ///< -1 right, 0 none, 1 left
    int32_t ahead_id;       ///< vehicle expected directly ahead at t1 in its path, -1 none
    int32_t behind_id;      ///< vehicle expected directly behind at t1, -1 none
} verge_action_step;

/// Writes the step as one sentence a passenger understands ("changing to the right lane behind
/// vehicle 3"), always null-terminated, at most size bytes. Returns the length written.
size_t verge_action_say(const verge_action_step* step, char* text, size_t size);

/// One point of a trajectory: the motion of the body's centre and the direction of the body.
/// The rear axle, rear_axle of the vehicle's body behind the centre, moves along the heading; so the
/// same trajectory is drivable for the centre stated here and not for another point of the vehicle.
typedef struct verge_point {
    double t;            ///< [s] from the plan's utime
    double x, y;         ///< [m] centre
    double heading;      ///< [rad] of the body
    double speed;        ///< [m/s] of the centre
    double acceleration; ///< [m/s^2] of the centre along its path
    double curvature;    ///< [1/m] yaw rate over speed
    double jerk;         ///< [m/s^3] rate of the acceleration
} verge_point;

/// The six cost terms of the chosen trajectory, weighted, and their sum (Eq. 8).
typedef struct verge_cost {
    double total, curvature, heading, offset, acceleration, jerk, obstacle;
} verge_cost;

typedef struct verge_vehicle_plan {
    int32_t           vehicle_id;
    verge_plan_status status;
    verge_reason      reason;
    uint32_t          action_count;  ///< covers the decision horizon
    verge_action_step actions[VERGE_STEPS_MAX];
    uint32_t          point_count;   ///< covers the planning horizon, point 0 at t = 0
    verge_point       points[VERGE_POINTS_MAX];
    verge_cost        cost;
} verge_vehicle_plan;

/// What the planner believed of a vehicle it does not plan.
typedef struct verge_pose {
    double t, x, y, heading;
} verge_pose;

typedef struct verge_prediction {
    int32_t    vehicle_id;
    uint32_t   point_count;
    verge_pose points[VERGE_POINTS_MAX];
} verge_prediction;

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

/// The whole plan. Large (113 kB with the default capacities): keep it in static memory. Vehicles are
/// ordered by id.
typedef struct verge_plan {
    int64_t             utime;   ///< [us] t = 0 of everything in it
    uint64_t            digest;  ///< of all vehicle plans and predictions, see core/README.md
    verge_search_report search;
    uint32_t            vehicle_count;
    verge_vehicle_plan  vehicles[VERGE_CONTROLLED_MAX];
    uint32_t            prediction_count;
    verge_prediction    predictions[VERGE_VEHICLES_MAX];
    uint32_t            fallback_count;
    uint32_t            replanned_count; ///< vehicles planned again by the joint check
} verge_plan;

#ifdef __cplusplus
}
#endif

#endif
