/// How a vehicle on one lane appears to one on another.
///
/// From every lane the graph is walked downstream, up to VG_RELATION_REACH, adding up where the
/// next lane's stations begin on the first one's axis. All kinds of relation follow from that one
/// table: downstream directly, upstream by reading it the other way round, merging by a lane that
/// both reach, diverged by a lane that reaches both. The nearest kind wins.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A way through a neighbour counts as this much longer, so that a lane's own successors win. [m]
static const double aside_cost = 5.0;
/// Lanes whose ends come together run to them side by side; nearer than this they are one. [m]
static const double touch_distance = VG_BODY_WIDTH_MAX;
/// A run that ends this close to a lane's end reaches it. [m]
static const double end_slack = 3.0;

/// Lane B from lane A by driving on.
typedef struct reach {
    double cost;    ///< [m] from A's end to B's start; VG_HUGE: not within reach
    double offset;  ///< [m] add to B's station
    double lateral; ///< [m] add to B's y
} reach;

static void walk_downstream(const struct verge_road* road, uint32_t from, reach* row, double* ring);
static void arrive(reach* at, double cost, double offset, double lateral);
static vg_relation relation_between(const struct verge_road* road, const reach* table,
                                    const double* ring, uint32_t a, uint32_t b);
static double touch_station(const struct verge_road* road, uint32_t a, uint32_t b, bool merging);
static double lateral_at_end(const vg_lane* lane, bool end);

void vg_road_relate(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    const uint32_t n = road->lane_count;
    draft->scratch->used = draft->scratch_start;
    reach* table = vg_arena_take(draft->scratch, (size_t)n * n * sizeof *table);
    double* ring = vg_arena_take(draft->scratch, n * sizeof *ring);
    if (table == NULL || ring == NULL) {
        return;
    }
    for (uint32_t a = 0; a < n; ++a) {
        walk_downstream(road, a, &table[a * n], &ring[a]);
    }
    for (uint32_t a = 0; a < n; ++a) {
        for (uint32_t b = 0; b < n; ++b) {
            road->relations[a * n + b] = relation_between(road, table, ring, a, b);
        }
    }
}

size_t vg_road_relate_scratch_size(const verge_road_def* def)
{
    const size_t n = def->lane_count;
    return n * n * sizeof(reach) + n * sizeof(double) + 4 * VG_ARENA_ALIGN;
}

/// Dijkstra over lanes; settles the cheapest, lowest index first. ring: [m] way round back to the
/// same bundle, 0 if there is none within reach.
static void walk_downstream(const struct verge_road* road, uint32_t from, reach* row, double* ring)
{
    const uint32_t n = road->lane_count;
    reach entry[VERGE_LANES_MAX]; // at each lane's start, or for the first bundle beside `from`
    bool settled[VERGE_LANES_MAX] = { false };
    for (uint32_t i = 0; i < n; ++i) {
        row[i] = (reach){ .cost = VG_HUGE };
        entry[i] = (reach){ .cost = VG_HUGE };
        if (road->lanes[i].bundle == road->lanes[from].bundle) {
            entry[i].cost = i == from ? 0.0 : aside_cost;
        }
    }
    *ring = 0.0;
    for (uint32_t round = 0; round < n; ++round) {
        uint32_t at = n;
        for (uint32_t i = 0; i < n; ++i) {
            if (!settled[i] && entry[i].cost < VG_RELATION_REACH
                && (at == n || entry[i].cost < entry[at].cost)) {
                at = i;
            }
        }
        if (at == n) {
            break;
        }
        settled[at] = true;
        const vg_lane* lane = &road->lanes[at];
        const bool first = lane->bundle == road->lanes[from].bundle;
        const double cost = entry[at].cost + (first ? 0.0 : lane->length);
        for (uint32_t k = 0; k < lane->successor_count; ++k) {
            const vg_lane* next = &road->lanes[lane->successors[k]];
            const double offset = entry[at].offset + lane->station_end - next->station_start;
            const double lateral = entry[at].lateral + lateral_at_end(lane, true)
                                   - lateral_at_end(next, false);
            if (next->bundle == road->lanes[from].bundle) {
                if (*ring == 0.0 && offset > 0.0) {
                    *ring = offset;
                }
                continue;
            }
            for (uint32_t i = 0; i < n; ++i) {
                if (road->lanes[i].bundle == next->bundle) {
                    const bool direct = (int32_t)i == lane->successors[k];
                    const double way = cost + (direct ? 0.0 : aside_cost);
                    arrive(&row[i], way, offset, lateral);
                    if (!settled[i]) {
                        arrive(&entry[i], way, offset, lateral);
                    }
                }
            }
        }
    }
}

static void arrive(reach* at, double cost, double offset, double lateral)
{
    if (cost < at->cost) {
        *at = (reach){ .cost = cost, .offset = offset, .lateral = lateral };
    }
}

static vg_relation relation_between(const struct verge_road* road, const reach* table,
                                    const double* ring, uint32_t a, uint32_t b)
{
    const uint32_t n = road->lane_count;
    const reach* down = &table[a * n + b];
    const reach* up = &table[b * n + a];
    vg_relation relation = { .kind = VG_UNRELATED, .touch = (float)-VG_HUGE };
    const bool round = ring[a] > 0.0 && ring[b] > 0.0;
    if (road->lanes[a].bundle == road->lanes[b].bundle) {
        relation.kind = VG_SAME_BUNDLE;
        relation.period = (float)ring[a];
        return relation;
    }
    double best = VG_HUGE;
    if (down->cost < best) {
        best = down->cost;
        relation.kind = VG_DOWNSTREAM;
        relation.offset = (float)down->offset;
        relation.lateral = (float)down->lateral;
    }
    if (up->cost < best) {
        best = up->cost;
        relation.kind = VG_UPSTREAM;
        relation.offset = (float)-up->offset;
        relation.lateral = (float)-up->lateral;
    }
    if (round && down->cost < VG_HUGE && up->cost < VG_HUGE) {
        relation.period = (float)ring[a];
        return relation;
    }
    for (uint32_t c = 0; c < n; ++c) { // a lane both reach
        const reach *ac = &table[a * n + c], *bc = &table[b * n + c];
        if (vg_max(ac->cost, bc->cost) < best) {
            best = vg_max(ac->cost, bc->cost);
            relation.kind = VG_MERGING;
            relation.offset = (float)(ac->offset - bc->offset);
            relation.lateral = (float)(ac->lateral - bc->lateral);
        }
    }
    for (uint32_t c = 0; c < n; ++c) { // a lane that reaches both
        const reach *ca = &table[c * n + a], *cb = &table[c * n + b];
        if (vg_max(ca->cost, cb->cost) < best) {
            best = vg_max(ca->cost, cb->cost);
            relation.kind = VG_DIVERGED;
            relation.offset = (float)(cb->offset - ca->offset);
            relation.lateral = (float)(cb->lateral - ca->lateral);
        }
    }
    if (relation.kind == VG_MERGING || relation.kind == VG_DIVERGED) {
        const bool merging = relation.kind == VG_MERGING;
        relation.touch = (float)touch_station(road, a, b, merging);
        if (!merging && relation.touch <= (float)-VG_HUGE) {
            return (vg_relation){ .kind = VG_UNRELATED, .touch = (float)-VG_HUGE };
        }
    }
    return relation;
}

/// Merging: A's station from which the lanes are close up to A's end; +VG_HUGE if they are not.
/// Diverged: A's station up to which they are close from A's start on; -VG_HUGE if they are not.
static double touch_station(const struct verge_road* road, uint32_t a, uint32_t b, bool merging)
{
    const vg_lane* lane = &road->lanes[a];
    vg_run runs[VG_RUNS_MAX];
    const uint32_t count = vg_lane_runs(lane, &road->lanes[b], touch_distance, false, runs);
    if (merging) {
        const bool meets = count > 0 && runs[count - 1].to >= lane->length - end_slack;
        return meets ? vg_lane_station(lane, runs[count - 1].from) : VG_HUGE;
    }
    return count > 0 && runs[0].from <= end_slack ? vg_lane_station(lane, runs[0].to) : -VG_HUGE;
}

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
