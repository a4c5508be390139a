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

/// Where a station lies beyond the end of a lane of slot's route: sets lane (index) and station to
/// those of the lane that continues it. Several may be passed, as lanes may be shorter than a step.
/// rate: [1] metres of lane per metre of station, where the vehicle is.
void vg_flow_pass_ends(const vg_model* model, uint32_t slot, float rate, int32_t* lane,
                       float* station);

#ifdef __cplusplus
}
#endif

#endif
