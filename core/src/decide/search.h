/// The joint search: Monte-Carlo tree search over metanodes (section 3.1 of the paper).
///
/// A metanode is the whole flow at one decision step. An edge is one joint action: one action for
/// every controlled vehicle. Nodes come from a pool of fixed size. The joint actions of a node are
/// numbered in mixed radix over the legal sets of the vehicles and visited in a permuted order, so
/// they are never stored. Joint actions with a conflict are skipped before expansion.
///
/// Three modes:
/// PAPER  UCT (Eq. 1). The root moves to its best child step by step. The budget is split over the
///        steps as 1/(t/2 + 1). The plan is the greedy child of each layer.
/// BEST   A fifth of the budget is used as in PAPER. The rest polishes the best complete plan found
///        so far: it varies one or two vehicles at a time, more often those that do not reach their
///        target lane yet. All vehicles share one reward and the model is deterministic, so the
///        best plan that was simulated is returned. In random scenes this gains 0.02 to 0.04 of
///        reward over the greedy path through the same tree. The plan of the last cycle is
///        simulated too.
///
/// POLICY No tree, no budget, nothing random: the plan of the last cycle is simulated, and the one
///        in which each vehicle follows its policy (vg_drive_policy()). In a step with a conflict
///        the vehicles in it keep their speed and lane instead, or brake. A vehicle that does not
///        reach its target lane, or is in a conflict all the same, tries a fixed list of
///        variations: it waits, accelerates or changes lane first. The best plan is returned.
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

/// Takes memory for a tree: def->nodes_max nodes of def->vehicles_max vehicles. Null: it does not
/// fit, or the arena is measuring.
vg_tree* vg_tree_take(vg_arena* arena, const verge_planner_def* def);
/// Size of a node with these counts, with its state [B].
uint32_t vg_node_size(uint32_t vehicle_count, uint32_t controlled_count);

/// Searches from the state flows[0]; the other two are overwritten. tree, random: POLICY ignores
/// them. warm: actions of the warm start (their reward is computed again), or null. sequence: the
/// result, def->steps joint actions, all legal.
void vg_search_run(vg_tree* tree, const vg_model* model, vg_flow flows[3], vg_random* random,
                   const vg_joint_actions* warm, vg_joint_actions* sequence,
                   verge_search_report* report);

#ifdef __cplusplus
}
#endif

#endif
