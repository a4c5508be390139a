/// A smooth line in the plane: one C2 cubic spline for x and one for y, through knots at equal
/// distances. Reference lines of lanes and reference paths of trajectories are such lines. The
/// owner of a line holds its knots. Beyond both ends the line continues straight.
#ifndef VG_LINE_H
#define VG_LINE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_line {
    const double *x, *y;     ///< [m] of the knots
    const double *xss, *yss; ///< [1/m] second derivatives by s at the knots
    uint32_t knot_count;     ///< 2 or more
    double   knot_spacing;   ///< [m]
    double   start;          ///< [m] coordinate s of knot 0
} vg_line;

/// The line at one coordinate.
typedef struct vg_reference {
    double x, y;                     ///< [m]
    double cos_heading, sin_heading; ///< [1]
    double curvature;                ///< [1/m]
    double curvature_rate;           ///< [1/m^2] d curvature / ds
} vg_reference;

/// The line at s, which must be finite. [m]
vg_reference vg_line_at(const vg_line* line, double s);

/// Coordinate of the line's point nearest to (x, y), to 1e-12 m. s_guess: where the search
/// starts; NaN: the whole line is searched.
double vg_line_project(const vg_line* line, double x, double y, double s_guess);

/// The same, with a search of the whole line. It is faster if s_hint is near the result. s_hint
/// must not be NaN.
double vg_line_project_whole(const vg_line* line, double x, double y, double s_hint);

/// Distance from the line's point `at` to (x, y) along the direction of the line there. [m]
static inline double vg_ahead_of(const vg_reference* at, double x, double y)
{
    return (x - at->x) * at->cos_heading + (y - at->y) * at->sin_heading;
}

/// Distance from the line's point `at` to (x, y) to the left of the direction of the line there.
/// [m]
static inline double vg_left_of(const vg_reference* at, double x, double y)
{
    return (y - at->y) * at->cos_heading - (x - at->x) * at->sin_heading;
}

/// Second derivatives of the C2 cubic spline through value[0 .. count), count >= 4. h[i] is the
/// distance of knots i and i + 1. slopes: first derivatives at both ends; null: the third
/// derivative is the same in the two intervals at each end. work: memory for count doubles.
void vg_spline_solve(const double* value, const double* h, uint32_t count, const double* slopes,
                     double* second, double* work);

#ifdef __cplusplus
}
#endif

#endif
