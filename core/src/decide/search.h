/// The joint search: Monte-Carlo tree search over metanodes (section 3.1 of the paper).
///
/// A metanode is the whole flow at one decision step; an edge is one action for every planned
/// vehicle. Nodes come from a pool of fixed size; the joint actions of a node are numbered in
/// mixed radix over each vehicle's legal set and walked in a permuted order, so the product is
/// never materialised. Joint actions with a conflict are skipped before expansion.
///
/// Two modes. PAPER: UCT (Eq. 1), the root moves to its best child step by step, the budget is
/// split over the steps as 1/(t/2 + 1), the plan is the greedy child of each layer. BEST: a fifth
/// of the budget as in PAPER, the rest polishes the best complete plan seen, one or two vehicles
/// at a time, those first that do not arrive yet. All vehicles share one reward and the model is
/// deterministic, so the best plan ever simulated is returned: in random scenes this gains 0.02 to
/// 0.04 of reward over the greedy path through the same tree. The last cycle's plan takes part.
#ifndef VG_SEARCH_H
#define VG_SEARCH_H

#include "base/random.h"
#include "traffic/flow.h"
#include "verge/decision.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A joint action sequence.
typedef struct vg_joint_actions {
    uint32_t step_count;
    uint8_t  actions[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX];
} vg_joint_actions;

typedef struct vg_tree vg_tree;

/// Takes a tree from the arena: def->nodes_max nodes of def->vehicles_max vehicles.
vg_tree* vg_tree_take(vg_arena* arena, const verge_planner_def* def);
/// Bytes a node takes with these counts.
uint32_t vg_node_size(uint32_t vehicle_count, uint32_t controlled_count);

/// warm: actions to start from (their reward is computed anew), or null. line: def->steps steps as the
/// vehicles drive them.
void vg_search_run(vg_tree* tree, const vg_model* model, const vg_flow* root, vg_random* random,
                   const vg_joint_actions* warm, vg_joint_actions* line, verge_search_report* report);

#ifdef __cplusplus
}
#endif

#endif
