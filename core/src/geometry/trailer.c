/// See trailer.h.
#include "geometry/trailer.h"

#include "base/contract.h"
#include "base/scalar.h"

typedef struct point {
    double x, y;
} point;

static point hitch_between(const verge_body* body, const vg_rectangle* from,
                           const vg_rectangle* to, double share);
static void turn(double angle, double* cosine, double* sine);

vg_rectangle vg_trailer_at(const verge_body* body, const vg_rectangle* tractor, double cosine,
                           double sine)
{
    const point hitch = hitch_between(body, tractor, tractor, 0.0);
    const double middle = body->trailer_front - 0.5 * body->trailer_length; // ahead of the hitch
    return (vg_rectangle){ hitch.x + middle * cosine, hitch.y + middle * sine, cosine, sine,
                           0.5 * body->trailer_length, 0.5 * body->trailer_width };
}

void vg_trailer_pull(const verge_body* body, const vg_rectangle* from, const vg_rectangle* to,
                     double* cosine, double* sine)
{
    VERGE_ASSERT(body->trailer_axle > 0.0);
    point before = hitch_between(body, from, to, 0.0);
    for (uint32_t part = 1; part <= VG_TRAILER_PARTS; ++part) {
        const point now = hitch_between(body, from, to, (double)part / VG_TRAILER_PARTS);
        const double x = now.x - before.x, y = now.y - before.y;
        // The midpoint rule: the rate of the heading half-way, from the rate at the start.
        double c = *cosine, s = *sine;
        turn(0.5 * (c * y - s * x) / body->trailer_axle, &c, &s);
        turn((c * y - s * x) / body->trailer_axle, cosine, sine);
        before = now;
    }
}

static point hitch_between(const verge_body* body, const vg_rectangle* from,
                           const vg_rectangle* to, double share)
{
    const double c = from->cos_heading + share * (to->cos_heading - from->cos_heading);
    const double s = from->sin_heading + share * (to->sin_heading - from->sin_heading);
    const double back = body->hitch / vg_max(vg_sqrt(c * c + s * s), 1e-9);
    return (point){ from->x + share * (to->x - from->x) - back * c,
                    from->y + share * (to->y - from->y) - back * s };
}

/// Turns a unit vector by a small angle, to the third order; it stays a unit vector.
static void turn(double angle, double* cosine, double* sine)
{
    const double w = vg_clamp(angle, -1.0, 1.0);
    const double dc = 1.0 - 0.5 * w * w, ds = w - w * w * w / 6.0;
    const double c = *cosine * dc - *sine * ds, s = *sine * dc + *cosine * ds;
    const double norm = 1.0 / vg_sqrt(c * c + s * s);
    *cosine = c * norm;
    *sine = s * norm;
}
