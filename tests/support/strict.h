/// A judge of trajectories that shares no code with the planner. It reads the emitted points only,
/// moves them to the rear axle, joins them by quintic Hermite curves and computes every 10 ms the
/// steering and acceleration that a kinematic single-track vehicle would need. Bodies are tested
/// by clipping polygons.
#ifndef STRICT_H
#define STRICT_H

#include "verge/plan.h"
#include "verge/trajectory.h"

#include <math.h>
#include <stdio.h>

typedef struct strict_rear {
    double x, y, heading, v, a, k;
} strict_rear;

/// Rear axle from a point of the centre. The centre's acceleration holds v k k' b^2 / m too.
static inline strict_rear strict_rear_of(const verge_body* body, const verge_point* p,
                                         double k_rate)
{
    const double b = body->rear_axle;
    const double m = 1.0 / sqrt(1.0 - b * p->curvature * b * p->curvature);
    const double k = p->curvature * m, v = p->speed / m;
    return (strict_rear){ p->x - b * cos(p->heading), p->y - b * sin(p->heading), p->heading, v,
                          (p->acceleration - v * k * k_rate * b * b / m) / m, k };
}

/// Acceleration in the plane: along the heading and towards the centre of the bend.
static inline void strict_pull(const strict_rear* r, double out[2])
{
    const double across = r->v * r->v * r->k;
    out[0] = r->a * cos(r->heading) - across * sin(r->heading);
    out[1] = r->a * sin(r->heading) + across * cos(r->heading);
}

/// One axis of a quintic Hermite curve at u in [0, 1] of a step h: position, velocity,
/// acceleration.
static inline void strict_hermite(double h, double u, double p0, double v0, double a0, double p1,
                                  double v1, double a1, double out[3])
{
    const double q = p1 - p0 - v0 * h - 0.5 * a0 * h * h;
    const double w = (v1 - v0 - a0 * h) * h, z = (a1 - a0) * h * h;
    const double c3 = 10.0 * q - 4.0 * w + 0.5 * z, c4 = -15.0 * q + 7.0 * w - z;
    const double c5 = 6.0 * q - 3.0 * w + 0.5 * z;
    const double t = u * h;
    out[0] = p0 + v0 * t + 0.5 * a0 * t * t + u * u * u * (c3 + u * (c4 + u * c5));
    out[1] = v0 + a0 * t + u * u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)) / h;
    out[2] = a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5)) / (h * h);
}

/// What is wrong with the motion, or null. `text` receives the numbers.
static inline const char* strict_motion_fault(const verge_vehicle_plan* plan,
                                              const verge_body* body, double h, char text[160])
{
    const double curvature_max = tan(body->steer_max) / body->wheelbase;
    double k_before = NAN;
    for (uint32_t i = 0; i + 1 < plan->point_count; ++i) {
        const verge_point* p = &plan->points[i];
        const double k_rate = (p[1].curvature - p[0].curvature) / h;
        const strict_rear r0 = strict_rear_of(body, &p[0], k_rate);
        const strict_rear r1 = strict_rear_of(body, &p[1], k_rate);
        double turn = remainder(r1.heading - r0.heading, 2.0 * M_PI);
        snprintf(text, 160, "t=%.2f v=%.4f a=%.4f k=%.5f | v=%.4f a=%.4f k=%.5f turn=%.5f", p->t,
                 r0.v, r0.a, r0.k, r1.v, r1.a, r1.k, turn);
        if (!(r0.v >= 0.0) || !(r1.v >= 0.0)) {
            return "speed is negative or not a number";
        }
        // Inverse dynamics over the step: position, speed and heading must follow from rates.
        const double dx = r1.x - r0.x, dy = r1.y - r0.y;
        double a0[2], a1[2]; // accelerations in the plane
        strict_pull(&r0, a0);
        strict_pull(&r1, a1);
        const double ex = 0.5 * h * (r0.v * cos(r0.heading) + r1.v * cos(r1.heading))
                        + h * h / 12.0 * (a0[0] - a1[0]);
        const double ey = 0.5 * h * (r0.v * sin(r0.heading) + r1.v * sin(r1.heading))
                        + h * h / 12.0 * (a0[1] - a1[1]);
        if (!(hypot(dx - ex, dy - ey) < 2e-3)) {
            return "position does not follow from speed and heading";
        }
        // A peak inside the step hides jerk h^2 / 4 at most; a stop may end with a jolt.
        if (!(fabs(r1.v - r0.v - 0.5 * h * (r0.a + r1.a)) < (r1.v > 0.0 ? 3.1 * h * h : 0.06))) {
            return "speed does not follow from acceleration";
        }
        if (!(fabs(turn - 0.5 * h * (r0.v * r0.k + r1.v * r1.k)) < 3e-3)) {
            return "heading does not follow from curvature";
        }
        for (int j = 0; j <= 10; ++j) {
            double x[3], y[3];
            strict_hermite(h, j / 10.0, r0.x, r0.v * cos(r0.heading), a0[0], r1.x,
                           r1.v * cos(r1.heading), a1[0], x);
            strict_hermite(h, j / 10.0, r0.y, r0.v * sin(r0.heading), a0[1], r1.y,
                           r1.v * sin(r1.heading), a1[1], y);
            const double v = hypot(x[1], y[1]);
            if (hypot(x[2], y[2]) > 1.01 * fmax(body->braking_max, body->lateral_max)) {
                return "outside the friction circle";
            }
            if (v < 0.5) {
                k_before = NAN; // curvature of a point at rest cannot be seen from its positions
                continue;
            }
            const double a = (x[1] * x[2] + y[1] * y[2]) / v;
            const double k = (x[1] * y[2] - y[1] * x[2]) / (v * v * v);
            if (hypot(a / body->braking_max, v * v * k / body->lateral_max) > 1.01) {
                return "outside the ellipse of braking and lateral acceleration";
            }
            if (a > body->acceleration_max * fmin(1.0, body->speed_switch / v) * 1.02) {
                return "accelerates harder than the engine can";
            }
            if (fabs(k) > curvature_max * 1.02) {
                return "curvature beyond the steering";
            }
            const double steer_rate = (atan(body->wheelbase * k)
                                       - atan(body->wheelbase * k_before)) / (0.1 * h);
            // Slow positions hide curvature in their last digits: 6 % and 0.02 / v of slack.
            if (j > 0 && fabs(steer_rate) > body->steer_rate_max * 1.06 + 0.02 / v) {
                snprintf(text, 160, "t=%.2f steering rate %.3f rad/s at %.3f m/s", p->t,
                         steer_rate, v);
                return "steers faster than it can";
            }
            k_before = k;
        }
    }
    return NULL;
}

typedef struct strict_polygon {
    int count;
    double p[16][2];
} strict_polygon;

/// Body of a track between samples k and k + 1 (linear), share u.
static inline strict_polygon strict_body(const verge_track* t, uint32_t k, double u)
{
    double c = t->cos_heading[k] * (1.0 - u) + t->cos_heading[k + 1] * u;
    double s = t->sin_heading[k] * (1.0 - u) + t->sin_heading[k + 1] * u;
    const double n = hypot(c, s);
    c /= n;
    s /= n;
    const double x = t->x[k] * (1.0 - u) + t->x[k + 1] * u;
    const double y = t->y[k] * (1.0 - u) + t->y[k + 1] * u;
    static const double sides[4][2] = { { 1, 1 }, { -1, 1 }, { -1, -1 }, { 1, -1 } };
    strict_polygon out = { .count = 4 };
    for (int i = 0; i < 4; ++i) {
        const double l = sides[i][0] * t->half_length, w = sides[i][1] * t->half_width;
        out.p[i][0] = x + l * c - w * s;
        out.p[i][1] = y + l * s + w * c;
    }
    return out;
}

/// Area that two convex polygons share: Sutherland and Hodgman's clipping.
static inline double strict_shared_area(strict_polygon a, const strict_polygon* b)
{
    for (int e = 0; e < b->count && a.count > 0; ++e) {
        const double* q0 = b->p[e];
        const double* q1 = b->p[(e + 1) % b->count];
        strict_polygon out = { .count = 0 };
        for (int i = 0; i < a.count; ++i) {
            const double* p0 = a.p[i];
            const double* p1 = a.p[(i + 1) % a.count];
            const double d0 = (q1[0] - q0[0]) * (p0[1] - q0[1]) - (q1[1] - q0[1]) * (p0[0] - q0[0]);
            const double d1 = (q1[0] - q0[0]) * (p1[1] - q0[1]) - (q1[1] - q0[1]) * (p1[0] - q0[0]);
            if (d0 >= 0.0) {
                out.p[out.count][0] = p0[0];
                out.p[out.count++][1] = p0[1];
            }
            if ((d0 >= 0.0) != (d1 >= 0.0)) {
                const double u = d0 / (d0 - d1);
                out.p[out.count][0] = p0[0] + u * (p1[0] - p0[0]);
                out.p[out.count++][1] = p0[1] + u * (p1[1] - p0[1]);
            }
        }
        a = out;
    }
    double area = 0.0;
    for (int i = 0; i < a.count; ++i) {
        const double* p0 = a.p[i];
        const double* p1 = a.p[(i + 1) % a.count];
        area += 0.5 * (p0[0] * p1[1] - p1[0] * p0[1]);
    }
    return area;
}

/// First instant [s] at which two tracks overlap, from `from` on, every 10 ms; infinite: never.
static inline double strict_contact(const verge_track* a, const verge_track* b, uint32_t points,
                                    double h, double from)
{
    for (uint32_t k = 0; k + 1 < points; ++k) {
        for (int j = 0; j <= 10; ++j) {
            const strict_polygon p = strict_body(a, k, j / 10.0), q = strict_body(b, k, j / 10.0);
            const double t = h * (k + j / 10.0);
            if (t >= from && strict_shared_area(p, &q) > 1e-9) {
                return t;
            }
        }
    }
    return INFINITY;
}

#endif
