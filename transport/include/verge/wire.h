/// Messages and the planner's own types: range checks, and conversion in both directions.
///
/// A decoded message had the right crc32, so it is what its sender meant; whether that makes sense
/// is checked here, field by field, before anything of it reaches the planner. Nothing allocates,
/// nothing keeps a pointer, everything may be called from any thread.
#ifndef VERGE_WIRE_H
#define VERGE_WIRE_H

#include "verge/plan.h"
#include "verge/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { WIRE_ACTIONS_MAX = 10, WIRE_POINTS_MAX = 31 };

/// Null: every field of a state is in the range that verge.lcm gives it. Otherwise the name of the
/// first field that is not (static lifetime). Infinite is always refused.
const char* wire_state_check(const verge_vehicle_state_t* state);

/// The same for a plan and its relations: valid_until_utime >= utime, t1_ms >= t0_ms; a plan that
/// is not cancelled has at least two points, one with points has a dt_ms of at least 1. Elements
/// beyond the counts are not looked at.
const char* wire_plan_check(const verge_vehicle_plan_t* plan);

/// A checked state as the planner wants it, at the state's own utime, without margin.
/// cooperation NaN: the habit's; the weights are the habit's always.
verge_vehicle wire_vehicle_from_state(const verge_vehicle_state_t* state);

/// The reverse, for programs that stand in for vehicles: habit is told by its kind. crc32 is left
/// to transport_publish_state(), position_sigma unknown.
verge_vehicle_state_t wire_state_from_vehicle(const verge_vehicle* vehicle, verge_habit_kind habit,
                                              int64_t utime, int32_t sequence,
                                              int32_t followed_cycle);

/// What a plan message says beside the vehicle's own plan.
typedef struct wire_plan_header {
    int64_t  utime;             ///< [us] t = 0 of the plan
    int64_t  valid_until_utime; ///< [us]
    int64_t  state_utime;       ///< [us] of the state the vehicle was planned from
    int32_t  rsu_id;
    int32_t  cycle;
    int32_t  plans_in_cycle;
    uint64_t digest;            ///< verge_plan.digest
} wire_plan_header;

/// The message for one vehicle. Neighbouring steps with the same action, lights and lane become
/// one action (from the first's t0 to the last's t1, with the last's speed); the first ten are
/// kept, and the first 31 points.
verge_vehicle_plan_t wire_plan_from_vehicle_plan(const wire_plan_header* header,
                                                 const verge_vehicle_plan* plan);

/// "Your plan is withdrawn": status 3, no actions, no points.
verge_vehicle_plan_t wire_plan_cancelled(const wire_plan_header* header, int32_t vehicle_id,
                                         verge_reason reason);

/// What is left of a checked plan at an instant: elapsed points and actions are dropped, none is
/// added or changed, so t = 0 moves to the last point at or before utime, and valid_until_utime
/// stays. False, *rest untouched: fewer than two points are left, or the plan is cancelled.
bool wire_plan_rest(const verge_vehicle_plan_t* plan, int64_t utime, verge_vehicle_plan_t* rest);

/// The trajectory of a checked plan message. t from dt_ms, jerk from the accelerations (the last
/// point has none). Returns how many, at most VERGE_POINTS_MAX; 0 for a cancelled plan.
uint32_t wire_points_from_plan(const verge_vehicle_plan_t* plan,
                               verge_point points[VERGE_POINTS_MAX]);

/// The action that holds at an instant: the last one whose t0 has come; null before the first
/// and where there is none. Points into the plan.
const verge_plan_action_t* wire_action_at(const verge_vehicle_plan_t* plan, int64_t utime);

#ifdef __cplusplus
}
#endif

#endif
