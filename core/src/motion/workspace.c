/// See workspace.h.
#include "motion/workspace.h"

#include "base/contract.h"
#include "motion/trailer.h"

static const double path_behind = 30.0;     // [m] length of a path behind the vehicle
static const double path_beyond = 60.0;     // [m] length of a path beyond the distance driven
static const double path_speed_gain = 10.0; // [m/s] above the speed of vehicle and lane
static const double path_speed_max = 70.0;  // [m/s] highest speed of any vehicle or lane
static const double path_ahead_max = 570.0; // [m] largest length of a path ahead of the vehicle
/// Distance for building up the braking force beyond the end of a lane. [m]
static const double over_end_distance = 1.0;
/// A slow lane change may swing out over the end by this much. [m]
static const double swing_out = 9.0;
/// Factor above the measured value, for limits exceeded at t = 0. [1]
static const double widening = 1.05;

static void widen(vg_limits* limits, const vg_motion* start);
static void find_near(vg_workspace* ws, uint32_t i, const vg_job* job, const verge_tracks* tracks);
static bool is_in_front(const verge_track* body, const verge_track* other);

// Largest number of knots of a path: the distance that the fastest vehicle drives in the horizon.
static uint32_t path_knots(const verge_planner_def* def)
{
    const double horizon = def->point_s * (def->points - 1);
    const double ahead =
        vg_min((path_speed_max + path_speed_gain) * horizon + path_beyond, path_ahead_max);
    return (uint32_t)((path_behind + ahead) / VG_KNOT_SPACING) + 3u;
}

vg_workspace* vg_workspace_take(vg_arena* arena, const verge_planner_def* def)
{
    vg_workspace* ws = vg_arena_take(arena, sizeof *ws);
    vg_workspace measured = { .lane = 0 };
    vg_workspace* to = ws != NULL ? ws : &measured; // a measuring arena returns null
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
        ws->start.speed = 0.0; // a standing vehicle does not accelerate backwards
        ws->start.acceleration = vg_max(ws->start.acceleration, 0.0);
    }
    widen(&ws->limits, &ws->start);
    ws->path_lanes[0] = ws->path_lanes[1] = -1;
    ws->resumes = false;
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
    for (uint32_t i = 0; i < vg_workspace_bodies(ws); ++i) {
        find_near(ws, i, job, tracks);
    }
}

/// Finds the other bodies that are near body i of the vehicle at t = 0.
static void find_near(vg_workspace* ws, uint32_t i, const vg_job* job, const verge_tracks* tracks)
{
    const verge_track* body = vg_workspace_body(ws, i);
    for (uint32_t j = 0; j < tracks->count; ++j) {
        const verge_track* other = &tracks->of[j];
        if (j != job->track_index && j != vg_trailer_of(tracks, job->track_index)
            && vg_contact_at(body, other, job->def->clearance, 0)) {
            ws->near_start[i] |= (uint64_t)1 << j;
            const bool overlap = vg_contact_at(body, other, 0.0, 0);
            ws->refusals.overlap |= overlap;
            ws->blocking |= (uint64_t)(i == 0 && overlap && is_in_front(body, other)) << j;
        }
    }
}

/// Widens the limits that are exceeded at t = 0: the present motion cannot change at once. A truck
/// may drive downhill faster than its limiter, and a measured acceleration may exceed the engine's.
static void widen(vg_limits* limits, const vg_motion* start)
{
    const double v = start->speed, a = start->acceleration;
    const double engine = a * vg_max(1.0, v * limits->per_speed_switch);
    const double lateral = v * v * start->curvature * limits->lateral_share;
    const double square = a * a + lateral * lateral;
    if (v * limits->per_speed > 1.0) {
        limits->per_speed = 1.0 / (widening * v);
    }
    if (engine * limits->per_acceleration > 1.0) {
        limits->per_acceleration = 1.0 / (widening * engine);
    }
    if (square * limits->per_braking_squared > 1.0) {
        limits->per_braking_squared = 1.0 / (widening * widening * square);
    }
}

/// Of two bodies that overlap: is the other one in front? It is not if it is behind, or at the side
/// with a lateral overlap of less than a quarter of the mean width.
static bool is_in_front(const verge_track* body, const verge_track* other)
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
    for (uint32_t i = 0; i < 2; ++i) {
        if (ws->path_lanes[i] == (int32_t)lane) {
            return &ws->paths[i];
        }
    }
    const uint32_t slot = keep == &ws->paths[0] ? 1 : 0;
    const double horizon = job->def->point_s * (job->def->points - 1);
    const vg_lane* of = &job->road->lanes[lane];
    const double guess = lane == job->lane ? job->s : __builtin_nan("");
    const double s = vg_lane_project(of, ws->start.x, ws->start.y, guess);
    const double speed = vg_max(ws->start.speed, of->speed_limit) + path_speed_gain;
    const double ahead = vg_min(speed * horizon + path_beyond, path_ahead_max);
    vg_path_build(&ws->paths[slot], job->road, lane, job->target, s - path_behind, s + ahead);
    ws->path_lanes[slot] = (int32_t)lane;
    return &ws->paths[slot];
}

void vg_workspace_place(vg_workspace* ws, uint32_t k, const vg_rear* rear)
{
    VERGE_ASSERT(k > 0 && k < VERGE_POINTS_MAX);
    verge_track* body = &ws->body;
    const double rear_axle = ws->limits.rear_axle;
    ws->motion[k] = *rear;
    body->x[k] = rear->x + rear_axle * rear->cos_heading;
    body->y[k] = rear->y + rear_axle * rear->sin_heading;
    body->cos_heading[k] = rear->cos_heading;
    body->sin_heading[k] = rear->sin_heading;
    body->speed[k] =
        vg_max(rear->speed, 0.0) * vg_sqrt(1.0 + vg_square(rear_axle * rear->curvature));
}

void vg_workspace_pull_trailer(vg_workspace* ws, uint32_t start, uint32_t last)
{
    if (vg_workspace_bodies(ws) > 1) {
        vg_trailer_follow(&ws->shape, &ws->body, &ws->trailer, start, last);
    }
}

void vg_workspace_drive(vg_workspace* ws, const verge_planner_def* def, const vg_leg* leg,
                        double offset, uint32_t start, uint32_t last)
{
    for (uint32_t k = start + 1; k <= last; ++k) {
        const vg_row row = vg_leg_row(leg, def->point_s * (k - start));
        const vg_rear rear = vg_rear_of(&row, offset);
        vg_workspace_place(ws, k, &rear);
    }
    vg_workspace_pull_trailer(ws, start, last);
}

bool vg_workspace_runs_out(const vg_workspace* ws, const vg_job* job, const vg_lane* lane,
                           uint32_t last, double braking, bool swings_out)
{
    VERGE_ASSERT(last < VERGE_POINTS_MAX && braking > 0.0);
    const verge_track* body = &ws->body;
    double s = __builtin_nan(""), end = lane->length + (swings_out ? swing_out : 0.0);
    for (uint32_t k = 0; k <= last; ++k) {
        s = vg_lane_project(lane, body->x[k], body->y[k], s);
        const vg_reference at = vg_lane_at(lane, s);
        const double d = (body->y[k] - at.y) * at.cos_heading
                       - (body->x[k] - at.x) * at.sin_heading;
        const bool inside = vg_abs(d) <= 0.5 * lane->width;
        double front = s + body->half_length;
        if (k == 0 && inside && front > lane->length) {
            end = vg_max(end, front + body->speed[0] * body->speed[0] / (2.0 * braking)
                                  + over_end_distance);
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
    VERGE_ASSERT(job->def->points <= VERGE_POINTS_MAX);
    const verge_vehicle* v = job->vehicle;
    plan->point_count = job->def->points;
    plan->cost = ws->cost;
    plan->points[0] = (verge_point){ 0.0, v->x, v->y, v->heading, v->speed, v->acceleration,
                                     job->curvature, 0.0 };
    for (uint32_t k = 1; k < job->def->points; ++k) {
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
