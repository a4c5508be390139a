/// From smooth samples to the lines of the lanes: a C2 spline through the samples, knots on it at
/// equal arc length, and one C2 spline through the knots of all lanes of the chain.
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

static const double lane_length_min = 0.01; // [m]

/// Position on the spline through samples first .. , at u in [0, 1] of the interval.
static void spline_at(const double* value, const double* second, double h, double u, double* at,
                      double* slope)
{
    const double first = (value[1] - value[0]) / h - h * (2.0 * second[0] + second[1]) / 6.0;
    const double third = (second[1] - second[0]) / h;
    const double w = u * h;
    *at = value[0] + w * (first + w * (0.5 * second[0] + w * third / 6.0));
    *slope = first + w * (second[0] + 0.5 * w * third);
}

/// [m] of arc between 0 and u of one interval: Gauss' rule with three points, exact to 1e-9 m on
/// an arc of 2 m radius.
static double spline_arc(const vg_fit* self, uint32_t i, double u)
{
    static const double node[3] = { 0.1127016653792583, 0.5, 0.8872983346207417 };
    static const double weight[3] = { 5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0 };
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        double x, y, xs, ys;
        spline_at(self->x + i, self->xss + i, self->h[i], u * node[k], &x, &xs);
        spline_at(self->y + i, self->yss + i, self->h[i], u * node[k], &y, &ys);
        sum += weight[k] * vg_sqrt(xs * xs + ys * ys);
    }
    return sum * u * self->h[i];
}

void vg_fit_spline(vg_fit* self)
{
    const uint32_t n = self->sample_count;
    for (uint32_t i = 0; i < n; ++i) {
        self->x[i] = self->samples[i].qx;
        self->y[i] = self->samples[i].qy;
        self->h[i] = 1.0;
    }
    vg_spline_solve(self->x, self->h, n, NULL, self->xss, self->work);
    vg_spline_solve(self->y, self->h, n, NULL, self->yss, self->work);
    self->arc[0] = 0.0;
    for (uint32_t i = 0; i + 1 < n; ++i) {
        self->arc[i + 1] = self->arc[i] + spline_arc(self, i, 1.0);
    }
}

/// The interval that contains the sample coordinate u, which becomes that within the interval.
static uint32_t interval_of(const vg_fit* self, double* u)
{
    const double inside = vg_clamp(*u, 0.0, (double)(self->sample_count - 1));
    uint32_t i = (uint32_t)inside;
    i = i > self->sample_count - 2 ? self->sample_count - 2 : i;
    *u = inside - (double)i;
    return i;
}

/// [m] arc length at the sample coordinate u.
static double arc_at(const vg_fit* self, double u)
{
    const uint32_t i = interval_of(self, &u);
    return self->arc[i] + spline_arc(self, i, u);
}

vg_pose vg_fit_at_joint(const vg_fit* self, uint32_t joint)
{
    VERGE_ASSERT(joint <= self->lane_count);
    double u = self->joints[joint];
    const uint32_t i = interval_of(self, &u);
    vg_pose at;
    double xs, ys;
    spline_at(self->x + i, self->xss + i, self->h[i], u, &at.x, &xs);
    spline_at(self->y + i, self->yss + i, self->h[i], u, &at.y, &ys);
    const double xss = (1.0 - u) * self->xss[i] + u * self->xss[i + 1];
    const double yss = (1.0 - u) * self->yss[i] + u * self->yss[i + 1];
    const double speed = vg_sqrt(vg_square(xs) + vg_square(ys));
    at.x += self->origin_x;
    at.y += self->origin_y;
    at.cos_heading = xs / speed;
    at.sin_heading = ys / speed;
    at.curvature = (xs * yss - ys * xss) / (speed * speed * speed);
    return at;
}

/// Point and direction at an arc length; *hint is the interval to start looking from, as they
/// come in order.
static void point_at_arc(const vg_fit* self, double s, uint32_t* hint, double point[2],
                         double direction[2])
{
    while (*hint + 2 < self->sample_count && self->arc[*hint + 1] < s) {
        ++*hint;
    }
    const uint32_t i = *hint;
    double u = (s - self->arc[i]) / (self->arc[i + 1] - self->arc[i]);
    for (int round = 0; round < 5; ++round) { // speed along the interval is nearly constant
        spline_at(self->x + i, self->xss + i, self->h[i], u, &point[0], &direction[0]);
        spline_at(self->y + i, self->yss + i, self->h[i], u, &point[1], &direction[1]);
        const double speed = vg_sqrt(vg_square(direction[0]) + vg_square(direction[1]));
        u += (s - self->arc[i] - spline_arc(self, i, u)) / speed;
        direction[0] /= speed;
        direction[1] /= speed;
    }
}

/// Puts `count` knots h apart from arc length s on into the samples from n on; returns the next n.
static uint32_t add_knots(vg_fit* self, uint32_t n, double s, double h, uint32_t count,
                          uint32_t* hint)
{
    for (uint32_t i = 0; i < count; ++i) {
        double point[2], direction[2];
        VERGE_ASSERT(n < self->sample_capacity);
        point_at_arc(self, s + h * (double)i, hint, point, direction);
        self->samples[n++] = (vg_fit_sample){ .qx = point[0], .qy = point[1], .px = direction[0],
                                              .py = direction[1], .weight = h };
    }
    return n;
}

/// Knots of each lane at equal distances. They are collected in the samples, whose job is done.
/// Returns their number.
static uint32_t collect_knots(vg_fit* self, vg_road_draft* draft, const uint16_t* lanes)
{
    uint32_t hint = 0, n = 0;
    for (uint32_t k = 0; k < self->lane_count; ++k) {
        vg_lane* lane = &draft->road->lanes[lanes[k]];
        const double start = arc_at(self, self->joints[k]);
        lane->length = vg_max(arc_at(self, self->joints[k + 1]) - start, lane_length_min);
        lane->line.knot_spacing = lane->length / (double)(lane->line.knot_count - 1);
        n = add_knots(self, n, start, lane->line.knot_spacing, lane->line.knot_count - 1, &hint);
    }
    return add_knots(self, n, arc_at(self, self->joints[self->lane_count]), 0.0, 1, &hint);
}

/// The knots of an end that has a pose take exactly that pose.
static void pin_knots(vg_fit* self, uint32_t count)
{
    for (int end = 0; end < 2; ++end) {
        const vg_pose* pose = self->ends[end];
        if (pose != NULL) {
            vg_fit_sample* knot = &self->samples[end == 0 ? 0 : count - 1];
            knot->qx = pose->x - self->origin_x;
            knot->qy = pose->y - self->origin_y;
            knot->px = pose->cos_heading;
            knot->py = pose->sin_heading;
        }
    }
}

/// [m] from the line to the surveyed point that is furthest from it. The points come in order, so
/// each is looked for near the one before.
static double deviation_of(const vg_lane* lane, const verge_lane_def* survey)
{
    double furthest = 0.0, s = 0.0;
    for (uint32_t i = 0; i < survey->point_count; ++i) {
        const double* p = survey->points[i];
        s = vg_clamp(vg_lane_project(lane, p[0], p[1], s), 0.0, lane->length);
        const vg_reference at = vg_lane_at(lane, s);
        furthest = vg_max(furthest, vg_square(at.x - p[0]) + vg_square(at.y - p[1]));
    }
    return vg_sqrt(furthest);
}

static void store_lanes(const vg_fit* self, vg_road_draft* draft, const uint16_t* lanes)
{
    uint32_t knot = 0;
    for (uint32_t k = 0; k < self->lane_count; ++k) {
        vg_lane* lane = &draft->road->lanes[lanes[k]];
        const vg_lane_storage* storage = &draft->storage[lanes[k]];
        for (uint32_t i = 0; i < lane->line.knot_count; ++i) {
            storage->x[i] = self->origin_x + self->x[knot + i];
            storage->y[i] = self->origin_y + self->y[knot + i];
            storage->xss[i] = self->xss[knot + i];
            storage->yss[i] = self->yss[knot + i];
        }
        knot += lane->line.knot_count - 1; // the last knot is the next lane's first
        lane->deviation = deviation_of(lane, &draft->def->lanes[lanes[k]]);
    }
}

void vg_fit_knots(vg_fit* self, vg_road_draft* draft, const uint16_t* lanes)
{
    const uint32_t n = collect_knots(self, draft, lanes);
    pin_knots(self, n);
    const vg_fit_sample* knots = self->samples;
    const double slopes_x[2] = { knots[0].px, knots[n - 1].px };
    const double slopes_y[2] = { knots[0].py, knots[n - 1].py };
    for (uint32_t i = 0; i < n; ++i) {
        self->x[i] = knots[i].qx;
        self->y[i] = knots[i].qy;
        self->h[i] = knots[i].weight;
    }
    vg_spline_solve(self->x, self->h, n, slopes_x, self->xss, self->work);
    vg_spline_solve(self->y, self->h, n, slopes_y, self->yss, self->work);
    store_lanes(self, draft, lanes);
}
