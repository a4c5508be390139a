/// See fleet.h.
#include "fleet.h"

#include "common/state_message.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { QUEUE_MAX = 16 * VERGE_CONTROLLED_MAX }; // plans on their way

/// An instant of our time at t = 0: messages have no instants before 1970. [us]
static const int64_t epoch = INT64_C(1700000000) * 1000000;

typedef struct flying_plan {
    int64_t              due;    // [us]
    uint64_t             sender; // of the roadside unit
    verge_vehicle_plan_t plan;
} flying_plan;

struct fleet {
    world*        world;
    fleet_options  faults;
    uint32_t      map_crc32;
    cycle         cycle;       // of the roadside unit
    int64_t       cycle_count;
    uint64_t      rsu_sender;  // another one after each start
    bool          was_off, planned;
    uint32_t      unit_count;
    struct {
        int32_t        vehicle_id;
        unit*          unit;
        bool           drives;  // has made a trajectory
        wire_unit_mode mode;
        int32_t        followed_cycle;
    } units[VERGE_CONTROLLED_MAX];
    uint32_t      queue_count;
    flying_plan   queue[QUEUE_MAX];
    uint64_t      random;
    uint32_t      change_count;
    fleet_change  changes[FLEET_CHANGES_MAX];
};

static int64_t now_of(const fleet* self)
{
    return epoch + world_utime(self->world);
}

static bool open_units(fleet* self, char* error, size_t error_size)
{
    const scenario* scene = self->world->scene;
    unit_def def = { .planner = scene->def, .rsu_id = -1, .map_crc32 = self->map_crc32,
                     .limits = inbox_default_limits(), .own_bus = -1,
                     .repeats = self->faults.repeats, .rsu_planner = scene->def };
    def.planner.threads = 1;
    for (uint32_t i = 0; i < self->world->vehicle_count && !self->faults.without_units; i++) {
        const verge_vehicle* vehicle = &self->world->vehicles[i].state;
        if (vehicle->controlled && self->unit_count < VERGE_CONTROLLED_MAX) {
            def.vehicle_id = vehicle->id;
            unit* made = unit_open(&def, error, error_size);
            if (made == NULL) {
                return false;
            }
            self->units[self->unit_count].vehicle_id = vehicle->id;
            self->units[self->unit_count].followed_cycle = -1;
            self->units[self->unit_count++].unit = made;
        }
    }
    return true;
}

fleet* fleet_open(world* world, const fleet_options* faults, char* error, size_t error_size)
{
    fleet* self = calloc(1, sizeof *self);
    if (self == NULL) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    self->world = world;
    self->world->takes_up = true; // plans may come late
    self->faults = *faults;
    self->map_crc32 = wire_map_crc32(&world->scene->def.road);
    self->rsu_sender = 1;
    self->random = faults->seed * 2654435769u + 1u;
    const cycle_def def = {
        .planner = world->scene->planner,
        .vehicles_max = world->scene->def.vehicles_max,
        .controlled_max = world->scene->def.controlled_max,
        .limits = inbox_default_limits(),
        .rsu_id = 1,
        .map_crc32 = self->map_crc32,
    };
    cycle_init(&self->cycle, &def);
    if (!open_units(self, error, error_size)) {
        fleet_close(self);
        return NULL;
    }
    return self;
}

void fleet_close(fleet* self)
{
    if (self == NULL) {
        return;
    }
    for (uint32_t i = 0; i < self->unit_count; i++) {
        unit_close(self->units[i].unit);
    }
    free(self);
}

// ---- the bus ------------------------------------------------------------------------------

static void send_to_units(fleet* self, transport_message* message, uint64_t sender)
{
    message->arrival_utime = now_of(self);
    message->sender = sender;
    for (uint32_t i = 0; i < self->unit_count; i++) {
        unit_offer(self->units[i].unit, message);
    }
}

/// The plan that a vehicle says to follow, and the number of its message.
static int32_t followed_cycle(const fleet* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->unit_count; i++) {
        if (self->units[i].vehicle_id == vehicle_id) {
            return self->units[i].followed_cycle;
        }
    }
    return -1;
}

static void send(fleet* self, transport_message* message, uint64_t sender, bool rsu_on)
{
    send_to_units(self, message, sender);
    if (rsu_on) {
        cycle_offer(&self->cycle, message);
    }
}

static void send_states(fleet* self, bool rsu_on)
{
    static transport_message message; // large
    const world* world = self->world;
    message.kind = TRANSPORT_STATE;
    for (uint32_t i = 0; i < world->vehicle_count; i++) {
        const verge_vehicle* vehicle = &world->vehicles[i].state;
        if (world->vehicles[i].present) {
            message.as.state = state_message(vehicle, now_of(self), (int32_t)world->tick,
                                             followed_cycle(self, vehicle->id), self->map_crc32);
            send(self, &message, 1000u + (uint64_t)vehicle->id, rsu_on);
        }
    }
    message.kind = TRANSPORT_SIGNAL;
    for (uint32_t i = 0; i < world->signal_count; i++) {
        message.as.signal = signal_message(&world->signals[i], now_of(self), self->map_crc32);
        send(self, &message, 999u, rsu_on);
    }
}

static double random_share(fleet* self)
{
    self->random = self->random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(self->random >> 11) * 0x1p-53;
}

static void queue_plans(fleet* self)
{
    for (uint32_t i = 0; i < self->cycle.message_count; i++) {
        const bool lost = random_share(self) < self->faults.loss;
        if (!lost && self->queue_count < QUEUE_MAX) {
            self->queue[self->queue_count++] = (flying_plan){
                now_of(self) + (int64_t)(self->faults.delay_s * 1e6 + 0.5), self->rsu_sender,
                self->cycle.messages[i],
            };
        }
    }
}

static void deliver_plans(fleet* self)
{
    static transport_message message;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->queue_count; i++) {
        if (self->queue[i].due > now_of(self)) {
            self->queue[kept++] = self->queue[i];
            continue;
        }
        verge_vehicle_plan plan;
        message.kind = TRANSPORT_PLAN;
        message.as.plan = self->queue[i].plan;
        if (self->faults.without_units && wire_vehicle_plan_from_plan(&message.as.plan, &plan)) {
            world_follow(self->world, &plan, (double)(message.as.plan.utime - epoch) * 1e-6);
        }
        send_to_units(self, &message, self->queue[i].sender);
    }
    self->queue_count = kept;
}

// ---- a tick -------------------------------------------------------------------------------

static bool is_off(const fleet* self)
{
    const double t = world_time(self->world);
    return t >= self->faults.off_from && t < self->faults.off_to;
}

/// A roadside unit that was started again knows nothing.
static void start_again(fleet* self)
{
    const cycle_def def = self->cycle.def;
    verge_planner_reset(def.planner);
    cycle_init(&self->cycle, &def);
    self->cycle_count = 0;
    self->rsu_sender++;
}

static void run_cycle(fleet* self)
{
    const double replan = self->world->scene->replan;
    const uint32_t ticks = (uint32_t)lround(replan * WORLD_TICKS_PER_SECOND);
    self->planned = self->world->tick % ticks == 0;
    if (self->planned) {
        cycle_run(&self->cycle, self->cycle_count++, now_of(self));
        queue_plans(self);
    }
}

static void note_mode(fleet* self, uint32_t i, const verge_vehicle_trajectory_t* made)
{
    self->units[i].followed_cycle = made->mode == WIRE_FOLLOWING ? made->followed_cycle : -1;
    if (self->units[i].drives && self->units[i].mode == (wire_unit_mode)made->mode) {
        return;
    }
    self->units[i].drives = true;
    self->units[i].mode = (wire_unit_mode)made->mode;
    if (self->change_count < FLEET_CHANGES_MAX) {
        self->changes[self->change_count++] = (fleet_change){
            .t = world_time(self->world), .vehicle_id = made->vehicle_id,
            .mode = (wire_unit_mode)made->mode, .reason = (wire_unit_reason)made->mode_reason,
            .about = made->mode_vehicle, .cycle = made->followed_cycle,
        };
    }
}

/// Is the vehicle in the scene? The unit of one that has left it does nothing more.
static bool is_here(const fleet* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->world->vehicle_count; i++) {
        if (self->world->vehicles[i].state.id == vehicle_id) {
            return self->world->vehicles[i].present;
        }
    }
    return false;
}

void fleet_tick(fleet* self)
{
    const bool off = is_off(self);
    if (self->was_off && !off) {
        start_again(self);
    }
    self->was_off = off;
    self->planned = false;
    send_states(self, !off);
    if (!off) {
        run_cycle(self);
    }
    deliver_plans(self);
    for (uint32_t i = 0; i < self->unit_count; i++) {
        verge_vehicle_trajectory_t made;
        if (is_here(self, self->units[i].vehicle_id)
            && unit_cycle(self->units[i].unit, now_of(self), &made)) {
            const verge_vehicle_plan plan = trajectory_plan(&made);
            world_follow(self->world, &plan, (double)(made.utime - epoch) * 1e-6);
            note_mode(self, i, &made);
            repeat_result again;
            (void)unit_repeat(self->units[i].unit, &again);
        }
    }
}

const verge_plan* fleet_plan(const fleet* self, bool* planned)
{
    *planned = self->planned;
    return &self->cycle.plan;
}

const fleet_change* fleet_changes(const fleet* self, uint32_t* count)
{
    *count = self->change_count;
    return self->changes;
}

unit_counters fleet_count(const fleet* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->unit_count; i++) {
        if (self->units[i].vehicle_id == vehicle_id) {
            return unit_count(self->units[i].unit);
        }
    }
    return (unit_counters){ 0 };
}
