/// The reference line of one trajectory.
#ifndef VG_PATH_H
#define VG_PATH_H

#include "road/road.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A smooth reference path for one vehicle's trajectory: a lane, the lanes before it and the
/// lanes that continue it, joined into one C2 spline. Beyond the last lane it continues straight.
enum { VG_PATH_KNOTS_MAX = 640 };
typedef struct vg_path {
    uint32_t knot_count, knots_max;
    double   knot_spacing;         ///< [m] uniform
    double   start;                ///< [m] path coordinate of knot 0; < 0: before the anchor lane
    double  *x, *y, *xss, *yss;    ///< [knots_max] of the arena
    double  *h, *work;             ///< [knots_max] of the arena, while the spline is fitted
    uint32_t anchor;               ///< lane index; on this lane the path coordinate is its s
} vg_path;

/// Takes the arrays of two paths of up to knots_max knots each, 8 .. VG_PATH_KNOTS_MAX. They share
/// h and work, so one path is built at a time.
void vg_paths_take(vg_path paths[2], vg_arena* arena, uint32_t knots_max);

/// Path along `lane` (index) towards `target` (index or -1), covering [s_from, s_to] of the lane's
/// s, which may lie before its start or beyond its end. Cut to what fits; s_to - s_from <= 600.
void vg_path_build(vg_path* path, const struct verge_road* road, uint32_t lane, int32_t target,
                   double s_from, double s_to);

static inline vg_line vg_path_line(const vg_path* path)
{
    return (vg_line){ path->x, path->y, path->xss, path->yss, path->knot_count, path->knot_spacing,
                      path->start };
}
/// The path at s; straight beyond its ends.
static inline vg_reference vg_path_at(const vg_path* path, double s)
{
    const vg_line line = vg_path_line(path);
    return vg_line_at(&line, s);
}
static inline double vg_path_project(const vg_path* path, double x, double y, double s_guess)
{
    const vg_line line = vg_path_line(path);
    return vg_line_project(&line, x, y, s_guess);
}

#ifdef __cplusplus
}
#endif

#endif
