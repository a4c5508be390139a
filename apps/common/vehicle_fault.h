/// A vehicle's fault in words, for error messages and logs.
///
///     verge_vehicle_fault fault;
///     if (verge_road_check_vehicle(road, &vehicle, &fault) == VERGE_ERR_VEHICLE) {
///         char words[VEHICLE_FAULT_SIZE];
///         vehicle_fault_text(&fault, words);  // "speed is 71 m/s, expected 0 to 70 m/s"
#ifndef VERGE_APPS_VEHICLE_FAULT_H
#define VERGE_APPS_VEHICLE_FAULT_H

#include "verge/limits.h"

enum { VEHICLE_FAULT_SIZE = 160 }; ///< [B]

/// fault->field: not null.
void vehicle_fault_text(const verge_vehicle_fault* fault, char words[VEHICLE_FAULT_SIZE]);

#endif
