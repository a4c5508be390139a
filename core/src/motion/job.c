/// See job.h.
#include "motion/job.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "base/stage.h"
#include "motion/segments.h"
#include "motion/trailer.h"
#include "motion/why.h"
#include "traffic/flow.h"

#include <string.h>

// No track leads this far. [m], also [m/s] and [1]
static const double track_max = 1e8;
// Tolerance for the size of a body in its track. [m]
static const double size_slack = 1e-6;
// No vehicle steers as sharply as this: such a curvature of the last trajectory is not used. [1/m]
static const double curvature_max = 100.0;
// A slower vehicle stands. [m/s]
static const double standing = 0.05;
// A controlled vehicle farther behind than this is no follower. [m]
static const double follower_distance = 200.0;
// A vehicle nearer than this to its last trajectory follows it. [m]
static const double on_plan_distance = 0.3;
// A change is complete on its lane, nearer to the centre than this. Lane keeping does the rest. [m]
static const double change_done_within = 0.2;
// Mean acceleration from which a motion is speeding up, or slowing down. [m/s^2]
static const double action_from = 0.15;
// Mean acceleration that keeping the speed may begin with. [m/s^2]
static const double keeping_within = 0.5;
// The first part of a step, which the plan of the next cycle usually replaces. [s]
static const double step_begin_s = 0.5;
// Deceleration above which the brake lights are on: more than engine braking. [m/s^2]
static const double brake_light_from = 0.8;

static double known_curvature(const verge_planner_def* def, const verge_vehicle* v, int64_t utime,
                              const verge_vehicle_plan* before);
static bool on_trajectory(const verge_vehicle* v, const verge_vehicle_plan* before, uint32_t k);
static uint64_t followers_of(const verge_scene* scene, uint32_t own);
static void finish_change(const vg_expected* expected, int64_t utime,
                          const verge_vehicle_plan* before, vg_job* job);
static void brake_off_road(const verge_planner_def* def, const verge_vehicle* vehicle,
                           verge_vehicle_plan* plan);

bool vg_job_begin(vg_job* job, const verge_planner_def* def, const verge_scene* scene,
                  uint32_t vehicle_index, const verge_vehicle_decision* decision,
                  const verge_vehicle_plan* before, verge_vehicle_plan* plan)
{
    VERGE_ASSERT(vehicle_index < scene->vehicle_count);
    const verge_vehicle* vehicle = &scene->vehicles[vehicle_index];
    const verge_lane_position* at = &scene->positions[vehicle_index];
    memset(job, 0, sizeof *job);
    job->def = def;
    job->road = scene->road;
    job->vehicle = vehicle;
    job->on_road = vg_scene_moves_along(scene, vehicle_index);
    job->s = at->s;
    job->d = at->d;
    job->target = -1;
    job->change_lane = -1;
    // A vehicle that stands can turn its wheels to the lane's curvature before it starts.
    job->curvature = vg_abs(vehicle->speed) < standing
                         ? at->curvature : known_curvature(def, vehicle, scene->utime, before);
    job->track_index = vehicle_index;
    job->before = before;
    job->before_age = before == NULL ? 0.0 : vg_seconds_between(before->utime, scene->utime);
    if (!job->on_road) {
        memset(plan, 0, sizeof *plan);
        brake_off_road(def, vehicle, plan);
    } else {
        const double horizon = def->point_s * (double)(def->points - 1u);
        vg_expected expected;
        if (decision == NULL || !vg_expected_from(&expected, scene, vehicle_index, decision)
            || expected.t[expected.step_count] < horizon - 1e-9) {
            return false;
        }
        job->lane = expected.states[0].lane;
        job->target = vg_road_lane_index(scene->road, vehicle->target_lane);
        job->followers = followers_of(scene, vehicle_index);
        vg_segments_from(&expected, job);
        if (def->search != VERGE_SEARCH_PAPER) {
            finish_change(&expected, scene->utime, before, job);
        }
        memset(plan, 0, sizeof *plan);
        plan->action_count = decision->step_count;
        memcpy(plan->actions, decision->steps, decision->step_count * sizeof decision->steps[0]);
        plan->decided = decision->steps[0].action;
        plan->why = decision->why;
        plan->pass_count = decision->pass_count;
        memcpy(plan->passes, decision->passes, decision->pass_count * sizeof decision->passes[0]);
    }
    plan->vehicle_id = vehicle->id;
    plan->utime = scene->utime;
    return true;
}

// Is the body of `own` ahead of that of `behind`, on the way of `behind`?
static bool is_ahead(const verge_scene* scene, uint32_t own, uint32_t behind)
{
    const verge_road* road = scene->road;
    const verge_lane_position *at = &scene->positions[own], *from = &scene->positions[behind];
    const int32_t start = vg_road_lane_index(road, from->lane_id);
    if (start < 0 || at->lane_id == VERGE_NO_LANE) {
        return false;
    }
    vg_walk walk = vg_walk_from(road, (uint32_t)start,
                                vg_road_lane_index(road, scene->vehicles[behind].target_lane));
    const double bodies = 0.5 * (scene->vehicles[own].length + scene->vehicles[behind].length);
    double distance = at->s - from->s;
    while (road->lanes[walk.lane].id != at->lane_id || distance < bodies) {
        distance += road->lanes[walk.lane].length;
        if (distance - at->s > follower_distance || !vg_walk_on(&walk)) {
            return false;
        }
    }
    return distance <= follower_distance;
}

// Controlled vehicles behind this one, which plan behind whatever it does.
static uint64_t followers_of(const verge_scene* scene, uint32_t own)
{
    uint64_t set = 0;
    for (uint32_t k = 0; k < scene->vehicle_count; ++k) {
        const bool follows = k != own && scene->vehicles[k].controlled && is_ahead(scene, own, k)
                             && !is_ahead(scene, k, own);
        set |= follows ? (uint64_t)1 << k : 0;
    }
    return set;
}

// Curvature of the vehicle's path at t = 0. Below 2 m/s, or without a measured yaw rate, it is that
// of the last trajectory if the vehicle follows it. Otherwise a vehicle in a bend at low speed
// would be planned straight ahead in every cycle.
static double known_curvature(const verge_planner_def* def, const verge_vehicle* v, int64_t utime,
                              const verge_vehicle_plan* before)
{
    if (v->speed >= VERGE_SPEED_SLOW && vg_finite(v->yaw_rate)) {
        return v->yaw_rate / v->speed;
    }
    if (before == NULL) {
        return 0.0;
    }
    const double age = vg_seconds_between(before->utime, utime) / def->point_s;
    if (!(age >= 0.0 && age <= (double)(def->points - 1u))) {
        return 0.0;
    }
    const uint32_t k = (uint32_t)(age + 0.5);
    const bool known = on_trajectory(v, before, k)
                       && vg_abs(before->points[k].curvature) <= curvature_max;
    return known ? before->points[k].curvature : 0.0;
}

static bool on_trajectory(const verge_vehicle* v, const verge_vehicle_plan* before, uint32_t k)
{
    if (before->vehicle_id != v->id || k >= before->point_count) {
        return false;
    }
    const double dx = before->points[k].x - v->x, dy = before->points[k].y - v->y;
    return dx * dx + dy * dy < on_plan_distance * on_plan_distance;
}

// Has the vehicle arrived on the lane that its last trajectory changes to? Without this end a
// change would be continued for ever: what is left of it is at least finish_min (segments.c), which
// is longer than a cycle, and would be remembered as a change in progress.
static bool change_is_done(const vg_job* job, int32_t lane)
{
    return vg_road_continues(job->road, (uint32_t)lane, job->lane)
           && vg_abs(job->d) < change_done_within;
}

// Continues a lane change in progress of a vehicle that follows its last trajectory.
static void finish_change(const vg_expected* expected, int64_t utime,
                          const verge_vehicle_plan* before, vg_job* job)
{
    if (before == NULL) {
        return;
    }
    const double age = vg_seconds_between(before->utime, utime);
    const double k = age / job->def->point_s + 0.5;
    const int32_t lane = vg_road_lane_index(job->road, before->change_lane_id);
    if (k >= 0.0 && k < (double)job->def->points && lane >= 0 && before->change_end > age
        && !change_is_done(job, lane) && on_trajectory(job->vehicle, before, (uint32_t)k)) {
        vg_segments_finish_change(expected, (uint32_t)lane, before->change_end - age, job);
    }
}

// Actions of a vehicle on no lane: it decelerates.
static void brake_off_road(const verge_planner_def* def, const verge_vehicle* vehicle,
                           verge_vehicle_plan* plan)
{
    double v = vehicle->speed;
    plan->action_count = def->steps;
    for (uint32_t t = 0; t < def->steps; ++t) {
        v = vg_max(v - def->deceleration * def->step_s, 0.0);
        plan->actions[t] = (verge_action_step){
            .action = VERGE_DECELERATE,
            .lane_id = VERGE_NO_LANE,
            .t0 = (double)t * def->step_s,
            .t1 = (double)(t + 1u) * def->step_s,
            .v = v,
            .brake_light = true,
            .ahead_id = -1,
            .behind_id = -1,
        };
    }
}

// The lane to which the trajectory changes, if it does. If no candidate for a lane change was
// acceptable, the vehicle keeps its lane.
static int32_t lane_changed_to(const vg_job* job, const verge_vehicle_plan* plan)
{
    if (plan->status != VERGE_PLANNED || job->change_lane < 0) {
        return VERGE_NO_LANE;
    }
    const int32_t lane = job->road->lanes[job->change_lane].id;
    const verge_point* end = &plan->points[plan->point_count - 1u];
    const verge_lane_position at =
        verge_road_project(job->road, end->x, end->y, end->heading, lane);
    return at.contained && verge_road_continues(job->road, lane, at.lane_id) ? lane : VERGE_NO_LANE;
}

// Mean acceleration of the trajectory up to time t. [m/s^2]
static double mean_acceleration(const verge_vehicle_plan* plan, double t)
{
    uint32_t k = 1;
    while (k + 1u < plan->point_count && plan->points[k].t < t - 1e-9) {
        ++k;
    }
    return (plan->points[k].speed - plan->points[0].speed) / plan->points[k].t;
}

static verge_action action_of(double acceleration)
{
    return acceleration > action_from    ? VERGE_ACCELERATE
           : acceleration < -action_from ? VERGE_DECELERATE
                                         : VERGE_KEEP_SPEED;
}

// The action that the trajectory shows in the present step: that of its mean acceleration, unless
// it begins with another motion.
static verge_action action_driven(const verge_vehicle_plan* plan)
{
    VERGE_ASSERT(plan->point_count >= 2);
    const double step_s = plan->actions[0].t1;
    const double first = mean_acceleration(plan, vg_min(step_begin_s, step_s));
    const verge_action action = action_of(mean_acceleration(plan, step_s));
    const bool fits = action == VERGE_ACCELERATE   ? first >= -action_from
                      : action == VERGE_DECELERATE ? first <= action_from
                                                   : vg_abs(first) <= keeping_within;
    return fits ? action : action_of(first);
}

// People read the action of the present step and see the motion: it is that of the trajectory
// unless it changes lane. The decision keeps its own.
static void set_present_action(const vg_workspace* workspace, verge_vehicle_plan* plan)
{
    verge_action_step* step = &plan->actions[0];
    const bool changes = vg_action_changes_lane((uint8_t)step->action) && !workspace->keeps_lane
                         && (plan->status == VERGE_PLANNED || workspace->resumes);
    if (plan->action_count == 0 || changes) {
        return;
    }
    const verge_action driven = action_driven(plan);
    step->brake_light = step->brake_light && driven == VERGE_DECELERATE;
    step->action = driven;
}

// Brake lights depend on the deceleration of the trajectory, not only on the decided action.
static void set_brake_lights(verge_vehicle_plan* plan)
{
    for (uint32_t t = 0; t < plan->action_count; ++t) {
        verge_action_step* step = &plan->actions[t];
        for (uint32_t k = 0; k < plan->point_count; ++k) {
            const verge_point* p = &plan->points[k];
            if (p->t >= step->t0 && p->t < step->t1 && p->acceleration < -brake_light_from) {
                step->brake_light = true;
            }
        }
    }
}

void vg_job_end(const vg_job* job, const vg_workspace* workspace, const verge_scene* scene,
                const verge_vehicle_plan* before, verge_vehicle_plan* plan)
{
    set_present_action(workspace, plan);
    set_brake_lights(plan);
    plan->change_lane_id = lane_changed_to(job, plan);
    plan->change_end = workspace->lateral_end;
    if (workspace->resumes) { // with the change that the last plan has begun, if any
        VERGE_ASSERT(before != NULL);
        plan->change_lane_id = before->change_lane_id;
        plan->change_end = before->change_end - job->before_age;
    }
    vg_why_fill(scene, job->track_index, plan);
    vg_why_compare(plan, before);
}

// ---------------------------------------------------------------------------- the stage alone

struct verge_sampler {
    verge_planner_def def;
    vg_workspace*     workspace;
    vg_job            job;
    uint64_t          candidates;
};

static void* take(vg_arena* arena, const verge_planner_def* def)
{
    verge_sampler* self = vg_arena_take(arena, sizeof *self);
    vg_workspace* workspace = vg_workspace_take(arena, def);
    if (self != NULL) {
        self->def = *def;
        self->def.road = (verge_road_def){ NULL, 0 };
        self->workspace = workspace;
    }
    return self;
}

size_t verge_sampler_memory_size(const verge_planner_def* def)
{
    return vg_stage_size(def, take);
}

verge_status verge_sampler_init(verge_sampler** sampler, const verge_planner_def* def, void* memory,
                                size_t size)
{
    if (sampler == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    void* stage = NULL;
    const verge_status status = vg_stage_init(&stage, def, memory, size, take);
    *sampler = stage;
    return status;
}

static bool track_holds(const verge_track* track, uint32_t points)
{
    bool holds = track->half_length >= 0.0 && track->half_length <= track_max
                 && track->half_width >= 0.0 && track->half_width <= track_max;
    for (uint32_t k = 0; k < points; ++k) {
        holds = holds && vg_abs(track->x[k]) <= track_max && vg_abs(track->y[k]) <= track_max
                && vg_abs(track->cos_heading[k]) <= track_max
                && vg_abs(track->sin_heading[k]) <= track_max
                && vg_abs(track->speed[k]) <= track_max;
    }
    return holds;
}

// The own track says how large the body is that has to fit between the others.
static bool own_track_holds(const verge_track* track, const verge_vehicle* vehicle)
{
    verge_track begun;
    verge_track_begin(&begun, vehicle);
    return vg_abs(track->half_length - begun.half_length) <= size_slack
           && vg_abs(track->half_width - begun.half_width) <= size_slack;
}

// A track that is not finite would be a body that nothing ever meets. Tracks in another order would
// hide one vehicle and put the own body of the controlled vehicle in its path.
static bool tracks_hold(const verge_tracks* tracks, const verge_scene* scene, uint32_t own,
                        uint32_t points)
{
    const uint32_t trailer = vg_trailer_of(tracks, own);
    bool holds = own_track_holds(&tracks->of[own], &scene->vehicles[own]);
    for (uint32_t i = 0; i < tracks->count; ++i) {
        const verge_track* track = &tracks->of[i];
        holds = holds && (i >= scene->vehicle_count || track->vehicle_id == scene->vehicles[i].id)
                && (i == own || i == trailer || track_holds(track, points));
    }
    return holds;
}

// Checks the arguments of a planning function, and finds the vehicle in the scene.
static verge_status check_call(const verge_sampler* self, const verge_scene* scene,
                               int32_t vehicle_id, const verge_tracks* tracks,
                               const verge_vehicle_plan* before, const verge_vehicle_plan* plan,
                               uint32_t* vehicle_index)
{
    if (self == NULL || tracks == NULL || plan == NULL || before == plan || !vg_scene_holds(scene)
        || (tracks->of == NULL && tracks->count > 0)) {
        return VERGE_ERR_ARGUMENT;
    }
    const int32_t index = verge_scene_find(scene, vehicle_id);
    if (index < 0 || !scene->vehicles[index].controlled) {
        return VERGE_ERR_VEHICLE;
    }
    *vehicle_index = (uint32_t)index;
    const uint32_t trailer = tracks->count < scene->vehicle_count ? 0 : tracks->of[index].trailer;
    if (tracks->count < scene->vehicle_count || tracks->count > VERGE_VEHICLES_MAX
        || trailer >= tracks->count) {
        return VERGE_ERR_CAPACITY;
    }
    return tracks_hold(tracks, scene, (uint32_t)index, self->def.points) ? VERGE_OK
                                                                         : VERGE_ERR_VEHICLE;
}

static void run_job(verge_sampler* self, const verge_scene* scene, const verge_tracks* tracks,
                    const verge_vehicle_plan* before, verge_vehicle_plan* plan)
{
    self->workspace->evaluated = 0;
    self->workspace->ignored = 0;
    vg_vehicle_plan_trajectory(self->workspace, &self->job, tracks, plan);
    self->candidates += self->workspace->evaluated;
    vg_job_end(&self->job, self->workspace, scene, before, plan);
}

verge_status verge_plan_vehicle_for(uint64_t config, verge_sampler* self, const verge_scene* scene,
                                    const verge_vehicle_decision* decision,
                                    const verge_tracks* tracks, const verge_vehicle_plan* before,
                                    verge_vehicle_plan* plan)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    if (decision == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    uint32_t index = 0;
    const verge_status status =
        check_call(self, scene, decision->vehicle_id, tracks, before, plan, &index);
    if (status != VERGE_OK) {
        return status;
    }
    if (!vg_job_begin(&self->job, &self->def, scene, index, decision, before, plan)) {
        return VERGE_ERR_DEF;
    }
    run_job(self, scene, tracks, before, plan);
    return VERGE_OK;
}

// Decelerates to standstill in the lane, within the horizon of the trajectory.
static void decide_stop(const verge_sampler* self, const verge_scene* scene, uint32_t index,
                        verge_vehicle_decision* decision)
{
    const verge_lane_position* at = &scene->positions[index];
    const double horizon = self->def.point_s * (double)self->def.points;
    const double way = 0.5 * vg_max(scene->vehicles[index].speed, 0.0) * horizon;
    memset(decision, 0, sizeof *decision);
    decision->vehicle_id = scene->vehicles[index].id;
    decision->step_count = 1;
    decision->steps[0] = (verge_action_step){
        .action = VERGE_DECELERATE, .lane_id = at->lane_id, .t1 = horizon, .s = at->s + way,
        .d = at->d, .distance = way, .brake_light = true, .ahead_id = -1, .behind_id = -1,
    };
}

verge_status verge_plan_stop_for(uint64_t config, verge_sampler* self, const verge_scene* scene,
                                 int32_t vehicle_id, const verge_tracks* tracks,
                                 const verge_vehicle_plan* before, verge_vehicle_plan* plan)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    uint32_t index = 0;
    const verge_status status = check_call(self, scene, vehicle_id, tracks, before, plan, &index);
    if (status != VERGE_OK) {
        return status;
    }
    verge_vehicle_decision decision;
    decide_stop(self, scene, index, &decision);
    const bool usable = vg_job_begin(&self->job, &self->def, scene, index, &decision, before, plan);
    VERGE_ASSERT(usable);
    (void)usable;
    self->job.stops = true;
    run_job(self, scene, tracks, before, plan);
    return VERGE_OK;
}

uint64_t verge_sampler_candidates(const verge_sampler* self)
{
    return self == NULL ? 0 : self->candidates;
}
