/// See line.h.
#include "geometry/line.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// One coordinate of the line and its three derivatives by s.
typedef struct axis {
    double r, rs, rss, rsss;
} axis;

static axis axis_at(const vg_line* self, const double* value, const double* second, uint32_t knot,
                    double u);
static uint32_t nearest_knot(const vg_line* self, double x, double y, uint32_t hint);
static double project_near(const vg_line* self, double x, double y, uint32_t knot);
static uint32_t walk_to_nearest_knot(const vg_line* self, double x, double y, double s_guess);
static uint32_t knot_at(const vg_line* self, double s);
static double knot_distance_squared(const vg_line* self, uint32_t knot, double x, double y);
static double refine(const vg_line* self, double x, double y, double low, double high);

vg_reference vg_line_at(const vg_line* self, double s)
{
    VERGE_ASSERT(self->knot_count >= 2);
    VERGE_ASSERT(vg_finite(s));
    const double end = self->knot_spacing * (double)(self->knot_count - 1);
    const double along = s - self->start;
    const double inside = vg_clamp(along, 0.0, end);
    const double intervals = inside / self->knot_spacing; // 0 .. knot_count - 1
    uint32_t knot = (uint32_t)intervals;
    if (knot > self->knot_count - 2) {
        knot = self->knot_count - 2;
    }
    const double u = inside - self->knot_spacing * (double)knot;
    const axis x = axis_at(self, self->x, self->xss, knot, u);
    const axis y = axis_at(self, self->y, self->yss, knot, u);
    const double norm = vg_sqrt(x.rs * x.rs + y.rs * y.rs);
    const double beyond = along - inside;

    vg_reference at = { .cos_heading = x.rs / norm, .sin_heading = y.rs / norm };
    at.x = x.r + beyond * at.cos_heading;
    at.y = y.r + beyond * at.sin_heading;
    if (vg_abs(beyond) < 1e-9) { // the end itself, with rounding: it has its curvature
        const double cube = norm * norm * norm;
        at.curvature = (x.rs * y.rss - y.rs * x.rss) / cube;
        at.curvature_rate = (x.rs * y.rsss - y.rs * x.rsss) / cube
                            - 3.0 * at.curvature * (x.rs * x.rss + y.rs * y.rss) / (norm * norm);
    }
    return at;
}

/// The cubic between `knot` and the next, u metres after `knot`.
static axis axis_at(const vg_line* self, const double* value, const double* second, uint32_t knot,
                    double u)
{
    VERGE_ASSERT(knot + 1 < self->knot_count);
    const double h = self->knot_spacing;
    const double r0 = value[knot], r1 = value[knot + 1];
    const double rss0 = second[knot], rss1 = second[knot + 1];
    const double rs0 = (r1 - r0) / h - h * (2.0 * rss0 + rss1) / 6.0;

    axis at;
    at.rsss = (rss1 - rss0) / h;
    at.rss = rss0 + u * at.rsss;
    at.rs = rs0 + u * (rss0 + 0.5 * u * at.rsss);
    at.r = r0 + u * (rs0 + u * (0.5 * rss0 + u * at.rsss / 6.0));
    return at;
}

double vg_line_project(const vg_line* self, double x, double y, double s_guess)
{
    const uint32_t knot = s_guess == s_guess ? walk_to_nearest_knot(self, x, y, s_guess)
                                             : nearest_knot(self, x, y, 0);
    return project_near(self, x, y, knot);
}

double vg_line_project_whole(const vg_line* self, double x, double y, double s_hint)
{
    return project_near(self, x, y, nearest_knot(self, x, y, knot_at(self, s_hint)));
}

/// The nearest point within an interval of this knot, or beyond the line's end next to it.
static double project_near(const vg_line* self, double x, double y, uint32_t knot)
{
    const uint32_t last = self->knot_count - 1;
    const uint32_t first = knot == 0 ? 0 : knot - 1;
    const uint32_t second = knot == last ? last : knot + 1;
    const double low = self->start + self->knot_spacing * (double)first;
    const double high = self->start + self->knot_spacing * (double)second;
    for (int end = 0; end < 2; ++end) { // beyond an end the line is straight
        const double s = end == 0 ? low : high;
        if (end == 0 ? first == 0 : second == last) {
            const vg_reference at = vg_line_at(self, s);
            const double ahead = vg_ahead_of(&at, x, y);
            if (end == 0 ? ahead <= 0.0 : ahead >= 0.0) {
                return s + ahead;
            }
        }
    }
    return refine(self, x, y, low, high);
}

/// The nearest of all knots, exactly. The distance changes by at most one spacing from knot to
/// knot. Therefore knots that cannot be nearer than the best one so far are skipped. With a hint
/// near the result most knots are skipped. Of equally near knots the first is taken.
static uint32_t nearest_knot(const vg_line* self, double x, double y, uint32_t hint)
{
    uint32_t best = hint;
    double best_distance = vg_sqrt(knot_distance_squared(self, hint, x, y));
    for (uint32_t i = hint == 0 ? 1 : 0; i < self->knot_count;) {
        const double distance = vg_sqrt(knot_distance_squared(self, i, x, y));
        if (distance < best_distance || (distance == best_distance && i < best)) {
            best = i;
            best_distance = distance;
        }
        // 1.01: the distance of two knots may be slightly larger than knot_spacing.
        const double skip = (distance - best_distance) / (1.01 * self->knot_spacing);
        i += skip >= (double)self->knot_count ? self->knot_count : skip > 1.0 ? (uint32_t)skip : 1;
    }
    return best;
}

static uint32_t knot_at(const vg_line* self, double s)
{
    const double knots = (s - self->start) / self->knot_spacing + 0.5;
    return (uint32_t)vg_clamp(knots, 0.0, (double)(self->knot_count - 1));
}

static uint32_t walk_to_nearest_knot(const vg_line* self, double x, double y, double s_guess)
{
    const uint32_t last = self->knot_count - 1;
    uint32_t knot = knot_at(self, s_guess);
    double here = knot_distance_squared(self, knot, x, y);
    for (uint32_t step = 0; step < last; ++step) {
        uint32_t next = knot;
        double there = here;
        if (knot > 0 && knot_distance_squared(self, knot - 1, x, y) < there) {
            next = knot - 1;
            there = knot_distance_squared(self, next, x, y);
        }
        if (knot < last && knot_distance_squared(self, knot + 1, x, y) < there) {
            next = knot + 1;
            there = knot_distance_squared(self, next, x, y);
        }
        if (next == knot) {
            break;
        }
        knot = next;
        here = there;
    }
    return knot;
}

static double knot_distance_squared(const vg_line* self, uint32_t knot, double x, double y)
{
    return vg_square(self->x[knot] - x) + vg_square(self->y[knot] - y);
}

/// Root of ahead(s) = (p - r(s)) . r'(s) in [low, high], which falls through zero at the nearest
/// point: Newton's method, kept inside the bracket by bisection.
static double refine(const vg_line* self, double x, double y, double low, double high)
{
    double s = 0.5 * (low + high);
    for (int round = 0; round < 60; ++round) {
        const vg_reference at = vg_line_at(self, s);
        const double ahead = vg_ahead_of(&at, x, y);
        const double d = vg_left_of(&at, x, y);
        if (ahead > 0.0) {
            low = s;
        } else {
            high = s;
        }
        const double slope = 1.0 - at.curvature * d;
        double next = slope > 0.0 ? s + ahead / slope : 0.5 * (low + high);
        if (!(next >= low && next <= high)) {
            next = 0.5 * (low + high);
        }
        const double step = vg_abs(next - s);
        s = next;
        if (step < 1e-13 || high - low < 1e-13) {
            break;
        }
    }
    return s;
}

void vg_spline_solve(const double* value, const double* h, uint32_t count, const double* slopes,
                     double* second, double* work)
{
    VERGE_ASSERT(count >= 4);
    // Continuity of the slope at the inner knots: h0 M0 + 2 (h0 + h1) M1 + h1 M2 = 6 (slope step).
    const uint32_t last = count - 1;
    work[0] = 0.0;
    second[0] = 0.0;
    if (slopes != NULL) {
        work[0] = 0.5;
        second[0] = 3.0 * ((value[1] - value[0]) / h[0] - slopes[0]) / h[0];
    }
    for (uint32_t i = 1; i < last; ++i) {
        double lower = h[i - 1];
        double diagonal = 2.0 * (h[i - 1] + h[i]);
        double upper = h[i];
        if (slopes == NULL && i == 1) { // M0 = M1 - (M2 - M1) h0 / h1
            diagonal += lower + lower * lower / upper;
            upper -= lower * lower / upper;
            lower = 0.0;
        } else if (slopes == NULL && i == last - 1) {
            diagonal += upper + upper * upper / lower;
            lower -= upper * upper / lower;
            upper = 0.0;
        }
        const double step = (value[i + 1] - value[i]) / h[i] - (value[i] - value[i - 1]) / h[i - 1];
        const double pivot = diagonal - lower * work[i - 1];
        work[i] = upper / pivot;
        second[i] = (6.0 * step - lower * second[i - 1]) / pivot;
    }
    second[last] = 0.0;
    if (slopes != NULL) {
        const double step = slopes[1] - (value[last] - value[last - 1]) / h[last - 1];
        second[last] = (6.0 * step / h[last - 1] - second[last - 1]) / (2.0 - work[last - 1]);
        for (uint32_t i = last; i-- > 0;) {
            second[i] -= work[i] * second[i + 1];
        }
        return;
    }
    for (uint32_t i = last - 1; i-- > 1;) {
        second[i] -= work[i] * second[i + 1];
    }
    second[0] = second[1] - (second[2] - second[1]) * h[0] / h[1];
    second[last] = second[last - 1]
                   + (second[last - 1] - second[last - 2]) * h[last - 1] / h[last - 2];
}
