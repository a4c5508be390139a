/// Which vehicles of a scene stand, and whether they are expected to go on.
#ifndef VG_STANDING_H
#define VG_STANDING_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Sets model->standing of all slots. The last part of vg_model_from().
void vg_model_classify(vg_model* model, const vg_flow* flow);

#ifdef __cplusplus
}
#endif

#endif
