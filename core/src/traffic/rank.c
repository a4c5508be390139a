/// The rank of the vehicles of a scene: by arrival, within what facts and rules demand. See
/// order.h.
#include "traffic/order.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <string.h>

// Comfortable acceleration from which times of arrival follow. [m/s^2]
static const float acceleration = 1.5f;
// A vehicle that needs harder braking to stop before an area goes first. [m/s^2]
static const float braking_planned = 3.0f;
// The same where a vehicle that is not planned here cannot stop before it either. [m/s^2]
static const float braking_needed = 6.0f;
// Time between a planned vehicle that leaves an area and an uncontrolled one that arrives. [s]
static const float encroachment = 1.0f;
// The same where the uncontrolled one has priority: it is not to brake. [s]
static const float encroachment_of_priority = 2.5f;
// One that has to wait, is this near to its line or would need this to stop, but brakes less than
// half as hard as it needs, is not expected to wait. Nobody brakes visibly below 2 m/s.
static const float brakes_within = 3.0f; // [s] at the present speed
static const float braking_usual = 1.5f; // [m/s^2] with which drivers begin to brake for a line
static const float crawling = 2.0f;      // [m/s]
static const float shown_from = 0.6f;    // [m/s^2] who brakes less shows nothing
// A planned vehicle stays ready to brake by this for one that has not shown that it waits. [m/s^2]
static const float braking_ready = 2.0f;
// Nor is one whose weight of VERGE_INSISTS is larger. [1]
static const float doubt = 0.3f;
// An estimate of arrival that is later by more, or earlier by more, replaces the first one. A
// vehicle that is at most so long away waits for its turn, and is not late. [s]
static const double later = 3.0, earlier = 1.0;
// Later arrival, in effect, of a lane that yields, and of one that enters a ring. [s]
static const double yields = 4.0, enters = 4.0;
// The same of a vehicle that has somebody from the right within right_within, where the right goes
// first. [s]
static const double from_right = 2.0;
static const float right_within = 3.0f;
// A lane turns left, and vehicles come towards one another: sine and cosine of the angle. [1]
static const double left_turn = 0.5, towards = -0.7;
// A vehicle follows its leader over a line after this time. [s]
static const float follow_up = 2.0f;
// A standing vehicle with its front this near before an area waits for it, others do not go. [m]
static const float waits_within = 6.0f;
// Standing vehicles this near behind one another are a queue. [m]
static const float queue_gap = 8.0f;
static const float standing = 0.3f; // [m/s]
// A vehicle that is not planned here and does not use its turn for so long is passed over. [s]
static const double patience_human = 3.0, patience_planned = 4.0;
// Added to the arrival of a vehicle that was passed over, that has no room behind its area or a red
// signal before it, or that does not move at all. [s]
static const double passed_over = 600.0, no_room = 500.0, never = 1000.0;
// A vehicle that stops at a stop sign loses so long there. [s]
static const float stop_takes = 1.5f;
// A red signal that opens within this time is one that is waited for. [s]
static const float opens_soon = 5.0f;
// A vehicle that nobody let go is first for so long. [s]
static const double helped_s = 10.0;

typedef struct ranking {
    vg_order*       order;
    const vg_model* model;
    const vg_flow*  flow;
    const verge_scene* scene;
    int32_t  leader[VERGE_VEHICLES_MAX]; // slot ahead on the route, -1 none
    float    ahead[VERGE_VEHICLES_MAX];  // [m] from centre to centre
    float    arrival[VERGE_VEHICLES_MAX]; // [s] at the first shared area
    double   key[VERGE_VEHICLES_MAX];    // [s]
    uint64_t must[VERGE_VEHICLES_MAX];   // slots (bits) that come before
    uint64_t lets[VERGE_VEHICLES_MAX];   // slots (bits) in whose way it would be
    uint64_t passed;                     // slots (bits) that did not use their turn
    uint64_t doubted;                    // slots (bits) that have to show that they wait
} ranking;

static void find_leaders(ranking* self);
static void find_arrivals(ranking* self);
static void find_keys(ranking* self, const verge_scene* scene, verge_turns* turns);
static void find_facts(ranking* self);
static void keep_passes(ranking* self, const verge_scene* scene, const verge_decision* decision);
static void select_ranks(ranking* self);
static void count_patience(const ranking* self, const verge_scene* scene, verge_turns* turns);
static void note_doubts(const ranking* self, const verge_scene* scene, verge_turns* turns);

void vg_order_rank(vg_order* order, const vg_model* model, const vg_flow* flow,
                   const verge_scene* scene, verge_turns* turns, const verge_decision* decision)
{
    VERGE_ASSERT(model->count <= order->vehicles_max);
    ranking self = { .order = order, .model = model, .flow = flow, .scene = scene };
    find_leaders(&self);
    find_arrivals(&self);
    find_keys(&self, scene, turns);
    find_facts(&self);
    if (decision != NULL) {
        keep_passes(&self, scene, decision);
    }
    select_ranks(&self);
    if (turns != NULL) {
        count_patience(&self, scene, turns);
        note_doubts(&self, scene, turns);
    }
}

static const vg_share* shares_of(const ranking* self, uint32_t slot)
{
    return &self->order->shares[slot * self->order->shares_max];
}

// ---------------------------------------------------------------------------- leaders

// On a ring everybody is ahead of everybody: only the nearest counts.
static void find_leaders(ranking* self)
{
    const vg_flow* flow = self->flow;
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const vg_course* course = &self->order->courses[i];
        self->leader[i] = -1;
        self->ahead[i] = VG_FAR_AWAY;
        for (uint32_t j = 0; j < self->model->count; ++j) {
            for (uint32_t k = 0; j != i && k < course->leg_count; ++k) {
                const vg_route_leg* leg = &course->legs[k];
                const float at = vg_on_leg(leg, flow->station[j]);
                if (leg->lane == flow->lane[j] && (at > 0.0f || (at == 0.0f && j < i))
                    && at < self->ahead[i]) {
                    self->ahead[i] = at;
                    self->leader[i] = (int32_t)j;
                }
            }
        }
    }
}

// ---------------------------------------------------------------------------- arrivals

// Time to drive a distance from speed v, accelerating up to a limit. [s]
static float time_to(float distance, float v, float limit)
{
    if (distance <= 0.0f) {
        return 0.0f;
    }
    const float top = vg_maxf(limit, vg_maxf(v, 1.0f));
    const float gaining = (top * top - v * v) / (2.0f * acceleration);
    if (distance < gaining) {
        return (__builtin_sqrtf(v * v + 2.0f * acceleration * distance) - v) / acceleration;
    }
    return (top - v) / acceleration + (distance - gaining) / top;
}

static bool is_planned(const ranking* self, uint32_t slot)
{
    return (slot < self->model->controlled_count) != self->order->of_humans;
}

// Time to drive a distance, with a stop at the stop sign that lies before. [s]
static float time_with_stop(const ranking* self, uint32_t slot, float distance)
{
    const vg_course* course = &self->order->courses[slot];
    const float v = self->flow->v[slot], limit = self->flow->limit[slot];
    const float gap = vg_maxf(course->sign - self->model->half_length[slot], 0.0f);
    if (gap >= distance || !vg_order_stops_first(self->order, self->flow, slot)) {
        return time_to(distance, v, limit);
    }
    return 2.0f * gap / vg_maxf(v, 1.0f) + stop_takes + time_to(distance - gap, 0.0f, limit);
}

// Arrival at the first shared area on a free road. A vehicle that is not planned here is expected
// to keep its speed; standing away from an area it does not go.
static float free_arrival(const ranking* self, uint32_t slot)
{
    const float v = self->flow->v[slot];
    const float distance = shares_of(self, slot)->enter - self->model->half_length[slot];
    const bool stopped = self->order->courses[slot].stopped != 0;
    if (slot < self->model->controlled_count
        || (v >= standing
            && (stopped || vg_order_stops_first(self->order, self->flow, slot)))) {
        return time_with_stop(self, slot, distance);
    }
    if (v < standing) {
        return distance < waits_within || stopped ? 0.0f : VG_FAR_AWAY;
    }
    return vg_maxf(distance, 0.0f) / v;
}

// Arrival behind the leader, who is before the area as well.
static float arrival_behind(const ranking* self, uint32_t slot, float own)
{
    const int32_t lead = self->leader[slot];
    const float enter = shares_of(self, slot)->enter;
    if (lead < 0 || self->ahead[slot] - self->model->half_length[lead] > enter) {
        return own;
    }
    const uint32_t j = (uint32_t)lead;
    const float gap = self->ahead[slot] - self->model->half_length[slot]
                      - self->model->half_length[j];
    const float left = enter - self->ahead[slot]; // of the leader, to this area
    const float v = self->flow->v[j];
    float theirs = self->order->courses[j].share_count > 0 ? self->arrival[j] : VG_FAR_AWAY;
    if (theirs >= VG_FAR_AWAY && (v >= standing || j < self->model->controlled_count)) {
        theirs = j < self->model->controlled_count ? time_to(left, v, self->flow->limit[j])
                                                   : vg_maxf(left, 0.0f) / v;
    }
    if (own >= VG_FAR_AWAY && gap < queue_gap) {
        own = 0.0f; // it stands because of its leader
    }
    return theirs >= VG_FAR_AWAY || own >= VG_FAR_AWAY ? VG_FAR_AWAY
                                                       : vg_maxf(own, theirs + follow_up);
}

static void find_arrivals(ranking* self)
{
    float alone[VERGE_VEHICLES_MAX];
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const bool shares = self->order->courses[i].share_count > 0;
        alone[i] = self->arrival[i] = shares ? free_arrival(self, i) : VG_FAR_AWAY;
    }
    bool more = true;
    for (uint32_t round = 0; more && round < self->model->count; ++round) {
        more = false;
        for (uint32_t i = 0; i < self->model->count; ++i) {
            if (self->order->courses[i].share_count > 0) {
                const float arrival = arrival_behind(self, i, alone[i]);
                more = more || arrival != self->arrival[i];
                self->arrival[i] = arrival;
            }
        }
    }
}

// ---------------------------------------------------------------------------- keys

verge_turn* vg_turn_of(verge_turns* turns, int32_t id)
{
    for (uint32_t k = 0; turns != NULL && k < turns->count; ++k) {
        if (turns->of[k].vehicle_id == id) {
            return &turns->of[k];
        }
    }
    return NULL;
}

// The priority that a vehicle has in an area: that of the last lane before it that has one.
static verge_priority priority_at(const vg_order* order, const vg_model* model, uint32_t slot,
                                  float enter)
{
    const verge_road* road = model->road;
    const vg_course* course = &order->courses[slot];
    verge_priority found = VERGE_PRIORITY_NONE;
    int32_t before = vg_lane_before(road, (uint32_t)course->legs[0].lane);
    if (before >= 0) {
        found = road->lanes[before].priority;
    }
    for (uint32_t k = 0; k < course->leg_count; ++k) {
        if (vg_leg_start(&course->legs[k], road) > enter) {
            break;
        }
        const verge_priority here = road->lanes[course->legs[k].lane].priority;
        found = here != VERGE_PRIORITY_NONE ? here : found;
    }
    return found;
}

static bool must_yield(verge_priority priority)
{
    return priority == VERGE_PRIORITY_MINOR || priority == VERGE_PRIORITY_STOP;
}

// Is there a vehicle from the right that arrives at about the same time?
static bool has_right(const ranking* self, uint32_t slot)
{
    const verge_road* road = self->model->road;
    const vg_share* shares = shares_of(self, slot);
    const vg_reference own = vg_lane_at(&road->lanes[self->flow->lane[slot]],
                                        vg_flow_s(self->model, self->flow, slot));
    bool found = false;
    for (uint32_t k = 0; k < self->order->courses[slot].share_count; ++k) {
        const uint32_t j = shares[k].other;
        const vg_reference other =
            vg_lane_at(&road->lanes[self->flow->lane[j]], vg_flow_s(self->model, self->flow, j));
        const double left =
            own.cos_heading * other.sin_heading - own.sin_heading * other.cos_heading;
        found = found || (left > 0.5 && self->arrival[j] < self->arrival[slot] + right_within);
    }
    return found;
}

// Change of heading along a lane, as its sine: above 0 to the left; and the heading at its start.
static double turn_of(const vg_lane* lane, vg_reference* start)
{
    *start = vg_lane_at(lane, 0.0);
    const vg_reference end = vg_lane_at(lane, lane->length);
    return start->cos_heading * end.sin_heading - start->sin_heading * end.cos_heading;
}

// Does slot i turn left in an area, across the way of one that comes towards it and does not?
static bool turns_across(const ranking* self, const vg_share* area)
{
    vg_reference own, other;
    const vg_lane* lanes = self->model->road->lanes;
    const bool left = turn_of(&lanes[area->lane], &own) > left_turn;
    const bool other_left = turn_of(&lanes[area->other_lane], &other) > left_turn;
    const double along = own.cos_heading * other.cos_heading + own.sin_heading * other.sin_heading;
    return area->kind == VG_SHARE_CROSS && left && !other_left && along < towards;
}

bool vg_order_yields(const vg_order* order, const vg_model* model, uint32_t slot, float enter)
{
    return must_yield(priority_at(order, model, slot, enter));
}

static double delay_by_rule(const ranking* self, uint32_t slot)
{
    const float enter = shares_of(self, slot)->enter;
    const verge_priority priority = priority_at(self->order, self->model, slot, enter);
    double delay = must_yield(priority) ? yields : 0.0;
    if (priority == VERGE_PRIORITY_RIGHT_BEFORE_LEFT && has_right(self, slot)) {
        delay += from_right;
    }
    return delay + (self->order->courses[slot].ring_enter < VG_FAR_AWAY ? enters : 0.0);
}

// The time of arrival that counts: the first one, unless the vehicle is much later or earlier.
static double kept_arrival(double arrival, int64_t utime, const verge_turn* before)
{
    if (before == NULL) {
        return arrival;
    }
    const double first = vg_seconds_between(utime, before->arrival);
    const bool late = arrival > later && arrival - first > later;
    return late || arrival < first - earlier ? arrival : first;
}

// Since when does the vehicle stand, and does it still go first because nobody moved?
static void count_standing(const ranking* self, uint32_t slot, int64_t utime,
                           const verge_turn* before, verge_turn* turn)
{
    if (before != NULL && before->helped != 0
        && vg_seconds_between(before->helped, utime) < helped_s) {
        turn->helped = before->helped;
    }
    if (slot < self->model->controlled_count && vg_fabsf(self->flow->v[slot]) < standing) {
        turn->still = before != NULL && before->still != 0 ? before->still : utime;
    }
}

// Is there a signal before an area that stops the slot? Areas may begin a little before the line.
static bool red_before(const ranking* self, uint32_t slot, float enter)
{
    return self->order->courses[slot].red < enter + VG_STOP_BEFORE;
}

static void find_keys(ranking* self, const verge_scene* scene, verge_turns* turns)
{
    verge_turns kept = { 0 };
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const int32_t id = scene->vehicles[self->model->input_index[i]].id;
        const verge_turn* before = vg_turn_of(turns, id);
        self->key[i] = never;
        const vg_course* course = &self->order->courses[i];
        verge_turn turn = { .vehicle_id = id, .arrival = scene->utime, .stopped = course->stopped };
        if (turn.stopped != 0) {
            turn.stop_lane_id = self->model->road->lanes[course->sign_lane].id;
        }
        count_standing(self, i, scene->utime, before, &turn);
        self->doubted |= before != NULL && before->doubted ? (uint64_t)1 << i : 0;
        self->order->helped |= turn.helped != 0 ? (uint64_t)1 << i : 0;
        if (course->share_count == 0 || self->arrival[i] >= VG_FAR_AWAY) {
            if (turn.still != 0 || turn.helped != 0 || turn.stopped != 0) {
                kept.of[kept.count++] = turn;
            }
            continue;
        }
        // Of those that have stopped at their sign, the first one goes first.
        const double arrival =
            course->stopped != 0
                ? -vg_seconds_between(course->stopped, scene->utime)
                : kept_arrival((double)self->arrival[i], scene->utime, before);
        turn.arrival = scene->utime + (int64_t)(arrival * 1e6);
        const bool red = red_before(self, i, shares_of(self, i)->enter);
        const bool waits = red && course->red_opens <= opens_soon;
        self->key[i] = (waits ? vg_max(arrival, (double)course->red_opens) : arrival)
                       + delay_by_rule(self, i);
        if (before != NULL && before->standing != 0 && self->flow->v[i] < standing) {
            turn.standing = before->standing;
            const double patience = self->order->of_humans ? patience_planned : patience_human;
            const bool late = vg_seconds_between(turn.standing, scene->utime) > patience;
            self->key[i] += late ? passed_over : 0.0;
            self->passed |= late ? (uint64_t)1 << i : 0;
        }
        if ((red && !waits)
            || !vg_order_has_room(self->order, self->model, self->flow, i)) {
            self->key[i] += no_room;
        }
        if (turn.helped != 0) {
            self->key[i] = -passed_over;
        }
        kept.of[kept.count++] = turn;
    }
    if (turns != NULL) {
        *turns = kept;
    }
}

// ---------------------------------------------------------------------------- facts

enum { FREE, COMMITTED, INSIDE };

// A vehicle well beyond its stop line is in the way of others as one in the area is, unless it
// waits for a signal, or did not use its turn.
static uint32_t grade(const ranking* self, uint32_t slot, float enter, float margin, float braking)
{
    const float v = self->flow->v[slot];
    const bool  waits = red_before(self, slot, enter) || (self->passed >> slot & 1u) != 0;
    const float beyond = waits ? 0.0f : 0.5f * margin;
    const float distance = enter - beyond - self->model->half_length[slot];
    return distance <= 0.0f                    ? INSIDE
           : v * v > 2.0f * braking * distance ? COMMITTED
                                               : FREE;
}

static bool merge_before(const ranking* self, uint32_t i, const vg_share* area)
{
    const vg_share* shares = shares_of(self, i);
    bool found = false;
    for (const vg_share* at = shares; at < area; ++at) {
        found = found || (at->kind == VG_SHARE_MERGE && at->other == area->other);
    }
    return found;
}

// Has the other vehicle to go first in this area, whatever their times are?
static bool goes_first(const ranking* self, uint32_t i, const vg_share* area)
{
    const uint32_t j = area->other;
    const float margin = vg_share_margin(area);
    const uint32_t own = grade(self, i, area->enter, margin, braking_planned);
    const uint32_t other = grade(self, j, area->other_enter, margin, braking_planned);
    if (area->kind == VG_SHARE_ZIP) {
        return false; // decided in zipper.c
    }
    if (area->kind == VG_SHARE_PART) { // the one ahead, unless they merge first
        return !merge_before(self, i, area)
               && (area->other_enter < area->enter || (area->other_enter == area->enter && j < i));
    }
    if (own != other || own == FREE) {
        return other > own;
    }
    const float v = vg_maxf(self->flow->v[i], 0.5f), v_other = vg_maxf(self->flow->v[j], 0.5f);
    float mine = area->leave, theirs = area->other_leave;
    if (area->kind == VG_SHARE_CROSS) {
        mine = (own == INSIDE ? area->leave : area->enter) / v;
        theirs = (own == INSIDE ? area->other_leave : area->other_enter) / v_other;
    }
    return theirs < mine || (theirs == mine && j < i);
}

// The line before an area at which the slot has to stop, whoever is there; VG_FAR_AWAY: none. [m]
static float line_before(const ranking* self, uint32_t slot, float enter)
{
    const vg_course* course = &self->order->courses[slot];
    const float gap = enter - self->model->half_length[slot];
    if (red_before(self, slot, enter) && course->red_opens * self->flow->v[slot] > gap) {
        return course->red;
    }
    return vg_order_stops_first(self->order, self->flow, slot) ? course->sign : VG_FAR_AWAY;
}

// Has slot j by priority to wait for slot i in an area that begins there on their routes?
static bool has_to_wait(const vg_order* order, const vg_model* model, uint32_t i, uint32_t j,
                        float enter, float other_enter)
{
    return !vg_order_yields(order, model, i, enter)
           && vg_order_yields(order, model, j, other_enter);
}

float vg_order_line_to_yield(const vg_order* order, const vg_model* model, uint32_t slot)
{
    const vg_share* shares = &order->shares[slot * order->shares_max];
    const vg_course* course = &order->courses[slot];
    float line = vg_minf(course->red, course->sign) - model->half_length[slot];
    line = line > 0.0f && line < 0.5f * VG_FAR_AWAY ? line : VG_FAR_AWAY;
    for (uint32_t k = 0; k < course->share_count; ++k) {
        const vg_share* area = &shares[k];
        const float at = area->enter - vg_share_margin(area) - model->half_length[slot];
        if (area->other < model->controlled_count && area->kind < VG_SHARE_PART && at > 0.0f
            && has_to_wait(order, model, area->other, slot, area->other_enter, area->enter)) {
            line = vg_minf(line, at);
        }
    }
    return line;
}

// Would slot i, after one more second, need more than light braking to stop before an area? Up to
// then it may rely on others that have not shown yet that they wait.
static bool stops_late(const ranking* self, uint32_t i, const vg_share* area)
{
    const float v = self->flow->v[i];
    const float gap = area->enter - vg_share_margin(area) - self->model->half_length[i] - v;
    return self->order->believes && v * v > 2.0f * braking_ready * vg_maxf(gap, 0.0f);
}

// Does slot j wait before its part of an area for slot i, by the rules and as far as one sees? Far
// from the area a vehicle need not show it yet.
static bool will_wait(const ranking* self, uint32_t i, const vg_share* area)
{
    const uint32_t j = area->other;
    const float stop = line_before(self, j, area->other_enter);
    const bool stops = stop < VG_FAR_AWAY;
    if ((!stops
         && !has_to_wait(self->order, self->model, i, j, area->enter, area->other_enter))
        || self->order->insists[j] > doubt) {
        return false;
    }
    const float line = stops ? stop : area->other_enter - vg_share_margin(area);
    const float distance = vg_maxf(line - self->model->half_length[j], 0.5f);
    const float v = self->flow->v[j], needed = v * v / (2.0f * distance);
    const double a = self->scene->vehicles[self->model->input_index[j]].acceleration;
    const bool far = needed < braking_usual && (v < crawling || distance > brakes_within * v);
    const bool shows = v < standing || a <= -0.5 * (double)vg_maxf(needed, shown_from);
    return shows || (far && !stops_late(self, i, area) && (self->doubted >> j & 1u) == 0);
}

// Has slot i to let the other vehicle go first in an area, by the rules of the road?
static bool cedes_to(const ranking* self, uint32_t i, const vg_share* area)
{
    return turns_across(self, area)
           || (vg_order_yields(self->order, self->model, i, area->enter)
               && !vg_order_yields(self->order, self->model, area->other, area->other_enter));
}

// Would a vehicle be in the way of one that keeps its speed? A planned vehicle is in nobody's way
// that is not planned. Drivers that have priority do not wait for those who have not.
static bool is_in_the_way(const ranking* self, uint32_t i, const vg_share* area)
{
    const uint32_t j = area->other;
    const float v = self->flow->v[j], margin = vg_share_margin(area);
    const bool cedes = area->kind < VG_SHARE_PART && cedes_to(self, i, area);
    const bool asked = self->order->of_humans ? cedes && is_planned(self, j)
                                              : is_planned(self, i) && !is_planned(self, j);
    if (!asked || v < standing || area->kind >= VG_SHARE_PART || will_wait(self, i, area)) {
        return false;
    }
    const bool late = grade(self, j, area->other_enter, margin, braking_planned) == COMMITTED;
    const float braking = late ? braking_needed : braking_planned;
    if (grade(self, i, area->enter, margin, braking) != FREE) {
        return false;
    }
    const float half = self->model->half_length[i], half_j = self->model->half_length[j];
    const float clear = time_with_stop(self, i, area->leave + half);
    const float apart = cedes ? encroachment_of_priority : encroachment;
    return clear + apart > (area->other_enter - half_j) / v;
}

static void find_facts(ranking* self)
{
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const vg_share* shares = shares_of(self, i);
        self->must[i] = self->order->before[i];
        self->must[i] |= self->leader[i] >= 0 ? (uint64_t)1 << self->leader[i] : 0;
        for (uint32_t k = 0; k < self->order->courses[i].share_count; ++k) {
            const bool lets = is_in_the_way(self, i, &shares[k]);
            self->lets[i] |= lets ? (uint64_t)1 << shares[k].other : 0;
        }
        self->must[i] |= self->lets[i];
    }
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const vg_share* shares = shares_of(self, i);
        for (uint32_t k = 0; k < self->order->courses[i].share_count; ++k) {
            const uint32_t j = shares[k].other;
            if ((self->lets[j] >> i & 1u) == 0 && goes_first(self, i, &shares[k])) {
                self->must[i] |= (uint64_t)1 << j;
            }
        }
    }
}

// The order that a decision states for its vehicles and the others.
static void keep_passes(ranking* self, const verge_scene* scene, const verge_decision* decision)
{
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const verge_vehicle_decision* own =
            verge_decision_of(decision, scene->vehicles[self->model->input_index[i]].id);
        const vg_share* shares = shares_of(self, i);
        for (uint32_t k = 0; own != NULL && k < self->order->courses[i].share_count; ++k) {
            const uint32_t j = shares[k].other;
            const int32_t other = scene->vehicles[self->model->input_index[j]].id;
            for (uint32_t m = 0; m < own->pass_count && m < VERGE_PASSES_MAX; ++m) {
                self->must[i] |= own->passes[m].after_id == other ? (uint64_t)1 << j : 0;
            }
        }
    }
}

// ---------------------------------------------------------------------------- ranks

// Would the slot come to a ring in the way of one that has no rank yet?
static bool enters_in_the_way(const ranking* self, uint32_t slot, uint64_t left)
{
    return self->order->courses[slot].ring_enter < VG_FAR_AWAY && (self->lets[slot] & left) != 0;
}

// The next vehicle: the earliest one of those whose predecessors have a rank. Where facts
// contradict one another, none is left. On a full ring they always do, as each follows the next:
// the earliest of those that do not enter it in somebody's way is next. Else the earliest of all.
static uint32_t next_of(const ranking* self, uint64_t left)
{
    int32_t best = -1;
    uint32_t best_level = 0;
    for (uint64_t set = left; set != 0; set &= set - 1u) {
        const uint32_t i = (uint32_t)__builtin_ctzll(set);
        const uint32_t level = (self->must[i] & left) == 0          ? 2u
                               : !enters_in_the_way(self, i, left) ? 1u
                                                                   : 0u;
        if (best < 0 || level > best_level
            || (level == best_level && self->key[i] < self->key[best])) {
            best = (int32_t)i;
            best_level = level;
        }
    }
    VERGE_ASSERT(best >= 0);
    return (uint32_t)best;
}

static void select_ranks(ranking* self)
{
    const uint32_t count = self->model->count;
    uint64_t left = count == 64u ? ~(uint64_t)0 : ((uint64_t)1 << count) - 1u;
    for (uint8_t rank = 0; left != 0; ++rank) {
        const uint32_t i = next_of(self, left);
        self->order->rank[i] = rank;
        left &= ~((uint64_t)1 << i);
    }
}

// Since when does a vehicle that is not planned here stand though it is its turn?
static void count_patience(const ranking* self, const verge_scene* scene, verge_turns* turns)
{
    for (uint32_t i = 0; i < self->model->count; ++i) {
        const int32_t id = scene->vehicles[self->model->input_index[i]].id;
        verge_turn* turn = vg_turn_of(turns, id);
        if (turn == NULL || is_planned(self, i) || turn->standing != 0
            || self->flow->v[i] >= standing) {
            continue;
        }
        bool first = true;
        for (uint32_t k = 0; k < self->order->courses[i].share_count; ++k) {
            first = first && self->order->rank[shares_of(self, i)[k].other] > self->order->rank[i];
        }
        turn->standing = first ? scene->utime : 0;
    }
}

// Who has to wait for a planned vehicle, and goes first all the same?
static void note_doubts(const ranking* self, const verge_scene* scene, verge_turns* turns)
{
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const vg_share* shares = shares_of(self, i);
        for (uint32_t k = 0; k < self->order->courses[i].share_count; ++k) {
            const uint32_t j = shares[k].other;
            verge_turn* turn =
                vg_turn_of(turns, scene->vehicles[self->model->input_index[j]].id);
            const bool has_to =
                line_before(self, j, shares[k].other_enter) < VG_FAR_AWAY
                || has_to_wait(self->order, self->model, i, j, shares[k].enter,
                               shares[k].other_enter);
            if (turn != NULL && (self->lets[i] >> j & 1u) != 0 && has_to) {
                turn->doubted = true;
            }
        }
    }
}
