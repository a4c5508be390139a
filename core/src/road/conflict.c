/// Where two lanes that are not neighbours, and that no relation makes leader and follower, run
/// through the same area: found by walking along each and measuring the distance to the other.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

static const double walk_step = 2.0; // [m]

static bool may_conflict(const struct verge_road* road, uint32_t a, uint32_t b);
static uint32_t cut_related(const struct verge_road* road, uint32_t a, uint32_t b, vg_run* runs,
                            uint32_t count);
static bool store(struct verge_road* road, uint32_t a, uint32_t b, const vg_run* run_a,
                  const vg_run* run_b);

bool vg_road_conflict(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    for (uint32_t a = 0; a < road->lane_count; ++a) { // both orders: so they are ordered by lane
        for (uint32_t b = 0; b < road->lane_count; ++b) {
            vg_run on_a[VG_RUNS_MAX], on_b[VG_RUNS_MAX];
            if (a == b || !may_conflict(road, a, b)) {
                continue;
            }
            const vg_lane *lane_a = &road->lanes[a], *lane_b = &road->lanes[b];
            uint32_t count_a = vg_lane_runs(lane_a, lane_b, VG_BODY_WIDTH_MAX, true, on_a);
            if (count_a == 0) {
                continue;
            }
            uint32_t count_b = vg_lane_runs(lane_b, lane_a, VG_BODY_WIDTH_MAX, true, on_b);
            count_a = cut_related(road, a, b, on_a, count_a);
            count_b = cut_related(road, b, a, on_b, count_b);
            for (uint32_t i = 0; i < count_a; ++i) {
                for (uint32_t k = 0; k < count_b; ++k) {
                    const bool meet = on_a[i].other_from <= on_b[k].to + walk_step
                                      && on_a[i].other_to >= on_b[k].from - walk_step
                                      && on_b[k].other_from <= on_a[i].to + walk_step
                                      && on_b[k].other_to >= on_a[i].from - walk_step;
                    if (meet && !store(road, a, b, &on_a[i], &on_b[k])) {
                        return false;
                    }
                }
            }
        }
    }
    return true;
}

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
        // Far away nothing can be missed: distances change by a metre a metre. The end is walked.
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

static bool may_conflict(const struct verge_road* road, uint32_t a, uint32_t b)
{
    const vg_relation* relation = vg_road_relation(road, a, b);
    return relation->kind == VG_UNRELATED || relation->kind == VG_MERGING
           || relation->kind == VG_DIVERGED;
}

/// Takes away what the relation of a to b covers already: behind `touch` where they merge, before
/// it where they have parted.
static uint32_t cut_related(const struct verge_road* road, uint32_t a, uint32_t b, vg_run* runs,
                            uint32_t count)
{
    const vg_relation* relation = vg_road_relation(road, a, b);
    const vg_lane* lane = &road->lanes[a];
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const double middle = vg_lane_station(lane, 0.5 * (runs[i].from + runs[i].to));
        const double touch = (double)relation->touch;
        const bool covered = (relation->kind == VG_MERGING && middle >= touch)
                             || (relation->kind == VG_DIVERGED && middle <= touch);
        if (!covered) {
            runs[kept++] = runs[i];
        }
    }
    return kept;
}

static bool store(struct verge_road* road, uint32_t a, uint32_t b, const vg_run* run_a,
                  const vg_run* run_b)
{
    if (road->conflict_count == VERGE_CONFLICTS_MAX) {
        return false;
    }
    // Half a step on both sides: the walk may have missed that much.
    const vg_lane *lane_a = &road->lanes[a], *lane_b = &road->lanes[b];
    const double pad = 0.5 * walk_step;
    vg_conflict* conflict = &road->conflicts[road->conflict_count++];
    conflict->lane = a;
    conflict->other = b;
    conflict->from = (float)vg_lane_station(lane_a, run_a->from - pad);
    conflict->to = (float)vg_lane_station(lane_a, run_a->to + pad);
    conflict->other_from = (float)vg_lane_station(lane_b, run_b->from - pad);
    conflict->other_to = (float)vg_lane_station(lane_b, run_b->to + pad);
    road->conflict_lanes |= (uint64_t)1 << a | (uint64_t)1 << b;
    return true;
}
