/// Decide, then plan. Owns the memory and its budget, the last plan, and the order of things:
/// vehicles by id, placed on lanes, decided jointly, predicted, planned, digested.

#include "verge/planner.h"

#include "base/contract.h"
#include "digest.h"
#include "motion/segments.h"
#include "decide/mcts.h"
#include "motion/predict.h"
#include "motion/sampler.h"
#include "traffic/advance.h"
#include "base/scalar.h"

#include <string.h>

// Input limits: what no road vehicle does is a fault of the message, not of the road.
static const double coordinate_max = 1e6; // [m]
static const double speed_max = 70.0;     // [m/s]
static const double acceleration_max = 30.0;
static const double yaw_rate_max = 5.0;
// A vehicle this near to its last trajectory follows it. [m]
static const double on_plan = 0.3;

// What is kept from step to step.
typedef struct memory {
    uint64_t steps;   // stream of randomness of the next decision
    bool     valid;
    int64_t  utime;
    uint32_t count;
    int32_t  ids[VERGE_CONTROLLED_MAX];
    vg_joint_actions  line;                           // the decision in force, and when it was first taken
    int64_t  line_utime;
    uint32_t plan_count;                     // trajectories, by vehicle id
    int32_t  plan_ids[VERGE_CONTROLLED_MAX];
    int32_t  change_lane[VERGE_CONTROLLED_MAX]; // lane id that the trajectory is changing to
    double   change_end[VERGE_CONTROLLED_MAX];  // [s] after utime, when it is in the lane's centre
    double   curvature[VERGE_CONTROLLED_MAX][VERGE_POINTS_MAX];
    double   x[VERGE_CONTROLLED_MAX][VERGE_POINTS_MAX], y[VERGE_CONTROLLED_MAX][VERGE_POINTS_MAX];
    uint32_t lane_count;                     // last known lanes, of all vehicles
    int32_t  lane_ids[VERGE_VEHICLES_MAX];
    int32_t  lane_of[VERGE_VEHICLES_MAX];    // lane id
} memory;

struct verge_planner {
    verge_planner_def def;
    vg_arena      arena;
    verge_road*   road;
    vg_tree*      tree;
    vg_pairs*     sight;
    vg_model*     scene;
    vg_flow*      root;
    vg_decision*  decision;
    vg_tracks*    tracks;
    vg_job*       jobs;                               // [controlled_max]
    verge_vehicle* vehicles;                          // [vehicles_max], sorted by id
    vg_placed*    placed;                             // [vehicles_max]
    vg_workspace* workspaces[VERGE_CONTROLLED_MAX];
    memory        last;
    verge_counters counters;
};

static verge_planner* take_all(vg_arena* arena, const verge_planner_def* def);
static verge_status   accept(verge_planner* self, const verge_vehicle* vehicles, uint32_t count);
static void           place_all(verge_planner* self, uint32_t count);
static bool           decide(verge_planner* self, int64_t utime, uint32_t count);
static void           plan_all(verge_planner* self, int64_t utime, bool decided, uint32_t count,
                               verge_plan* plan);
static void           remember(verge_planner* self, int64_t utime, uint32_t count, bool decided,
                               const verge_plan* plan);
static void           report(verge_planner* self, int64_t utime, uint32_t count, verge_plan* plan);

// ---------------------------------------------------------------------------- memory

// Space before the road takes what the road's fit needs only while it is built.
static verge_road* build_road(vg_arena* arena, const verge_planner_def* def, size_t* scratch_size)
{
    const size_t fit = vg_road_scratch_size(&def->road);
    *scratch_size = (fit + VG_ARENA_ALIGN - 1u) / VG_ARENA_ALIGN * VG_ARENA_ALIGN;
    const size_t whole = arena->size;
    vg_arena scratch;
    if (arena->base == NULL) {
        vg_arena_init(&scratch, NULL, 0);
    } else {
        // The far end of the arena is still free: the fit works there.
        const size_t end = arena->size / VG_ARENA_ALIGN * VG_ARENA_ALIGN;
        if (end < *scratch_size || end - *scratch_size < arena->used) {
            arena->failed = true;
            return NULL;
        }
        const size_t from = end - *scratch_size;
        vg_arena_init(&scratch, arena->base + from, *scratch_size);
        arena->size = from; // the road ends where its scratch begins
    }
    verge_road* road = vg_road_build(arena, &scratch, &def->road);
    arena->size = whole;
    arena->failed = arena->failed || scratch.failed;
    return road;
}

static verge_planner* take_all(vg_arena* arena, const verge_planner_def* def)
{
    const size_t vehicles = def->vehicles_max, planned = def->controlled_max;
    verge_planner* self = vg_arena_take(arena, sizeof *self);
    vg_tree* tree = vg_tree_take(arena, def);
    vg_pairs* sight = vg_arena_take(arena, sizeof *sight);
    vg_model* scene = vg_arena_take(arena, sizeof *scene);
    vg_flow* root = vg_arena_take(arena, sizeof *root);
    vg_decision* decision = vg_arena_take(arena, sizeof *decision);
    vg_tracks* tracks = vg_arena_take(arena, sizeof *tracks);
    vg_job* jobs = vg_arena_take(arena, planned * sizeof *jobs);
    verge_vehicle* sorted = vg_arena_take(arena, vehicles * sizeof *sorted);
    vg_placed* placed = vg_arena_take(arena, vehicles * sizeof *placed);
    vg_workspace* workspaces[VERGE_CONTROLLED_MAX] = { NULL };
    for (size_t i = 0; i < planned; ++i) {
        workspaces[i] = vg_arena_take(arena, vg_workspace_size());
    }
    if (self == NULL) {
        return NULL;
    }
    self->def = *def;
    self->tree = tree;
    self->sight = sight;
    self->scene = scene;
    self->root = root;
    self->decision = decision;
    self->tracks = tracks;
    self->jobs = jobs;
    self->vehicles = sorted;
    self->placed = placed;
    memcpy(self->workspaces, workspaces, sizeof workspaces);
    return self;
}

// A dry run on a measuring arena: the code that takes memory is the code that sizes it. The
// road's scratch lies over what is taken after the road, so the larger of the two counts.
static bool measure(const verge_planner_def* def, size_t* road, size_t* scratch, size_t* rest)
{
    if (verge_planner_check(def, NULL) != VERGE_OK
        || verge_road_check(&def->road, NULL) != VERGE_OK) {
        return false;
    }
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)build_road(&arena, def, scratch);
    *road = arena.used;
    (void)take_all(&arena, def);
    *rest = arena.used - *road;
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

void verge_planner_memory_terms(const verge_planner_def* def, verge_memory_term terms[VERGE_MEMORY_TERMS])
{
    size_t road = 0, scratch = 0, rest = 0;
    memset(terms, 0, VERGE_MEMORY_TERMS * sizeof terms[0]);
    if (!measure(def, &road, &scratch, &rest)) {
        return;
    }
    vg_arena tree;
    vg_arena_init(&tree, NULL, 0);
    (void)vg_tree_take(&tree, def);
    const size_t samplers = def->controlled_max * vg_workspace_size();
    const size_t total = verge_planner_memory_size(def);
    const verge_memory_term budget[] = {
        { "road: reference lines, stations, relations", road },
        { "search tree: nodes_max nodes", tree.used },
        { "samplers: one workspace a controlled vehicle", samplers },
        { "jobs: one a controlled vehicle", def->controlled_max * sizeof(vg_job) },
        { "tracks: where everyone will be", sizeof(vg_tracks) },
        { "decision: the flow at every step", sizeof(vg_decision) },
        { "sight: who sees whom", sizeof(vg_pairs) },
        { "planner, vehicles, alignment, fitting of the road", 0 },
    };
    size_t sum = 0;
    for (uint32_t i = 0; i < VERGE_MEMORY_TERMS; ++i) {
        terms[i] = budget[i];
        sum += budget[i].size;
    }
    terms[VERGE_MEMORY_TERMS - 1].size = total > sum ? total - sum : 0;
}

verge_status verge_planner_init(verge_planner** planner, const verge_planner_def* def, void* memory_given,
                                size_t size)
{
    *planner = NULL;
    if (verge_planner_check(def, NULL) != VERGE_OK) {
        return VERGE_ERR_DEF;
    }
    if (verge_road_check(&def->road, NULL) != VERGE_OK) {
        return VERGE_ERR_ROAD;
    }
    if (memory_given == NULL || (uintptr_t)memory_given % VG_ARENA_ALIGN != 0) {
        return VERGE_ERR_MEMORY;
    }
    vg_arena arena;
    size_t scratch_size = 0;
    vg_arena_init(&arena, memory_given, size);
    verge_road* road = build_road(&arena, def, &scratch_size);
    if (road == NULL || arena.failed) {
        return VERGE_ERR_MEMORY;
    }
    verge_planner* self = take_all(&arena, def);
    if (self == NULL || arena.failed) {
        return VERGE_ERR_MEMORY;
    }
    arena.sealed = true;
    self->arena = arena;
    self->road = road;
    self->def.road = (verge_road_def){ NULL, 0 }; // copied; the caller's is not looked at again
    self->counters.arena_size = size;
    self->counters.arena_peak = arena.peak;
    self->counters.nodes_max = def->nodes_max;
    *planner = self;
    return VERGE_OK;
}

void verge_planner_reset(verge_planner* self)
{
    memset(&self->last, 0, sizeof self->last);
}

const verge_road* verge_planner_road(const verge_planner* self)
{
    return self->road;
}

verge_counters verge_planner_counters(const verge_planner* self)
{
    return self->counters;
}

// ---------------------------------------------------------------------------- one step

verge_status verge_planner_step(verge_planner* self, int64_t utime, const verge_vehicle* vehicles,
                                uint32_t vehicle_count, verge_plan* plan)
{
    const verge_status status = accept(self, vehicles, vehicle_count);
    if (status != VERGE_OK) {
        return status;
    }
    place_all(self, vehicle_count);

    // Everyone's actions first, from the flow ordered by id; then one trajectory for each.
    memset(&plan->search, 0, sizeof plan->search);
    const bool decided = decide(self, utime, vehicle_count);
    plan_all(self, utime, decided, vehicle_count, plan);
    remember(self, utime, vehicle_count, decided, plan);
    report(self, utime, vehicle_count, plan);
    return VERGE_OK;
}

static bool within(double x, double bound)
{
    return vg_finite(x) && x >= -bound && x <= bound;
}

static bool habit_holds(const verge_habit* habit)
{
    const verge_weights* w = &habit->weights;
    const double values[] = { w->curvature, w->heading, w->offset, w->acceleration, w->jerk,
                              w->obstacle };
    for (uint32_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
        if (!(values[i] >= 0.0 && values[i] <= 1e6)) {
            return false;
        }
    }
    return habit->cooperation >= 0.0 && habit->cooperation <= 1.0;
}

// Not given at all, or of this vehicle's size and good by itself.
static bool body_holds(const verge_vehicle* v)
{
    const verge_body* body = &v->body;
    if (body->length == 0.0 && body->wheelbase == 0.0 && body->rear_axle == 0.0) {
        return true;
    }
    return verge_body_check(body, NULL) && body->length == v->length && body->width == v->width;
}

static bool vehicle_holds(const verge_planner* self, const verge_vehicle* v)
{
    const bool motion = within(v->x, coordinate_max) && within(v->y, coordinate_max)
                        && within(v->heading, 2.0 * VG_PI) && v->speed >= 0.0
                        && within(v->speed, speed_max) && within(v->acceleration, acceleration_max)
                        && (v->yaw_rate != v->yaw_rate || within(v->yaw_rate, yaw_rate_max));
    const bool body = v->length >= 0.5 && v->length <= 30.0 && v->width >= 0.3 && v->width <= 4.0
                      && v->margin >= 0.0 && v->margin <= 100.0 && body_holds(v);
    const bool wish = v->target_lane == VERGE_NO_LANE
                      || vg_road_lane_index(self->road, v->target_lane) >= 0;
    return v->id >= 0 && motion && body && wish && (!v->controlled || habit_holds(&v->habit));
}

verge_status verge_planner_check_vehicle(const verge_planner* self, const verge_vehicle* vehicle)
{
    if (!vehicle_holds(self, vehicle)) {
        return VERGE_ERR_VEHICLE;
    }
    const verge_lane_position at =
        verge_road_project(self->road, vehicle->x, vehicle->y, vehicle->heading, VERGE_NO_LANE);
    return at.lane_id == VERGE_NO_LANE ? VERGE_ERR_OFF_ROAD : VERGE_OK;
}

// Copies the vehicles in the order of their ids, by insertion: few, and often sorted already.
static verge_status accept(verge_planner* self, const verge_vehicle* vehicles, uint32_t count)
{
    if (count > self->def.vehicles_max) {
        return VERGE_ERR_CAPACITY;
    }
    uint32_t planned = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (!vehicle_holds(self, &vehicles[i])) {
            return VERGE_ERR_VEHICLE;
        }
        planned += vehicles[i].controlled ? 1u : 0u;
        uint32_t at = i;
        for (; at > 0 && self->vehicles[at - 1u].id > vehicles[i].id; --at) {
            self->vehicles[at] = self->vehicles[at - 1u];
        }
        self->vehicles[at] = vehicles[i];
        self->vehicles[at].heading = vg_wrap_angle(vehicles[i].heading);
        if (at > 0 && self->vehicles[at - 1u].id == vehicles[i].id) {
            return VERGE_ERR_DUPLICATE;
        }
    }
    return planned > self->def.controlled_max ? VERGE_ERR_CAPACITY : VERGE_OK;
}

static int32_t remembered_lane(const memory* last, int32_t id)
{
    for (uint32_t i = 0; last->valid && i < last->lane_count; ++i) {
        if (last->lane_ids[i] == id) {
            return last->lane_of[i];
        }
    }
    return VERGE_NO_LANE;
}

// Where lanes overlap (merges, diverges) the lane is the one the vehicle is on its way along: the
// lane it was on, else the one that continues that lane towards its target, else one that can
// lead to the target at all.
static verge_lane_position locate(const verge_planner* self, const verge_vehicle* v)
{
    const verge_road* road = self->road;
    const int32_t before = remembered_lane(&self->last, v->id);
    verge_lane_position at = verge_road_project(road, v->x, v->y, v->heading, before);
    if (before != VERGE_NO_LANE && at.lane_id != before) {
        const int32_t next = verge_road_next(road, before, v->controlled ? v->target_lane : VERGE_NO_LANE);
        at = next == VERGE_NO_LANE ? at : verge_road_project(road, v->x, v->y, v->heading, next);
    }
    const int32_t target = v->controlled ? vg_road_lane_index(road, v->target_lane) : -1;
    if (at.lane_id == VERGE_NO_LANE || target < 0) {
        return at;
    }
    const uint32_t lane_count = road->lane_count;
    uint32_t fewest =
        vg_road_changes(road, (uint32_t)vg_road_lane_index(road, at.lane_id), (uint32_t)target);
    const bool never = fewest == VG_NEVER && !verge_road_continues(road, v->target_lane, at.lane_id);
    for (uint32_t lane = 0; never && lane < lane_count; ++lane) {
        const uint32_t changes = vg_road_changes(road, lane, (uint32_t)target);
        if (changes < fewest) {
            const verge_lane_position other =
                verge_road_project(road, v->x, v->y, v->heading, road->lanes[lane].id);
            if (other.lane_id == road->lanes[lane].id && other.contained) {
                at = other;
                fewest = changes;
            }
        }
    }
    return at;
}

static void place_all(verge_planner* self, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        const verge_lane_position at = locate(self, &self->vehicles[i]);
        const int32_t lane = at.lane_id == VERGE_NO_LANE
                                 ? -1 : vg_road_lane_index(self->road, at.lane_id);
        // Who faces the other way is not on its way along this lane, whatever else it does there.
        const bool along = vg_cos(at.heading - self->vehicles[i].heading) > 0.0;
        self->placed[i] = (vg_placed){ .on_road = lane >= 0 && along,
                                       .lane = lane >= 0 ? (uint32_t)lane : 0u,
                                       .s = at.s,
                                       .d = at.d };
    }
}

// ---------------------------------------------------------------------------- decision

// The last plan's action for a vehicle at a time [s] of that plan; ACTION_COUNT: none.
static uint8_t remembered_action(const memory* last, int32_t id, double t, double step_s)
{
    if (!last->valid || t < 0.0 || t >= (double)last->line.step_count * step_s) {
        return VERGE_ACTION_COUNT;
    }
    for (uint32_t i = 0; i < last->count; ++i) {
        if (last->ids[i] == id) {
            return last->line.actions[(uint32_t)(t / step_s)][i];
        }
    }
    return VERGE_ACTION_COUNT;
}

// The last plan moved to now: each step takes what was planned for its middle.
static bool shift_last(const verge_planner* self, const vg_model* scene, double age, vg_joint_actions* line)
{
    const double step_s = self->def.step_s;
    bool any = false;
    line->step_count = self->def.steps;
    for (uint32_t t = 0; t < line->step_count; ++t) {
        for (uint32_t slot = 0; slot < scene->controlled_count; ++slot) {
            const int32_t id = self->vehicles[scene->input_index[slot]].id;
            const double at = age + ((double)t + 0.5) * step_s;
            const uint8_t action = remembered_action(&self->last, id, at, step_s);
            any = any || action < VERGE_ACTION_COUNT;
            line->actions[t][slot] =
                action < VERGE_ACTION_COUNT ? action : (uint8_t)VERGE_KEEP_SPEED;
        }
    }
    return any;
}

// Does the decision confirm this line, for the same vehicles as before?
static bool same_line(const verge_planner* self, const vg_joint_actions* line)
{
    const vg_model* scene = self->scene;
    bool same = self->last.count == scene->controlled_count;
    for (uint32_t slot = 0; slot < scene->controlled_count; ++slot) {
        same = same && self->last.ids[slot] == self->vehicles[scene->input_index[slot]].id;
        for (uint32_t t = 0; t < self->decision->line.step_count; ++t) {
            same = same && line->actions[t][slot] == self->decision->line.actions[t][slot];
        }
    }
    return same;
}

// A new decision takes force.
static void hold_line(verge_planner* self, int64_t utime)
{
    memory* last = &self->last;
    last->line = self->decision->line;
    last->line_utime = utime;
    last->count = self->scene->controlled_count;
    for (uint32_t slot = 0; slot < last->count; ++slot) {
        last->ids[slot] = self->vehicles[self->scene->input_index[slot]].id;
    }
}

static bool decide(verge_planner* self, int64_t utime, uint32_t count)
{
    // Microseconds to seconds; an age out of the horizon is as good as none. It counts from when the
    // plan was first decided: counted from its last confirmation, a change planned for the next
    // step would stay planned for the next step.
    const double age = (double)(utime - self->last.line_utime) * 1e-6;
    const double known = age >= 0.0 && age < 100.0 ? age : -1.0;
    const bool remembers = self->def.search == VERGE_SEARCH_BEST;
    vg_model* scene = self->scene;
    vg_model_from(scene, self->root, &self->def, self->road, self->sight, self->vehicles,
                  self->placed, count);
    if (scene->controlled_count == 0) {
        return false;
    }
    vg_joint_actions warm;
    const bool warmed = remembers && known >= 0.0 && shift_last(self, scene, known, &warm);
    vg_random random = vg_random_from(self->def.seed, self->last.steps++);
    vg_mcts_run(self->tree, scene, self->root, &random, warmed ? &warm : NULL, self->decision);
    if (!warmed || !same_line(self, &warm)) {
        hold_line(self, utime);
    }
    return true;
}

// ---------------------------------------------------------------------------- trajectories

static int32_t slot_of(const vg_model* scene, uint32_t input_index)
{
    for (uint32_t slot = 0; slot < scene->controlled_count; ++slot) {
        if (scene->input_index[slot] == input_index) {
            return (int32_t)slot;
        }
    }
    return -1;
}

// Where the yaw rate tells nothing (below 2 m/s, or not measured) a vehicle that is where its
// last trajectory wanted it is taken to steer as that trajectory did: without this a vehicle that
// crawls through a bend would be planned straight ahead again and again.
static double known_curvature(const verge_planner* self, const verge_vehicle* v, int64_t utime)
{
    if (v->speed >= VERGE_SPEED_SLOW && vg_finite(v->yaw_rate)) {
        return v->yaw_rate / v->speed;
    }
    const memory* last = &self->last;
    const double age = (double)(utime - last->utime) * 1e-6 / self->def.point_s;
    if (!last->valid || !(age >= 0.0 && age <= (double)(self->def.points - 1u))) {
        return 0.0;
    }
    const uint32_t k = (uint32_t)(age + 0.5);
    for (uint32_t i = 0; i < last->plan_count; ++i) {
        const double dx = last->x[i][k] - v->x, dy = last->y[i][k] - v->y;
        if (last->plan_ids[i] == v->id && dx * dx + dy * dy < on_plan * on_plan) {
            return last->curvature[i][k];
        }
    }
    return 0.0;
}

// The change that a vehicle on its last trajectory is in the middle of goes on.
static void finish_change(const verge_planner* self, int64_t utime, uint32_t slot, vg_job* job)
{
    const memory* last = &self->last;
    const verge_vehicle* v = job->vehicle;
    const double age = (double)(utime - last->utime) * 1e-6;
    const double k = age / self->def.point_s + 0.5;
    if (!last->valid || !(k >= 0.0 && k < (double)self->def.points)) {
        return;
    }
    for (uint32_t i = 0; i < last->plan_count; ++i) {
        const double dx = last->x[i][(uint32_t)k] - v->x, dy = last->y[i][(uint32_t)k] - v->y;
        const int32_t lane = vg_road_lane_index(self->road, last->change_lane[i]);
        if (last->plan_ids[i] == v->id && lane >= 0 && dx * dx + dy * dy < on_plan * on_plan
            && last->change_end[i] > age) {
            vg_guide_finish_change(self->scene, self->decision, slot, (uint32_t)lane,
                                   last->change_end[i] - age, job);
        }
    }
}

static void prepare(verge_planner* self, int64_t utime, uint32_t i, const int32_t* ids, vg_job* job,
                    verge_vehicle_plan* plan)
{
    const verge_vehicle* vehicle = &self->vehicles[i];
    const int32_t slot = slot_of(self->scene, i);
    memset(plan, 0, sizeof *plan);
    plan->vehicle_id = vehicle->id;
    memset(job, 0, sizeof *job);
    job->def = &self->def;
    job->road = self->road;
    job->vehicle = vehicle;
    job->on_road = slot >= 0;
    job->lane = self->placed[i].lane;
    job->s = self->placed[i].s;
    job->d = self->placed[i].d;
    job->target = -1;
    job->change_lane = -1;
    job->curvature = known_curvature(self, vehicle, utime);
    job->track_index = i;
    if (slot >= 0) {
        job->target = self->scene->target[slot];
        vg_guide_actions(self->scene, self->decision, (uint32_t)slot, ids, plan);
        vg_guide_segments(self->scene, self->decision, (uint32_t)slot, job);
        if (self->def.search == VERGE_SEARCH_BEST) {
            finish_change(self, utime, (uint32_t)slot, job);
        }
    } else {
        vg_guide_off_road(&self->def, vehicle, plan);
    }
}

// The lights tell what the trajectory does, not only what the decision is called.
static void light(verge_vehicle_plan* plan)
{
    for (uint32_t t = 0; t < plan->action_count; ++t) {
        verge_action_step* step = &plan->actions[t];
        for (uint32_t k = 0; k < plan->point_count; ++k) {
            const verge_point* p = &plan->points[k];
            if (p->t >= step->t0 && p->t < step->t1 && p->acceleration < -0.8) {
                step->brake_light = true; // beyond what lifting the foot does [m/s^2]
            }
        }
    }
}

static void plan_all(verge_planner* self, int64_t utime, bool decided, uint32_t count,
                     verge_plan* plan)
{
    vg_predict_tracks(self->tracks, self->scene, self->root, decided ? self->decision : NULL,
                      self->vehicles, self->placed, count);
    int32_t ids[VERGE_VEHICLES_MAX];
    for (uint32_t slot = 0; slot < self->scene->count; ++slot) {
        ids[slot] = self->vehicles[self->scene->input_index[slot]].id;
    }
    uint32_t jobs = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (self->vehicles[i].controlled) {
            prepare(self, utime, i, ids, &self->jobs[jobs], &plan->vehicles[jobs]);
            ++jobs;
        }
    }
    plan->vehicle_count = jobs;
    plan->replanned_count = 0;
    if (jobs > 0) {
        self->counters.candidates += vg_trajectories_run(self->workspaces, self->jobs, jobs, self->tracks,
                                                         plan->vehicles, &plan->replanned_count);
    }
    for (uint32_t i = 0; i < jobs; ++i) {
        light(&plan->vehicles[i]);
    }
    if (decided) {
        plan->search = self->decision->report;
    }
}

// ---------------------------------------------------------------------------- after

// The lane (id) that a job wanted to change to and its trajectory does change to: where no candidate
// for the change would do, it keeps its lane.
static int32_t change_driven(const verge_planner* self, const vg_job* job, const verge_vehicle_plan* plan)
{
    if (plan->status != VERGE_PLANNED || job->change_lane < 0) {
        return VERGE_NO_LANE;
    }
    const int32_t lane = self->road->lanes[job->change_lane].id;
    const verge_point* end = &plan->points[plan->point_count - 1u];
    const verge_lane_position at = verge_road_project(self->road, end->x, end->y, end->heading, lane);
    return at.contained && verge_road_continues(self->road, lane, at.lane_id) ? lane : VERGE_NO_LANE;
}

static void remember(verge_planner* self, int64_t utime, uint32_t count, bool decided,
                     const verge_plan* plan)
{
    memory* last = &self->last;
    last->valid = true;
    last->utime = utime;
    last->lane_count = count;
    for (uint32_t i = 0; i < count; ++i) {
        last->lane_ids[i] = self->vehicles[i].id;
        last->lane_of[i] = self->placed[i].on_road ? self->road->lanes[self->placed[i].lane].id
                                                   : VERGE_NO_LANE;
    }
    last->plan_count = plan->vehicle_count;
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        const verge_vehicle_plan* vehicle = &plan->vehicles[i];
        last->plan_ids[i] = vehicle->vehicle_id;
        last->change_lane[i] = change_driven(self, &self->jobs[i], vehicle);
        last->change_end[i] = vg_workspace_settled(self->workspaces[i]);
        for (uint32_t k = 0; k < vehicle->point_count; ++k) {
            last->x[i][k] = vehicle->points[k].x;
            last->y[i][k] = vehicle->points[k].y;
            last->curvature[i][k] = vehicle->points[k].curvature;
        }
    }
    if (!decided) {
        last->count = 0;
    }
}

static void write_prediction(const verge_planner* self, const vg_track* track, double heading,
                             verge_prediction* to)
{
    to->vehicle_id = track->vehicle_id;
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

static void report(verge_planner* self, int64_t utime, uint32_t count, verge_plan* plan)
{
    plan->utime = utime;
    plan->prediction_count = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (!self->vehicles[i].controlled) {
            write_prediction(self, &self->tracks->of[i], self->vehicles[i].heading,
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
    counters->nodes_peak =
        plan->search.nodes > counters->nodes_peak ? plan->search.nodes : counters->nodes_peak;
    counters->bytes_per_node = vg_node_size(self->scene->count, self->scene->controlled_count);
}

// ---------------------------------------------------------------------------- for simulators

void verge_planner_advance_humans(verge_planner* self, verge_vehicle* vehicles, uint32_t vehicle_count,
                                  double dt)
{
    const uint32_t count = vehicle_count <= self->def.vehicles_max ? vehicle_count
                                                                   : self->def.vehicles_max;
    for (uint32_t i = 0; i < count; ++i) {
        const verge_vehicle* v = &vehicles[i];
        const verge_lane_position at =
            verge_road_project(self->road, v->x, v->y, v->heading, VERGE_NO_LANE);
        const int32_t lane = at.lane_id == VERGE_NO_LANE
                                 ? -1 : vg_road_lane_index(self->road, at.lane_id);
        self->vehicles[i] = *v;
        self->placed[i] = (vg_placed){
            .on_road = lane >= 0, .lane = lane >= 0 ? (uint32_t)lane : 0u, .s = at.s, .d = at.d
        };
        if (lane < 0 && !v->controlled) { // as predicted: straight on
            vehicles[i].x += v->speed * dt * vg_cos(v->heading);
            vehicles[i].y += v->speed * dt * vg_sin(v->heading);
        }
    }
    vg_flow next;
    vg_model* scene = self->scene;
    vg_model_from(scene, self->root, &self->def, self->road, self->sight, self->vehicles,
                  self->placed, count);
    vg_model_free_humans(scene, self->root);
    vg_flow_follow(scene, self->root, dt, &next);
    for (uint32_t slot = scene->controlled_count; slot < scene->count; ++slot) {
        const uint32_t i = scene->input_index[slot];
        const vg_placed* at = &self->placed[i];
        verge_vehicle* v = &vehicles[i];
        const double speed = (double)next.v[slot];
        double c = 1.0, n = 0.0;
        vg_road_pose(self->road, at->lane, -1, at->s + 0.5 * (v->speed + speed) * dt, at->d, &v->x,
                     &v->y, &c, &n);
        const double heading = vg_atan2(n, c);
        v->yaw_rate = vg_wrap_angle(heading - v->heading) / dt;
        v->heading = heading;
        v->acceleration = (speed - v->speed) / dt;
        v->speed = speed;
    }
}

static vg_rectangle body_of(const verge_vehicle* v)
{
    vg_rectangle body = { .x = v->x, .y = v->y, .half_length = 0.5 * v->length + v->margin,
                          .half_width = 0.5 * v->width + v->margin };
    vg_sincos(v->heading, &body.sin_heading, &body.cos_heading);
    return body;
}

bool verge_vehicles_overlap(const verge_vehicle* a, const verge_vehicle* b)
{
    const vg_rectangle first = body_of(a), second = body_of(b);
    return vg_rectangle_overlap(&first, &second);
}

double verge_vehicles_distance(const verge_vehicle* a, const verge_vehicle* b)
{
    const vg_rectangle first = body_of(a), second = body_of(b);
    return vg_rectangle_distance(&first, &second);
}
