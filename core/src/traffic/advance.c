/// See advance.h.
#include "traffic/advance.h"
#include "base/contract.h"

#include "traffic/goal.h"
#include "traffic/humans.h"
#include "traffic/order.h"
#include "traffic/pairs.h"
#include "traffic/reward.h"

#include <string.h>

// A vehicle changes its lane index when it is nearer to the other lane's centre by this much. [m]
static const float boundary_margin = 0.1f;

static void assign_lane(const vg_model* model, const vg_flow* flow, vg_flow* next, uint32_t slot,
                        uint8_t action);

void vg_flow_advance(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                     const uint8_t* actions, vg_flow* next)
{
    VERGE_ASSERT(flow != next);
    VERGE_ASSERT(vg_flow_holds(model, flow));
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        const uint8_t action = slot < model->controlled_count ? actions[slot] : 0;
        next->station[slot] = moves->station[vg_actions[action].along][slot];
        next->v[slot] = moves->v[vg_actions[action].along][slot];
        next->y[slot] = moves->y[vg_actions[action].across][slot];
        next->lane[slot] = flow->lane[slot];
        next->rate[slot] = flow->rate[slot];
        assign_lane(model, flow, next, slot, action);
    }
    next->t = flow->t + (float)model->def->step_s;
    next->stopped = flow->stopped;
    vg_order_note_stops(model, next);
    vg_flow_earn(model, flow, moves, next, actions);
}

void vg_flow_follow(const vg_model* model, const vg_flow* flow, double dt, vg_flow* next)
{
    VERGE_ASSERT(flow != next && dt > 0.0);
    VERGE_ASSERT(vg_flow_holds(model, flow));
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    memcpy(next, flow, sizeof *next);
    vg_flow_human_moves(model, flow, (float)dt, next->station, next->v, next->y);
    for (uint32_t slot = model->controlled_count; slot < model->count; ++slot) {
        assign_lane(model, flow, next, slot, VERGE_KEEP_SPEED);
    }
    next->t = flow->t + (float)dt;
    vg_order_note_stops(model, next);
}

void vg_flow_pass_ends(const vg_model* model, uint32_t slot, float rate, int32_t* lane,
                       float* station)
{
    const verge_road* road = model->road;
    const int32_t target = slot < model->controlled_count ? model->target[slot] : -1;
    float beyond = (*station - (float)road->lanes[*lane].station_end) * rate; // [m]
    vg_walk walk = vg_walk_from(road, (uint32_t)*lane, target);
    while (beyond > 0.0f && vg_walk_on(&walk)) {
        *lane = (int32_t)walk.lane;
        *station = (float)vg_lane_station(&road->lanes[walk.lane], (double)beyond);
        beyond -= (float)road->lanes[walk.lane].length;
    }
}

// Moves a vehicle that drives backwards before the start of its lane to the lane before.
static void pass_lane_starts(const vg_model* model, vg_flow* next, uint32_t slot)
{
    const verge_road* road = model->road;
    const vg_lane* lane = &road->lanes[next->lane[slot]];
    float beyond = ((float)lane->station_start - next->station[slot]) * next->rate[slot]; // [m]
    int32_t before = vg_lane_before(road, (uint32_t)next->lane[slot]);
    for (uint32_t passed = 0; beyond > 0.0f && before >= 0 && passed < VG_WALK_LANES; ++passed) {
        const vg_lane* on = &road->lanes[before];
        next->lane[slot] = before;
        next->station[slot] = (float)vg_lane_station(on, on->length - (double)beyond);
        beyond -= (float)on->length;
        before = vg_lane_before(road, (uint32_t)before);
    }
}

// Lane and d from station and y. A lane change may end beyond the lane boundary, a long step beyond
// the lane's end. The change of d is the change of y before the lane's own slope is added.
static void assign_lane(const vg_model* model, const vg_flow* flow, vg_flow* next, uint32_t slot,
                        uint8_t action)
{
    const verge_road* road = model->road;
    const vg_lane* lane = &road->lanes[next->lane[slot]];
    const float station = next->station[slot];
    vg_bin_place place = vg_bin_at(lane, station);
    next->d[slot] = flow->d[slot] + (next->y[slot] - flow->y[slot]);
    if (action == VERGE_CHANGE_LEFT || action == VERGE_CHANGE_RIGHT) {
        const int32_t beside = action == VERGE_CHANGE_LEFT ? lane->left : lane->right;
        if (beside >= 0) {
            const vg_bin_place there = vg_bin_at(&road->lanes[beside], station);
            const float other = next->d[slot] + (vg_bin_centre(place) - vg_bin_centre(there));
            // A partial change that ends on the lane boundary stays in its lane.
            if (vg_fabsf(other) < vg_fabsf(next->d[slot]) - boundary_margin) {
                next->lane[slot] = beside;
                next->d[slot] = other;
                lane = &road->lanes[beside];
                place = there;
            }
        }
    }
    if (!model->single_axis && station > (float)lane->station_end) {
        vg_flow_pass_ends(model, slot, next->rate[slot], &next->lane[slot], &next->station[slot]);
        place = vg_bin_at(&road->lanes[next->lane[slot]], next->station[slot]);
    }
    if (!model->single_axis && next->v[slot] < 0.0f && station < (float)lane->station_start) {
        pass_lane_starts(model, next, slot);
        place = vg_bin_at(&road->lanes[next->lane[slot]], next->station[slot]);
    }
    vg_flow_set_road_fields(next, slot, place);
    if (model->body_count > 0 && slot < model->controlled_count) {
        vg_goal_limit(model, next, slot);
    }
}
