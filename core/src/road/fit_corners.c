/// Where the fitted line leaves its survey by more than the tolerance: at corners that could not be
/// driven otherwise, and where a lane meets others at an angle.
///
/// A corner of turn t, smoothed over the length L, is passed inside its vertex at a distance
/// e = 2/3 sin(t/2) L, with the curvature 4/9 tan(t/2)^2 / e. A body that stays in the lane leaves
/// room for an e that grows with 1 / cos(t/2), and for a swing to the outside before and after it.
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

/// Radius that a corner is rounded to where the lane is wide enough: cars drive it at 4 m/s, and
/// it is above what vans need. [m]
static const double corner_radius = 8.0;
/// Radius of the arc by which a lane turns into the direction of the lane it meets. [m]
static const double seam_radius = 15.0;
/// [m] from a pose over which a lane may turn into its direction.
static const double seam_reach = 20.0;
/// Smoothing length at a pose: over a longer one the line would bend before it to meet it. [m]
static const double seam_smoothing = 6.0;
/// Body that has to stay in the lane while it cuts a corner, and its distance from the edge. [m]
static const double body_width = 2.0, body_margin = 0.3;
/// Over this length to each side of a corner the line swings out. [m]
static const double swing_length = 12.0;
/// Share of the swing that smoothing leaves (measured over corners of 60 to 120 degrees).
static const double swing_kept = 0.4;
/// Smoothing lengths to each side of a corner, within which the line leaves the chords to cut it.
static const double cut_reach = 4.0;
/// The formula for e is for small turns: it may be exceeded by a fifth.
static const double cut_slack = 1.2;
static const double turn_cosine_min = 0.2; // of half a turn: 157 degrees, more than roads have

void vg_fit_note_corner(const vg_fit* self, const vg_fit_vertex* surveyed, vg_fit_vertex* corner)
{
    const double half = 0.5 * vg_abs(surveyed->turn);
    const double chord = vg_min(surveyed[-1].chord, surveyed->chord);
    double sine, cosine;
    vg_sincos(half, &sine, &cosine);
    if (chord * half < 4.0 * VG_FIT_OUTLIER || cosine < turn_cosine_min) {
        return; // an arc through the vertices stays within the tolerance of the chords
    }
    const double wanted = corner_radius * 4.0 / 9.0 * vg_square(sine / cosine);
    if (wanted <= VG_FIT_OUTLIER) {
        return; // within the tolerance, too
    }
    const double inside = 0.5 * self->width / cosine - 0.5 * body_width - body_margin;
    const double aside = 0.5 * (self->width - body_width) - body_margin;
    corner->cut = vg_max(vg_min(wanted, inside), VG_FIT_OUTLIER);
    if (chord >= swing_length) {
        corner->swing = vg_clamp((wanted - corner->cut) * cosine, 0.0, vg_max(aside, 0.0));
    }
}

/// Samples from `reach` before to `reach` behind a place on the shape. [m]
static void range_of(const vg_fit* self, double place, double reach, uint32_t* first,
                     uint32_t* last)
{
    const double end = (double)(self->sample_count - 1);
    *first = (uint32_t)vg_clamp((place - reach) / self->spacing, 0.0, end);
    *last = (uint32_t)vg_clamp((place + reach) / self->spacing + 1.0, 0.0, end);
}

/// Moves the samples around a corner outwards by its swing. [m] place: of the corner on the shape
static void swing_out(vg_fit* self, const vg_fit_vertex* corner, double place)
{
    const double side = corner->turn > 0.0 ? -1.0 : 1.0;
    const double before = side * corner->swing / corner[-1].chord;
    const double behind = side * corner->swing / corner->chord;
    uint32_t first, last;
    range_of(self, place, swing_length, &first, &last);
    for (uint32_t i = first; i <= last; ++i) {
        const double ahead = self->spacing * (double)i - place;
        const double u = vg_max(1.0 - vg_abs(ahead) / swing_length, 0.0);
        const double ease = u * u * (3.0 - 2.0 * u);
        const double share = vg_clamp(0.5 + 0.5 * ahead, 0.0, 1.0); // of the chord behind
        const double b = ease * (1.0 - share) * before, a = ease * share * behind;
        vg_fit_sample* p = &self->samples[i];
        p->px -= b * (corner->y - corner[-1].y) + a * (corner[1].y - corner->y);
        p->py += b * (corner->x - corner[-1].x) + a * (corner[1].x - corner->x);
    }
}

/// Allows the samples around a corner to cut it. [m] place: of the corner on the shape
static void allow_cut(vg_fit* self, const vg_fit_vertex* corner, double place)
{
    double sine, cosine;
    vg_sincos(0.5 * vg_abs(corner->turn), &sine, &cosine);
    const double cut = corner->cut + swing_kept * corner->swing / cosine;
    const double smoothing = cut * 1.5 / sine;
    const double reach = vg_max(cut_reach * smoothing, 2.0 * swing_length);
    uint32_t first, last;
    range_of(self, place, 2.0 * self->smoothing + reach, &first, &last);
    for (uint32_t i = first; i <= last; ++i) {
        vg_fit_sample* p = &self->samples[i];
        const double distance = vg_abs(self->spacing * (double)i - place);
        const double inside = cut_slack * cut * (1.0 - distance / (cut_reach * smoothing));
        const double outside = corner->swing * (1.0 - 0.5 * distance / swing_length);
        p->smoothing = vg_min(p->smoothing, vg_max(smoothing, 0.5 * (distance - smoothing)));
        p->slack = vg_max(p->slack, vg_max(inside, outside));
    }
}

/// Allows the samples near an end with a pose, which the survey meets at an angle, what an arc of
/// seam_radius needs to turn by that angle, as long as the body stays in the lane.
static void allow_seam(vg_fit* self, int end)
{
    const uint32_t at = end == 0 ? 0 : self->sample_count - 1;
    double sine, cosine;
    vg_sincos(0.5 * self->vertices[end == 0 ? 0 : self->vertex_count - 1].turn, &sine, &cosine);
    const double inside = 0.5 * (self->width - body_width) - VG_FIT_TOLERANCE;
    const double most = vg_clamp(seam_radius * (1.0 - cosine), 0.0, vg_max(inside, 0.0));
    uint32_t first, last;
    range_of(self, self->spacing * (double)at, seam_reach, &first, &last);
    for (uint32_t i = first; i <= last; ++i) {
        vg_fit_sample* p = &self->samples[i];
        const double distance = vg_abs((double)i - (double)at) * self->spacing;
        p->slack = vg_max(p->slack, most * (1.0 - distance / seam_reach));
        p->smoothing = vg_min(p->smoothing, vg_max(seam_smoothing, 0.5 * distance));
    }
}

/// The first or the last sample holds the line to its pose.
static void pin(vg_fit* self, int end)
{
    vg_fit_sample* p = &self->samples[end == 0 ? 0 : self->sample_count - 1];
    p->px = self->ends[end]->x - self->origin_x;
    p->py = self->ends[end]->y - self->origin_y;
    p->weight = VG_FIT_PINNED;
}

void vg_fit_deviate(vg_fit* self)
{
    VERGE_ASSERT(self->sample_count >= 2);
    double place = 0.0;
    for (uint32_t i = 0; i + 1 < self->vertex_count; ++i) {
        if (self->vertices[i].cut > 0.0) {
            swing_out(self, &self->vertices[i], place);
            allow_cut(self, &self->vertices[i], place);
        }
        place += self->vertices[i].length;
    }
    for (int end = 0; end < 2; ++end) {
        if (self->ends[end] != NULL) {
            allow_seam(self, end);
            pin(self, end);
        }
    }
}
