/// Improves the best complete plan seen: variations of one or two vehicles' actions, each simulated
/// from the first step that differs.
#include "decide/playout.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <string.h>

// A whole plan: up to step `from` the best one's, whose states are at hand, then the wanted's.
double vg_search_try(vg_search* self, uint32_t from, const vg_joint_actions* wanted)
{
    const uint32_t own = 1u - self->trail;
    const double before = self->best_reward;
    vg_tree_load(self, from == 0 ? 0u : vg_tree_trail(self, self->trail, from), self->flow);
    self->line = self->best;
    self->line.step_count = from;
    while (!vg_playout_over(self)) {
        if (!vg_playout_follow(self, wanted)) {
            return vg_playout_finish(self, false);
        }
        vg_tree_save(self, vg_tree_trail(self, own, self->line.step_count), self->flow);
    }
    const double reward = vg_playout_finish(self, true);
    if (self->best_reward > before) { // the new best: its trail begins as the old one's did
        const size_t stride = self->tree->stride;
        memcpy(self->tree->states + vg_tree_trail(self, own, 0) * stride,
               self->tree->states + vg_tree_trail(self, self->trail, 0) * stride,
               (size_t)(from + 1u) * stride);
        self->trail = own;
    }
    return reward;
}

// Puts the states along the best plan, found in the tree, on its trail.
static void retrace(vg_search* self)
{
    vg_tree_load(self, 0, self->flow);
    self->line.step_count = 0;
    while (self->line.step_count < self->best.step_count && vg_playout_follow(self, &self->best)) {
        vg_tree_save(self, vg_tree_trail(self, self->trail, self->line.step_count), self->flow);
    }
    self->best.step_count = self->line.step_count;
}

// One vehicle does one thing over one stretch of steps. Returns the first step.
static uint32_t vary_run(vg_search* self, vg_joint_actions* line, uint32_t slot)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t from = vg_random_below(self->random, steps);
    const uint32_t length = 1u + vg_random_below(self->random, steps - from);
    const uint8_t action = (uint8_t)vg_random_below(self->random, VERGE_ACTION_COUNT);
    for (uint32_t t = from; t < from + length; ++t) {
        line->actions[t][slot] = action;
    }
    return from;
}

// One vehicle changes lane at some step, after a run of one thing and before another.
static uint32_t vary_change(vg_search* self, vg_joint_actions* line, uint32_t slot)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t at = vg_random_below(self->random, steps - 1u);
    const uint32_t from = at > 0 ? vg_random_below(self->random, at) : 0u;
    const uint8_t before = vg_lane_keeping[vg_random_below(self->random, VG_LANE_KEEPING_COUNT)];
    const uint8_t after = vg_lane_keeping[vg_random_below(self->random, VG_LANE_KEEPING_COUNT)];
    const uint8_t change = self->turn[slot] > 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
    for (uint32_t t = from; t < steps; ++t) {
        line->actions[t][slot] = t < at ? before : t < at + 2u ? change : after;
    }
    return from;
}

static uint32_t fewer(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

// Half of the time one of those that do not arrive yet, else anyone.
static uint32_t pick_vehicle(vg_search* self)
{
    if (self->missing == 0 || vg_random_below(self->random, 2) == 0) {
        return vg_random_below(self->random, self->model->controlled_count);
    }
    uint32_t set = self->missing;
    for (uint32_t k = vg_random_below(self->random, vg_bits(set)); k > 0; --k) {
        set &= set - 1u;
    }
    return (uint32_t)__builtin_ctz(set);
}

// A random variation; a quarter of them let a second vehicle make way. Returns the first step.
static uint32_t mutate(vg_search* self, vg_joint_actions* line)
{
    const uint32_t count = self->model->controlled_count;
    const uint32_t slot = pick_vehicle(self);
    const uint32_t kind = vg_random_below(self->random, 8);
    if (kind < 4u || self->turn[slot] == 0) {
        return vary_run(self, line, slot);
    }
    uint32_t from = vary_change(self, line, slot);
    if (kind >= 6u && count > 1u) {
        const uint32_t other = (slot + 1u + vg_random_below(self->random, count - 1u)) % count;
        from = fewer(from, vary_run(self, line, other));
    }
    return from;
}

// The k-th of the plain variations: one vehicle does one thing from a step on to the end.
static uint32_t vary(const vg_search* self, uint32_t k, vg_joint_actions* line)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t action = k % VERGE_ACTION_COUNT;
    const uint32_t from = k / VERGE_ACTION_COUNT % steps;
    const uint32_t slot = k / VERGE_ACTION_COUNT / steps;
    for (uint32_t t = from; t < steps; ++t) {
        line->actions[t][slot] = (uint8_t)action;
    }
    return from;
}

static void find_turns(vg_search* self)
{
    const verge_road* road = self->model->road;
    vg_tree_load(self, 0, self->flow);
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const int32_t target = self->model->target[i];
        const uint32_t lane = (uint32_t)self->flow->lane[i];
        self->turn[i] = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    }
}

// First all plain variations, as far as a third of the budget reaches, then random ones.
void vg_search_polish(vg_search* self, uint32_t budget)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t plain =
        fewer(budget / 3u, self->model->controlled_count * steps * VERGE_ACTION_COUNT);
    find_turns(self);
    retrace(self);
    for (uint32_t k = 0; k < budget; ++k) {
        vg_joint_actions line = self->best;
        for (uint32_t t = line.step_count; t < steps; ++t) {
            memset(line.actions[t], VERGE_KEEP_SPEED, sizeof line.actions[t]);
        }
        line.step_count = steps;
        uint32_t from = k < plain ? vary(self, k, &line) : mutate(self, &line);
        if (k >= plain && k % 4u == 3u) {
            from = fewer(from, mutate(self, &line));
        }
        (void)vg_search_try(self, fewer(from, self->best.step_count), &line);
    }
}
