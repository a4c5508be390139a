/// Texts of statuses, actions and reasons; habits; defaults of vehicles.

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
    }
    return "unknown reason";
}

const char* verge_why_text(verge_why code)
{
    static const char* const texts[VERGE_WHY_COUNT] = {
        [VERGE_WHY_NONE] = "nothing holds it back",
        [VERGE_WHY_LEADER] = "a vehicle ahead",
        [VERGE_WHY_AREA] = "another vehicle crosses first",
        [VERGE_WHY_EXIT] = "no room behind the crossing, which stays clear",
        [VERGE_WHY_MERGE] = "another vehicle merges first",
        [VERGE_WHY_LANE_END] = "the lane ends",
        [VERGE_WHY_SIGNAL] = "the signal is not green",
        [VERGE_WHY_STOP_LINE] = "a stop line",
        [VERGE_WHY_YIELD] = "another vehicle has priority",
        [VERGE_WHY_OBSTACLE] = "a standing vehicle in the way",
        [VERGE_WHY_ONCOMING] = "a vehicle that comes towards it",
        [VERGE_WHY_HUMAN] = "a vehicle that may do one thing or another",
        [VERGE_WHY_ROOM_AHEAD] = "no room ahead of it in the other lane",
        [VERGE_WHY_ROOM_BEHIND] = "no room behind it in the other lane",
        [VERGE_WHY_BORDER] = "no lane change is allowed here",
        [VERGE_WHY_FREEZE] = "a lane change has just ended",
        [VERGE_WHY_BEND] = "a bend",
        [VERGE_WHY_GAP] = "a gap has to open first",
        [VERGE_WHY_UNREACHABLE] = "the target lane cannot be reached from here",
        [VERGE_WHY_BLOCKED] = "blocked",
        [VERGE_WHY_FALLBACK] = "no acceptable trajectory",
        [VERGE_WHY_OFF_ROAD] = "it is on no lane",
    };
    return (unsigned)code < VERGE_WHY_COUNT ? texts[code] : "unknown reason";
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

// A string in a buffer of fixed size; text that does not fit is cut.
typedef struct sentence {
    char*  text;
    size_t size, used;
} sentence;

static void append(sentence* to, const char* words)
{
    for (; *words != '\0' && to->used + 1 < to->size; ++words) {
        to->text[to->used++] = *words;
    }
}

static void append_id(sentence* to, int32_t id)
{
    char digits[12];
    size_t first = sizeof digits - 1;
    digits[first] = '\0';
    uint32_t rest = id < 0 ? 0u : (uint32_t)id;
    do {
        digits[--first] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    append(to, &digits[first]);
}

static void append_neighbour(sentence* to, const char* relation, int32_t id)
{
    append(to, relation);
    append(to, " vehicle ");
    append_id(to, id);
}

size_t verge_action_say(const verge_action_step* step, char* text, size_t size)
{
    sentence to = { text, size, 0 };
    if (size == 0 || text == NULL) {
        return 0;
    }
    if (step == NULL) {
        text[0] = '\0';
        return 0;
    }
    const bool known = (unsigned)step->action < VERGE_ACTION_COUNT;
    const bool changing = known && vg_action_changes_lane(step->action);
    append(&to, known ? vg_actions[step->action].words : "unknown action");
    if (step->ahead_id >= 0) {
        append_neighbour(&to, " behind", step->ahead_id);
    }
    if (changing && step->behind_id >= 0) {
        append_neighbour(&to, step->ahead_id >= 0 ? ", ahead of" : " ahead of", step->behind_id);
    }
    text[to.used] = '\0';
    return to.used;
}
