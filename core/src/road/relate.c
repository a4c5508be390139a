/// Classifies pairs of lanes that are not neighbours but run through the same area: they merge,
/// they have diverged, or they conflict. Only pairs whose surveys come near one another are
/// examined. For merging lanes the offset that relates vehicles on both is stored, for conflicting
/// lanes the stretches where bodies could touch.
#include "road/local.h"

#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// Lanes with a common end converge towards it; bodies can touch below this distance. [m]
static const double touch_distance = VG_BODY_WIDTH_MAX;
/// A run that ends this close to a lane's end reaches it. [m]
static const double end_slack = 3.0;
static const double walk_step = 2.0; // [m] along lanes, when the distance to another is measured

/// A pair of lanes that come near one another, a before b.
typedef struct pair {
    vg_meeting meeting;
    uint8_t    kind;            ///< of vg_relation_kind, as b appears to a
    double     parted;          ///< [m] from the nearest lane that leads to both; VG_HUGE none
    double     cost;            ///< [m] merging: to the nearest lane that both lead to
    double     offset, lateral; ///< [m] merging: as b appears to a
    double     touch[2];        ///< [m] stations of a and of b, see vg_relation
    uint32_t   first, count;    ///< its areas
} pair;

typedef struct area {
    vg_run on_a, on_b;
    bool   parts; ///< see vg_conflict
} area;

/// The work of this stage, in scratch.
typedef struct work {
    struct verge_road* road;
    pair*    pairs;
    area*    areas;
    uint32_t pair_count, area_count;
    vg_reach_table from_a, from_b;
} work;

static bool work_take(work* self, vg_road_draft* draft);
static void find_parted(work* self);
static void find_kinds(work* self);
static void find_areas(work* self);
static void store_merges(const work* self);
static void store_conflicts(const work* self);

void vg_road_relate(vg_road_draft* draft)
{
    work self = { .road = draft->road };
    if (work_take(&self, draft)) {
        find_parted(&self);
        find_kinds(&self);
        find_areas(&self);
        store_merges(&self);
        store_conflicts(&self);
    }
}

size_t vg_road_relate_scratch_size(const verge_road_def* def, const vg_meetings* meetings)
{
    const size_t n = def->lane_count;
    const size_t table = n * (2 * sizeof(vg_reach) + sizeof(uint8_t) + 2 * sizeof(uint16_t));
    return meetings->pairs * (sizeof(pair) + sizeof(vg_meeting)) + meetings->areas * sizeof(area)
           + 2 * table + 16 * VG_ARENA_ALIGN;
}

static bool work_take(work* self, vg_road_draft* draft)
{
    vg_arena* scratch = draft->scratch;
    scratch->used = draft->scratch_start;
    const vg_meetings* meetings = &draft->meetings;
    self->pair_count = meetings->pairs;
    self->pairs = vg_arena_take(scratch, meetings->pairs * sizeof *self->pairs);
    self->areas = vg_arena_take(scratch, meetings->areas * sizeof *self->areas);
    vg_reach_take(&self->from_a, scratch, draft->road->lane_count);
    vg_reach_take(&self->from_b, scratch, draft->road->lane_count);
    vg_meeting* list = vg_arena_take(scratch, meetings->pairs * sizeof *list);
    if (scratch->failed) {
        return false;
    }
    (void)vg_road_meetings(draft->def, list);
    for (uint32_t i = 0; i < self->pair_count; ++i) {
        self->pairs[i] = (pair){ .meeting = list[i], .parted = VG_HUGE, .cost = VG_HUGE };
    }
    return true;
}

/// Of the lanes that lead to both of a pair the nearest.
static void find_parted(work* self)
{
    for (uint32_t c = 0; c < self->road->lane_count && self->pair_count > 0; ++c) {
        (void)vg_reach_walk(&self->from_a, self->road, c);
        for (uint32_t i = 0; i < self->pair_count; ++i) {
            pair* pair = &self->pairs[i];
            const double to_a = vg_reach_of(&self->from_a, pair->meeting.a)->cost;
            const double to_b = vg_reach_of(&self->from_a, pair->meeting.b)->cost;
            pair->parted = vg_min(pair->parted, vg_max(to_a, to_b));
        }
    }
}

/// Merging: the lane's station from which the lanes are close up to its end; +VG_HUGE if they are
/// not. Diverged: its station up to which they are close from its start on; -VG_HUGE if not.
static double touch_station(const struct verge_road* road, uint32_t lane, uint32_t other,
                            bool merging)
{
    const vg_lane* of = &road->lanes[lane];
    vg_run runs[VG_RUNS_MAX];
    const uint32_t count = vg_lane_runs(of, &road->lanes[other], touch_distance, false, runs);
    if (merging) {
        const bool meets = count > 0 && runs[count - 1].to >= of->length - end_slack;
        return meets ? vg_lane_station(of, runs[count - 1].from) : VG_HUGE;
    }
    return count > 0 && runs[0].from <= end_slack ? vg_lane_station(of, runs[0].to) : -VG_HUGE;
}

/// The nearest lane that both lead to; of equally near ones the first.
static void find_merge(const work* self, pair* pair)
{
    uint32_t nearest = VERGE_LANES_MAX;
    for (uint32_t k = 0; k < self->from_a.touched_count; ++k) {
        const uint32_t c = self->from_a.touched[k];
        const vg_reach *from_a = vg_reach_of(&self->from_a, c),
                       *from_b = vg_reach_of(&self->from_b, c);
        const double cost = vg_max(from_a->cost, from_b->cost);
        if (cost < pair->cost || (cost == pair->cost && cost < VG_HUGE && c < nearest)) {
            nearest = c;
            pair->cost = cost;
            pair->offset = from_a->offset - from_b->offset;
            pair->lateral = from_a->lateral - from_b->lateral;
        }
    }
}

/// The nearest kind of relation wins.
static void find_kind(const work* self, pair* pair, double ring_a, double ring_b)
{
    const uint32_t a = pair->meeting.a, b = pair->meeting.b;
    const double down = vg_reach_of(&self->from_a, b)->cost;
    const double up = vg_reach_of(&self->from_b, a)->cost;
    const double along = vg_min(down, up);
    if (self->road->lanes[a].bundle == self->road->lanes[b].bundle) {
        pair->kind = VG_SAME_BUNDLE;
        return;
    }
    pair->kind = along >= VG_HUGE ? VG_UNRELATED : down <= up ? VG_DOWNSTREAM : VG_UPSTREAM;
    if (ring_a > 0.0 && ring_b > 0.0 && down < VG_HUGE && up < VG_HUGE) {
        return;
    }
    find_merge(self, pair);
    const bool merges = pair->cost < along;
    const bool parts = pair->parted < vg_min(along, pair->cost);
    if (merges || parts) {
        pair->kind = parts ? VG_DIVERGED : VG_MERGING;
        pair->touch[0] = touch_station(self->road, a, b, !parts);
        pair->touch[1] = touch_station(self->road, b, a, !parts);
    }
}

static void find_kinds(work* self)
{
    double ring_a = 0.0;
    for (uint32_t i = 0; i < self->pair_count; ++i) { // ordered by a
        pair* pair = &self->pairs[i];
        if (i == 0 || pair->meeting.a != self->pairs[i - 1].meeting.a) {
            ring_a = vg_reach_walk(&self->from_a, self->road, pair->meeting.a);
        }
        const double ring_b = vg_reach_walk(&self->from_b, self->road, pair->meeting.b);
        find_kind(self, pair, ring_a, ring_b);
    }
}

// ------------------------------------------------------------------------------ areas

uint32_t vg_lane_runs(const vg_lane* lane, const vg_lane* other, double limit, bool opposite,
                      vg_run runs[VG_RUNS_MAX])
{
    uint32_t count = 0;
    bool inside = false;
    double step, there = 0.0;
    for (double s = 0.0; s <= lane->length; s += step) {
        const vg_reference at = vg_lane_at(lane, s);
        there = vg_lane_project_whole(other, at.x, at.y, there);
        there = vg_clamp(there, 0.0, other->length);
        const vg_reference near = vg_lane_at(other, there);
        const double distance = vg_sqrt(vg_square(at.x - near.x) + vg_square(at.y - near.y));
        const double cosine = at.cos_heading * near.cos_heading + at.sin_heading * near.sin_heading;
        const bool close = distance < limit && (opposite || cosine > 0.0);
        if (close && !inside && count < VG_RUNS_MAX) {
            runs[count++] = (vg_run){ .from = s, .to = s, .other_from = there, .other_to = there };
        }
        if (close) {
            vg_run* run = &runs[count - 1];
            run->to = s;
            run->other_from = vg_min(run->other_from, there);
            run->other_to = vg_max(run->other_to, there);
        }
        inside = close;
        // Far from the other lane larger steps miss nothing: the distance changes by at most 1 m
        // per metre. The last step ends at the end of the lane.
        step = vg_max(walk_step, distance - limit);
        if (s < lane->length && s + step > lane->length) {
            step = lane->length - s;
        }
        if (s >= lane->length) {
            break;
        }
    }
    return count;
}

/// Removes the part that the relation covers already: behind `touch` of merging lanes, before it of
/// diverged lanes.
static uint32_t cut_related(const vg_lane* lane, const pair* pair, double touch, vg_run* runs,
                            uint32_t count)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const double middle = vg_lane_station(lane, 0.5 * (runs[i].from + runs[i].to));
        const bool covered = (pair->kind == VG_MERGING && middle >= touch)
                             || (pair->kind == VG_DIVERGED && middle <= touch);
        if (!covered) {
            runs[kept++] = runs[i];
        }
    }
    return kept;
}

static void widen(vg_run* run, const vg_run* by)
{
    run->from = vg_min(run->from, by->from);
    run->to = vg_max(run->to, by->to);
}

/// An area beyond the capacity is joined to the last area of the pair.
static void area_add(work* self, pair* pair, const vg_run* on_a, const vg_run* on_b, bool parts)
{
    if (pair->count == pair->meeting.areas_max) {
        area* last = &self->areas[self->area_count - 1];
        widen(&last->on_a, on_a);
        widen(&last->on_b, on_b);
        return;
    }
    self->areas[self->area_count++] = (area){ *on_a, *on_b, parts };
    pair->count++;
}

static void find_areas_of(work* self, pair* pair)
{
    const vg_lane* a = &self->road->lanes[pair->meeting.a];
    const vg_lane* b = &self->road->lanes[pair->meeting.b];
    vg_run on_a[VG_RUNS_MAX], on_b[VG_RUNS_MAX];
    uint32_t count_a = vg_lane_runs(a, b, VG_BODY_WIDTH_MAX, true, on_a);
    if (count_a == 0) {
        return;
    }
    uint32_t count_b = vg_lane_runs(b, a, VG_BODY_WIDTH_MAX, true, on_b);
    if (count_b == 0) {
        return;
    }
    if (pair->kind == VG_DIVERGED && pair->touch[0] > -VG_HUGE && pair->touch[1] > -VG_HUGE) {
        area_add(self, pair, &on_a[0], &on_b[0], true);
    }
    count_a = cut_related(a, pair, pair->touch[0], on_a, count_a);
    count_b = cut_related(b, pair, pair->touch[1], on_b, count_b);
    for (uint32_t i = 0; i < count_a; ++i) {
        for (uint32_t k = 0; k < count_b; ++k) {
            const bool meet = on_a[i].other_from <= on_b[k].to + walk_step
                              && on_a[i].other_to >= on_b[k].from - walk_step
                              && on_b[k].other_from <= on_a[i].to + walk_step
                              && on_b[k].other_to >= on_a[i].from - walk_step;
            if (meet) {
                area_add(self, pair, &on_a[i], &on_b[k], false);
            }
        }
    }
}

static void find_areas(work* self)
{
    for (uint32_t i = 0; i < self->pair_count; ++i) {
        pair* pair = &self->pairs[i];
        pair->first = self->area_count;
        if (pair->kind == VG_UNRELATED || pair->kind == VG_MERGING || pair->kind == VG_DIVERGED) {
            find_areas_of(self, pair);
        }
    }
}

// ------------------------------------------------------------------------------ into the road

/// Numbers of things a lane has become the lane's part of their list: from[lane + 1] is where the
/// next thing of this lane is to be written, and ends as the part's end.
static void parts_from_counts(uint32_t* from, uint32_t lane_count)
{
    uint32_t begin = 0;
    for (uint32_t i = 1; i <= lane_count; ++i) {
        const uint32_t count = from[i];
        from[i] = begin;
        begin += count;
    }
}

static bool side_merges(const pair* pair, uint32_t side)
{
    return pair->kind == VG_MERGING && pair->touch[side] < VG_HUGE;
}

static void store_merges(const work* self)
{
    struct verge_road* road = self->road;
    uint32_t* from = road->merges_from;
    for (uint32_t pass = 0; pass < 2; ++pass) { // pairs are ordered, so each part is
        for (uint32_t i = 0; i < self->pair_count; ++i) {
            const pair* pair = &self->pairs[i];
            const uint32_t lanes[2] = { pair->meeting.a, pair->meeting.b };
            for (uint32_t side = 0; side < 2; ++side) {
                uint32_t* at = &from[lanes[side] + 1];
                const double sign = side == 0 ? 1.0 : -1.0;
                if (!side_merges(pair, side)) {
                    continue;
                }
                if (pass == 1) {
                    road->merges[*at] = (vg_merge){ .other = (uint16_t)lanes[1 - side],
                                                    .cost = (float)pair->cost,
                                                    .offset = (float)(sign * pair->offset),
                                                    .lateral = (float)(sign * pair->lateral),
                                                    .touch = (float)pair->touch[side] };
                }
                ++*at;
            }
        }
        if (pass == 0) {
            parts_from_counts(from, road->lane_count);
        }
    }
    VERGE_ASSERT(from[road->lane_count] <= road->merge_capacity);
}

static vg_conflict conflict_from(const struct verge_road* road, const uint32_t lanes[2],
                                 const area* area, uint32_t side)
{
    // Half a step is added on both sides: the sampling may have missed that much.
    const double pad = 0.5 * walk_step;
    const vg_lane *lane = &road->lanes[lanes[side]], *other = &road->lanes[lanes[1 - side]];
    const vg_run* own = side == 0 ? &area->on_a : &area->on_b;
    const vg_run* others = side == 0 ? &area->on_b : &area->on_a;
    return (vg_conflict){ .other = (uint16_t)lanes[1 - side],
                          .from = (float)vg_lane_station(lane, own->from - pad),
                          .to = (float)vg_lane_station(lane, own->to + pad),
                          .other_from = (float)vg_lane_station(other, others->from - pad),
                          .other_to = (float)vg_lane_station(other, others->to + pad),
                          .parts = area->parts };
}

static void store_conflicts(const work* self)
{
    struct verge_road* road = self->road;
    uint32_t* from = road->conflicts_from;
    for (uint32_t pass = 0; pass < 2; ++pass) {
        for (uint32_t i = 0; i < self->pair_count; ++i) {
            const pair* pair = &self->pairs[i];
            const uint32_t lanes[2] = { pair->meeting.a, pair->meeting.b };
            for (uint32_t k = 0; k < 2 * pair->count; ++k) {
                const uint32_t side = k % 2;
                uint32_t* at = &from[lanes[side] + 1];
                if (pass == 1) {
                    road->conflicts[*at] =
                        conflict_from(road, lanes, &self->areas[pair->first + k / 2], side);
                }
                ++*at;
            }
        }
        if (pass == 0) {
            parts_from_counts(from, road->lane_count);
        }
    }
    VERGE_ASSERT(from[road->lane_count] <= road->conflict_capacity);
}
