/// Conflicts of joint actions: finds the controlled vehicles that would come too close to another
/// vehicle in one step (pruning of joint actions, section 3.1.3).
#ifndef VG_CONFLICT_H
#define VG_CONFLICT_H

#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Controlled slots (bits) that these actions bring too close to another vehicle, at any time
/// during the step.
uint32_t vg_flow_conflicts(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                           const uint8_t* actions);

#ifdef __cplusplus
}
#endif

#endif
