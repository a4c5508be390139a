/// See local.h.
#include "road/local.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <assert.h>
#include <string.h>

static_assert(VERGE_LANES_NEAR_MAX >= 8 && VERGE_LANES_NEAR_MAX <= 64,
              "near lanes are 64-bit sets");

// Distances along the graph at which lanes are near. [m]
static const double near_max = 700.0;         // horizon of the search at motorway speed
static const double uncontrolled_from = 300.0; // beyond the lanes around controlled vehicles
static const double aside = 5.0;              // to a lane beside
static const double across = 10.0;            // to a lane that crosses or merges
// Distances from a vehicle to the ends of its lane are rounded to whole steps, so that the near
// lanes stay the same over some cycles. [m]
static const double distance_step = 50.0;

enum { NO_TARGET = -1, FREE = -2 };
// An on-vehicle unit has few vehicles and little memory, so fewer lanes are near. A crossing of
// four arms has 20.
enum { few_vehicles = 16, few_lanes = 24 };

static void choose_lanes(vg_local* self, const struct verge_road* road, const vg_source* sources,
                         uint32_t count);
static void relate(vg_local* self, const struct verge_road* road);
static void find_after(vg_local* self, const struct verge_road* road);
static void find_matters(vg_local* self, uint32_t column);

static size_t lanes_of(uint32_t lane_count)
{
    return lane_count > 0 ? lane_count : VERGE_LANES_MAX;
}

static size_t capacity_for(uint32_t lane_count, uint32_t vehicles)
{
    const size_t wanted = vehicles <= few_vehicles ? few_lanes : VERGE_LANES_NEAR_MAX;
    const size_t most = wanted < VERGE_LANES_NEAR_MAX ? wanted : VERGE_LANES_NEAR_MAX;
    const size_t lanes = lanes_of(lane_count);
    return lanes < most ? lanes : most;
}

vg_local* vg_local_take(vg_arena* arena, uint32_t lane_count, uint32_t vehicles, uint32_t targets)
{
    const size_t columns = targets + 1u, capacity = capacity_for(lane_count, vehicles);
    vg_local* self = vg_arena_take(arena, sizeof *self);
    vg_local taken = {
        .capacity = (uint32_t)capacity,
        .lanes = vg_arena_take(arena, capacity * sizeof *taken.lanes),
        .place = vg_arena_take(arena, lanes_of(lane_count) * sizeof *taken.place),
        .links = vg_arena_take(arena, capacity * capacity * sizeof *taken.links),
        .kinds = vg_arena_take(arena, capacity * capacity * sizeof *taken.kinds),
        .ring = vg_arena_take(arena, capacity * sizeof *taken.ring),
        .after = vg_arena_take(arena, capacity * sizeof *taken.after),
        .columns = (uint32_t)columns,
        .targets = vg_arena_take(arena, columns * sizeof *taken.targets),
        .used = vg_arena_take(arena, columns * sizeof *taken.used),
        .matters = vg_arena_take(arena, columns * capacity * sizeof *taken.matters),
    };
    if (self == NULL || arena->failed) {
        return NULL;
    }
    *self = taken;
    return self;
}

void vg_local_take_scratch(vg_local* self, vg_arena* arena, uint32_t lane_count, uint32_t vehicles)
{
    const size_t capacity = capacity_for(lane_count, vehicles);
    vg_local measured = { .capacity = 0 };
    vg_local* to = self != NULL ? self : &measured;
    to->distance = vg_arena_take(arena, lanes_of(lane_count) * sizeof *to->distance);
    to->downstream = vg_arena_take(arena, capacity * capacity * sizeof *to->downstream);
    vg_reach_take(&to->reach, arena, (uint32_t)capacity);
    to->reach.local = to->place;
}

/// The column of a target, or the one that was not asked for for longest.
static uint32_t column_for(const vg_local* self, int32_t target)
{
    if (target == NO_TARGET) {
        return 0;
    }
    uint32_t oldest = 1;
    for (uint32_t column = 1; column < self->columns; ++column) {
        if (self->targets[column] == target) {
            return column;
        }
        oldest = self->used[column] < self->used[oldest] ? column : oldest;
    }
    return oldest;
}

uint32_t vg_local_column(vg_local* self, int32_t target)
{
    VERGE_ASSERT(self->road != NULL && target < (int32_t)self->road->lane_count);
    const uint32_t column = column_for(self, target);
    if (self->targets[column] != target) {
        self->targets[column] = target;
        find_matters(self, column);
    }
    self->used[column] = ++self->uses;
    return column;
}

// ---------------------------------------------------------------------------- near lanes

void vg_local_cover(vg_local* self, const struct verge_road* road, const vg_source* sources,
                    uint32_t count)
{
    uint16_t before[VERGE_LANES_NEAR_MAX];
    const uint32_t count_before = self->fingerprint == road->fingerprint ? self->count : 0;
    self->road = road;
    if (count_before == road->lane_count) {
        return; // all of the road, related before
    }
    memcpy(before, self->lanes, count_before * sizeof before[0]);
    self->fingerprint = road->fingerprint;
    choose_lanes(self, road, sources, count);
    if (self->count == count_before
        && memcmp(before, self->lanes, count_before * sizeof before[0]) == 0) {
        return;
    }
    relate(self, road);
    find_after(self, road);
    for (uint32_t column = 0; column < self->columns; ++column) {
        self->targets[column] = FREE;
    }
}

static void come_near(vg_local* self, int32_t lane, double distance)
{
    if (distance < (double)self->distance[lane]) {
        self->distance[lane] = (uint16_t)distance;
    }
}

/// From a lane on to those around it; ahead, behind: [m] to its ends.
static void spread(vg_local* self, const struct verge_road* road, uint32_t lane, double ahead,
                   double behind)
{
    const vg_lane* from = &road->lanes[lane];
    const double cost = (double)self->distance[lane];
    for (uint32_t k = 0; k < from->successor_count; ++k) {
        come_near(self, from->successors[k], cost + ahead);
    }
    for (uint32_t k = 0; k < vg_lane_predecessor_count(road, lane); ++k) {
        come_near(self, vg_lane_predecessor(road, lane, k), cost + behind);
    }
    for (uint32_t k = road->bundles_from[from->bundle]; k < road->bundles_from[from->bundle + 1];
         ++k) {
        come_near(self, road->bundle_lanes[k], cost + aside);
    }
    for (uint32_t k = road->conflicts_from[lane]; k < road->conflicts_from[lane + 1]; ++k) {
        if (!road->conflicts[k].parts) {
            come_near(self, road->conflicts[k].other, cost + across);
        }
    }
    for (uint32_t k = road->merges_from[lane]; k < road->merges_from[lane + 1]; ++k) {
        come_near(self, road->merges[k].other, cost + across);
    }
}

static double in_steps(double distance)
{
    return distance_step * (double)(uint32_t)(vg_max(distance, 0.0) / distance_step);
}

static void spread_from_sources(vg_local* self, const struct verge_road* road,
                                const vg_source* sources, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t lane = sources[i].lane;
        const double ahead = in_steps(road->lanes[lane].length - sources[i].s);
        const double behind = in_steps(sources[i].s);
        const double cost = sources[i].controlled ? 0.0 : uncontrolled_from;
        if (cost <= (double)self->distance[lane]) {
            self->distance[lane] = (uint16_t)cost;
            spread(self, road, lane, ahead, behind);
        }
    }
}

static void choose_lanes(vg_local* self, const struct verge_road* road, const vg_source* sources,
                         uint32_t count)
{
    const uint32_t n = road->lane_count;
    for (uint32_t i = 0; i < n; ++i) {
        self->distance[i] = n <= self->capacity ? 0 : UINT16_MAX;
        self->place[i] = VG_NOT_LOCAL;
    }
    self->count = 0;
    if (n > self->capacity) {
        spread_from_sources(self, road, sources, count);
    }
    while (self->count < self->capacity) {
        uint32_t nearest = 0;
        double least = near_max;
        for (uint32_t i = 0; i < n; ++i) {
            if (self->place[i] == VG_NOT_LOCAL && (double)self->distance[i] < least) {
                least = (double)self->distance[i];
                nearest = i;
            }
        }
        if (least >= near_max) {
            break;
        }
        self->place[nearest] = 0; // taken; its place follows
        ++self->count;
        spread(self, road, nearest, road->lanes[nearest].length, road->lanes[nearest].length);
    }
    uint32_t place = 0;
    for (uint32_t i = 0; i < n; ++i) {
        if (self->place[i] != VG_NOT_LOCAL) {
            self->place[i] = (uint8_t)place;
            self->lanes[place++] = (uint16_t)i;
        }
    }
    VERGE_ASSERT(place == self->count);
}

// ---------------------------------------------------------------------------- relations

static const vg_merge* merge_of(const struct verge_road* road, uint32_t lane, uint32_t other)
{
    for (uint32_t k = road->merges_from[lane]; k < road->merges_from[lane + 1]; ++k) {
        if (road->merges[k].other == other) {
            return &road->merges[k];
        }
    }
    return NULL;
}

static float cost_of(const vg_local* self, uint32_t from, uint32_t to)
{
    return self->downstream[from * self->capacity + to].cost;
}

static float larger(float a, float b)
{
    return a > b ? a : b;
}

/// The relation of b to a if both lead to a common lane nearer than `best`, else unrelated. Lanes
/// that have diverged from a common lane which is nearer are unrelated.
static vg_relation merging(const vg_local* self, const struct verge_road* road, uint32_t a,
                           uint32_t b, float best)
{
    const vg_downstream* from_a = &self->downstream[a * self->capacity];
    const vg_downstream* from_b = &self->downstream[b * self->capacity];
    vg_relation relation = { .kind = VG_UNRELATED };
    for (uint32_t c = 0; c < self->count; ++c) {
        const float cost = larger(from_a[c].cost, from_b[c].cost);
        if (cost < best) {
            best = cost;
            relation = (vg_relation){ .offset = from_a[c].offset - from_b[c].offset,
                                      .lateral = from_a[c].lateral - from_b[c].lateral,
                                      .kind = VG_MERGING };
        }
    }
    for (uint32_t c = 0; c < self->count && relation.kind == VG_MERGING; ++c) {
        if (larger(cost_of(self, c, a), cost_of(self, c, b)) < best) {
            relation.kind = VG_UNRELATED;
        }
    }
    const vg_merge* merge =
        relation.kind == VG_MERGING ? merge_of(road, self->lanes[a], self->lanes[b]) : NULL;
    if (merge != NULL) { // they come close before: then it is known better
        relation.offset = merge->offset;
        relation.lateral = merge->lateral;
    }
    return relation;
}

vg_relation vg_local_relation(const vg_local* self, uint32_t a, uint32_t b)
{
    VERGE_ASSERT(a < VERGE_LANES_MAX && b < VERGE_LANES_MAX);
    const uint32_t at = self->place[a], to = self->place[b];
    if (at == VG_NOT_LOCAL || to == VG_NOT_LOCAL) {
        return (vg_relation){ .kind = VG_UNRELATED };
    }
    const vg_link* link = &self->links[at * self->capacity + to];
    const uint8_t kind = self->kinds[at * self->capacity + to];
    vg_relation relation = { .offset = link->offset, .lateral = link->lateral,
                             .period = (kind & VG_ROUND) != 0 ? self->ring[at] : 0.0f,
                             .touch = (float)-VG_HUGE, .kind = kind & (uint8_t)~VG_ROUND };
    if (relation.kind == VG_MERGING) {
        const vg_merge* merge = merge_of(self->road, a, b);
        relation.touch = merge != NULL ? merge->touch : (float)VG_HUGE;
    }
    return relation;
}

/// The nearest kind of relation of b as seen from a. ring: [m] length of the ring through both, 0
/// none.
static vg_relation relation_of(const vg_local* self, const struct verge_road* road, uint32_t a,
                               uint32_t b, float ring)
{
    const vg_downstream* down = &self->downstream[a * self->capacity + b];
    const vg_downstream* up = &self->downstream[b * self->capacity + a];
    vg_relation relation = { .kind = VG_UNRELATED };
    const float never = (float)VG_HUGE;
    if (road->lanes[self->lanes[a]].bundle == road->lanes[self->lanes[b]].bundle) {
        relation.kind = VG_SAME_BUNDLE;
        relation.period = ring;
        return relation;
    }
    if (down->cost < never && down->cost <= up->cost) {
        relation = (vg_relation){ .offset = down->offset, .lateral = down->lateral,
                                  .kind = VG_DOWNSTREAM };
    } else if (up->cost < never) {
        relation = (vg_relation){ .offset = -up->offset, .lateral = -up->lateral,
                                  .kind = VG_UPSTREAM };
    }
    if (ring > 0.0f && down->cost < never && up->cost < never) {
        relation.period = ring;
        return relation;
    }
    const float best = down->cost < up->cost ? down->cost : up->cost;
    const vg_relation merge = merging(self, road, a, b, best);
    return merge.kind == VG_MERGING ? merge : relation;
}

static void relate(vg_local* self, const struct verge_road* road)
{
    const size_t stride = self->capacity;
    vg_reach_clear(&self->reach);
    for (uint32_t a = 0; a < self->count; ++a) {
        self->ring[a] = (float)vg_reach_walk(&self->reach, road, self->lanes[a]);
        for (uint32_t b = 0; b < self->count; ++b) {
            const vg_reach* down = vg_reach_of(&self->reach, self->lanes[b]);
            self->downstream[a * stride + b] = (vg_downstream){
                (float)down->cost, (float)down->offset, (float)down->lateral };
        }
    }
    self->rings = false;
    for (uint32_t a = 0; a < self->count; ++a) {
        for (uint32_t b = 0; b < self->count; ++b) {
            const bool same =
                road->lanes[self->lanes[a]].bundle == road->lanes[self->lanes[b]].bundle;
            const bool round = same || (self->ring[a] > 0.0f && self->ring[b] > 0.0f);
            const vg_relation found =
                relation_of(self, road, a, b, round ? self->ring[a] : 0.0f);
            self->links[a * stride + b] = (vg_link){ found.offset, found.lateral };
            self->kinds[a * stride + b] =
                (uint8_t)(found.kind | (found.period > 0.0f ? VG_ROUND : 0));
            self->rings = self->rings || found.period > 0.0f;
        }
    }
}

static void find_after(vg_local* self, const struct verge_road* road)
{
    for (uint32_t a = 0; a < self->count; ++a) {
        self->after[a] = (uint64_t)1 << a;
    }
    for (bool more = true; more;) {
        more = false;
        for (uint32_t a = self->count; a-- > 0;) {
            const vg_lane* lane = &road->lanes[self->lanes[a]];
            uint64_t set = self->after[a];
            for (uint32_t k = 0; k < lane->successor_count; ++k) {
                const uint32_t next = self->place[lane->successors[k]];
                set |= next != VG_NOT_LOCAL ? self->after[next] : 0;
            }
            more = more || set != self->after[a];
            self->after[a] = set;
        }
    }
}

/// Near lanes (bits) of the bundle of a near lane.
static uint64_t bundle_of(const vg_local* self, const struct verge_road* road, uint32_t place)
{
    const uint32_t bundle = road->lanes[self->lanes[place]].bundle;
    uint64_t set = 0;
    for (uint32_t k = road->bundles_from[bundle]; k < road->bundles_from[bundle + 1]; ++k) {
        const uint32_t at = self->place[road->bundle_lanes[k]];
        set |= at != VG_NOT_LOCAL ? (uint64_t)1 << at : 0;
    }
    return set;
}

/// Near lanes (bits) of the bundles that the route leads through from any lane beside this one.
static uint64_t passed_from(const vg_local* self, const struct verge_road* road, int32_t target,
                            uint32_t place)
{
    uint64_t passed = 0;
    for (uint64_t begin = bundle_of(self, road, place); begin != 0; begin &= begin - 1) {
        uint32_t at = (uint32_t)__builtin_ctzll(begin);
        uint64_t own = 0; // ends where the route leaves the near lanes, or comes round
        while (at != VG_NOT_LOCAL && (own >> at & 1u) == 0) {
            own |= (uint64_t)1 << at;
            passed |= bundle_of(self, road, at);
            const int32_t next = vg_road_next(road, self->lanes[at], target);
            at = next < 0 ? (uint32_t)VG_NOT_LOCAL : self->place[next];
        }
    }
    return passed;
}

/// All related lanes, less those downstream that no lane of the bundle leads to on this route,
/// and those that merge into such.
static void find_matters(vg_local* self, uint32_t column)
{
    for (uint32_t a = 0; a < self->count; ++a) {
        const uint64_t passed = passed_from(self, self->road, self->targets[column], a);
        uint64_t set = 0;
        for (uint32_t b = 0; b < self->count; ++b) {
            const uint64_t bit = (uint64_t)1 << b;
            const uint8_t kind = self->kinds[a * self->capacity + b] & (uint8_t)~VG_ROUND;
            const bool matters = kind == VG_SAME_BUNDLE || kind == VG_UPSTREAM
                                 || (kind == VG_DOWNSTREAM && (passed & bit) != 0)
                                 || (kind == VG_MERGING && (self->after[b] & ~bit & passed) != 0);
            set |= matters ? bit : 0;
        }
        self->matters[column * self->capacity + a] = set;
    }
}
