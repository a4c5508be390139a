/// The state message of a simulated vehicle, for verge-publish and for verge-replay.
#ifndef VERGE_APPS_STATE_MESSAGE_H
#define VERGE_APPS_STATE_MESSAGE_H

#include "verge/transport.h"
#include "verge/types.h"

/// utime: [us] of the state. followed_cycle: that of the plan it follows, -1: none. The habit is
/// the preset with the vehicle's cooperation, or normal if there is none.
verge_vehicle_state_t state_message(const verge_vehicle* vehicle, int64_t utime, int32_t sequence,
                                    int32_t followed_cycle);

#endif
