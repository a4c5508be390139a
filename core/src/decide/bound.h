/// What no joint plan can exceed: each vehicle's best R_i if it had the road to itself.
///
/// Dynamic programming over (step, half lane changes left, times accelerated, last kind of
/// action), others and legal stretches ignored, everything rounded upwards; so
/// the weighted sum is an admissible bound of X_flow. DC is left out: where nobody is ahead it
/// earns nothing that KS does not. Cost: a few thousand operations a vehicle.
#ifndef VG_BOUND_H
#define VG_BOUND_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// [1] in [0, 1]; X_flow of every plan from this flow is at most this.
double vg_flow_bound(const vg_model* scene, const vg_flow* root);

#ifdef __cplusplus
}
#endif

#endif
