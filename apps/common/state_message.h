/// The messages of simulated vehicles and signals, for verge-publish and for verge-replay.
#ifndef VERGE_APPS_STATE_MESSAGE_H
#define VERGE_APPS_STATE_MESSAGE_H

#include "verge/transport.h"
#include "verge/scene.h"
#include "verge/trajectory.h"

/// utime: [us] of the state. followed_cycle: that of the plan it follows, -1: none. The habit is
/// the preset with the vehicle's cooperation, or normal if there is none. map_crc32: of its road.
verge_vehicle_state_t state_message(const verge_vehicle* vehicle, int64_t utime, int32_t sequence,
                                    int32_t followed_cycle, uint32_t map_crc32);

/// The message of a signal that shows this at utime [us].
verge_lane_signal_t signal_message(const verge_signal* signal, int64_t utime, uint32_t map_crc32);

/// The trajectory of an on-vehicle unit as a plan to drive: its points, and its present action until
/// their end. Quantities that the message lacks are NaN; utime is not set.
verge_vehicle_plan trajectory_plan(const verge_vehicle_trajectory_t* message);

#endif
