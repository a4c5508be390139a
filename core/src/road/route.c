/// The ways through the graph: for every lane and target how many lane changes it takes, what to
/// do next, and which lanes matter to a vehicle on that way.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A neighbour that goes on less than this beyond a lane's end does not make it a dead end. [m]
static const double dead_end_length = 20.0;

static uint64_t lanes_after(const struct verge_road* road, uint32_t lane);
static void route_to(struct verge_road* road, uint32_t target);
static void relax(uint32_t changes, double length, uint32_t* best_changes, double* best_length);
static bool change_exists(const vg_lane* lane, bool left);
static uint64_t lanes_that_matter(const struct verge_road* road, uint32_t lane, uint32_t column);
static bool is_dead_end(const struct verge_road* road, uint32_t lane);

void vg_road_route(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    const uint32_t n = road->lane_count;
    for (uint32_t i = 0; i < n; ++i) {
        road->continues[i] = lanes_after(road, i);
        const vg_lane* lane = &road->lanes[i];
        road->next[i * (n + 1)] = lane->successor_count > 0 ? lane->successors[0] : -1;
    }
    for (uint32_t target = 0; target < n; ++target) {
        route_to(road, target);
    }
    for (uint32_t i = 0; i < n; ++i) {
        road->lanes[i].dead_end = is_dead_end(road, i);
        for (uint32_t column = 0; column <= n; ++column) {
            road->on_route[i * (n + 1) + column] = lanes_that_matter(road, i, column);
        }
    }
}

/// The lane and all that continue it by successors.
static uint64_t lanes_after(const struct verge_road* road, uint32_t lane)
{
    uint64_t set = (uint64_t)1 << lane;
    for (uint64_t before = 0; before != set;) {
        before = set;
        for (uint32_t i = 0; i < road->lane_count; ++i) {
            for (uint32_t k = 0; (before >> i & 1u) != 0 && k < road->lanes[i].successor_count;
                 ++k) {
                set |= (uint64_t)1 << road->lanes[i].successors[k];
            }
        }
    }
    return set;
}

/// Backwards from the target and all that continues it: fewest changes first, then the shortest
/// way; the passes end when nothing improves, each in the order of the lanes.
static void route_to(struct verge_road* road, uint32_t target)
{
    const uint32_t n = road->lane_count;
    uint32_t changes[VERGE_LANES_MAX];
    double length[VERGE_LANES_MAX];
    for (uint32_t i = 0; i < n; ++i) {
        const bool there = (road->continues[target] >> i & 1u) != 0;
        changes[i] = there ? 0 : VG_NEVER;
        length[i] = there ? 0.0 : VG_HUGE;
    }
    bool improved = true;
    for (uint32_t pass = 0; improved && pass < 2 * n; ++pass) {
        improved = false;
        for (uint32_t i = 0; i < n; ++i) {
            const vg_lane* lane = &road->lanes[i];
            uint32_t best = changes[i];
            double way = length[i];
            for (uint32_t k = 0; k < lane->successor_count; ++k) {
                const int32_t next = lane->successors[k];
                relax(changes[next], length[next] + lane->length, &best, &way);
            }
            if (change_exists(lane, true)) {
                relax(changes[lane->left] + 1, length[lane->left], &best, &way);
            }
            if (change_exists(lane, false)) {
                relax(changes[lane->right] + 1, length[lane->right], &best, &way);
            }
            if (best < changes[i] || (best == changes[i] && way < length[i])) {
                changes[i] = best;
                length[i] = way;
                improved = true;
            }
        }
    }
    for (uint32_t i = 0; i < n; ++i) {
        const vg_lane* lane = &road->lanes[i];
        int32_t next = lane->successor_count > 0 ? lane->successors[0] : -1;
        for (uint32_t k = 1; k < lane->successor_count; ++k) {
            const int32_t other = lane->successors[k];
            if (changes[other] < changes[next]
                || (changes[other] == changes[next] && length[other] < length[next])) {
                next = other;
            }
        }
        road->next[i * (n + 1) + target + 1] = next;
        road->changes[i * n + target] = (uint8_t)changes[i];

        // Where a change is needed anyway it is the way as soon as it helps: the stretch may end.
        const bool needed = changes[i] > 0 && changes[i] < VG_NEVER;
        const bool left = needed && change_exists(lane, true)
                          && changes[lane->left] + 1 == changes[i];
        const bool right = needed && change_exists(lane, false)
                           && changes[lane->right] + 1 == changes[i]
                           && (!left || length[lane->right] < length[lane->left]);
        road->move[i * n + target] = right ? -1 : left ? 1 : 0;
    }
}

static void relax(uint32_t changes, double length, uint32_t* best_changes, double* best_length)
{
    if (changes < *best_changes || (changes == *best_changes && length < *best_length)) {
        *best_changes = changes;
        *best_length = length;
    }
}

static bool change_exists(const vg_lane* lane, bool left)
{
    if ((left ? lane->left : lane->right) < 0) {
        return false;
    }
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        if ((left ? lane->bins[i].left_gap : lane->bins[i].right_gap) > 0.0f) {
            return true;
        }
    }
    return false;
}

/// All related lanes, less those downstream that no lane of the bundle leads to on this route,
/// those that merge into such, and those that have parted from the vehicle's lane.
static uint64_t lanes_that_matter(const struct verge_road* road, uint32_t lane, uint32_t column)
{
    const uint32_t n = road->lane_count;
    uint64_t bundles = (uint64_t)1 << road->lanes[lane].bundle; // at most one bundle a lane
    for (uint32_t i = 0; i < n; ++i) {
        if (road->lanes[i].bundle != road->lanes[lane].bundle) {
            continue;
        }
        int32_t on = (int32_t)i;
        for (uint32_t step = 0; step < n && on >= 0; ++step) {
            bundles |= (uint64_t)1 << road->lanes[on].bundle;
            on = road->next[(uint32_t)on * (n + 1) + column];
        }
    }
    uint64_t set = 0;
    for (uint32_t other = 0; other < n; ++other) {
        bool matters = false;
        switch ((vg_relation_kind)road->relations[lane * n + other].kind) {
        case VG_SAME_BUNDLE:
        case VG_UPSTREAM:
            matters = true;
            break;
        case VG_DOWNSTREAM:
            matters = (bundles >> road->lanes[other].bundle & 1u) != 0;
            break;
        case VG_MERGING: // some lane that continues the other is on the way
            for (uint32_t c = 0; c < n; ++c) {
                matters = matters || ((road->continues[other] >> c & 1u) != 0 && c != other
                                      && (bundles >> road->lanes[c].bundle & 1u) != 0);
            }
            break;
        case VG_DIVERGED:
        case VG_UNRELATED:
            break;
        }
        set |= matters ? (uint64_t)1 << other : 0;
    }
    return set;
}

/// [m] that can be driven from a lane's end on by successors, as far as it matters here.
static double way_beyond(const struct verge_road* road, uint32_t lane)
{
    double way = 0.0;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        if (i != lane && (road->continues[lane] >> i & 1u) != 0) {
            way += road->lanes[i].length;
        }
    }
    return road->lanes[lane].successor_count > 0 ? vg_max(way, road->lanes[lane].length) : 0.0;
}

static bool is_dead_end(const struct verge_road* road, uint32_t index)
{
    const vg_lane* lane = &road->lanes[index];
    if (lane->successor_count > 0) {
        return false;
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        const vg_lane* other = &road->lanes[i];
        const bool beside = i != index && other->bundle == lane->bundle
                            && other->station_start < lane->station_end;
        // Neighbours that end a little earlier and go on count as much as those that run by.
        const double end = other->station_end + way_beyond(road, i);
        if (beside && end >= lane->station_end + dead_end_length
            && other->station_end > lane->station_end - dead_end_length) {
            return true;
        }
    }
    return false;
}
