/// See leader.h.
#include "leader.h"

#include <string.h>

static leader_verdict judge_sender(leader* self, const verge_vehicle_plan_t* plan,
                                   inbox_source source, int64_t now);
static leader_verdict judge_time(const leader* self, const verge_vehicle_plan_t* plan,
                                 const verge_vehicle_plan_t* known, int64_t now);
static bool contradicts(const leader* self, const verge_vehicle_plan_t* plan);

void leader_init(leader* self, const leader_def* def)
{
    memset(self, 0, sizeof *self);
    self->def = *def;
    leader_forget(self);
}

void leader_forget(leader* self)
{
    self->rsu_id = -1;
    self->plan_count = 0;
    self->cycle_us = LEADER_CYCLE_US_DEFAULT;
    self->seen_us = 0;
    self->other_map = self->other_version = 0;
    memset(self->senders, 0, sizeof self->senders);
}

const char* leader_verdict_name(leader_verdict verdict)
{
    static const char* const names[LEADER_VERDICTS] = {
        "accepted", "other_version", "out_of_range", "other_map", "other_rsu",   "same_id",
        "future",   "over",          "old",          "too_soon",  "contradicts", "no_room",
    };
    return (unsigned)verdict < LEADER_VERDICTS ? names[verdict] : "unknown";
}

static bool is_silent(const leader* self, int64_t now)
{
    return self->rsu_id < 0 || now - self->heard > LEADER_SILENT_CYCLES * self->cycle_us;
}

/// The place of a vehicle's plan; plan_count: there is none.
static uint32_t place_of(const leader* self, int32_t vehicle_id)
{
    uint32_t i = 0;
    while (i < self->plan_count && self->plans[i].vehicle_id != vehicle_id) {
        i++;
    }
    return i;
}

/// Removes plans that are over, of vehicles that have left.
static void make_room(leader* self, int64_t now)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->plan_count; i++) {
        if (self->plans[i].valid_until_utime >= now
            || self->plans[i].vehicle_id == self->def.vehicle_id) {
            self->plans[kept++] = self->plans[i];
        }
    }
    self->plan_count = kept;
}

/// The period of the roadside unit, from two of its plans for one vehicle. Late plans begin at other
/// instants than their cycles, so a shorter period counts when two plans in a row show it.
static void learn_cycle(leader* self, const verge_vehicle_plan_t* before,
                        const verge_vehicle_plan_t* plan)
{
    const int64_t cycles = (int64_t)plan->cycle - before->cycle;
    const int64_t us = cycles > 0 ? (plan->utime - before->utime) / cycles : 0;
    const bool late =
        plan->reason == VERGE_REASON_OVERRUN || before->reason == VERGE_REASON_OVERRUN;
    if (late || us < LEADER_CYCLE_US_MIN || us > LEADER_CYCLE_US_MAX) {
        return;
    }
    const int64_t apart = us - self->seen_us;
    if (us >= self->cycle_us || (apart <= us / 8 && apart >= -us / 8)) {
        self->cycle_us = us;
    }
    self->seen_us = us;
}

static leader_verdict judge(leader* self, const verge_vehicle_plan_t* plan, inbox_source source,
                            int64_t now)
{
    const bool own = plan->vehicle_id == self->def.vehicle_id;
    if (plan->protocol_version != WIRE_PROTOCOL_VERSION) {
        self->other_version = own ? now : self->other_version;
        return LEADER_OTHER_VERSION;
    }
    if (wire_plan_check(plan) != NULL || source.bus >= INBOX_BUSES_MAX) {
        return LEADER_OUT_OF_RANGE;
    }
    if ((uint32_t)plan->map_crc32 != self->def.map_crc32) {
        self->other_map = own ? now : self->other_map;
        return LEADER_OTHER_MAP;
    }
    const leader_verdict sender = judge_sender(self, plan, source, now);
    if (sender != LEADER_ACCEPTED) {
        return sender;
    }
    const uint32_t place = place_of(self, plan->vehicle_id);
    const bool known = self->rsu_id == plan->rsu_id && place < self->plan_count;
    const leader_verdict time = judge_time(self, plan, known ? &self->plans[place] : NULL, now);
    if (time != LEADER_ACCEPTED) {
        return time;
    }
    return self->rsu_id == plan->rsu_id && contradicts(self, plan) ? LEADER_CONTRADICTS
                                                                   : LEADER_ACCEPTED;
}

leader_verdict leader_offer(leader* self, const verge_vehicle_plan_t* plan, inbox_source source,
                            int64_t now)
{
    leader_verdict verdict = judge(self, plan, source, now);
    if (verdict == LEADER_ACCEPTED && self->rsu_id != plan->rsu_id) {
        leader_forget(self); // another roadside unit is followed from now on
        self->rsu_id = plan->rsu_id;
    }
    uint32_t place = place_of(self, plan->vehicle_id);
    if (verdict == LEADER_ACCEPTED && place == VERGE_CONTROLLED_MAX) {
        make_room(self, now);
        place = self->plan_count;
        verdict = place == VERGE_CONTROLLED_MAX ? LEADER_NO_ROOM : LEADER_ACCEPTED;
    }
    self->counters[verdict]++;
    if (verdict != LEADER_ACCEPTED) {
        self->refused_rsu_id = plan->rsu_id;
        return verdict;
    }
    if (place < self->plan_count) {
        learn_cycle(self, &self->plans[place], plan);
    }
    self->plan_count += place == self->plan_count ? 1 : 0;
    self->plans[place] = *plan;
    self->senders[source.bus] = source.sender;
    self->heard = now;
    if (plan->vehicle_id == self->def.vehicle_id) {
        self->ever = true;
        self->heard_own = now;
    }
    return LEADER_ACCEPTED;
}

/// Has the roadside unit not planned the own vehicle for three of its cycles?
static bool is_silent_about_own(const leader* self, int64_t now)
{
    return is_silent(self, now) || now - self->heard_own > LEADER_SILENT_CYCLES * self->cycle_us;
}

static leader_verdict judge_sender(leader* self, const verge_vehicle_plan_t* plan,
                                   inbox_source source, int64_t now)
{
    const int32_t wanted = self->def.rsu_id;
    if (wanted >= 0 && plan->rsu_id != wanted) {
        return LEADER_OTHER_RSU;
    }
    if (is_silent(self, now)) {
        memset(self->senders, 0, sizeof self->senders); // a unit that was restarted sends anew
        return LEADER_ACCEPTED;
    }
    if (plan->rsu_id != self->rsu_id) { // units share vehicles: who plans the own one counts
        const bool own = plan->vehicle_id == self->def.vehicle_id;
        const bool first = plan->rsu_id < self->rsu_id || is_silent_about_own(self, now);
        return own && plan->status != VERGE_CANCELLED && first ? LEADER_ACCEPTED
                                                               : LEADER_OTHER_RSU;
    }
    const uint64_t owner = self->senders[source.bus];
    return owner != 0 && source.sender != 0 && owner != source.sender ? LEADER_SAME_ID
                                                                      : LEADER_ACCEPTED;
}

static leader_verdict judge_time(const leader* self, const verge_vehicle_plan_t* plan,
                                 const verge_vehicle_plan_t* known, int64_t now)
{
    if (plan->utime > now + self->def.future_us) {
        return LEADER_FUTURE;
    }
    if (plan->status != VERGE_CANCELLED && plan->valid_until_utime < now) {
        return LEADER_OVER;
    }
    const bool cancels = plan->status == VERGE_CANCELLED;
    if (cancels && now - plan->utime > LEADER_SILENT_CYCLES * self->cycle_us) {
        return LEADER_OVER;
    }
    if (known == NULL || (known->status != VERGE_CANCELLED && cancels
                          && plan->utime >= known->utime)) {
        return LEADER_ACCEPTED;
    }
    // A late plan may begin with the rest of the plan before it, which bridged the time.
    const int64_t later = plan->utime - known->utime;
    const bool bridged = known->reason == VERGE_REASON_OVERRUN
                         && plan->reason != VERGE_REASON_OVERRUN && plan->cycle > known->cycle;
    if (bridged && later > -(int64_t)plan->dt_ms * 1000) {
        return LEADER_ACCEPTED;
    }
    return later <= 0                     ? LEADER_OLD
           : later < LEADER_CYCLE_US_MIN ? LEADER_TOO_SOON
                                         : LEADER_ACCEPTED;
}

/// All plans of a cycle state the same digest and the same number of plans. The rest of a late plan
/// and a plan that replaces one state the cycle of a plan before (VERGE_REASON_OVERRUN).
static bool contradicts(const leader* self, const verge_vehicle_plan_t* plan)
{
    for (uint32_t i = 0; i < self->plan_count; i++) {
        const verge_vehicle_plan_t* other = &self->plans[i];
        const bool whole = plan->status != VERGE_CANCELLED && other->status != VERGE_CANCELLED
                           && plan->reason != VERGE_REASON_OVERRUN
                           && other->reason != VERGE_REASON_OVERRUN;
        if (whole && other->cycle == plan->cycle && other->utime == plan->utime
            && (other->digest != plan->digest || other->plans_in_cycle != plan->plans_in_cycle)) {
            return true;
        }
    }
    return false;
}

const verge_vehicle_plan_t* leader_plan_of(const leader* self, int32_t vehicle_id, int64_t now)
{
    const uint32_t place = place_of(self, vehicle_id);
    if (is_silent(self, now) || place == self->plan_count) {
        return NULL;
    }
    const verge_vehicle_plan_t* plan = &self->plans[place];
    return plan->status != VERGE_CANCELLED && plan->valid_until_utime >= now ? plan : NULL;
}

/// Was a plan refused for this lately?
static bool lately(const leader* self, int64_t refused, int64_t now)
{
    return refused != 0 && now - refused <= LEADER_SILENT_CYCLES * self->cycle_us;
}

const verge_vehicle_plan_t* leader_plan(const leader* self, int64_t now, wire_unit_reason* why_not)
{
    const verge_vehicle_plan_t* plan =
        is_silent_about_own(self, now) ? NULL : leader_plan_of(self, self->def.vehicle_id, now);
    const uint32_t place = place_of(self, self->def.vehicle_id);
    const bool known = place < self->plan_count;
    *why_not = plan != NULL                                          ? WIRE_UNIT_NONE
               : lately(self, self->other_map, now)                  ? WIRE_UNIT_OTHER_MAP
               : lately(self, self->other_version, now)              ? WIRE_UNIT_OTHER_VERSION
               : !self->ever                                         ? WIRE_UNIT_NEVER_HEARD
               : is_silent_about_own(self, now) || !known            ? WIRE_UNIT_SILENT
               : self->plans[place].status == VERGE_CANCELLED        ? WIRE_UNIT_CANCELLED
                                                                     : WIRE_UNIT_PLAN_OVER;
    return plan;
}
