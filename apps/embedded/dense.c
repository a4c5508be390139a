// A new random scene every third cycle: neighbours on all sides, some of them braking hard. In many
// of these scenes a contact cannot be avoided.
#include "vehicle.h"

/// A number in [low, high]: always the same sequence.
static double draw(double low, double high)
{
    static uint32_t state = 12345;
    state = state * 1664525u + 1013904223u;
    return low + (high - low) * (double)(state >> 8) / 16777216.0;
}

void traffic_change(verge_vehicle vehicles[VEHICLES], int cycle)
{
    static const struct {
        double ahead; // [m] of the own vehicle
        int    lane;
    } place[VEHICLES] = {
        { 0, 1 }, { -15, 0 }, { -18, 1 }, { -16, 2 }, { 16, 0 }, { 20, 1 }, { 14, 2 }, { 2, 0 },
        { -3, 2 },
    };
    for (int i = 0; i < VEHICLES && cycle % 3 == 0; ++i) {
        verge_vehicle* vehicle = &vehicles[i];
        *vehicle = verge_vehicle_default();
        vehicle->id = 1 + i;
        vehicle->x = 100.0 + place[i].ahead + draw(-5.0, 5.0);
        vehicle->y = LANE_WIDTH * place[i].lane + draw(-0.6, 0.6);
        vehicle->speed = draw(0.0, 16.0);
        vehicle->acceleration = draw(-7.0, 3.0);
        vehicle->controlled = i == 0;
        vehicle->target_lane = i == 0 ? cycle / 3 % LANES : VERGE_NO_LANE;
    }
}
