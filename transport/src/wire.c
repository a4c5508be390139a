/// Ranges of single fields are in messages.def; relations between fields are checked here.
#include "verge/wire.h"

#include "verge/message.h"

#include "base/scalar.h" // core's angles: a replay gives the same bits on every machine

#include <assert.h>
#include <math.h>
#include <string.h>

static verge_plan_action_t action_from_step(const verge_action_step* step);
static void                steps_from_actions(const verge_vehicle_plan_t* plan,
                                              verge_action_step* steps);
static verge_cause         cause_of(const verge_vehicle_plan_t* plan);
static uint32_t            read_passes(const verge_vehicle_plan_t* plan, verge_pass* passes);
static int32_t             begin_of(const verge_vehicle_plan_t* plan, int32_t action);
static void                write_order(verge_vehicle_plan_t* message,
                                       const verge_vehicle_plan* plan);
static void                remove_actions(verge_vehicle_plan_t* plan, int32_t ms);
static int32_t             change_end(const verge_vehicle_plan* plan);
static int32_t             milliseconds(double seconds);

#define LENGTH(type, array) (sizeof((type*)0)->array / sizeof((type*)0)->array[0])
static_assert(LENGTH(verge_vehicle_plan_t, actions) == WIRE_ACTIONS_MAX, "as in messages.def");
static_assert(LENGTH(verge_vehicle_plan_t, passes) == WIRE_PASSES_MAX, "as in messages.def");
static_assert(LENGTH(verge_vehicle_plan_t, stops) == WIRE_STOPS_MAX, "as in messages.def");
static_assert((int)WIRE_PASSES_MAX == (int)VERGE_PASSES_MAX, "every pass of a plan fits");
static_assert(VERGE_WHY_COUNT == 22, "the range of why in messages.def");
static_assert(LENGTH(verge_vehicle_plan_t, points) == WIRE_POINTS_MAX, "as in messages.def");

const char* wire_state_check(const verge_vehicle_state_t* state)
{
    return message_check(TRANSPORT_STATE, state);
}

const char* wire_plan_check(const verge_vehicle_plan_t* plan)
{
    const char* fault = message_check(TRANSPORT_PLAN, plan);
    if (fault != NULL) {
        return fault;
    }
    if (plan->valid_until_utime < plan->utime) {
        return "valid_until_utime";
    }
    if (plan->point_count < 2 && plan->status != VERGE_CANCELLED) {
        return "point_count";
    }
    if (plan->dt_ms < 1 && plan->point_count > 0) {
        return "dt_ms";
    }
    for (int32_t i = 0; i < plan->action_count; ++i) {
        if (plan->actions[i].t1_ms < begin_of(plan, i)) {
            return "actions.t1_ms";
        }
    }
    return NULL;
}

const char* wire_signal_check(const verge_lane_signal_t* signal)
{
    const char* fault = message_check(TRANSPORT_SIGNAL, signal);
    const bool  early = signal->change_utime != 0 && signal->change_utime < signal->utime;
    return fault == NULL && early ? "change_utime" : fault;
}

const char* wire_trajectory_check(const verge_vehicle_trajectory_t* trajectory)
{
    const char* fault = message_check(TRANSPORT_TRAJECTORY, trajectory);
    const bool  early = trajectory->valid_until_utime < trajectory->utime;
    return fault == NULL && early ? "valid_until_utime" : fault;
}

const char* wire_unit_mode_name(int32_t mode)
{
    static const char* const names[] = { "following", "departing", "alone", "stopping" };
    static_assert(sizeof names / sizeof names[0] == WIRE_UNIT_MODES, "one name for each mode");
    return mode >= 0 && mode < WIRE_UNIT_MODES ? names[mode] : "unknown";
}

const char* wire_unit_reason_name(int32_t reason)
{
    static const char* const names[] = {
        "none",        "contact",   "plan_far",      "never_heard", "silent",      "cancelled",
        "plan_over",   "other_map", "other_version", "not_wanted",  "no_position", "touching",
        "off_road",    "refused",   "no_trajectory", "red_signal",
    };
    static_assert(sizeof names / sizeof names[0] == WIRE_UNIT_REASONS, "one name for each reason");
    return reason >= 0 && reason < WIRE_UNIT_REASONS ? names[reason] : "unknown";
}

verge_vehicle wire_vehicle_from_state(const verge_vehicle_state_t* state)
{
    assert(wire_state_check(state) == NULL);

    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = state->vehicle_id;
    vehicle.controlled = state->controlled != 0;
    vehicle.x = state->x;
    vehicle.y = state->y;
    vehicle.heading = isnan(state->heading) ? 0.0 : vg_wrap_angle((double)state->heading);
    vehicle.speed = isnan(state->speed) ? 0.0 : (double)state->speed;
    vehicle.acceleration = isnan(state->acceleration) ? 0.0 : (double)state->acceleration;
    vehicle.yaw_rate = (double)state->yaw_rate;
    vehicle.length = (double)state->length;
    vehicle.width = (double)state->width;
    vehicle.margin = 0.0;
    vehicle.target_lane = state->target_lane;
    vehicle.habit = verge_habit_of((verge_habit_kind)state->habit);
    if (!isnan(state->cooperation)) {
        vehicle.habit.cooperation = (double)state->cooperation;
    }
    return vehicle;
}

verge_vehicle_state_t wire_state_from_vehicle(const verge_vehicle* vehicle, verge_habit_kind habit,
                                              int64_t utime, int32_t sequence,
                                              int32_t followed_cycle)
{
    const verge_habit usual = verge_habit_of(habit);
    const bool own_mind = vehicle->habit.cooperation != usual.cooperation;
    return (verge_vehicle_state_t){
        .utime = utime,
        .vehicle_id = vehicle->id,
        .sequence = sequence,
        .controlled = vehicle->controlled ? 1 : 0,
        .protocol_version = WIRE_PROTOCOL_VERSION,
        .x = vehicle->x,
        .y = vehicle->y,
        .heading = (float)vehicle->heading,
        .speed = (float)vehicle->speed,
        .acceleration = (float)vehicle->acceleration,
        .yaw_rate = (float)vehicle->yaw_rate,
        .length = (float)vehicle->length,
        .width = (float)vehicle->width,
        .position_sigma = NAN,
        .target_lane = vehicle->target_lane,
        .habit = (int16_t)habit,
        .cooperation = own_mind ? (float)vehicle->habit.cooperation : NAN,
        .followed_cycle = followed_cycle,
    };
}

verge_vehicle_plan_t wire_plan_from_vehicle_plan(const wire_plan_header* header,
                                                 const verge_vehicle_plan* plan)
{
    assert(plan->action_count <= VERGE_STEPS_MAX && plan->point_count <= VERGE_POINTS_MAX);

    verge_vehicle_plan_t message = wire_plan_cancelled(header, plan->vehicle_id, plan->reason);
    message.status = (int16_t)plan->status;

    const uint32_t actions = plan->action_count < WIRE_ACTIONS_MAX ? plan->action_count
                                                                   : (uint32_t)WIRE_ACTIONS_MAX;
    for (uint32_t i = 0; i < actions; ++i) {
        message.actions[i] = action_from_step(&plan->actions[i]);
    }
    message.action_count = (int32_t)actions;
    message.decided = (int16_t)plan->decided;
    message.change_lane = plan->change_lane_id;
    message.change_end_ms = change_end(plan);
    write_order(&message, plan);

    const uint32_t points = plan->point_count < WIRE_POINTS_MAX ? plan->point_count
                                                                : (uint32_t)WIRE_POINTS_MAX;
    for (uint32_t i = 0; i < points; ++i) {
        const verge_point* point = &plan->points[i];
        message.points[i] = (verge_plan_point_t){
            .x = point->x,
            .y = point->y,
            .heading = (float)point->heading,
            .speed = (float)point->speed,
            .acceleration = (float)point->acceleration,
            .curvature = (float)point->curvature,
        };
    }
    message.point_count = (int32_t)points;
    message.dt_ms = points > 1 ? (int16_t)milliseconds(plan->points[1].t - plan->points[0].t) : 0;
    return message;
}

/// As verge_vehicle_plan_round() does. [ms]
static int32_t change_end(const verge_vehicle_plan* plan)
{
    verge_vehicle_plan rounded = { .change_lane_id = plan->change_lane_id,
                                   .change_end = plan->change_end };
    verge_vehicle_plan_round(&rounded);
    return milliseconds(rounded.change_end);
}

/// What the vehicle waits for, and after whom it passes.
static void write_order(verge_vehicle_plan_t* message, const verge_vehicle_plan* plan)
{
    assert(plan->pass_count <= WIRE_PASSES_MAX);
    if (plan->why.code != VERGE_WHY_NONE) {
        message->why = (int16_t)plan->why.code;
        message->why_vehicle = plan->why.vehicle_id;
        message->why_lane = plan->why.lane_id;
    }
    message->pass_count = (int32_t)plan->pass_count;
    for (uint32_t i = 0; i < plan->pass_count; ++i) {
        message->passes[i] = (verge_plan_pass_t){ .lane = plan->passes[i].lane_id,
                                                  .after = plan->passes[i].after_id };
    }
}

bool wire_decision_from_plan(const verge_vehicle_plan_t* plan, verge_vehicle_decision* decision)
{
    assert(wire_plan_check(plan) == NULL);

    if (plan->action_count == 0 || plan->action_count > VERGE_STEPS_MAX) {
        return false;
    }
    *decision = (verge_vehicle_decision){
        .vehicle_id = plan->vehicle_id,
        .step_count = (uint32_t)plan->action_count,
        .why = cause_of(plan),
    };
    steps_from_actions(plan, decision->steps);
    decision->steps[0].action = (verge_action)plan->decided;
    decision->pass_count = read_passes(plan, decision->passes);
    return true;
}

bool wire_vehicle_plan_from_plan(const verge_vehicle_plan_t* plan, verge_vehicle_plan* last)
{
    assert(wire_plan_check(plan) == NULL);

    if (plan->status == VERGE_CANCELLED || plan->action_count > VERGE_STEPS_MAX
        || plan->point_count > VERGE_POINTS_MAX) {
        return false;
    }
    memset(last, 0, sizeof *last);
    last->vehicle_id = plan->vehicle_id;
    last->utime = plan->utime;
    last->status = (verge_plan_status)plan->status;
    last->reason = (verge_reason)plan->reason;
    last->action_count = (uint32_t)plan->action_count;
    steps_from_actions(plan, last->actions);
    last->decided = (verge_action)plan->decided;
    last->why = cause_of(plan);
    last->pass_count = read_passes(plan, last->passes);
    last->point_count = wire_points_from_plan(plan, last->points);
    last->change_lane_id = plan->change_lane;
    last->change_end = (double)plan->change_end_ms / 1000.0;
    return true;
}

static verge_cause cause_of(const verge_vehicle_plan_t* plan)
{
    return (verge_cause){ (verge_why)plan->why, plan->why_vehicle, plan->why_lane, 0 };
}

/// Returns their number.
static uint32_t read_passes(const verge_vehicle_plan_t* plan, verge_pass* passes)
{
    for (int32_t i = 0; i < plan->pass_count; ++i) {
        passes[i] = (verge_pass){ .lane_id = plan->passes[i].lane,
                                  .other_lane_id = VERGE_NO_LANE,
                                  .after_id = plan->passes[i].after };
    }
    return (uint32_t)plan->pass_count;
}

uint32_t wire_scene_hash(int32_t vehicle_id, int64_t value)
{
    // The last step of splitmix64: every bit of both numbers changes half of the bits of the hash.
    uint64_t bits = (uint64_t)value ^ ((uint64_t)(uint32_t)vehicle_id << 32);
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)(bits ^ (bits >> 31));
}

verge_vehicle_plan_t wire_plan_cancelled(const wire_plan_header* header, int32_t vehicle_id,
                                         verge_reason reason)
{
    return (verge_vehicle_plan_t){
        .utime = header->utime,
        .valid_until_utime = header->valid_until_utime,
        .rsu_id = header->rsu_id,
        .cycle = header->cycle,
        .plans_in_cycle = header->plans_in_cycle,
        .vehicle_id = vehicle_id,
        .state_utime = header->state_utime,
        .status = VERGE_CANCELLED,
        .reason = (int16_t)reason,
        .protocol_version = WIRE_PROTOCOL_VERSION,
        .map_crc32 = (int32_t)header->map_crc32,
        .scene_sum = (int32_t)header->scene_sum,
        .change_lane = VERGE_NO_LANE,
        .why_vehicle = -1,
        .why_lane = VERGE_NO_LANE,
        .digest = (int64_t)header->digest,
    };
}

bool wire_plan_rest(const verge_vehicle_plan_t* plan, int64_t utime, verge_vehicle_plan_t* rest)
{
    assert(wire_plan_check(plan) == NULL);

    const int64_t dt_us = (int64_t)plan->dt_ms * 1000;
    const bool    begun = plan->dt_ms > 0 && utime > plan->utime;
    const int64_t elapsed = begun ? (utime - plan->utime) / dt_us : 0;
    if (plan->status == VERGE_CANCELLED || elapsed > plan->point_count - 2) {
        return false;
    }
    const int32_t points = (int32_t)elapsed;
    const int32_t ms = points * plan->dt_ms;
    *rest = *plan;
    rest->utime += elapsed * dt_us;
    rest->point_count -= points;
    memmove(rest->points, rest->points + points,
            (size_t)rest->point_count * sizeof rest->points[0]);
    memset(rest->points + rest->point_count, 0, (size_t)points * sizeof rest->points[0]);

    rest->change_end_ms = rest->change_end_ms > ms ? rest->change_end_ms - ms : 0;
    remove_actions(rest, ms);
    return true;
}

/// Removes the actions that are over after ms [ms], and shortens the one that is not.
static void remove_actions(verge_vehicle_plan_t* plan, int32_t ms)
{
    int32_t done = 0; // the last action is kept to the end, also after its time is over
    while (done + 1 < plan->action_count && plan->actions[done].t1_ms <= ms) {
        ++done;
    }
    const int32_t begin = begin_of(plan, done);
    plan->action_count -= done;
    memmove(plan->actions, plan->actions + done,
            (size_t)plan->action_count * sizeof plan->actions[0]);
    memset(plan->actions + plan->action_count, 0, (size_t)done * sizeof plan->actions[0]);
    verge_plan_action_t* first = &plan->actions[0];
    if (done > 0) { // the decision of the first step is over
        plan->decided = first->action;
    }
    if (plan->action_count > 0 && begin < ms && first->t1_ms > ms) { // a part of it is driven
        first->distance *= (float)(first->t1_ms - ms) / (float)(first->t1_ms - begin);
    }
    for (int32_t i = 0; i < plan->action_count; ++i) {
        const int32_t end = plan->actions[i].t1_ms;
        plan->actions[i].t1_ms = end > ms ? end - ms : 0;
    }
}

/// When an action begins, from the plan's utime. [ms]
static int32_t begin_of(const verge_vehicle_plan_t* plan, int32_t action)
{
    return action == 0 ? 0 : plan->actions[action - 1].t1_ms;
}

/// sent, dt_ms: how many points there are, and the time between them.
static uint32_t points_read(const verge_plan_point_t* from, int32_t sent, int32_t dt_ms,
                            verge_point points[VERGE_POINTS_MAX])
{
    const uint32_t count = (uint32_t)sent < VERGE_POINTS_MAX ? (uint32_t)sent : VERGE_POINTS_MAX;
    const double   dt = dt_ms / 1000.0;
    for (uint32_t i = 0; i < count; ++i) {
        const verge_plan_point_t* point = &from[i];
        const bool   last = i + 1 == count;
        const double next = last ? 0.0 : (double)point[1].acceleration;
        const double now = (double)point->acceleration;
        points[i] = (verge_point){
            .t = (int32_t)i * dt_ms / 1000.0,
            .x = point->x,
            .y = point->y,
            .heading = (double)point->heading,
            .speed = (double)point->speed,
            .acceleration = now,
            .curvature = (double)point->curvature,
            .jerk = last ? 0.0 : (next - now) / dt,
        };
    }
    return count;
}

uint32_t wire_points_from_plan(const verge_vehicle_plan_t* plan,
                               verge_point points[VERGE_POINTS_MAX])
{
    assert(wire_plan_check(plan) == NULL);

    return points_read(plan->points, plan->point_count, plan->dt_ms, points);
}

uint32_t wire_points_from_trajectory(const verge_vehicle_trajectory_t* trajectory,
                                     verge_point points[VERGE_POINTS_MAX])
{
    assert(wire_trajectory_check(trajectory) == NULL);

    return points_read(trajectory->points, trajectory->point_count, trajectory->dt_ms, points);
}

const verge_plan_action_t* wire_action_at(const verge_vehicle_plan_t* plan, int64_t utime)
{
    const verge_plan_action_t* found = NULL;
    for (int32_t i = 0; i < plan->action_count && i < WIRE_ACTIONS_MAX; ++i) {
        if (plan->utime + (int64_t)begin_of(plan, i) * 1000 <= utime) {
            found = &plan->actions[i];
        }
    }
    return found;
}

static verge_plan_action_t action_from_step(const verge_action_step* step)
{
    return (verge_plan_action_t){
        .action = (int16_t)step->action,
        .brake_light = step->brake_light ? 1 : 0,
        .turn_signal = (int16_t)step->turn_signal,
        .d_mm = (int16_t)(step->d < 0.0 ? step->d * 1000.0 - 0.5 : step->d * 1000.0 + 0.5),
        .lane = step->lane_id,
        .t1_ms = milliseconds(step->t1),
        .s = (float)step->s,
        .speed = (float)step->v,
        .distance = (float)step->distance,
    };
}

/// The numbers that verge_decision_round() had rounded.
static void steps_from_actions(const verge_vehicle_plan_t* plan, verge_action_step* steps)
{
    for (int32_t i = 0; i < plan->action_count; ++i) {
        const verge_plan_action_t* action = &plan->actions[i];
        steps[i] = (verge_action_step){
            .action = (verge_action)action->action,
            .lane_id = action->lane,
            .t0 = (double)begin_of(plan, i) / 1000.0,
            .t1 = (double)action->t1_ms / 1000.0,
            .s = (double)action->s,
            .d = (double)action->d_mm / 1000.0,
            .v = (double)action->speed,
            .distance = (double)action->distance,
            .brake_light = action->brake_light != 0,
            .turn_signal = action->turn_signal,
            .ahead_id = -1,
            .behind_id = -1,
        };
    }
}

/// Rounded to the nearest; 0 .. an hour, so that the conversion is always defined.
static int32_t milliseconds(double seconds)
{
    const double rounded = seconds * 1000.0 + 0.5;
    return rounded >= 0.0 && rounded <= 3.6e6 ? (int32_t)rounded : 0;
}
