// A vehicle on three lanes with 8 neighbours. What they do is in follow.c or dense.c.
#include "vehicle.h"

#define CYCLE_S (1e-6 * CYCLE_US)

static verge_lane_def lanes[LANES];
static double         points[LANES][2][2];
static verge_vehicle  now[VEHICLES]; // the first one is the own vehicle
static int            cycle;

verge_road_def vehicle_road(void)
{
    for (int i = 0; i < LANES; ++i) {
        points[i][1][0] = 500.0;
        points[i][0][1] = points[i][1][1] = LANE_WIDTH * i;
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = points[i];
        lanes[i].point_count = 2;
        lanes[i].width = LANE_WIDTH;
        lanes[i].speed_limit = 17.0;
        lanes[i].left = i + 1 < LANES ? i + 1 : VERGE_NO_LANE;
        lanes[i].right = i > 0 ? i - 1 : VERGE_NO_LANE;
    }
    const verge_road_def road = { lanes, LANES };
    return road;
}

void vehicle_receive(verge_vehicle heard[VEHICLES])
{
    for (int i = 1; i < VEHICLES; ++i) {
        const double v = now[i].speed + CYCLE_S * now[i].acceleration;
        now[i].x += CYCLE_S * now[i].speed;
        now[i].speed = v > 0.0 ? v : 0.0;
    }
    traffic_change(now, cycle++);
    for (int i = 0; i < VEHICLES; ++i) {
        heard[i] = now[i];
    }
}

void vehicle_drive(const verge_vehicle_plan* plan)
{
    const verge_point* at = &plan->points[1]; // one cycle later
    now[0].x = at->x;
    now[0].y = at->y;
    now[0].heading = at->heading;
    now[0].speed = at->speed;
    now[0].acceleration = at->acceleration;
    now[0].yaw_rate = at->speed * at->curvature;
}
