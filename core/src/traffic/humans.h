/// Lane keeping (KL) of uncontrolled vehicles: they follow the nearest vehicle in their path by the
/// Intelligent Driver Model (IDM, Treiber 2000).
#ifndef VG_HUMANS_H
#define VG_HUMANS_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

/// State of every uncontrolled slot after dt [s]: station_to [m], v_to [m/s], y_to [m].
void vg_flow_human_moves(const vg_model* model, const vg_flow* flow, float dt, float* station_to,
                         float* v_to, float* y_to);

/// Acceleration of an uncontrolled slot at speed v behind a vehicle at this free gap and speed.
/// [m/s^2]
float vg_human_acceleration(const vg_model* model, uint32_t slot, float v, float gap, float v_lead);
/// The same of one that wants no speed of its own: what the vehicle ahead asks for alone.
float vg_human_following(const vg_model* model, uint32_t slot, float v, float gap, float v_lead);

#ifdef __cplusplus
}
#endif

#endif
