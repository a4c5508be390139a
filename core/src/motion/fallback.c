/// The fallback, for a vehicle without an acceptable sampled trajectory: first gentle deceleration
/// in the lane (the lowest level keeps the speed), then braking of up to 8 m/s^2. The first one
/// without contact is taken, else the one with the latest contact, and of these the slowest. A
/// vehicle that overlaps a body in front brakes to a standstill unless that body moves away.
///
/// All of them limit their jerk, end at standstill or at constant speed, and move towards the
/// centre of the lane within the steering limits. Off the road they are straight.
#include "motion/contact.h"
#include "base/contract.h"
#include "motion/target.h"
#include "motion/workspace.h"
#include "motion/trailer.h"

/// Decelerations tried [m/s^2]. Slowing down ends at comfort_braking; 8 is what tyres do on a
/// dry road (reference car: 11.5 at the very most).
static const double keep_levels[] = { 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0 };
static const double brake_levels[] = { 3.0, 5.0, 6.5, 8.0 };
/// Shortest duration of the lateral motion to the centre of the lane. [s]
static const double centring_s = 3.0;
#define LEVELS(levels) (sizeof(levels) / sizeof(levels)[0])
enum { limit_parts = 10 }; // parts of a step in the limit check

/// Braking that may be needed after the horizon before the end of a lane, on a dry road. [m/s^2]
static const double dead_end_braking = 8.0;
/// An overlap with a body in front may grow by this much. [m]
static const double overlap_tolerance = 1e-3;

/// The criteria of a fallback, the most important one first.
typedef struct verdict {
    bool     clear;   // no contact, and braking before the end of the lane is possible
    bool     holds;   // the limits of the body
    bool     stays;   // does not drive over the end of its lane
    uint32_t contact; // instant of the first contact
    double   speed;   // then, or at the horizon where it does not stay
} verdict;

static const vg_path* fallback_path(vg_workspace* ws, const vg_job* job, vg_state* state);
static void straight_path(vg_path* path, const vg_motion* from);
static vg_leg fallback_leg(const vg_job* job, const vg_limits* limits, const vg_path* path,
                           const vg_state* state, double level, double jerk);
static verdict evaluate(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                        const vg_leg* leg, double braking);
static bool overlap_grows(const verge_track* body, const verge_track* other, uint32_t last);
static bool better(const verdict* a, const verdict* b);

void vg_vehicle_fall_back(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                          verge_vehicle_plan* plan, verge_reason reason)
{
    const verge_planner_def* def = job->def;
    vg_state state;
    const vg_path* path = fallback_path(ws, job, &state);
    // Off the road there is no lane to keep: brake at once.
    const uint32_t from = job->on_road ? 0 : LEVELS(keep_levels);
    verdict best = { 0 };
    vg_leg best_leg;
    bool best_brakes = true;
    for (uint32_t i = from; i < LEVELS(keep_levels) + LEVELS(brake_levels) && !best.clear; ++i) {
        const bool brakes = i >= LEVELS(keep_levels);
        const double level = brakes ? brake_levels[i - LEVELS(keep_levels)] : keep_levels[i];
        if (!brakes && level > def->comfort_braking) {
            continue;
        }
        const double jerk = brakes ? VG_JERK_MAX : vg_min(def->comfort_jerk, VG_JERK_MAX);
        const vg_leg leg = fallback_leg(job, &ws->limits, path, &state, level, jerk);
        const double later = brakes ? dead_end_braking : def->comfort_braking;
        const verdict now = evaluate(ws, job, tracks, &leg, later);
        if (i == from || better(&now, &best) || (ws->blocking != 0 && now.holds)) {
            best = now;
            best_leg = leg;
            best_brakes = brakes;
        }
    }
    vg_workspace_drive(ws, def, &best_leg, 0.0, 0, def->points - 1);
    ws->cost = vg_leg_cost(&best_leg, 0.0, 0, def->points - 1, def,
                           &job->vehicle->habit.weights, tracks, job->track_index, true);
    plan->status = best_brakes ? VERGE_FALLBACK_BRAKE : VERGE_FALLBACK_KEEP_LANE;
    plan->reason = reason;
    vg_workspace_emit(ws, job, plan);
}

static const vg_path* fallback_path(vg_workspace* ws, const vg_job* job, vg_state* state)
{
    if (job->on_road) {
        const vg_path* path = vg_workspace_path(ws, job, job->lane, NULL);
        *state = vg_state_of(path, &ws->start, job->s);
        if (state->valid) {
            return path;
        }
    }
    straight_path(&ws->paths[0], &ws->start);
    ws->path_lanes[0] = -1;
    *state = (vg_state){ 0.0, ws->start.speed, ws->start.acceleration, 0.0, 0.0,
                         ws->start.curvature, true };
    return &ws->paths[0];
}

/// The straight line ahead of the rear axle; its coordinate is 0 there.
static void straight_path(vg_path* path, const vg_motion* from)
{
    double sine, cosine;
    vg_sincos(from->heading, &sine, &cosine);
    path->knot_count = 8;
    path->knot_spacing = 100.0;
    path->start = -100.0;
    path->anchor = 0;
    for (uint32_t i = 0; i < path->knot_count; ++i) {
        const double s = path->start + path->knot_spacing * i;
        path->x[i] = from->x + s * cosine;
        path->y[i] = from->y + s * sine;
        path->xss[i] = path->yss[i] = 0.0;
    }
}

static vg_leg fallback_leg(const vg_job* job, const vg_limits* limits, const vg_path* path,
                           const vg_state* state, double level, double jerk)
{
    vg_leg leg = { .path = path, .limits = limits,
                   .profile = vg_profile_braking(state, level, jerk) };
    vg_leg_link(&leg, state, vg_max(centring_s, job->def->point_s * (job->def->points - 1)), 0.0);
    return leg;
}

/// braking: largest braking that may be needed after the horizon before the end of the lane.
/// [m/s^2]
static verdict evaluate(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                        const vg_leg* leg, double braking)
{
    const verge_planner_def* def = job->def;
    const uint32_t last = def->points - 1;
    verdict v = { .holds = true, .contact = last + 1 };
    for (uint32_t i = 1; i <= last * limit_parts && v.holds; ++i) {
        const vg_row row = vg_leg_row(leg, def->point_s * i / limit_parts);
        const vg_rear rear = vg_rear_of(&row, 0.0);
        v.holds = vg_hard_ratio(leg->limits, &rear, row.s_t) <= 1.0;
    }
    vg_workspace_drive(ws, def, leg, 0.0, 0, last);
    bool grows = false;
    const uint32_t trailer = vg_trailer_of(tracks, job->track_index);
    for (uint32_t j = 0; j < tracks->count; ++j) {
        if (j != job->track_index && j != trailer) {
            for (uint32_t i = 0; i < vg_workspace_bodies(ws); ++i) {
                const uint32_t k = vg_contact_new(vg_workspace_body(ws, i), &tracks->of[j], 0.0,
                                                  last);
                v.contact = k < v.contact ? k : v.contact;
            }
            grows |= (ws->blocking >> j & 1) != 0
                    && overlap_grows(&ws->body, &tracks->of[j], last);
        }
    }
    const vg_lane* lane = job->on_road ? &job->road->lanes[job->lane] : NULL;
    const bool ends = lane != NULL && lane->dead_end;
    v.stays = !ends || !vg_workspace_runs_out(ws, job, lane, last, dead_end_braking);
    v.speed = ws->body.speed[v.contact <= last && v.stays ? v.contact : last];
    const bool easily = !ends || !vg_workspace_runs_out(ws, job, lane, last, braking);
    v.clear = v.holds && v.contact > last && easily && !grows;
    return v;
}

/// Does the overlap with a body in front grow?
static bool overlap_grows(const verge_track* body, const verge_track* other, uint32_t last)
{
    double first = 0.0;
    for (uint32_t k = 0; k <= last && vg_contact_at(body, other, 0.0, k); ++k) {
        const double ahead = (other->x[k] - body->x[k]) * body->cos_heading[k]
                           + (other->y[k] - body->y[k]) * body->sin_heading[k];
        first = k == 0 ? ahead : first;
        if (ahead < first - overlap_tolerance) {
            return true;
        }
    }
    return false;
}

/// Staying on a lane that ends outranks avoiding a contact: the vehicle behind can brake as well.
/// If neither fallback stays on the lane, the slower one is better.
static bool better(const verdict* a, const verdict* b)
{
    if (a->clear != b->clear) {
        return a->clear;
    }
    if (a->holds != b->holds) {
        return a->holds;
    }
    if (a->stays != b->stays) {
        return a->stays;
    }
    if (!a->stays && a->speed != b->speed) {
        return a->speed < b->speed;
    }
    return a->contact != b->contact ? a->contact > b->contact : a->speed < b->speed;
}
