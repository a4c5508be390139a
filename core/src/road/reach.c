/// Dijkstra's algorithm over the lanes downstream of one, up to VG_RELATION_REACH: how far away
/// each is, and where its stations begin on the first one's axis. See vg_reach_walk() in local.h.
#include "road/local.h"

#include "base/scalar.h"

#include <stddef.h>

/// A route through a neighbour counts as longer by this, so that own successors are preferred. [m]
static const double aside_cost = 5.0;

static double lateral_at_end(const vg_lane* lane, bool end)
{
    if (!end) {
        return (double)lane->bins[0].lateral;
    }
    const double bins = (lane->station_end - lane->station_start) / VG_BIN;
    const uint32_t bin = (uint32_t)vg_clamp(bins, 0.0, (double)(lane->bin_count - 2));
    const double t = bins - (double)bin;
    const vg_bin* here = &lane->bins[bin];
    return (1.0 - t) * (double)here[0].lateral + t * (double)here[1].lateral;
}

void vg_reach_take(vg_reach_table* table, vg_arena* arena, uint32_t capacity)
{
    table->row = vg_arena_take(arena, capacity * sizeof *table->row);
    table->entry = vg_arena_take(arena, capacity * sizeof *table->entry);
    table->state = vg_arena_take(arena, capacity * sizeof *table->state);
    table->touched = vg_arena_take(arena, capacity * sizeof *table->touched);
    table->open = vg_arena_take(arena, capacity * sizeof *table->open);
    table->capacity = arena->base == NULL || arena->failed ? 0 : capacity;
    vg_reach_clear(table);
}

void vg_reach_clear(vg_reach_table* table)
{
    table->touched_count = table->open_count = 0;
    for (uint32_t i = 0; i < table->capacity; ++i) {
        table->row[i].cost = table->entry[i].cost = VG_HUGE;
        table->state[i] = 0;
    }
}

/// Where a lane stands in the table, -1: it is not part of it.
static int32_t place_of(const vg_reach_table* table, uint32_t lane)
{
    if (table->local == NULL) {
        return (int32_t)lane;
    }
    return table->local[lane] == VG_NOT_LOCAL ? -1 : (int32_t)table->local[lane];
}

enum { TOUCHED = 1, OPEN = 2, SETTLED = 4 };

static void arrive(vg_reach* at, const vg_reach* by)
{
    if (by->cost < at->cost) {
        *at = *by;
    }
}

/// Reaches the start of a lane: its row (unless it is a lane the walk begins in) and its entry.
static void reach_lane(vg_reach_table* table, uint32_t lane, const vg_reach* by, bool begin)
{
    const int32_t place = place_of(table, lane);
    if (place < 0) {
        return;
    }
    uint8_t* state = &table->state[place];
    if ((*state & TOUCHED) == 0) {
        *state |= TOUCHED;
        table->touched[table->touched_count++] = (uint16_t)lane;
    }
    if (!begin) {
        arrive(&table->row[place], by);
    }
    if ((*state & SETTLED) == 0) {
        arrive(&table->entry[place], by);
        if ((*state & OPEN) == 0 && table->entry[place].cost < VG_RELATION_REACH) {
            *state |= OPEN;
            table->open[table->open_count++] = (uint16_t)lane;
        }
    }
}

static void forget(vg_reach_table* table)
{
    for (uint32_t i = 0; i < table->touched_count; ++i) {
        const int32_t place = place_of(table, table->touched[i]);
        table->row[place].cost = table->entry[place].cost = VG_HUGE;
        table->state[place] = 0;
    }
    table->touched_count = table->open_count = 0;
}

/// Takes the cheapest lane, of equal ones the lowest, out of the open ones.
static uint32_t settle(vg_reach_table* table)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < table->open_count; ++k) {
        const double cost = table->entry[place_of(table, table->open[k])].cost;
        const double least = table->entry[place_of(table, table->open[best])].cost;
        if (cost < least || (cost == least && table->open[k] < table->open[best])) {
            best = k;
        }
    }
    const uint32_t lane = table->open[best];
    table->open[best] = table->open[--table->open_count];
    table->state[place_of(table, lane)] |= SETTLED;
    return lane;
}

/// All lanes of the bundle that `direct` belongs to are reached with it.
static void reach_bundle(vg_reach_table* table, const struct verge_road* road, uint32_t direct,
                         vg_reach by, bool begin)
{
    const uint32_t bundle = road->lanes[direct].bundle;
    const double cost = by.cost;
    for (uint32_t k = road->bundles_from[bundle]; k < road->bundles_from[bundle + 1]; ++k) {
        by.cost = cost + (road->bundle_lanes[k] == direct ? 0.0 : aside_cost);
        reach_lane(table, road->bundle_lanes[k], &by, begin);
    }
}

double vg_reach_walk(vg_reach_table* table, const struct verge_road* road, uint32_t from)
{
    const uint32_t home = road->lanes[from].bundle;
    double ring = 0.0;
    forget(table);
    reach_bundle(table, road, from, (vg_reach){ .cost = 0.0 }, true);
    while (table->open_count > 0) {
        const vg_lane* lane = &road->lanes[settle(table)];
        const vg_reach* at = &table->entry[place_of(table, (uint32_t)(lane - road->lanes))];
        const double cost = at->cost + (lane->bundle == home ? 0.0 : lane->length);
        for (uint32_t k = 0; k < lane->successor_count; ++k) {
            const vg_lane* next = &road->lanes[lane->successors[k]];
            const double offset = at->offset + lane->station_end - next->station_start;
            const double lateral = at->lateral + lateral_at_end(lane, true)
                                   - lateral_at_end(next, false);
            if (next->bundle != home) {
                reach_bundle(table, road, (uint32_t)lane->successors[k],
                             (vg_reach){ .cost = cost, .offset = offset, .lateral = lateral },
                             false);
            } else if (ring == 0.0 && offset > 0.0) {
                ring = offset;
            }
        }
    }
    return ring;
}

const vg_reach* vg_reach_of(const vg_reach_table* table, uint32_t lane)
{
    static const vg_reach never = { .cost = VG_HUGE };
    const int32_t place = place_of(table, lane);
    return place < 0 ? &never : &table->row[place];
}
