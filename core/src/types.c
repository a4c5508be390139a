/// Texts of statuses and reasons; habits; defaults of vehicles. Sentences: say.c.

#include "verge/plan.h"

#include "traffic/actions.h"

const char* verge_status_text(verge_status status)
{
    switch (status) {
    case VERGE_OK: return "ok";
    case VERGE_ERR_DEF: return "a planner parameter is out of its range";
    case VERGE_ERR_MEMORY: return "the memory given is too small or not aligned to 64 bytes";
    case VERGE_ERR_ROAD: return "the road cannot be built";
    case VERGE_ERR_CAPACITY: return "more vehicles than the capacity";
    case VERGE_ERR_VEHICLE: return "a vehicle with a value that is not finite or out of range";
    case VERGE_ERR_DUPLICATE: return "two vehicles with one id";
    case VERGE_ERR_OFF_ROAD: return "a vehicle that is on no lane";
    case VERGE_ERR_CONFIG: return "caller and library were compiled with different capacities";
    case VERGE_ERR_ARGUMENT: return "a null pointer, or a scene that does not hold";
    case VERGE_ERR_SIGNAL: return "a signal that is not valid on this road";
    }
    return "unknown status";
}

const char* verge_action_name(verge_action action)
{
    return (unsigned)action < VERGE_ACTION_COUNT ? vg_actions[action].name : "??";
}

const char* verge_reason_text(verge_reason reason)
{
    switch (reason) {
    case VERGE_REASON_NONE: return "none";
    case VERGE_REASON_NO_FEASIBLE: return "no candidate within the vehicle's limits";
    case VERGE_REASON_COLLISION: return "every candidate collides with a predicted vehicle";
    case VERGE_REASON_JOINT: return "every candidate collides with another controlled vehicle";
    case VERGE_REASON_OVERLAP_NOW: return "the vehicle overlaps another one already";
    case VERGE_REASON_OFF_ROAD: return "the vehicle is on no lane";
    case VERGE_REASON_OVERRUN: return "the planning cycle ran out of time";
    case VERGE_REASON_STALE: return "the vehicle's state is too old";
    case VERGE_REASON_STOP: return "a stop was asked for";
    }
    return "unknown reason";
}

const char* verge_priority_name(verge_priority priority)
{
    static const char* const names[VERGE_PRIORITY_COUNT] = { "none", "major", "minor", "stop",
                                                             "right-before-left" };
    return (unsigned)priority < VERGE_PRIORITY_COUNT ? names[priority] : "??";
}

// Table 2 of the paper gives cooperation, obstacle, offset (its "out") and jerk. Curvature,
// heading and acceleration are the same for all three, because the paper does not give them.
verge_habit verge_habit_of(verge_habit_kind kind)
{
    verge_habit habit = {
        .cooperation = 0.5,
        .weights = { .curvature = 1.0, .heading = 1.0, .offset = 5.0, .acceleration = 1.0,
                     .jerk = 1.0, .obstacle = 4.0 },
    };
    if (kind == VERGE_AGGRESSIVE) {
        habit.cooperation = 0.1;
        habit.weights.obstacle = 2.0;
        habit.weights.offset = 6.5;
        habit.weights.jerk = 0.7;
    } else if (kind == VERGE_CONSERVATIVE) {
        habit.cooperation = 0.9;
        habit.weights.obstacle = 6.0;
        habit.weights.offset = 4.0;
        habit.weights.jerk = 1.2;
    }
    return habit;
}

verge_vehicle verge_vehicle_default(void)
{
    const verge_vehicle vehicle = {
        .length = 5.0, // paper, section 4
        .width = 2.0,
        .trailer_heading = __builtin_nan(""),
        .yaw_rate = __builtin_nan(""),
        .target_lane = VERGE_NO_LANE,
        .habit = verge_habit_of(VERGE_NORMAL),
    };
    return vehicle;
}

void verge_vehicle_set_body(verge_vehicle* vehicle, const verge_body* body)
{
    if (vehicle == NULL || body == NULL) {
        return;
    }
    vehicle->body = *body;
    vehicle->length = body->length;
    vehicle->width = body->width;
}

verge_body verge_vehicle_body(const verge_vehicle* vehicle)
{
    if (vehicle == NULL) {
        return (verge_body){ 0 };
    }
    return vehicle->body.length > 0.0 ? vehicle->body
                                      : verge_body_by_size(vehicle->length, vehicle->width);
}
