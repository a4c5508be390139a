/// The input of all stages: a road and the vehicles on it at one instant.
///
///     verge_vehicle vehicles[9];
///     verge_lane_position positions[9];
///     verge_scene scene = verge_scene_make(road, vehicles, positions, 9);
///     verge_scene_place(&scene, utime, heard, heard_count, NULL);
#ifndef VERGE_SCENE_H
#define VERGE_SCENE_H

#include "verge/def.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The arrays are the caller's.
typedef struct verge_scene {
    const verge_road*    road;
    int64_t              utime;         ///< [us] instant of all states
    uint32_t             vehicle_count;
    uint32_t             vehicles_max;  ///< length of both arrays
    verge_vehicle*       vehicles;      ///< ascending ids
    /// Where vehicles[i] is. lane_id VERGE_NO_LANE: on no lane, or heading against every lane there;
    /// such a vehicle takes no part in the decision and is predicted straight ahead.
    verge_lane_position* positions;
} verge_scene;

/// A scene without vehicles, in arrays of vehicles_max elements that outlive it.
static inline verge_scene verge_scene_make(const verge_road* road, verge_vehicle* vehicles,
                                           verge_lane_position* positions, uint32_t vehicles_max)
{
    verge_scene scene;
    scene.road = road;
    scene.utime = 0;
    scene.vehicle_count = 0;
    scene.vehicles_max = vehicles_max;
    scene.vehicles = vehicles;
    scene.positions = positions;
    return scene;
}

/// Fills utime, vehicles and positions: checks the vehicles, orders them by id and finds the lane of
/// each. Where lanes overlap (merges, diverges) the lane is the one the vehicle drives along: the
/// lane it had in `before`, else the lane that continues it towards its target, else one that can
/// lead to the target. before: the scene one step ago, or null; a scene of its own arrays.
/// vehicles: any order; not the scene's own array.
/// @retval VERGE_ERR_CAPACITY, VERGE_ERR_VEHICLE, VERGE_ERR_DUPLICATE  vehicle_count is 0
verge_status verge_scene_place(verge_scene* scene, int64_t utime, const verge_vehicle* vehicles,
                               uint32_t vehicle_count, const verge_scene* before);

/// Index of a vehicle in the scene, -1 if it is not there.
int32_t verge_scene_find(const verge_scene* scene, int32_t vehicle_id);

/// Is this vehicle acceptable to verge_scene_place(), on its own?
/// @retval VERGE_ERR_VEHICLE   a value out of range
/// @retval VERGE_ERR_OFF_ROAD  its centre lies on no lane: not an error for verge_scene_place()
verge_status verge_road_check_vehicle(const verge_road* road, const verge_vehicle* vehicle);

/// Do two vehicles' bodies (oriented rectangles grown by their margins, trailers included) touch?
bool verge_vehicles_overlap(const verge_vehicle* a, const verge_vehicle* b);
/// Smallest distance between two bodies [m]; 0 where they touch.
double verge_vehicles_distance(const verge_vehicle* a, const verge_vehicle* b);

#ifdef __cplusplus
}
#endif

#endif
