/// What a vehicle is told when its cycle runs out of time and no plan of it is left: brake.
///
/// Every tick sends something for every vehicle that is being planned for (cycle_overrun()): what
/// is left of its last plan, see wire_plan_rest(), or this. Both carry VERGE_REASON_OVERRUN.
#ifndef VERGE_RSU_OVERRUN_H
#define VERGE_RSU_OVERRUN_H

#include "verge/verge.h"
#include "verge/wire.h"

/// [m/s^2] The gentlest with which the planner's own fallback brakes: nobody has looked who
/// follows.
#define OVERRUN_BRAKING 3.0

enum { OVERRUN_DT_MS = 100 };

/// Brakes to standstill along the lane and its continuation, straight ahead where there is none,
/// from the vehicle's state now; its first point is that state. header->valid_until_utime is set
/// to the trajectory's end. Looks at the road alone, never at other vehicles, and takes
/// microseconds. The road is only read: a planning step may be under way.
verge_vehicle_plan_t overrun_brake(const wire_plan_header* header, const verge_vehicle* now,
                                   const verge_road* road);

#endif
