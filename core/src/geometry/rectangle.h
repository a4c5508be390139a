/// Overlap and distance of oriented rectangles.
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

/// True if two rectangles overlap or touch. Exact (separating axes), no trigonometry.
bool   vg_rectangle_overlap(const vg_rectangle* a, const vg_rectangle* b);
/// Smallest distance of two rectangles [m]; 0 if they overlap.
double vg_rectangle_distance(const vg_rectangle* a, const vg_rectangle* b);

#ifdef __cplusplus
}
#endif

#endif
