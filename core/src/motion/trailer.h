/// Trailers of articulated vehicles. A trailer has a track of its own, after the tracks of the
/// vehicles. For other vehicles it is one more body.
#ifndef VG_MOTION_TRAILER_H
#define VG_MOTION_TRAILER_H

#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Index of the track of a vehicle's trailer, or of the vehicle itself where it has none.
static inline uint32_t vg_trailer_of(const verge_tracks* tracks, uint32_t own)
{
    const uint32_t trailer = tracks->of[own].trailer;
    return trailer == 0 ? own : trailer;
}

/// Adds a track for each trailer, which follows the track of its vehicle.
void vg_trailers_predict(verge_tracks* tracks, const verge_vehicle* vehicles,
                         uint32_t vehicle_count, uint32_t points);

/// Sets the track of a trailer at instant 0: as measured, else straight behind the tractor.
void vg_trailer_start(const verge_vehicle* vehicle, const verge_body* body,
                      const verge_track* tractor, verge_track* trailer);

/// Computes instants start + 1 .. last of a trailer that follows the track of its tractor.
void vg_trailer_follow(const verge_body* body, const verge_track* tractor, verge_track* trailer,
                       uint32_t start, uint32_t last);

#ifdef __cplusplus
}
#endif

#endif
