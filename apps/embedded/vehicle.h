/// What surrounds the planner in a vehicle: map, radio and controller. vehicle.c stands in for them
/// with a small scene; replace it.
#ifndef VEHICLE_H
#define VEHICLE_H

#include <verge/verge.h>

enum { VEHICLES = 9, LANES = 3, CYCLE_US = 100000 };
#define LANE_WIDTH 3.5 // [m]

/// The map. Valid for the life of the program.
verge_road_def vehicle_road(void);

/// The own vehicle, first, and its neighbours, one cycle after the last call.
void vehicle_receive(verge_vehicle heard[VEHICLES]);

/// Hands the plan to the controller.
void vehicle_drive(const verge_vehicle_plan* plan);

/// What drivers do at the beginning of a cycle: sets vehicles, or their accelerations. follow.c:
/// one drive with a stop. dense.c: random scenes, to look for cycles that take long.
void traffic_change(verge_vehicle vehicles[VEHICLES], int cycle);

#endif
