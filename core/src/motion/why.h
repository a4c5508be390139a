/// Why a vehicle stands or makes no lane change, where the decision did not say it, and what is new
/// in a plan. From the scene alone: who is ahead, what ends, who is in or near an area ahead.
#ifndef VG_WHY_H
#define VG_WHY_H

#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Completes plan->why of vehicles[own], whose trajectory is planned. A vehicle that stands within
/// the next second always has a reason; one that the decision gave stays.
void vg_why_fill(const verge_scene* scene, uint32_t own, verge_vehicle_plan* plan);

/// Sets plan->changed. before: the vehicle's last plan, or null.
void vg_why_compare(verge_vehicle_plan* plan, const verge_vehicle_plan* before);

#ifdef __cplusplus
}
#endif

#endif
