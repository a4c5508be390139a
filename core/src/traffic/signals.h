/// The traffic signals of a scene, for core. See scene.h.
#ifndef VG_SIGNALS_H
#define VG_SIGNALS_H

#include "verge/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Are the signals as scene.h says: of lanes of the road, in ascending order, values in range?
bool vg_signals_hold(const verge_road* road, const verge_signal* signals, uint32_t count);

/// Copies signals in the order of their lanes. Insertion sort: they are few and often sorted.
void vg_signals_sort(verge_signal* to, const verge_signal* from, uint32_t count);

/// The signals `seconds` later, as planner.h says.
void vg_signals_after(verge_signal* to, const verge_signal* from, uint32_t count, double seconds);

#ifdef __cplusplus
}
#endif

#endif
