/// See resume.h.
#include "motion/resume.h"

#include "base/contract.h"
#include "geometry/quintic.h"

// Distance of the knots of the line. At low speed a steering rate lasts for decimetres only. [m]
static const double spacing_min = 0.1;
// A plan that drives less, or more, is no line to follow. [m]
static const double length_min = 2.0, length_max = 4000.0;
// The line goes on beyond the end of the plan, for the distance driven since then and this. [m]
static const double beyond = 1.0;
// A vehicle farther than this from its last plan does not follow it: beside it, along it, and in
// speed. [m], [m], [m/s]
static const double beside_max = 0.3, along_max = 1.0, speed_error_max = 1.0;
// A difference to the planned speed is made up for within this time. [s]
static const double catch_up_s = 0.5;
// No plan has larger values: the caller of a stage may pass any. [m], [rad], [m/s], [1/m]
static const double place_max = 1e8, heading_max = 10.0, speed_max = 200.0, curvature_max = 100.0;

// The caller of a stage may pass points that no vehicle can drive. A point farther from where speed
// and heading lead than this, times the square of the time between two points, is one. [m/s^2]
static const double jump_max = 0.5;

/// The rear axle at the points of the last plan.
typedef struct trace {
    uint32_t count;
    vg_motion at[VERGE_POINTS_MAX];
    double cos_heading[VERGE_POINTS_MAX], sin_heading[VERGE_POINTS_MAX];
    double distance[VERGE_POINTS_MAX]; ///< [m] from the first one, along the line
} trace;

static bool can_resume(const vg_job* job);
static double trace_of(trace* self, const verge_vehicle_plan* plan, double rear_axle);
static bool is_smooth(const trace* from, double point_s);
static void build(vg_path* path, const trace* from, double length);
static double at_time(const vg_job* job, double t, uint32_t* k);

static double mix(double a, double b, double part)
{
    return a + part * (b - a);
}

bool vg_resume_path(vg_path* path, vg_state* state, const vg_job* job, const vg_motion* rear,
                    double rear_axle)
{
    state->valid = false;
    if (!can_resume(job)) {
        return false;
    }
    trace from;
    const double length = trace_of(&from, job->before, rear_axle);
    if (length < length_min || length > length_max || !is_smooth(&from, job->def->point_s)) {
        return false;
    }
    const double speed = from.at[from.count - 1].speed;
    build(path, &from, length + speed * job->before_age + beyond);
    path->anchor = job->lane;

    uint32_t k;
    const double part = at_time(job, 0.0, &k);
    const double expected = mix(from.distance[k], from.distance[k + 1], part);
    *state = vg_state_of(path, rear, expected);
    const double planned = mix(from.at[k].speed, from.at[k + 1].speed, part);
    state->valid = state->valid && vg_abs(state->d) <= beside_max
                   && vg_abs(state->s - expected) <= along_max
                   && vg_abs(rear->speed - planned) <= speed_error_max;
    return state->valid;
}

double vg_resume_level(const vg_job* job, double t, double speed)
{
    const verge_planner_def* def = job->def;
    if (job->before_age + t > def->point_s * (double)(def->points - 1u) - 1e-9) {
        return def->comfort_braking;
    }
    uint32_t k;
    const double part = at_time(job, t, &k);
    const verge_point* from = &job->before->points[k];
    const double planned = mix(from[0].speed, from[1].speed, part);
    return (from[0].speed - from[1].speed) / def->point_s + (speed - planned) / catch_up_s;
}

/// The interval of the last plan t [s] from now, and the part of it that is over. [1]
static double at_time(const vg_job* job, double t, uint32_t* k)
{
    const double at = (job->before_age + t) / job->def->point_s;
    const uint32_t last = job->def->points - 2u;
    *k = at < (double)last ? (uint32_t)at : last;
    return vg_clamp(at - (double)*k, 0.0, 1.0);
}

static bool can_resume(const vg_job* job)
{
    const verge_vehicle_plan* last = job->before;
    const verge_planner_def* def = job->def;
    if (last == NULL || last->vehicle_id != job->vehicle->id || last->point_count != def->points
        || (last->status != VERGE_PLANNED && last->status != VERGE_FALLBACK_KEEP_LANE)
        || !(job->before_age >= 0.0
             && job->before_age < def->point_s * (double)(def->points - 1u))) {
        return false;
    }
    bool usable = true;
    for (uint32_t k = 0; k < last->point_count; ++k) {
        const verge_point* p = &last->points[k];
        usable = usable && vg_abs(p->x) <= place_max && vg_abs(p->y) <= place_max
                 && vg_abs(p->heading) <= heading_max && p->speed >= 0.0 && p->speed <= speed_max
                 && vg_abs(p->curvature) <= curvature_max;
    }
    return usable;
}

/// Returns the length. [m]
static double trace_of(trace* self, const verge_vehicle_plan* plan, double rear_axle)
{
    double length = 0.0;
    self->count = plan->point_count;
    for (uint32_t k = 0; k < self->count; ++k) {
        const verge_point* p = &plan->points[k];
        const vg_motion centre = { p->x, p->y, p->heading, p->speed, p->acceleration,
                                   p->curvature };
        self->at[k] = vg_motion_of_rear(&centre, rear_axle);
        vg_sincos(p->heading, &self->sin_heading[k], &self->cos_heading[k]);
        if (k > 0) {
            const double x = self->at[k].x - self->at[k - 1].x;
            const double y = self->at[k].y - self->at[k - 1].y;
            const double turn = vg_wrap_angle(self->at[k].heading - self->at[k - 1].heading);
            length += vg_sqrt(x * x + y * y) * (1.0 + turn * turn / 24.0);
        }
        self->distance[k] = length;
    }
    return length;
}

/// Does each point follow from the one before? Between two points the rear axle moves in the mean
/// of both headings, at the mean of both speeds.
static bool is_smooth(const trace* from, double point_s)
{
    bool smooth = true;
    for (uint32_t k = 0; k + 1 < from->count; ++k) {
        const vg_motion *a = &from->at[k], *b = &from->at[k + 1];
        const double turn = vg_wrap_angle(b->heading - a->heading);
        const double way = 0.5 * (a->speed + b->speed) * point_s * (1.0 - turn * turn / 24.0);
        double sine, cosine;
        vg_sincos(a->heading + 0.5 * turn, &sine, &cosine);
        const double x = b->x - a->x - way * cosine, y = b->y - a->y - way * sine;
        smooth = smooth && vg_sqrt(x * x + y * y) <= jump_max * point_s * point_s;
    }
    return smooth;
}

/// Beyond the last point: an arc of its curvature.
static vg_motion beyond_end(const trace* from, double s)
{
    vg_motion at = from->at[from->count - 1];
    const double far = s - from->distance[from->count - 1];
    const double turn = at.curvature * far, chord = far * (1.0 - turn * turn / 24.0);
    double sine, cosine;
    vg_sincos(at.heading + 0.5 * turn, &sine, &cosine);
    at.x += chord * cosine;
    at.y += chord * sine;
    at.heading += turn;
    return at;
}

/// The curves through points k and k + 1, with the direction and curvature that they have.
static void between(const trace* from, uint32_t k, vg_quintic* x, vg_quintic* y)
{
    vg_axis_state ends_x[2], ends_y[2];
    for (uint32_t i = 0; i < 2; ++i) {
        const vg_motion* at = &from->at[k + i];
        const double c = from->cos_heading[k + i], s = from->sin_heading[k + i];
        ends_x[i] = (vg_axis_state){ at->x, c, -at->curvature * s };
        ends_y[i] = (vg_axis_state){ at->y, s, at->curvature * c };
    }
    const double length = from->distance[k + 1] - from->distance[k];
    *x = vg_quintic_between(ends_x[0], ends_x[1], length);
    *y = vg_quintic_between(ends_y[0], ends_y[1], length);
}

static void build(vg_path* path, const trace* from, double length)
{
    const uint32_t last = from->count - 1;
    const uint32_t wanted = (uint32_t)(length / spacing_min) + 1u;
    path->knot_count = wanted < path->knots_max ? wanted : path->knots_max;
    VERGE_ASSERT(path->knot_count >= 4);
    const double spacing = length / (double)(path->knot_count - 1u);
    path->knot_spacing = spacing;
    path->start = 0.0;
    uint32_t k = 0, of = last; // the curves are those behind point `of`
    vg_quintic x, y;
    vg_motion end = from->at[last];
    for (uint32_t i = 0; i < path->knot_count; ++i) {
        const double s = spacing * (double)i;
        path->h[i] = spacing;
        while (k < last && s >= from->distance[k + 1]) {
            ++k;
        }
        if (k < last) {
            if (of != k) {
                between(from, k, &x, &y);
                of = k;
            }
            path->x[i] = vg_quintic_at(&x, s - from->distance[k]).position;
            path->y[i] = vg_quintic_at(&y, s - from->distance[k]).position;
        } else {
            end = beyond_end(from, s);
            path->x[i] = end.x;
            path->y[i] = end.y;
        }
    }
    double sine, cosine;
    vg_sincos(end.heading, &sine, &cosine);
    const double x_slopes[2] = { from->cos_heading[0], cosine };
    const double y_slopes[2] = { from->sin_heading[0], sine };
    vg_spline_solve(path->x, path->h, path->knot_count, x_slopes, path->xss, path->work);
    vg_spline_solve(path->y, path->h, path->knot_count, y_slopes, path->yss, path->work);
}
