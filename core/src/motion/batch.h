/// All candidates of one segment, evaluated eight at a time: cost (Eq. 7 to 9), limits, and a
/// swept collision filter against every track. The eight share one profile s(t) and differ in their
/// end offset, so a point of the reference line is looked up once for all of them.
#ifndef VG_BATCH_H
#define VG_BATCH_H

#include "motion/cost.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    VG_LANES = 8, ///< candidates of one inner loop: end offsets that share a profile
};

/// What a candidate may be marked with.
enum {
    VG_ALARM = 1,         ///< may touch a body: needs the exact check
    VG_UNCOMFORTABLE = 2, ///< breaks a limit of normal driving
    VG_INFEASIBLE = 4,    ///< breaks a limit of the body
    VG_TRIED = 8,         ///< the sampler has been here
};

/// The candidates of one segment: legs x offsets.
typedef struct vg_batch {
    uint32_t start, last;      ///< instants of the trajectory; the leg covers (start, last]
    bool     in_lane;          ///< the offset term is active
    vg_comfort comfort;
    uint32_t leg_count, offset_count;
    double*  offsets;          ///< [sample_offsets] [m] lateral end offsets
    vg_leg*  legs;             ///< [sample_speeds]
    double*  leg_penalties;    ///< [sample_speeds] [1] added to the cost for the
    double*  offset_penalties; ///< [sample_offsets] order of choice only
    double*  costs;            ///< [leg * offset_count + offset]
    uint8_t* marks;            ///< [leg * offset_count + offset]
} vg_batch;

/// Takes the arrays of a batch of def->sample_speeds x def->sample_offsets candidates.
void vg_batch_take(vg_batch* batch, vg_arena* arena, const verge_planner_def* def);

/// Fills costs and marks. The alarm may be false, its absence is a proof.
void vg_batch_run(vg_batch* batch, const verge_planner_def* def, const verge_weights* weights,
                  const verge_tracks* tracks, uint32_t own);

#ifdef __cplusplus
}
#endif

#endif
