/// See order.h. Routes, areas and walls; the rank is made in rank.c.
#include "traffic/order.h"

#include "base/contract.h"
#include "traffic/belief.h"
#include "traffic/pairs.h"

#include <string.h>

// Areas whose entry is nearer than this, or than this time at the present speed, are ordered.
static const float scope_distance = 60.0f; // [m]
static const float scope_time = 8.0f;      // [s]
// Routes are known this far beyond the scope: the room behind a crossing lies there. [m]
static const float route_beyond = 60.0f;
// Free distance between standing vehicles. [m]
static const float standing_gap = 2.0f;
// Slower vehicles may stand when one arrives behind them. [m/s]
static const float slow = 2.0f;
// A vehicle follows one on a lane that merges by this time. [s]
static const float merge_headway = 0.6f;
// A vehicle that would have to brake harder drives through. [m/s^2]
static const float braking_last = 8.0f;
// A box that is full binds vehicles that can still stop with this. [m/s^2]
static const float braking_box = 3.0f;

// A planned vehicle enters a crossing this long after one that is not planned has left it, with the
// acceleration from the line. [s], [m/s^2]
static const float behind_others = 1.0f, starting = 1.5f;
// Where lanes lead to a ring at a larger angle, a nose crosses the path of the body that goes
// first, and comes this long after it, if that one is planned. Cosine of 0.5 rad. [1], [s]
static const double steep_cosine = 0.87758;
static const float behind_planned = 0.5f;

static_assert(VERGE_VEHICLES_MAX <= 255 && VG_SHARES_MAX <= 255 && VG_LEGS_MAX <= 255,
              "slots, ranks and counts are bytes");

static void find_courses(vg_order* self, const vg_model* model, const vg_flow* flow,
                         const verge_scene* scene, verge_turns* turns);
static void find_shares(vg_order* self, const vg_model* model, const vg_flow* flow);
static void bind(vg_order* self, const vg_model* model);

// ---------------------------------------------------------------------------- memory

void vg_order_take(vg_order* self, vg_arena* arena, uint32_t vehicles_max)
{
    // As many as there can be, so no result depends on the room for more vehicles.
    const uint32_t of_all = VG_PAIR_SHARES_MAX * (vehicles_max - 1u);
    const uint32_t shares_max = of_all < VG_SHARES_MAX ? of_all : VG_SHARES_MAX;
    const vg_order taken = {
        .vehicles_max = vehicles_max,
        .shares_max = shares_max,
        .courses = vg_arena_take(arena, vehicles_max * sizeof *taken.courses),
        .shares = vg_arena_take(arena, (size_t)vehicles_max * shares_max * sizeof *taken.shares),
        .before = vg_arena_take(arena, vehicles_max * sizeof *taken.before),
        .cedes = vg_arena_take(arena, vehicles_max * sizeof *taken.cedes),
        .rank = vg_arena_take(arena, vehicles_max * sizeof *taken.rank),
        .insists = vg_arena_take(arena, vehicles_max * sizeof *taken.insists),
        .through = vg_arena_take(arena, VERGE_LANES_NEAR_MAX * sizeof *taken.through),
    };
    if (self != NULL) {
        *self = taken;
    }
}

// Is there anything to order?
static bool has_areas(const vg_model* model, const vg_flow* flow, const verge_scene* scene)
{
    const verge_road* road = model->road;
    bool found = road->has_successors || road->conflicts_from[road->lane_count] > 0
                 || scene->signal_count > 0;
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        const vg_lane* lane = &road->lanes[flow->lane[slot]];
        found = found || lane->priority == VERGE_PRIORITY_STOP
                || (slot < model->controlled_count && lane->dead_end);
    }
    return found;
}

static void find_insisting(vg_order* self, const vg_model* model, const verge_scene* scene,
                           const verge_beliefs* beliefs)
{
    for (uint32_t slot = model->controlled_count; slot < model->count; ++slot) {
        const verge_belief* belief =
            vg_belief_of(beliefs, scene->vehicles[model->input_index[slot]].id);
        self->insists[slot] = belief != NULL ? belief->weights[VERGE_INSISTS] : 0.0f;
    }
}

static void order_scene(vg_order* self, vg_model* model, const vg_flow* flow,
                        const verge_scene* scene, verge_turns* turns, verge_beliefs* beliefs,
                        const verge_decision* decision)
{
    VERGE_ASSERT(model->count <= self->vehicles_max);
    model->order = self;
    self->slots = 0;
    self->reordered = self->unstuck = 0;
    self->blocked = self->helped = self->signs = 0;
    self->believes = beliefs != NULL;
    memset(self->insists, 0, model->count * sizeof self->insists[0]);
    if (!has_areas(model, flow, scene)) {
        if (beliefs != NULL) {
            vg_belief_update(beliefs, model, flow, scene, NULL);
        }
        if (turns != NULL) {
            turns->count = 0;
        }
        return;
    }
    find_courses(self, model, flow, scene, turns);
    find_shares(self, model, flow);
    vg_order_zip(self, model, flow);
    if (beliefs != NULL) {
        vg_belief_update(beliefs, model, flow, scene, self);
        find_insisting(self, model, scene, beliefs);
    }
    vg_order_rank(self, model, flow, scene, turns, decision);
    bind(self, model);
    self->slots = model->count;
    if (turns != NULL && !self->of_humans) {
        vg_order_watch(self, model, flow, scene, turns);
    }
}

void vg_order_from(vg_order* self, vg_model* model, const vg_flow* flow, const verge_scene* scene,
                   verge_turns* turns, verge_beliefs* beliefs)
{
    order_scene(self, model, flow, scene, turns, beliefs, NULL);
}

void vg_order_decided(vg_order* self, vg_model* model, const vg_flow* flow,
                      const verge_scene* scene, const verge_decision* decision)
{
    order_scene(self, model, flow, scene, NULL, NULL, decision);
}

// ---------------------------------------------------------------------------- routes

static bool can_stop(float v, float distance, float braking)
{
    return v * v <= 2.0f * braking * vg_maxf(distance, 0.0f);
}

static float scope_of(const vg_flow* flow, uint32_t slot)
{
    return vg_maxf(scope_distance, scope_time * flow->v[slot]);
}

static void add_leg(vg_course* course, const vg_lane* lane, int32_t index, float begin)
{
    const float stations = (float)(lane->station_end - lane->station_start);
    const float scale = (float)lane->length / vg_maxf(stations, 1e-3f);
    course->legs[course->leg_count++] = (vg_route_leg){
        .lane = index, .begin = begin - (float)lane->station_start * scale, .scale = scale,
    };
}

static const vg_route_leg* leg_of(const vg_course* course, int32_t lane)
{
    for (uint32_t k = 0; k < course->leg_count; ++k) {
        if (course->legs[k].lane == lane) {
            return &course->legs[k];
        }
    }
    return NULL;
}

// The lanes ahead of a slot. A ring is followed once.
static void find_route(vg_course* course, const vg_model* model, const vg_flow* flow,
                       uint32_t slot)
{
    const verge_road* road = model->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const int32_t target = slot < model->controlled_count ? model->target[slot] : -1;
    const float reach = scope_of(flow, slot) + route_beyond;
    add_leg(course, &road->lanes[lane], (int32_t)lane, 0.0f);
    course->legs[0].begin -= vg_on_leg(&course->legs[0], flow->station[slot]);
    float end = vg_on_leg(&course->legs[0], (float)road->lanes[lane].station_end);
    for (vg_walk walk = vg_walk_from(road, lane, target); end < reach && vg_walk_on(&walk);) {
        if (leg_of(course, (int32_t)walk.lane) != NULL) {
            break;
        }
        add_leg(course, &road->lanes[walk.lane], (int32_t)walk.lane, end);
        end += (float)road->lanes[walk.lane].length;
    }
}

static bool on_one_ring(const vg_model* model, uint32_t a, uint32_t b)
{
    return vg_local_ring(model->pairs->local, a, b) > 0.0f;
}

// Where the route joins a ring from outside: where bodies could first touch those on it.
static void find_ring(vg_course* course, const vg_model* model)
{
    const verge_road* road = model->road;
    course->ring_enter = VG_FAR_AWAY;
    for (uint32_t k = 1; model->rings && k < course->leg_count; ++k) {
        const uint32_t lane = (uint32_t)course->legs[k].lane;
        const uint32_t before = (uint32_t)course->legs[k - 1u].lane;
        if (!on_one_ring(model, lane, lane) || on_one_ring(model, before, before)) {
            continue;
        }
        course->ring_enter = vg_leg_start(&course->legs[k], road);
        course->ring_lane = (int32_t)lane;
        for (uint32_t m = road->merges_from[before]; m < road->merges_from[before + 1u]; ++m) {
            if (on_one_ring(model, lane, road->merges[m].other)) {
                const float touch = vg_on_leg(&course->legs[k - 1u], road->merges[m].touch);
                course->ring_enter = vg_minf(course->ring_enter, touch);
            }
        }
        break;
    }
}

static void add_box(vg_course* course, vg_box box, float room)
{
    vg_box* last = course->box_count > 0 ? &course->boxes[course->box_count - 1u] : NULL;
    if (last != NULL && box.enter < last->leave + room) {
        if (box.leave > last->leave) {
            last->leave = box.leave;
            last->exit_lane = box.exit_lane;
        }
    } else if (course->box_count < VG_BOXES_MAX) {
        course->boxes[course->box_count++] = box;
    }
}

// The nearest crossing of a lane that begins beyond a station. They are stored by the other lane.
static const vg_conflict* next_crossing(const verge_road* road, uint32_t lane, float beyond)
{
    const vg_conflict* next = NULL;
    for (uint32_t c = road->conflicts_from[lane]; c < road->conflicts_from[lane + 1u]; ++c) {
        const vg_conflict* area = &road->conflicts[c];
        if (!area->parts && area->from > beyond && (next == NULL || area->from < next->from)) {
            next = area;
        }
    }
    return next;
}

static void find_boxes(vg_course* course, const verge_road* road, float half)
{
    const float room = 2.0f * half + standing_gap;
    for (uint32_t k = 0; k < course->leg_count; ++k) {
        const vg_route_leg* leg = &course->legs[k];
        const uint32_t lane = (uint32_t)leg->lane;
        for (const vg_conflict* area = next_crossing(road, lane, -VG_FAR_AWAY); area != NULL;
             area = next_crossing(road, lane, area->from)) {
            const float enter = vg_on_leg(leg, area->from), leave = vg_on_leg(leg, area->to);
            if (leave > -half) {
                add_box(course, (vg_box){ enter, leave, leg->lane }, room);
            }
        }
    }
}

static void find_courses(vg_order* self, const vg_model* model, const vg_flow* flow,
                         const verge_scene* scene, verge_turns* turns)
{
    const vg_local* local = model->pairs->local;
    memset(self->through, 0, VERGE_LANES_NEAR_MAX * sizeof self->through[0]);
    memset(self->before, 0, model->count * sizeof self->before[0]);
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        vg_course* course = &self->courses[slot];
        memset(course, 0, sizeof *course);
        find_route(course, model, flow, slot);
        vg_order_find_stops(self, model, flow, scene, slot, turns);
        find_ring(course, model);
        find_boxes(course, model->road, model->half_length[slot]);
        for (uint32_t k = 0; k < course->leg_count; ++k) {
            const uint32_t place = local->place[course->legs[k].lane];
            if (place != VG_NOT_LOCAL) {
                self->through[place] |= (uint64_t)1 << slot;
            }
        }
    }
}

// Position on a route of a place on one of its lanes, or on a lane beside one.
static float position_on(const vg_course* course, const verge_road* road, int32_t lane,
                         float station)
{
    const vg_route_leg* leg = leg_of(course, lane);
    for (uint32_t k = 0; leg == NULL && k < course->leg_count; ++k) {
        if (road->lanes[course->legs[k].lane].bundle == road->lanes[lane].bundle) {
            leg = &course->legs[k];
        }
    }
    return leg != NULL ? vg_on_leg(leg, station) : -VG_FAR_AWAY;
}

float vg_order_position(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    VERGE_ASSERT(slot < model->count);
    return position_on(&model->order->courses[slot], model->road, flow->lane[slot],
                       flow->station[slot]);
}

// ---------------------------------------------------------------------------- shared areas

// The area that a new one with slot `other` takes the place of: the farthest with this slot if
// there are VG_PAIR_SHARES_MAX, else the farthest of all if there is no room, else the end.
static uint32_t replaced_share(const vg_order* self, uint32_t slot, uint32_t other)
{
    const uint32_t count = self->courses[slot].share_count;
    const vg_share* shares = &self->shares[slot * self->shares_max];
    uint32_t with_other = 0, farthest = count;
    for (uint32_t k = 0; k < count; ++k) {
        if (shares[k].other == other) {
            farthest = k;
            ++with_other;
        }
    }
    if (with_other == VG_PAIR_SHARES_MAX) {
        return farthest;
    }
    return count == self->shares_max ? count - 1u : count;
}

void vg_order_share(vg_order* self, uint32_t slot, const vg_share* share)
{
    vg_course* course = &self->courses[slot];
    vg_share* shares = &self->shares[slot * self->shares_max];
    VERGE_ASSERT(self->shares_max > 0); // there is another vehicle
    uint32_t at = replaced_share(self, slot, share->other);
    if (at < course->share_count) {
        if (shares[at].enter <= share->enter) {
            return;
        }
    } else {
        ++course->share_count;
    }
    for (; at > 0 && shares[at - 1u].enter > share->enter; --at) {
        shares[at] = shares[at - 1u];
    }
    shares[at] = *share;
}

// Adds an area to both slots, as slot i sees it.
static void share(vg_order* self, const vg_model* model, const vg_flow* flow, uint32_t i,
                  const vg_share* area)
{
    const uint32_t j = area->other;
    if (area->leave < -model->half_length[i] || area->other_leave < -model->half_length[j]
        || area->enter > scope_of(flow, i) || area->other_enter > scope_of(flow, j)) {
        return;
    }
    const vg_share back = {
        .enter = area->other_enter, .leave = area->other_leave,
        .other_enter = area->enter, .other_leave = area->leave,
        .lane = area->other_lane, .other_lane = area->lane,
        .other = (uint8_t)i, .kind = area->kind, .steep = area->steep,
    };
    vg_order_share(self, i, area);
    vg_order_share(self, j, &back);
}

// Lanes that part are like a crossing for vehicles that come from different lanes.
static uint8_t kind_of(const vg_order* self, const vg_conflict* area, uint32_t i, uint32_t j,
                       const vg_route_leg* leg, const vg_route_leg* other)
{
    const bool first_i = leg == self->courses[i].legs, first_j = other == self->courses[j].legs;
    const bool same = first_i || first_j || leg[-1].lane == other[-1].lane;
    return area->parts && same ? VG_SHARE_PART : VG_SHARE_CROSS;
}

// Crossings of one lane of the route of slot i with the routes of the slots after it.
static void find_crossings(vg_order* self, const vg_model* model, const vg_flow* flow, uint32_t i,
                           const vg_route_leg* leg)
{
    const verge_road* road = model->road;
    const vg_local* local = model->pairs->local;
    const uint32_t lane = (uint32_t)leg->lane;
    for (uint32_t c = road->conflicts_from[lane]; c < road->conflicts_from[lane + 1u]; ++c) {
        const vg_conflict* area = &road->conflicts[c];
        const uint32_t place = local->place[area->other];
        if (place == VG_NOT_LOCAL) {
            continue;
        }
        for (uint64_t set = self->through[place] >> i >> 1; set != 0; set &= set - 1u) {
            const uint32_t j = i + 1u + (uint32_t)__builtin_ctzll(set);
            const vg_route_leg* other = leg_of(&self->courses[j], area->other);
            const vg_share found = {
                .enter = vg_on_leg(leg, area->from), .leave = vg_on_leg(leg, area->to),
                .other_enter = vg_on_leg(other, area->other_from),
                .other_leave = vg_on_leg(other, area->other_to),
                .lane = (uint16_t)lane, .other_lane = area->other,
                .other = (uint8_t)j, .kind = kind_of(self, area, i, j, leg, other),
            };
            share(self, model, flow, i, &found);
        }
    }
}

// Station of lane `a` from which bodies on it can touch those on `b`; both lead to one lane.
static float touch_of(const verge_road* road, uint32_t a, uint32_t b)
{
    for (uint32_t m = road->merges_from[a]; m < road->merges_from[a + 1u]; ++m) {
        if (road->merges[m].other == b) {
            return road->merges[m].touch;
        }
    }
    return (float)road->lanes[a].station_end;
}

// Do bodies on two lanes that lead to a ring meet at an angle where they could begin to touch? In a
// crossing nobody waits for that: there they would be in the way of others.
static bool is_steep(const vg_model* model, uint32_t a, uint32_t b, uint32_t common)
{
    const vg_lane *on_a = &model->road->lanes[a], *on_b = &model->road->lanes[b];
    const double touch_a = (double)touch_of(model->road, a, b);
    const double touch_b = (double)touch_of(model->road, b, a);
    const vg_reference at_a = vg_lane_at(on_a, vg_lane_s(on_a, touch_a));
    const vg_reference at_b = vg_lane_at(on_b, vg_lane_s(on_b, touch_b));
    return on_one_ring(model, common, common)
           && at_a.cos_heading * at_b.cos_heading + at_a.sin_heading * at_b.sin_heading
                  < steep_cosine;
}

// The first lane that two routes have in common, where both come to it from different lanes.
static void find_merge(vg_order* self, const vg_model* model, const vg_flow* flow, uint32_t i,
                       uint32_t j)
{
    const vg_course *own = &self->courses[i], *others = &self->courses[j];
    for (uint32_t p = 0; p < own->leg_count; ++p) {
        const vg_route_leg* there = leg_of(others, own->legs[p].lane);
        if (there == NULL) {
            continue;
        }
        if (p == 0 || there == others->legs) {
            return; // one of them is on it: the other follows
        }
        const uint32_t a = (uint32_t)own->legs[p - 1u].lane, b = (uint32_t)there[-1].lane;
        const vg_share found = {
            .enter = vg_on_leg(&own->legs[p - 1u], touch_of(model->road, a, b)),
            .leave = vg_leg_start(&own->legs[p], model->road),
            .other_enter = vg_on_leg(&there[-1], touch_of(model->road, b, a)),
            .other_leave = vg_leg_start(there, model->road),
            .lane = (uint16_t)a, .other_lane = (uint16_t)b,
            .other = (uint8_t)j, .kind = VG_SHARE_MERGE,
            .steep = is_steep(model, a, b, (uint32_t)own->legs[p].lane),
        };
        share(self, model, flow, i, &found);
        return;
    }
}

static void find_shares(vg_order* self, const vg_model* model, const vg_flow* flow)
{
    const vg_local* local = model->pairs->local;
    for (uint32_t i = 0; i < model->count; ++i) {
        const vg_course* course = &self->courses[i];
        uint64_t meets = 0;
        for (uint32_t k = 0; k < course->leg_count; ++k) {
            find_crossings(self, model, flow, i, &course->legs[k]);
            const uint32_t place = local->place[course->legs[k].lane];
            meets |= k > 0 && place != VG_NOT_LOCAL ? self->through[place] : 0;
        }
        for (uint64_t set = meets >> i >> 1; set != 0; set &= set - 1u) {
            find_merge(self, model, flow, i, i + 1u + (uint32_t)__builtin_ctzll(set));
        }
    }
}

// Once the rank is known: shares with lower ranks first, and the sets of slots.
static void bind(vg_order* self, const vg_model* model)
{
    for (uint32_t i = 0; i < model->count; ++i) {
        vg_course* course = &self->courses[i];
        vg_share* shares = &self->shares[i * self->shares_max];
        self->before[i] = self->cedes[i] = 0;
        for (uint32_t k = 0; k < course->share_count; ++k) {
            const vg_share found = shares[k];
            const uint64_t bit = (uint64_t)1 << found.other;
            if (self->rank[found.other] > self->rank[i]) {
                self->cedes[i] |= found.kind == VG_SHARE_MERGE ? bit : 0;
                continue;
            }
            self->before[i] |= bit;
            for (uint32_t m = k; m > course->bind_count; --m) {
                shares[m] = shares[m - 1u];
            }
            shares[course->bind_count++] = found;
        }
    }
}

// ---------------------------------------------------------------------------- walls

// Takes the wall at `at`, where the front of the slot waits, if it is the nearest.
static void take_wall(vg_wall* wall, float at, float r, verge_why why, int32_t slot, int32_t lane)
{
    const float distance = at - r;
    if (distance < wall->distance) {
        *wall = (vg_wall){ distance, why, slot, lane, VG_FAR_AWAY };
    }
}

// Time until the front of the slot is at an area, with the acceleration from the line. [s]
static float time_to_area(const vg_model* model, const vg_flow* flow, uint32_t slot,
                          const vg_share* area, float r)
{
    const float v = flow->v[slot], a = starting;
    const float gap = vg_maxf(area->enter - r - model->half_length[slot], 0.0f);
    return (__builtin_sqrtf(v * v + 2.0f * a * gap) - v) / a;
}

// How far beyond an area the other vehicle has to be, for this slot to enter it: one that is not
// planned is given some time. [m]
static float beyond_area(const vg_model* model, const vg_flow* flow, uint32_t slot,
                         const vg_share* area, float r)
{
    const uint32_t j = area->other;
    if (slot >= model->controlled_count || j < model->controlled_count) {
        return 0.0f;
    }
    const float arrives = time_to_area(model, flow, slot, area, r);
    return vg_maxf(flow->v[j], 0.0f) * vg_maxf(behind_others - arrives, 0.0f);
}

// Where lanes merge at an angle: would the front of the slot come too soon behind the rear of the
// other vehicle, which is there on its route? A slot that would have to brake hard goes on.
static bool comes_too_soon(const vg_model* model, const vg_flow* flow, uint32_t slot,
                           const vg_share* area, float r, float rear)
{
    const float v = vg_maxf(flow->v[area->other], 0.0f);
    const float apart = area->other < model->controlled_count ? behind_planned : behind_others;
    const float then = rear + v * (time_to_area(model, flow, slot, area, r) - apart);
    return area->steep && then < area->enter
           && can_stop(flow->v[slot], area->enter - VG_STOP_BEFORE - r - model->half_length[slot],
                       braking_box);
}

// Position where the front of the slot waits because of an area: before its entry. Where lanes
// merge or part, it may follow the one that goes first beyond the entry: up to where that one would
// stop. VG_FAR_AWAY: the vehicle that goes first has left the area.
static float line_of(const vg_model* model, const vg_flow* flow, uint32_t slot,
                     const vg_share* area, float r)
{
    const uint32_t j = area->other;
    const float other = vg_order_position(model, flow, j);
    const float line = area->enter - vg_share_margin(area);
    if (other == -VG_FAR_AWAY) {
        return VG_FAR_AWAY;
    }
    if (area->kind == VG_SHARE_CROSS) {
        const float left = area->other_leave + beyond_area(model, flow, slot, area, r);
        return other - model->half_length[j] > left ? VG_FAR_AWAY : line;
    }
    const bool parts = area->kind == VG_SHARE_PART;
    if (parts ? other - model->half_length[j] > area->other_leave : other > area->other_leave) {
        return VG_FAR_AWAY; // it has parted, or is the leader on the common lane
    }
    // Positions beyond the end, or before the begin, of the common lane.
    const float ahead = parts ? (other - area->other_enter) - (r - area->enter)
                              : (area->leave - r) - (area->other_leave - other);
    if (parts && (ahead <= 0.0f || other < area->other_enter)) {
        return VG_FAR_AWAY; // it is behind, or still on the common lane, where it is the leader
    }
    const float v = vg_maxf(flow->v[j], 0.0f), own = flow->v[slot];
    const float rear = r + ahead - model->half_length[j] - standing_gap;
    const float until = (area->enter - r - model->half_length[slot]) / vg_maxf(own, 1.0f);
    if (!parts && (rear - r - model->half_length[slot] + (v - own) * until < 0.0f
                   || comes_too_soon(model, flow, slot, area, r, rear))) {
        return line; // it would still be beside, or close ahead
    }
    const float stops = rear + vg_order_stopping(model, v) - merge_headway * own;
    return parts ? stops : vg_maxf(line, stops);
}

static void wall_of_shares(const vg_model* model, const vg_flow* flow, uint32_t slot, float r,
                           vg_wall* wall)
{
    const vg_order* order = model->order;
    const vg_share* shares = &order->shares[slot * order->shares_max];
    const float front = r + model->half_length[slot];
    for (uint32_t k = 0; k < order->courses[slot].bind_count; ++k) {
        const vg_share* area = &shares[k];
        if (area->kind == VG_SHARE_ZIP) {
            const float distance = vg_order_zip_wall(model, flow, slot, area->other);
            if (distance < wall->distance) {
                *wall = (vg_wall){ distance, VERGE_WHY_MERGE, (int32_t)area->other,
                                   (int32_t)area->other_lane, VG_FAR_AWAY };
            }
        } else if (area->kind == VG_SHARE_PART
                   || (front < area->enter
                       && area->enter - VG_STOP_BEFORE_MERGE - r < wall->distance
                       && can_stop(flow->v[slot], area->enter - front, braking_last))) {
            static const verge_why whys[] = { VERGE_WHY_AREA, VERGE_WHY_MERGE, VERGE_WHY_LEADER };
            take_wall(wall, line_of(model, flow, slot, area, r), r, whys[area->kind],
                      (int32_t)area->other, (int32_t)area->other_lane);
        }
    }
}

// Free distance behind the box for the slot, less what others ahead of it will take, and the
// vehicle that stands there.
static float room_behind(const vg_order* order, const vg_model* model, const vg_flow* flow,
                         uint32_t slot, float r, const vg_box* box, int32_t* last)
{
    const vg_course* course = &order->courses[slot];
    float ahead[VERGE_VEHICLES_MAX], end = VG_FAR_AWAY, taken = 0.0f;
    *last = -1;
    for (uint32_t k = 0; k < model->count; ++k) {
        const vg_route_leg* leg = k != slot ? leg_of(course, flow->lane[k]) : NULL;
        const float at = leg != NULL ? vg_on_leg(leg, flow->station[k]) : -VG_FAR_AWAY;
        const float half = model->half_length[k];
        ahead[k] = at;
        if (at > r && at + half > box->enter && flow->v[k] < slow && at - half < end) {
            end = at - half;
            *last = (int32_t)k;
        }
    }
    for (uint32_t k = 0; *last >= 0 && k < model->count; ++k) {
        if (ahead[k] > r && ahead[k] < end) {
            taken += 2.0f * model->half_length[k] + standing_gap;
        }
    }
    const vg_share* shares = &order->shares[slot * order->shares_max];
    for (uint32_t k = 0; *last >= 0 && k < course->bind_count; ++k) {
        const uint32_t j = shares[k].other;
        if (shares[k].kind == VG_SHARE_MERGE && ahead[j] == -VG_FAR_AWAY) {
            taken += 2.0f * model->half_length[j] + standing_gap;
        }
    }
    return end - box->leave - taken;
}

bool vg_order_has_room(const vg_order* self, const vg_model* model, const vg_flow* flow,
                       uint32_t slot)
{
    const vg_course* course = &self->courses[slot];
    const vg_box* box = &course->boxes[0];
    const float half = model->half_length[slot];
    int32_t last = -1;
    return course->box_count == 0 || box->enter - half < 0.0f
           || room_behind(self, model, flow, slot, 0.0f, box, &last) >= 2.0f * half + standing_gap;
}

static void wall_of_boxes(const vg_model* model, const vg_flow* flow, uint32_t slot, float r,
                          vg_wall* wall)
{
    const vg_course* course = &model->order->courses[slot];
    const float half = model->half_length[slot], v = flow->v[slot];
    uint32_t k = 0; // boxes that it is in already, or has left, bind no more; then the nearest does
    while (k < course->box_count
           && course->boxes[k].enter - VG_STOP_BEFORE - r - half + VG_STOP_BEFORE < 0.0f) {
        ++k;
    }
    if (k == course->box_count) {
        return;
    }
    const vg_box* box = &course->boxes[k];
    const float line = box->enter - VG_STOP_BEFORE, gap = line - r - half;
    const float needed = 2.0f * half + standing_gap;
    int32_t last = -1;
    if (line - r < wall->distance && can_stop(v, gap + VG_STOP_BEFORE, braking_box)
        && gap < v * v + scope_distance
        && room_behind(model->order, model, flow, slot, r, box, &last) < needed) {
        take_wall(wall, line, r, VERGE_WHY_EXIT, last, box->exit_lane);
    }
}

// A ring keeps a free place of one vehicle when the slot has entered.
static void wall_of_ring(const vg_model* model, const vg_flow* flow, uint32_t slot, float r,
                         vg_wall* wall)
{
    const vg_course* course = &model->order->courses[slot];
    const float half = model->half_length[slot];
    const float gap = course->ring_enter - VG_STOP_BEFORE - r - half;
    if (course->ring_enter >= VG_FAR_AWAY || gap + VG_STOP_BEFORE < 0.0f || gap > scope_distance) {
        return;
    }
    const uint32_t lane = (uint32_t)course->ring_lane;
    float taken = 2.0f * (2.0f * half + standing_gap); // itself, and the free place
    int32_t last = -1;
    for (uint32_t k = 0; k < model->count; ++k) {
        if (k != slot && on_one_ring(model, lane, (uint32_t)flow->lane[k])) {
            taken += 2.0f * model->half_length[k] + standing_gap;
            last = (int32_t)k;
        }
    }
    const float ring = vg_local_ring(model->pairs->local, lane, lane);
    if (taken > ring && last >= 0) {
        take_wall(wall, course->ring_enter - VG_STOP_BEFORE, r, VERGE_WHY_EXIT, last,
                  course->ring_lane);
    }
}

// signals: with those of the route.
static vg_wall find_wall(const vg_model* model, const vg_flow* flow, uint32_t slot, bool signals)
{
    vg_wall wall = { VG_FAR_AWAY, VERGE_WHY_NONE, -1, -1, VG_FAR_AWAY };
    const vg_order* order = model->order;
    if (order == NULL || order->slots == 0) {
        return wall;
    }
    VERGE_ASSERT(slot < order->slots && order->slots == model->count);
    const vg_course* course = &order->courses[slot];
    const bool free = course->bind_count == 0 && course->box_count == 0
                      && course->ring_enter >= VG_FAR_AWAY && course->light_count == 0
                      && course->sign >= VG_FAR_AWAY;
    const vg_route_leg* leg = free ? NULL : leg_of(course, flow->lane[slot]);
    if (leg == NULL || (model->lawless >> slot & 1u) != 0) {
        return wall;
    }
    const float r = vg_on_leg(leg, flow->station[slot]);
    wall_of_shares(model, flow, slot, r, &wall);
    wall_of_boxes(model, flow, slot, r, &wall);
    wall_of_ring(model, flow, slot, r, &wall);
    vg_order_stop_wall(model, flow, slot, r, signals, &wall);
    return wall;
}

vg_wall vg_order_wall_why(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return find_wall(model, flow, slot, true);
}

float vg_order_wall_beyond(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return find_wall(model, flow, slot, false).distance;
}

float vg_order_wall(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return vg_order_wall_why(model, flow, slot).distance;
}

bool vg_order_conflict(const vg_model* model, const vg_flow* flow, const float* station1,
                       uint32_t i)
{
    const vg_order* order = model->order;
    if (order == NULL || order->slots == 0) {
        return false;
    }
    const vg_course* course = &order->courses[i];
    const vg_route_leg* leg = course->bind_count > 0 ? leg_of(course, flow->lane[i]) : NULL;
    const vg_share* shares = &order->shares[i * order->shares_max];
    const float half = model->half_length[i];
    for (uint32_t k = 0; leg != NULL && k < course->bind_count; ++k) {
        const vg_share* area = &shares[k];
        const uint32_t j = area->other;
        const float from = vg_on_leg(leg, flow->station[i]), to = vg_on_leg(leg, station1[i]);
        if (area->kind != VG_SHARE_CROSS || from + half > area->enter || to + half <= area->enter) {
            continue;
        }
        const float before = position_on(&order->courses[j], model->road, flow->lane[j],
                                         flow->station[j]);
        const float after = position_on(&order->courses[j], model->road, flow->lane[j],
                                        station1[j]);
        const float reach = model->half_length[j];
        if (after + reach > area->other_enter && before - reach < area->other_leave) {
            return true;
        }
    }
    return false;
}

// ---------------------------------------------------------------------------- report

verge_cause vg_order_reason(const vg_model* model, const vg_flow* flow, const verge_scene* scene,
                            uint32_t slot)
{
    static const float near = 3.0f, soon_s = 1.0f, braking = 1.5f; // [m], [s], [m/s^2]
    verge_cause cause = { .vehicle_id = -1, .lane_id = VERGE_NO_LANE };
    const vg_order* order = model->order;
    if (order == NULL || order->slots == 0) {
        return cause;
    }
    const vg_wall wall = vg_order_wall_why(model, flow, slot);
    const float v = flow->v[slot], gap = wall.distance - model->half_length[slot];
    if ((order->blocked >> slot & 1u) != 0) {
        cause.code = VERGE_WHY_BLOCKED;
    } else if (gap < near + soon_s * v + v * v / (2.0f * braking)) {
        const bool yields = wall.why == VERGE_WHY_AREA
                            && vg_order_yields(order, model, slot, wall.distance + VG_STOP_BEFORE);
        cause.code = yields ? VERGE_WHY_YIELD : wall.why;
    }
    if (cause.code != VERGE_WHY_NONE && wall.slot >= 0) {
        cause.vehicle_id = scene->vehicles[model->input_index[wall.slot]].id;
    }
    if (cause.code != VERGE_WHY_NONE && wall.lane >= 0) {
        cause.lane_id = model->road->lanes[wall.lane].id;
    }
    return cause;
}

uint32_t vg_order_passes(const vg_model* model, const verge_scene* scene, uint32_t slot,
                         verge_pass passes[VERGE_PASSES_MAX])
{
    const vg_order* order = model->order;
    uint32_t count = 0;
    if (order == NULL || order->slots == 0) {
        return 0;
    }
    const vg_share* shares = &order->shares[slot * order->shares_max];
    for (uint32_t k = 0; k < order->courses[slot].bind_count && count < VERGE_PASSES_MAX; ++k) {
        const vg_share* area = &shares[k];
        const verge_pass pass = {
            .lane_id = model->road->lanes[area->lane].id,
            .other_lane_id = model->road->lanes[area->other_lane].id,
            .after_id = scene->vehicles[model->input_index[area->other]].id,
        };
        bool latest = true; // of several vehicles on one lane the last one is named
        for (uint32_t m = 0; m < order->courses[slot].bind_count; ++m) {
            latest = latest
                     && !(shares[m].lane == area->lane && shares[m].other_lane == area->other_lane
                          && order->rank[shares[m].other] > order->rank[area->other]);
        }
        bool listed = false;
        for (uint32_t m = 0; m < count; ++m) {
            listed = listed || (passes[m].lane_id == pass.lane_id
                                && passes[m].other_lane_id == pass.other_lane_id);
        }
        if (latest && !listed) {
            passes[count++] = pass;
        }
    }
    return count;
}
