/// See bus_run.h.
#include "bus_run.h"

#include "common/state_message.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Instants are positive and leave room for sums.
static const int64_t UTIME_MAX = INT64_C(1) << 53;

bool bus_run_init(bus_run* self, const scenario* scene, int64_t start_utime, const cycle_def* def,
                  const verge_planner_def* planner, void* memory, size_t memory_size)
{
    memset(self, 0, sizeof *self);
    self->scene = scene;
    self->start_utime = start_utime;
    self->map_crc32 = wire_map_crc32(&scene->def.road);
    self->horizon_us = (int64_t)(planner->points - 1) * llround(planner->point_s * 1e6);
    self->last_number = self->gap_number = -1;
    self->memory = memory;
    self->memory_size = memory_size;
    self->memory_before = malloc(memory_size);
    self->cycle_before = malloc(sizeof *self->cycle_before);
    cycle_init(&self->cycle, def);
    return self->memory_before != NULL && self->cycle_before != NULL;
}

void bus_run_free(bus_run* self)
{
    free(self->waiting);
    free(self->memory_before);
    free(self->cycle_before);
    self->waiting = NULL;
    self->memory_before = NULL;
    self->cycle_before = NULL;
}

// ---- states -------------------------------------------------------------------------------

static const scenario_vehicle* vehicle_of(const scenario* scene, int64_t id)
{
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        if (scene->vehicles[i].start.id == id) {
            return &scene->vehicles[i];
        }
    }
    return NULL;
}

/// The vehicle of a row [id, x, y, heading, speed, acceleration, ...]. False: reported.
static bool row_read(const json_at* row, const scenario* scene, verge_vehicle* vehicle)
{
    double values[6] = { 0 };
    json_expect_array(row, 10, 10);
    const cJSON* node = row->node != NULL ? row->node->child : NULL;
    for (uint32_t i = 0; i < 6 && row->file->error[0] == '\0'; ++i, node = node->next) {
        const json_at value = json_element(row, node, i);
        values[i] = json_as_double(&value, -1e10, 1e10);
    }
    if (row->file->error[0] != '\0') {
        return false;
    }
    const scenario_vehicle* origin = vehicle_of(scene, llround(values[0]));
    if (origin == NULL) {
        return json_fail(row, "is of vehicle %.0f, expected one of the scenario", values[0]);
    }
    *vehicle = origin->start;
    vehicle->x = values[1];
    vehicle->y = values[2];
    vehicle->heading = values[3];
    vehicle->speed = values[4];
    vehicle->acceleration = values[5];
    return true;
}

static bool wait_for(bus_run* self, const verge_vehicle_state_t* state)
{
    if (self->waiting_count == self->waiting_capacity) {
        const uint32_t capacity = 2 * self->waiting_capacity + 256;
        verge_vehicle_state_t* larger = realloc(self->waiting, capacity * sizeof *larger);
        if (larger == NULL) {
            return false;
        }
        self->waiting = larger;
        self->waiting_capacity = capacity;
    }
    self->waiting[self->waiting_count++] = *state;
    return true;
}

bool bus_run_tick(bus_run* self, const json_at* line)
{
    const json_at  rows = json_member(line, "vehicles");
    const json_at  rates = json_member(line, "yaw_rates");
    const uint32_t count = json_expect_array(&rows, 0, VERGE_VEHICLES_MAX);
    const int64_t  utime =
        self->start_utime + llround(json_double(line, "t", 0.0, 1e6) * 1e6);
    json_expect_array(&rates, count, count);
    if (line->file->error[0] != '\0') {
        return false;
    }
    const cJSON* row_node = rows.node->child;
    const cJSON* rate_node = rates.node->child;
    for (uint32_t i = 0; i < count; ++i, row_node = row_node->next, rate_node = rate_node->next) {
        const json_at row = json_element(&rows, row_node, i);
        const json_at rate = json_element(&rates, rate_node, i);
        verge_vehicle vehicle;
        if (!row_read(&row, self->scene, &vehicle)) {
            return false;
        }
        vehicle.yaw_rate = json_none(&rate) ? (double)NAN : json_as_double(&rate, -1e3, 1e3);
        const verge_vehicle_state_t state = state_message(&vehicle, utime, 0, -1, self->map_crc32);
        if (!wait_for(self, &state)) {
            return json_fail(line, "out of memory");
        }
    }
    return line->file->error[0] == '\0';
}

// ---- cycles -------------------------------------------------------------------------------

typedef struct used_state {
    int32_t id;
    int64_t utime; ///< [us] of the newest state that the cycle used
} used_state;

typedef struct used_states {
    used_state vehicles[VERGE_CONTROLLED_MAX];
    uint32_t   count;
    int64_t    newest; ///< [us]
} used_states;

static bool used_read(const json_at* line, used_states* used)
{
    const json_at  plan = json_member(line, "plan");
    const json_at  vehicles = json_member(&plan, "vehicles");
    const json_at  utimes = json_member(line, "state_utimes");
    *used = (used_states){ .count = json_expect_array(&vehicles, 1, VERGE_CONTROLLED_MAX) };
    json_expect_array(&utimes, used->count, used->count);
    if (line->file->error[0] != '\0') {
        return false;
    }
    const cJSON* vehicle_node = vehicles.node->child;
    const cJSON* utime_node = utimes.node->child;
    for (uint32_t i = 0; i < used->count; ++i) {
        const json_at vehicle = json_element(&vehicles, vehicle_node, i);
        const json_at utime = json_element(&utimes, utime_node, i);
        used->vehicles[i].id = (int32_t)json_integer(&vehicle, "id", 0, INT32_MAX);
        used->vehicles[i].utime = json_as_integer(&utime, 0, UTIME_MAX);
        if (used->vehicles[i].utime > used->newest) {
            used->newest = used->vehicles[i].utime;
        }
        vehicle_node = vehicle_node->next;
        utime_node = utime_node->next;
    }
    return line->file->error[0] == '\0';
}

/// The states arrive in the order in which they were sent, so a cycle uses a prefix of the waiting
/// ones: at least up to the last one that a plan names, and at most up to the first one that a plan
/// excludes. Between these two are only states of vehicles without a plan.
typedef struct prefix {
    uint32_t least, most; ///< states
    uint32_t likely;      ///< all of the ticks that some plan used
} prefix;

static prefix prefix_of(const bus_run* self, const used_states* used)
{
    prefix found = { .most = self->waiting_count };
    for (uint32_t i = 0; i < self->waiting_count; ++i) {
        const verge_vehicle_state_t* state = &self->waiting[i];
        uint32_t k = 0;
        while (k < used->count && used->vehicles[k].id != state->vehicle_id) {
            ++k;
        }
        if (k < used->count && state->utime <= used->vehicles[k].utime) {
            found.least = i + 1;
        } else if (k < used->count && i < found.most) {
            found.most = i;
        }
        found.likely += state->utime <= used->newest ? 1 : 0;
    }
    found.most = found.most < found.least ? found.least : found.most;
    found.likely = found.likely < found.least  ? found.least
                   : found.likely > found.most ? found.most
                                               : found.likely;
    return found;
}

/// The signals of a tick, which are sent before its states.
static void offer_signals(bus_run* self, int64_t utime)
{
    static transport_message message;
    const double t = (double)(utime - self->start_utime) / 1e6;
    for (uint32_t i = 0; i < self->scene->signal_count; ++i) {
        const verge_signal signal = signal_at(&self->scene->signals[i], t);
        memset(&message, 0, sizeof message);
        message.kind = TRANSPORT_SIGNAL;
        message.arrival_utime = utime;
        message.as.signal = signal_message(&signal, utime, self->map_crc32);
        cycle_offer(&self->cycle, &message);
    }
}

static void offer(bus_run* self, uint32_t count)
{
    static transport_message message;
    for (uint32_t i = 0; i < count; ++i) {
        if (i == 0 || self->waiting[i].utime != self->waiting[i - 1].utime) {
            offer_signals(self, self->waiting[i].utime);
        }
        memset(&message, 0, sizeof message);
        message.kind = TRANSPORT_STATE;
        message.arrival_utime = self->waiting[i].utime;
        message.as.state = self->waiting[i];
        cycle_offer(&self->cycle, &message);
    }
}

static void forget_offered(bus_run* self, uint32_t count)
{
    self->waiting_count -= count;
    memmove(self->waiting, self->waiting + count,
            self->waiting_count * sizeof self->waiting[0]);
}

/// Plans the cycle with this many states; whether it has the digest.
static bool plan_with(bus_run* self, uint32_t count, int32_t number, int64_t utime, uint64_t digest)
{
    self->cycle = *self->cycle_before;
    memcpy(self->memory, self->memory_before, self->memory_size);
    offer(self, count);
    cycle_run(&self->cycle, number, utime);
    return self->cycle.plan.digest == digest;
}

/// Tries the likely number of states first, then every other possible one. If none has the digest,
/// the result is that of the likely number.
static bool plan_again(bus_run* self, const used_states* used, int32_t number, int64_t utime,
                       uint64_t digest)
{
    const prefix of = prefix_of(self, used);
    uint32_t     count = of.likely;
    *self->cycle_before = self->cycle;
    memcpy(self->memory_before, self->memory, self->memory_size);
    bool same = plan_with(self, count, number, utime, digest);
    for (uint32_t other = of.least; !same && other <= of.most; ++other) {
        same = other != of.likely && plan_with(self, other, number, utime, digest);
        count = same ? other : count;
    }
    if (!same && of.most > of.least) {
        plan_with(self, of.likely, number, utime, digest);
    }
    forget_offered(self, count);
    return same;
}

/// A cycle number that starts again means that the roadside unit was restarted.
static void start_again(bus_run* self)
{
    const cycle_def def = self->cycle.def;
    verge_planner_reset(def.planner);
    cycle_init(&self->cycle, &def);
}

bool bus_run_plan(bus_run* self, const json_at* line, uint64_t digest)
{
    const json_at number_at = json_member(line, "cycle");
    if (!json_given(&number_at) || self->ended) {
        return true; // sent because a cycle was late, so not a cycle of its own
    }
    used_states   used;
    const int32_t number = (int32_t)json_as_integer(&number_at, 0, INT32_MAX);
    const int64_t end = json_integer(line, "valid_until_utime", 0, UTIME_MAX);
    if (!used_read(line, &used) || line->file->error[0] != '\0') {
        return false;
    }
    if (number <= self->last_number) {
        start_again(self);
    } else if (self->last_number >= 0 && number > self->last_number + 1) {
        self->gap_number = self->gap_number >= 0 ? self->gap_number : self->last_number + 1;
    }
    self->last_number = number;
    if (plan_again(self, &used, number, end - self->horizon_us, digest)) {
        ++self->compared;
        return true;
    }
    self->ended = true;
    self->differs = self->gap_number < 0; // else it is not known what was planned in the gap
    self->differs_number = number;
    self->recorded = digest;
    self->replayed = self->cycle.plan.digest;
    return true;
}
