/// See unit.h. A cycle: place the vehicles, choose the mode, plan.
#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// A plan is followed while it is no further than this from the vehicle. [m], [m/s]
static const double far_m = 1.0, far_mps = 1.0;
/// Nearer than this, its own points are driven; else new ones along the same actions. [m], [m/s]
static const double near_m = 0.05, near_mps = 0.1;
/// An unplanned neighbour that brakes harder is expected to go on braking. [m/s^2]
static const double brakes_from = 1.0;
/// A planned neighbour brakes at least by this for a vehicle that its plan lets go first. [m/s^2]
static const double lets_braking = 3.0;
/// Free space beside the own path, within which another body counts as in it. [m]
static const double path_margin = 1.0;
/// Free distance to such a neighbour, ahead of it and behind; less where there is less now. [m]
static const double braking_gap = 1.5;

/// A clock that is further ahead after a cycle has stepped; no cycle is that long. [us]
static const int64_t leap_us = 1500000;

/// The front of a body passes a stop line where it is this far beyond it. [m]
static const double passes_from = 0.3;

enum { OWN_STATES = 32 }; // remembered, to know them again when a bus returns them

/// What plans the cycles of the roadside unit again.
typedef struct again {
    repeat         repeat;
    verge_planner* planner;
    void*          memory;
    bool           due;     // a cycle is whole
} again;

struct unit {
    unit_def            def;
    void*               road_memory;
    void*               stage_memory[3];
    again*              again;          // null: nothing is planned again
    size_t              road_size, stage_size;
    const verge_road*   road;
    verge_decider*      decider;
    verge_predictor*    predictor;
    verge_sampler*      sampler;

    inbox               inbox;
    inbox_view          view;
    verge_signal        signals[INBOX_SIGNALS_MAX];
    leader              leader;
    verge_vehicle_state_t own_state;
    int64_t             own_utimes[OWN_STATES]; // [us] of the last own states
    uint32_t            own_count;

    verge_vehicle       vehicles[2][VERGE_VEHICLES_MAX];
    verge_lane_position positions[2][VERGE_VEHICLES_MAX];
    verge_scene         scenes[2];      // of this cycle and of the cycle before
    verge_track         bodies[VERGE_VEHICLES_MAX];
    verge_tracks        tracks;
    uint32_t            own;            // index of the own vehicle in the scene
    verge_vehicle_decision decided[1];
    verge_commitment    commitment;     // of own decisions
    verge_vehicle_plan  plans[3];       // of this cycle, of the cycle before, and an alternative
    bool                has_last;

    wire_unit_mode      mode;
    wire_unit_reason    reason;
    int32_t             reason_vehicle;
    int64_t             departed;       // [us] utime of the last plan departed from; 0: none
    wire_unit_reason    departed_reason;
    int32_t             departed_vehicle;
    int64_t             utime;          // [us] of the last cycle
    int64_t             state_utime;    // [us] of the own state in it
    int32_t             sequence;
    unit_counters       counters;
};

// ---- memory -------------------------------------------------------------------------------

static void* allocate(size_t size)
{
    return aligned_alloc(64, (size + 63) / 64 * 64);
}

static bool build(unit* self, char* error, size_t error_size)
{
    const verge_planner_def* def = &self->def.planner;
    const size_t sizes[3] = { verge_decider_memory_size(def),
                              verge_predictor_shared_memory_size(def),
                              verge_sampler_memory_size(def) };
    self->road_size = verge_road_memory_size(&def->road, NULL);
    self->road_memory = self->road_size > 0 ? allocate(self->road_size) : NULL;
    for (uint32_t i = 0; i < 3; i++) {
        self->stage_memory[i] = sizes[i] > 0 ? allocate(sizes[i]) : NULL;
        self->stage_size += sizes[i];
    }
    if (self->road_size == 0 || sizes[0] == 0 || sizes[1] == 0 || sizes[2] == 0) {
        snprintf(error, error_size, "planner: the planner refuses these parameters");
        return false;
    }
    if (self->road_memory == NULL || self->stage_memory[0] == NULL
        || self->stage_memory[1] == NULL || self->stage_memory[2] == NULL) {
        snprintf(error, error_size, "planner: the system refused %zu bytes",
                 self->road_size + self->stage_size);
        return false;
    }
    verge_status status =
        verge_road_init(&self->road, &def->road, self->road_memory, self->road_size);
    if (status == VERGE_OK) {
        status = verge_decider_init(&self->decider, def, self->stage_memory[0], sizes[0]);
    }
    if (status == VERGE_OK) {
        status = verge_predictor_init_shared(&self->predictor, self->decider,
                                             self->stage_memory[1], sizes[1]);
    }
    if (status == VERGE_OK) {
        status = verge_sampler_init(&self->sampler, def, self->stage_memory[2], sizes[2]);
    }
    if (status != VERGE_OK) {
        snprintf(error, error_size, "planner: %s", verge_status_text(status));
    }
    return status == VERGE_OK;
}

static bool build_again(unit* self, const unit_def* def, char* error, size_t error_size)
{
    if (!def->repeats) {
        return true;
    }
    verge_planner_def planner = def->rsu_planner;
    planner.road = def->planner.road;
    planner.threads = 1;
    const size_t size = verge_planner_memory_size(&planner);
    again* made = self->again = calloc(1, sizeof *made);
    if (made != NULL && size > 0) {
        made->memory = allocate(size);
    }
    if (made == NULL || made->memory == NULL) {
        snprintf(error, error_size, "repeat: %s", size == 0 ? "the planner refuses these parameters"
                                                            : "the system refused memory");
        return false;
    }
    const verge_status status = verge_planner_init(&made->planner, &planner, made->memory, size);
    if (status != VERGE_OK) {
        snprintf(error, error_size, "repeat: %s", verge_status_text(status));
        return false;
    }
    const repeat_def how = { .planner = made->planner, .vehicles_max = planner.vehicles_max,
                             .controlled_max = planner.controlled_max, .limits = def->limits,
                             .map_crc32 = def->map_crc32 };
    repeat_init(&made->repeat, &how);
    self->stage_size += size + sizeof *made;
    return true;
}

unit* unit_open(const unit_def* def, char* error, size_t error_size)
{
    unit* self = calloc(1, sizeof *self);
    if (self == NULL) {
        snprintf(error, error_size, "planner: the system refused %zu bytes", sizeof *self);
        return NULL;
    }
    self->def = *def;
    self->def.planner.controlled_max = 1;
    if (!build(self, error, error_size) || !build_again(self, def, error, error_size)) {
        unit_close(self);
        return NULL;
    }
    self->def.planner.road = self->def.rsu_planner.road = (verge_road_def){ NULL, 0 }; // built
    inbox_init(&self->inbox, &def->limits, VERGE_VEHICLES_MAX, VERGE_CONTROLLED_MAX);
    inbox_set_map(&self->inbox, def->map_crc32);
    const leader_def follow = { .vehicle_id = def->vehicle_id, .rsu_id = def->rsu_id,
                                .map_crc32 = def->map_crc32,
                                .future_us = (int64_t)(def->limits.future_ms * 1000.0) };
    leader_init(&self->leader, &follow);
    for (uint32_t i = 0; i < 2; i++) {
        self->scenes[i] = verge_scene_make(self->road, self->vehicles[i], self->positions[i],
                                           VERGE_VEHICLES_MAX);
    }
    self->tracks = verge_tracks_make(self->bodies, VERGE_VEHICLES_MAX);
    self->mode = WIRE_STOPPING;
    self->reason = WIRE_UNIT_NO_POSITION;
    self->reason_vehicle = -1;
    return self;
}

void unit_close(unit* self)
{
    if (self == NULL) {
        return;
    }
    if (self->again != NULL) {
        free(self->again->memory);
        free(self->again);
    }
    free(self->road_memory);
    for (uint32_t i = 0; i < 3; i++) {
        free(self->stage_memory[i]);
    }
    free(self);
}

unit_memory unit_memory_of(const unit* self)
{
    return (unit_memory){ .road = self->road_size, .stages = self->stage_size,
                          .rest = sizeof *self };
}

void unit_continue(unit* self, const unit* before)
{
    self->inbox = before->inbox;
    inbox_set_limits(&self->inbox, &self->def.limits);
    inbox_set_map(&self->inbox, self->def.map_crc32);
    inbox_review(&self->inbox, self->road);
    inbox_forget_senders(&self->inbox); // new buses give new numbers to senders
    self->own_state = before->own_state;
    self->plans[1] = before->plans[1];
    self->has_last = before->has_last;
    self->mode = before->mode;
    self->reason = before->reason;
    self->reason_vehicle = before->reason_vehicle;
    self->utime = before->utime;
    self->sequence = before->sequence;
    self->counters = before->counters;
    if (self->def.map_crc32 == before->def.map_crc32 && self->def.rsu_id == before->def.rsu_id) {
        const leader_def def = self->leader.def;
        self->leader = before->leader;
        self->leader.def = def;
        memset(self->leader.senders, 0, sizeof self->leader.senders); // as above
    } else {
        memcpy(self->leader.counters, before->leader.counters, sizeof self->leader.counters);
    }
}

static double length_of(double x, double y)
{
    return sqrt(x * x + y * y); // hypot() has other bits on other machines
}

// ---- messages -----------------------------------------------------------------------------

/// Is this one of the last own states? The unit forwards them, and a bus may return them.
static bool is_echo(const unit* self, const verge_vehicle_state_t* state)
{
    bool found = false;
    for (uint32_t i = 0; i < OWN_STATES; i++) {
        found = found || self->own_utimes[i] == state->utime;
    }
    return found;
}

/// Where all places of the inbox are taken, the farthest vehicle leaves for a nearer one, and any
/// for the own one.
static void make_place(unit* self, const verge_vehicle_state_t* state)
{
    const double x = self->own_state.x, y = self->own_state.y;
    int32_t farthest = -1;
    double  distance = 0.0;
    if (inbox_held_utime(&self->inbox, state->vehicle_id) != 0
        || !inbox_farthest(&self->inbox, x, y, &farthest, &distance)) {
        return;
    }
    if (state->vehicle_id == self->def.vehicle_id
        || length_of(state->x - x, state->y - y) < distance) {
        inbox_forget_vehicle(&self->inbox, farthest);
    }
}

static bool offer_state(unit* self, const transport_message* message, inbox_source source)
{
    const verge_vehicle_state_t* state = &message->as.state;
    const bool own = state->vehicle_id == self->def.vehicle_id;
    const int32_t bus = self->def.own_bus;
    if (own && bus >= 0 && message->bus != (uint32_t)bus) {
        self->counters.own_id_elsewhere += is_echo(self, state) ? 0u : 1u;
        return false;
    }
    make_place(self, state);
    const bool used = inbox_offer_from(&self->inbox, state, source, message->arrival_utime,
                                       self->road) == INBOX_ACCEPTED;
    if (own && used) {
        self->own_state = *state;
        self->own_utimes[self->own_count++ % OWN_STATES] = state->utime;
    }
    if (used && self->again != NULL) {
        repeat_state(&self->again->repeat, state);
    }
    return used;
}

static bool offer_plan(unit* self, const transport_message* message, inbox_source source)
{
    const verge_vehicle_plan_t* plan = &message->as.plan;
    const bool used =
        leader_offer(&self->leader, plan, source, message->arrival_utime) == LEADER_ACCEPTED;
    if (used && self->again != NULL) {
        self->again->due = repeat_plan(&self->again->repeat, plan) || self->again->due;
    }
    return used;
}

static bool offer_signal(unit* self, const transport_message* message)
{
    const bool used = inbox_offer_signal(&self->inbox, &message->as.signal, message->arrival_utime,
                                         self->road) == INBOX_ACCEPTED;
    if (used && self->again != NULL) {
        repeat_signal(&self->again->repeat, &message->as.signal);
    }
    return used;
}

bool unit_offer(unit* self, const transport_message* message)
{
    const inbox_source source = { .sender = message->sender, .bus = message->bus };
    switch (message->kind) {
    case TRANSPORT_STATE: return offer_state(self, message, source);
    case TRANSPORT_PLAN: return offer_plan(self, message, source);
    case TRANSPORT_SIGNAL: return offer_signal(self, message);
    default: return false;
    }
}

bool unit_repeat(unit* self, repeat_result* result)
{
    if (self->again == NULL || !self->again->due) {
        return false;
    }
    self->again->due = false;
    repeat_run(&self->again->repeat, self->def.vehicle_id, result);
    self->counters.repeated += result->planned ? 1u : 0u;
    self->counters.repeated_same += result->planned && result->same ? 1u : 0u;
    return true;
}

// ---- the vehicles of a cycle --------------------------------------------------------------

/// How far a vehicle is from the own one; one ahead in its path counts as ten times as near. [m]
static double remoteness(const verge_vehicle* other, const verge_vehicle* own)
{
    const double x = other->x - own->x, y = other->y - own->y;
    double sine, cosine;
    verge_sincos(own->heading, &sine, &cosine);
    const double ahead = x * cosine + y * sine, beside = fabs(y * cosine - x * sine);
    const double reach = 0.5 * (own->width + other->width) + path_margin;
    return length_of(x, y) * (ahead > 0.0 && beside < reach ? 0.1 : 1.0);
}

/// The own vehicle where its last trajectory has it at this instant.
static verge_vehicle reckoned(const unit* self, int64_t utime)
{
    const verge_vehicle_plan* last = &self->plans[1];
    const double t = (double)(utime - last->utime) * 1e-6 / last->points[1].t;
    const double k = fmin(fmax(t, 0.0), (double)(last->point_count - 1u));
    const uint32_t i = (uint32_t)k + 1u < last->point_count ? (uint32_t)k : last->point_count - 2u;
    const verge_point *a = &last->points[i], *b = &last->points[i + 1u];
    const double share = k - (double)i;
    const bool over = t > (double)(last->point_count - 1u);
    verge_vehicle own = wire_vehicle_from_state(&self->own_state);
    own.x = a->x + share * (b->x - a->x);
    own.y = a->y + share * (b->y - a->y);
    own.heading = share < 0.5 ? a->heading : b->heading;
    own.speed = over ? 0.0 : fmax(a->speed + share * (b->speed - a->speed), 0.0);
    own.acceleration = over ? 0.0 : a->acceleration + share * (b->acceleration - a->acceleration);
    own.yaw_rate = (share < 0.5 ? a->curvature : b->curvature) * own.speed;
    if (!verge_road_continues(self->road, own.target_lane, own.target_lane)) {
        own.target_lane = VERGE_NO_LANE; // a lane that this road does not have
    }
    return own;
}

/// The own vehicle and the nearest of the others, as many as the planner holds. Returns how many.
static uint32_t gather(unit* self, const verge_vehicle* own,
                       verge_vehicle nearest[VERGE_VEHICLES_MAX])
{
    const uint32_t room = self->def.planner.vehicles_max - 1u;
    uint32_t count = 0;
    for (uint32_t i = 0; i < self->view.count; i++) {
        verge_vehicle next = self->view.vehicles[i];
        if (next.id == own->id) {
            continue;
        }
        if (!verge_vehicle_check(&next, NULL)) {
            self->counters.unusable++;
            continue;
        }
        next.controlled = leader_plan_of(&self->leader, next.id, self->utime) != NULL;
        uint32_t at = count;
        for (; at > 0 && remoteness(&next, own) < remoteness(&nearest[at - 1u], own); at--) {
            if (at < room) {
                nearest[at] = nearest[at - 1u];
            }
        }
        if (at < room) {
            nearest[at] = next;
        }
        self->counters.left_out += count == room ? 1u : 0u;
        count += count < room ? 1u : 0u;
    }
    nearest[count] = *own;
    nearest[count].controlled = true;
    return count + 1u;
}

/// Builds the scene of this cycle in the arrays of the one before the last. False: the planner
/// refuses the own vehicle.
static bool place(unit* self, const verge_vehicle* own)
{
    verge_vehicle heard[VERGE_VEHICLES_MAX];
    const uint32_t count = gather(self, own, heard);
    verge_scene before = self->scenes[0], now = self->scenes[1];
    before.signals = NULL;
    before.signal_count = 0;
    now.signal_count = inbox_signals(&self->inbox, self->utime, self->signals);
    now.signals = self->signals;
    const verge_status status = verge_scene_place(&now, self->utime, heard, count, &before);
    if (status != VERGE_OK) {
        return false;
    }
    self->scenes[0] = now;
    self->scenes[1] = before;
    self->own = (uint32_t)verge_scene_find(&now, own->id);
    return true;
}

// ---- prediction ---------------------------------------------------------------------------

typedef struct pose {
    double x, y, heading, speed;
} pose;

/// Where a plan has its vehicle at an instant; after its last point it goes on straight ahead.
static pose pose_of(const verge_vehicle_plan_t* plan, int64_t utime)
{
    const double at = (double)(utime - plan->utime) / (1000.0 * plan->dt_ms);
    const int32_t last = plan->point_count - 1;
    const int32_t i = at < 0.0 ? 0 : at >= (double)last ? last - 1 : (int32_t)at;
    const verge_plan_point_t *a = &plan->points[i], *b = &plan->points[i + 1];
    const double share = fmin(fmax(at - i, 0.0), 1.0);
    const double beyond_s = fmax(at - last, 0.0) * 1e-3 * plan->dt_ms;
    const double whole = 2.0 * 3.14159265358979323846;
    const double turn = remainder((double)b->heading - (double)a->heading, whole);
    pose p = { a->x + share * (b->x - a->x), a->y + share * (b->y - a->y),
               (double)a->heading + share * turn,
               (double)a->speed + share * ((double)b->speed - (double)a->speed) };
    double sine, cosine;
    verge_sincos(p.heading, &sine, &cosine);
    p.x += beyond_s * p.speed * cosine;
    p.y += beyond_s * p.speed * sine;
    return p;
}

/// Is the vehicle as near to where the plan has it now? [m], [m/s]
static bool is_within(const verge_vehicle_plan_t* plan, const verge_vehicle* vehicle, int64_t utime,
                      double distance, double speed)
{
    const pose p = pose_of(plan, utime);
    return length_of(p.x - vehicle->x, p.y - vehicle->y) <= distance
           && fabs(p.speed - vehicle->speed) <= speed;
}

static bool fits(const verge_vehicle_plan_t* plan, const verge_vehicle* vehicle, int64_t utime)
{
    return is_within(plan, vehicle, utime, far_m, far_mps);
}

static void track_plan(const unit* self, const verge_vehicle_plan_t* plan, verge_track* track)
{
    for (uint32_t k = 1; k < self->def.planner.points; k++) {
        const double us = (double)k * self->def.planner.point_s * 1e6;
        const pose p = pose_of(plan, self->utime + (int64_t)(us + 0.5));
        verge_track_set(track, k, p.x, p.y, p.heading, p.speed);
    }
}

/// Does the plan of another vehicle say that it passes an area after the own one?
static bool comes_after_own(const unit* self, const verge_vehicle_plan_t* plan)
{
    bool after = false;
    for (int32_t k = 0; plan != NULL && k < plan->pass_count; k++) {
        after = after || plan->passes[k].after == self->def.vehicle_id;
    }
    return after;
}

/// One that is beside its plan, in which it lets the own vehicle go first, brakes to do so.
static void track_letting(const unit* self, const verge_vehicle* vehicle, verge_track* track)
{
    for (uint32_t k = 1; k < self->def.planner.points; k++) {
        verge_vehicle then = *vehicle;
        then.acceleration = fmin(then.acceleration, -lets_braking);
        inbox_project(&then, (double)k * self->def.planner.point_s);
        verge_track_set(track, k, then.x, then.y, then.heading, then.speed);
    }
}

static void track_braking(const unit* self, const verge_vehicle* vehicle, verge_track* track)
{
    const verge_vehicle* own = &self->scenes[0].vehicles[self->own];
    const double room = verge_vehicles_distance(own, vehicle) - self->def.planner.clearance;
    track->half_length += fmin(braking_gap, fmax(0.9 * room, 0.0));
    for (uint32_t k = 1; k < self->def.planner.points; k++) {
        verge_vehicle then = *vehicle;
        inbox_project(&then, (double)k * self->def.planner.point_s);
        verge_track_set(track, k, then.x, then.y, then.heading, then.speed);
    }
}

/// The motion of all vehicles, with this decision for the own one; null: it keeps its lane.
static bool predict(unit* self, const verge_vehicle_decision* decided)
{
    verge_decision decision = verge_decision_make(self->decided, 1);
    if (decided != NULL) {
        self->decided[0] = *decided;
        decision.vehicle_count = 1;
    }
    const verge_scene* scene = &self->scenes[0];
    if (verge_predict(self->predictor, scene, &decision, &self->tracks) != VERGE_OK) {
        return false;
    }
    for (uint32_t i = 0; i < scene->vehicle_count; i++) {
        const verge_vehicle* vehicle = &scene->vehicles[i];
        const verge_vehicle_plan_t* plan = leader_plan_of(&self->leader, vehicle->id, self->utime);
        if (i == self->own) {
            continue;
        }
        if (plan != NULL && fits(plan, vehicle, self->utime)) {
            track_plan(self, plan, &self->tracks.of[i]);
        } else if (vehicle->speed > 0.0 && comes_after_own(self, plan)) {
            track_letting(self, vehicle, &self->tracks.of[i]);
        } else if (vehicle->acceleration < -brakes_from && vehicle->speed > 0.0) {
            track_braking(self, vehicle, &self->tracks.of[i]);
        }
    }
    return true;
}

// ---- planning -----------------------------------------------------------------------------

static const verge_vehicle_plan* last_of(const unit* self)
{
    return self->has_last ? &self->plans[1] : NULL;
}

static void stop(unit* self, verge_vehicle_plan* plan)
{
    verge_status status = VERGE_ERR_ARGUMENT;
    if (predict(self, NULL)) {
        status = verge_plan_stop(self->sampler, &self->scenes[0], self->def.vehicle_id,
                                 &self->tracks, last_of(self), plan);
    }
    if (status != VERGE_OK) { // a defect: the own vehicle and the tracks were checked
        memset(plan, 0, sizeof *plan);
    }
}

/// A trajectory for a decision. False: the decision cannot be used.
static bool plan_decided(unit* self, const verge_vehicle_decision* decided,
                         verge_vehicle_plan* plan)
{
    return predict(self, decided)
           && verge_plan_vehicle(self->sampler, &self->scenes[0], decided, &self->tracks,
                                 last_of(self), plan) == VERGE_OK;
}

/// Decides for the own vehicle alone.
static bool decide(unit* self, verge_vehicle_decision* decided)
{
    verge_scene* scene = &self->scenes[0];
    bool planned[VERGE_VEHICLES_MAX];
    for (uint32_t i = 0; i < scene->vehicle_count; i++) {
        planned[i] = scene->vehicles[i].controlled;
        scene->vehicles[i].controlled = i == self->own;
    }
    verge_decision decision = verge_decision_make(self->decided, 1);
    const bool done = verge_decide(self->decider, scene, &self->commitment, &decision) == VERGE_OK
                      && decision.vehicle_count == 1;
    for (uint32_t i = 0; i < scene->vehicle_count; i++) {
        scene->vehicles[i].controlled = planned[i];
    }
    *decided = self->decided[0];
    return done;
}

static void plan_alone(unit* self, verge_vehicle_plan* plan)
{
    verge_vehicle_decision own;
    if (!decide(self, &own) || !plan_decided(self, &own, plan)) {
        stop(self, plan);
    }
}

/// Along the actions of the plan, or else by an own decision: before a red signal in any case.
static void plan_departing(unit* self, const verge_vehicle_plan_t* rest, bool red,
                           verge_vehicle_plan* plan)
{
    verge_vehicle_decision decided;
    const bool along =
        !red && wire_decision_from_plan(rest, &decided) && plan_decided(self, &decided, plan);
    if (along && plan->status == VERGE_PLANNED) {
        return;
    }
    verge_vehicle_plan* other = &self->plans[2];
    plan_alone(self, other);
    if (!along || other->status == VERGE_PLANNED) {
        *plan = *other;
    }
}

/// Is the front of a body beyond a stop line? *beside: [m] from the middle of the line.
static bool is_beyond(const verge_road* road, int32_t lane, double x, double y, double* beside)
{
    double line_x = 0.0, line_y = 0.0, heading = 0.0, sine, cosine;
    (void)verge_road_at(road, lane, verge_road_stop_line(road, lane), 0.0, &line_x, &line_y,
                        &heading);
    verge_sincos(heading, &sine, &cosine);
    *beside = fabs((y - line_y) * cosine - (x - line_x) * sine);
    return (x - line_x) * cosine + (y - line_y) * sine > passes_from;
}

/// Does the rest of a plan pass the stop line of this lane before the red of its signal ends?
static bool passes(const unit* self, const verge_vehicle_plan_t* rest, const verge_signal* signal)
{
    const verge_scene* scene = &self->scenes[0];
    const double front = 0.5 * scene->vehicles[self->own].length;
    int32_t lane = scene->positions[self->own].lane_id;
    bool was_before = false;
    for (int32_t k = 0; k < rest->point_count; k++) {
        const verge_plan_point_t* point = &rest->points[k];
        const double t = (double)(rest->utime - self->utime) * 1e-6 + k * 1e-3 * rest->dt_ms;
        if (signal->change_s >= 0.0 && t > signal->change_s) {
            return false;
        }
        double sine, cosine, beside;
        verge_sincos((double)point->heading, &sine, &cosine);
        const bool beyond =
            is_beyond(scene->road, signal->lane_id, point->x + front * cosine,
                      point->y + front * sine, &beside);
        if (beyond && was_before) {
            return beside < 0.5 * verge_road_width(scene->road, signal->lane_id);
        }
        lane = verge_road_project(scene->road, point->x, point->y, (double)point->heading, lane)
                   .lane_id;
        was_before = !beyond && lane == signal->lane_id;
    }
    return false;
}

static bool passes_red(const unit* self, const verge_vehicle_plan_t* rest)
{
    bool found = false;
    for (uint32_t i = 0; i < self->scenes[0].signal_count; i++) {
        const verge_signal* signal = &self->scenes[0].signals[i];
        found = found || (signal->state == VERGE_SIGNAL_RED && passes(self, rest, signal));
    }
    return found;
}

/// Does the rest of a plan meet a body, as they are predicted now? *met: the vehicle.
static bool meets(unit* self, const verge_vehicle_plan_t* rest, int32_t* met)
{
    verge_vehicle_decision decided;
    const bool usable = wire_decision_from_plan(rest, &decided);
    if (!predict(self, usable ? &decided : NULL)) {
        return true;
    }
    track_plan(self, rest, &self->tracks.of[self->own]);
    const double left_s = (double)(rest->utime - self->utime) * 1e-6
                          + (rest->point_count - 1) * 1e-3 * rest->dt_ms;
    const double whole = left_s / self->def.planner.point_s;
    const uint32_t points = whole >= (double)self->def.planner.points
                                ? self->def.planner.points : (uint32_t)whole + 1u;
    uint32_t other = 0;
    if (!verge_tracks_contact(&self->tracks, self->own, points, 0.0, &other, NULL)) {
        return false;
    }
    *met = self->tracks.of[other].vehicle_id;
    return true;
}

// ---- a cycle ------------------------------------------------------------------------------

/// The mode of a cycle and its cause.
typedef struct choice {
    wire_unit_mode   mode;
    wire_unit_reason reason;
    int32_t          vehicle;
    bool             tracked;  // following the very points of the plan
    bool             has_rest;
    int64_t          plan_utime; // [us] of that plan
    verge_vehicle_plan_t rest; // of the plan that is followed or departed from
} choice;

/// The body that overlaps the own one, -1: none. Margins of old states do not count.
static int32_t touching(const unit* self)
{
    const verge_scene* scene = &self->scenes[0];
    verge_vehicle own = scene->vehicles[self->own];
    own.margin = 0.0;
    for (uint32_t i = 0; i < scene->vehicle_count; i++) {
        verge_vehicle other = scene->vehicles[i];
        other.margin = 0.0;
        if (i != self->own && verge_vehicles_overlap(&own, &other)) {
            return other.id;
        }
    }
    return -1;
}

static void choose(unit* self, choice* chosen)
{
    *chosen = (choice){ .mode = WIRE_STOPPING, .vehicle = touching(self) };
    if (chosen->vehicle >= 0) {
        chosen->reason = WIRE_UNIT_TOUCHING;
        return;
    }
    if (self->scenes[0].positions[self->own].lane_id == VERGE_NO_LANE) {
        chosen->reason = WIRE_UNIT_OFF_ROAD;
        return;
    }
    chosen->mode = WIRE_ALONE;
    const verge_vehicle_plan_t* plan = leader_plan(&self->leader, self->utime, &chosen->reason);
    if (self->own_state.controlled == 0) {
        chosen->reason = WIRE_UNIT_NOT_WANTED;
        return;
    }
    if (plan == NULL) {
        return;
    }
    // The rest has to look as far ahead as a new plan would be half over.
    if (!wire_plan_rest(plan, self->utime, &chosen->rest)
        || 2 * (chosen->rest.point_count - 1) < plan->point_count - 1) {
        chosen->reason = WIRE_UNIT_PLAN_OVER;
        return;
    }
    chosen->has_rest = true;
    chosen->plan_utime = plan->utime;
    chosen->mode = WIRE_DEPARTING;
    if (!fits(plan, &self->scenes[0].vehicles[self->own], self->utime)) {
        chosen->reason = WIRE_UNIT_PLAN_FAR;
    } else if (meets(self, &chosen->rest, &chosen->vehicle)) {
        chosen->reason = WIRE_UNIT_CONTACT;
    } else if (passes_red(self, &chosen->rest)) {
        chosen->reason = WIRE_UNIT_RED_SIGNAL;
    } else if (plan->utime == self->departed) {
        chosen->reason = self->departed_reason; // until the next plan
        chosen->vehicle = self->departed_vehicle;
    } else {
        chosen->mode = WIRE_FOLLOWING;
        chosen->tracked = is_within(plan, &self->scenes[0].vehicles[self->own], self->utime,
                                    near_m, near_mps);
    }
}

static wire_plan_header header_of(const unit* self, const verge_vehicle_plan* plan)
{
    const double us = (double)(plan->point_count - 1u) * self->def.planner.point_s * 1e6;
    return (wire_plan_header){ .utime = plan->utime,
                               .valid_until_utime = plan->utime + (int64_t)(us + 0.5),
                               .map_crc32 = self->def.map_crc32 };
}

static void fill(const unit* self, const choice* chosen, const verge_vehicle_plan_t* plan,
                 verge_vehicle_trajectory_t* to)
{
    const verge_plan_action_t* action = wire_action_at(plan, self->utime);
    const verge_plan_action_t none = { .action = VERGE_KEEP_SPEED, .lane = VERGE_NO_LANE };
    action = action != NULL ? action : &none;
    *to = (verge_vehicle_trajectory_t){
        .utime = plan->utime,
        .valid_until_utime = plan->valid_until_utime,
        .state_utime = self->state_utime,
        .vehicle_id = self->def.vehicle_id,
        .sequence = self->sequence,
        .mode = (int16_t)chosen->mode,
        .mode_reason = (int16_t)chosen->reason,
        .mode_vehicle = chosen->vehicle,
        .rsu_id = chosen->has_rest ? chosen->rest.rsu_id : -1,
        .followed_cycle = chosen->has_rest ? chosen->rest.cycle : -1,
        .map_crc32 = (int32_t)self->def.map_crc32,
        .protocol_version = WIRE_PROTOCOL_VERSION,
        .status = plan->status,
        .reason = plan->reason,
        .why = plan->why,
        .why_vehicle = plan->why_vehicle,
        .why_lane = plan->why_lane,
        .lane = action->lane,
        .action = action->action,
        .brake_light = action->brake_light,
        .turn_signal = action->turn_signal,
        .dt_ms = plan->dt_ms,
        .point_count = plan->point_count,
    };
    memcpy(to->points, plan->points, sizeof to->points);
}

static void adopt(unit* self, const choice* chosen)
{
    self->counters.mode_changes += self->mode != chosen->mode ? 1u : 0u;
    self->counters.by_mode[chosen->mode]++;
    self->mode = chosen->mode;
    self->reason = chosen->reason;
    self->reason_vehicle = chosen->vehicle;
    if (chosen->mode == WIRE_DEPARTING) {
        self->departed = chosen->plan_utime;
        self->departed_reason = chosen->reason;
        self->departed_vehicle = chosen->vehicle;
    }
    if (chosen->mode == WIRE_FOLLOWING) { // own decisions begin anew after it
        memset(&self->commitment, 0, sizeof self->commitment);
    }
}

/// Follows the plan of the roadside unit: its points, or new ones along the same actions. Where
/// there are none, the vehicle departs.
static void plan_following(unit* self, choice* chosen, verge_vehicle_plan* plan)
{
    verge_vehicle_decision decided;
    if (chosen->tracked) {
        (void)wire_vehicle_plan_from_plan(&chosen->rest, plan); // the next cycle begins from it
    } else if (!wire_decision_from_plan(&chosen->rest, &decided)
               || !plan_decided(self, &decided, plan)
               || (plan->status != VERGE_PLANNED && chosen->rest.status == VERGE_PLANNED)) {
        chosen->mode = WIRE_DEPARTING;
        chosen->reason = WIRE_UNIT_NO_TRAJECTORY;
        plan_departing(self, &chosen->rest, false, plan);
    }
}

/// Plans for the chosen mode and fills the trajectory. False: a defect, there is no trajectory.
static bool carry_out(unit* self, choice* chosen, verge_vehicle_trajectory_t* trajectory)
{
    verge_vehicle_plan* plan = &self->plans[0];
    switch (chosen->mode) {
    case WIRE_FOLLOWING: plan_following(self, chosen, plan); break;
    case WIRE_DEPARTING:
        plan_departing(self, &chosen->rest, chosen->reason == WIRE_UNIT_RED_SIGNAL, plan);
        break;
    case WIRE_ALONE: plan_alone(self, plan); break;
    case WIRE_STOPPING: stop(self, plan); break;
    }
    if (plan->point_count < 2) {
        return false;
    }
    if (chosen->tracked) {
        fill(self, chosen, &chosen->rest, trajectory);
    } else {
        const wire_plan_header header = header_of(self, plan);
        const verge_vehicle_plan_t message = wire_plan_from_vehicle_plan(&header, plan);
        fill(self, chosen, &message, trajectory);
        self->counters.fallbacks += plan->status != VERGE_PLANNED ? 1u : 0u;
    }
    self->counters.tracked += chosen->tracked ? 1u : 0u;
    self->plans[1] = *plan;
    self->has_last = true;
    adopt(self, chosen);
    return true;
}

/// The own vehicle at this instant. False: its state is missing, too old, or without heading or
/// speed.
static bool own_vehicle(unit* self, verge_vehicle* own)
{
    self->state_utime = 0;
    return inbox_latest(&self->inbox, self->def.vehicle_id, self->utime, own, &self->state_utime)
           && !isnan(self->own_state.heading) && !isnan(self->own_state.speed);
}

/// The clock has stepped: what is known lies in the future now, or is older than it was.
static void start_afresh(unit* self)
{
    self->counters.clock_steps++;
    inbox_forget(&self->inbox, VERGE_VEHICLES_MAX, VERGE_CONTROLLED_MAX);
    leader_forget(&self->leader);
    memset(&self->commitment, 0, sizeof self->commitment);
    self->departed = 0;
}

bool unit_cycle(unit* self, int64_t utime, verge_vehicle_trajectory_t* trajectory)
{
    const int64_t back = self->utime - utime;
    if (self->counters.cycles > 0 && (back >= 0 || back < -leap_us)) {
        start_afresh(self);
        self->plans[1].utime -= back; // the last trajectory goes on by the new clock
    }
    self->utime = utime;
    self->counters.cycles++;
    self->sequence = self->sequence < INT32_MAX ? self->sequence + 1 : 0;
    inbox_snapshot(&self->inbox, utime, &self->view);
    inbox_placed(&self->inbox, &self->def.vehicle_id, 1); // off the road it is known, too
    verge_vehicle own;
    choice chosen = { .mode = WIRE_STOPPING, .reason = WIRE_UNIT_NO_POSITION, .vehicle = -1 };
    bool known = own_vehicle(self, &own);
    if (known && !place(self, &own)) {
        chosen.reason = WIRE_UNIT_REFUSED;
        known = false;
    } else if (known) {
        choose(self, &chosen);
    }
    if (!known) { // from where the last trajectory has it
        if (self->has_last) {
            own = reckoned(self, utime);
        }
        if (!self->has_last || !place(self, &own)) {
            self->counters.without++;
            self->mode = chosen.mode;
            self->reason = chosen.reason;
            self->reason_vehicle = -1;
            return false;
        }
    }
    return carry_out(self, &chosen, trajectory);
}

// ---- what others see ----------------------------------------------------------------------

unit_view unit_look(const unit* self)
{
    return (unit_view){
        .mode = self->mode,
        .reason = self->reason,
        .vehicle = self->reason_vehicle,
        .utime = self->utime,
        .state_utime = self->state_utime,
        .neighbours = self->scenes[0].vehicle_count > 0 ? self->scenes[0].vehicle_count - 1u : 0,
        .scene = &self->scenes[0],
        .plan = &self->plans[1],
        .own = self->own_state,
    };
}

unit_counters unit_count(const unit* self)
{
    return self->counters;
}

const inbox* unit_inbox(const unit* self)
{
    return &self->inbox;
}

const leader* unit_leader(const unit* self)
{
    return &self->leader;
}

const verge_road* unit_road(const unit* self)
{
    return self->road;
}
