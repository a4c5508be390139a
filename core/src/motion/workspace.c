/// See workspace.h.
#include "motion/workspace.h"

#include "base/contract.h"
#include "motion/trailer.h"

/// Path kept behind the vehicle and beyond its farthest end. [m]
#define PATH_BEHIND 30.0
#define PATH_BEYOND 60.0
/// Speed a vehicle can gain on what is planned. [m/s]
#define PATH_SPEED_GAIN 10.0
/// Beyond the speed of any vehicle or lane that is accepted. [m/s]
#define PATH_SPEED_MAX 70.0
/// The farthest end of any path. [m]
#define PATH_AHEAD_MAX (600.0 - PATH_BEHIND)
/// Way who is over a lane's end already gets for building up the brakes' force. [m]
#define OVER_END_SLACK 1.0

/// Limits already broken at t = 0 are taken this much above what is measured. [1]
#define WIDENING 1.05

static void widen(vg_limits* limits, const vg_motion* start);
static void note_near(vg_workspace* ws, uint32_t i, const vg_job* job, const verge_tracks* tracks);
static bool in_front(const verge_track* body, const verge_track* other);

// Knots that the longest path of a job takes: as long as the fastest vehicle drives within the horizon.
static uint32_t path_knots(const verge_planner_def* def)
{
    const double horizon = def->point_s * (def->points - 1);
    const double ahead = vg_min((PATH_SPEED_MAX + PATH_SPEED_GAIN) * horizon + PATH_BEYOND, PATH_AHEAD_MAX);
    return (uint32_t)((PATH_BEHIND + ahead) / VG_KNOT_SPACING) + 3u;
}

vg_workspace* vg_workspace_take(vg_arena* arena, const verge_planner_def* def)
{
    vg_workspace* ws = vg_arena_take(arena, sizeof *ws);
    vg_workspace measured = { .lane = 0 };
    vg_workspace* to = ws != NULL ? ws : &measured; // a measuring arena hands out nothing
    vg_paths_take(to->paths, arena, path_knots(def));
    vg_batch_take(&to->first, arena, def);
    vg_batch_take(&to->later, arena, def);
    return ws;
}

void vg_workspace_begin(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const verge_vehicle* v = job->vehicle;
    const verge_track* own = &tracks->of[job->track_index];
    const vg_motion centre = { v->x, v->y, v->heading, v->speed, v->acceleration,
                               job->curvature };
    ws->shape = verge_vehicle_body(v);
    ws->limits = vg_limits_of(&ws->shape);
    ws->start = vg_motion_of_rear(&centre, ws->limits.rear_axle);
    if (ws->start.speed < 1e-3) {
        ws->start.speed = 0.0; // at rest nothing pulls backwards
        ws->start.acceleration = vg_max(ws->start.acceleration, 0.0);
    }
    widen(&ws->limits, &ws->start);
    ws->path_lanes[0] = ws->path_lanes[1] = -1;
    ws->cost = (verge_cost){ 0 };
    ws->refusals = (vg_refusals){ 0 };
    ws->near_start[0] = ws->near_start[1] = ws->blocking = 0;

    verge_track* body = &ws->body;
    body->vehicle_id = v->id;
    body->controlled = true;
    body->half_length = own->half_length;
    body->half_width = own->half_width;
    body->x[0] = v->x;
    body->y[0] = v->y;
    vg_sincos(v->heading, &body->sin_heading[0], &body->cos_heading[0]);
    body->speed[0] = v->speed;
    if (vg_workspace_bodies(ws) > 1) {
        vg_trailer_start(v, &ws->shape, body, &ws->trailer);
    }
    for (uint32_t i = 0; i < vg_workspace_bodies(ws); i += 1) {
        note_near(ws, i, job, tracks);
    }
}

/// Other bodies that are near one of the vehicle's own at t = 0 already.
static void note_near(vg_workspace* ws, uint32_t i, const vg_job* job, const verge_tracks* tracks)
{
    const verge_track* body = vg_workspace_body(ws, i);
    for (uint32_t j = 0; j < tracks->count; j += 1) {
        const verge_track* other = &tracks->of[j];
        if (j != job->track_index && j != vg_trailer_of(tracks, job->track_index)
            && vg_contact_at(body, other, job->def->clearance, 0)) {
            ws->near_start[i] |= (uint64_t)1 << j;
            const bool overlap = vg_contact_at(body, other, 0.0, 0);
            ws->refusals.overlap |= overlap;
            ws->blocking |= (uint64_t)(i == 0 && overlap && in_front(body, other)) << j;
        }
    }
}

/// What the vehicle does already cannot be undone at once: a truck downhill drives faster than its
/// limiter, a measured acceleration may be more than the engine's.
static void widen(vg_limits* limits, const vg_motion* start)
{
    const double v = start->speed, a = start->acceleration;
    const double engine = a * vg_max(1.0, v * limits->per_speed_switch);
    const double lateral = v * v * start->curvature * limits->lateral_share;
    const double square = a * a + lateral * lateral;
    if (v * limits->per_speed > 1.0) {
        limits->per_speed = 1.0 / (WIDENING * v);
    }
    if (engine * limits->per_acceleration > 1.0) {
        limits->per_acceleration = 1.0 / (WIDENING * engine);
    }
    if (square * limits->per_braking_squared > 1.0) {
        limits->per_braking_squared = 1.0 / (WIDENING * WIDENING * square);
    }
}

/// Of two bodies that overlap: is the other one in front, rather than behind or at the side,
/// where a quarter of a width at most is shared?
static bool in_front(const verge_track* body, const verge_track* other)
{
    const double c = body->cos_heading[0], s = body->sin_heading[0];
    const double x = other->x[0] - body->x[0], y = other->y[0] - body->y[0];
    const double ahead = x * c + y * s, left = vg_abs(y * c - x * s);
    const double width = body->half_width + other->half_width;
    return ahead > body->half_length || (ahead > 0.0 && left < 0.75 * width);
}

const vg_path* vg_workspace_path(vg_workspace* ws, const vg_job* job, uint32_t lane,
                                 const vg_path* keep)
{
    for (uint32_t i = 0; i < 2; i += 1) {
        if (ws->path_lanes[i] == (int32_t)lane) {
            return &ws->paths[i];
        }
    }
    const uint32_t slot = keep == &ws->paths[0] ? 1 : 0;
    const double horizon = job->def->point_s * (job->def->points - 1);
    const vg_lane* of = &job->road->lanes[lane];
    const double guess = lane == job->lane ? job->s : __builtin_nan("");
    const double s = vg_lane_project(of, ws->start.x, ws->start.y, guess);
    const double speed = vg_max(ws->start.speed, of->speed_limit) + PATH_SPEED_GAIN;
    const double ahead = vg_min(speed * horizon + PATH_BEYOND, PATH_AHEAD_MAX);
    vg_path_build(&ws->paths[slot], job->road, lane, job->target, s - PATH_BEHIND, s + ahead);
    ws->path_lanes[slot] = (int32_t)lane;
    return &ws->paths[slot];
}

void vg_workspace_drive(vg_workspace* ws, const verge_planner_def* def, const vg_leg* leg,
                        double offset, uint32_t start, uint32_t last)
{
    VERGE_ASSERT(last < VERGE_POINTS_MAX);
    verge_track* body = &ws->body;
    const double rear_axle = ws->limits.rear_axle;
    for (uint32_t k = start + 1; k <= last; k += 1) {
        const vg_row row = vg_leg_row(leg, def->point_s * (k - start));
        const vg_rear rear = vg_rear_of(&row, offset);
        ws->motion[k] = rear;
        body->x[k] = rear.x + rear_axle * rear.cos_heading;
        body->y[k] = rear.y + rear_axle * rear.sin_heading;
        body->cos_heading[k] = rear.cos_heading;
        body->sin_heading[k] = rear.sin_heading;
        body->speed[k] = vg_max(rear.speed, 0.0)
                       * vg_sqrt(1.0 + vg_square(rear_axle * rear.curvature));
    }
    if (vg_workspace_bodies(ws) > 1) {
        vg_trailer_follow(&ws->shape, body, &ws->trailer, start, last);
    }
}

bool vg_workspace_runs_out(const vg_workspace* ws, const vg_job* job, const vg_lane* lane,
                           uint32_t last, double braking)
{
    const verge_track* body = &ws->body;
    double s = __builtin_nan(""), end = lane->length;
    for (uint32_t k = 0; k <= last; k += 1) {
        s = vg_lane_project(lane, body->x[k], body->y[k], s);
        const vg_reference at = vg_lane_at(lane, s);
        const double d = (body->y[k] - at.y) * at.cos_heading
                       - (body->x[k] - at.x) * at.sin_heading;
        const bool inside = vg_abs(d) <= 0.5 * lane->width;
        double front = s + body->half_length;
        if (k == 0 && inside && front > lane->length) {
            end = front + body->speed[0] * body->speed[0] / (2.0 * braking) + OVER_END_SLACK;
        }
        if (k + 1 == job->def->points) {
            front += body->speed[k] * body->speed[k] / (2.0 * braking);
        }
        if (k > 0 && inside && front > end) {
            return true;
        }
    }
    return false;
}

void vg_cost_add(verge_cost* sum, const verge_cost* cost)
{
    sum->total += cost->total;
    sum->curvature += cost->curvature;
    sum->heading += cost->heading;
    sum->offset += cost->offset;
    sum->acceleration += cost->acceleration;
    sum->jerk += cost->jerk;
    sum->obstacle += cost->obstacle;
}

void vg_workspace_emit(const vg_workspace* ws, const vg_job* job, verge_vehicle_plan* plan)
{
    const verge_vehicle* v = job->vehicle;
    plan->point_count = job->def->points;
    plan->cost = ws->cost;
    plan->points[0] = (verge_point){ 0.0, v->x, v->y, v->heading, v->speed, v->acceleration,
                                     job->curvature, 0.0 };
    for (uint32_t k = 1; k < job->def->points; k += 1) {
        const vg_rear* rear = &ws->motion[k];
        const vg_motion motion = vg_motion_of(rear);
        const vg_motion centre = vg_motion_of_centre(&motion, rear->curvature_t,
                                                     ws->limits.rear_axle);
        plan->points[k] = (verge_point){ job->def->point_s * k, centre.x, centre.y,
                                         centre.heading, centre.speed, centre.acceleration,
                                         centre.curvature, rear->jerk };
    }
    plan->points[0].jerk = job->def->points > 1 ? plan->points[1].jerk : 0.0;
}
