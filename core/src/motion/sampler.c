/// The trajectory of one vehicle: a greedy chain of segments (section 3.2.2). For each segment all
/// candidates of its target region are evaluated (batch.c). In the order of cost, the first one
/// that passes every exact check is taken. Its end is the start of the next segment.
///
/// Attempts, until one succeeds: as decided; in the present lane for the whole horizon; both again
/// without the limits of normal driving; the fallback. A decision that brakes harder than normal
/// driving does begins without these limits. A slow vehicle that is turned against its lane
/// straightens out before all these. Where these hinder a slow vehicle, close behind another one or
/// in a corner that is sharper than its steering, the same simulated driver does better
/// (straighten.h).
#include "motion/sampler.h"

#include "motion/contact.h"
#include "base/contract.h"
#include "motion/straighten.h"
#include "motion/target.h"
#include "motion/trailer.h"
#include "motion/workspace.h"

#include <stddef.h>

enum {
    first_tries_max = 6, // candidates of the first segment that are tried; each costs one batch
    limit_parts = 10,    // parts of a step in the exact limit check: 10 ms each at 0.1 s
    inside_tries_max = 16, // candidates tried after the first one whose nose leaves the lane
};
/// The nose of a vehicle that keeps its lane may be this far beyond the lane's edge. [m]
static const double edge_slack = 0.1;
/// Below this speed brakes may be released faster than the jerk limit. [m/s]
static const double jolt_speed = 0.5;
/// A slower vehicle stands; a faster one does not need the simulated driver. [m/s]
static const double standing = 0.3, walking = 2.0;
/// A change of lane that ends this far from where it was decided is late. The simulated driver is
/// taken if it ends nearer by the second. [m]
static const double late_from = 0.6, nearer_by = 0.2;
/// An end speed decided below the comfortable ones by this much is meant. [m/s]
static const double hard_from = 1.0;
/// A lane change over the end of a lane is no faster than this. [m/s]
static const double swing_out_speed = 10.0;

/// The inputs of a chain.
typedef struct chain {
    const vg_job*    job;
    const verge_tracks* tracks;
    bool emergency;
} chain;

static bool plan_sampled(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);
static bool attempt_chains(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);
static double distance_beside(const vg_workspace* ws, const vg_job* job, uint32_t lane);
static bool is_hindered(const vg_job* job, double speed);
static bool plan_chain(vg_workspace* ws, const chain* chain, const vg_segment* segments,
                       uint32_t count);
static bool plan_rest(vg_workspace* ws, const chain* chain, const vg_segment* segments,
                      uint32_t count, uint32_t start, uint32_t lane);
static bool prepare(vg_workspace* ws, vg_batch* batch, const chain* chain,
                    const vg_segment* segment, uint32_t start, uint32_t lane,
                    const vg_motion* from);
static bool choose(vg_workspace* ws, vg_batch* batch, const chain* chain, uint32_t lane,
                   uint32_t* choice);
static bool acceptable(vg_workspace* ws, const vg_batch* batch, const chain* chain,
                       uint32_t lane, uint32_t candidate);
static bool runs_out(const vg_workspace* ws, const vg_batch* batch, const chain* chain,
                     uint32_t lane);
static bool leaves_lane(const vg_workspace* ws, const vg_batch* batch, const vg_job* job,
                        uint32_t lane, const vg_leg* leg);
static double nose_beyond_lane(const vg_workspace* ws, const vg_batch* batch, const vg_job* job,
                               uint32_t lane, uint32_t candidate);
static void take(vg_workspace* ws, const vg_batch* batch, const chain* chain, uint32_t lane,
                 uint32_t candidate);
static bool limits_hold(const vg_batch* batch, const verge_planner_def* def, const vg_leg* leg,
                        double offset);
static const verge_track* first_met(const vg_workspace* ws, const vg_batch* batch,
                                    const chain* chain);
static bool body_collides(const vg_workspace* ws, uint32_t i, const vg_batch* batch,
                          const chain* chain, uint32_t j);
static uint32_t reference_lane(const vg_job* job, const vg_segment* segment, uint32_t lane);
static uint32_t instant_of(const vg_job* job, const vg_segment* segment);

void vg_vehicle_plan_trajectory(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                                verge_vehicle_plan* plan)
{
    VERGE_ASSERT(job->def->points >= 2 && job->def->points <= VERGE_POINTS_MAX);
    vg_workspace_begin(ws, job, tracks);
    if (job->vehicle->speed < 0.0) {
        vg_vehicle_stop_reversing(ws, job, plan);
        return;
    }
    if (job->stops || !job->on_road) {
        vg_vehicle_fall_back(ws, job, tracks, plan,
                             job->stops ? VERGE_REASON_STOP : VERGE_REASON_OFF_ROAD);
        return;
    }
    if (ws->blocking != 0) { // a body in front overlaps
        vg_vehicle_fall_back(ws, job, tracks, plan, VERGE_REASON_OVERLAP_NOW);
        return;
    }
    if (!plan_sampled(ws, job, tracks)) {
        const vg_refusals* r = &ws->refusals;
        const verge_reason reason = r->overlap        ? VERGE_REASON_OVERLAP_NOW
                                    : r->uncontrolled ? VERGE_REASON_COLLISION
                                    : r->controlled   ? VERGE_REASON_JOINT
                                                      : VERGE_REASON_NO_FEASIBLE;
        vg_vehicle_fall_back(ws, job, tracks, plan, reason);
        return;
    }
    // A trajectory that begins with an overlap is used, but it is reported as a fallback.
    plan->status = ws->refusals.overlap ? VERGE_FALLBACK_KEEP_LANE : VERGE_PLANNED;
    plan->reason = ws->refusals.overlap ? VERGE_REASON_OVERLAP_NOW : VERGE_REASON_NONE;
    vg_workspace_emit(ws, job, plan);
}

/// A trajectory that is no fallback.
static bool plan_sampled(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const uint32_t lane = vg_straighten_lane(job), last = job->def->points - 1;
    if (vg_straighten_applies(ws, job) && vg_straighten(ws, job, tracks, lane)) {
        ws->keeps_lane = lane == job->lane;
        return true;
    }
    const bool found = attempt_chains(ws, job, tracks);
    if (!vg_straighten_can(ws, job)) {
        return found;
    }
    const double speed = found ? ws->motion[last].speed : -1.0;
    const double beside = found && !ws->keeps_lane ? distance_beside(ws, job, lane) : VG_HUGE;
    const bool late = lane != job->lane && beside > late_from
                      && vg_straighten_is_close(ws, job, tracks);
    if (found && !late && !is_hindered(job, speed)) {
        return true;
    }
    ws->keeps_lane = lane == job->lane;
    const bool better = vg_straighten(ws, job, tracks, lane)
                        && (late ? distance_beside(ws, job, lane) < beside - nearer_by
                                 : ws->motion[last].speed > speed + standing);
    // The workspace holds one trajectory: that of the chains is planned again.
    return better || (found && attempt_chains(ws, job, tracks));
}

/// Distance of the end of the trajectory beside where the decision is at the horizon, if that is on
/// the lane. [m]
static double distance_beside(const vg_workspace* ws, const vg_job* job, uint32_t lane)
{
    const uint32_t last = job->def->points - 1;
    const vg_segment* end = &job->segments[job->segment_count - 1];
    const vg_lane* of = &job->road->lanes[lane];
    const double s = vg_lane_project(of, ws->body.x[last], ws->body.y[last], __builtin_nan(""));
    const vg_reference line = vg_lane_at(of, s);
    const double d = vg_left_of(&line, ws->body.x[last], ws->body.y[last]);
    return vg_abs(d - (end->lane == lane ? end->d : 0.0));
}

/// Does the trajectory end much slower than decided, and slowly? Then its polynomials cannot follow
/// the way: out from behind a body, or through a corner sharper than the steering allows. A vehicle
/// that has to stop or stand before is not hindered.
static bool is_hindered(const vg_job* job, double speed)
{
    const double decided = job->segments[job->segment_count - 1].v;
    for (uint32_t i = 0; i < job->segment_count; ++i) {
        if (job->segments[i].v < standing) {
            return false;
        }
    }
    return decided > 2.0 * standing && speed < 0.75 * vg_min(decided, walking);
}

/// Does the decision brake in its first segment harder than the comfortable jerk allows? Its end
/// speed is then below the lowest one of a profile (target.c).
static bool brakes_hard(const vg_workspace* ws, const vg_job* job)
{
    const vg_segment* first = &job->segments[0];
    const double least = vg_profile_end_speed(ws->start.speed, ws->start.acceleration,
                                              first->t1 - first->t0, -job->def->comfort_jerk);
    return first->v < vg_max(least, 0.0) - hard_from;
}

static bool attempt_chains(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const vg_segment keep = { .t1 = job->def->point_s * (job->def->points - 1),
                              .action = VERGE_KEEP_SPEED, .lane = job->lane, .s = job->s,
                              .v = job->vehicle->speed };
    bool found = false;
    for (uint32_t attempt = brakes_hard(ws, job) ? 2 : 0; attempt < 4 && !found; ++attempt) {
        const chain chain = { job, tracks, attempt >= 2 };
        ws->keeps_lane = attempt % 2 != 0;
        found = ws->keeps_lane ? plan_chain(ws, &chain, &keep, 1)
                               : plan_chain(ws, &chain, job->segments, job->segment_count);
    }
    return found;
}

static bool plan_chain(vg_workspace* ws, const chain* chain, const vg_segment* segments,
                       uint32_t count)
{
    const vg_job* job = chain->job;
    // Segments that end before the first instant are skipped.
    while (count > 1 && instant_of(job, segments) == 0) {
        ++segments;
        --count;
    }
    if (count == 0) {
        return false;
    }
    vg_batch* batch = &ws->first;
    const uint32_t lane = reference_lane(job, segments, job->lane);
    batch->last = count == 1 ? job->def->points - 1 : instant_of(job, segments);
    if (!prepare(ws, batch, chain, segments, 0, lane, &ws->start)) {
        return false;
    }
    for (uint32_t i = 0; i < first_tries_max; ++i) {
        uint32_t choice;
        ws->cost = (verge_cost){ 0 };
        if (!choose(ws, batch, chain, lane, &choice)) {
            return false;
        }
        if (plan_rest(ws, chain, segments + 1, count - 1, batch->last, lane)) {
            return true;
        }
        const uint32_t leg = choice / batch->offset_count;
        for (uint32_t j = 0; j < batch->offset_count; ++j) {
            batch->marks[leg * batch->offset_count + j] |= VG_TRIED; // next: another end speed
        }
    }
    return false;
}

/// Continues from instant `start`, with the cheapest acceptable candidate of each segment.
static bool plan_rest(vg_workspace* ws, const chain* chain, const vg_segment* segments,
                      uint32_t count, uint32_t start, uint32_t lane)
{
    const vg_job* job = chain->job;
    for (uint32_t i = 0; i < count && start + 1 < job->def->points; ++i) {
        const bool last = i + 1 == count;
        const uint32_t end = last ? job->def->points - 1 : instant_of(job, &segments[i]);
        if (end <= start) {
            continue;
        }
        lane = reference_lane(job, &segments[i], lane);
        const vg_motion motion = vg_motion_of(&ws->motion[start]);
        uint32_t choice;
        ws->later.last = end;
        if (!prepare(ws, &ws->later, chain, &segments[i], start, lane, &motion)
            || !choose(ws, &ws->later, chain, lane, &choice)) {
            return false;
        }
        start = end;
    }
    return start + 1 == job->def->points;
}

/// Samples and evaluates the candidates of a segment.
static bool prepare(vg_workspace* ws, vg_batch* batch, const chain* chain,
                    const vg_segment* segment, uint32_t start, uint32_t lane,
                    const vg_motion* from)
{
    const vg_job* job = chain->job;
    const verge_planner_def* def = job->def;
    const vg_path* keep = start == 0 ? NULL : ws->first.legs[0].path;
    const vg_path* path = vg_workspace_path(ws, job, lane, keep);
    // On the vehicle's own lane the coordinate is known. A search could find another turn of a
    // ring.
    const bool same = lane == (start == 0 ? job->lane : ws->lane);
    const double near = start == 0 ? job->s : ws->s;
    const double guess = same ? near
                              : vg_lane_project(&job->road->lanes[lane], from->x, from->y,
                                                __builtin_nan(""));
    const vg_state state = vg_state_of(path, from, guess);
    if (!state.valid) {
        return false;
    }
    const double T = def->point_s * (batch->last - start);
    batch->start = start;
    batch->in_lane = !vg_action_changes_lane(segment->action);
    batch->aim = batch->in_lane ? segment->d : 0.0;
    // The present acceleration cannot change at once: limits that it exceeds are widened.
    const double lateral = vg_abs(from->speed * from->speed * from->curvature);
    const double a = from->acceleration;
    batch->comfort = (vg_comfort){ 1.0 / vg_max(def->comfort_acceleration, 1.05 * a),
                                   1.0 / vg_max(def->comfort_braking, -1.05 * a),
                                   1.0 / vg_max(def->comfort_lateral, 1.05 * lateral),
                                   1.0 / def->comfort_jerk };
    vg_target_sample(batch, job, &ws->limits, segment, path, lane, &state, T, chain->tracks,
                     chain->emergency);
    vg_batch_run(batch, def, &job->vehicle->habit.weights, chain->tracks, job->track_index);
    ws->evaluated += batch->leg_count * batch->offset_count;
    return true;
}

/// Chooses the cheapest acceptable candidate whose nose stays in the lane, else the one of some
/// whose nose leaves it least, and adds its points and its cost to the trajectory.
static bool choose(vg_workspace* ws, vg_batch* batch, const chain* chain, uint32_t lane,
                   uint32_t* choice)
{
    const uint32_t count = batch->leg_count * batch->offset_count;
    const unsigned refuse = VG_TRIED | VG_INFEASIBLE | (chain->emergency ? 0u : VG_UNCOMFORTABLE);
    uint32_t outside = count, tries = 0;
    double beyond_least = VG_HUGE; // of `outside`
    for (uint32_t round = 0; round < count && tries < inside_tries_max; ++round) {
        uint32_t best = count;
        double least = VG_HUGE;
        for (uint32_t i = 0; i < count; ++i) {
            const double cost = batch->costs[i] + batch->leg_penalties[i / batch->offset_count]
                              + batch->offset_penalties[i % batch->offset_count];
            if ((batch->marks[i] & refuse) == 0 && cost < least) {
                least = cost;
                best = i;
            }
        }
        if (best == count) {
            break;
        }
        batch->marks[best] |= VG_TRIED;
        tries += outside < count ? 1u : 0u;
        if (!acceptable(ws, batch, chain, lane, best)) {
            continue;
        }
        const double beyond =
            batch->in_lane ? nose_beyond_lane(ws, batch, chain->job, lane, best) : 0.0;
        if (beyond <= 0.0) {
            take(ws, batch, chain, lane, best);
            *choice = best;
            return true;
        }
        if (beyond < beyond_least - edge_slack) {
            outside = best;
            beyond_least = beyond;
        }
    }
    if (outside == count) {
        return false;
    }
    const bool again = acceptable(ws, batch, chain, lane, outside); // its motion
    VERGE_ASSERT(again);
    take(ws, batch, chain, lane, outside);
    *choice = outside;
    return again;
}

static void take(vg_workspace* ws, const vg_batch* batch, const chain* chain, uint32_t lane,
                 uint32_t candidate)
{
    const vg_job* job = chain->job;
    const vg_leg* leg = &batch->legs[candidate / batch->offset_count];
    const verge_cost cost =
        vg_leg_cost(leg, batch->offsets[candidate % batch->offset_count], batch->start, batch->last,
                    job->def, &job->vehicle->habit.weights, chain->tracks, job->track_index,
                    batch->in_lane, batch->aim);
    vg_cost_add(&ws->cost, &cost);
    if (batch->start == 0) {
        ws->lateral_end = leg->by_distance ? batch->lateral_s : leg->span;
    }
    ws->lane = lane;
    ws->s = vg_profile_at(&leg->profile, job->def->point_s * (batch->last - batch->start)).s;
}

/// A slow lane change from the end of a lane: the nose may swing out over the end.
static bool slowly_out(const vg_workspace* ws, const vg_batch* batch)
{
    bool slow = !batch->in_lane;
    for (uint32_t k = 0; k <= batch->last; ++k) {
        slow = slow && ws->body.speed[k] <= swing_out_speed;
    }
    return slow;
}

/// The checks of a candidate, the cheapest first. The most expensive one, that of the limits
/// between the points, can be left out after a contact if it is known already that such contacts occur.
static bool acceptable(vg_workspace* ws, const vg_batch* batch, const chain* chain,
                       uint32_t lane, uint32_t candidate)
{
    const vg_job* job = chain->job;
    const vg_leg* leg = &batch->legs[candidate / batch->offset_count];
    const double offset = batch->offsets[candidate % batch->offset_count];
    vg_workspace_drive(ws, job->def, leg, offset, batch->start, batch->last);
    if (batch->in_lane && leaves_lane(ws, batch, job, lane, leg)) {
        return false;
    }
    const bool alarm = (batch->marks[candidate] & VG_ALARM) != 0;
    const verge_track* met = alarm ? first_met(ws, batch, chain) : NULL;
    bool* refused = met == NULL       ? NULL
                    : met->controlled ? &ws->refusals.controlled
                                      : &ws->refusals.uncontrolled;
    if (met == NULL ? runs_out(ws, batch, chain, lane) : *refused) {
        return false;
    }
    const bool holds = limits_hold(batch, job->def, leg, offset);
    if (refused != NULL) {
        *refused = holds;
        return false;
    }
    return holds;
}

/// Does the candidate drive over the end of the present lane or of the reference lane?
static bool runs_out(const vg_workspace* ws, const vg_batch* batch, const chain* chain,
                     uint32_t lane)
{
    const vg_job* job = chain->job;
    const double braking = chain->emergency ? VG_DEAD_END_BRAKING : job->def->comfort_braking;
    const vg_lane* lanes = job->road->lanes;
    return (lanes[job->lane].dead_end
            && vg_workspace_runs_out(ws, job, &lanes[job->lane], batch->last, braking,
                                     slowly_out(ws, batch)))
        || (lane != job->lane && lanes[lane].dead_end
            && vg_workspace_runs_out(ws, job, &lanes[lane], batch->last, braking, false));
}

/// Does a lane-keeping segment end beyond the lane boundary, and farther out than it began?
static bool leaves_lane(const vg_workspace* ws, const vg_batch* batch, const vg_job* job,
                        uint32_t lane, const vg_leg* leg)
{
    const verge_track* body = &ws->body;
    const uint32_t k0 = batch->start, k = batch->last;
    const double T = job->def->point_s * (k - k0);
    const vg_reference from = vg_path_at(leg->path, leg->s_start + leg->limits->rear_axle);
    const double s_end = vg_profile_at(&leg->profile, T).s;
    const vg_reference to = vg_path_at(leg->path, s_end + leg->limits->rear_axle);
    const double d0 = vg_abs(vg_left_of(&from, body->x[k0], body->y[k0]));
    const double d = vg_abs(vg_left_of(&to, body->x[k], body->y[k]));
    return d > 0.5 * job->road->lanes[lane].width && d > d0;
}

/// How far the nose of a vehicle that keeps its lane gets beyond the edge, and farther out than it
/// began. [m] 0: it stays inside
static double nose_beyond_lane(const vg_workspace* ws, const vg_batch* batch, const vg_job* job,
                               uint32_t lane, uint32_t candidate)
{
    const verge_track* body = &ws->body;
    const vg_leg* leg = &batch->legs[candidate / batch->offset_count];
    const double half = job->vehicle->length * 0.5;
    const double edge = 0.5 * job->road->lanes[lane].width + edge_slack;
    double s = leg->s_start + leg->limits->rear_axle + half;
    double from = 0.0, beyond = 0.0;
    for (uint32_t k = batch->start; k <= batch->last; ++k) {
        const double x = body->x[k] + half * body->cos_heading[k];
        const double y = body->y[k] + half * body->sin_heading[k];
        s = vg_path_project(leg->path, x, y, s);
        const vg_reference at = vg_path_at(leg->path, s);
        const double d = vg_abs(vg_left_of(&at, x, y));
        from = k == batch->start ? d : from;
        beyond = vg_max(beyond, d - vg_max(edge, from));
    }
    return beyond;
}

/// Checks the limits of the body between the points as well, and the jerk limit of the brakes. At
/// walking speed the braking force may decrease faster than the jerk limit, but not increase.
static bool limits_hold(const vg_batch* batch, const verge_planner_def* def, const vg_leg* leg,
                        double offset)
{
    const uint32_t count = (batch->last - batch->start) * limit_parts;
    for (uint32_t i = 1; i <= count; ++i) {
        const vg_row row = vg_leg_row(leg, def->point_s * i / limit_parts);
        const vg_rear rear = vg_rear_of(&row, offset);
        const bool jolts = row.s_ttt < -VG_JERK_MAX
                        || (row.s_ttt > VG_JERK_MAX && row.s_t > jolt_speed);
        if (jolts || !(vg_hard_ratio(leg->limits, &rear, row.s_t) <= 1.0)) {
            return false;
        }
    }
    return true;
}

/// The exact check: the first track that the vehicle or its trailer touches up to the end of this
/// leg, null if there is none.
static const verge_track* first_met(const vg_workspace* ws, const vg_batch* batch,
                                    const chain* chain)
{
    const verge_tracks* tracks = chain->tracks;
    const uint32_t own = chain->job->track_index, trailer = vg_trailer_of(tracks, own);
    for (uint32_t i = 0; i < vg_workspace_bodies(ws); ++i) {
        for (uint32_t j = 0; j < tracks->count; ++j) {
            const bool yields = (ws->ignored >> j & 1) != 0;
            if (j != own && j != trailer && !yields && body_collides(ws, i, batch, chain, j)) {
                return &tracks->of[j];
            }
        }
    }
    return NULL;
}

/// Does body i of the vehicle touch track j?
static bool body_collides(const vg_workspace* ws, uint32_t i, const vg_batch* batch,
                          const chain* chain, uint32_t j)
{
    const verge_track* body = vg_workspace_body(ws, i);
    const verge_track* other = &chain->tracks->of[j];
    const double clearance = chain->job->def->clearance;
    const uint32_t last = batch->last;
    if ((ws->near_start[i] >> j & 1) == 0) {
        return vg_contact_first(body, other, clearance, batch->start, last) <= last;
    }
    // The bodies must separate before the end of the horizon, and not touch again.
    const bool whole = last + 1 == chain->job->def->points;
    return vg_contact_new(body, other, clearance, last) <= last
        || (whole && vg_contact_at(body, other, 0.0, last));
}

/// The lane whose line a segment follows, from `lane`. Lane keeping continues along the path of the
/// lane, through its successors. A lane change leads to the neighbour, also if the decision ends it
/// on a successor of the neighbour.
static uint32_t reference_lane(const vg_job* job, const vg_segment* segment, uint32_t lane)
{
    const verge_road* road = job->road;
    if (!vg_action_changes_lane(segment->action)) {
        return lane;
    }
    const vg_lane* from = &road->lanes[lane];
    const int32_t beside = segment->action == VERGE_CHANGE_LEFT ? from->left : from->right;
    if (beside < 0) {
        return segment->lane;
    }
    vg_walk walk = vg_walk_from(road, (uint32_t)beside, job->target);
    do {
        if (walk.lane == segment->lane) {
            return (uint32_t)beside;
        }
    } while (walk.passed < 3 && vg_walk_on(&walk));
    return segment->lane;
}

/// The trajectory instant nearest to a segment's end, at most the last one.
static uint32_t instant_of(const vg_job* job, const vg_segment* segment)
{
    const double k = segment->t1 / job->def->point_s + 0.5;
    return k >= (double)job->def->points ? job->def->points - 1 : k < 0.0 ? 0 : (uint32_t)k;
}
