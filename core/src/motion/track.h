/// Where a body is believed to be at each trajectory instant: humans by lane keeping, controlled
/// vehicles along their decided actions and, once planned, along their trajectory.
#ifndef VG_TRACK_H
#define VG_TRACK_H

#include "geometry/rectangle.h"
#include "verge/planner.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_track {
    int32_t  vehicle_id;
    bool     controlled;
    double   half_length, half_width; ///< [m] grown by the vehicle's margin
    double   x[VERGE_POINTS_MAX], y[VERGE_POINTS_MAX];                     ///< [m] centre
    double   cos_heading[VERGE_POINTS_MAX], sin_heading[VERGE_POINTS_MAX]; ///< [1]
    double   speed[VERGE_POINTS_MAX];                                      ///< [m/s]
} vg_track;

/// All vehicles of the step, in the order of their ids; def->points instants def->point_s apart.
typedef struct vg_tracks {
    uint32_t count;
    vg_track of[VERGE_VEHICLES_MAX];
} vg_tracks;

#ifdef __cplusplus
}
#endif

#endif
