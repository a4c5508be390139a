#include "verge/inbox.h"

#include "verge/limits.h"

#include "base/scalar.h" // core's sine and cosine: a replay gives the same bits on every machine

#include <assert.h>
#include <math.h>
#include <string.h>

static inbox_slot*   slot_of(inbox* self, int32_t id);
static inbox_slot*   slot_free(inbox* self, int64_t now_utime);
static inbox_verdict state_judge(inbox* self, const inbox_slot* slot,
                                 const verge_vehicle_state_t* state, inbox_source source,
                                 int64_t now_utime, const verge_road* road);
static bool          id_taken(const inbox* self, const inbox_slot* slot, inbox_source source,
                              int64_t now_utime);
static inbox_verdict successor_judge(const inbox* self, const verge_vehicle_state_t* held,
                                     const verge_vehicle_state_t* state);
static bool          has_lane(const verge_road* road, int32_t lane);
static void          slot_store(inbox* self, inbox_slot* slot, const verge_vehicle_state_t* state,
                                const verge_road* road);
static float         lane_heading(const verge_road* road, const verge_vehicle_state_t* state);
static bool          is_other_map(const inbox* self, int32_t map_crc32);
static bool          is_known_version(int16_t version);
static bool          on_map(const verge_road* road, const verge_vehicle_state_t* state);
static void          verdict_count(inbox_counters* counters, inbox_verdict verdict);
static void          slots_order(inbox* self);
static uint32_t      controlled_choose(const inbox* self, int64_t plan_utime,
                                       bool chosen[VERGE_VEHICLES_MAX]);
static bool          wants_plan(const inbox* self, const inbox_slot* slot, int64_t plan_utime);
static inbox_verdict age_judge(const inbox* self, int64_t utime, int64_t now_utime);
static double        age_ms(int64_t utime, int64_t at_utime);

static const inbox_param params[] = {
    { "fresh_ms", "ms", offsetof(inbox_limits, fresh_ms), 10.0, 5000.0,
      "Up to this age a state is used, projected to the plan's instant, and its vehicle planned." },
    { "obstacle_ms", "ms", offsetof(inbox_limits, obstacle_ms), 10.0, 10000.0,
      "Up to this age its vehicle is an obstacle with obstacle_margin_m and gets no new plan." },
    { "drop_ms", "ms", offsetof(inbox_limits, drop_ms), 10.0, 60000.0,
      "Up to this age its vehicle is an obstacle with old_margin_m; beyond, it is forgotten." },
    { "future_ms", "ms", offsetof(inbox_limits, future_ms), 0.0, 5000.0,
      "A state further ahead of the unit's clock than this is refused." },
    { "obstacle_margin_m", "m", offsetof(inbox_limits, obstacle_margin_m), 0.0, 5.0,
      "Added to every side of a body whose state is older than fresh_ms." },
    { "old_margin_m", "m", offsetof(inbox_limits, old_margin_m), 0.0, 5.0,
      "Added to every side of a body whose state is older than obstacle_ms." },
    { "jump_m", "m", offsetof(inbox_limits, jump_m), 1.0, 1000.0,
      "A state further than this from where the vehicle can have driven is refused." },
};
enum { PARAM_COUNT = sizeof params / sizeof params[0] };

/// Ages: 40 ms and 2 s are what receivers of cooperative-awareness messages use, 300 ms is three
/// missed messages at 10 Hz. Margins: half a metre and a metre are the errors of the position after
/// one second if the acceleration changes by 1 and 2 m/s^2.
inbox_limits inbox_default_limits(void)
{
    return (inbox_limits){
        .fresh_ms = 300.0,
        .obstacle_ms = 1000.0,
        .drop_ms = 2000.0,
        .future_ms = 40.0,
        .obstacle_margin_m = 0.5,
        .old_margin_m = 1.0,
        .jump_m = 10.0,
    };
}

const inbox_param* inbox_params(uint32_t* count)
{
    *count = PARAM_COUNT;
    return params;
}

const char* inbox_limits_check(const inbox_limits* limits)
{
    for (uint32_t i = 0; i < PARAM_COUNT; ++i) {
        const double* value = (const double*)((const char*)limits + params[i].offset);
        if (!(*value >= params[i].min && *value <= params[i].max)) {
            return params[i].name;
        }
    }
    if (limits->obstacle_ms < limits->fresh_ms) {
        return "obstacle_ms";
    }
    if (limits->drop_ms < limits->obstacle_ms) {
        return "drop_ms";
    }
    return limits->old_margin_m < limits->obstacle_margin_m ? "old_margin_m" : NULL;
}

void inbox_init(inbox* self, const inbox_limits* limits, uint32_t vehicles_max,
                uint32_t controlled_max)
{
    assert(controlled_max >= 1 && controlled_max <= vehicles_max);
    assert(vehicles_max <= VERGE_VEHICLES_MAX);

    *self = (inbox){ .vehicles_max = vehicles_max, .controlled_max = controlled_max };
    inbox_set_limits(self, limits);
}

void inbox_set_limits(inbox* self, const inbox_limits* limits)
{
    assert(inbox_limits_check(limits) == NULL);
    self->limits = *limits;
}

inbox_verdict inbox_offer(inbox* self, const verge_vehicle_state_t* state, int64_t now_utime,
                          const verge_road* road)
{
    return inbox_offer_from(self, state, (inbox_source){ 0 }, now_utime, road);
}

void inbox_set_map(inbox* self, uint32_t map_crc32)
{
    self->map_crc32 = map_crc32;
}

/// The crc32 is that of a message; 0: not stated.
static bool is_other_map(const inbox* self, int32_t map_crc32)
{
    return self->map_crc32 != 0 && map_crc32 != 0 && (uint32_t)map_crc32 != self->map_crc32;
}

inbox_verdict inbox_offer_from(inbox* self, const verge_vehicle_state_t* state,
                               inbox_source source, int64_t now_utime, const verge_road* road)
{
    assert(source.bus < INBOX_BUSES_MAX);
    inbox_slot*   slot = slot_of(self, state->vehicle_id);
    verge_vehicle_state_t without_target;
    if (state->target_lane != VERGE_NO_LANE && is_other_map(self, state->map_crc32)) {
        ++self->counters.rx_other_map;
        without_target = *state;
        without_target.target_lane = VERGE_NO_LANE;
        state = &without_target;
    }
    inbox_verdict verdict = state_judge(self, slot, state, source, now_utime, road);
    if (verdict == INBOX_ACCEPTED && slot == NULL) {
        slot = slot_free(self, now_utime);
        if (slot == NULL) {
            verdict = INBOX_OVER_CAPACITY;
        } else {
            *slot = (inbox_slot){ .used = true };
        }
    }
    if (verdict == INBOX_ACCEPTED) {
        slot_store(self, slot, state, road);
    }
    if ((verdict == INBOX_ACCEPTED || verdict == INBOX_DUPLICATE) && source.sender != 0) {
        slot->owners[source.bus].sender = source.sender;
        slot->owners[source.bus].utime = state->utime;
    }
    verdict_count(&self->counters, verdict);
    return verdict;
}

void inbox_placed(inbox* self, const int32_t* ids, uint32_t count)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        inbox_slot* slot = &self->slots[i];
        slot->placed = false;
        for (uint32_t k = 0; k < count && !slot->placed; ++k) {
            slot->placed = slot->used && slot->state.vehicle_id == ids[k];
        }
    }
}

int64_t inbox_held_utime(const inbox* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        if (self->slots[i].used && self->slots[i].state.vehicle_id == vehicle_id) {
            return self->slots[i].state.utime;
        }
    }
    return 0;
}

bool inbox_farthest(const inbox* self, double x, double y, int32_t* vehicle_id, double* distance)
{
    double most = -1.0;
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        const verge_vehicle_state_t* state = &self->slots[i].state;
        if (!self->slots[i].used) {
            return false;
        }
        const double dx = state->x - x, dy = state->y - y;
        if (dx * dx + dy * dy > most) {
            most = dx * dx + dy * dy;
            *vehicle_id = state->vehicle_id;
        }
    }
    *distance = sqrt(most);
    return true;
}

void inbox_forget_vehicle(inbox* self, int32_t vehicle_id)
{
    inbox_slot* slot = slot_of(self, vehicle_id);
    if (slot != NULL) {
        *slot = (inbox_slot){ .used = false };
    }
}

void inbox_forget_senders(inbox* self)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        memset(self->slots[i].owners, 0, sizeof self->slots[i].owners);
    }
}

void inbox_review(inbox* self, const verge_road* road)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        inbox_slot* slot = &self->slots[i];
        slot->placed = false;
        if (slot->used && !on_map(road, &slot->state)) {
            slot->state.utime = 1; // forgotten by age: the next snapshot cancels and drops it
        } else if (slot->used && !has_lane(road, slot->state.target_lane)) {
            slot->state.target_lane = VERGE_NO_LANE;
        }
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->signal_count; ++i) {
        if (has_lane(road, self->signals[i].lane)) {
            self->signals[kept++] = self->signals[i];
        }
    }
    self->signal_count = kept;
}

void inbox_forget(inbox* self, uint32_t vehicles_max, uint32_t controlled_max)
{
    assert(controlled_max >= 1 && controlled_max <= vehicles_max);
    memset(self->slots, 0, sizeof self->slots);
    self->vehicles_max = vehicles_max;
    self->controlled_max = controlled_max;
    for (uint32_t i = 0; i < self->signal_count; ++i) { // older than any message
        self->signals[i].utime = 1;
        self->signals[i].change_utime = 0;
    }
}

// ---- signals ------------------------------------------------------------------------------

static inbox_verdict signal_judge(inbox* self, const verge_lane_signal_t* signal,
                                  int64_t now_utime, const verge_road* road)
{
    if (!is_known_version(signal->protocol_version)) {
        self->fault_version = signal->protocol_version;
        return INBOX_VERSION;
    }
    if (is_other_map(self, signal->map_crc32)) {
        return INBOX_OTHER_MAP;
    }
    const char* fault = wire_signal_check(signal);
    if (fault == NULL && !has_lane(road, signal->lane)) {
        fault = "lane";
    }
    if (fault != NULL) {
        self->fault_field = fault;
        return INBOX_OUT_OF_RANGE;
    }
    return age_judge(self, signal->utime, now_utime);
}

static inbox_verdict signal_store(inbox* self, const verge_lane_signal_t* signal)
{
    uint32_t at = 0;
    while (at < self->signal_count && self->signals[at].lane < signal->lane) {
        ++at;
    }
    verge_lane_signal_t* held = &self->signals[at];
    if (at < self->signal_count && held->lane == signal->lane) {
        if (signal->utime < held->utime) {
            return INBOX_OUT_OF_ORDER;
        }
    } else if (self->signal_count == INBOX_SIGNALS_MAX) {
        return INBOX_OVER_CAPACITY;
    } else {
        memmove(held + 1, held, (self->signal_count - at) * sizeof *held);
        ++self->signal_count;
    }
    *held = *signal;
    return INBOX_ACCEPTED;
}

inbox_verdict inbox_offer_signal(inbox* self, const verge_lane_signal_t* signal, int64_t now_utime,
                                 const verge_road* road)
{
    inbox_verdict verdict = signal_judge(self, signal, now_utime, road);
    if (verdict == INBOX_ACCEPTED) {
        verdict = signal_store(self, signal);
    }
    if (verdict != INBOX_ACCEPTED) { // rx_accepted counts states
        verdict_count(&self->counters, verdict);
    }
    return verdict;
}

uint32_t inbox_signals(const inbox* self, int64_t utime, verge_signal signals[INBOX_SIGNALS_MAX])
{
    for (uint32_t i = 0; i < self->signal_count; ++i) {
        const verge_lane_signal_t* held = &self->signals[i];
        const bool   timed = held->change_utime != 0;
        const double age = age_ms(held->utime, utime);
        const double change = (double)(held->change_utime - utime) / 1e6;
        const bool   unknown = timed ? change < 0.0 : age > self->limits.drop_ms;
        signals[i] = (verge_signal){
            .lane_id = held->lane,
            .state = unknown && held->state != VERGE_SIGNAL_OFF ? VERGE_SIGNAL_RED
                                                                : (verge_signal_state)held->state,
            .change_s = timed && !unknown ? vg_min(change, 86400.0) : -1.0,
        };
    }
    return self->signal_count;
}

const char* inbox_verdict_name(inbox_verdict verdict)
{
    switch (verdict) {
    case INBOX_ACCEPTED: return "accepted";
    case INBOX_VERSION: return "version";
    case INBOX_OTHER_MAP: return "other_map";
    case INBOX_OUT_OF_RANGE: return "out_of_range";
    case INBOX_FUTURE: return "future";
    case INBOX_STALE: return "stale";
    case INBOX_DUPLICATE: return "duplicate";
    case INBOX_OUT_OF_ORDER: return "out_of_order";
    case INBOX_ID_TAKEN:
    case INBOX_ID_CONFLICT: return "id_conflict";
    case INBOX_OFF_MAP: return "off_map";
    case INBOX_OVER_CAPACITY: return "over_capacity";
    }
    return "unknown";
}

void inbox_snapshot(inbox* self, int64_t plan_utime, inbox_view* view)
{
    bool chosen[VERGE_VEHICLES_MAX] = { false };
    slots_order(self);
    self->counters.rx_over_capacity += controlled_choose(self, plan_utime, chosen);

    view->count = view->controlled_count = view->cancelled_count = 0;
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        inbox_slot* slot = &self->slots[i];
        if (!slot->used) {
            continue;
        }
        if (slot->planned && !chosen[i]) {
            view->cancelled[view->cancelled_count++] = slot->state.vehicle_id;
        }
        slot->planned = chosen[i];

        const double age = age_ms(slot->state.utime, plan_utime);
        if (age > self->limits.drop_ms) {
            slot->used = false;
            continue;
        }
        verge_vehicle vehicle = wire_vehicle_from_state(&slot->state);
        inbox_project(&vehicle, age / 1000.0);
        // The planner refuses a whole step for one vehicle beyond the range of the wire.
        vehicle.x = vg_clamp(vehicle.x, -VERGE_LIMIT_POSITION, VERGE_LIMIT_POSITION);
        vehicle.y = vg_clamp(vehicle.y, -VERGE_LIMIT_POSITION, VERGE_LIMIT_POSITION);
        vehicle.controlled = chosen[i];
        vehicle.margin = age <= self->limits.fresh_ms      ? 0.0
                         : age <= self->limits.obstacle_ms ? self->limits.obstacle_margin_m
                                                           : self->limits.old_margin_m;
        view->vehicles[view->count] = vehicle;
        view->state_utime[view->count] = slot->state.utime;
        ++view->count;
        view->controlled_count += chosen[i] ? 1 : 0;
    }
}

bool inbox_latest(const inbox* self, int32_t id, int64_t utime, verge_vehicle* vehicle,
                  int64_t* state_utime)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        const inbox_slot* slot = &self->slots[i];
        const double      age = slot->used ? age_ms(slot->state.utime, utime) : 0.0;
        if (slot->used && slot->state.vehicle_id == id && age <= self->limits.fresh_ms) {
            *vehicle = wire_vehicle_from_state(&slot->state);
            *state_utime = slot->state.utime;
            inbox_project(vehicle, age / 1000.0);
            return true;
        }
    }
    return false;
}

/// Yaw rate over speed; 0 if it is unknown, at standstill and backwards. At most that of the centre
/// of a car in its tightest turn: noise does not turn a vehicle that hardly moves. [1/m]
static double curvature_of(const verge_vehicle* vehicle)
{
    static const double most = 0.5;
    return vg_finite(vehicle->yaw_rate) && vehicle->speed > 0.0
               ? vg_max(-most, vg_min(vehicle->yaw_rate / vehicle->speed, most))
               : 0.0;
}

static double rear_axle_of(const verge_vehicle* vehicle)
{
    const verge_body* given = &vehicle->body;
    return given->length > 0.0 ? given->rear_axle
                               : verge_body_by_size(vehicle->length, vehicle->width).rear_axle;
}

/// The rear axle moves along the heading, on an arc; its chord points along the middle heading. The
/// chord's length is taken as the arc's: for a turn of 0.5 rad the difference is 1 %. The centre,
/// ahead of the axle, moves farther: a part of its distance is across the heading.
void inbox_project(verge_vehicle* vehicle, double dt)
{
    const double speed = vehicle->speed;
    const double acceleration = vehicle->acceleration;
    double       moving = dt;
    double       speed_end = speed + acceleration * dt;
    double       acceleration_end = acceleration;
    const bool   turned = speed < 0.0 ? speed_end > 0.0 : speed_end < 0.0;
    if (turned) { // it stood still for a part of the time; acceleration is not zero
        moving = -speed / acceleration;
        speed_end = 0.0;
        acceleration_end = 0.0;
    } else if (speed_end < vg_min(speed, VERGE_LIMIT_SPEED_MIN)) { // no vehicle is that fast
        speed_end = vg_min(speed, VERGE_LIMIT_SPEED_MIN);
        acceleration_end = 0.0;
    } else if (speed_end > vg_max(speed, VERGE_SPEED_MAX)) { // no vehicle is that fast
        speed_end = vg_max(speed, VERGE_SPEED_MAX);
        acceleration_end = 0.0;
    }
    const double distance = 0.5 * (speed + speed_end) * moving;
    const double curvature = curvature_of(vehicle);
    const double rear_axle = rear_axle_of(vehicle);
    const double across = vg_max(-0.9, vg_min(rear_axle * curvature, 0.9)); // share of the distance
    const double along = distance * vg_sqrt(1.0 - across * across);
    const double turn = curvature * distance;
    const double now = vehicle->heading, middle = now + 0.5 * turn, then = now + turn;

    vehicle->x += along * vg_cos(middle) + rear_axle * (vg_cos(then) - vg_cos(now));
    vehicle->y += along * vg_sin(middle) + rear_axle * (vg_sin(then) - vg_sin(now));
    vehicle->heading = vg_wrap_angle(then);
    vehicle->speed = speed_end;
    vehicle->acceleration = acceleration_end;
}

static int32_t capped(uint64_t count)
{
    return count < INT32_MAX ? (int32_t)count : INT32_MAX;
}

void inbox_fill_status(const inbox* self, const transport_stats* bus, verge_rsu_status_t* status)
{
    const inbox_counters* counters = &self->counters;
    status->rx_accepted = capped(counters->rx_accepted);
    status->rx_stale = capped(counters->rx_stale);
    status->rx_future = capped(counters->rx_future);
    status->rx_duplicate = capped(counters->rx_duplicate);
    status->rx_out_of_order = capped(counters->rx_out_of_order);
    status->rx_malformed =
        capped(counters->rx_malformed + bus->malformed + transport_refused(bus));
    status->rx_out_of_range = capped(counters->rx_out_of_range);
    status->rx_off_map = capped(counters->rx_off_map);
    status->rx_over_capacity = capped(counters->rx_over_capacity);
    status->rx_id_conflict = capped(counters->rx_id_conflict);
    status->rx_dropped = capped(counters->rx_dropped + bus->dropped);
    status->rx_version = capped(counters->rx_version);
    status->rx_other_map = capped(counters->rx_other_map);
}

static inbox_slot* slot_of(inbox* self, int32_t id)
{
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        if (self->slots[i].used && self->slots[i].state.vehicle_id == id) {
            return &self->slots[i];
        }
    }
    return NULL;
}

/// An unused slot, or else the first one whose state is too old to be used again. A slot with a
/// pending cancellation is kept until the next snapshot.
static inbox_slot* slot_free(inbox* self, int64_t now_utime)
{
    inbox_slot* forgotten = NULL;
    for (uint32_t i = 0; i < self->vehicles_max; ++i) {
        inbox_slot* slot = &self->slots[i];
        if (!slot->used) {
            return slot;
        }
        if (forgotten == NULL && !slot->planned &&
            age_ms(slot->state.utime, now_utime) > self->limits.drop_ms) {
            forgotten = slot;
        }
    }
    return forgotten;
}

/// 0: the sender does not state it.
static bool is_known_version(int16_t version)
{
    return version == 0 || version == WIRE_PROTOCOL_VERSION;
}

/// All rules except the capacity.
static inbox_verdict state_judge(inbox* self, const inbox_slot* slot,
                                 const verge_vehicle_state_t* state, inbox_source source,
                                 int64_t now_utime, const verge_road* road)
{
    // First: what the other fields mean is not known either.
    if (!is_known_version(state->protocol_version)) {
        self->fault_version = state->protocol_version;
        return INBOX_VERSION;
    }
    const char* fault = wire_state_check(state);
    if (fault != NULL) {
        self->fault_field = fault;
        return INBOX_OUT_OF_RANGE;
    }
    inbox_verdict verdict = age_judge(self, state->utime, now_utime);
    const bool    known = slot != NULL
                          && age_ms(slot->state.utime, now_utime) <= self->limits.drop_ms;
    if (verdict == INBOX_ACCEPTED && known) {
        verdict = id_taken(self, slot, source, now_utime)
                      ? INBOX_ID_TAKEN : successor_judge(self, &slot->state, state);
    }
    if (verdict != INBOX_ACCEPTED) {
        return verdict;
    }
    return (known && slot->placed) || on_map(road, state) ? INBOX_ACCEPTED : INBOX_OFF_MAP;
}

/// True: another sender of this bus owns the id.
static bool id_taken(const inbox* self, const inbox_slot* slot, inbox_source source,
                     int64_t now_utime)
{
    const uint64_t holder = slot->owners[source.bus].sender;
    const double   silent_ms = age_ms(slot->owners[source.bus].utime, now_utime);
    return source.sender != 0 && holder != 0 && holder != source.sender &&
           silent_ms <= self->limits.obstacle_ms;
}

/// Compares `state` with the stored state of the same id. The first sender keeps the id as long as
/// it sends; a second sender cannot take it over, and the two cannot alternate.
static inbox_verdict successor_judge(const inbox* self, const verge_vehicle_state_t* held,
                                     const verge_vehicle_state_t* state)
{
    const double dx = state->x - held->x;
    const double dy = state->y - held->y;
    if (state->utime == held->utime) {
        return dx == 0.0 && dy == 0.0 ? INBOX_DUPLICATE : INBOX_ID_CONFLICT;
    }
    if (state->utime < held->utime) {
        return INBOX_OUT_OF_ORDER;
    }
    const double dt = (double)(state->utime - held->utime) / 1e6;
    const double now = isnan(state->speed) ? 0.0 : vg_abs((double)state->speed);
    const double speed = vg_max(now, vg_abs((double)held->speed));
    const double reach = speed * dt + self->limits.jump_m;
    return dx * dx + dy * dy <= reach * reach ? INBOX_ACCEPTED : INBOX_ID_CONFLICT;
}

/// A lane continues itself, so one that does not is not on the road. True without a lane or a road.
static bool has_lane(const verge_road* road, int32_t lane)
{
    return road == NULL || lane == VERGE_NO_LANE || verge_road_continues(road, lane, lane);
}

/// Keeps a state that was accepted. What it does not say is what the vehicle said last, if it is
/// known.
static void slot_store(inbox* self, inbox_slot* slot, const verge_vehicle_state_t* state,
                       const verge_road* road)
{
    const bool  known = slot->state.utime > 0;
    const float heading = slot->state.heading;
    const float speed = slot->state.speed;
    slot->state = *state;
    slot->incomplete = isnan(state->heading) || isnan(state->speed);
    if (isnan(state->heading)) {
        slot->state.heading = known ? heading : lane_heading(road, state);
    }
    if (isnan(state->speed)) {
        slot->state.speed = known ? speed : 0.0f;
    }
    if (slot->incomplete) {
        self->counters.incomplete += 1;
        self->lacking_id = state->vehicle_id;
    }
    if (!has_lane(road, state->target_lane)) {
        slot->state.target_lane = VERGE_NO_LANE;
        self->counters.unknown_target += 1;
        self->lacking_id = state->vehicle_id;
    }
}

static float lane_heading(const verge_road* road, const verge_vehicle_state_t* state)
{
    const verge_lane_position at =
        verge_road_project(road, state->x, state->y, 0.0, VERGE_NO_LANE);
    return at.lane_id == VERGE_NO_LANE ? 0.0f : (float)at.heading;
}

static double known_heading(const verge_vehicle_state_t* state)
{
    return isnan(state->heading) ? 0.0 : vg_wrap_angle((double)state->heading);
}

static bool on_map(const verge_road* road, const verge_vehicle_state_t* state)
{
    if (road == NULL) {
        return true;
    }
    const verge_lane_position position =
        verge_road_project(road, state->x, state->y, known_heading(state), VERGE_NO_LANE);
    return position.lane_id != VERGE_NO_LANE;
}

static void verdict_count(inbox_counters* counters, inbox_verdict verdict)
{
    switch (verdict) {
    case INBOX_ACCEPTED: counters->rx_accepted += 1; break;
    case INBOX_VERSION: counters->rx_version += 1; break;
    case INBOX_OTHER_MAP: counters->rx_other_map += 1; break;
    case INBOX_OUT_OF_RANGE: counters->rx_out_of_range += 1; break;
    case INBOX_FUTURE: counters->rx_future += 1; break;
    case INBOX_STALE: counters->rx_stale += 1; break;
    case INBOX_DUPLICATE: counters->rx_duplicate += 1; break;
    case INBOX_OUT_OF_ORDER: counters->rx_out_of_order += 1; break;
    case INBOX_ID_TAKEN:
    case INBOX_ID_CONFLICT: counters->rx_id_conflict += 1; break;
    case INBOX_OFF_MAP: counters->rx_off_map += 1; break;
    case INBOX_OVER_CAPACITY: counters->rx_over_capacity += 1; break;
    }
}

/// Insertion sort by id, unused slots last: they are nearly in order from the last time.
static void slots_order(inbox* self)
{
    for (uint32_t i = 1; i < self->vehicles_max; ++i) {
        const inbox_slot slot = self->slots[i];
        uint32_t at = i;
        while (at > 0 && slot.used &&
               (!self->slots[at - 1].used ||
                self->slots[at - 1].state.vehicle_id > slot.state.vehicle_id)) {
            self->slots[at] = self->slots[at - 1];
            --at;
        }
        self->slots[at] = slot;
    }
}

/// Two passes over the ordered slots: vehicles that had a plan first, then the others. Returns the
/// number of those that there is no room for.
static uint32_t controlled_choose(const inbox* self, int64_t plan_utime,
                                  bool chosen[VERGE_VEHICLES_MAX])
{
    uint32_t room = self->controlled_max;
    uint32_t left_out = 0;
    for (int newcomers = 0; newcomers <= 1; ++newcomers) {
        for (uint32_t i = 0; i < self->vehicles_max; ++i) {
            const inbox_slot* slot = &self->slots[i];
            const bool wants = slot->planned != (newcomers == 1)
                               && wants_plan(self, slot, plan_utime);
            chosen[i] = chosen[i] || (wants && room > 0);
            left_out += wants && room == 0 ? 1 : 0;
            room -= wants && room > 0 ? 1 : 0;
        }
    }
    return left_out;
}

static bool wants_plan(const inbox* self, const inbox_slot* slot, int64_t plan_utime)
{
    return slot->used && slot->state.controlled != 0 && !slot->incomplete &&
           age_ms(slot->state.utime, plan_utime) <= self->limits.fresh_ms;
}

static inbox_verdict age_judge(const inbox* self, int64_t utime, int64_t now_utime)
{
    const double age = age_ms(utime, now_utime);
    return age < -self->limits.future_ms ? INBOX_FUTURE
           : age > self->limits.drop_ms  ? INBOX_STALE
                                         : INBOX_ACCEPTED;
}

/// Both instants are positive, so the difference cannot overflow; and it is exact up to 285 years.
static double age_ms(int64_t utime, int64_t at_utime)
{
    return (double)(at_utime - utime) / 1000.0;
}
