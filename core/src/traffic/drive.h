/// How controlled vehicles drive unless the search is VERGE_SEARCH_PAPER: the five actions, with
/// strengths that suit the traffic. The paper's rules (moves.c) accelerate and brake by 0.6 m/s^2
/// whatever lies ahead.
///
/// AC   accelerates comfortably, but not above what the limit and the vehicle ahead allow
/// KS   keeps the speed; legal where the speed allows to follow what is ahead
/// DC   brakes as much as is needed, at least drive_deceleration; legal while the vehicle moves
/// LCL, LCR  half a lane change at an adapted speed; legal where a gap allows it
///
/// One action of AC, KS, DC is always legal, so there always is a joint plan. What is ahead: the
/// nearest vehicle in the path, the end of a lane, and a conflict area that others pass first.
#ifndef VG_DRIVE_H
#define VG_DRIVE_H

#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// vg_flow_moves_unchecked() of BEST. Pairs are up to date.
void vg_drive_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);

/// vg_flow_check_change() of BEST: if the change is legal, its state is computed as well.
void vg_drive_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                           uint32_t slot, uint8_t action);

/// The action that a vehicle alone would choose: towards the lane with the least time to go,
/// counting slower vehicles ahead, else as fast as is legal. Always a legal action.
uint8_t vg_drive_policy(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot);

/// Time lost behind the vehicle ahead, if it is slower, over the next 20 s. [s]
float vg_drive_delay(const vg_model* model, const vg_flow* flow, uint32_t slot,
                     const vg_neighbours* w);

/// Desired speed of a controlled vehicle at its place. [m/s]
static inline float vg_drive_desired(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return vg_maxf(vg_minf(flow->limit[slot], model->speed_max[slot]), 1.0f);
}

/// Time until the traffic beside leaves a gap for a change to the left, or right, lane. [s]
float vg_drive_blocked(const vg_model* model, const vg_flow* flow, uint32_t slot, bool left);

#ifdef __cplusplus
}
#endif

#endif
