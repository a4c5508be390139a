/// The result of a planning step: for each controlled vehicle an action sequence a human can
/// read and a trajectory a vehicle can follow; for every other vehicle what was believed of it.
#ifndef VERGE_PLAN_H
#define VERGE_PLAN_H

#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// What the planner believed of a vehicle it does not plan.
typedef struct verge_pose {
    double t, x, y, heading;
} verge_pose;

typedef struct verge_prediction {
    int32_t    vehicle_id;
    uint32_t   point_count;
    verge_pose points[VERGE_POINTS_MAX];
} verge_prediction;

/// The whole plan. Large (116 kB with the default capacities): keep it in static memory. Vehicles are
/// ordered by id.
typedef struct verge_plan {
    int64_t             utime;   ///< [us] t = 0 of everything in it
    uint64_t            digest;  ///< of all vehicle plans and predictions, see core/README.md
    verge_search_report search;
    uint32_t            vehicle_count;
    verge_vehicle_plan  vehicles[VERGE_CONTROLLED_MAX];
    uint32_t            prediction_count;
    verge_prediction    predictions[VERGE_VEHICLES_MAX];
    uint32_t            fallback_count;
    uint32_t            replanned_count; ///< vehicles planned again by the joint check
} verge_plan;

#ifdef __cplusplus
}
#endif

#endif
