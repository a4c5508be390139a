/// The state of one search, and its simulations. Tree search and polishing share them.
#ifndef VG_PLAYOUT_H
#define VG_PLAYOUT_H

#include "decide/search.h"
#include "decide/tree.h"
#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The state of one search.
typedef struct vg_search {
    vg_tree*        tree;   ///< null: POLICY
    const vg_model* model;
    vg_random*      random; ///< null: POLICY
    const vg_flow*  root;
    vg_flow*        flow; ///< the simulation's state
    vg_flow*        next; ///< the state after the present step
    vg_moves        moves;
    vg_joint_actions sequence; ///< actions of the present simulation
    vg_joint_actions best;     ///< actions of the best plan so far
    double          best_reward;
    double          conflict_cost; ///< [1] of conflicts that remain in the present simulation
    uint32_t conflicts, best_conflicts; ///< slots (bits) in them, and in those of the best plan
    uint32_t        unreached; ///< slots (bits) not in their target lane with the best plan
    uint32_t        trail;     ///< 0 or 1: the trail that holds the states of the best plan
    int8_t          turn[VERGE_CONTROLLED_MAX]; ///< at the root: +1 the target lies left, -1 right
    verge_search_report* report;
} vg_search;

/// Draws actions uniformly from the legal set of each vehicle, for the slots `which` (bits).
void vg_playout_draw(vg_search* self, uint8_t* actions, uint32_t which);
/// Draws again for vehicles in conflict, a few times. False: a conflict remains.
bool vg_playout_repair(vg_search* self, uint8_t* actions);
/// Moves the flow by one step with these actions and appends them to the sequence.
void vg_playout_step(vg_search* self, const uint8_t* actions);
/// True at the horizon or in a terminal flow.
bool vg_playout_over(const vg_search* self);
/// Ends a simulation and returns its reward. A plan better than all before becomes the best plan.
/// whole: see vg_flow_reward().
double vg_playout_finish(vg_search* self, bool whole);
/// Simulates one step with the legal actions nearest to the wanted ones. False: no joint action
/// without conflict was found.
bool vg_playout_follow(vg_search* self, const vg_joint_actions* wanted);
/// best_reward before any complete plan was simulated.
#define VG_NO_PLAN (-1e9)
/// An entry of a sequence that stands for the action of vg_drive_policy(). BEST alone.
enum { VG_POLICY = VERGE_ACTION_COUNT };
/// The wanted action if it is legal, else the first legal one of KS, DC, AC.
uint8_t vg_playout_nearest_legal(vg_search* self, uint32_t slot, uint8_t wanted);
/// The wanted action of a slot in one step; KS beyond the end of the sequence.
uint8_t vg_wanted_action(const vg_joint_actions* wanted, uint32_t step_index, uint32_t slot);
/// Number of actions in a set.
uint32_t vg_set_size(uint8_t set);
/// Member number `index` of a set of actions, counted from the lowest bit.
uint8_t vg_set_member(uint8_t set, uint32_t index);

/// Searches the tree with this budget of simulations (tree.c).
void vg_search_tree(vg_search* self, uint32_t budget);
/// Improves the best plan by variations of one or two vehicles, with this budget of simulations
/// (polish.c).
void vg_search_polish(vg_search* self, uint32_t budget);
/// The start of it without a budget: the policies of all vehicles, and fixed variations of those
/// that do not reach their target lane or are in a conflict (polish.c).
void vg_search_policy(vg_search* self);
/// Simulates a whole plan (polish.c): before step `from` the actions of the best plan, whose states
/// are stored, then the wanted ones. Returns its reward.
double vg_search_try(vg_search* self, uint32_t from, const vg_joint_actions* wanted);

#ifdef __cplusplus
}
#endif

#endif
