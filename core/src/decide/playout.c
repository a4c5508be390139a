/// See playout.h.
#include "decide/playout.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/advance.h"
#include "traffic/conflict.h"
#include "traffic/drive.h"
#include "traffic/reward.h"

#include <string.h>

// BEST: cost of a vehicle in a conflict that remains, in one step. [1] of X_flow
static const double conflict_cost = 0.25;
enum { repair_tries_max = 4 }; // new draws for vehicles in conflict, per step of a simulation

// A table, because not every machine has an instruction that counts bits.
uint32_t vg_set_size(uint8_t set)
{
    static const uint8_t sizes[16] = { 0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4 };
    return (uint32_t)sizes[set & 15u] + sizes[set >> 4];
}
static_assert(VERGE_ACTION_COUNT <= 8, "sets of actions are bytes");

uint8_t vg_set_member(uint8_t set, uint32_t index)
{
    VERGE_ASSERT(index < vg_set_size(set));
    for (; index > 0; --index) {
        set = (uint8_t)(set & (set - 1u));
    }
    return (uint8_t)__builtin_ctz(set);
}

// Is the action legal? Checks the neighbouring lane if that has not been done yet.
static bool is_legal(vg_search* self, uint32_t slot, uint8_t action)
{
    return ((self->moves.legal[slot] >> action) & 1u) != 0
           || (((self->moves.unchecked[slot] >> action) & 1u) != 0
               && vg_flow_check_change(self->model, self->flow, &self->moves, slot, action));
}

// Uniform over the legal set: an action that turns out to be illegal is drawn again.
void vg_playout_draw(vg_search* self, uint8_t* actions, uint32_t which)
{
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        for (uint32_t tries = 0; ((which >> i) & 1u) != 0 && tries <= VERGE_ACTION_COUNT; ++tries) {
            const uint8_t set = self->moves.legal[i] | self->moves.unchecked[i];
            actions[i] = vg_set_member(set, vg_random_below(self->random, vg_set_size(set)));
            if (is_legal(self, i, actions[i])) {
                break;
            }
        }
    }
}

// First those that change lane wait, in POLICY all; then all brake. Physics has no better answer.
static void give_way(vg_search* self, uint8_t* actions, uint32_t conflicts, bool brake)
{
    const bool all = brake || self->random == NULL;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        if ((conflicts >> i & 1u) != 0 && (all || vg_action_changes_lane(actions[i]))) {
            const uint8_t legal = self->moves.legal[i];
            const bool slows = (legal & 1u << VERGE_DECELERATE) != 0;
            actions[i] = slows && (brake || (legal & 1u << VERGE_KEEP_SPEED) == 0)
                             ? VERGE_DECELERATE : VERGE_KEEP_SPEED;
        }
    }
}

// BEST and POLICY: conflicts that remain are paid for, the sooner the more.
static bool repair_best(vg_search* self, uint8_t* actions)
{
    const uint32_t tries_max = self->random != NULL ? repair_tries_max : 2u;
    uint32_t conflicts = 0;
    for (uint32_t tries = 0; tries < tries_max; ++tries) {
        conflicts = vg_flow_conflicts(self->model, self->flow, &self->moves, actions);
        if (conflicts == 0) {
            return true;
        }
        if (tries < 2u) {
            give_way(self, actions, conflicts, tries == 1u);
        } else {
            vg_playout_draw(self, actions, conflicts);
        }
    }
    conflicts = vg_flow_conflicts(self->model, self->flow, &self->moves, actions);
    const double later = (double)self->sequence.step_count / (double)self->model->def->steps;
    self->conflicts |= conflicts;
    self->conflict_cost += conflict_cost * (double)vg_bits(conflicts) * (1.5 - later);
    return true;
}

bool vg_playout_repair(vg_search* self, uint8_t* actions)
{
    if (self->model->best) {
        return repair_best(self, actions);
    }
    for (uint32_t tries = 0; tries < repair_tries_max; ++tries) {
        const uint32_t conflicts =
            vg_flow_conflicts(self->model, self->flow, &self->moves, actions);
        if (conflicts == 0) {
            return true;
        }
        vg_playout_draw(self, actions, conflicts);
    }
    return vg_flow_conflicts(self->model, self->flow, &self->moves, actions) == 0;
}

void vg_playout_step(vg_search* self, const uint8_t* actions)
{
    VERGE_ASSERT(self->sequence.step_count < VERGE_STEPS_MAX);
    memcpy(self->sequence.actions[self->sequence.step_count++], actions,
           self->model->controlled_count);
    vg_flow_advance(self->model, self->flow, &self->moves, actions, self->next);
    vg_flow* after = self->next;
    self->next = self->flow;
    self->flow = after;
}

bool vg_playout_over(const vg_search* self)
{
    return self->sequence.step_count >= self->model->def->steps
           || vg_flow_terminal(self->model, self->flow);
}

static uint32_t unreached(const vg_search* self)
{
    uint32_t set = 0;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const bool reached =
            self->model->target[i] < 0 || vg_flow_in_target(self->model, self->flow, i);
        set |= reached ? 0u : 1u << i;
    }
    return set;
}

double vg_playout_finish(vg_search* self, bool whole)
{
    const double reward =
        vg_flow_reward(self->model, self->flow, self->sequence.step_count, whole)
        - self->conflict_cost;
    self->report->iterations++;
    if (whole && reward > self->best_reward) {
        self->best = self->sequence;
        self->best_reward = reward;
        self->best_conflicts = self->conflicts;
        self->unreached = unreached(self);
        self->report->nodes_first = self->report->nodes;
    }
    self->conflict_cost = 0.0;
    self->conflicts = 0;
    return reward;
}

uint8_t vg_playout_nearest_legal(vg_search* self, uint32_t slot, uint8_t wanted)
{
    if (wanted == VG_POLICY) {
        return vg_drive_policy(self->model, self->flow, &self->moves, slot);
    }
    const uint8_t order[] = { wanted, VERGE_KEEP_SPEED, VERGE_DECELERATE, VERGE_ACCELERATE };
    for (uint32_t k = 0; k < sizeof order; ++k) {
        if (is_legal(self, slot, order[k])) {
            return order[k];
        }
    }
    return VERGE_KEEP_SPEED; // not reached: one lane-keeping action is always legal
}

uint8_t vg_wanted_action(const vg_joint_actions* wanted, uint32_t step_index, uint32_t slot)
{
    return step_index < wanted->step_count ? wanted->actions[step_index][slot]
                                         : (uint8_t)VERGE_KEEP_SPEED;
}

bool vg_playout_follow(vg_search* self, const vg_joint_actions* wanted)
{
    uint8_t actions[VERGE_CONTROLLED_MAX];
    vg_flow_moves_unchecked(self->model, self->flow, &self->moves);
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        actions[i] = vg_playout_nearest_legal(
            self, i, vg_wanted_action(wanted, self->sequence.step_count, i));
    }
    if (!vg_playout_repair(self, actions)) {
        return false;
    }
    vg_playout_step(self, actions);
    return true;
}
