/// See trailer.h.
#include "motion/trailer.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "geometry/trailer.h"
#include "traffic/flow.h"

static vg_rectangle pose_at(const verge_track* track, uint32_t k);
static void put(verge_track* trailer, uint32_t k, const vg_rectangle* at, double speed);

void vg_trailers_predict(verge_tracks* tracks, const verge_vehicle* vehicles,
                         uint32_t vehicle_count, uint32_t points)
{
    VERGE_ASSERT(tracks->count == vehicle_count);
    for (uint32_t i = 0; i < vehicle_count; ++i) {
        tracks->of[i].trailer = 0;
        if (vg_body_count(&vehicles[i]) > 1) {
            VERGE_ASSERT(tracks->count < tracks->tracks_max);
            const verge_body body = verge_vehicle_body(&vehicles[i]);
            verge_track* trailer = &tracks->of[tracks->count];
            vg_trailer_start(&vehicles[i], &body, &tracks->of[i], trailer);
            vg_trailer_follow(&body, &tracks->of[i], trailer, 0, points - 1);
            tracks->of[i].trailer = tracks->count++;
        }
    }
}

void vg_trailer_start(const verge_vehicle* vehicle, const verge_body* body,
                      const verge_track* tractor, verge_track* trailer)
{
    const vg_rectangle pose = pose_at(tractor, 0);
    double c = pose.cos_heading, s = pose.sin_heading;
    if (vg_finite(vehicle->trailer_heading)) {
        vg_sincos(vehicle->trailer_heading, &s, &c);
    }
    const vg_rectangle at = vg_trailer_at(body, &pose, c, s);
    trailer->vehicle_id = vehicle->id;
    trailer->controlled = vehicle->controlled;
    trailer->trailer = 0;
    trailer->half_length = at.half_length + vehicle->margin;
    trailer->half_width = at.half_width + vehicle->margin;
    put(trailer, 0, &at, tractor->speed[0]);
}

void vg_trailer_follow(const verge_body* body, const verge_track* tractor, verge_track* trailer,
                       uint32_t start, uint32_t last)
{
    VERGE_ASSERT(last < VERGE_POINTS_MAX);
    double c = trailer->cos_heading[start], s = trailer->sin_heading[start];
    for (uint32_t k = start + 1; k <= last; ++k) {
        const vg_rectangle from = pose_at(tractor, k - 1), to = pose_at(tractor, k);
        vg_trailer_pull(body, &from, &to, &c, &s);
        const vg_rectangle at = vg_trailer_at(body, &to, c, s);
        put(trailer, k, &at, tractor->speed[k]);
    }
}

static vg_rectangle pose_at(const verge_track* track, uint32_t k)
{
    return (vg_rectangle){ track->x[k], track->y[k], track->cos_heading[k],
                           track->sin_heading[k], 0.0, 0.0 };
}

static void put(verge_track* trailer, uint32_t k, const vg_rectangle* at, double speed)
{
    trailer->x[k] = at->x;
    trailer->y[k] = at->y;
    trailer->cos_heading[k] = at->cos_heading;
    trailer->sin_heading[k] = at->sin_heading;
    trailer->speed[k] = speed;
}
