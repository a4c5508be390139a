/// Messages and the planner's own types: range checks, and conversion in both directions.
///
/// The crc32 of a decoded message was correct, so it was received as it was sent. Here each field
/// is checked against its range before the planner uses the message. No function allocates or keeps
/// a pointer; all may be called from any thread.
#ifndef VERGE_WIRE_H
#define VERGE_WIRE_H

#include "verge/plan.h"
#include "verge/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { WIRE_ACTIONS_MAX = 7, WIRE_PASSES_MAX = 4, WIRE_STOPS_MAX = 3, WIRE_POINTS_MAX = 31 };

/// The protocol_version of all messages: it counts changes of their meaning. Their form is told
/// apart by LCM's fingerprint and by the size on DDS.
enum { WIRE_PROTOCOL_VERSION = 1 };

/// Null: every field of a state is in its range (verge.lcm). Otherwise the name of the first field
/// that is not (static lifetime). Infinite values are always refused.
const char* wire_state_check(const verge_vehicle_state_t* state);

/// The same for a plan and its relations: valid_until_utime >= utime; no action ends before the one
/// before it; a plan that is not cancelled has at least two points, one with points has a dt_ms of
/// at least 1. Elements beyond the counts are ignored.
const char* wire_plan_check(const verge_vehicle_plan_t* plan);

/// Null: every field of a signal is in its range, and change_utime is 0 or not before utime.
const char* wire_signal_check(const verge_lane_signal_t* signal);

/// Null: every field of a trajectory is in its range, and valid_until_utime is not before utime.
const char* wire_trajectory_check(const verge_vehicle_trajectory_t* trajectory);

/// What an on-vehicle unit does: the mode of its trajectory.
typedef enum wire_unit_mode {
    WIRE_FOLLOWING = 0, ///< drives the plan of the roadside unit
    WIRE_DEPARTING = 1, ///< that plan is no longer safe or does not fit: own trajectory, by the
                        ///< decision of the plan where that is possible
    WIRE_ALONE = 2,     ///< there is no plan: own decision
    WIRE_STOPPING = 3,  ///< no position, or a contact: brakes to standstill in the lane
} wire_unit_mode;

/// Why an on-vehicle unit is in its mode.
typedef enum wire_unit_reason {
    WIRE_UNIT_NONE = 0,
    // departing
    WIRE_UNIT_CONTACT = 1,       ///< the plan meets a body, as the unit predicts that body now
    WIRE_UNIT_PLAN_FAR = 2,      ///< the plan is more than 1 m or 1 m/s from the vehicle's state
    // alone
    WIRE_UNIT_NEVER_HEARD = 3,   ///< no roadside unit was heard yet
    WIRE_UNIT_SILENT = 4,        ///< no plan for three cycles of the roadside unit
    WIRE_UNIT_CANCELLED = 5,     ///< the roadside unit has withdrawn the plan
    WIRE_UNIT_PLAN_OVER = 6,     ///< the plan has ended, and no newer one came
    WIRE_UNIT_OTHER_MAP = 7,     ///< the plan was made with another road
    WIRE_UNIT_OTHER_VERSION = 8, ///< the plan has another protocol version
    WIRE_UNIT_NOT_WANTED = 9,    ///< the vehicle does not ask for plans (controlled 0)
    // stopping
    WIRE_UNIT_NO_POSITION = 10,  ///< the own state is missing or too old
    WIRE_UNIT_TOUCHING = 11,     ///< the body overlaps another one
    WIRE_UNIT_OFF_ROAD = 12,     ///< the vehicle is on no lane
    WIRE_UNIT_REFUSED = 13,      ///< the own state cannot be planned from
    // departing
    WIRE_UNIT_NO_TRAJECTORY = 14, ///< from where the vehicle is, no trajectory along the actions of the
                                  ///< plan was acceptable
    WIRE_UNIT_RED_SIGNAL = 15,   ///< the plan passes a stop line while its signal is red
} wire_unit_reason;
enum { WIRE_UNIT_MODES = 4, WIRE_UNIT_REASONS = 16 };

/// "following", "departing", "alone", "stopping"; "unknown". Never null.
const char* wire_unit_mode_name(int32_t mode);
/// "contact", "plan_far", ...; "none" for 0; "unknown". Never null.
const char* wire_unit_reason_name(int32_t reason);

/// A checked state as input of the planner, at the state's own utime, without margin. cooperation
/// NaN: that of the habit; heading, speed, acceleration NaN: 0. The weights are always those of the
/// habit.
verge_vehicle wire_vehicle_from_state(const verge_vehicle_state_t* state);

/// The reverse, for programs that simulate vehicles. transport_publish_state() computes crc32;
/// position_sigma is unknown.
verge_vehicle_state_t wire_state_from_vehicle(const verge_vehicle* vehicle, verge_habit_kind habit,
                                              int64_t utime, int32_t sequence,
                                              int32_t followed_cycle);

/// The fields of a plan message that are not in the plan of the vehicle.
typedef struct wire_plan_header {
    int64_t  utime;             ///< [us] t = 0 of the plan
    int64_t  valid_until_utime; ///< [us]
    int64_t  state_utime;       ///< [us] of the state from which the vehicle was planned
    int32_t  rsu_id;
    int32_t  cycle;
    int32_t  plans_in_cycle;
    uint64_t digest;            ///< verge_plan.digest
    uint32_t map_crc32;         ///< wire_map_crc32() of the road
    uint32_t scene_sum;         ///< of the cycle, see wire_scene_hash()
} wire_plan_header;

/// The message for one vehicle: the first seven actions, the first 31 points. Its numbers are
/// those of a plan that verge_planner_step() made: nothing of its actions is lost by rounding.
verge_vehicle_plan_t wire_plan_from_vehicle_plan(const wire_plan_header* header,
                                                 const verge_vehicle_plan* plan);

/// The decision in a checked plan message, without what vehicles are ahead and behind, and without
/// the other lanes of its passes. False: the message has no actions. A message holds the decision
/// as far as a trajectory depends on it, if seven steps are at least as long as a trajectory.
bool wire_decision_from_plan(const verge_vehicle_plan_t* plan, verge_vehicle_decision* decision);

/// The plan in a checked message, as the last plan of the next cycle: all that is used of it is
/// there, with the bits that the roadside unit remembers (verge_vehicle_plan_round()). Empty are
/// cost, changed and what wire_decision_from_plan() leaves out. False: the plan is cancelled.
///
/// With the decisions of all messages of a cycle, the last plans of all messages of the cycle
/// before, and the vehicles, verge_planner_repeat() makes every trajectory of the cycle, bit for
/// bit. repeat.h does all this.
bool wire_vehicle_plan_from_plan(const verge_vehicle_plan_t* plan, verge_vehicle_plan* last);

/// A term of scene_sum. value: the utime of the vehicle's state, or the id of the lane on which it
/// was planned or predicted (verge_scene.positions, VERGE_NO_LANE included). scene_sum is the sum
/// of both terms over all vehicles of a cycle, modulo 2^32. A receiver that has heard another state
/// of one vehicle finds from the difference of two sums which one.
uint32_t wire_scene_hash(int32_t vehicle_id, int64_t value);

/// The checksum of a road: zlib's CRC-32 over all that its definition states, lane by lane in the
/// order of their ids, whatever file it was read from. Never 0.
uint32_t wire_map_crc32(const verge_road_def* road);

/// The message that withdraws a plan: status 3, no actions, no points.
verge_vehicle_plan_t wire_plan_cancelled(const wire_plan_header* header, int32_t vehicle_id,
                                         verge_reason reason);

/// The remainder of a checked plan at an instant. Elapsed points and actions are removed, none is
/// added or changed: t = 0 moves to the last point at or before utime, and valid_until_utime is the
/// same. False: fewer than two points remain, or the plan is cancelled; *rest is unchanged.
bool wire_plan_rest(const verge_vehicle_plan_t* plan, int64_t utime, verge_vehicle_plan_t* rest);

/// The trajectory of a checked plan message, with t from dt_ms and jerk from the accelerations (0
/// at the last point). Returns the number of points, at most VERGE_POINTS_MAX; 0 for a cancelled
/// plan.
uint32_t wire_points_from_plan(const verge_vehicle_plan_t* plan,
                               verge_point points[VERGE_POINTS_MAX]);

/// The same for a checked trajectory message.
uint32_t wire_points_from_trajectory(const verge_vehicle_trajectory_t* trajectory,
                                     verge_point points[VERGE_POINTS_MAX]);

/// The action at an instant: the last one whose t0 is not later. Null: there is none. Points into
/// the plan.
const verge_plan_action_t* wire_action_at(const verge_vehicle_plan_t* plan, int64_t utime);

#ifdef __cplusplus
}
#endif

#endif
