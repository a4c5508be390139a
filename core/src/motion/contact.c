/// See contact.h. A circle test excludes most pairs; for the others a step is divided into parts.
#include "motion/contact.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "motion/trailer.h"

static bool step_is_far(const verge_track* a, const verge_track* b, double clearance, uint32_t k);
static bool step_touches(const verge_track* a, const verge_track* b, double clearance, uint32_t k);
static double turn_of(const verge_track* track, uint32_t k);
static vg_rectangle body_between(const verge_track* track, uint32_t k, double share);

uint32_t vg_contact_first(const verge_track* a, const verge_track* b, double clearance,
                          uint32_t from, uint32_t to)
{
    VERGE_ASSERT(to < VERGE_POINTS_MAX);
    for (uint32_t k = from + 1; k <= to; ++k) {
        if (!step_is_far(a, b, clearance, k) && step_touches(a, b, clearance, k)) {
            return k;
        }
    }
    return to + 1;
}

bool vg_contact_at(const verge_track* a, const verge_track* b, double clearance, uint32_t k)
{
    VERGE_ASSERT(k < VERGE_POINTS_MAX);
    vg_rectangle body = body_between(a, k, 1.0);
    const vg_rectangle other = body_between(b, k, 1.0);
    body.half_length += clearance;
    body.half_width += clearance;
    return vg_rectangle_overlap(&body, &other);
}

uint32_t vg_contact_new(const verge_track* a, const verge_track* b, double clearance, uint32_t to)
{
    VERGE_ASSERT(to < VERGE_POINTS_MAX);
    if (!vg_contact_at(a, b, clearance, 0)) {
        return vg_contact_first(a, b, clearance, 0, to);
    }
    uint32_t apart = 0;
    while (apart <= to && vg_contact_at(a, b, 0.0, apart)) {
        ++apart;
    }
    return apart > to ? to + 1 : vg_contact_first(a, b, 0.0, apart, to);
}

bool verge_tracks_contact(const verge_tracks* tracks, uint32_t own, uint32_t points,
                          double clearance, uint32_t* other, uint32_t* instant)
{
    if (tracks == NULL || own >= tracks->count || points < 1 || points > VERGE_POINTS_MAX) {
        return false;
    }
    const verge_track* body = &tracks->of[own];
    const uint32_t trailer = vg_trailer_of(tracks, own);
    uint32_t first = points, met = 0;
    for (uint32_t j = 0; j < tracks->count; ++j) {
        if (j == own || j == trailer) {
            continue;
        }
        const verge_track* at = &tracks->of[j];
        const uint32_t k = vg_contact_at(body, at, clearance, 0)
                               ? 0 : vg_contact_first(body, at, clearance, 0, points - 1u);
        if (k < first) {
            first = k;
            met = j;
        }
    }
    if (first == points) {
        return false;
    }
    if (other != NULL) {
        *other = met;
    }
    if (instant != NULL) {
        *instant = first;
    }
    return true;
}

/// The coarse filter: circles around both bodies and around their motion in the step.
static bool step_is_far(const verge_track* a, const verge_track* b, double clearance, uint32_t k)
{
    const double x = b->x[k] - a->x[k], y = b->y[k] - a->y[k];
    const double x0 = b->x[k - 1] - a->x[k - 1], y0 = b->y[k - 1] - a->y[k - 1];
    const double reach = a->half_length + a->half_width + b->half_length + b->half_width
                       + 2.0 * clearance + vg_abs(x - x0) + vg_abs(y - y0);
    return x * x + y * y > reach * reach;
}

static bool step_touches(const verge_track* a, const verge_track* b, double clearance, uint32_t k)
{
    // `grow` includes half of the relative motion in one part, that of the corners included.
    const double x = (b->x[k] - b->x[k - 1]) - (a->x[k] - a->x[k - 1]);
    const double y = (b->y[k] - b->y[k - 1]) - (a->y[k] - a->y[k - 1]);
    const double motion = vg_sqrt(x * x + y * y) + turn_of(a, k) + turn_of(b, k);
    const double grow = clearance + 0.5 * motion / VG_CONTACT_PARTS;
    for (uint32_t part = 0; part <= VG_CONTACT_PARTS; ++part) {
        const double share = (double)part / VG_CONTACT_PARTS;
        vg_rectangle body = body_between(a, k, share);
        const vg_rectangle other = body_between(b, k, share);
        body.half_length += grow;
        body.half_width += grow;
        if (vg_rectangle_overlap(&body, &other)) {
            return true;
        }
    }
    return false;
}

/// Upper bound of the distance that a corner moves by turning in the step. [m]
static double turn_of(const verge_track* track, uint32_t k)
{
    return (track->half_length + track->half_width)
         * (vg_abs(track->cos_heading[k] - track->cos_heading[k - 1])
            + vg_abs(track->sin_heading[k] - track->sin_heading[k - 1]));
}

/// The body at a share of the step from sample k - 1 to sample k.
static vg_rectangle body_between(const verge_track* track, uint32_t k, double share)
{
    const uint32_t j = k > 0 ? k - 1 : 0;
    const double* cosine = track->cos_heading;
    const double* sine = track->sin_heading;
    const double c = cosine[j] + share * (cosine[k] - cosine[j]);
    const double s = sine[j] + share * (sine[k] - sine[j]);
    const double norm = 1.0 / vg_max(vg_sqrt(c * c + s * s), 1e-9);
    return (vg_rectangle){ track->x[j] + share * (track->x[k] - track->x[j]),
                           track->y[j] + share * (track->y[k] - track->y[j]), c * norm, s * norm,
                           track->half_length, track->half_width };
}
