/// See reward.h.
#include "traffic/reward.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/drive.h"
#include "traffic/order.h"
#include "traffic/pairs.h"
#include "traffic/value.h"

// BEST. A loss of loss_scale halves the reward for progress. [s]
static const double loss_scale = 30.0;
// Share of reward_room in BEST, where being late costs less than it does in the paper's reward. [1]
static const float room_share = 0.8f;
// A vehicle that waits at red moves up to the line now and not later: cost of the distance to it in
// each step, up to a distance. [1 per m and step], [m]
static const float red_cost = 1e-4f, red_reach = 50.0f;
// Braking harder than this costs reward. [m/s^2], [1 per m/s^2 and step]
static const float harsh_from = 2.0f, harsh_cost = 0.01f;
// Change of speed in one step that counts as a whole reversal. [m/s]
static const float reversal_speed = 4.0f;
// Cost of each second in a lane that does not lead to the target: small where the vehicle leaves
// the target lane to overtake, larger where it is not there yet. [1]
static const float cost_of_leaving = 0.2f, cost_of_missing = 2.2f;
// A vehicle nearer than this to the one ahead follows it. [s]
static const float following_s = 4.0f;
// Between two lanes at the horizon: cost [s], of this offset [m].
static const float between_cost = 1.5f, half_lane = 1.75f;
// Braking that a follower may need, and the largest loss that counts. [m/s^2], [s]
static const float follower_from = 2.0f, follower_most = 5.0f;

// Number of lane changes to the target lane. VG_WAY_CHANGES: it cannot be reached.
VG_INLINE uint32_t changes_left(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_way* ways = model->ways[slot];
    return ways == NULL ? 0u : (uint32_t)(ways[flow->lane[slot]] & VG_WAY_CHANGES);
}

// Value of the vehicle's lane; 0 between lanes. [1] 0 .. 1
static float lane_value(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const uint32_t changes = changes_left(model, flow, slot);
    if (vg_fabsf(flow->d[slot]) > VG_REACHED_OFFSET || changes == VG_WAY_CHANGES) {
        return 0.0f;
    }
    return changes == 0 ? 1.0f : (float)VG_VALUE_ONE_CHANGE / (float)changes;
}

// Speed relative to cruise_share times the speed limit. It falls again above the limit. [1] 0 .. 1
static float speed_share(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const float v = flow->v[slot], limit = flow->limit[slot];
    return v > limit ? limit / v
                     : vg_minf(v, model->cruise_share * limit) / (model->cruise_share * limit);
}

// Penalty for the start of a lane change that leaves a smaller gap than wanted. [1] 0 .. 1
static float gap_penalty(const vg_model* model, const vg_flow* before, const vg_moves* moves,
                         uint32_t slot, uint8_t action)
{
    const float d = before->d[slot];
    const vg_action_row* row = &vg_actions[action];
    if (row->across == VG_KEEP_LANE || d > VG_CENTRED || d < -VG_CENTRED) {
        return 0.0f;
    }
    const float gap = moves->change_gap[row->across - 1u][slot];
    const float wanted =
        vg_minf(model->change_gap_wanted, 2.0f * vg_low_speed_gap(model, before->v[slot]));
    return gap < wanted ? 1.0f - gap / wanted : 0.0f;
}

// BEST. How far an action takes back the one before: braking after speeding up and the reverse, by
// the change of speed; a change back whole. [1] 0 .. 1
static float reversal(uint8_t before, uint8_t action, float change_of_speed)
{
    if ((before == VERGE_CHANGE_LEFT && action == VERGE_CHANGE_RIGHT)
        || (before == VERGE_CHANGE_RIGHT && action == VERGE_CHANGE_LEFT)) {
        return 1.0f;
    }
    return (before == VERGE_ACCELERATE && action == VERGE_DECELERATE)
                   || (before == VERGE_DECELERATE && action == VERGE_ACCELERATE)
               ? vg_minf(vg_fabsf(change_of_speed) / reversal_speed, 1.0f) : 0.0f;
}

// BEST. Does a lane change begin with this action?
static bool begins_change(const vg_flow* before, uint32_t slot, uint8_t action)
{
    const float d = before->d[slot];
    return vg_action_changes_lane(action) && vg_fabsf(d) <= VG_CENTRED;
}

static void earn_best(const vg_model* model, const vg_flow* before, const vg_moves* moves,
                      vg_flow* next, uint32_t slot, uint8_t action)
{
    const verge_planner_def* def = model->def;
    const float share = 1.0f / (float)def->steps;
    const float braking = (before->v[slot] - next->v[slot]) / (float)def->step_s;
    float credit = before->credit[slot];
    credit += (float)def->reward_consistency * share
              * (1.0f - reversal(before->previous[slot], action, next->v[slot] - before->v[slot]));
    float lost = begins_change(before, slot, action) ? VG_VALUE_CHANGE : 0.0f;
    if (changes_left(model, next, slot) > 0) {
        lost += model->wrong_lane[slot] * (float)def->step_s;
    }
    credit -= lost * (float)((def->reward_target + def->reward_lane) / loss_scale);
    const float care = 0.5f + 0.5f * model->gap_weight[slot];
    credit -= room_share * (float)def->reward_room * share * care
              * gap_penalty(model, before, moves, slot, action);
    credit -= harsh_cost * vg_maxf(braking - harsh_from, 0.0f);
    credit -= red_cost * vg_minf(vg_order_to_red(model, next, slot), red_reach);
    next->credit[slot] = credit;
    next->driven[slot] = 0.0f;
    next->previous[slot] = action;
}

// Time lost until the speed `wanted` is reached, by uniform acceleration. Before a line at which
// the vehicle has to stop, the speed that it has is of no use.
static float speed_loss(const vg_model* model, const vg_flow* flow, uint32_t slot, float wanted)
{
    const float missing =
        vg_order_stops_ahead(model, flow, slot) ? wanted : vg_maxf(wanted - flow->v[slot], 0.0f);
    return 0.5f * missing * missing / ((float)model->acceleration[slot] * wanted);
}

// A follower that closes in costs as much as the braking that it needs beyond this. [m/s^2]
static float follower_loss(const vg_neighbours* w, float half, float v)
{
    const float closing = w->v_behind - v;
    if (w->behind < 0 || closing <= 0.0f) {
        return 0.0f;
    }
    const float gap = vg_maxf(w->gap_behind - half, 0.5f);
    return vg_minf(vg_maxf(0.5f * closing * closing / gap - follower_from, 0.0f), follower_most);
}

// A vehicle on its way to its target lane waits for the gap in the lane beside. One that left the
// target lane to overtake passes who is beside. [s]
static float blocked_loss(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const float station = flow->station[slot];
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const int32_t sides[2] = { model->road->lanes[lane].right, model->road->lanes[lane].left };
    float least = vg_value_at(model->value, slot, lane, station);
    const bool missing = model->wrong_lane[slot] > cost_of_leaving;
    int32_t better = -1;
    for (int32_t left = 0; missing && changes_left(model, flow, slot) > 0 && left < 2; ++left) {
        const float time = sides[left] < 0 ? least : vg_value_at(model->value, slot,
                                                                 (uint32_t)sides[left], station);
        better = time < least ? left : better;
        least = vg_minf(least, time);
    }
    return better < 0 ? 0.0f : vg_drive_blocked(model, flow, slot, better == 1);
}

// Time lost behind the vehicles ahead. A planned one is soon as slow as those ahead of it. [s]
static float delay_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot,
                         const vg_neighbours* w)
{
    float delay = vg_drive_delay(model, flow, slot, w), gaps[VERGE_VEHICLES_MAX];
    if (w->ahead < 0 || w->ahead >= (int32_t)model->controlled_count) {
        return delay;
    }
    for (uint64_t set = vg_all_ahead(model, flow, slot, gaps); set != 0; set &= set - 1u) {
        const uint32_t j = (uint32_t)__builtin_ctzll(set);
        const vg_neighbours other = { .gap_ahead = gaps[j], .v_ahead = flow->v[j],
                                      .ahead = (int32_t)j, .behind = -1 };
        delay = vg_maxf(delay, vg_drive_delay(model, flow, slot, &other));
    }
    return delay;
}

float vg_flow_loss(const vg_model* model, const vg_flow* flow, uint32_t slot, float t)
{
    VERGE_ASSERT(slot < model->controlled_count && model->value != NULL);
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const float half = model->half_length[slot];
    const vg_neighbours w = vg_nearest(model, flow, slot, flow->station[slot], flow->y[slot],
                                       flow->station, flow->v, VG_FAR_AWAY);
    // Behind a slower vehicle more speed is of no use.
    const float gap = w.gap_ahead - half;
    const bool follows = w.ahead >= 0 && gap < following_s * flow->v[slot];
    const float desired = vg_drive_desired(model, flow, slot);
    const float wanted = follows ? vg_minf(desired, vg_maxf(w.v_ahead, 1.0f)) : desired;
    const float between = vg_minf(vg_fabsf(flow->d[slot]) / half_lane, 1.0f);
    return t + vg_value_at(model->value, slot, lane, flow->station[slot])
           + speed_loss(model, flow, slot, wanted) + between_cost * between
           + delay_ahead(model, flow, slot, &w) + blocked_loss(model, flow, slot)
           + model->gap_weight[slot] * follower_loss(&w, half, flow->v[slot]);
}

// The least time to go from a station of a lane and of the lanes beside it. [s]
static float least_time(const vg_model* model, uint32_t slot, uint32_t lane, float station)
{
    const verge_road* road = model->road;
    float least = vg_value_at(model->value, slot, lane, station);
    for (uint32_t left = 0; left < 2; ++left) {
        uint32_t tries = 0;
        int32_t beside = left ? road->lanes[lane].left : road->lanes[lane].right;
        while (beside >= 0 && ++tries <= VG_VALUE_LANES) {
            least = vg_minf(least, vg_value_at(model->value, slot, (uint32_t)beside, station));
            beside = left ? road->lanes[beside].left : road->lanes[beside].right;
        }
    }
    return least;
}

void vg_flow_begin(vg_model* model, const vg_flow* root, uint32_t reached)
{
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        model->loss_at_root[slot] =
            least_time(model, slot, (uint32_t)root->lane[slot], root->station[slot])
            + speed_loss(model, root, slot, vg_drive_desired(model, root, slot));
        model->wrong_lane[slot] =
            (reached >> slot & 1u) != 0 ? cost_of_leaving : cost_of_missing;
    }
}

// From the centre of its lane a vehicle is in the next one after two steps of a change; from this
// far on its way after one. [m]
static const float changes_at_once_from = 0.04f;

// Nothing but these costs is certain: a vehicle that has to change lane either does not get there,
// and pays for the wrong lane in every step, or does, and pays for each change and for the steps
// before. 0.04 s are for the rounding of single precision.
double vg_reward_most(const vg_model* model, const vg_flow* root, uint32_t slot)
{
    const verge_planner_def* def = model->def;
    const double most = def->reward_target + def->reward_lane + def->reward_consistency;
    const uint32_t way = changes_left(model, root, slot);
    if (way == 0) {
        return most;
    }
    const double step = (double)model->wrong_lane[slot] * def->step_s;
    const double never = (double)def->steps * step;
    const float d = vg_fabsf(root->d[slot]);
    const double steps_before = (double)way - (d > changes_at_once_from ? 1.0 : 0.0);
    const double changes = (double)way - (d > VG_CENTRED ? 1.0 : 0.0);
    const double there = vg_min(steps_before * step, never) + changes * (double)VG_VALUE_CHANGE;
    const double lost = way == VG_WAY_CHANGES ? never : vg_min(never, there);
    return most - vg_max(lost - 0.04, 0.0) * (def->reward_target + def->reward_lane)
                      / (double)loss_scale;
}

static double reward_best(const vg_model* model, const vg_flow* flow, uint32_t step, bool whole)
{
    const verge_planner_def* def = model->def;
    double sum = 0.0;
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        double reward = (double)flow->credit[i];
        if (whole) {
            const float lost = vg_flow_loss(model, flow, i, (float)step * (float)def->step_s)
                               - model->loss_at_root[i];
            const double share = loss_scale / (loss_scale + (double)vg_maxf(lost, 0.0f));
            reward += (def->reward_target + def->reward_lane) * share;
        }
        sum += (double)model->weight[i] * reward;
    }
    return vg_clamp(sum, 0.0, 1.0);
}

VG_INLINE void earn(const vg_model* model, const vg_flow* before, const vg_moves* moves,
                    vg_flow* next, uint32_t slot, uint8_t action)
{
    const verge_planner_def* def = model->def;
    const float share = 1.0f / (float)def->steps;
    float credit = before->credit[slot];
    float driven = 0.0f;
    credit += (float)def->reward_lane * share * lane_value(model, next, slot)
              * speed_share(model, next, slot);
    if (vg_flow_in_target(model, next, slot)) {
        driven = before->driven[slot] + next->v[slot] * (float)def->step_s;
    }
    if (action == before->previous[slot] || before->previous[slot] == VERGE_ACTION_COUNT) {
        credit += (float)def->reward_consistency * share;
    }
    credit -= (float)def->reward_room * share * model->gap_weight[slot]
              * gap_penalty(model, before, moves, slot, action);
    next->credit[slot] = credit;
    next->driven[slot] = driven;
    next->previous[slot] = action;
}

void vg_flow_earn(const vg_model* model, const vg_flow* before, const vg_moves* moves,
                  vg_flow* next, const uint8_t* actions)
{
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        if (model->best) {
            earn_best(model, before, moves, next, slot, actions[slot]);
        } else {
            earn(model, before, moves, next, slot, actions[slot]);
        }
    }
}

bool vg_flow_in_target(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    VERGE_ASSERT(slot < model->controlled_count);
    const float d = flow->d[slot];
    return changes_left(model, flow, slot) == 0 && d <= VG_REACHED_OFFSET
           && d >= -VG_REACHED_OFFSET;
}

bool vg_flow_terminal(const vg_model* model, const vg_flow* flow)
{
    bool wanted = false;
    if (model->best) { // the time to go counts all the way to the horizon
        return false;
    }
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        if (model->target[i] >= 0 && flow->driven[i] < (float)model->def->target_distance) {
            return false;
        }
        wanted = wanted || model->target[i] >= 0;
    }
    return wanted;
}

// The remaining steps of a terminal flow earn the same as one more step in this state.
double vg_flow_reward(const vg_model* model, const vg_flow* flow, uint32_t step, bool whole)
{
    const verge_planner_def* def = model->def;
    VERGE_ASSERT(step <= def->steps);
    if (model->best) {
        return reward_best(model, flow, step, whole);
    }
    const double rest = (double)(def->steps - step) / (double)def->steps;
    double sum = 0.0;
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        double reward = (double)flow->credit[i];
        if (whole) {
            const double speed = (double)speed_share(model, flow, i);
            reward += (def->reward_target + def->reward_lane * rest * speed)
                          * (double)lane_value(model, flow, i)
                      + def->reward_consistency * rest;
        }
        sum += (double)model->weight[i] * reward;
    }
    return vg_clamp(sum, 0.0, 1.0);
}
