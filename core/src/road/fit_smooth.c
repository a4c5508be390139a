/// The smoothest samples near those of the shape: least squares with a penalty on third
/// differences, which leaves straight lines and parabolas as they are,
///
///     minimise  sum w_i (q_i - p_i)^2  +  sum (L_i / h)^6 (q_i+3 - 3 q_i+2 + 3 q_i+1 - q_i)^2
///
/// The smoothing length L begins large and is reduced, in a fixed number of
/// rounds, wherever the result deviates more than is allowed. A round is linear in the samples.
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

static const double smoothing_min = 1.0;     // [m]
static const double smoothing_shrink = 0.7;
/// Shrinking spreads over this many smoothing lengths to each side: where it changes abruptly the
/// line bends twice as sharply as its survey (measured over random clothoids).
static const double shrink_reach = 3.0;
/// Of the direction at an end with a pose: above the penalty of the longest smoothing length.
static const double direction_weight = 1e9;
enum { ROUNDS = 24 };                        // 7 shrink 12 m to the least; more as it spreads

/// (L / h)^6
static double penalty_of(double smoothing, double spacing)
{
    const double ratio = smoothing / spacing;
    return ratio * ratio * ratio * ratio * ratio * ratio;
}

/// Adds the penalty on the third differences from sample j on.
static void add_penalty(vg_fit_sample* p, uint32_t j, double spacing)
{
    static const double difference[4] = { -1.0, 3.0, -3.0, 1.0 };
    const double penalty = penalty_of(vg_min(p[j + 1].smoothing, p[j + 2].smoothing), spacing);
    const double dx = (p[j + 3].px - p[j].px) - 3.0 * (p[j + 2].px - p[j + 1].px);
    const double dy = (p[j + 3].py - p[j].py) - 3.0 * (p[j + 2].py - p[j + 1].py);
    for (uint32_t m = 0; m < 4; ++m) {
        for (uint32_t k = m; k < 4; ++k) {
            p[j + m].band[k - m] += penalty * difference[m] * difference[k];
        }
        p[j + m].qx -= penalty * difference[m] * dx;
        p[j + m].qy -= penalty * difference[m] * dy;
    }
}

/// Adds weight * (sum of row[k] q_k - value)^2 over the four samples at an end, inwards.
static void add_row(vg_fit* self, int end, double weight, const double row[4], double x, double y)
{
    vg_fit_sample* p = self->samples;
    const uint32_t last = self->sample_count - 1;
    for (uint32_t k = 0; k < 4; ++k) {
        const vg_fit_sample* at = &p[end == 0 ? k : last - k];
        x -= row[k] * at->px;
        y -= row[k] * at->py;
    }
    for (uint32_t m = 0; m < 4; ++m) {
        vg_fit_sample* at = &p[end == 0 ? m : last - m];
        for (uint32_t k = 0; k < 4; ++k) { // the band is to the right of its sample
            if (end == 0 ? k >= m : k <= m) {
                at->band[end == 0 ? k - m : m - k] += weight * row[m] * row[k];
            }
        }
        at->qx += weight * row[m] * x;
        at->qy += weight * row[m] * y;
    }
}

/// Holds direction, and maybe curvature, at an end with a pose: first and second derivatives of the
/// cubic through its four samples.
static void hold_end(vg_fit* self, int end)
{
    static const double first[4] = { -11.0 / 6.0, 3.0, -1.5, 1.0 / 3.0 };
    static const double second[4] = { 2.0, -5.0, 4.0, -1.0 };
    const vg_pose* pose = self->ends[end];
    const double h = end == 0 ? self->spacing : -self->spacing;
    const double bend = pose->curvature * h * h;
    add_row(self, end, direction_weight, first, h * pose->cos_heading, h * pose->sin_heading);
    if (self->curvature_weight[end] > 0.0) {
        const vg_fit_sample* p = &self->samples[end == 0 ? 0 : self->sample_count - 1];
        const double penalty = penalty_of(p->smoothing, self->spacing);
        add_row(self, end, self->curvature_weight[end] * penalty, second, -bend * pose->sin_heading,
                bend * pose->cos_heading);
    }
}

/// Solves for what the samples have to move: the normal matrix has three diagonals on each side,
/// and the right-hand side is zero where the shape is straight, which stays so exactly.
static void solve(vg_fit* self)
{
    vg_fit_sample* p = self->samples;
    const uint32_t n = self->sample_count;
    for (uint32_t i = 0; i < n; ++i) {
        p[i].qx = 0.0;
        p[i].qy = 0.0;
        p[i].band[0] = p[i].weight;
        p[i].band[1] = p[i].band[2] = p[i].band[3] = 0.0;
    }
    for (uint32_t j = 0; j + 3 < n; ++j) {
        add_penalty(p, j, self->spacing);
    }
    for (int end = 0; end < 2; ++end) {
        if (self->ends[end] != NULL) {
            hold_end(self, end);
        }
    }
    for (uint32_t i = 0; i < n; ++i) { // L D L^T in place, then both sides at once
        VERGE_ASSERT(p[i].band[0] > 0.0);
        for (uint32_t k = 1; k < 4 && i + k < n; ++k) {
            const double factor = p[i].band[k] / p[i].band[0];
            for (uint32_t m = k; m < 4 && i + m < n; ++m) {
                p[i + k].band[m - k] -= factor * p[i].band[m];
            }
            p[i + k].qx -= factor * p[i].qx;
            p[i + k].qy -= factor * p[i].qy;
        }
    }
    for (uint32_t i = n; i-- > 0;) {
        for (uint32_t k = 1; k < 4 && i + k < n; ++k) {
            p[i].qx -= p[i].band[k] * p[i + k].qx;
            p[i].qy -= p[i].band[k] * p[i + k].qy;
        }
        p[i].qx /= p[i].band[0];
        p[i].qy /= p[i].band[0];
    }
}

/// Marks the samples around sample i to be smoothed over less.
static void shrink_around(vg_fit* self, uint32_t i)
{
    vg_fit_sample* p = self->samples;
    const uint32_t reach = (uint32_t)(shrink_reach * p[i].smoothing / self->spacing) + 1;
    const uint32_t first = i > reach ? i - reach : 0;
    for (uint32_t k = first; k < self->sample_count && k <= i + reach; ++k) {
        p[k].shrink = true;
    }
}

/// How far each sample moved to the left of the shape. [m]
static void measure_deviations(const vg_fit* self, double* deviation)
{
    const vg_fit_sample* p = self->samples;
    const uint32_t n = self->sample_count;
    for (uint32_t i = 0; i < n; ++i) {
        const vg_fit_sample* before = &p[i > 0 ? i - 1 : 0];
        const vg_fit_sample* behind = &p[i + 1 < n ? i + 1 : n - 1];
        const double tx = behind->px - before->px;
        const double ty = behind->py - before->py;
        const double norm = vg_max(vg_sqrt(tx * tx + ty * ty), 1e-9);
        deviation[i] = (p[i].qy * tx - p[i].qx * ty) / norm;
    }
}

/// Is the line within the tolerance? Where it is not, the smoothing length is reduced.
static bool check(vg_fit* self)
{
    vg_fit_sample* p = self->samples;
    const uint32_t n = self->sample_count;
    const uint32_t window = (uint32_t)(VG_FIT_WINDOW / self->spacing) + 1; // some 6 samples
    double* deviation = self->work;
    measure_deviations(self, deviation);
    bool good = true;
    for (uint32_t i = 0; i < n; ++i) {
        if (p[i].weight > 1.0 || p[i].smoothing <= smoothing_min) {
            continue;
        }
        double sum = 0.0;
        const uint32_t first = i > window ? i - window : 0;
        const uint32_t last = i + window < n ? i + window : n - 1;
        for (uint32_t k = first; k <= last; ++k) {
            sum += deviation[k];
        }
        const double mean = vg_abs(sum) / (double)(last - first + 1);
        const double off = vg_abs(deviation[i]) - p[i].slack;
        if (off > VG_FIT_OUTLIER || (off > VG_FIT_TOLERANCE && mean > VG_FIT_MEAN)) {
            good = false;
            shrink_around(self, i);
        }
    }
    for (uint32_t i = 0; i < n; ++i) {
        if (p[i].shrink) {
            p[i].smoothing = vg_max(p[i].smoothing * smoothing_shrink, smoothing_min);
            p[i].shrink = false;
        }
    }
    return good;
}

void vg_fit_smooth(vg_fit* self)
{
    for (int round = 0; round < ROUNDS; ++round) {
        solve(self);
        if (round + 1 == ROUNDS || check(self)) {
            break;
        }
    }
    for (uint32_t i = 0; i < self->sample_count; ++i) {
        self->samples[i].qx += self->samples[i].px;
        self->samples[i].qy += self->samples[i].py;
    }
}
