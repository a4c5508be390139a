/// The state message of a simulated vehicle: what verge-publish sends, and verge-replay sends again.
#ifndef VERGE_APPS_STATE_MESSAGE_H
#define VERGE_APPS_STATE_MESSAGE_H

#include "verge/transport.h"
#include "verge/types.h"

/// utime: [us] of the state. followed_cycle: of the plan it drives, -1 none. The habit is the
/// standard one with the vehicle's cooperation, normal where none has it.
verge_vehicle_state_t state_message(const verge_vehicle* vehicle, int64_t utime, int32_t sequence,
                                    int32_t followed_cycle);

#endif
