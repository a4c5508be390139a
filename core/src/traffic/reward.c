/// See reward.h.
#include "traffic/reward.h"

#include "base/contract.h"
#include "base/scalar.h"

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
    if (row->along != 0 || row->across == 0 || d > VG_CENTRED || d < -VG_CENTRED) {
        return 0.0f;
    }
    const float gap = moves->change_gap[row->across - 1u][slot];
    const float wanted =
        vg_minf(model->change_gap_wanted, 2.0f * vg_low_speed_gap(model, before->v[slot]));
    return gap < wanted ? 1.0f - gap / wanted : 0.0f;
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
        earn(model, before, moves, next, slot, actions[slot]);
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
