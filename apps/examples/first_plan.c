// One planning step: vehicle 7 drives behind the slower vehicle 3 and wants the left lane.
#include <stdalign.h>
#include <stdio.h>
#include <verge/verge.h>

alignas(64) static unsigned char memory[8 << 20]; // the planner never uses any other memory
static verge_plan plan;                           // 119 kB: too large for many stacks

static const double centerlines[2][2][2] = { // [m]
    { { 0.0, 0.0 }, { 500.0, 0.0 } },        // lane 0
    { { 0.0, 3.5 }, { 500.0, 3.5 } },        // lane 1, to the left of lane 0
};
static verge_lane_def lanes[2]; // all zero: no successors, lane changes allowed everywhere

int main(void)
{
    for (int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].points = centerlines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 3.5;        // [m]
        lanes[i].speed_limit = 20.0; // [m/s]
        lanes[i].left = i == 0 ? 1 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 0 : VERGE_NO_LANE;
    }
    verge_planner_def def = verge_planner_default_def();
    def.road.lanes = lanes;
    def.road.lane_count = 2;
    verge_planner* planner;
    verge_status status = verge_planner_init(&planner, &def, memory, sizeof memory);

    verge_vehicle vehicles[2] = { verge_vehicle_default(), verge_vehicle_default() };
    vehicles[0].id = 3; // an uncontrolled vehicle: its motion is predicted
    vehicles[0].x = 90.0;
    vehicles[0].speed = 8.0;
    vehicles[1].id = 7;
    vehicles[1].controlled = true; // a controlled vehicle: its motion is planned
    vehicles[1].x = 60.0;
    vehicles[1].speed = 12.0;
    vehicles[1].target_lane = 1;
    if (status == VERGE_OK) {
        status = verge_planner_step(planner, 0, vehicles, 2, &plan);
    }
    if (status != VERGE_OK) {
        fprintf(stderr, "%s\n", verge_status_text(status));
        return 1;
    }

    const verge_vehicle_plan* one = &plan.vehicles[0];
    for (uint32_t i = 0; i < one->action_count; ++i) {
        char words[96];
        verge_action_say(&one->actions[i], words, sizeof words);
        printf("%4.1f s  %s\n", one->actions[i].t0, words);
    }
    const verge_point* end = &one->points[one->point_count - 1];
    printf("%4.1f s  x %.1f m, y %.2f m, %.1f m/s\n", end->t, end->x, end->y, end->speed);
    return 0;
}
