/// A cycle is repeated in the order in which the roadside unit has made it: the states it had, its
/// vehicles with their lanes, its decision and last plans, its plan. Of a planned vehicle the
/// message tells the state. Of the others the newest one before the instant of the plan is taken,
/// and the lane of each follows from the one before. Where scene_sum says otherwise, the difference
/// of the sums tells what it was (explain).
#include "verge/repeat.h"

#include "codec.h"

#include "road/road.h" // the lanes at a place

#include <assert.h>
#include <string.h>

enum { CANDIDATES_MAX = 512 };

/// Another state or lane of a vehicle than the one taken first, and what it adds to the sum.
typedef struct candidate {
    repeat_choice choice;
    uint32_t      delta;
} candidate;

static bool     is_whole(const repeat* self);
static bool     choose(repeat* self, repeat_result* result);
static bool     explain(repeat* self, uint32_t missing, repeat_result* result);
static void     gather(repeat* self);
static void     place(repeat* self);
static int32_t  lane_after(const repeat* self, const verge_vehicle* vehicle, int32_t before);
static uint32_t list_candidates(const repeat* self, candidate* list);
static void     take(repeat* self, const candidate* candidate, repeat_result* result);
static bool     plan_again(repeat* self);
static bool     is_same(repeat* self, int32_t vehicle_id, repeat_result* result);
static void     name_reasons(const repeat* self, bool explained, repeat_result* result);
static void     remember(repeat* self);
static void     drop_used(repeat* self);

const char* repeat_kind_text(repeat_kind kind)
{
    switch (kind) {
    case REPEAT_UNHEARD_BY_RSU: return "not heard by the roadside unit";
    case REPEAT_OLDER_STATE: return "planned from an older state";
    case REPEAT_NEWER_STATE: return "planned from a newer state";
    case REPEAT_OTHER_LANE: return "planned from another lane";
    case REPEAT_STATE_MISSED: return "a state that the roadside unit had was not heard here";
    case REPEAT_LAST_MISSED: return "the plans of the last cycle were not all heard";
    case REPEAT_LATE: return "the plan, or the one before, is late";
    case REPEAT_OTHER_ROAD: return "the plan is for another road";
    case REPEAT_OTHER_RESULT: return "other parameters, another version, or a signal not heard";
    }
    return "unknown";
}

void repeat_init(repeat* self, const repeat_def* def)
{
    memset(self, 0, sizeof *self);
    self->def = *def;
    self->last_cycle = -1;
    inbox_init(&self->held, &def->limits, def->vehicles_max, def->controlled_max);
    inbox_set_map(&self->held, def->map_crc32);
}

// ---- hearing ------------------------------------------------------------------------------

void repeat_state(repeat* self, const verge_vehicle_state_t* state)
{
    if (self->state_count == REPEAT_STATES_MAX) {
        --self->state_count;
        memmove(self->states, self->states + 1, self->state_count * sizeof self->states[0]);
    }
    self->states[self->state_count++] = *state;
}

void repeat_signal(repeat* self, const verge_lane_signal_t* signal)
{
    if (self->signal_count == REPEAT_SIGNALS_MAX) {
        --self->signal_count;
        memmove(self->signals, self->signals + 1, self->signal_count * sizeof self->signals[0]);
    }
    self->signals[self->signal_count++] = *signal;
}

bool repeat_plan(repeat* self, const verge_vehicle_plan_t* plan)
{
    const bool rest = plan->reason == VERGE_REASON_OVERRUN && plan->status != VERGE_CANCELLED;
    const bool over = plan->cycle == self->last_cycle && plan->utime <= self->last_utime;
    if (rest || over || wire_plan_check(plan) != NULL) {
        return false;
    }
    if (self->plan_count > 0 && self->plans[0].cycle != plan->cycle) {
        self->plan_count = 0; // the cycle before was not whole
    }
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        if (self->plans[i].vehicle_id == plan->vehicle_id) {
            return false; // heard on a second bus
        }
    }
    if (self->plan_count == REPEAT_PLANS_MAX) {
        return false;
    }
    self->plans[self->plan_count++] = *plan;
    return is_whole(self);
}

/// Have all messages of the present cycle been heard?
static bool is_whole(const repeat* self)
{
    return self->plan_count > 0 && self->plan_count == (uint32_t)self->plans[0].plans_in_cycle;
}

static bool is_plan(const verge_vehicle_plan_t* message)
{
    return message->status != VERGE_CANCELLED;
}

/// The plan of a vehicle in the present cycle, null: it has none.
static const verge_vehicle_plan_t* plan_of(const repeat* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        if (self->plans[i].vehicle_id == vehicle_id && is_plan(&self->plans[i])) {
            return &self->plans[i];
        }
    }
    return NULL;
}

/// Any plan of the present cycle, null: it has none. All have the same utime and scene_sum.
static const verge_vehicle_plan_t* any_plan(const repeat* self)
{
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        if (is_plan(&self->plans[i])) {
            return &self->plans[i];
        }
    }
    return NULL;
}

// ---- a cycle ------------------------------------------------------------------------------

static void add(repeat_result* result, repeat_difference difference)
{
    if (result->difference_count < REPEAT_DIFFERENCES_MAX) {
        result->differences[result->difference_count++] = difference;
    }
}

static void add_reason(repeat_result* result, repeat_kind kind)
{
    add(result, (repeat_difference){ kind, -1, 0, VERGE_NO_LANE });
}

void repeat_run(repeat* self, int32_t vehicle_id, repeat_result* result)
{
    memset(result, 0, sizeof *result);
    if (!is_whole(self)) {
        return;
    }
    const verge_vehicle_plan_t* any = any_plan(self);
    if (any == NULL) { // the roadside unit has not planned: its memory stays
        self->plan_count = 0;
        return;
    }
    if (any->map_crc32 != 0 && (uint32_t)any->map_crc32 != self->def.map_crc32) {
        add_reason(result, REPEAT_OTHER_ROAD);
        self->plan_count = 0;
        return;
    }
    const bool explained = choose(self, result);
    const bool has_plan = plan_of(self, vehicle_id) != NULL;
    result->planned = plan_again(self) && has_plan;
    result->same = result->planned && is_same(self, vehicle_id, result);
    if (has_plan && !result->same) {
        name_reasons(self, explained, result);
    }
    remember(self);
    drop_used(self);
    self->plan_count = 0;
}

/// Takes the states and lanes that the roadside unit had. False: at least one was not found.
static bool choose(repeat* self, repeat_result* result)
{
    const uint32_t wanted = (uint32_t)any_plan(self)->scene_sum;
    uint32_t sum = 0;
    self->choice_count = 0;
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        const verge_vehicle_plan_t* plan = &self->plans[i];
        if (is_plan(plan)) {
            self->choices[self->choice_count++] =
                (repeat_choice){ .vehicle_id = plan->vehicle_id, .utime = plan->state_utime };
            sum += wire_scene_hash(plan->vehicle_id, plan->state_utime);
        }
    }
    gather(self);
    for (uint32_t i = 0; i < self->scene.vehicle_count; ++i) {
        const int32_t id = self->scene.vehicles[i].id;
        sum += wire_scene_hash(id, self->scene.positions[i].lane_id);
        sum += plan_of(self, id) == NULL ? wire_scene_hash(id, self->view.state_utime[i]) : 0;
    }
    if (wanted == 0 || wanted == sum) {
        return true;
    }
    const bool explained = explain(self, wanted - sum, result);
    gather(self);
    return explained;
}

/// Can both be so at once?
static bool are_compatible(const repeat_choice* a, const repeat_choice* b)
{
    return a->vehicle_id != b->vehicle_id
           || (a->of_lane != b->of_lane && a->utime != 0 && b->utime != 0);
}

/// Finds the one difference, or the two, between what the roadside unit had and what was taken.
static bool explain(repeat* self, uint32_t missing, repeat_result* result)
{
    candidate list[CANDIDATES_MAX];
    const uint32_t count = list_candidates(self, list);
    for (uint32_t i = 0; i < count; ++i) {
        if (list[i].delta == missing) {
            take(self, &list[i], result);
            return true;
        }
    }
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t k = 0; k < i; ++k) {
            if (list[i].delta + list[k].delta == missing
                && are_compatible(&list[i].choice, &list[k].choice)) {
                take(self, &list[i], result);
                take(self, &list[k], result);
                return true;
            }
        }
    }
    return false;
}

/// The newest state of a vehicle that the roadside unit may have had. [us]
static int64_t newest_for(const repeat* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->choice_count; ++i) {
        if (self->choices[i].vehicle_id == vehicle_id && !self->choices[i].of_lane) {
            return self->choices[i].utime;
        }
    }
    return any_plan(self)->utime;
}

/// Makes the vehicles of the cycle, as the roadside unit does, from the states chosen.
static void gather(repeat* self)
{
    const int64_t utime = any_plan(self)->utime;
    const verge_scene* last = verge_planner_scene(self->def.planner);
    int32_t placed[VERGE_VEHICLES_MAX];
    uint32_t placed_count = 0;
    self->next = self->held;
    for (uint32_t i = 0; i < self->state_count; ++i) {
        const verge_vehicle_state_t* state = &self->states[i];
        if (state->utime <= newest_for(self, state->vehicle_id)) {
            (void)inbox_offer(&self->next, state, utime, last->road);
        }
    }
    for (uint32_t i = 0; i < self->signal_count; ++i) {
        if (self->signals[i].utime <= utime) {
            (void)inbox_offer_signal(&self->next, &self->signals[i], utime, last->road);
        }
    }
    for (uint32_t i = 0; i < self->choice_count; ++i) {
        if (self->choices[i].utime == 0 && !self->choices[i].of_lane) {
            inbox_forget_vehicle(&self->next, self->choices[i].vehicle_id);
        }
    }
    for (uint32_t i = 0; i < last->vehicle_count; ++i) {
        if (last->positions[i].lane_id != VERGE_NO_LANE) {
            placed[placed_count++] = last->vehicles[i].id;
        }
    }
    inbox_placed(&self->next, placed, placed_count);
    inbox_snapshot(&self->next, utime, &self->view);
    for (uint32_t i = 0; i < self->view.count; ++i) {
        self->view.vehicles[i].controlled = plan_of(self, self->view.vehicles[i].id) != NULL;
    }
    place(self);
}

/// The lane that a vehicle had before, as far as it is known.
static int32_t lane_before(const repeat* self, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < self->choice_count; ++i) {
        if (self->choices[i].vehicle_id == vehicle_id && self->choices[i].of_lane) {
            return self->choices[i].lane_id;
        }
    }
    const verge_scene* last = verge_planner_scene(self->def.planner);
    const int32_t i = verge_scene_find(last, vehicle_id);
    return i < 0 ? VERGE_NO_LANE : last->positions[i].lane_id;
}

/// Finds the lane of each vehicle. A vehicle that the scene refuses leaves it empty.
static void place(repeat* self)
{
    const verge_road* road = verge_planner_road(self->def.planner);
    verge_scene before = verge_scene_make(road, self->view.vehicles, self->before,
                                          VERGE_VEHICLES_MAX);
    before.vehicle_count = self->view.count; // in the order of ids
    for (uint32_t i = 0; i < before.vehicle_count; ++i) {
        before.positions[i].lane_id = lane_before(self, before.vehicles[i].id);
    }
    self->scene = verge_scene_make(road, self->vehicles, self->positions, VERGE_VEHICLES_MAX);
    (void)verge_scene_place(&self->scene, any_plan(self)->utime, self->view.vehicles,
                            self->view.count, &before);
}

/// The lane of one vehicle, had it been on another one before.
static int32_t lane_after(const repeat* self, const verge_vehicle* vehicle, int32_t before)
{
    const verge_road* road = verge_planner_road(self->def.planner);
    verge_vehicle had = *vehicle, has;
    verge_lane_position on = { .lane_id = before }, at = { .lane_id = VERGE_NO_LANE };
    verge_scene last = verge_scene_make(road, &had, &on, 1);
    verge_scene scene = verge_scene_make(road, &has, &at, 1);
    last.vehicle_count = 1;
    (void)verge_scene_place(&scene, 0, vehicle, 1, &last);
    return at.lane_id;
}

static uint32_t list_lanes(const repeat* self, uint32_t i, candidate* list, uint32_t room)
{
    const verge_vehicle* vehicle = &self->scene.vehicles[i];
    const verge_road* road = verge_planner_road(self->def.planner);
    const int32_t id = vehicle->id, own = self->scene.positions[i].lane_id;
    uint32_t count = 0;
    vg_nearby nearby = vg_road_nearby(road, vehicle->x, vehicle->y);
    while (vg_nearby_next(&nearby) >= 0 && count < room) {
        const int32_t before = vg_nearby_position(&nearby, vehicle->heading).lane_id;
        const int32_t after = lane_after(self, vehicle, before);
        if (after != own) {
            list[count++] = (candidate){
                { .vehicle_id = id, .of_lane = true, .utime = 1, .lane_id = after },
                wire_scene_hash(id, after) - wire_scene_hash(id, own),
            };
        }
    }
    return count;
}

/// Of a vehicle in the scene: no state, or the one of the last cycle.
static uint32_t list_states(const repeat* self, uint32_t i, candidate* list)
{
    const int32_t id = self->scene.vehicles[i].id;
    const int64_t held = inbox_held_utime(&self->held, id);
    const uint32_t own = wire_scene_hash(id, self->view.state_utime[i]);
    const uint32_t lane = wire_scene_hash(id, self->scene.positions[i].lane_id);
    list[0] = (candidate){ { .vehicle_id = id }, 0u - own - lane };
    list[1] = (candidate){ { .vehicle_id = id, .utime = held }, wire_scene_hash(id, held) - own };
    return held == 0 ? 1 : 2;
}

/// What the state adds if the roadside unit had it, and not the one taken.
static uint32_t delta_of(const repeat* self, const verge_vehicle_state_t* state)
{
    const int32_t  id = state->vehicle_id, i = verge_scene_find(&self->scene, id);
    const uint32_t with = wire_scene_hash(id, state->utime);
    if (i >= 0) {
        return with - wire_scene_hash(id, self->view.state_utime[i]);
    }
    const verge_vehicle vehicle = wire_vehicle_from_state(state);
    return with + wire_scene_hash(id, lane_after(self, &vehicle, VERGE_NO_LANE));
}

/// What the roadside unit may have had instead: another lane of a vehicle, and no state, or another
/// one, of a vehicle without a plan.
static uint32_t list_candidates(const repeat* self, candidate* list)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < self->scene.vehicle_count && count + 2 <= CANDIDATES_MAX; ++i) {
        if (plan_of(self, self->scene.vehicles[i].id) == NULL) {
            count += list_states(self, i, list + count);
        }
        count += list_lanes(self, i, list + count, CANDIDATES_MAX - count);
    }
    for (uint32_t k = 0; k < self->state_count && count < CANDIDATES_MAX; ++k) {
        const verge_vehicle_state_t* state = &self->states[k];
        if (plan_of(self, state->vehicle_id) == NULL && wire_state_check(state) == NULL) {
            list[count++] = (candidate){
                { .vehicle_id = state->vehicle_id, .utime = state->utime },
                delta_of(self, state),
            };
        }
    }
    return count;
}

static void take(repeat* self, const candidate* candidate, repeat_result* result)
{
    const repeat_choice* choice = &candidate->choice;
    const repeat_kind kind = choice->of_lane      ? REPEAT_OTHER_LANE
                             : choice->utime == 0 ? REPEAT_UNHEARD_BY_RSU
                             : choice->utime > any_plan(self)->utime ? REPEAT_NEWER_STATE
                                                                     : REPEAT_OLDER_STATE;
    add(result, (repeat_difference){
        .kind = kind,
        .vehicle_id = choice->vehicle_id,
        .state_utime = choice->of_lane ? 0 : choice->utime,
        .lane_id = choice->of_lane ? choice->lane_id : VERGE_NO_LANE,
    });
    self->choices[self->choice_count++] = *choice;
}

/// False: the planner refuses what was received.
static bool plan_again(repeat* self)
{
    verge_signal signals[INBOX_SIGNALS_MAX];
    verge_decision decision = verge_decision_make(self->decisions, VERGE_CONTROLLED_MAX);
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        if (is_plan(&self->plans[i]) && decision.vehicle_count < VERGE_CONTROLLED_MAX
            && wire_decision_from_plan(&self->plans[i],
                                       &self->decisions[decision.vehicle_count])) {
            ++decision.vehicle_count;
        }
    }
    verge_scene scene = self->scene;
    scene.signal_count = inbox_signals(&self->next, scene.utime, signals);
    scene.signals = signals;
    return verge_planner_repeat(self->def.planner, &scene, &decision, self->last,
                                self->last_count, &self->plan) == VERGE_OK;
}

/// Makes the message of the repeated plan. True: it has the bytes of the one received.
static bool is_same(repeat* self, int32_t vehicle_id, repeat_result* result)
{
    const verge_vehicle_plan_t* message = plan_of(self, vehicle_id);
    const wire_plan_header header = {
        .utime = message->utime,
        .valid_until_utime = message->valid_until_utime,
        .state_utime = message->state_utime,
        .rsu_id = message->rsu_id,
        .cycle = message->cycle,
        .plans_in_cycle = message->plans_in_cycle,
        .digest = (uint64_t)message->digest,
        .map_crc32 = (uint32_t)message->map_crc32,
        .scene_sum = (uint32_t)message->scene_sum,
    };
    uint32_t i = 0;
    while (i < self->plan.vehicle_count && self->plan.vehicles[i].vehicle_id != vehicle_id) {
        ++i;
    }
    if (i == self->plan.vehicle_count) {
        return false;
    }
    result->plan = wire_plan_from_vehicle_plan(&header, &self->plan.vehicles[i]);
    verge_vehicle_plan_t other = *message;
    other.crc32 = result->plan.crc32;
    uint8_t own_bytes[CODEC_SIZE_MAX], bytes[CODEC_SIZE_MAX];
    const size_t size = codec_encode(TRANSPORT_PLAN, &result->plan, own_bytes);
    return codec_encode(TRANSPORT_PLAN, &other, bytes) == size
           && memcmp(own_bytes, bytes, size) == 0;
}

/// Is the cycle a part of a plan that was late?
static bool is_late(const repeat* self)
{
    const verge_vehicle_plan_t* any = any_plan(self);
    return self->plan.vehicle_count > 0
           && (uint32_t)any->point_count < self->plan.vehicles[0].point_count;
}

/// Why the result differs. explained: the states are those that the roadside unit had.
static void name_reasons(const repeat* self, bool explained, repeat_result* result)
{
    const uint32_t before = result->difference_count;
    bool missed = false;
    for (uint32_t i = 0; i < self->plan_count; ++i) {
        const verge_vehicle_plan_t* plan = &self->plans[i];
        if (is_plan(plan)
            && inbox_held_utime(&self->next, plan->vehicle_id) != plan->state_utime) {
            add(result, (repeat_difference){ REPEAT_STATE_MISSED, plan->vehicle_id,
                                             plan->state_utime, VERGE_NO_LANE });
            missed = true;
        }
    }
    if (!explained && !missed) {
        add_reason(result, REPEAT_STATE_MISSED);
    }
    if (self->last_cycle < 0 || self->plans[0].cycle != self->last_cycle + 1) {
        add_reason(result, REPEAT_LAST_MISSED);
    }
    if (is_late(self) || self->last_late) {
        add_reason(result, REPEAT_LATE);
    }
    if (result->difference_count == before) {
        add_reason(result, REPEAT_OTHER_RESULT);
    }
}

/// The last plans are those of the messages, also where the result differs.
static void remember(repeat* self)
{
    self->last_late = is_late(self);
    self->last_cycle = self->plans[0].cycle;
    self->last_utime = any_plan(self)->utime;
    self->last_count = 0;
    for (uint32_t i = 0; i < self->plan_count && self->last_count < VERGE_CONTROLLED_MAX; ++i) {
        self->last_count +=
            wire_vehicle_plan_from_plan(&self->plans[i], &self->last[self->last_count]) ? 1 : 0;
    }
}

/// Keeps the states that the inbox does not hold yet, unless they are too old for it.
static void drop_used(repeat* self)
{
    const int64_t utime = any_plan(self)->utime;
    const int64_t oldest = utime - (int64_t)(self->def.limits.drop_ms * 1000.0);
    uint32_t kept = 0;
    self->held = self->next;
    for (uint32_t i = 0; i < self->state_count; ++i) {
        const verge_vehicle_state_t* state = &self->states[i];
        if (state->utime > oldest
            && state->utime > inbox_held_utime(&self->held, state->vehicle_id)) {
            self->states[kept++] = *state;
        }
    }
    self->state_count = kept;
    kept = 0;
    for (uint32_t i = 0; i < self->signal_count; ++i) {
        if (self->signals[i].utime > utime) {
            self->signals[kept++] = self->signals[i];
        }
    }
    self->signal_count = kept;
}
