/// The plan of a vehicle whose cycle is late and whose last plan is over: it brakes.
///
/// At every tick each controlled vehicle gets a message (cycle_overrun()): the rest of its last
/// plan, see wire_plan_rest(), or this one. Both have VERGE_REASON_OVERRUN.
#ifndef VERGE_RSU_OVERRUN_H
#define VERGE_RSU_OVERRUN_H

#include "verge/verge.h"
#include "verge/wire.h"

/// [m/s^2] The lowest deceleration of the planner's own fallback, because following vehicles are
/// not checked here.
#define OVERRUN_BRAKING 3.0

enum { OVERRUN_DT_MS = 100 };

/// Brakes to standstill from the state `now`, which is the first point, along the lane and its
/// successors, or straight ahead if there is none. The message is valid until the last point. Uses
/// the road only, not other vehicles, and takes microseconds. The road is only read: a planning
/// step may be running.
verge_vehicle_plan_t overrun_brake(const wire_plan_header* header, const verge_vehicle* now,
                                   const verge_road* road);

#endif
