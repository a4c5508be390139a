#include "cycle.h"

#include "overrun.h"

#include "verge/wire.h"

#include <assert.h>
#include <string.h>

void cycle_init(cycle* self, const cycle_def* def)
{
    memset(self, 0, sizeof *self);
    self->number = -1;
    self->utime = INT64_MIN;
    self->def = *def;
    inbox_init(&self->inbox, &def->limits, def->vehicles_max, def->controlled_max);
    inbox_set_map(&self->inbox, def->map_crc32);
    self->planner_counters = verge_planner_counters(def->planner);
}

void cycle_swap(cycle* self, const cycle_def* def)
{
    const bool smaller = def->vehicles_max < self->def.vehicles_max;
    self->def = *def;
    if (smaller) { // more slots may be in use than there are now
        inbox_forget(&self->inbox, def->vehicles_max, def->controlled_max);
    }
    inbox_set_limits(&self->inbox, &def->limits);
    inbox_set_map(&self->inbox, def->map_crc32);
    self->inbox.vehicles_max = def->vehicles_max;
    self->inbox.controlled_max = def->controlled_max;
    inbox_review(&self->inbox, verge_planner_road(def->planner));
    self->planner_counters = verge_planner_counters(def->planner);
}

bool cycle_offer(cycle* self, const transport_message* message)
{
    const verge_road* road = verge_planner_road(self->def.planner);
    if (message->kind == TRANSPORT_SIGNAL) {
        return inbox_offer_signal(&self->inbox, &message->as.signal, message->arrival_utime, road)
               == INBOX_ACCEPTED;
    }
    if (message->kind != TRANSPORT_STATE) {
        return false;
    }
    const inbox_source source = { .sender = message->sender, .bus = message->bus };
    return inbox_offer_from(&self->inbox, &message->as.state, source, message->arrival_utime,
                            road) == INBOX_ACCEPTED;
}

void cycle_run(cycle* self, int64_t number, int64_t utime)
{
    cycle_begin(self, number, utime);
    cycle_plan(self);
    cycle_end(self);
}

// ---- begin --------------------------------------------------------------------------------

static void start_afresh(cycle* self);
static void report_placed(cycle* self);
static void remove_vehicle(inbox_view* view, uint32_t index);

void cycle_begin(cycle* self, int64_t number, int64_t utime)
{
    if (utime <= self->utime) {
        start_afresh(self);
    }
    report_placed(self);
    self->number = number;
    self->utime = utime;
    inbox_snapshot(&self->inbox, utime, &self->view);
    self->signal_count = inbox_signals(&self->inbox, utime, self->signals);
    if (self->view.count == 0) { // later plans do not depend on anything before
        verge_planner_reset(self->def.planner);
    }
    // The planner refuses a whole step because of one unusable vehicle. The inbox accepts none;
    // this check protects the others in case extrapolation has made a vehicle unusable.
    for (uint32_t i = self->view.count; i-- > 0;) {
        verge_vehicle_fault fault;
        if (!verge_vehicle_check(&self->view.vehicles[i], &fault)) {
            self->counters.unusable++;
            self->fault = fault;
            remove_vehicle(&self->view, i);
        }
    }
}

/// The clock has stepped back: the last plan and all states are in the future now. Vehicles send
/// new states within a tenth of a second.
static void start_afresh(cycle* self)
{
    verge_planner_reset(self->def.planner);
    inbox_forget(&self->inbox, self->def.vehicles_max, self->def.controlled_max);
}

/// Reports to the inbox which vehicles the last cycle found on a lane. This happens here and not at
/// the end of that cycle: a recording holds the states in their order among the beginnings of
/// cycles, and a replay has to judge each state alike.
static void report_placed(cycle* self)
{
    const verge_scene* scene = verge_planner_scene(self->def.planner);
    const bool         stepped = self->view.controlled_count > 0 && self->status == VERGE_OK;
    int32_t            ids[VERGE_VEHICLES_MAX];
    uint32_t           count = 0;
    for (uint32_t i = 0; stepped && i < scene->vehicle_count; i++) {
        if (scene->positions[i].lane_id != VERGE_NO_LANE) {
            ids[count++] = scene->vehicles[i].id;
        }
    }
    inbox_placed(&self->inbox, ids, count);
}

/// Removes one vehicle and keeps the order of the others.
static void remove_vehicle(inbox_view* view, uint32_t index)
{
    view->controlled_count -= view->vehicles[index].controlled ? 1 : 0;
    view->count--;
    const uint32_t behind = view->count - index;
    memmove(&view->vehicles[index], &view->vehicles[index + 1],
            behind * sizeof view->vehicles[0]);
    memmove(&view->state_utime[index], &view->state_utime[index + 1],
            behind * sizeof view->state_utime[0]);
}

// ---- plan ---------------------------------------------------------------------------------

void cycle_plan(cycle* self)
{
    self->status = VERGE_OK;
    if (self->view.controlled_count > 0) {
        self->status = verge_planner_set_signals(self->def.planner, self->utime, self->signals,
                                                 self->signal_count);
    }
    if (self->view.controlled_count > 0 && self->status == VERGE_OK) {
        self->status = verge_planner_step(self->def.planner, self->utime, self->view.vehicles,
                                          self->view.count, &self->plan);
    }
    if (self->view.controlled_count == 0 || self->status != VERGE_OK) {
        memset(&self->plan, 0, sizeof self->plan);
        self->plan.utime = self->utime;
    }
}

// ---- end ----------------------------------------------------------------------------------

static void count_planner(cycle* self);
static void make_cancellations(cycle* self);
static void make_plans(cycle* self);
static void finish_messages(cycle* self, int64_t number);
static void count_messages(cycle* self);
static void keep_valid(cycle* self);

void cycle_end(cycle* self)
{
    count_planner(self);
    self->counters.planned += self->view.controlled_count > 0 ? 1 : 0;
    self->counters.refused += self->status != VERGE_OK ? 1 : 0;
    self->message_count = 0;
    make_cancellations(self);
    make_plans(self);
    finish_messages(self, self->number);
    keep_valid(self);
}

/// Adds what the step added to the planner's counters, which begin at 0 again with each planner.
static void count_planner(cycle* self)
{
    const verge_counters before = self->planner_counters;
    const verge_counters now = verge_planner_counters(self->def.planner);
    self->counters.unexpanded += now.unexpanded - before.unexpanded;
    self->counters.candidates += now.candidates - before.candidates;
    self->counters.reordered += now.reordered - before.reordered;
    self->counters.unstuck += now.unstuck - before.unstuck;
    self->planner_counters = now;
}

/// The index of a vehicle in the view; view.count when it is not there.
static uint32_t index_of(const cycle* self, int32_t vehicle_id)
{
    uint32_t i = 0;
    while (i < self->view.count && self->view.vehicles[i].id != vehicle_id) {
        i++;
    }
    return i;
}

static int32_t number_on_wire(int64_t number)
{
    return (int32_t)(number & INT32_MAX); // wraps after 34 years at 2 Hz
}

/// finish_messages() adds the number of messages.
static wire_plan_header header_of(const cycle* self, int64_t utime, int64_t state_utime)
{
    const wire_plan_header header = {
        .utime = utime,
        .valid_until_utime = utime,
        .state_utime = state_utime,
        .rsu_id = self->def.rsu_id,
        .cycle = number_on_wire(self->number),
        .map_crc32 = self->def.map_crc32,
    };
    return header;
}

static void cancel(cycle* self, int32_t vehicle_id, int64_t utime, int64_t state_utime,
                   verge_reason reason)
{
    assert(self->message_count < CYCLE_MESSAGES_MAX);
    const wire_plan_header header = header_of(self, utime, state_utime);
    self->messages[self->message_count++] = wire_plan_cancelled(&header, vehicle_id, reason);
    self->counters.cancelled++;
}

/// Once for each vehicle that had a plan and is not controlled any more: its states are missing or
/// too old, it does not request plans any more, or there are more vehicles than the planner holds.
/// If the planner refused the cycle, the last plans stay valid.
static void make_cancellations(cycle* self)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->valid_count; i++) {
        const int32_t  id = self->valid_plans[i].vehicle_id;
        const uint32_t index = index_of(self, id);
        const bool     seen = index < self->view.count;
        if (seen && self->view.vehicles[index].controlled) {
            self->valid_plans[kept++] = self->valid_plans[i];
            continue;
        }
        const int64_t state_utime = seen ? self->view.state_utime[index] : 0;
        const double  age_ms = (double)(self->utime - state_utime) / 1000.0;
        cancel(self, id, self->utime, state_utime,
               age_ms > self->def.limits.fresh_ms ? VERGE_REASON_STALE : VERGE_REASON_NONE);
    }
    self->valid_count = kept;
}

/// Tells the receivers of the plans what they were made from.
static uint32_t scene_sum(const cycle* self)
{
    const verge_scene* scene = verge_planner_scene(self->def.planner);
    uint32_t sum = 0;
    for (uint32_t i = 0; i < self->view.count && i < scene->vehicle_count; i++) {
        const int32_t id = self->view.vehicles[i].id;
        assert(id == scene->vehicles[i].id); // both in the order of ids
        sum += wire_scene_hash(id, self->view.state_utime[i])
               + wire_scene_hash(id, scene->positions[i].lane_id);
    }
    return sum;
}

static void make_plans(cycle* self)
{
    if (self->status != VERGE_OK) {
        return;
    }
    const uint32_t sum = self->plan.vehicle_count > 0 ? scene_sum(self) : 0;
    for (uint32_t i = 0; i < self->plan.vehicle_count; i++) {
        const verge_vehicle_plan* plan = &self->plan.vehicles[i];
        const uint32_t index = index_of(self, plan->vehicle_id);
        assert(index < self->view.count && self->message_count < CYCLE_MESSAGES_MAX);
        wire_plan_header header = header_of(self, self->utime, self->view.state_utime[index]);
        header.digest = self->plan.digest;
        header.scene_sum = sum;
        verge_vehicle_plan_t* message = &self->messages[self->message_count++];
        *message = wire_plan_from_vehicle_plan(&header, plan);
        // A plan is valid until its last point. A vehicle without a newer plan then decides for
        // itself.
        message->valid_until_utime =
            self->utime + (int64_t)(message->point_count - 1) * message->dt_ms * 1000;
        self->counters.plans++;
        self->counters.fallbacks += plan->status != VERGE_PLANNED ? 1 : 0;
    }
}

/// The messages are the valid plans from now on, except cancellations. If the planner refused the
/// cycle, the last plans stay valid.
static void keep_valid(cycle* self)
{
    if (self->status != VERGE_OK) {
        return;
    }
    self->valid_count = 0;
    for (uint32_t i = 0; i < self->message_count; i++) {
        if (self->messages[i].status != VERGE_CANCELLED) {
            self->valid_plans[self->valid_count++] = self->messages[i];
        }
    }
}

void cycle_cancel_all(cycle* self, int64_t number, int64_t utime)
{
    self->message_count = 0;
    for (uint32_t i = 0; i < self->valid_count; i++) {
        cancel(self, self->valid_plans[i].vehicle_id, utime, 0, VERGE_REASON_NONE);
    }
    self->valid_count = 0;
    finish_messages(self, number);
}

/// Orders the messages by vehicle id and gives each the cycle's number and their count.
static void finish_messages(cycle* self, int64_t number)
{
    for (uint32_t i = 1; i < self->message_count; i++) {
        const verge_vehicle_plan_t message = self->messages[i];
        uint32_t j = i;
        for (; j > 0 && self->messages[j - 1].vehicle_id > message.vehicle_id; j--) {
            self->messages[j] = self->messages[j - 1];
        }
        self->messages[j] = message;
    }
    for (uint32_t i = 0; i < self->message_count; i++) {
        self->messages[i].cycle = number_on_wire(number);
    }
    count_messages(self);
}

static void count_messages(cycle* self)
{
    for (uint32_t i = 0; i < self->message_count; i++) {
        self->messages[i].plans_in_cycle = (int32_t)self->message_count;
    }
}

// ---- overrun ------------------------------------------------------------------------------

static bool overrun_message(cycle* self, int32_t vehicle_id, int64_t utime,
                            verge_vehicle_plan_t* message);

void cycle_overrun(cycle* self, int64_t utime)
{
    self->message_count = 0;
    for (uint32_t i = 0; i < self->view.count; i++) {
        verge_vehicle_plan_t* message = &self->messages[self->message_count];
        const verge_vehicle*  vehicle = &self->view.vehicles[i];
        if (vehicle->controlled && overrun_message(self, vehicle->id, utime, message)) {
            message->reason = VERGE_REASON_OVERRUN;
            self->message_count++;
            self->counters.plans++;
            self->counters.overruns++;
            self->counters.fallbacks += message->status != VERGE_PLANNED ? 1 : 0;
        }
    }
    count_messages(self);
}

/// False: its plan is over and its states are missing. When the cycle ends, its plan is cancelled.
static bool overrun_message(cycle* self, int32_t vehicle_id, int64_t utime,
                            verge_vehicle_plan_t* message)
{
    uint32_t at = 0;
    while (at < self->valid_count && self->valid_plans[at].vehicle_id != vehicle_id) {
        at++;
    }
    if (at < self->valid_count && wire_plan_rest(&self->valid_plans[at], utime, message)) {
        return true;
    }
    verge_vehicle now;
    wire_plan_header header = header_of(self, utime, 0);
    if (!inbox_latest(&self->inbox, vehicle_id, utime, &now, &header.state_utime) ||
        at == VERGE_CONTROLLED_MAX) {
        return false;
    }
    *message = overrun_brake(&header, &now, verge_planner_road(self->def.planner));
    self->valid_plans[at] = *message; // what is sent at the next overrun, or cancelled
    self->valid_count += at == self->valid_count ? 1 : 0;
    return true;
}

void cycle_withhold(cycle* self, uint32_t index)
{
    const verge_vehicle_plan_t* message = &self->messages[index];
    assert(index < self->message_count);
    self->counters.withheld++;
    if (message->status == VERGE_CANCELLED) {
        self->counters.cancelled--;
        return;
    }
    self->counters.plans--;
    self->counters.overruns -= message->reason == VERGE_REASON_OVERRUN ? 1 : 0;
    self->counters.fallbacks -= message->status != VERGE_PLANNED ? 1 : 0;
}

void cycle_retime(cycle* self, int64_t utime)
{
    for (uint32_t i = 0; i < self->message_count; i++) {
        verge_vehicle_plan_t rest;
        if (wire_plan_rest(&self->messages[i], utime, &rest)) {
            self->messages[i] = rest;
        }
    }
}
