/// The fallback, for a vehicle without an acceptable sampled trajectory: a ladder of stopping
/// continuations (stop.h). Its rungs, the gentlest first:
///
///   go on with the last plan, no faster than now, to a comfortable stop after its end (resume.h)
///   keep the speed in the lane, or slow down with the limits of normal driving
///   brake in the lane, up to 8 m/s^2
///   the same towards an offset inside the lane, to pass beside a body
///   accelerate out of the way of a body that comes from behind or from the side
///   brake straight ahead, with the wheel turned back as fast as it can
///
/// The first rung that keeps to the limits of the body, meets no body and does not drive over the
/// end of its lane is taken. If there is none, of those within the limits the one whose contact is
/// the softest, and of these the latest; but the last plan, which may change lane, and accelerating
/// are only for vehicles that become clear by it. Nothing beyond the limits is ever emitted: the
/// last rung keeps to them by construction (vg_stop_straight). Off the road only that one is left.
///
/// A vehicle that overlaps a body in front brakes to a standstill unless that body moves away.
///
/// A vehicle that has to stop (vg_job.stops) takes the rungs that brake in the lane or straight
/// ahead alone.
#include "motion/contact.h"
#include "base/contract.h"
#include "motion/follow.h"
#include "motion/resume.h"
#include "motion/stop.h"
#include "motion/workspace.h"
#include "motion/trailer.h"

#include <stddef.h>

typedef enum way { RESUME, IN_LANE, ACCELERATE, STRAIGHT } way;

typedef struct rung {
    way    where;
    bool   brakes; // with the jerk of hard braking; else within the limits of normal driving
    double level;  // [m/s^2] deceleration
    double goal;   // [m] offset in the lane
} rung;

// Slowing down ends at comfort_braking; 8 m/s^2 is what tyres do on a dry road (reference car: 11.5
// at the very most).
static const rung rungs[] = {
    { RESUME, false, 0.0, 0.0 },
    { IN_LANE, false, 0.0, 0.0 },  { IN_LANE, false, 0.5, 0.0 },  { IN_LANE, false, 1.0, 0.0 },
    { IN_LANE, false, 1.5, 0.0 },  { IN_LANE, false, 2.0, 0.0 },  { IN_LANE, false, 3.0, 0.0 },
    { IN_LANE, false, 4.0, 0.0 },  { IN_LANE, false, 5.0, 0.0 },  { IN_LANE, false, 6.0, 0.0 },
    { IN_LANE, true, 3.0, 0.0 },   { IN_LANE, true, 5.0, 0.0 },   { IN_LANE, true, 6.5, 0.0 },
    { IN_LANE, true, 8.0, 0.0 },   { IN_LANE, false, 2.0, 0.3 },  { IN_LANE, false, 2.0, -0.3 },
    { IN_LANE, false, 2.0, 0.6 },  { IN_LANE, false, 2.0, -0.6 }, { IN_LANE, true, 5.0, 0.3 },
    { IN_LANE, true, 5.0, -0.3 },  { IN_LANE, true, 5.0, 0.6 },   { IN_LANE, true, 5.0, -0.6 },
    { IN_LANE, true, 8.0, 0.3 },   { IN_LANE, true, 8.0, -0.3 },  { IN_LANE, true, 8.0, 0.6 },
    { IN_LANE, true, 8.0, -0.6 },  { ACCELERATE, false, -1.5, 0.0 },
    { ACCELERATE, true, -3.0, 0.0 }, { STRAIGHT, true, 3.0, 0.0 }, { STRAIGHT, true, 5.0, 0.0 },
    { STRAIGHT, true, 6.5, 0.0 },  { STRAIGHT, true, 8.0, 0.0 },
};
enum { RUNGS = sizeof rungs / sizeof rungs[0] };

/// The gentlest deceleration of a vehicle that has to stop. [m/s^2]
static const double stop_level = 2.0;
/// Free space between the body and the lane boundary at an offset. [m]
static const double goal_reserve = 0.1;
/// Share of the limits that going on with the last plan may use: between its points, a line through
/// them is not exactly the plan. [1]
static const double resume_share = 0.98;
/// An overlap with a body in front may grow by this much. [m]
static const double overlap_tolerance = 1e-3;

/// What the rungs of one vehicle share.
typedef struct ladder {
    vg_workspace*       ws;
    const vg_job*       job;
    const verge_tracks* tracks;
    const vg_path*      path;  // of the lane; null: there is none to follow
    vg_state            state; // on this path
    vg_state            last;  // on the line of the last plan, built in `straight`
    vg_path*            straight;
    double              speed; // [m/s] of the centre
    double              acceleration;
} ladder;

/// The criteria of a rung, the most important one first.
typedef struct verdict {
    bool     clear;   // no contact, and braking before the end of the lane is possible
    bool     holds;   // the limits of the body
    bool     stays;   // does not drive over the end of its lane
    double   closing; // [m/s] difference of the velocities at the first contact; 0: no contact
    uint32_t contact; // instant of the first contact
    double   speed;   // [m/s] at the horizon
} verdict;

static ladder ladder_of(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);
static bool offers(const ladder* all, const rung* rung);
static vg_stop begin(const ladder* all, const rung* rung, vg_leg* leg);
static bool drive(const ladder* all, const rung* rung);
static verdict evaluate(const ladder* all, const rung* rung);
static bool needs_clear(const rung* rung);
static bool better(const ladder* all, const rung* rung, const verdict* a, const verdict* b);

void vg_vehicle_fall_back(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                          verge_vehicle_plan* plan, verge_reason reason)
{
    const ladder all = ladder_of(ws, job, tracks);
    verdict best = { .clear = false };
    const rung* taken = NULL;
    for (uint32_t i = 0; i < RUNGS && !best.clear; ++i) {
        if (offers(&all, &rungs[i])) {
            const verdict now = evaluate(&all, &rungs[i]);
            if (taken == NULL ? now.clear || !needs_clear(&rungs[i])
                              : better(&all, &rungs[i], &now, &best)) {
                best = now;
                taken = &rungs[i];
            }
        }
    }
    VERGE_ASSERT(taken != NULL);
    if (!best.clear) { // else it is the last one that was driven
        (void)drive(&all, taken);
    }
    ws->resumes = taken->where == RESUME;
    ws->cost = vg_motion_cost(ws->motion, ws->limits.rear_axle, job->def,
                              &job->vehicle->habit.weights, tracks, job->track_index);
    const bool brakes = (taken->brakes && taken->where != ACCELERATE) || job->stops;
    plan->status = brakes ? VERGE_FALLBACK_BRAKE : VERGE_FALLBACK_KEEP_LANE;
    plan->reason = reason;
    vg_workspace_emit(ws, job, plan);
}

static ladder ladder_of(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    ladder all = { .ws = ws, .job = job, .tracks = tracks, .straight = &ws->paths[0] };
    const double ratio = vg_sqrt(1.0 + vg_square(ws->limits.rear_axle * ws->start.curvature));
    all.speed = ws->start.speed * ratio;
    all.acceleration = ws->start.acceleration * ratio;
    if (job->on_road) {
        const vg_path* path = vg_workspace_path(ws, job, job->lane, NULL);
        all.state = vg_state_of(path, &ws->start, job->s);
        all.path = all.state.valid ? path : NULL;
        all.straight = &ws->paths[path == &ws->paths[0] ? 1 : 0];
    }
    ws->path_lanes[all.straight - ws->paths] = -1;
    if (job->on_road) {
        (void)vg_resume_path(all.straight, &all.last, job, &ws->start, ws->limits.rear_axle);
    }
    return all;
}

/// Can the vehicle try this rung?
static bool offers(const ladder* all, const rung* rung)
{
    const vg_job* job = all->job;
    if (job->stops && rung->level < stop_level) {
        return false;
    }
    if (rung->where == RESUME) {
        return all->last.valid && all->ws->blocking == 0;
    }
    if (rung->where == STRAIGHT) {
        return all->path == NULL || rung->level >= VG_DEAD_END_BRAKING;
    }
    const double room = all->path == NULL ? 0.0
                                          : 0.5 * job->road->lanes[job->lane].width
                                                - all->ws->body.half_width - goal_reserve;
    return all->path != NULL && (rung->brakes || rung->level <= job->def->comfort_braking)
           && (rung->goal == 0.0 || vg_abs(rung->goal) <= room)
           && (all->ws->blocking == 0 || (rung->where == IN_LANE && rung->goal == 0.0));
}

static vg_stop begin(const ladder* all, const rung* rung, vg_leg* leg)
{
    const verge_planner_def* def = all->job->def;
    const vg_limits* limits = &all->ws->limits;
    if (rung->where == RESUME) {
        vg_stop_in_lane(leg, all->straight, limits, &all->last, 0.0);
    } else if (rung->where == STRAIGHT) {
        vg_stop_straight(leg, all->straight, limits, &all->ws->start);
    } else {
        vg_stop_in_lane(leg, all->path, limits, &all->state, rung->goal);
    }
    const double jerk = rung->brakes ? VG_JERK_MAX : vg_min(def->comfort_jerk, VG_JERK_MAX);
    vg_stop stop = vg_stop_from(leg, rung->goal, all->speed, all->acceleration, rung->level, jerk);
    if (rung->where == RESUME) {
        stop.speed_max = all->speed; // no faster than now, even if the last plan accelerates
    } else if (all->job->on_road) {
        const double limit = all->job->road->lanes[all->job->lane].speed_limit;
        stop.speed_max = vg_max(limit, all->speed);
    }
    return stop;
}

/// Writes the trajectory of a rung to the workspace. True: it keeps to the limits of the body.
static bool drive(const ladder* all, const rung* rung)
{
    vg_workspace* ws = all->ws;
    const verge_planner_def* def = all->job->def;
    const uint32_t parts = vg_parts_of_point(def, VG_STOP_STEP);
    const double share = rung->where == RESUME ? resume_share : 1.0;
    vg_leg leg;
    vg_stop stop = begin(all, rung, &leg);
    bool holds = true;
    for (uint32_t k = 1; k < def->points; ++k) {
        vg_rear rear = { 0 };
        for (uint32_t i = 0; i < parts; ++i) {
            if (rung->where == RESUME) {
                const double t = def->point_s * ((double)(k - 1u) + (double)i / parts);
                stop.level = vg_resume_level(all->job, t, stop.speed);
            }
            vg_stop_advance(&stop, def->point_s / parts);
            rear = vg_stop_at(&stop);
            holds = holds && vg_hard_ratio(leg.limits, &rear, rear.speed) <= share;
        }
        vg_workspace_place(ws, k, &rear);
    }
    vg_workspace_pull_trailer(ws, 0, def->points - 1);
    return holds;
}

/// Length of the difference of two velocities at instant k. [m/s]
static double closing_speed(const verge_track* a, const verge_track* b, uint32_t k)
{
    const double x = a->speed[k] * a->cos_heading[k] - b->speed[k] * b->cos_heading[k];
    const double y = a->speed[k] * a->sin_heading[k] - b->speed[k] * b->sin_heading[k];
    return vg_sqrt(x * x + y * y);
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

/// The first contact with another body. True: an overlap that exists already grows.
static bool meet(const ladder* all, verdict* v)
{
    const vg_workspace* ws = all->ws;
    const uint32_t own = all->job->track_index, trailer = vg_trailer_of(all->tracks, own);
    const uint32_t last = all->job->def->points - 1;
    bool grows = false;
    for (uint32_t j = 0; j < all->tracks->count; ++j) {
        const verge_track* other = &all->tracks->of[j];
        if (j == own || j == trailer || (ws->ignored >> j & 1) != 0) {
            continue;
        }
        for (uint32_t i = 0; i < vg_workspace_bodies(ws); ++i) {
            const verge_track* body = vg_workspace_body(ws, i);
            const uint32_t k = vg_contact_new(body, other, 0.0, last);
            if (k <= last && k <= v->contact) {
                const double closing = closing_speed(body, other, k);
                v->closing = k < v->contact ? closing : vg_max(closing, v->closing);
                v->contact = k;
            }
        }
        grows |= (ws->blocking >> j & 1) != 0 && overlap_grows(&ws->body, other, last);
    }
    return grows;
}

/// Is the way ahead free for a vehicle that has accelerated? It may reach the speed at the horizon
/// only where comfortable braking afterwards keeps it behind all bodies ahead.
static bool way_is_free(const ladder* all)
{
    const verge_planner_def* def = all->job->def;
    const vg_following ahead = vg_following_to_horizon(
        def, all->path, all->tracks, all->job->track_index, all->ws->limits.rear_axle);
    return all->ws->motion[def->points - 1].speed
           <= vg_follow_speed(&ahead, &all->state, def->comfort_braking);
}

static verdict evaluate(const ladder* all, const rung* rung)
{
    const vg_job* job = all->job;
    vg_workspace* ws = all->ws;
    const uint32_t last = job->def->points - 1;
    verdict v = { .contact = last + 1 };
    v.holds = drive(all, rung);
    const bool grows = meet(all, &v);
    const vg_lane* lane = job->on_road ? &job->road->lanes[job->lane] : NULL;
    const bool ends = lane != NULL && lane->dead_end;
    const double later = rung->brakes ? VG_DEAD_END_BRAKING : job->def->comfort_braking;
    v.stays = !ends || !vg_workspace_runs_out(ws, job, lane, last, VG_DEAD_END_BRAKING, false);
    const bool easily = !ends || !vg_workspace_runs_out(ws, job, lane, last, later, false);
    v.speed = ws->body.speed[last];
    v.clear = v.holds && v.contact > last && easily && !grows
              && (rung->where != ACCELERATE || way_is_free(all));
    return v;
}

/// Is this rung for those only that become clear by it?
static bool needs_clear(const rung* rung)
{
    return rung->where == ACCELERATE || rung->where == RESUME;
}

/// Is rung a better than the best one before it, b? Staying on a lane that ends outranks avoiding a
/// contact: the vehicle behind can brake as well. With a body in front that it overlaps, a vehicle
/// brakes the harder the better.
static bool better(const ladder* all, const rung* rung, const verdict* a, const verdict* b)
{
    if (a->clear != b->clear) {
        return a->clear;
    }
    if (needs_clear(rung)) {
        return false;
    }
    if (a->holds != b->holds) {
        return a->holds;
    }
    if (all->ws->blocking != 0) {
        return a->holds && rung->where == IN_LANE;
    }
    if (a->stays != b->stays) {
        return a->stays;
    }
    if (!a->stays && a->speed != b->speed) {
        return a->speed < b->speed;
    }
    return a->closing != b->closing ? a->closing < b->closing : a->contact > b->contact;
}
