/// Separating axes for the question whether, corners against sides for the question how far.
#include "rectangle.h"

#include "contract.h"
#include "scalar.h"

#include <stddef.h>

/// Does one of a's two axes separate a from b?
static bool axis_separates(const vg_rectangle* a, const vg_rectangle* b);
/// Smallest distance of b's corners to a, squared. [m^2]
static double corners_to_body(const vg_rectangle* a, const vg_rectangle* b);

bool vg_rectangle_overlap(const vg_rectangle* a, const vg_rectangle* b)
{
    VERGE_ASSERT(a != NULL && b != NULL);
    return !axis_separates(a, b) && !axis_separates(b, a);
}

double vg_rectangle_distance(const vg_rectangle* a, const vg_rectangle* b)
{
    if (vg_rectangle_overlap(a, b)) {
        return 0.0;
    }
    // Two convex bodies apart are closest at a corner of one of them.
    return vg_sqrt(vg_min(corners_to_body(a, b), corners_to_body(b, a)));
}

static bool axis_separates(const vg_rectangle* a, const vg_rectangle* b)
{
    const double dx = b->x - a->x;
    const double dy = b->y - a->y;
    const double along = vg_abs(dx * a->cos_heading + dy * a->sin_heading);
    const double across = vg_abs(dy * a->cos_heading - dx * a->sin_heading);
    const double cosine = vg_abs(a->cos_heading * b->cos_heading + a->sin_heading * b->sin_heading);
    const double sine = vg_abs(a->cos_heading * b->sin_heading - a->sin_heading * b->cos_heading);

    const double reach_along = b->half_length * cosine + b->half_width * sine;
    const double reach_across = b->half_length * sine + b->half_width * cosine;
    return along > a->half_length + reach_along || across > a->half_width + reach_across;
}

static double corners_to_body(const vg_rectangle* a, const vg_rectangle* b)
{
    double nearest = VG_HUGE;
    for (int corner = 0; corner < 4; ++corner) {
        const double l = (corner & 1) != 0 ? b->half_length : -b->half_length;
        const double w = (corner & 2) != 0 ? b->half_width : -b->half_width;
        const double dx = b->x + l * b->cos_heading - w * b->sin_heading - a->x;
        const double dy = b->y + l * b->sin_heading + w * b->cos_heading - a->y;
        const double along = vg_abs(dx * a->cos_heading + dy * a->sin_heading);
        const double across = vg_abs(dy * a->cos_heading - dx * a->sin_heading);
        const double beyond_along = vg_max(along - a->half_length, 0.0);
        const double beyond_across = vg_max(across - a->half_width, 0.0);
        nearest = vg_min(nearest, beyond_along * beyond_along + beyond_across * beyond_across);
    }
    return nearest;
}
