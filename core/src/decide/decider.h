/// What of a decider other stages may share: see verge_predictor_init_shared().
#ifndef VG_DECIDER_H
#define VG_DECIDER_H

#include "traffic/traffic.h"
#include "verge/decision.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The def that the decider was built with, without its road.
const verge_planner_def* vg_decider_def(const verge_decider* decider);
/// The memory that holds the traffic while it decides.
vg_traffic vg_decider_traffic(const verge_decider* decider);

#ifdef __cplusplus
}
#endif

#endif
