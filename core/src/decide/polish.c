/// Improves the best complete plan found so far. Each variation changes the actions of one or two
/// vehicles and is simulated from the first step that differs.
#include "decide/playout.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <string.h>

double vg_search_try(vg_search* self, uint32_t from, const vg_joint_actions* wanted)
{
    const uint32_t own = 1u - self->trail;
    const double before = self->best_reward;
    if (from == 0) {
        *self->flow = *self->root;
    } else {
        vg_tree_load(self, vg_tree_trail(self, self->trail, from), self->flow);
    }
    self->sequence = self->best;
    self->sequence.step_count = from;
    while (!vg_playout_over(self)) {
        if (!vg_playout_follow(self, wanted)) {
            return vg_playout_finish(self, false);
        }
        if (self->tree != NULL) {
            vg_tree_save(self, vg_tree_trail(self, own, self->sequence.step_count), self->flow);
        }
    }
    const double reward = vg_playout_finish(self, true);
    if (self->tree != NULL && self->best_reward > before) {
        // A new best plan: copy the states before `from` to its trail.
        const size_t stride = self->tree->stride;
        memcpy(self->tree->states + vg_tree_trail(self, own, 0) * stride,
               self->tree->states + vg_tree_trail(self, self->trail, 0) * stride,
               (size_t)(from + 1u) * stride);
        self->trail = own;
    }
    return reward;
}

// Stores the states along the best plan, which the tree search found, in its trail.
static void store_states(vg_search* self)
{
    *self->flow = *self->root;
    self->sequence.step_count = 0;
    while (self->sequence.step_count < self->best.step_count
           && vg_playout_follow(self, &self->best)) {
        vg_tree_save(self, vg_tree_trail(self, self->trail, self->sequence.step_count), self->flow);
    }
    self->best.step_count = self->sequence.step_count;
}

// One vehicle takes one action for a random interval of steps. Returns the first step.
static uint32_t vary_run(vg_search* self, vg_joint_actions* sequence, uint32_t slot)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t from = vg_random_below(self->random, steps);
    const uint32_t length = 1u + vg_random_below(self->random, steps - from);
    const uint8_t action = (uint8_t)vg_random_below(self->random, VERGE_ACTION_COUNT);
    for (uint32_t t = from; t < from + length; ++t) {
        sequence->actions[t][slot] = action;
    }
    return from;
}

// One vehicle takes one action, then changes lane at a random step, then takes another action.
// Returns the first step.
static uint32_t vary_lane_change(vg_search* self, vg_joint_actions* sequence, uint32_t slot)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t at = vg_random_below(self->random, steps - 1u);
    const uint32_t from = at > 0 ? vg_random_below(self->random, at) : 0u;
    const uint8_t before = vg_lane_keeping[vg_random_below(self->random, VG_LANE_KEEPING_COUNT)];
    const uint8_t after = vg_lane_keeping[vg_random_below(self->random, VG_LANE_KEEPING_COUNT)];
    const uint8_t change = self->turn[slot] > 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
    // The second bound is for the compiler, which cannot know that steps is no more.
    for (uint32_t t = from; t < steps && t < VERGE_STEPS_MAX; ++t) {
        sequence->actions[t][slot] = t < at ? before : t < at + 2u ? change : after;
    }
    return from;
}

static uint32_t smaller(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

// With probability 1/2 a vehicle that does not reach its target lane yet, else any vehicle.
static uint32_t pick_vehicle(vg_search* self)
{
    if (self->unreached == 0 || vg_random_below(self->random, 2) == 0) {
        return vg_random_below(self->random, self->model->controlled_count);
    }
    uint32_t set = self->unreached;
    for (uint32_t k = vg_random_below(self->random, vg_bits(set)); k > 0; --k) {
        set &= set - 1u;
    }
    return (uint32_t)__builtin_ctz(set);
}

// A random variation. In a quarter of them a second vehicle changes its actions as well, so that it
// can yield. Returns the first step.
static uint32_t vary_randomly(vg_search* self, vg_joint_actions* sequence)
{
    const uint32_t count = self->model->controlled_count;
    const uint32_t slot = pick_vehicle(self);
    const uint32_t kind = vg_random_below(self->random, 8);
    if (kind < 4u || self->turn[slot] == 0) {
        return vary_run(self, sequence, slot);
    }
    uint32_t from = vary_lane_change(self, sequence, slot);
    if (kind >= 6u && count > 1u) {
        const uint32_t other = (slot + 1u + vg_random_below(self->random, count - 1u)) % count;
        from = smaller(from, vary_run(self, sequence, other));
    }
    return from;
}

// One vehicle keeps one action of the lane for some steps, or changes lane at some step; after that
// it follows its policy. So a change is made at the first instant at which it is legal.
typedef struct code {
    uint8_t steps;  // with `first`
    uint8_t first;  // action, or VG_POLICY
    uint8_t change; // action of the two steps after these, VG_POLICY: none
} code;

static const code codes[] = {
    { 0, VG_POLICY, VG_POLICY },
    { 1, VERGE_DECELERATE, VG_POLICY }, { 1, VERGE_KEEP_SPEED, VG_POLICY },
    { 2, VERGE_DECELERATE, VG_POLICY }, { 2, VERGE_KEEP_SPEED, VG_POLICY },
    { 3, VERGE_DECELERATE, VG_POLICY }, { 3, VERGE_KEEP_SPEED, VG_POLICY },
    { 5, VERGE_DECELERATE, VG_POLICY }, { 5, VERGE_KEEP_SPEED, VG_POLICY },
    { 2, VERGE_ACCELERATE, VG_POLICY }, { 4, VERGE_ACCELERATE, VG_POLICY },
    { 7, VERGE_ACCELERATE, VG_POLICY }, { 7, VERGE_KEEP_SPEED, VG_POLICY },
    { 0, VG_POLICY, VERGE_CHANGE_LEFT }, { 0, VG_POLICY, VERGE_CHANGE_RIGHT },
    { 1, VG_POLICY, VERGE_CHANGE_LEFT }, { 1, VG_POLICY, VERGE_CHANGE_RIGHT },
    { 2, VG_POLICY, VERGE_CHANGE_LEFT }, { 2, VG_POLICY, VERGE_CHANGE_RIGHT },
    { 1, VERGE_DECELERATE, VERGE_CHANGE_LEFT }, { 1, VERGE_DECELERATE, VERGE_CHANGE_RIGHT },
    { 2, VERGE_DECELERATE, VERGE_CHANGE_LEFT }, { 2, VERGE_DECELERATE, VERGE_CHANGE_RIGHT },
    { 2, VERGE_ACCELERATE, VERGE_CHANGE_LEFT }, { 2, VERGE_ACCELERATE, VERGE_CHANGE_RIGHT },
};
enum { CODE_COUNT = sizeof codes / sizeof codes[0] };

static void write_code(const vg_search* self, vg_joint_actions* sequence, uint32_t slot,
                       const code* with)
{
    const uint32_t steps = self->model->def->steps;
    for (uint32_t t = 0; t < steps && t < VERGE_STEPS_MAX; ++t) {
        const bool changing = with->change != VG_POLICY && t >= with->steps
                              && t < with->steps + 2u;
        sequence->actions[t][slot] = changing ? with->change
                                     : t < with->steps ? with->first : (uint8_t)VG_POLICY;
    }
}

// Variation number k of the sweeps over all codes: of one vehicle at a time. In every second sweep
// the others follow their policies too, so that they can react.
static void vary(const vg_search* self, uint32_t k, vg_joint_actions* sequence)
{
    const uint32_t count = self->model->controlled_count;
    const uint32_t sweep = k / (CODE_COUNT * count);
    const uint32_t slot = k / CODE_COUNT % count;
    if (sweep % 2u == 1u) {
        for (uint32_t t = 0; t < self->model->def->steps; ++t) {
            memset(sequence->actions[t], VG_POLICY, count);
        }
    }
    write_code(self, sequence, slot, &codes[k % CODE_COUNT]);
}

// Two vehicles at once: what one of them gives up another one may need. Every second time all
// others follow their policies.
static void vary_pair(vg_search* self, vg_joint_actions* sequence)
{
    const uint32_t count = self->model->controlled_count;
    const uint32_t slot = pick_vehicle(self);
    const uint32_t other = (slot + 1u + vg_random_below(self->random, count - 1u)) % count;
    if (vg_random_below(self->random, 2) == 0) {
        for (uint32_t t = 0; t < self->model->def->steps; ++t) {
            memset(sequence->actions[t], VG_POLICY, count);
        }
    }
    write_code(self, sequence, slot, &codes[vg_random_below(self->random, CODE_COUNT)]);
    write_code(self, sequence, other, &codes[vg_random_below(self->random, CODE_COUNT)]);
}

// Where a variation ends, the vehicle may follow its policy instead of its actions of before.
static void end_in_policy(vg_search* self, const vg_joint_actions* before, vg_joint_actions* after)
{
    const uint32_t steps = self->model->def->steps;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        uint32_t last = steps;
        for (uint32_t t = 0; t < steps; ++t) {
            last = before->actions[t][i] != after->actions[t][i] ? t : last;
        }
        for (uint32_t t = last + 1u; t < steps; ++t) {
            after->actions[t][i] = VG_POLICY;
        }
    }
}

// The policies of all vehicles. Where a vehicle does not reach its target lane or is in a conflict,
// its codes are tried until it does and is not.
void vg_search_policy(vg_search* self)
{
    vg_joint_actions plan = { .step_count = self->model->def->steps };
    memset(plan.actions, VG_POLICY, sizeof plan.actions);
    (void)vg_search_try(self, 0, &plan);
    for (uint32_t k = 0; k < self->model->controlled_count * CODE_COUNT; ++k) {
        const uint32_t slot = k / CODE_COUNT;
        if (((self->unreached | self->best_conflicts) >> slot & 1u) != 0) {
            plan = self->best;
            write_code(self, &plan, slot, &codes[k % CODE_COUNT]);
            (void)vg_search_try(self, 0, &plan);
        }
    }
}

static void find_turns(vg_search* self)
{
    const verge_road* road = self->model->road;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const int32_t target = self->model->target[i];
        const uint32_t lane = (uint32_t)self->root->lane[i];
        self->turn[i] = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    }
}

// First the best of all policies, then sweeps over the codes, then random variations.
void vg_search_polish(vg_search* self, uint32_t budget)
{
    const uint32_t steps = self->model->def->steps;
    const uint32_t sweeps =
        smaller(budget / 2u, 3u * self->model->controlled_count * (uint32_t)CODE_COUNT);
    find_turns(self);
    store_states(self);
    for (uint32_t k = 0; k < budget; ++k) {
        vg_joint_actions sequence = self->best;
        for (uint32_t t = sequence.step_count; t < steps; ++t) {
            memset(sequence.actions[t], VG_POLICY, sizeof sequence.actions[t]);
        }
        sequence.step_count = steps;
        uint32_t from = 0;
        if (k == 0) {
            memset(sequence.actions, VG_POLICY, sizeof sequence.actions);
        } else if (k < sweeps) {
            vary(self, k, &sequence);
        } else if (k % 4u == 1u && self->model->controlled_count > 1u) {
            vary_pair(self, &sequence);
        } else {
            const vg_joint_actions before = sequence;
            from = vary_randomly(self, &sequence);
            if (k % 4u == 3u) {
                from = smaller(from, vary_randomly(self, &sequence));
            }
            if (k % 2u == 0u) {
                end_in_policy(self, &before, &sequence);
            }
        }
        (void)vg_search_try(self, smaller(from, self->best.step_count), &sequence);
    }
}
