// A vehicle in the middle of three lanes, with 8 neighbours. The one ahead of it brakes to a
// standstill, waits and departs again, and so does the one behind it; the others keep their speeds.
#include "vehicle.h"

enum { OWN = 0, BEHIND = 2, AHEAD = 5, BRAKES = 20, STANDS = 70, DEPARTS = 80 }; // the last three: cycles
#define CYCLE_S (1e-6 * CYCLE_US)

static const double centerlines[LANES][2][2] = {
    { { 0.0, 0.0 }, { 500.0, 0.0 } },
    { { 0.0, 3.5 }, { 500.0, 3.5 } },
    { { 0.0, 7.0 }, { 500.0, 7.0 } },
};
static verge_lane_def lanes[LANES];
static verge_vehicle  now[VEHICLES];
static int            cycle;

verge_road_def vehicle_road(void)
{
    for (int i = 0; i < LANES; ++i) {
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = centerlines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 3.5;
        lanes[i].speed_limit = 17.0;
        lanes[i].left = i + 1 < LANES ? i + 1 : VERGE_NO_LANE;
        lanes[i].right = i > 0 ? i - 1 : VERGE_NO_LANE;
    }
    const verge_road_def road = { lanes, LANES };
    return road;
}

static void set_start(void)
{
    static const struct {
        double x, speed; // [m], [m/s]
        int    lane;
    } start[VEHICLES] = {
        { 60, 14, 1 }, { 40, 13, 0 }, { 30, 10, 1 }, { 58, 14, 2 }, { 150, 11, 0 },
        { 100, 10, 1 }, { 30, 13, 2 }, { 75, 12, 0 }, { 130, 14, 2 },
    };
    for (int i = 0; i < VEHICLES; ++i) {
        now[i] = verge_vehicle_default();
        now[i].id = 1 + i;
        now[i].x = start[i].x;
        now[i].y = centerlines[start[i].lane][0][1];
        now[i].speed = start[i].speed;
    }
    now[OWN].controlled = true;
    now[OWN].target_lane = 1;
}

void vehicle_receive(verge_vehicle heard[VEHICLES])
{
    if (cycle == 0) {
        set_start();
    }
    const bool brakes = cycle >= BRAKES && cycle < STANDS;
    now[AHEAD].acceleration = cycle >= DEPARTS ? 1.0 : brakes ? -2.0 : 0.0;
    now[BEHIND].acceleration = now[AHEAD].acceleration;
    for (int i = 0; i < VEHICLES; ++i) {
        if (cycle > 0 && i != OWN) {
            const double v = now[i].speed + CYCLE_S * now[i].acceleration;
            now[i].x += CYCLE_S * now[i].speed;
            now[i].speed = v > 0.0 ? v : 0.0;
        }
        heard[i] = now[i];
    }
    ++cycle;
}

void vehicle_drive(const verge_vehicle_plan* plan)
{
    const verge_point* at = &plan->points[1]; // one cycle later
    now[OWN].x = at->x;
    now[OWN].y = at->y;
    now[OWN].heading = at->heading;
    now[OWN].speed = at->speed;
    now[OWN].acceleration = at->acceleration;
    now[OWN].yaw_rate = at->speed * at->curvature;
}

/// [m/s^2] that keeps a time gap of 1.5 s to the vehicle ahead
static double wanted_acceleration(const verge_scene* scene)
{
    const verge_lane_position* own = &scene->positions[0];
    const double v = scene->vehicles[0].speed;
    double gap = 100.0, closing = 0.0; // [m], [m/s]
    for (uint32_t i = 1; i < scene->vehicle_count; ++i) {
        const double ahead = scene->positions[i].s - own->s - scene->vehicles[0].length;
        if (scene->positions[i].lane_id == own->lane_id && ahead > 0.0 && ahead < gap) {
            gap = ahead;
            closing = v - scene->vehicles[i].speed;
        }
    }
    const double wanted = 0.1 * (gap - 3.0 - 1.5 * v) - 0.7 * closing;
    return wanted > 1.0 ? 1.0 : wanted < -4.0 ? -4.0 : wanted;
}

void vehicle_decide(const verge_scene* scene, verge_decision* decision)
{
    const double a = wanted_acceleration(scene);
    const int32_t lane_id = scene->positions[0].lane_id;
    double s = scene->positions[0].s, v = scene->vehicles[0].speed;
    verge_vehicle_decision* own = &decision->vehicles[0];
    decision->vehicle_count = 1;
    own->vehicle_id = scene->vehicles[0].id;
    for (own->step_count = 0; own->step_count < 2; ++own->step_count) {
        verge_action_step* step = &own->steps[own->step_count];
        const double v1 = v + 1.5 * a > 0.0 ? v + 1.5 * a : 0.0;
        step->action = a > 0.05 ? VERGE_ACCELERATE : a < -0.05 ? VERGE_DECELERATE : VERGE_KEEP_SPEED;
        step->lane_id = lane_id;
        step->t0 = 1.5 * own->step_count;
        step->t1 = step->t0 + 1.5;
        step->distance = 1.5 * 0.5 * (v + v1);
        step->s = s += step->distance;
        step->v = v = v1;
        step->ahead_id = step->behind_id = -1;
    }
}
