/// The shape that the fitted line stays near: the chords of the survey, and arcs of circles where
/// the survey evidently is one. From it a sample is taken every metre.
///
/// A survey turns evenly from one vertex to the next where both turn to the same side by similar
/// angles. There the shape is an arc through its vertices, unless the arc would leave the chord by
/// more than VG_FIT_RISE: whatever lies between two distant points, they do not tell. Elsewhere the
/// shape is the chord, and leaves it only close to its vertices, by up to bow_max.
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

static const double sample_spacing = 1.0;     // [m]
static const double same_point = 0.01;        // [m] vertices this close are one
static const double even_ratio = 3.0;         // of two turns that are similar
static const double even_turn_max = 1.3;      // [rad] from chord to chord of a circle
static const double curvature_step = 0.04;     // [1/m] below it two lanes are in one bend
static const double straight_curvature = 1e-3; // [1/m] a lane that bends less has no side
static const double seam_turn_max = 0.3;      // [rad] twice the angle at a kinked seam
static const double bow_max = 0.1;            // [m] by which an uneven corner may swing out

/// Weights of the curvature at a pose, relative to the penalty on third differences: in one bend it
/// is held; where a turn begins its line stays within the tolerance (tried from 0.2 to 5).
static const double bend_weight = 100.0, turn_weight = 0.38;

void vg_fit_add(vg_fit* self, double x, double y, int32_t joint)
{
    VERGE_ASSERT(self->vertex_count < self->vertex_capacity);
    x -= self->origin_x;
    y -= self->origin_y;
    if (self->vertex_count > 0) {
        vg_fit_vertex* last = &self->vertices[self->vertex_count - 1];
        if (vg_square(x - last->x) + vg_square(y - last->y) < same_point * same_point) {
            if (joint > last->joint) {
                last->joint = joint;
            }
            return;
        }
    }
    self->vertices[self->vertex_count++] = (vg_fit_vertex){ .x = x, .y = y, .joint = joint };
}

// ------------------------------------------------------------------------------ vertices

static double turn_between(double ax, double ay, double bx, double by)
{
    return vg_atan2(ax * by - ay * bx, ax * bx + ay * by);
}

/// Chords and turns of the polygon. An end with a pose turns as if the circle went on beyond it.
static void measure(vg_fit* self)
{
    vg_fit_vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    VERGE_ASSERT(n >= 2);
    for (uint32_t i = 0; i + 1 < n; ++i) {
        v[i].chord = vg_sqrt(vg_square(v[i + 1].x - v[i].x) + vg_square(v[i + 1].y - v[i].y));
    }
    v[0].turn = 0.0;
    v[n - 1].turn = 0.0;
    for (uint32_t i = 1; i + 1 < n; ++i) {
        v[i].turn = turn_between(v[i].x - v[i - 1].x, v[i].y - v[i - 1].y, v[i + 1].x - v[i].x,
                                 v[i + 1].y - v[i].y);
    }
    for (int end = 0; end < 2; ++end) {
        const vg_pose* pose = self->ends[end];
        if (pose != NULL) {
            const uint32_t from = end == 0 ? 0 : n - 2;
            const double turn = turn_between(pose->cos_heading, pose->sin_heading,
                                             v[from + 1].x - v[from].x, v[from + 1].y - v[from].y);
            v[end == 0 ? 0 : n - 1].turn = end == 0 ? 2.0 * turn : -2.0 * turn;
        }
    }
}

/// Does the survey turn evenly from vertex i to i + 1, as on a circle that stays near the chord?
static bool turns_evenly(const vg_fit* self, const vg_fit_vertex* v, uint32_t i)
{
    const uint32_t n = self->vertex_count;
    double before = v[i].turn;
    double behind = v[i + 1].turn;
    if (i == 0 && self->ends[0] == NULL && n > 2 && v[i].chord < 2.0 * v[i + 1].chord) {
        before = behind; // nothing known before the first: it goes on as it is
    }
    if (i + 2 == n && self->ends[1] == NULL && n > 2 && v[i].chord < 2.0 * v[i - 1].chord) {
        behind = before;
    }
    const double least = vg_min(vg_abs(before), vg_abs(behind));
    const double most = vg_max(vg_abs(before), vg_abs(behind));
    const double rise = v[i].chord * 0.5 * (least + most) / 8.0; // c tan(turn / 4) / 2, nearly
    return before * behind > 0.0 && most < even_ratio * least && most < even_turn_max
           && rise < VG_FIT_RISE;
}

/// [m] from a corner at which the shape may leave its chord, so that it swings out by bow_max.
static double corner_reach(double turn)
{
    // A cubic that leaves its chord by half the turn bows out 4/27 of its length times that.
    return vg_clamp(bow_max * 13.5 / vg_max(vg_abs(turn), 1e-3), 0.5, 20.0);
}

/// Where on the straight chord from `a` to `b` the shape leaves it. from, to: how far the shape may
/// leave it at its ends. Returns how many such places there are. [m] from `a`.
static uint32_t split_places(const vg_fit_vertex* a, const vg_fit_vertex* b, double from, double to,
                             double places[2])
{
    if (from + to < 0.99 * a->chord) {
        places[0] = from;
        places[1] = a->chord - to;
        return 2;
    }
    const double turn = vg_max(vg_abs(a->turn), vg_abs(b->turn));
    if (a->chord * turn < 13.5 * VG_FIT_RISE) {
        return 0; // all of it is close enough
    }
    places[0] = from < to ? from : a->chord - to;
    return 1;
}

/// Adds vertices on chords that are straight, so that corners stay where they are.
static void split(vg_fit* self)
{
    const uint32_t n = self->vertex_count;
    vg_fit_vertex* old = self->surveyed;
    for (uint32_t i = 0; i < n; ++i) {
        old[i] = self->vertices[i];
        if (i > 0 && i + 1 < n) {
            vg_fit_note_corner(self, &self->vertices[i], &old[i]);
        }
    }
    bool even_before = false;
    uint32_t count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        const bool even = i + 1 < n && turns_evenly(self, old, i);
        VERGE_ASSERT(count + 2 < self->vertex_capacity);
        self->vertices[count++] = old[i];
        if (i + 1 < n && !even) {
            const bool even_behind = i + 2 < n && turns_evenly(self, old, i + 1);
            const double from = corner_reach(old[i].turn), to = corner_reach(old[i + 1].turn);
            double places[2];
            const uint32_t more = split_places(
                &old[i], &old[i + 1], even_before ? vg_min(from, old[i - 1].chord) : from,
                even_behind ? vg_min(to, old[i + 1].chord) : to, places);
            for (uint32_t k = 0; k < more; ++k) {
                const double t = places[k] / old[i].chord;
                self->vertices[count++] =
                    (vg_fit_vertex){ .x = old[i].x + t * (old[i + 1].x - old[i].x),
                                     .y = old[i].y + t * (old[i + 1].y - old[i].y), .joint = -1 };
            }
        }
        even_before = even;
    }
    self->vertex_count = count;
}

/// Tangents: of the circle through a vertex and its neighbours.
static void place_tangents(vg_fit* self)
{
    vg_fit_vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    for (uint32_t i = 1; i + 1 < n; ++i) {
        const double before = v[i].chord / v[i - 1].chord; // weights: the shorter chord counts more
        const double behind = v[i - 1].chord / v[i].chord;
        const double x = before * (v[i].x - v[i - 1].x) + behind * (v[i + 1].x - v[i].x);
        const double y = before * (v[i].y - v[i - 1].y) + behind * (v[i + 1].y - v[i].y);
        const double norm = vg_sqrt(x * x + y * y);
        v[i].tangent_x = norm > 0.0 ? x / norm : (v[i + 1].x - v[i].x) / v[i].chord;
        v[i].tangent_y = norm > 0.0 ? y / norm : (v[i + 1].y - v[i].y) / v[i].chord;
    }
    for (int end = 0; end < 2; ++end) { // mirrored at the chord where it turns evenly, else along
        const uint32_t at = end == 0 ? 0 : n - 1;
        const uint32_t inner = end == 0 ? 1 : n - 2;
        const uint32_t first = end == 0 ? 0 : n - 2;
        const double ux = (v[first + 1].x - v[first].x) / v[first].chord;
        const double uy = (v[first + 1].y - v[first].y) / v[first].chord;
        const bool even = n > 2 && turns_evenly(self, v, first);
        const double along = ux * v[inner].tangent_x + uy * v[inner].tangent_y;
        v[at].tangent_x = even ? 2.0 * along * ux - v[inner].tangent_x : ux;
        v[at].tangent_y = even ? 2.0 * along * uy - v[inner].tangent_y : uy;
    }
    for (uint32_t i = 0; i + 1 < n; ++i) {
        // Arc over chord of a circle that leaves the chord by the angle a: 1 + a^2/6 + ...
        const double cosine = ((v[i + 1].x - v[i].x) * (v[i].tangent_x + v[i + 1].tangent_x)
                               + (v[i + 1].y - v[i].y) * (v[i].tangent_y + v[i + 1].tangent_y))
                              / (2.0 * v[i].chord);
        v[i].length = v[i].chord * (1.0 + (1.0 - vg_clamp(cosine, 0.4, 1.0)) / 3.0);
    }
}

// ------------------------------------------------------------------------------ samples

/// The shape between a and b at t in [0, 1]: the cubic that is nearest to a circle's arc.
static void shape_at(const vg_fit_vertex* a, const vg_fit_vertex* b, double t, double* x, double* y)
{
    const double cx = b->x - a->x;
    const double cy = b->y - a->y;
    const double cos_a = vg_max((cx * a->tangent_x + cy * a->tangent_y) / a->chord, 0.0);
    const double cos_b = vg_max((cx * b->tangent_x + cy * b->tangent_y) / a->chord, 0.0);
    const double out = 2.0 * a->chord / (1.0 + cos_a);
    const double in = 2.0 * a->chord / (1.0 + cos_b);
    const double ease = t * t * (3.0 - 2.0 * t);
    const double lead = t * (1.0 - t) * (1.0 - t) * out;
    const double tail = -t * t * (1.0 - t) * in;
    *x = a->x + ease * cx + lead * a->tangent_x + tail * b->tangent_x;
    *y = a->y + ease * cy + lead * a->tangent_y + tail * b->tangent_y;
}

/// Number and spacing of the samples, and where the joints lie among them.
static void space_samples(vg_fit* self)
{
    const vg_fit_vertex* v = self->vertices;
    double total = 0.0;
    for (uint32_t i = 0; i < self->vertex_count; ++i) {
        if (v[i].joint >= 0) {
            self->joints[v[i].joint] = total;
        }
        total += i + 1 < self->vertex_count ? v[i].length : 0.0;
    }
    const double wanted = vg_clamp(total / sample_spacing, 7.0,
                                   (double)(self->sample_capacity - 2));
    self->sample_count = (uint32_t)wanted + 2;
    self->spacing = total / (double)(self->sample_count - 1);
    for (uint32_t k = 0; k <= self->lane_count; ++k) {
        self->joints[k] /= self->spacing;
    }
}

static void take_samples(vg_fit* self)
{
    const vg_fit_vertex* v = self->vertices;
    uint32_t at = 0;
    double start = 0.0;
    for (uint32_t i = 0; i < self->sample_count; ++i) {
        const double distance = self->spacing * (double)i;
        while (at + 2 < self->vertex_count && start + v[at].length < distance) {
            start += v[at++].length;
        }
        vg_fit_sample* p = &self->samples[i];
        *p = (vg_fit_sample){ .weight = 1.0, .smoothing = self->smoothing };
        const vg_fit_vertex *a = &v[at], *b = &v[at + 1];
        shape_at(a, b, vg_clamp((distance - start) / a->length, 0.0, 1.0), &p->px, &p->py);
    }
}

/// A lane leaves a place with the curvature of the pose where the survey shows that the bend goes
/// on, and nearly with it where a bend begins: a wheel cannot turn at once. Not where the lane
/// bends to the other side or meets the place at an angle.
static void compare_curvatures(vg_fit* self)
{
    const vg_fit_vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    for (int end = 0; end < 2; ++end) {
        if (self->ends[end] == NULL || n < 3) {
            continue;
        }
        const vg_fit_vertex* at = &v[end == 0 ? 1 : n - 2];
        const double meets = vg_abs(v[end == 0 ? 0 : n - 1].turn); // twice the angle
        const double curvature = at->turn / (0.5 * (at[-1].chord + at->chord));
        const double bend = self->ends[end]->curvature;
        const bool other_side = curvature * bend < 0.0 && vg_abs(bend) > straight_curvature;
        const bool goes_on = vg_abs(curvature - bend) < curvature_step;
        self->curvature_weight[end] = meets > seam_turn_max ? 0.0 : goes_on ? bend_weight
                                      : other_side ? 0.0 : turn_weight;
    }
}

void vg_fit_shape(vg_fit* self)
{
    measure(self);
    compare_curvatures(self);
    split(self);
    measure(self);
    place_tangents(self);
    space_samples(self);
    take_samples(self);
    vg_fit_deviate(self);
}
