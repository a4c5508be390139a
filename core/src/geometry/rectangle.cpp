/// Overlap by separating axes; distance from the corners of one rectangle to the other.
#include "geometry/rectangle.h"

#include "geometry/linear.hpp"
#include "base/scalar.h"

#include <stddef.h>

static Matrix2d frame_of(const vg_rectangle* body);
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
    // The smallest distance of two convex polygons that do not overlap is at a corner of one of
    // them.
    return vg_sqrt(vg_min(corners_to_body(a, b), corners_to_body(b, a)));
}

static bool axis_separates(const vg_rectangle* a, const vg_rectangle* b)
{
    const Matrix2d to_a = frame_of(a).transpose();
    const Vector2d between = to_a * Vector2d(b->x - a->x, b->y - a->y);
    const Matrix2d turned = to_a * frame_of(b); // the axes of b in the frame of a
    const Vector2d reach = turned.unaryExpr(&vg_abs) * Vector2d(b->half_length, b->half_width);
    return vg_abs(between.x()) > a->half_length + reach.x()
           || vg_abs(between.y()) > a->half_width + reach.y();
}

static double corners_to_body(const vg_rectangle* a, const vg_rectangle* b)
{
    const Matrix2d to_a = frame_of(a).transpose();
    const Matrix2d axes_b = frame_of(b);
    double nearest = VG_HUGE;
    for (int corner = 0; corner < 4; ++corner) {
        const double l = (corner & 1) != 0 ? b->half_length : -b->half_length;
        const double w = (corner & 2) != 0 ? b->half_width : -b->half_width;
        const Vector2d at = Vector2d(b->x, b->y) + l * axes_b.col(0) + w * axes_b.col(1);
        const Vector2d seen = to_a * (at - Vector2d(a->x, a->y));
        const Vector2d beyond(vg_max(vg_abs(seen.x()) - a->half_length, 0.0),
                              vg_max(vg_abs(seen.y()) - a->half_width, 0.0));
        nearest = vg_min(nearest, beyond.squaredNorm());
    }
    return nearest;
}

static Matrix2d frame_of(const vg_rectangle* body)
{
    return vg_frame(body->cos_heading, body->sin_heading);
}
