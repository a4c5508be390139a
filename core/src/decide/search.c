/// See search.h: the budget, the warm start, and the answer.
#include "decide/search.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "decide/bound.h"
#include "decide/playout.h"
#include "decide/tree.h"
#include "traffic/reward.h"

#include <string.h>

// In BEST the tree search uses 1 / tree_part of the budget, and polishing the rest. Measured on
// random freeway scenes with 3,000 iterations: shares from 0 to 1/2.
enum { tree_part = 5 };

static void   search(vg_search* self, uint32_t budget);
static void   replay(vg_search* self, const vg_joint_actions* sequence);
static double switched_share(const vg_search* self, const vg_joint_actions* kept);

void vg_search_run(vg_tree* tree, const vg_model* model, vg_flow flows[3], vg_random* random,
                   const vg_joint_actions* warm, vg_joint_actions* sequence,
                   verge_search_report* report)
{
    VERGE_ASSERT(model->controlled_count > 0 && vg_flow_holds(model, &flows[0]));
    memset(report, 0, sizeof *report);
    vg_search self = { .tree = tree, .model = model, .root = &flows[0], .flow = &flows[1],
                       .next = &flows[2], .best_reward = VG_NO_PLAN, .report = report };
    flows[1] = flows[2] = flows[0];
    memset(&self.moves, 0, sizeof self.moves);
    if (model->def->search != VERGE_SEARCH_POLICY) {
        self.random = random;
        vg_tree_empty(tree, model->count, model->controlled_count);
        (void)vg_tree_add(&self, VG_NO_NODE, NULL, self.root);
    }
    double warm_reward = VG_NO_PLAN;
    uint32_t warm_conflicts = 0;
    vg_joint_actions kept = { .step_count = 0 };
    if (model->best && warm != NULL) {
        (void)vg_search_try(&self, 0, warm);
        warm_reward = self.best_reward;
        warm_conflicts = self.best_conflicts;
        kept = self.best;
    }
    search(&self, model->def->iterations);
    const double margin = model->def->switch_margin;
    if (warm_reward > VG_NO_PLAN
        && self.best_reward < warm_reward + margin * switched_share(&self, &kept)) {
        self.best = kept;
        self.best_reward = warm_reward;
        self.best_conflicts = warm_conflicts;
    }
    replay(&self, &self.best);
    *sequence = self.sequence;
    report->conflicts = model->best ? vg_bits(self.best_conflicts)
                        : self.best_reward > VG_NO_PLAN ? 0u : model->controlled_count;
    report->bound = vg_flow_bound(model, self.root);
}

static void search(vg_search* self, uint32_t budget)
{
    const uint32_t used = self->report->iterations;
    const uint32_t left = used < budget ? budget - used : 0;
    switch ((verge_search)self->model->def->search) {
    case VERGE_SEARCH_PAPER: vg_search_tree(self, left); break;
    case VERGE_SEARCH_POLICY: vg_search_policy(self); break;
    case VERGE_SEARCH_BEST:
        vg_search_tree(self, left / tree_part);
        vg_search_polish(self, left - left / tree_part);
        break;
    }
}

// The lane changes of one vehicle in their order, two bits each, and the step of the first one.
typedef struct change_list {
    uint32_t changes, first;
} change_list;

static change_list changes_of(const vg_search* self, const vg_joint_actions* plan, uint32_t slot)
{
    const uint32_t steps = self->model->def->steps;
    change_list list = { 0, steps };
    for (uint32_t t = 0; t < steps; ++t) {
        const uint32_t across = vg_actions[vg_wanted_action(plan, t, slot)].across;
        if (across != VG_KEEP_LANE) {
            list.first = list.changes == 0 ? t : list.first;
            if ((list.changes & 3u) != across) {
                list.changes = list.changes << 2u | across;
            }
        }
    }
    return list;
}

// Share of X_flow that belongs to vehicles whose lane changes differ from those of the plan kept,
// or begin later. Differences of speed do not count, nor does an earlier begin. [1]
static double switched_share(const vg_search* self, const vg_joint_actions* kept)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const change_list before = changes_of(self, kept, i);
        const change_list now = changes_of(self, &self->best, i);
        const bool same = now.changes == before.changes && now.first <= before.first;
        sum += same ? 0.0 : (double)self->model->weight[i];
    }
    return sum;
}

// Simulates the plan step by step to the horizon. A sequence that ends early continues with KS.
static void replay(vg_search* self, const vg_joint_actions* sequence)
{
    const vg_model* model = self->model;
    *self->flow = *self->root;
    self->sequence.step_count = 0;
    bool ended_early = false;
    for (uint32_t t = 0; t < model->def->steps; ++t) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves(model, self->flow, &self->moves);
        for (uint32_t i = 0; i < model->controlled_count; ++i) {
            actions[i] = vg_playout_nearest_legal(self, i, vg_wanted_action(sequence, t, i));
        }
        if (!ended_early && vg_flow_terminal(model, self->flow)) {
            ended_early = true;
            self->report->reward = vg_flow_reward(model, self->flow, t, true);
        }
        vg_playout_step(self, actions);
    }
    // If every simulation ended in a conflict, so does the plan returned: its remaining steps earn
    // nothing.
    const bool whole = self->best_reward > VG_NO_PLAN;
    if (model->best) { // conflicts that remain count
        self->report->reward = vg_clamp(self->best_reward, 0.0, 1.0);
        ended_early = true;
    }
    if (!ended_early) {
        self->report->reward = vg_flow_reward(model, self->flow, self->sequence.step_count, whole);
    }
    self->report->complete = whole;
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        self->report->complete = self->report->complete
                                 && (model->target[i] < 0
                                     || vg_flow_in_target(model, self->flow, i));
    }
}
