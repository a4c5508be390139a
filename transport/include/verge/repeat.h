/// The cycles of a roadside unit planned again on board of a vehicle, from messages alone: to check
/// that a plan is what its roadside unit says, and to name what differs.
///
///     repeat_init(&repeat, &def);
///     repeat_state(&repeat, &message.as.state);           // each state, the vehicle's own as well
///     repeat_signal(&repeat, &message.as.signal);         // each signal
///     if (repeat_plan(&repeat, &message.as.plan)) {       // each plan; true: the cycle is whole
///         repeat_run(&repeat, own_id, &result);
///     }
///
/// The trajectory of a vehicle follows, bit for bit, from
///
///   - the plan messages of the cycle: the decisions, and what they were made from;
///   - the plan messages of the cycle before: the last plans;
///   - the state messages of all vehicles, and the signals;
///   - road, parameters and freshness limits of the roadside unit, and the version of this library.
///
/// What the roadside unit remembers besides is not needed, with these exceptions:
///
///   - The lane of a vehicle where lanes overlap is the one that it had before. It follows from the
///     messages of the cycles since the vehicle was on a lane of its own. Where the unit has not
///     heard these, scene_sum tells the lanes of up to two vehicles, in each cycle.
///   - A late plan (REPEAT_LATE) is a part of a plan: it cannot be repeated, and neither can the
///     cycle after it. It is driven as it was sent.
///   - Decisions longer than seven steps: the message holds the first seven. Where these are
///     shorter than a trajectory, no plan can be repeated.
///
/// Memory      All in the struct (about 420 kB: keep it static) and in the planner.
/// Threads     One at a time.
/// Time        No clock is read: the instants are those in the messages.
#ifndef VERGE_REPEAT_H
#define VERGE_REPEAT_H

#include "verge/inbox.h"
#include "verge/planner.h"
#include "verge/wire.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    REPEAT_STATES_MAX = 1024, ///< states that wait for the cycle that uses them
    REPEAT_SIGNALS_MAX = 512,
    REPEAT_PLANS_MAX = 2 * VERGE_CONTROLLED_MAX, ///< messages of a cycle, cancellations included
    REPEAT_DIFFERENCES_MAX = 8,
};

/// All of it as in the roadside unit.
typedef struct repeat_def {
    verge_planner* planner;        ///< for this alone; outlives it. Seed and search do not matter
    uint32_t       vehicles_max;   ///< of the planner's def
    uint32_t       controlled_max; ///< of the planner's def
    inbox_limits   limits;
    uint32_t       map_crc32;      ///< wire_map_crc32() of the planner's road
} repeat_def;

/// How the input of a cycle, or its result, differs from what the vehicle has heard.
typedef enum repeat_kind {
    // Found, and made up for: the plan was repeated from what the roadside unit had.
    REPEAT_UNHEARD_BY_RSU = 1, ///< vehicle: the roadside unit did not know of it
    REPEAT_OLDER_STATE,        ///< vehicle: not planned from its newest state before utime
    REPEAT_NEWER_STATE,        ///< vehicle: planned from a state newer than utime of the plan
    REPEAT_OTHER_LANE,         ///< vehicle: taken to be on another lane, where lanes overlap
    // Found, and not made up for: the result may differ.
    REPEAT_STATE_MISSED,       ///< vehicle: a state of it, or with -1 of any, was not heard here
    REPEAT_LAST_MISSED,        ///< the plans of the cycle before were not all heard
    REPEAT_LATE,               ///< the plan is late, or the one before was
    REPEAT_OTHER_ROAD,         ///< the plan is for another road
    // None of all these, and the result differs nevertheless.
    REPEAT_OTHER_RESULT,       ///< other parameters, another version, a signal not heard
} repeat_kind;

/// A few words for a kind ("not heard by the roadside unit"); static lifetime.
const char* repeat_kind_text(repeat_kind kind);

typedef struct repeat_difference {
    repeat_kind kind;
    int32_t     vehicle_id;  ///< -1: none
    int64_t     state_utime; ///< [us] of the state that the roadside unit planned from; 0: none
    int32_t     lane_id;     ///< of REPEAT_OTHER_LANE: the lane on which the roadside unit has it
} repeat_difference;

typedef struct repeat_result {
    bool     planned;  ///< the cycle has a plan for the vehicle, and it was repeated
    bool     same;     ///< the repeated plan is the one of the message, bit for bit
    verge_vehicle_plan_t plan;     ///< the message that the repeated plan makes; crc32 is not set
    uint32_t difference_count;     ///< 0 .. REPEAT_DIFFERENCES_MAX
    repeat_difference differences[REPEAT_DIFFERENCES_MAX];
} repeat_result;

/// What the roadside unit had of a vehicle, as far as it is known.
typedef struct repeat_choice {
    int32_t vehicle_id;
    bool    of_lane; ///< false: the state; true: the lane
    int64_t utime;   ///< [us] of the state; 0: it had none
    int32_t lane_id; ///< the lane
} repeat_choice;

typedef struct repeat {
    repeat_def def;
    inbox      held;        ///< as that of the roadside unit after the last cycle
    inbox      next;        ///< the same after the present one
    inbox_view view;        ///< the vehicles of the present cycle, and their states
    verge_scene            scene; ///< the same with their lanes
    verge_vehicle          vehicles[VERGE_VEHICLES_MAX];
    verge_lane_position    positions[VERGE_VEHICLES_MAX], before[VERGE_VEHICLES_MAX];
    uint32_t   choice_count;
    repeat_choice choices[REPEAT_PLANS_MAX + 2]; ///< planned ones, and what the sum tells
    uint32_t   state_count; ///< states heard that are not in the inbox, in this order
    verge_vehicle_state_t  states[REPEAT_STATES_MAX];
    uint32_t   signal_count;
    verge_lane_signal_t    signals[REPEAT_SIGNALS_MAX];
    uint32_t   plan_count;  ///< messages of the present cycle
    verge_vehicle_plan_t   plans[REPEAT_PLANS_MAX];
    verge_vehicle_decision decisions[VERGE_CONTROLLED_MAX];
    uint32_t   last_count;  ///< plans of the last cycle
    verge_vehicle_plan     last[VERGE_CONTROLLED_MAX];
    int64_t    last_cycle;  ///< its number; -1: there is none
    int64_t    last_utime;
    bool       last_late;
    verge_plan plan;        ///< the plans of all vehicles, as repeated last
} repeat;

/// def: its limits pass inbox_limits_check(), its counts are those of the planner.
void repeat_init(repeat* self, const repeat_def* def);

/// Hears a state. It is checked where a cycle uses it. Of more than REPEAT_STATES_MAX between two
/// cycles the oldest are lost.
void repeat_state(repeat* self, const verge_vehicle_state_t* state);
void repeat_signal(repeat* self, const verge_lane_signal_t* signal);

/// Hears a plan of the one roadside unit. True: all messages of its cycle have been heard, and
/// repeat_run() is next. Ignored are the rest of an earlier plan (VERGE_REASON_OVERRUN), a message
/// heard again, as on a second bus, and one that wire_plan_check() refuses.
bool repeat_plan(repeat* self, const verge_vehicle_plan_t* plan);

/// Plans the cycle again, for all its vehicles (self->plan), and compares the plan of one. Of a
/// vehicle without a plan in the cycle nothing is compared. Where the messages of the next cycle
/// have begun to arrive, the cycle is over: nothing is planned.
void repeat_run(repeat* self, int32_t vehicle_id, repeat_result* result);

#ifdef __cplusplus
}
#endif

#endif
