/// What surrounds the planner in a vehicle: map, radio and controller. vehicle.c stands in for them
/// with a small scene; replace it.
#ifndef VEHICLE_H
#define VEHICLE_H

#include <verge/verge.h>

enum { VEHICLES = 9, LANES = 3, CYCLE_US = 100000 };

/// The map. Valid for the life of the program.
verge_road_def vehicle_road(void);

/// The own vehicle, first, and its neighbours, one cycle after the last call.
void vehicle_receive(verge_vehicle heard[VEHICLES]);

/// The decision of the own vehicle: it stays in its lane and keeps a time gap to the one ahead.
void vehicle_decide(const verge_scene* scene, verge_decision* decision);

/// Hands the plan to the controller.
void vehicle_drive(const verge_vehicle_plan* plan);

#endif
