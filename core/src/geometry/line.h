/// A smooth line in the plane: one C2 cubic spline for x and one for y, through knots at equal
/// distances. Lanes and the reference paths of trajectories are such lines; the owner of a line
/// holds its knots. Beyond both ends the line goes straight on.
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

/// s finite.
vg_reference vg_line_at(const vg_line* line, double s);

/// Coordinate of the line's point nearest to (x, y), to 1e-12 m. s_guess: where the search
/// starts; NaN: the whole line is searched.
double vg_line_project(const vg_line* line, double x, double y, double s_guess);

/// The same over the whole line; the nearer s_hint is to the answer, the faster. Not NaN.
double vg_line_project_whole(const vg_line* line, double x, double y, double s_hint);

/// [m] from the line's point `at` to (x, y), along the line's direction there.
static inline double vg_ahead_of(const vg_reference* at, double x, double y)
{
    return (x - at->x) * at->cos_heading + (y - at->y) * at->sin_heading;
}

/// [m] from the line's point `at` to (x, y), to the left of the line's direction there.
static inline double vg_left_of(const vg_reference* at, double x, double y)
{
    return (y - at->y) * at->cos_heading - (x - at->x) * at->sin_heading;
}

/// Second derivatives of the C2 cubic spline through value[0 .. count), with knots h[i] apart
/// (h[i] between i and i + 1; count >= 4). slopes: first derivatives at both ends, or null: there
/// the third derivative goes on as in the next interval. work: count doubles.
void vg_spline_solve(const double* value, const double* h, uint32_t count, const double* slopes,
                     double* second, double* work);

#ifdef __cplusplus
}
#endif

#endif
