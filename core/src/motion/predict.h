/// Where everyone will be at the trajectory's instants: planned vehicles along their decided
/// actions, the others by lane keeping behind them (section 3.2.2: "first predicts").
#ifndef VG_PREDICT_H
#define VG_PREDICT_H

#include "decide/mcts.h"
#include "motion/track.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Fills one track per vehicle, in the vehicles' order (by id). decision may be null where
/// nothing is planned.
void vg_predict_tracks(vg_tracks* tracks, const vg_model* scene, const vg_flow* root,
                       const vg_decision* decision, const verge_vehicle* vehicles,
                       const vg_placed* placed, uint32_t vehicle_count);

/// Reference line under (lane, s), over the seam to the lane that continues it where s is beyond.
void vg_road_pose(const verge_road* road, uint32_t lane, int32_t target, double s, double d, double* x,
                  double* y, double* cos_heading, double* sin_heading);

#ifdef __cplusplus
}
#endif

#endif
