/// Pairs of vehicles: longitudinal and lateral distances, and the nearest vehicles.
#ifndef VG_PAIRS_H
#define VG_PAIRS_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A vehicle is in the path of another if their lateral gap is smaller than this: for two cars of
/// 2 m, less than 2.4 m between centres. [m]
#define VG_PATH_GAP 0.4f

/// The nearest vehicles ahead and behind in the path of a vehicle.
typedef struct vg_neighbours {
    float gap_ahead, v_ahead;   ///< [m] from the own centre to the leader's rear end, [m/s]
    float gap_behind, v_behind; ///< [m] from the own centre to the follower's front end, [m/s]
    int32_t ahead, behind;      ///< their slots, -1 none
} vg_neighbours;

/// Updates the pairs to the lanes of a flow. Needed where !model->single_axis.
void vg_pairs_update(const vg_model* model, const vg_flow* flow);

/// The neighbours of slot i at a station and y, with all vehicles at `stations` and speeds v.
/// free_ahead: distance to a standing obstacle ahead, VG_FAR_AWAY: none. [m]
vg_neighbours vg_nearest(const vg_model* model, const vg_flow* flow, uint32_t i, float station,
                         float y, const float* stations, const float* v, float free_ahead);

/// All vehicles ahead in the path of slot i (bits), with the distances from its centre to their rear
/// ends. [m]
uint64_t vg_all_ahead(const vg_model* model, const vg_flow* flow, uint32_t i,
                      float gaps[VERGE_VEHICLES_MAX]);

/// Slots of the nearest vehicles in the path of this one, -1 none.
void vg_flow_neighbours(const vg_model* model, const vg_flow* flow, uint32_t slot, int32_t* ahead,
                        int32_t* behind);

/// All other vehicles on the axes of vehicle i.
static inline const vg_pair* vg_pair_row(const vg_model* model, uint32_t i)
{
    return &model->pairs->of[i * model->pairs->stride];
}

/// Wraps a distance on a ring of this length to +-half of the length; ring 0: unchanged. [m]
static inline float vg_wrap(float ahead, float ring)
{
    const float half = 0.5f * ring;
    return ring <= 0.0f    ? ahead
           : ahead > half  ? ahead - ring
           : ahead < -half ? ahead + ring
                           : ahead;
}

/// Distance from slot i, at station_i, ahead to slot j, at station_j, centre to centre. [m]
VG_INLINE float vg_gap_along(const vg_model* model, uint32_t i, uint32_t j, float rate,
                             float station_i, float station_j)
{
    if (model->single_axis) {
        return (station_j - station_i) * rate;
    }
    const float ahead = (station_j + vg_pair_row(model, i)[j].offset - station_i) * rate;
    return model->rings ? vg_wrap(ahead, vg_pair_row(model, i)[j].period * rate) : ahead;
}

/// Lateral distance from slot i, at y_i, to slot j, at y_j, positive to the left. [m]
VG_INLINE float vg_gap_left(const vg_model* model, uint32_t i, uint32_t j, float y_i, float y_j)
{
    return model->single_axis ? y_j - y_i : y_j - y_i + vg_pair_row(model, i)[j].lateral;
}

#ifdef __cplusplus
}
#endif

#endif
