/// The trajectory of a vehicle that moves backwards: it brakes to a standstill, straight along its
/// heading. Driving backwards is not planned.
#include "base/contract.h"
#include "base/scalar.h"
#include "motion/workspace.h"
#include "verge/limits.h"

/// Deceleration of a comfortable stop, and the jerk that builds it up. [m/s^2], [m/s^3]
static const double reverse_braking = 3.0;
static const double reverse_jerk = 10.0;
enum { reverse_parts = 10 }; // parts of a step in the integration

void vg_vehicle_stop_reversing(vg_workspace* ws, const vg_job* job, verge_vehicle_plan* plan)
{
    const verge_vehicle* v = job->vehicle;
    const uint32_t last = job->def->points - 1u;
    const double dt = job->def->point_s / reverse_parts;
    VERGE_ASSERT(v->speed < 0.0 && last < VERGE_POINTS_MAX);
    verge_track* body = &ws->body;
    double way = 0.0, speed = v->speed, a = v->acceleration;
    plan->status = VERGE_FALLBACK_BRAKE;
    plan->reason = VERGE_REASON_OFF_ROAD;
    plan->point_count = last + 1u;
    plan->points[0] = (verge_point){ .x = v->x, .y = v->y, .heading = v->heading, .speed = speed,
                                     .acceleration = a, .curvature = job->curvature };
    for (uint32_t k = 1; k <= last; ++k) {
        const double a_before = a;
        for (uint32_t i = 0; i < reverse_parts; ++i) {
            a = vg_clamp(reverse_braking, a - reverse_jerk * dt, a + reverse_jerk * dt);
            const double next = vg_clamp(speed + a * dt, VERGE_LIMIT_SPEED_MIN, 0.0);
            way += 0.5 * (speed + next) * dt;
            speed = next;
        }
        a = speed < 0.0 ? a : 0.0;
        body->x[k] = v->x + way * body->cos_heading[0];
        body->y[k] = v->y + way * body->sin_heading[0];
        body->cos_heading[k] = body->cos_heading[0];
        body->sin_heading[k] = body->sin_heading[0];
        body->speed[k] = speed;
        plan->points[k] = (verge_point){ .t = job->def->point_s * k, .x = body->x[k],
                                         .y = body->y[k], .heading = v->heading, .speed = speed,
                                         .acceleration = a,
                                         .jerk = (a - a_before) / job->def->point_s };
    }
    plan->points[0].jerk = plan->points[1].jerk;
    vg_workspace_pull_trailer(ws, 0, last);
}
