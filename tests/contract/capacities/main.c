/// Builds a planner with every parameter at its default, checks the ends of the parameters that a
/// capacity bounds, and plans one vehicle behind another. Exit 0 where all of it works.
#include "verge/verge.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double centrelines[2][2][2] = { { { 0, 0 }, { 400, 0 } }, { { 0, 4 }, { 400, 4 } } };
static verge_plan plan;

static int refused(const char* what, int status)
{
    fprintf(stderr, "%s: %s\n", what, verge_status_text((verge_status)status));
    return 1;
}

static int plan_with(const verge_planner_def* def, const char* what)
{
    const size_t size = verge_planner_memory_size(def);
    void* memory = size > 0 ? aligned_alloc(64, (size + 63) / 64 * 64) : NULL;
    verge_planner* planner = NULL;
    verge_status status = verge_planner_init(&planner, def, memory, size);
    if (status != VERGE_OK) {
        return refused(what, status);
    }
    verge_vehicle vehicles[2] = { verge_vehicle_default(), verge_vehicle_default() };
    vehicles[0].controlled = true;
    vehicles[0].target_lane = 1;
    vehicles[1].id = 1;
    vehicles[0].x = 50.0;
    vehicles[1].x = 90.0;
    vehicles[0].speed = vehicles[1].speed = 10.0;
    for (int64_t utime = 0; utime < 500000 && status == VERGE_OK; utime += 100000) {
        status = verge_planner_step(planner, utime, vehicles, 2, &plan);
    }
    free(memory);
    if (status != VERGE_OK) {
        return refused(what, status);
    }
    const verge_vehicle_plan* own = &plan.vehicles[0];
    const int good = plan.vehicle_count == 1 && own->status == VERGE_PLANNED
                     && own->action_count == def->steps && own->point_count == def->points;
    if (!good) {
        fprintf(stderr, "%s: status %d, %u actions, %u points\n", what, (int)own->status,
                own->action_count, own->point_count);
    }
    return good ? 0 : 1;
}

int main(void)
{
    verge_lane_def lanes[2];
    memset(lanes, 0, sizeof lanes);
    for (int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].points = centrelines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 4.0;
        lanes[i].speed_limit = 15.0;
        lanes[i].left = i == 0 ? 1 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 0 : VERGE_NO_LANE;
    }
    verge_planner_def def = verge_planner_default_def();
    def.road.lanes = lanes;
    def.road.lane_count = 2;
    def.iterations = 300;
    if (verge_planner_memory_size(&def) == 0) {
        return refused("the default def", verge_planner_check(&def, NULL));
    }
    def.vehicles_max = 2; // a million nodes of two vehicles fit a test
    def.controlled_max = 1;
    if (plan_with(&def, "the default def") != 0) {
        return 1;
    }
    def.points = VERGE_POINTS_MAX;
    def.steps = VERGE_STEPS_MAX;
    def.step_s = 4.0;
    def.sample_speeds = VERGE_SAMPLE_SPEEDS_MAX;
    def.sample_offsets = VERGE_SAMPLE_OFFSETS_MAX;
    return plan_with(&def, "every parameter as large as its capacity");
}
