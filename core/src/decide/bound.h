/// An upper bound of X_flow: the weighted sum of the best R_i that each vehicle could have on an
/// empty road.
///
/// BEST and POLICY: all that can be earned, less what lane changes cost that a vehicle cannot do
/// without (vg_reward_most). What it loses behind slower vehicles is left out: others could let it
/// by, so no part of that is certain.
///
/// PAPER: dynamic programming over (step, half lane changes left, times accelerated, last kind of
/// action). Other vehicles and legal stretches are ignored and all values are rounded upwards,
/// so the bound is admissible. DC is left out: on an empty road it never earns more than KS. Cost: a
/// few thousand operations a vehicle.
#ifndef VG_BOUND_H
#define VG_BOUND_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// [1] in [0, 1]; X_flow of every plan from this flow is at most this.
double vg_flow_bound(const vg_model* model, const vg_flow* root);

#ifdef __cplusplus
}
#endif

#endif
