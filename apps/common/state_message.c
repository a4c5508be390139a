/// See state_message.h.
#include "state_message.h"

#include "verge/verge.h"
#include "verge/wire.h"

#include <math.h>

static verge_habit_kind habit_kind_of(const verge_vehicle* vehicle)
{
    for (int kind = VERGE_AGGRESSIVE; kind <= VERGE_CONSERVATIVE; ++kind) {
        const double cooperation = verge_habit_of((verge_habit_kind)kind).cooperation;
        if (fabs(cooperation - vehicle->habit.cooperation) < 1e-9) {
            return (verge_habit_kind)kind;
        }
    }
    return VERGE_NORMAL;
}

verge_vehicle_state_t state_message(const verge_vehicle* vehicle, int64_t utime, int32_t sequence,
                                    int32_t followed_cycle)
{
    return wire_state_from_vehicle(vehicle, habit_kind_of(vehicle), utime, sequence,
                                   followed_cycle);
}
