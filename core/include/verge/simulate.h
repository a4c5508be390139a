/// For simulators: the humans of a scene, moved by the model that predicts them.
#ifndef VERGE_SIMULATE_H
#define VERGE_SIMULATE_H

#include "verge/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct verge_humans verge_humans;

/// Bytes verge_humans_init() needs; 0 where the def is not valid. Grows with vehicles_max.
size_t verge_humans_memory_size(const verge_planner_def* def);
/// memory: aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_MEMORY  *humans is null
verge_status verge_humans_init(verge_humans** humans, const verge_planner_def* def, void* memory,
                               size_t size);
/// Moves every uncontrolled vehicle on by dt [s], 0 < dt <= 1: in its lane by the IDM, wanting to
/// drive at the limit, behind the vehicle ahead, which may be controlled; off the road, and where a
/// value is out of the range of verge_scene_place(), straight on. Controlled vehicles are left as
/// they are. vehicles: any order.
/// @retval VERGE_ERR_CAPACITY  more vehicles, or controlled vehicles, than the def holds
/// @retval VERGE_ERR_DEF       dt is out of range; in both no vehicle is moved
verge_status verge_humans_advance(verge_humans* humans, const verge_road* road, verge_vehicle* vehicles,
                                  uint32_t vehicle_count, double dt);

/// Heading of an articulated vehicle's trailer [rad] after the vehicle moved from `before`, with
/// its trailer_heading, to `after`; at most some tenths of a second should lie between both. Of other
/// vehicles `after`'s own.
double verge_vehicle_trailer_heading(const verge_vehicle* before, const verge_vehicle* after);

#ifdef __cplusplus
}
#endif

#endif
