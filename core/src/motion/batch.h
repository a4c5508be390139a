/// Evaluates all candidates of one segment, eight at a time: cost (Eq. 7 to 9), limits, and a swept
/// collision filter against every track. The eight share one profile s(t) and differ in their end
/// offset, so a point of the reference line is looked up once for all of them.
#ifndef VG_BATCH_H
#define VG_BATCH_H

#include "motion/cost.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    VG_BATCH_WIDTH = 8, ///< candidates in one inner loop: end offsets that share a profile
};

/// Marks of a candidate (bits).
enum {
    VG_ALARM = 1,         ///< may touch a body: the exact check is needed
    VG_UNCOMFORTABLE = 2, ///< exceeds a limit of normal driving
    VG_INFEASIBLE = 4,    ///< exceeds a limit of the body
    VG_TRIED = 8,         ///< already tried by the sampler
};

/// The candidates of one segment: legs x offsets.
typedef struct vg_batch {
    uint32_t start, last;      ///< instants of the trajectory; the leg covers (start, last]
    double   lateral_s;        ///< [s] from the start in which the offset is reached
    bool     in_lane;          ///< the offset term is active
    double   aim;              ///< [m] offset of the line from which it is measured
    vg_comfort comfort;
    uint32_t leg_count, offset_count;
    double*  offsets;          ///< [sample_offsets] [m] lateral end offsets
    vg_leg*  legs;             ///< [sample_speeds]
    double*  leg_penalties;    ///< [sample_speeds] [1] added to the cost when candidates are
    double*  offset_penalties; ///< [sample_offsets] [1] ordered, and not part of the cost reported
    double*  costs;            ///< [leg * offset_count + offset]
    uint8_t* marks;            ///< [leg * offset_count + offset]
} vg_batch;

/// Takes memory for a batch of def->sample_speeds x def->sample_offsets candidates.
void vg_batch_take(vg_batch* batch, vg_arena* arena, const verge_planner_def* def);

/// Fills costs and marks. A candidate without VG_ALARM touches no body; one with VG_ALARM may.
void vg_batch_run(vg_batch* batch, const verge_planner_def* def, const verge_weights* weights,
                  const verge_tracks* tracks, uint32_t own);

#ifdef __cplusplus
}
#endif

#endif
