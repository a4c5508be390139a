/// One search's state and its simulations: what tree search and polishing have in common.
#ifndef VG_PLAYOUT_H
#define VG_PLAYOUT_H

#include "decide/search.h"
#include "decide/tree.h"
#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Everything that changes while one search runs.
typedef struct vg_search {
    vg_tree*        tree;
    const vg_model* model;
    vg_random*      random;
    vg_flow         buffer[2];
    vg_flow*        flow; ///< the simulation's state
    vg_flow*        next; ///< the state after the step under way
    vg_moves        moves;
    vg_joint_actions line;  ///< actions of the simulation under way
    vg_joint_actions best;
    double          best_reward;
    uint32_t        missing; ///< controlled slots (bits) that the best plan does not bring to their target
    uint32_t        trail;   ///< 0 or 1: which trail is the best plan's
    int8_t          turn[VERGE_CONTROLLED_MAX]; ///< at the root: +1 the target lies left, -1 right
    verge_search_report* report;
} vg_search;

/// Actions uniform over each vehicle's legal set, for the slots `which` (bits).
void vg_playout_draw(vg_search* self, uint8_t* actions, uint32_t which);
/// Draws again for vehicles in conflict, a few times. False: a conflict is left.
bool vg_playout_repair(vg_search* self, uint8_t* actions);
/// The flow moves on by these actions, which are noted in the line.
void vg_playout_step(vg_search* self, const uint8_t* actions);
/// At the horizon, or everything wanted is reached.
bool vg_playout_over(const vg_search* self);
/// The simulation's end: its reward, and the plan to keep if none was better. whole: see
/// vg_flow_reward().
double vg_playout_finish(vg_search* self, bool whole);
/// One step of a plan, as near to the wanted actions as the rules allow. False: it cannot go on.
bool vg_playout_follow(vg_search* self, const vg_joint_actions* wanted);
/// The legal action nearest to the wanted one: itself, else KS, DC, AC.
uint8_t vg_playout_nearest_legal(vg_search* self, uint32_t slot, uint8_t wanted);
/// The wanted action of a slot in one step; KS beyond the end.
uint8_t vg_wanted_action(const vg_joint_actions* wanted, uint32_t step_index, uint32_t slot);
/// Members of a set of actions.
uint32_t vg_set_size(uint8_t set);
/// Member number `index` of a set of actions, from the lowest bit on.
uint8_t vg_set_member(uint8_t set, uint32_t index);

/// Tree search with this budget of simulations (tree.c).
void vg_search_tree(vg_search* self, uint32_t budget);
/// Improves the best plan by variations of one or two vehicles, with this budget (polish.c).
void vg_search_polish(vg_search* self, uint32_t budget);
/// Simulates a whole plan: up to step `from` the best one's, whose states are stored, then the wanted
/// one's (polish.c). Returns its reward.
double vg_search_try(vg_search* self, uint32_t from, const vg_joint_actions* wanted);

#ifdef __cplusplus
}
#endif

#endif
