/// Pairs of vehicles: how far one is ahead of and to the left of another, and the nearest ones.
#ifndef VG_PAIRS_H
#define VG_PAIRS_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A vehicle counts as in the path when the bodies, with this much air, overlap laterally: 2.4 m
/// between centres of two cars of 2 m, 0.6 lane widths. [m]
#define VG_PATH_AIR 0.4f

/// Nearest vehicles ahead and behind in the path of one lateral option.
typedef struct vg_neighbours {
    float gap_ahead, v_ahead;   ///< [m] from the own centre to the leader's tail, [m/s]
    float gap_behind, v_behind; ///< [m] from the own centre to the follower's nose, [m/s]
} vg_neighbours;

/// Brings the pairs up to date with the lanes of a flow. Needed where !model->single_axis.
void vg_pairs_update(const vg_model* model, const vg_flow* flow);

/// The neighbours of slot i at a station and y, with all vehicles at `stations` and speeds v.
/// free_ahead: distance to a standing obstacle ahead, VG_FAR_AWAY none. [m]
vg_neighbours vg_nearest(const vg_model* model, const vg_flow* flow, uint32_t i, float station, float y,
                         const float* stations, const float* v, float free_ahead);

/// Slots of the nearest vehicles in the path of this one, -1 none.
void vg_flow_neighbours(const vg_model* model, const vg_flow* flow, uint32_t slot, int32_t* ahead,
                        int32_t* behind);

/// All others as vehicle i sees them.
static inline const vg_pair* vg_pair_row(const vg_model* model, uint32_t i)
{
    return &model->pairs->of[i * model->pairs->stride];
}

/// Difference on a ring of this length, into +-half of it; unchanged where there is no ring. [m]
static inline float vg_wrap(float ahead, float ring)
{
    const float half = 0.5f * ring;
    return ring <= 0.0f ? ahead : ahead > half ? ahead - ring : ahead < -half ? ahead + ring : ahead;
}

/// Metres from slot i, at station_i, ahead to slot j, at station_j, centre to centre.
VG_INLINE float vg_gap_along(const vg_model* model, uint32_t i, uint32_t j, float rate, float station_i,
                      float station_j)
{
    if (model->single_axis) {
        return (station_j - station_i) * rate;
    }
    const float ahead = (station_j + vg_pair_row(model, i)[j].offset - station_i) * rate;
    return model->rings ? vg_wrap(ahead, vg_pair_row(model, i)[j].period * rate) : ahead;
}

/// Metres from y_i to the left to y_j.
VG_INLINE float vg_gap_left(const vg_model* model, uint32_t i, uint32_t j, float y_i, float y_j)
{
    return model->single_axis ? y_j - y_i : y_j - y_i + vg_pair_row(model, i)[j].lateral;
}

#ifdef __cplusplus
}
#endif

#endif
