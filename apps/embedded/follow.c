// The vehicle ahead brakes to a standstill, waits and departs again, and so does the one behind.
// The others keep their speeds.
#include "vehicle.h"

enum { BEHIND = 2, AHEAD = 5, BRAKES = 20, STANDS = 70, DEPARTS = 80 }; // the last three: cycles

static void set_start(verge_vehicle vehicles[VEHICLES])
{
    static const struct {
        double x, speed; // [m], [m/s]
        int    lane;
    } start[VEHICLES] = {
        { 60, 14, 1 }, { 40, 13, 0 }, { 30, 10, 1 }, { 58, 14, 2 }, { 150, 11, 0 },
        { 100, 10, 1 }, { 30, 13, 2 }, { 75, 12, 0 }, { 130, 14, 2 },
    };
    for (int i = 0; i < VEHICLES; ++i) {
        vehicles[i] = verge_vehicle_default();
        vehicles[i].id = 1 + i;
        vehicles[i].x = start[i].x;
        vehicles[i].y = LANE_WIDTH * start[i].lane;
        vehicles[i].speed = start[i].speed;
    }
    vehicles[0].controlled = true;
    vehicles[0].target_lane = 1;
}

void traffic_change(verge_vehicle vehicles[VEHICLES], int cycle)
{
    if (cycle == 0) {
        set_start(vehicles);
    }
    const bool brakes = cycle >= BRAKES && cycle < STANDS;
    vehicles[AHEAD].acceleration = cycle >= DEPARTS ? 1.0 : brakes ? -2.0 : 0.0;
    vehicles[BEHIND].acceleration = vehicles[AHEAD].acceleration;
}
