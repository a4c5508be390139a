/// Sentences for people: what a vehicle does, and what it waits for.

#include "verge/plan.h"

#include "traffic/actions.h"

const char* verge_why_name(verge_why code)
{
    static const char* const names[VERGE_WHY_COUNT] = {
        "none", "leader", "area", "exit", "merge", "lane_end", "signal", "stop_line", "yield",
        "obstacle", "oncoming", "human", "room_ahead", "room_behind", "border", "freeze", "bend",
        "gap", "unreachable", "blocked", "fallback", "off_road",
    };
    return (unsigned)code < VERGE_WHY_COUNT ? names[code] : "??";
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
        [VERGE_WHY_BLOCKED] = "stood without a cause",
        [VERGE_WHY_FALLBACK] = "no acceptable trajectory",
        [VERGE_WHY_OFF_ROAD] = "it is on no lane",
    };
    return (unsigned)code < VERGE_WHY_COUNT ? texts[code] : "unknown reason";
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

/// A sentence with a vehicle, with a lane, or with the lane beside in front of it.
typedef struct cause_words {
    const char *before, *after; // the id; null: the sentence is verge_why_text()
    bool of_lane;               // the id is that of the lane; else the vehicle's
    bool of_change;             // begins with the lane beside
} cause_words;

static const cause_words cause_sentences[VERGE_WHY_COUNT] = {
    [VERGE_WHY_LEADER] = { "behind vehicle ", "", false, false },
    [VERGE_WHY_AREA] = { "waits for vehicle ", " to clear the crossing", false, false },
    [VERGE_WHY_EXIT] = { "keeps the crossing clear, no room behind vehicle ", "", false, false },
    [VERGE_WHY_MERGE] = { "lets vehicle ", " merge first", false, false },
    [VERGE_WHY_LANE_END] = { "waits at the end of lane ", "", true, false },
    [VERGE_WHY_SIGNAL] = { "waits for the signal of lane ", "", true, false },
    [VERGE_WHY_STOP_LINE] = { "stops at the line of lane ", "", true, false },
    [VERGE_WHY_YIELD] = { "yields to vehicle ", "", false, false },
    [VERGE_WHY_OBSTACLE] = { "vehicle ", " stands in the way", false, false },
    [VERGE_WHY_ONCOMING] = { "vehicle ", " comes the other way", false, false },
    [VERGE_WHY_HUMAN] = { "waits for what vehicle ", " will do", false, false },
    [VERGE_WHY_ROOM_AHEAD] = { "no room behind vehicle ", "", false, true },
    [VERGE_WHY_ROOM_BEHIND] = { "no room ahead of vehicle ", "", false, true },
    [VERGE_WHY_BORDER] = { NULL, NULL, false, true },
    [VERGE_WHY_FREEZE] = { NULL, NULL, false, true },
    [VERGE_WHY_GAP] = { "opens a gap behind vehicle ", "", false, true },
    [VERGE_WHY_UNREACHABLE] = { "cannot reach lane ", " from here", true, false },
    [VERGE_WHY_BLOCKED] = { "was blocked by vehicle ", "", false, false },
};

static void append_lane_beside(sentence* to, const verge_cause* cause)
{
    if (cause->side != 0) {
        append(to, cause->side > 0 ? "left lane: " : "right lane: ");
    } else if (cause->lane_id >= 0) {
        append(to, "lane ");
        append_id(to, cause->lane_id);
        append(to, ": ");
    }
}

size_t verge_cause_say(const verge_cause* cause, char* text, size_t size)
{
    sentence to = { text, size, 0 };
    if (size == 0 || text == NULL) {
        return 0;
    }
    const verge_why code = cause == NULL ? VERGE_WHY_NONE : cause->code;
    if (code != VERGE_WHY_NONE && (unsigned)code < VERGE_WHY_COUNT) {
        const cause_words* words = &cause_sentences[code];
        const int32_t id = words->of_lane ? cause->lane_id : cause->vehicle_id;
        if (words->of_change) {
            append_lane_beside(&to, cause);
        }
        if (words->before != NULL && id >= 0) {
            append(&to, words->before);
            append_id(&to, id);
            append(&to, words->after);
        } else {
            append(&to, verge_why_text(code));
        }
    }
    text[to.used] = '\0';
    return to.used;
}

size_t verge_plan_say(const verge_vehicle_plan* plan, char* text, size_t size)
{
    if (size == 0 || text == NULL) {
        return 0;
    }
    text[0] = '\0';
    if (plan == NULL || plan->action_count == 0) {
        return 0;
    }
    size_t used = verge_action_say(&plan->actions[0], text, size);
    const bool follows = plan->why.code == VERGE_WHY_LEADER
                         && plan->why.vehicle_id == plan->actions[0].ahead_id;
    if (plan->why.code != VERGE_WHY_NONE && !follows) { // the action names the leader
        sentence to = { text, size, used };
        append(&to, "; ");
        used = to.used + verge_cause_say(&plan->why, text + to.used, size - to.used);
    }
    return used;
}
