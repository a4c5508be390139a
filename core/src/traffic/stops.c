/// Where rules stop a vehicle, whoever else is there: at signals, now and after their next change,
/// and at stop signs. See order.h.
#include "traffic/order.h"

#include "base/contract.h"
#include "base/scalar.h"

// A vehicle that would have to brake harder for a red signal, or for a stop sign, drives through.
// [m/s^2]
static const float braking_last = 8.0f;
// The same for a yellow signal, and for one that is about to close. [m/s^2]
static const float braking_yellow = 3.0f;
// Who stops with the front so far over the line of a signal, or of a stop sign, has stopped at it.
// [m]
static const float over_line = 2.0f, over_sign = 2.0f;
// One that brakes for a line may stop with its nose so far over it. [m]
static const float over_nose = 0.5f;
// The front of a vehicle waits this far before a line. [m]
static const float before_line = 1.0f;
// An area that begins more than this before a line is one of its own. [m]
static const float area_reach = 6.0f;
// A vehicle passes before a signal closes if it is at the line this long before, with this share of
// its usual acceleration. [s], [1]
static const float in_time = 0.3f, sure_share = 0.7f;
static const float human_acceleration = 1.0f; // [m/s^2]
// Who stands with its front this near before the line of a stop sign stands at the line. Drivers
// stop some metres before it; the next one in the queue is farther away. [m], [m/s]
static const float at_sign = 3.0f, standing = 0.3f;
// A stop at a stop sign lasts so long. [s]
static const double stop_lasts = 1.0;
// Without a memory, a vehicle slower than this at the line is taken to have stopped. [m/s]
static const float seems_stopped = 2.0f;
// A vehicle waits at the line of a stop sign, and not again before an area that begins this near
// behind it. [m]
static const float sign_reach = 10.0f;

// Can a vehicle stop with its front at a line `gap` ahead, or a little over it? One that is over it
// already stops within the same distance, but not farther than `over` behind the line.
static bool can_stop(float v, float gap, float over, float braking)
{
    const float room = gap >= 0.0f ? gap + over_nose : vg_minf(over_nose, gap + over);
    return room >= 0.0f && v * v <= 2.0f * braking * room;
}

static float stop_line(const verge_road* road, const vg_route_leg* leg)
{
    const vg_lane* lane = &road->lanes[leg->lane];
    return vg_on_leg(leg, (float)vg_lane_station(lane, lane->stop_line));
}

// Where the front waits at the line of a lane: a little before it, and not in an area that begins
// shortly before it.
static float waiting_line(const verge_road* road, const vg_route_leg* leg)
{
    const uint32_t lane = (uint32_t)leg->lane;
    const float line = stop_line(road, leg);
    float wait = line - before_line;
    for (uint32_t c = road->conflicts_from[lane]; c < road->conflicts_from[lane + 1u]; ++c) {
        const vg_conflict* area = &road->conflicts[c];
        const float from = vg_on_leg(leg, area->from);
        if (!area->parts && from > line - area_reach && vg_on_leg(leg, area->to) > line) {
            wait = vg_minf(wait, from - VG_STOP_BEFORE);
        }
    }
    for (uint32_t m = road->merges_from[lane]; m < road->merges_from[lane + 1u]; ++m) {
        const float touch = vg_on_leg(leg, road->merges[m].touch);
        wait = touch > line - area_reach ? vg_minf(wait, touch - VG_STOP_BEFORE_MERGE) : wait;
    }
    return wait;
}

// ---------------------------------------------------------------------------- signals

// Does the slot pass a line within a time, accelerating less than it usually does?
static bool passes_within(const vg_model* model, const vg_flow* flow, uint32_t slot, float gap,
                          float seconds)
{
    const float v = flow->v[slot], limit = vg_maxf(flow->limit[slot], v);
    const float a = slot < model->controlled_count ? sure_share * (float)model->acceleration[slot]
                                                   : human_acceleration;
    const float rising = a > 0.0f ? vg_minf((limit - v) / a, vg_maxf(seconds, 0.0f)) : 0.0f;
    const float way = (v + 0.5f * a * rising) * rising
                      + (v + a * rising) * vg_maxf(seconds - rising, 0.0f);
    return way >= gap;
}

static float gap_to(const vg_model* model, uint32_t slot, float line, float r)
{
    return line - r - model->half_length[slot];
}

// Has the slot to stop at a signal, as it is at the instant of a flow? Whether it stops for what
// the signal shows at the root is decided there, once.
static bool is_closed(const vg_order* order, const vg_model* model, const vg_flow* flow,
                      uint32_t slot, const vg_light* light, float r)
{
    const float gap = gap_to(model, slot, light->line, r), v = flow->v[slot];
    const float left = light->change - flow->t;
    if (gap < -over_line) {
        return false;
    }
    if (light->state == VERGE_SIGNAL_RED) {
        return left > 0.0f && !light->passes;
    }
    if (left > 0.0f && light->state == VERGE_SIGNAL_YELLOW) {
        return !light->passes;
    }
    if (left > 0.0f) { // green: only who is planned here knows for how long
        return slot < model->controlled_count && !order->of_humans && left < VG_FAR_AWAY
               && gap >= 0.0f && !passes_within(model, flow, slot, gap, left - in_time)
               && can_stop(v, gap, over_line, braking_yellow);
    }
    return can_stop(v, gap, over_line,
                    light->state == VERGE_SIGNAL_GREEN ? braking_yellow : braking_last);
}

// Does the slot drive on past what a signal shows at the root? At red a vehicle does that cannot
// stop any more, at yellow one that cannot stop comfortably and is over the line before red.
static bool drives_past(const vg_model* model, const vg_flow* flow, uint32_t slot,
                        const vg_light* light)
{
    const float gap = gap_to(model, slot, light->line, 0.0f), v = flow->v[slot];
    const bool late = light->state == VERGE_SIGNAL_RED
                      || (light->change < VG_FAR_AWAY
                          && !passes_within(model, flow, slot, gap, light->change));
    return !can_stop(v, gap, over_line, late ? braking_last : braking_yellow);
}

static void find_lights(const vg_order* order, vg_course* course, const vg_model* model,
                        const vg_flow* flow, const verge_scene* scene, uint32_t slot)
{
    for (uint32_t k = 0; scene->signal_count > 0 && k < course->leg_count; ++k) {
        const vg_route_leg* leg = &course->legs[k];
        const vg_lane* lane = &model->road->lanes[leg->lane];
        const verge_signal* signal = verge_scene_signal(scene, lane->id);
        const float line = stop_line(model->road, leg);
        if (signal == NULL || signal->state == VERGE_SIGNAL_OFF
            || gap_to(model, slot, line, 0.0f) < -over_line
            || course->light_count == VG_LIGHTS_MAX) {
            continue;
        }
        // Who drives by what it sees does not know when that changes.
        const bool known = signal->change_s >= 0.0 && !order->of_humans;
        vg_light light = { .line = line, .wait = waiting_line(model->road, leg),
                           .lane = (uint16_t)leg->lane, .state = (uint8_t)signal->state,
                           .change = known ? (float)signal->change_s : VG_FAR_AWAY };
        light.passes = signal->state != VERGE_SIGNAL_GREEN
                       && drives_past(model, flow, slot, &light);
        course->lights[course->light_count++] = light;
    }
}

static const vg_light* closed_light(const vg_order* order, const vg_model* model,
                                    const vg_flow* flow, uint32_t slot, float r)
{
    const vg_course* course = &order->courses[slot];
    for (uint32_t k = 0; k < course->light_count; ++k) {
        if (is_closed(order, model, flow, slot, &course->lights[k], r)) {
            return &course->lights[k];
        }
    }
    return NULL;
}

static float opens_in(const vg_light* light, const vg_flow* flow)
{
    return light->state == VERGE_SIGNAL_RED && light->change < VG_FAR_AWAY
               ? vg_maxf(light->change - flow->t, 0.0f) : VG_FAR_AWAY;
}

// ---------------------------------------------------------------------------- stop signs

static bool stands_at(const vg_model* model, const vg_flow* flow, uint32_t slot, float line,
                      float r)
{
    const float gap = gap_to(model, slot, line, r);
    return vg_fabsf(flow->v[slot]) < standing && gap >= -over_sign && gap < at_sign;
}

// Since when does the slot stand at the line of its sign, or did it stand there for long enough? 0:
// it did not. [us]
static int64_t stopped_since(const vg_model* model, const vg_flow* flow, uint32_t slot,
                             const vg_course* course, int64_t utime, int64_t since)
{
    if (stands_at(model, flow, slot, course->sign, 0.0f)) {
        return since != 0 ? since : utime;
    }
    return since != 0 && vg_seconds_between(since, utime) >= stop_lasts ? since : 0;
}

// The first stop sign ahead at which the slot has stopped, or can still stop. Returns since when it
// stands or stood there. [us]
static int64_t find_sign(vg_course* course, const vg_model* model, const vg_flow* flow,
                         uint32_t slot, const verge_turn* before)
{
    for (uint32_t k = 0; k < course->leg_count; ++k) {
        const vg_route_leg* leg = &course->legs[k];
        const vg_lane* lane = &model->road->lanes[leg->lane];
        if (lane->priority != VERGE_PRIORITY_STOP) {
            continue;
        }
        const float line = waiting_line(model->road, leg);
        const float gap = gap_to(model, slot, line, 0.0f);
        const bool stopped =
            before != NULL && before->stopped != 0 && before->stop_lane_id == lane->id;
        if (stopped ? gap >= -over_sign
                    : can_stop(flow->v[slot], gap, over_sign, braking_last)) {
            course->sign = line;
            course->sign_lane = (uint16_t)leg->lane;
            return stopped ? before->stopped : 0;
        }
    }
    return 0;
}

// ---------------------------------------------------------------------------- shared

void vg_order_find_stops(vg_order* order, const vg_model* model, const vg_flow* flow,
                         const verge_scene* scene, uint32_t slot, verge_turns* turns)
{
    VERGE_ASSERT(slot < order->vehicles_max && flow->t == 0.0f);
    vg_course* course = &order->courses[slot];
    course->sign = course->red = VG_FAR_AWAY;
    find_lights(order, course, model, flow, scene, slot);
    const vg_light* light = closed_light(order, model, flow, slot, 0.0f);
    if (light != NULL) {
        course->red = light->line;
        course->red_opens = opens_in(light, flow);
    }
    const int32_t id = scene->vehicles[model->input_index[slot]].id;
    const int64_t since = find_sign(course, model, flow, slot, vg_turn_of(turns, id));
    if (course->sign >= VG_FAR_AWAY) {
        return;
    }
    course->stopped = turns == NULL ? 0
                                    : stopped_since(model, flow, slot, course, scene->utime, since);
    const bool seems = turns == NULL && flow->v[slot] < seems_stopped
                       && gap_to(model, slot, course->sign, 0.0f) < at_sign;
    const bool stopped =
        seems || (course->stopped != 0
                  && vg_seconds_between(course->stopped, scene->utime) >= stop_lasts);
    order->signs |= stopped ? 0 : (uint64_t)1 << slot;
}

void vg_order_note_stops(const vg_model* model, vg_flow* flow)
{
    const vg_order* order = model->order;
    for (uint64_t set = order != NULL && order->slots > 0 ? order->signs : 0; set != 0;
         set &= set - 1u) {
        const uint32_t slot = (uint32_t)__builtin_ctzll(set);
        const float r = vg_order_position(model, flow, slot);
        const bool stops = r > -VG_FAR_AWAY
                           && stands_at(model, flow, slot, order->courses[slot].sign, r);
        flow->stopped |= stops ? (uint64_t)1 << slot : 0;
    }
}

bool vg_order_stops_first(const vg_order* order, const vg_flow* flow, uint32_t slot)
{
    return ((order->signs & ~flow->stopped) >> slot & 1u) != 0;
}

bool vg_order_stops_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_order* order = model->order;
    if (order == NULL || order->slots == 0
        || (order->courses[slot].light_count == 0 && order->courses[slot].sign >= VG_FAR_AWAY)) {
        return false;
    }
    const float r = vg_order_position(model, flow, slot);
    vg_wall wall = { VG_FAR_AWAY, VERGE_WHY_NONE, -1, -1, VG_FAR_AWAY };
    if (r > -VG_FAR_AWAY) {
        vg_order_stop_wall(model, flow, slot, r, true, &wall);
    }
    const float gap = vg_maxf(wall.distance - model->half_length[slot], 0.0f);
    return wall.why != VERGE_WHY_NONE && wall.opens * flow->v[slot] > gap;
}

float vg_order_to_red(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_order* order = model->order;
    const float horizon = (float)model->def->step_s * (float)model->def->steps;
    if (order == NULL || order->slots == 0 || order->courses[slot].red >= VG_FAR_AWAY
        || order->courses[slot].red_opens < horizon) {
        return 0.0f;
    }
    const float r = vg_order_position(model, flow, slot);
    const float gap = gap_to(model, slot, order->courses[slot].red, r);
    return r > -VG_FAR_AWAY ? vg_maxf(gap, 0.0f) : 0.0f;
}

void vg_order_stop_wall(const vg_model* model, const vg_flow* flow, uint32_t slot, float r,
                        bool signals, vg_wall* wall)
{
    const vg_order* order = model->order;
    const vg_course* course = &order->courses[slot];
    const vg_light* light = signals ? closed_light(order, model, flow, slot, r) : NULL;
    if (light != NULL && light->wait - r < wall->distance) {
        *wall = (vg_wall){ light->wait - r, VERGE_WHY_SIGNAL, -1, light->lane,
                           opens_in(light, flow) };
    }
    if (course->sign >= VG_FAR_AWAY || gap_to(model, slot, course->sign, r) < -over_sign) {
        return;
    }
    const float line = course->sign - r;
    if (vg_order_stops_first(order, flow, slot)) {
        if (line < wall->distance) {
            *wall = (vg_wall){ line, VERGE_WHY_STOP_LINE, -1, course->sign_lane, VG_FAR_AWAY };
        }
    } else if (line < wall->distance && wall->distance < line + sign_reach) {
        wall->distance = line;
    }
}
