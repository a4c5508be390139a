/// What holds for every built road: vg_road_holds().
#include "road/build.h"

#include "base/scalar.h"

/// Arc length and station are inverse to one another to this, in bins of single precision. [m]
static const double station_error = 0.05;
/// A spline's arc length differs from the distance of its knots by less than this share.
static const double chord_share = 0.2;

static bool knots_hold(const vg_lane* lane)
{
    const vg_line* line = &lane->line;
    const double end = line->knot_spacing * (double)(line->knot_count - 1);
    bool holds = line->knot_count >= 2 && vg_finite(lane->length) && lane->length > 0.0
                 && vg_abs(end - lane->length) <= 1e-9 * lane->length;
    for (uint32_t i = 0; holds && i < line->knot_count; ++i) {
        holds = vg_finite(line->x[i]) && vg_finite(line->y[i]) && vg_finite(line->xss[i])
                && vg_finite(line->yss[i]);
    }
    for (uint32_t i = 1; holds && i < line->knot_count; ++i) {
        const double dx = line->x[i] - line->x[i - 1], dy = line->y[i] - line->y[i - 1];
        holds = vg_sqrt(dx * dx + dy * dy) <= (1.0 + chord_share) * line->knot_spacing;
    }
    return holds;
}

static bool bin_holds(const vg_lane* lane, const vg_bin* bin)
{
    return vg_finite((double)bin->s) && vg_finite((double)bin->lateral) && bin->left_gap >= 0.0f
           && bin->right_gap >= 0.0f && bin->speed > 0.0f
           && (double)bin->speed <= lane->speed_limit + 1e-3
           && (double)bin->speed >= lane->speed_min - 1e-3;
}

static bool stations_hold(const vg_lane* lane)
{
    bool holds = lane->bin_count >= 2 && lane->station_end > lane->station_start;
    for (uint32_t i = 0; holds && i < lane->bin_count; ++i) {
        holds = bin_holds(lane, &lane->bins[i])
                && (i == 0 || lane->bins[i].s > lane->bins[i - 1].s);
    }
    const double covered = lane->station_start + VG_BIN * (double)(lane->bin_count - 1);
    return holds && covered >= lane->station_end - station_error
           && vg_abs(vg_lane_s(lane, lane->station_start)) <= station_error
           && vg_abs(vg_lane_s(lane, lane->station_end) - lane->length) <= station_error
           && vg_abs(vg_lane_station(lane, lane->length) - lane->station_end) <= station_error;
}

static bool is_lane(const struct verge_road* road, int32_t index)
{
    return index >= 0 && index < (int32_t)road->lane_count;
}

static bool leads_to(const vg_lane* lane, uint32_t next)
{
    bool leads = false;
    for (uint32_t k = 0; k < lane->successor_count; ++k) {
        leads = leads || lane->successors[k] == (int32_t)next;
    }
    return leads;
}

static bool links_hold(const struct verge_road* road, uint32_t index)
{
    const vg_lane* lane = &road->lanes[index];
    bool holds = (lane->left == -1 || is_lane(road, lane->left))
                 && (lane->right == -1 || is_lane(road, lane->right))
                 && lane->successor_count <= VERGE_SUCCESSORS_MAX
                 && lane->bundle < road->lane_count && lane->stop_line <= lane->length;
    for (uint32_t k = 0; holds && k < lane->successor_count; ++k) {
        holds = is_lane(road, lane->successors[k]);
    }
    for (uint32_t k = 0; holds && k < vg_lane_predecessor_count(road, index); ++k) {
        const int32_t before = vg_lane_predecessor(road, index, k);
        holds = is_lane(road, before) && leads_to(&road->lanes[before], index)
                && (k == 0 || before > vg_lane_predecessor(road, index, k - 1));
    }
    return holds;
}

/// Is the same area listed for the other lane, with the stretches exchanged?
static bool has_counterpart(const struct verge_road* road, uint32_t index,
                            const vg_conflict* conflict)
{
    bool has = false;
    for (uint32_t k = road->conflicts_from[conflict->other];
         k < road->conflicts_from[conflict->other + 1u]; ++k) {
        const vg_conflict* other = &road->conflicts[k];
        has = has || (other->other == index && other->from == conflict->other_from
                      && other->to == conflict->other_to);
    }
    return has;
}

static bool meetings_hold(const struct verge_road* road, uint32_t index)
{
    bool holds = road->merges_from[index] <= road->merges_from[index + 1]
                 && road->conflicts_from[index] <= road->conflicts_from[index + 1];
    for (uint32_t k = road->merges_from[index]; holds && k < road->merges_from[index + 1]; ++k) {
        const vg_merge* merge = &road->merges[k];
        holds = is_lane(road, merge->other) && merge->other != index
                && (k == road->merges_from[index] || merge->other > merge[-1].other);
    }
    for (uint32_t k = road->conflicts_from[index]; holds && k < road->conflicts_from[index + 1];
         ++k) {
        const vg_conflict* conflict = &road->conflicts[k];
        holds = is_lane(road, conflict->other) && conflict->from <= conflict->to
                && conflict->other_from <= conflict->other_to
                && (k == road->conflicts_from[index] || conflict->other >= conflict[-1].other)
                && has_counterpart(road, index, conflict);
    }
    return holds;
}

bool vg_road_holds(const struct verge_road* road)
{
    bool holds = road != NULL && road->lane_count >= 1 && road->lane_count <= VERGE_LANES_MAX;
    for (uint32_t i = 0; holds && i < road->lane_count; ++i) {
        const vg_lane* lane = &road->lanes[i];
        holds = knots_hold(lane) && stations_hold(lane) && links_hold(road, i)
                && meetings_hold(road, i)
                && (i == 0 || road->lanes[road->by_id[i]].id > road->lanes[road->by_id[i - 1]].id);
    }
    return holds;
}
