/// Routes through the graph: for every target and lane the number of lane changes and the next
/// action; and the lanes that end where a vehicle must leave them.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A lane is a dead end if a neighbour continues at least this far beyond its end. [m]
static const double dead_end_length = 20.0;

/// The best route known from a lane to the target: fewest lane changes first, then shortest length.
typedef struct best {
    uint32_t changes; ///< VG_NEVER: none
    double   length;  ///< [m]
} best;

/// The search for the routes to one target, in scratch.
typedef struct search {
    const struct verge_road* road;
    best*     known;      ///< [lane_count]
    uint16_t* open;       ///< [lane_count] a ring of lanes whose route has improved
    bool*     is_open;    ///< [lane_count]
    uint32_t  first, count;
    uint32_t* beside_from; ///< [lane_count + 1]
    uint16_t* beside;     ///< lanes from which a change to the lane is possible
} search;

static bool search_take(search* self, vg_road_draft* draft);
static void route_to(search* self, uint32_t target);
static vg_way way_from(const search* self, uint32_t lane);
static bool is_dead_end(const struct verge_road* road, uint32_t lane);

void vg_road_route(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    search self = { .road = road };
    if (!search_take(&self, draft)) {
        return;
    }
    for (uint32_t target = 0; target < road->lane_count; ++target) {
        route_to(&self, target);
        for (uint32_t i = 0; i < road->lane_count; ++i) {
            road->ways[target * road->lane_count + i] = way_from(&self, i);
        }
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        road->has_successors = road->has_successors || road->lanes[i].successor_count > 0;
        road->lanes[i].dead_end = is_dead_end(road, i);
    }
}

size_t vg_road_route_scratch_size(const verge_road_def* def)
{
    const size_t n = def->lane_count;
    return n * (sizeof(best) + 3 * sizeof(uint16_t) + sizeof(bool)) + (n + 1) * sizeof(uint32_t)
           + 6 * VG_ARENA_ALIGN;
}

/// The lane that a change from `lane` leads to, -1 none.
static int32_t changed_to(const vg_lane* lane, uint32_t side)
{
    return side == 0 ? (lane->change_left ? lane->left : -1)
                     : (lane->change_right ? lane->right : -1);
}

static bool search_take(search* self, vg_road_draft* draft)
{
    vg_arena* scratch = draft->scratch;
    scratch->used = draft->scratch_start;
    const struct verge_road* road = self->road;
    const size_t n = road->lane_count;
    self->known = vg_arena_take(scratch, n * sizeof *self->known);
    self->open = vg_arena_take(scratch, n * sizeof *self->open);
    self->is_open = vg_arena_take(scratch, n * sizeof *self->is_open);
    self->beside_from = vg_arena_take(scratch, (n + 1) * sizeof *self->beside_from);
    self->beside = vg_arena_take(scratch, 2 * n * sizeof *self->beside);
    if (scratch->failed) {
        return false;
    }
    uint32_t count = 0;
    for (uint32_t to = 0; to < n; ++to) { // of the lanes beside it alone: a bundle is small
        const uint32_t bundle = road->lanes[to].bundle;
        self->beside_from[to] = count;
        for (uint32_t k = road->bundles_from[bundle]; k < road->bundles_from[bundle + 1]; ++k) {
            for (uint32_t side = 0; side < 2; ++side) {
                if (changed_to(&road->lanes[road->bundle_lanes[k]], side) == (int32_t)to) {
                    self->beside[count++] = road->bundle_lanes[k];
                }
            }
        }
    }
    self->beside_from[n] = count;
    VERGE_ASSERT(count <= 2 * n);
    return true;
}

static void open_lane(search* self, uint32_t lane)
{
    if (!self->is_open[lane]) {
        self->is_open[lane] = true;
        self->open[(self->first + self->count++) % self->road->lane_count] = (uint16_t)lane;
    }
}

static uint32_t next_open(search* self)
{
    const uint32_t lane = self->open[self->first];
    self->first = (self->first + 1) % self->road->lane_count;
    --self->count;
    self->is_open[lane] = false;
    return lane;
}

static void improve(search* self, uint32_t lane, uint32_t changes, double length)
{
    best* known = &self->known[lane];
    if (changes < known->changes || (changes == known->changes && length < known->length)) {
        *known = (best){ changes, length };
        open_lane(self, lane);
    }
}

/// Searches backwards from the target lane and its successors until no route improves.
static void route_to(search* self, uint32_t target)
{
    const struct verge_road* road = self->road;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        self->known[i] = (best){ VG_NEVER, VG_HUGE };
    }
    improve(self, target, 0, 0.0);
    while (self->count > 0) { // successors of the target lane have reached it
        const vg_lane* lane = &road->lanes[next_open(self)];
        for (uint32_t k = 0; k < lane->successor_count; ++k) {
            improve(self, (uint32_t)lane->successors[k], 0, 0.0);
        }
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        if (self->known[i].changes == 0) {
            open_lane(self, i);
        }
    }
    while (self->count > 0) {
        const uint32_t at = next_open(self);
        const best here = self->known[at];
        for (uint32_t k = 0; k < vg_lane_predecessor_count(road, at); ++k) {
            const uint32_t before = (uint32_t)vg_lane_predecessor(road, at, k);
            improve(self, before, here.changes, here.length + road->lanes[before].length);
        }
        for (uint32_t k = self->beside_from[at]; k < self->beside_from[at + 1]; ++k) {
            improve(self, self->beside[k], here.changes + 1, here.length);
        }
    }
}

static bool is_better(const best* a, const best* b)
{
    return a->changes < b->changes || (a->changes == b->changes && a->length < b->length);
}

static vg_way way_from(const search* self, uint32_t index)
{
    const vg_lane* lane = &self->road->lanes[index];
    const best* known = self->known;
    uint32_t next = 0;
    for (uint32_t k = 1; k < lane->successor_count; ++k) {
        next = is_better(&known[lane->successors[k]], &known[lane->successors[next]]) ? k : next;
    }
    // A change that is needed is made as soon as possible: the stretch where it is legal may end.
    const uint32_t changes = known[index].changes;
    const bool needed = changes > 0 && changes < VG_NEVER;
    const int32_t to_left = changed_to(lane, 0), to_right = changed_to(lane, 1);
    const bool left = needed && to_left >= 0 && known[to_left].changes + 1 == changes;
    const bool right = needed && to_right >= 0 && known[to_right].changes + 1 == changes
                       && (!left || known[to_right].length < known[to_left].length);
    const uint32_t counted = changes >= VG_NEVER ? VG_WAY_CHANGES
                             : changes < VG_WAY_CHANGES ? changes : VG_WAY_CHANGES - 1u;
    const uint32_t turn = right ? 2u : left ? 1u : 0u;
    return (vg_way)(counted | turn << VG_WAY_TURN_SHIFT | next << VG_WAY_NEXT_SHIFT);
}

bool vg_road_continues(const struct verge_road* road, uint32_t first, uint32_t lane)
{
    uint16_t open[VERGE_LANES_MAX];
    bool known[VERGE_LANES_MAX] = { false };
    uint32_t count = 0;
    open[count++] = (uint16_t)first;
    known[first] = true;
    for (uint32_t at = 0; at < count && !known[lane]; ++at) {
        const vg_lane* here = &road->lanes[open[at]];
        for (uint32_t k = 0; k < here->successor_count; ++k) {
            const uint32_t next = (uint32_t)here->successors[k];
            if (!known[next]) {
                known[next] = true;
                open[count++] = (uint16_t)next;
            }
        }
    }
    return known[lane];
}

/// Can `wanted` metres be driven beyond the end of a lane along its successors, each counted once?
static bool goes_on(const struct verge_road* road, uint32_t lane, double wanted)
{
    enum { LANES = 64 }; // more lanes are not needed for this distance
    uint16_t open[LANES];
    uint32_t count = 0;
    open[count++] = (uint16_t)lane;
    double distance = 0.0;
    for (uint32_t at = 0; at < count && distance < wanted; ++at) {
        const vg_lane* here = &road->lanes[open[at]];
        for (uint32_t k = 0; k < here->successor_count && count < LANES; ++k) {
            bool known = false;
            for (uint32_t m = 0; m < count; ++m) {
                known = known || open[m] == here->successors[k];
            }
            if (!known) {
                distance += road->lanes[here->successors[k]].length;
                open[count++] = (uint16_t)here->successors[k];
            }
        }
    }
    const vg_lane* own = &road->lanes[lane];
    return (own->successor_count > 0 ? vg_max(distance, own->length) : 0.0) >= wanted;
}

static bool is_dead_end(const struct verge_road* road, uint32_t index)
{
    const vg_lane* lane = &road->lanes[index];
    if (lane->successor_count > 0) {
        return false;
    }
    for (uint32_t k = road->bundles_from[lane->bundle]; k < road->bundles_from[lane->bundle + 1];
         ++k) {
        const uint32_t i = road->bundle_lanes[k];
        const vg_lane* other = &road->lanes[i];
        // A neighbour that ends a little earlier, but continues, counts as well.
        if (i != index && other->station_start < lane->station_end
            && other->station_end > lane->station_end - dead_end_length
            && goes_on(road, i, lane->station_end + dead_end_length - other->station_end)) {
            return true;
        }
    }
    return false;
}
