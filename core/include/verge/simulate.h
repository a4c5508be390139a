/// For simulators: moves the uncontrolled vehicles of a scene, by the model that predicts them.
#ifndef VERGE_SIMULATE_H
#define VERGE_SIMULATE_H

#include "verge/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct verge_humans verge_humans;

/// Size of the memory for verge_humans_init() [B]; 0 if the def is not valid. It grows with
/// vehicles_max and road.lane_count (def.h).
size_t verge_humans_memory_size(const verge_planner_def* def);
/// Builds the model in the caller's memory, which must be aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_CONFIG, VERGE_ERR_MEMORY  *humans is null
verge_status verge_humans_init(verge_humans** humans, const verge_planner_def* def, void* memory,
                               size_t size);
/// The rules of the road for humans. Zero-filled: there are no signals, and all keep the rules.
typedef struct verge_human_rules {
    const verge_signal* signals;      ///< as those of a scene: ascending lane ids
    uint32_t            signal_count;
    const int32_t*      lawless_ids;  ///< humans that yield to nobody and pass red signals
    uint32_t            lawless_count;
} verge_human_rules;

/// Moves every uncontrolled vehicle by dt [s], 0 < dt <= 1. A vehicle on the road follows the
/// vehicle ahead in its lane by the IDM; its desired speed is the speed limit. The vehicle ahead
/// may be a controlled one. It stops at red signals, by what they show and not by when that
/// changes, and at stop signs (VERGE_PRIORITY_STOP) for 1 s. In a conflict area the vehicle that
/// comes first goes first, or the one with priority (verge_lane_def.priority); the others wait
/// before it.
/// A vehicle off the road, or with a value that verge_scene_place() rejects, moves straight ahead.
/// Controlled vehicles are not changed. vehicles: in any order. rules: null stands for zero-filled
/// ones; read until the call returns.
/// @retval VERGE_ERR_CAPACITY  more vehicles, or controlled vehicles, than the def holds
/// @retval VERGE_ERR_DEF       dt is out of range
/// @retval VERGE_ERR_ARGUMENT  a null pointer, or signals that are not as scene.h says; in all
///                             three no vehicle is moved
verge_status verge_humans_advance(verge_humans* humans, const verge_road* road,
                                  const verge_human_rules* rules, verge_vehicle* vehicles,
                                  uint32_t vehicle_count, double dt);

/// Heading of the trailer [rad] after an articulated vehicle moved from `before`, where its heading
/// was before->trailer_heading, to `after`. The time between both should be some tenths of a second
/// at most. For a vehicle without a trailer: after->trailer_heading.
double verge_vehicle_trailer_heading(const verge_vehicle* before, const verge_vehicle* after);

#ifdef __cplusplus
}
#endif

#endif
