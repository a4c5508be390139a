/// Plans in the numbers that a message can hold. See trajectory.h.
#include "verge/trajectory.h"

#include "base/single.h"

void verge_vehicle_plan_round(verge_vehicle_plan* plan)
{
    const uint32_t count = plan == NULL ? 0 : plan->point_count;
    for (uint32_t k = 0; k < count && k < VERGE_POINTS_MAX; ++k) {
        verge_point* point = &plan->points[k];
        point->heading = vg_single(point->heading);
        point->speed = vg_single(point->speed);
        point->acceleration = vg_single(point->acceleration);
        point->curvature = vg_single(point->curvature);
    }
    if (plan != NULL) {
        const bool lasts = plan->change_lane_id != VERGE_NO_LANE && plan->change_end > 0.0;
        plan->change_end = lasts ? vg_whole_milliseconds(plan->change_end) : 0.0;
    }
}
