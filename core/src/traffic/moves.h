/// The legal actions of each vehicle in one decision step, and the states they lead to: the actions
/// of Table 1, the speed window of Eq. 2 and 3, the pruning of single actions (section 3.1.3).
#ifndef VG_MOVES_H
#define VG_MOVES_H

#include "traffic/actions.h"
#include "traffic/pairs.h"

#ifdef __cplusplus
extern "C" {
#endif

/// States after one step. Uncontrolled vehicles have one state, stored as that of KS.
typedef struct vg_moves {
    VG_ALIGNED float station[VG_ALONG_COUNT][VERGE_VEHICLES_MAX]; ///< [m] by vg_along
    VG_ALIGNED float v[VG_ALONG_COUNT][VERGE_VEHICLES_MAX];       ///< [m/s] by vg_along
    VG_ALIGNED float y[VG_ACROSS_COUNT][VERGE_VEHICLES_MAX];      ///< [m] by vg_across
    vg_neighbours keep[VERGE_CONTROLLED_MAX];    ///< BEST: in the own lane after KS
    float   wall[VERGE_CONTROLLED_MAX]; ///< [m/s] BEST: most before a conflict area or a signal
    float   change_gap[2][VERGE_CONTROLLED_MAX]; ///< [m] left by a legal change to the left, right
    uint8_t legal[VERGE_CONTROLLED_MAX];         ///< set of actions (bits), never empty
    uint8_t unchecked[VERGE_CONTROLLED_MAX];     ///< lane changes (bits) not yet checked for gaps
} vg_moves;

/// Computes the moves of all vehicles and checks all lane changes. Each move is legal on its own.
void vg_flow_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);

/// The same without the check of the neighbouring lanes. A simulation draws one of up to five
/// actions, so most lane changes never need the check.
void vg_flow_moves_unchecked(const vg_model* model, const vg_flow* flow, vg_moves* moves);

/// Checks whether an unchecked lane change is legal. If it is, it becomes one of the legal actions.
bool vg_flow_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                          uint32_t slot, uint8_t action);

/// Gap that is sufficient at low speed v. [m]
static inline float vg_low_speed_gap(const vg_model* model, float v)
{
    return (float)model->def->idm_gap + (float)model->def->idm_headway_s * v;
}

#ifdef __cplusplus
}
#endif

#endif
