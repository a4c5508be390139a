/// See standing.h.
#include "standing.h"

#include <math.h>

static bool vehicle_ahead(const world* world, const world_vehicle* vehicle);
static bool end_ahead(const world* world, const world_vehicle* vehicle);

bool standing_without_cause(const world* world, const world_vehicle* vehicle)
{
    return vehicle->present && fabs(vehicle->state.speed) < STANDING_SPEED &&
           !vehicle_ahead(world, vehicle) && !end_ahead(world, vehicle);
}

static bool vehicle_ahead(const world* world, const world_vehicle* vehicle)
{
    const verge_vehicle* own = &vehicle->state;
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* other = &world->vehicles[i];
        const double x = other->state.x - own->x;
        const double y = other->state.y - own->y;
        const double along = x * cos(own->heading) + y * sin(own->heading);
        if (other != vehicle && other->present && along >= 0.0 && hypot(x, y) <= STANDING_VIEW) {
            return true;
        }
    }
    return false;
}

/// Follows the successors of the vehicle's lane. For a vehicle on no lane there is no end.
static bool end_ahead(const world* world, const world_vehicle* vehicle)
{
    static const uint32_t LANES_MAX = 256; // ends the loop on a ring of very short lanes
    const verge_vehicle*  own = &vehicle->state;
    int32_t lane = vehicle->lane;
    double  left = STANDING_VIEW;
    for (uint32_t i = 0; i < LANES_MAX && lane != VERGE_NO_LANE && left >= 0.0; ++i) {
        left -= verge_road_length(world->road, lane);
        if (i == 0) {
            left += verge_road_project_on(world->road, lane, own->x, own->y).s;
        }
        lane = verge_road_next(world->road, lane, own->target_lane);
        if (lane == VERGE_NO_LANE && left >= 0.0) {
            return true;
        }
    }
    return false;
}
