/// See standing.h.
#include "standing.h"

#include <math.h>

static bool traffic_near(const world* world, const world_vehicle* vehicle);
static bool stop_ahead(const world* world, const world_vehicle* vehicle);
static bool body_at(const world* world, const world_vehicle* vehicle, const verge_vehicle* probe);
static bool signal_stops(const world* world, int32_t lane);

bool standing_without_cause(const world* world, const world_vehicle* vehicle)
{
    return vehicle->present && fabs(vehicle->state.speed) < STANDING_SPEED &&
           !traffic_near(world, vehicle) && !stop_ahead(world, vehicle);
}

static bool traffic_near(const world* world, const world_vehicle* vehicle)
{
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* other = &world->vehicles[i];
        const double away = hypot(other->state.x - vehicle->state.x,
                                  other->state.y - vehicle->state.y);
        if (other != vehicle && other->present && away <= STANDING_VIEW &&
            fabs(other->state.speed) >= STANDING_SPEED) {
            return true;
        }
    }
    return false;
}

/// Goes along the lanes ahead of the vehicle, metre by metre, to a body, a signal or the end of the
/// road. On no lane: straight on.
static bool stop_ahead(const world* world, const world_vehicle* vehicle)
{
    const verge_vehicle* own = &vehicle->state;
    const double         way = STANDING_WAY + 0.5 * own->length;
    int32_t              lane = vehicle->lane;
    const verge_lane_position at = verge_road_project_on(world->road, lane, own->x, own->y);
    double               s = at.s;
    verge_vehicle        probe = verge_vehicle_default();
    probe.length = probe.width = own->width + 0.4;
    for (double gone = 0.0; gone <= way; gone += 1.0, s += 1.0) {
        if (lane == VERGE_NO_LANE) {
            probe.x = own->x + gone * cos(own->heading);
            probe.y = own->y + gone * sin(own->heading);
        } else {
            while (s > verge_road_length(world->road, lane)) {
                const int32_t next = verge_road_next(world->road, lane, own->target_lane);
                if (signal_stops(world, lane) || next == VERGE_NO_LANE) {
                    return next != VERGE_NO_LANE || !world_dead_end(world, lane);
                }
                s -= verge_road_length(world->road, lane);
                lane = next;
            }
            (void)verge_road_at(world->road, lane, s, at.d, &probe.x, &probe.y, &probe.heading);
        }
        if (body_at(world, vehicle, &probe)) {
            return true;
        }
    }
    return false;
}

static bool body_at(const world* world, const world_vehicle* vehicle, const verge_vehicle* probe)
{
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* other = &world->vehicles[i];
        if (other != vehicle && other->present &&
            verge_vehicles_overlap(probe, &other->state)) {
            return true;
        }
    }
    return false;
}

static bool signal_stops(const world* world, int32_t lane)
{
    for (uint32_t i = 0; i < world->signal_count; ++i) {
        if (world->signals[i].lane_id == lane) {
            return world->signals[i].state == VERGE_SIGNAL_RED ||
                   world->signals[i].state == VERGE_SIGNAL_YELLOW;
        }
    }
    return false;
}
