/// Runs the stages place, decide, predict, plan and check for all vehicles of a roadside unit. The
/// planner holds their memory and keeps the last scene, decision and plans.

#include "verge/planner.h"

#include "base/arena.h"
#include "base/contract.h"
#include "base/scalar.h"
#include "digest.h"
#include "motion/job.h"
#include "traffic/belief.h"
#include "traffic/flow.h"
#include "traffic/signals.h"

#include <string.h>

struct verge_planner {
    verge_planner_def  def;
    vg_arena           arena;
    const verge_road*  road;
    verge_decider*     decider;
    verge_predictor*   predictor;
    vg_workspace**     workspaces;  // [controlled_max]
    vg_job*            jobs;        // [controlled_max]
    verge_scene        scenes[2];   // of this step and of the step before
    int64_t            signals_utime;
    uint32_t           signal_count;
    verge_signal*      signals;     // [lanes] as set, at signals_utime
    verge_signal*      signals_now; // [lanes] those of scenes[0], at its utime
    verge_decision     decision;
    verge_commitment   commitment;
    verge_tracks       tracks;
    uint32_t           before_count;
    verge_vehicle_plan* before;     // [controlled_max] the last plans
    verge_counters     counters;
};

static verge_planner* take_all(vg_arena* arena, const verge_planner_def* def);
static verge_status   place(verge_planner* self, int64_t utime, const verge_vehicle* vehicles,
                            uint32_t count);
static verge_status   begin(verge_planner* self, const verge_scene* now);
static verge_scene    copy_scene(verge_planner* self, const verge_scene* scene);
static verge_status   carry_out(verge_planner* self, const verge_decision* decision,
                                verge_plan* plan);
static bool           plan_all(verge_planner* self, const verge_decision* decision,
                               verge_plan* plan);
static void           remember(verge_planner* self, const verge_vehicle_plan* plans,
                               uint32_t count);
static void           report(verge_planner* self, const verge_decision* decision,
                             verge_plan* plan);

// ---------------------------------------------------------------------------- memory

static verge_scene take_scene(vg_arena* arena, uint32_t vehicles_max)
{
    verge_vehicle* vehicles = vg_arena_take(arena, vehicles_max * sizeof *vehicles);
    verge_lane_position* positions = vg_arena_take(arena, vehicles_max * sizeof *positions);
    return (verge_scene){ .vehicles = vehicles, .positions = positions,
                          .vehicles_max = vehicles_max };
}

static verge_planner* take_all(vg_arena* arena, const verge_planner_def* def)
{
    const uint32_t vehicles = def->vehicles_max, controlled = def->controlled_max;
    const size_t decider_size = verge_decider_memory_size(def);
    const size_t predictor_size = verge_predictor_shared_memory_size(def);
    verge_planner* self = vg_arena_take(arena, sizeof *self);
    void* decider = vg_arena_take(arena, decider_size);
    void* predictor = vg_arena_take(arena, predictor_size);
    verge_planner all = { .def = *def };
    all.scenes[0] = take_scene(arena, vehicles);
    all.scenes[1] = take_scene(arena, vehicles);
    all.signals = vg_arena_take(arena, def->road.lane_count * sizeof *all.signals);
    all.signals_now = vg_arena_take(arena, def->road.lane_count * sizeof *all.signals_now);
    all.decision.vehicles_max = controlled;
    all.decision.vehicles = vg_arena_take(arena, controlled * sizeof *all.decision.vehicles);
    all.tracks.tracks_max = vehicles;
    all.tracks.of = vg_arena_take(arena, vehicles * sizeof *all.tracks.of);
    all.jobs = vg_arena_take(arena, controlled * sizeof *all.jobs);
    all.before = vg_arena_take(arena, controlled * sizeof *all.before);
    all.workspaces = vg_arena_take(arena, controlled * sizeof(vg_workspace*));
    for (uint32_t i = 0; i < controlled; ++i) {
        vg_workspace* workspace = vg_workspace_take(arena, def);
        if (all.workspaces != NULL) {
            all.workspaces[i] = workspace;
        }
    }
    if (self == NULL || arena->failed
        || verge_decider_init(&all.decider, def, decider, decider_size) != VERGE_OK
        || verge_predictor_init_shared(&all.predictor, all.decider, predictor, predictor_size)
               != VERGE_OK) {
        return NULL;
    }
    *self = all;
    return self;
}

// Runs the code that takes memory on an arena that only measures. The scratch memory of the road is
// used again for what is taken after the road, so the larger of both counts.
static bool measure(const verge_planner_def* def, size_t* road, size_t* scratch, size_t* rest)
{
    if (verge_planner_check(def, NULL) != VERGE_OK) {
        return false;
    }
    const size_t whole = verge_road_memory_size(&def->road, road);
    if (whole == 0) {
        return false;
    }
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)take_all(&arena, def);
    *scratch = whole - *road;
    *rest = arena.used;
    return true;
}

size_t verge_planner_memory_size(const verge_planner_def* def)
{
    size_t road = 0, scratch = 0, rest = 0;
    if (!measure(def, &road, &scratch, &rest)) {
        return 0;
    }
    return road + (rest > scratch ? rest : scratch);
}

static size_t workspace_size(const verge_planner_def* def)
{
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)vg_workspace_take(&arena, def);
    return arena.used;
}

void verge_planner_memory_terms(const verge_planner_def* def,
                                verge_memory_term terms[VERGE_MEMORY_TERMS])
{
    size_t road = 0, scratch = 0, rest = 0;
    if (terms == NULL) {
        return;
    }
    memset(terms, 0, VERGE_MEMORY_TERMS * sizeof terms[0]);
    if (!measure(def, &road, &scratch, &rest)) {
        return;
    }
    const size_t total = verge_planner_memory_size(def);
    const verge_memory_term budget[] = {
        { "road: reference lines, stations, routes, conflicts", road },
        { "decision: search tree of nodes_max nodes, pairs of vehicles",
          verge_decider_memory_size(def) },
        { "prediction, besides the memory of the decision: expected states",
          verge_predictor_shared_memory_size(def) },
        { "samplers: one workspace a controlled vehicle",
          def->controlled_max * workspace_size(def) },
        { "jobs and last plans: one a controlled vehicle",
          def->controlled_max * (sizeof(vg_job) + sizeof(verge_vehicle_plan)) },
        { "tracks: the predicted motion of every vehicle",
          def->vehicles_max * sizeof(verge_track) },
        { "scenes: the vehicles of this step and the last",
          2 * def->vehicles_max * (sizeof(verge_vehicle) + sizeof(verge_lane_position)) },
        { "planner, decided steps, signals, alignment, fitting of the road", 0 },
    };
    size_t sum = 0;
    for (uint32_t i = 0; i < VERGE_MEMORY_TERMS; ++i) {
        terms[i] = budget[i];
        sum += budget[i].size;
    }
    terms[VERGE_MEMORY_TERMS - 1].size = total > sum ? total - sum : 0;
}

verge_status verge_planner_init(verge_planner** planner, const verge_planner_def* def, void* memory,
                                size_t size)
{
    if (planner == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    *planner = NULL;
    const verge_status checked = verge_planner_check(def, NULL);
    if (checked != VERGE_OK) {
        return checked;
    }
    size_t road_size = 0;
    const verge_road* road = NULL;
    if (verge_road_memory_size(&def->road, &road_size) == 0) {
        return VERGE_ERR_ROAD;
    }
    const verge_status status = verge_road_init(&road, &def->road, memory, size);
    if (status != VERGE_OK) {
        return status;
    }
    vg_arena arena;
    vg_arena_init(&arena, memory, size);
    arena.used = arena.peak = road_size;
    verge_planner* self = take_all(&arena, def);
    if (self == NULL) {
        return VERGE_ERR_MEMORY;
    }
    arena.sealed = true;
    self->arena = arena;
    self->road = self->scenes[0].road = self->scenes[1].road = road;
    self->def.road = (verge_road_def){ NULL, 0 }; // the road is built; its definition may be freed
    self->counters.arena_size = size;
    self->counters.arena_peak = arena.peak;
    self->counters.nodes_max = def->search == VERGE_SEARCH_POLICY ? 0 : def->nodes_max;
    *planner = self;
    return VERGE_OK;
}

void verge_planner_reset(verge_planner* self)
{
    if (self == NULL) {
        return;
    }
    self->commitment = (verge_commitment){ 0 };
    self->before_count = 0;
    self->scenes[0].vehicle_count = self->scenes[1].vehicle_count = 0;
}

const verge_road* verge_planner_road(const verge_planner* self)
{
    return self == NULL ? NULL : self->road;
}

const verge_scene* verge_planner_scene(const verge_planner* self)
{
    return self == NULL ? NULL : &self->scenes[0];
}

verge_counters verge_planner_counters(const verge_planner* self)
{
    return self == NULL ? (verge_counters){ 0 } : self->counters;
}

verge_status verge_planner_set_signals(verge_planner* self, int64_t utime,
                                       const verge_signal* signals, uint32_t signal_count)
{
    if (self == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    const verge_status status = verge_signals_check(self->road, signals, signal_count, NULL);
    if (status == VERGE_OK) {
        VERGE_ASSERT(signal_count <= self->road->lane_count); // one a lane
        vg_signals_sort(self->signals, signals, signal_count);
        self->signals_utime = utime;
        self->signal_count = signal_count;
    }
    return status;
}

// ---------------------------------------------------------------------------- one step

verge_status verge_planner_step_for(uint64_t config, verge_planner* self, int64_t utime,
                                    const verge_vehicle* vehicles, uint32_t vehicle_count,
                                    verge_plan* plan)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    if (self == NULL || plan == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    const verge_status status = place(self, utime, vehicles, vehicle_count);
    if (status != VERGE_OK) {
        return status;
    }
    // First the joint decision of all vehicles, then one trajectory for each.
    verge_status done =
        verge_decide(self->decider, &self->scenes[0], &self->commitment, &self->decision);
    VERGE_ASSERT(done == VERGE_OK);
    verge_decision_round(&self->decision);
    done = carry_out(self, &self->decision, plan);
    VERGE_ASSERT(done == VERGE_OK);
    return done;
}

verge_status verge_planner_repeat_for(uint64_t config, verge_planner* self,
                                      const verge_scene* scene, const verge_decision* decision,
                                      const verge_vehicle_plan* last, uint32_t last_count,
                                      verge_plan* plan)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    if (self == NULL || plan == NULL || decision == NULL || (last == NULL && last_count > 0)
        || !vg_scene_holds(scene) || scene->road != self->road) {
        return VERGE_ERR_ARGUMENT;
    }
    if (scene->vehicle_count > self->def.vehicles_max || last_count > self->def.controlled_max) {
        return VERGE_ERR_CAPACITY;
    }
    const verge_scene now = copy_scene(self, scene);
    const verge_status status = begin(self, &now);
    if (status != VERGE_OK) {
        return status;
    }
    remember(self, last, last_count);
    return carry_out(self, decision, plan);
}

// In the arrays of scenes[1]. The scene may be scenes[0].
static verge_scene copy_scene(verge_planner* self, const verge_scene* scene)
{
    verge_scene copy = *scene;
    copy.vehicles = self->scenes[1].vehicles;
    copy.positions = self->scenes[1].positions;
    copy.vehicles_max = self->scenes[1].vehicles_max;
    copy.signals = self->signals_now;
    for (uint32_t i = 0; i < copy.vehicle_count; ++i) {
        copy.vehicles[i] = scene->vehicles[i];
        copy.positions[i] = scene->positions[i];
    }
    for (uint32_t i = 0; i < copy.signal_count; ++i) {
        self->signals_now[i] = scene->signals[i];
    }
    return copy;
}

// Predicts, plans, remembers and reports.
static verge_status carry_out(verge_planner* self, const verge_decision* decision,
                              verge_plan* plan)
{
    const verge_status status =
        verge_predict(self->predictor, &self->scenes[0], decision, &self->tracks);
    if (status != VERGE_OK) {
        return status;
    }
    if (!plan_all(self, decision, plan)) {
        return VERGE_ERR_DEF;
    }
    plan->search = decision->search;
    remember(self, plan->vehicles, plan->vehicle_count);
    report(self, decision, plan);
    return VERGE_OK;
}

// The new scene is built in the arrays of the scene before the last.
static verge_status place(verge_planner* self, int64_t utime, const verge_vehicle* vehicles,
                          uint32_t count)
{
    verge_scene before = self->scenes[0];
    before.signal_count = 0; // the array is written anew
    verge_scene now = self->scenes[1];
    vg_signals_after(self->signals_now, self->signals, self->signal_count,
                     vg_seconds_between(self->signals_utime, utime));
    now.signal_count = self->signal_count;
    now.signals = self->signals_now;
    const verge_status status = verge_scene_place(&now, utime, vehicles, count, &before);
    return status == VERGE_OK ? begin(self, &now) : status;
}

// Makes a scene in the arrays of scenes[1] the present one, unless it has too many vehicles.
static verge_status begin(verge_planner* self, const verge_scene* now)
{
    if (vg_bits(vg_scene_controlled(now)) > self->def.controlled_max
        || vg_scene_bodies(now) > self->def.vehicles_max) {
        return VERGE_ERR_CAPACITY;
    }
    self->scenes[1] = self->scenes[0];
    self->scenes[0] = *now;
    return VERGE_OK;
}

static const verge_vehicle_plan* plan_before(const verge_planner* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->before_count; ++i) {
        if (self->before[i].vehicle_id == vehicle_id) {
            return &self->before[i];
        }
    }
    return NULL;
}

// A vehicle that passes a conflict area after another one plans behind whatever that one does, as
// one that follows it in its lane.
static void let_first_plan_first(verge_planner* self, const verge_decision* decision,
                                 uint32_t count)
{
    for (uint32_t j = 0; j < count; ++j) {
        const verge_vehicle_decision* own =
            verge_decision_of(decision, self->jobs[j].vehicle->id);
        for (uint32_t m = 0; own != NULL && m < own->pass_count; ++m) {
            for (uint32_t i = 0; i < count; ++i) {
                if (self->jobs[i].vehicle->id == own->passes[m].after_id) {
                    self->jobs[i].followers |= (uint64_t)1 << self->jobs[j].track_index;
                    self->jobs[j].followers &= ~((uint64_t)1 << self->jobs[i].track_index);
                }
            }
        }
    }
}

// False: the decision of a vehicle cannot be used; the plan has no vehicles.
static bool plan_all(verge_planner* self, const verge_decision* decision, verge_plan* plan)
{
    const verge_scene* scene = &self->scenes[0];
    uint32_t count = 0;
    plan->vehicle_count = 0;
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        const int32_t id = scene->vehicles[i].id;
        if (!scene->vehicles[i].controlled) {
            continue;
        }
        if (!vg_job_begin(&self->jobs[count], &self->def, scene, i,
                          verge_decision_of(decision, id), plan_before(self, id),
                          &plan->vehicles[count])) {
            return false;
        }
        ++count;
    }
    plan->vehicle_count = count;
    let_first_plan_first(self, decision, count);
    self->counters.candidates += vg_trajectories_run(
        self->workspaces, self->jobs, count, &self->tracks, plan->vehicles, &plan->replanned_count);
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle_plan* of = &plan->vehicles[i];
        vg_job_end(&self->jobs[i], self->workspaces[i], scene, plan_before(self, of->vehicle_id),
                   of);
    }
    return true;
}

// As a message would hold them: a vehicle that plans from messages has the same memory.
static void remember(verge_planner* self, const verge_vehicle_plan* plans, uint32_t count)
{
    VERGE_ASSERT(count <= self->def.controlled_max);
    self->before_count = count;
    for (uint32_t i = 0; i < count; ++i) {
        self->before[i] = plans[i];
        verge_vehicle_plan_round(&self->before[i]);
    }
}

// ---------------------------------------------------------------------------- report

static void write_prediction(const verge_planner* self, const verge_track* track, double heading,
                             verge_prediction* to)
{
    const verge_belief* belief = vg_belief_of(&self->commitment.beliefs, track->vehicle_id);
    to->vehicle_id = track->vehicle_id;
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        to->hypotheses[k] = belief != NULL ? belief->weights[k] : 0.0f;
    }
    to->point_count = self->def.points;
    for (uint32_t k = 0; k < to->point_count; ++k) {
        to->points[k] = (verge_pose){
            .t = (double)k * self->def.point_s,
            .x = track->x[k],
            .y = track->y[k],
            .heading = k == 0 ? heading : vg_atan2(track->sin_heading[k], track->cos_heading[k]),
        };
    }
}

static void report(verge_planner* self, const verge_decision* decision, verge_plan* plan)
{
    const verge_scene* scene = &self->scenes[0];
    plan->utime = scene->utime;
    plan->prediction_count = 0;
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        if (!scene->vehicles[i].controlled) {
            write_prediction(self, &self->tracks.of[i], scene->vehicles[i].heading,
                             &plan->predictions[plan->prediction_count++]);
        }
    }
    plan->fallback_count = 0;
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        plan->fallback_count += plan->vehicles[i].status != VERGE_PLANNED ? 1u : 0u;
    }
    plan->digest = vg_digest_plan(plan);

    verge_counters* counters = &self->counters;
    counters->steps++;
    counters->fallbacks += plan->fallback_count;
    counters->unexpanded += plan->search.unexpanded;
    counters->reordered += decision->reordered;
    counters->unstuck += decision->unstuck;
    verge_decider_nodes(self->decider, &counters->nodes_peak, &counters->bytes_per_node);
}
