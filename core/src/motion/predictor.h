/// A predictor in memory of its own, or in that of another stage.
#ifndef VG_PREDICTOR_H
#define VG_PREDICTOR_H

#include "traffic/traffic.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// verge_predictor_init(), with traffic that another stage owns: it is taken for the same def.
verge_status vg_predictor_init_with(verge_predictor** predictor, const verge_planner_def* def,
                                    const vg_traffic* traffic, void* memory, size_t size);

#ifdef __cplusplus
}
#endif

#endif
