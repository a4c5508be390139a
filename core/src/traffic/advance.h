/// Moves the flow by one decision step.
#ifndef VG_ADVANCE_H
#define VG_ADVANCE_H

#include "traffic/moves.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The flow after one decision step with these actions. flow and next must not be the same.
void vg_flow_advance(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                     const uint8_t* actions, vg_flow* next);

/// Moves the uncontrolled vehicles by dt [s]. Controlled vehicles stay as they are.
void vg_flow_follow(const vg_model* model, const vg_flow* flow, double dt, vg_flow* next);

#ifdef __cplusplus
}
#endif

#endif
