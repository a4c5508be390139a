/// The traffic signals of a scene: checked, ordered by lane, looked up.
#include "traffic/signals.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "road/road.h"

// A change further away than this is a unit mistaken for another. [s]
static const double change_max = 86400.0;

const char* verge_signal_state_name(verge_signal_state state)
{
    static const char* const names[VERGE_SIGNAL_STATE_COUNT] = { "off", "red", "yellow", "green" };
    return (unsigned)state < VERGE_SIGNAL_STATE_COUNT ? names[state] : "??";
}

static bool signal_holds(const verge_road* road, const verge_signal* signal,
                         verge_signal_fault* fault)
{
    fault->field = "lane";
    fault->expected = "the id of a lane of the road";
    if (vg_road_lane_index(road, signal->lane_id) < 0) {
        return false;
    }
    fault->field = "state";
    fault->expected = "off, red, yellow or green";
    if ((unsigned)signal->state >= VERGE_SIGNAL_STATE_COUNT) {
        return false;
    }
    fault->field = "change_s";
    fault->expected = "0 to 86400 s, or a negative number: unknown";
    return vg_finite(signal->change_s) && signal->change_s <= change_max;
}

static bool lane_is_taken(const verge_signal* signals, uint32_t index)
{
    uint32_t other = 0;
    while (signals[other].lane_id != signals[index].lane_id) {
        ++other;
    }
    return other < index;
}

verge_status verge_signals_check(const verge_road* road, const verge_signal* signals,
                                 uint32_t signal_count, verge_signal_fault* fault)
{
    verge_signal_fault ignored;
    fault = fault != NULL ? fault : &ignored;
    *fault = (verge_signal_fault){ .signal_index = 0 };
    if (road == NULL || (signals == NULL && signal_count > 0)) {
        return VERGE_ERR_ARGUMENT;
    }
    for (uint32_t i = 0; i < signal_count; ++i) {
        fault->signal_index = i;
        if (!signal_holds(road, &signals[i], fault)) {
            return VERGE_ERR_SIGNAL;
        }
        if (lane_is_taken(signals, i)) {
            fault->field = "lane";
            fault->expected = "a lane that no other signal has";
            return VERGE_ERR_SIGNAL;
        }
    }
    *fault = (verge_signal_fault){ .signal_index = 0 };
    return VERGE_OK;
}

bool vg_signals_hold(const verge_road* road, const verge_signal* signals, uint32_t count)
{
    if (count > 0 && (road == NULL || signals == NULL)) {
        return false;
    }
    verge_signal_fault fault;
    bool holds = true;
    for (uint32_t i = 0; i < count && holds; ++i) {
        holds = (i == 0 || signals[i - 1u].lane_id < signals[i].lane_id)
                && signal_holds(road, &signals[i], &fault);
    }
    return holds;
}

void vg_signals_sort(verge_signal* to, const verge_signal* from, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t at = i;
        for (; at > 0 && to[at - 1u].lane_id > from[i].lane_id; --at) {
            to[at] = to[at - 1u];
        }
        VERGE_ASSERT(at == 0 || to[at - 1u].lane_id < from[i].lane_id);
        to[at] = from[i];
    }
}

void vg_signals_after(verge_signal* to, const verge_signal* from, uint32_t count, double seconds)
{
    for (uint32_t i = 0; i < count; ++i) {
        to[i] = from[i];
        if (from[i].change_s < 0.0) {
            continue;
        }
        to[i].change_s = from[i].change_s - seconds;
        // What it shows now, nobody has said.
        if (to[i].change_s < 0.0) {
            to[i].change_s = -1.0;
            to[i].state = from[i].state == VERGE_SIGNAL_OFF ? VERGE_SIGNAL_OFF : VERGE_SIGNAL_RED;
        }
    }
}

const verge_signal* verge_scene_signal(const verge_scene* scene, int32_t lane_id)
{
    if (scene == NULL || scene->signals == NULL) {
        return NULL;
    }
    uint32_t low = 0, high = scene->signal_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        if (scene->signals[middle].lane_id < lane_id) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    const bool found = low < scene->signal_count && scene->signals[low].lane_id == lane_id;
    return found ? &scene->signals[low] : NULL;
}
