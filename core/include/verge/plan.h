/// The result of a planning step: for each controlled vehicle a readable action sequence and a
/// drivable trajectory; for each uncontrolled vehicle a prediction.
#ifndef VERGE_PLAN_H
#define VERGE_PLAN_H

#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A predicted pose of a body.
typedef struct verge_pose {
    double t;       ///< [s] from the plan's utime
    double x, y;    ///< [m] centre
    double heading; ///< [rad]
} verge_pose;

/// The predicted motion of an uncontrolled vehicle.
typedef struct verge_prediction {
    int32_t    vehicle_id;
    uint32_t   point_count;
    verge_pose points[VERGE_POINTS_MAX];
    /// [1] How likely each verge_hypothesis is, 0 where it is not an option; sum 1. All 0: nothing
    /// is known, as for a vehicle on no lane. Not part of the digest.
    float      hypotheses[VERGE_HYPOTHESIS_COUNT];
} verge_prediction;

/// The whole plan. Large (119 kB with the default capacities): keep it in static memory. Vehicles
/// are ordered by id.
typedef struct verge_plan {
    int64_t             utime;   ///< [us] instant t = 0 of all times in the plan
    uint64_t            digest;  ///< of all vehicle plans and predictions, see core/README.md
    verge_search_report search;
    uint32_t            vehicle_count;
    verge_vehicle_plan  vehicles[VERGE_CONTROLLED_MAX];
    uint32_t            prediction_count;
    verge_prediction    predictions[VERGE_VEHICLES_MAX];
    uint32_t            fallback_count;  ///< vehicle plans with another status than VERGE_PLANNED
    uint32_t            replanned_count; ///< vehicles planned again after the joint check
} verge_plan;

#ifdef __cplusplus
}
#endif

#endif
