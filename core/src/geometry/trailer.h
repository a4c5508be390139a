/// A semitrailer behind its tractor: where its rectangle is, and how it turns.
///
/// The hitch moves with the tractor; the trailer's axle does not slip. With u the trailer's
/// direction and h the hitch,
///     d(heading) / dt = (u x dh / dt) / trailer_axle,
/// which is v / L sin(heading of the tractor - heading) for a hitch above the rear axle.
#ifndef VG_TRAILER_H
#define VG_TRAILER_H

#include "geometry/rectangle.h"
#include "verge/body.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Sub-steps of one pull. At 0.1 s and 20 m/s the hitch moves 0.2 m in each.
enum { VG_TRAILER_PARTS = 10 };

/// The trailer's rectangle behind a tractor, for a heading of the trailer (cosine, sine).
vg_rectangle vg_trailer_at(const verge_body* body, const vg_rectangle* tractor, double cosine,
                           double sine);

/// Turns the trailer while the tractor moves from one pose to the next, a short time later. Its
/// position and heading vector change linearly.
void vg_trailer_pull(const verge_body* body, const vg_rectangle* from, const vg_rectangle* to,
                     double* cosine, double* sine);

#ifdef __cplusplus
}
#endif

#endif
