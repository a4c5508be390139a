/// The decision of a vehicle in the coordinates of the traffic model: the state expected at the end
/// of each step, with the properties of the road there.
#ifndef VG_EXPECTED_H
#define VG_EXPECTED_H

#include "road/road.h"
#include "traffic/actions.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// One vehicle between two steps. Single precision, as the decision was made.
typedef struct vg_expected_state {
    uint32_t lane;                ///< index
    float    station, d, v;       ///< [m], [m], [m/s]
    float    y;                   ///< [m] on the bundle's lateral axis
    float    rate;                ///< [1] metres of lane per metre of station
    float    left_gap, right_gap; ///< [m] to the neighbours' centres, 0: no change there
} vg_expected_state;

/// states[0] is the vehicle's present state, states[t + 1] the one at the end of step t.
typedef struct vg_expected {
    uint32_t step_count;
    double   t[VERGE_STEPS_MAX + 1];    ///< [s] 0, and the end of each step
    uint8_t  actions[VERGE_STEPS_MAX];
    float    distance[VERGE_STEPS_MAX]; ///< [m] driven in each step
    vg_expected_state states[VERGE_STEPS_MAX + 1];
} vg_expected;

/// False where the decision cannot be used: an unknown lane or action, a value that is not finite
/// or out of range, steps that do not follow one another from t0 = 0 on, none, or more than
/// VERGE_STEPS_MAX. The vehicle is on the road.
bool vg_expected_from(vg_expected* expected, const verge_scene* scene, uint32_t vehicle_index,
                      const verge_vehicle_decision* decision);

#ifdef __cplusplus
}
#endif

#endif
