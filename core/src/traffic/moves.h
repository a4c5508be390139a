/// What each vehicle could do in one decision step: the actions of Table 1, the speed window of
/// Eq. 2 and 3 and the pruning of single actions (section 3.1.3).
#ifndef VG_MOVES_H
#define VG_MOVES_H

#include "traffic/actions.h"
#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// States after one step. Uncontrolled vehicles have one move, in place of KS.
typedef struct vg_moves {
    VG_ALIGNED float station[VG_ALONG_COUNT][VERGE_VEHICLES_MAX]; ///< [m] by vg_along
    VG_ALIGNED float v[VG_ALONG_COUNT][VERGE_VEHICLES_MAX];       ///< [m/s] by vg_along
    VG_ALIGNED float y[VG_ACROSS_COUNT][VERGE_VEHICLES_MAX];      ///< [m] by vg_across
    float   change_gap[2][VERGE_CONTROLLED_MAX]; ///< [m] that a legal change to the left, right leaves
    uint8_t legal[VERGE_CONTROLLED_MAX];         ///< set of actions (bits), never empty
    uint8_t unchecked[VERGE_CONTROLLED_MAX];     ///< lane changes (bits) wanted but not yet checked
} vg_moves;

/// Every vehicle's moves, each legal on its own; no change is left unchecked.
void vg_flow_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);

/// The same without the check of the neighbouring lanes: a simulation draws one action in a
/// handful, so most lane changes never need the check.
void vg_flow_moves_unchecked(const vg_model* model, const vg_flow* flow, vg_moves* moves);

/// Checks whether an unchecked change is legal, and moves it to the legal ones if so.
bool vg_flow_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot,
                          uint8_t action);

/// Gap that is enough where traffic crawls. [m]
static inline float vg_crawling_gap(const vg_model* model, float v)
{
    return (float)model->def->idm_gap + (float)model->def->idm_headway_s * v;
}

#ifdef __cplusplus
}
#endif

#endif
