/// Oriented bodies: do they touch, how far are they apart.
#ifndef VG_RECTANGLE_H
#define VG_RECTANGLE_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_rectangle {
    double x, y;                     ///< [m] centre
    double cos_heading, sin_heading; ///< [1]
    double half_length, half_width;  ///< [m]
} vg_rectangle;

/// Touching counts as overlap. Exact (separating axes), no trigonometry.
bool   vg_rectangle_overlap(const vg_rectangle* a, const vg_rectangle* b);
/// [m] 0 where they overlap.
double vg_rectangle_distance(const vg_rectangle* a, const vg_rectangle* b);

#ifdef __cplusplus
}
#endif

#endif
