/// See conflict.h.
#include "traffic/conflict.h"
#include "base/contract.h"

#include "traffic/order.h"
#include "traffic/pairs.h"

// Smallest gap between two bodies after joint actions. [m]
static const float joint_gap_along = 1.0f;
static const float joint_gap_across = 0.3f;
// A vehicle that turns out slowly before a body that stands does not move along a straight line:
// the trajectory knows whether it gets past. [m/s], lateral motion of the step [m]
static const float turning_speed = 3.0f, turning_offset = 0.3f;

static bool areas_conflict(const vg_model* model, const vg_flow* flow, const float* station1,
                           uint32_t i, uint32_t j);

// Does the segment from (x0, y0) to (x1, y1) intersect the box |x| < ex, |y| < ey? The test is
// exact (separating axes: the two axes of the box and the normal of the segment).
static bool crosses(float x0, float y0, float x1, float y1, float ex, float ey)
{
    const float dx = x1 - x0, dy = y1 - y0;
    return vg_minf(x0, x1) < ex && vg_maxf(x0, x1) > -ex && vg_minf(y0, y1) < ey
           && vg_maxf(y0, y1) > -ey
           && vg_fabsf(x0 * dy - y0 * dx) <= ex * vg_fabsf(dy) + ey * vg_fabsf(dx);
}

// Positions of all vehicles after their actions, on the axes of their present lanes.
typedef struct chosen {
    float station[VERGE_VEHICLES_MAX], y[VERGE_VEHICLES_MAX];
} chosen;

// The lateral position includes the slope of the lane: an acceleration lane approaches its
// neighbour.
static void choose_moves(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                         const uint8_t* actions, chosen* restrict to)
{
    for (uint32_t i = 0; i < model->count; ++i) {
        const uint8_t action = i < model->controlled_count ? actions[i] : (uint8_t)VERGE_KEEP_SPEED;
        const float station = moves->station[vg_actions[action].along][i];
        to->station[i] = station;
        to->y[i] =
            moves->y[vg_actions[action].across][i] + flow->slope[i] * (station - flow->station[i]);
    }
}

// A body that stands needs less distance.
static float gap_along_to(const vg_model* model, const vg_flow* flow, uint32_t j)
{
    const bool stands = model->best && j >= model->controlled_count
                        && model->standing[j] != VG_MOVING && vg_fabsf(flow->v[j]) < 0.1f;
    return stands ? joint_gap_across : joint_gap_along;
}

// Do two vehicles come too close between the two instants? x0, x1: distance from i ahead to j,
// before and after [m]. Relative motion is linear. Bodies with a smaller gap than required may move
// as long as they do not touch. Overlapping bodies may only separate.
static bool too_close(const vg_model* model, const vg_flow* flow, const chosen* to, uint32_t i,
                      uint32_t j, float x0, float x1)
{
    if (!model->single_axis
        && (to->station[i] <= vg_pair_row(model, i)[j].touch
            || (model->best && to->station[j] <= vg_pair_row(model, j)[i].touch))) {
        return false; // one of them is not where their lanes come close
    }
    const float y0 = vg_gap_left(model, i, j, flow->y[i], flow->y[j]);
    const float y1 = vg_gap_left(model, i, j, to->y[i], to->y[j]);
    const float length = model->half_length[i] + model->half_length[j];
    const float width = model->half_width[i] + model->half_width[j];
    const float gap = gap_along_to(model, flow, j);
    const float ex = length + gap, ey = width + joint_gap_across;
    if (gap < joint_gap_along && flow->v[i] <= turning_speed
        && vg_fabsf(y1 - y0) > turning_offset) {
        return vg_fabsf(x1) < length && vg_fabsf(y1) < width;
    }
    if (!model->single_axis && flow->station[i] <= vg_pair_row(model, i)[j].touch) {
        // Their lanes come close in this step only: their distance before it has no meaning.
        return crosses(x0, y0, x1, y1, ex, ey);
    }
    if (vg_fabsf(x0) < length && vg_fabsf(y0) < width) {
        return vg_fabsf(x1) < length && vg_fabsf(y1) < width && vg_fabsf(x1) <= vg_fabsf(x0)
               && vg_fabsf(y1) <= vg_fabsf(y0);
    }
    if (vg_fabsf(x0) < ex && vg_fabsf(y0) < ey) {
        return crosses(x0, y0, x1, y1, length, width);
    }
    return crosses(x0, y0, x1, y1, ex, ey);
}

// Conflicts of slot i with the slots after it. In most pairs one vehicle stays ahead of the other
// with enough distance, which is tested first.
VG_INLINE uint32_t conflicts_after(const vg_model* model, const vg_flow* flow, const chosen* to,
                                   uint32_t i, bool single_axis)
{
    const float* restrict before = flow->station;
    const float* restrict after = to->station;
    const float* restrict half_length = model->half_length;
    const float rate = flow->rate[i], station0 = before[i], station1 = after[i];
    const float ex = half_length[i] + joint_gap_along;
    const uint32_t count = model->count;
    uint32_t conflicts = 0;
    for (uint32_t j = i + 1u; j < count; ++j) {
        const float x0 = single_axis ? (before[j] - station0) * rate
                                     : vg_gap_along(model, i, j, rate, station0, before[j]);
        const float x1 = single_axis ? (after[j] - station1) * rate
                                     : vg_gap_along(model, i, j, rate, station1, after[j]);
        const float reach = ex + half_length[j];
        if ((x0 >= reach && x1 >= reach) || (x0 <= -reach && x1 <= -reach)) {
            continue;
        }
        if (too_close(model, flow, to, i, j, x0, x1)) {
            conflicts |= 1u << i | (j < model->controlled_count ? 1u << j : 0u);
        }
    }
    return conflicts;
}

// Controlled vehicles (bits) that would enter an area which another one sweeps.
static __attribute__((noinline)) uint32_t conflicts_in_areas(const vg_model* model,
                                                             const vg_flow* flow, const chosen* to)
{
    uint32_t conflicts = 0;
    if (model->order != NULL) {
        for (uint32_t i = 0; i < model->controlled_count; ++i) {
            conflicts |= vg_order_conflict(model, flow, to->station, i) ? 1u << i : 0u;
        }
        return conflicts;
    }
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        for (uint32_t j = 0; j < model->count; ++j) {
            if (i != j && areas_conflict(model, flow, to->station, i, j)) {
                conflicts |= 1u << i;
            }
        }
    }
    return conflicts;
}

uint32_t vg_flow_conflicts(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                           const uint8_t* actions)
{
    VERGE_ASSERT(model->controlled_count <= model->count);
    uint32_t conflicts = 0;
    chosen to;
    choose_moves(model, flow, moves, actions, &to);
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        conflicts |= model->single_axis ? conflicts_after(model, flow, &to, i, true)
                                        : conflicts_after(model, flow, &to, i, false);
    }
    if (model->conflicts) {
        conflicts |= conflicts_in_areas(model, flow, &to);
    }
    return conflicts;
}

static bool sweeps(float from, float to, float half, float area_from, float area_to)
{
    return to + half > area_from && from - half < area_to;
}

// Would vehicle i enter a conflict area that vehicle j uses in the same step? A vehicle that is
// already in the area may leave it.
static bool areas_conflict(const vg_model* model, const vg_flow* flow, const float* station1,
                           uint32_t i, uint32_t j)
{
    const verge_road* road = model->road;
    const uint32_t lane_i = (uint32_t)flow->lane[i], lane_j = (uint32_t)flow->lane[j];
    if (!vg_road_has_conflicts(road, lane_i) || !vg_road_has_conflicts(road, lane_j)) {
        return false;
    }
    const float half_i = model->half_length[i], half_j = model->half_length[j];
    for (uint32_t k = road->conflicts_from[lane_i]; k < road->conflicts_from[lane_i + 1u]; ++k) {
        const vg_conflict* area = &road->conflicts[k];
        if (area->other != lane_j || area->parts) {
            continue;
        }
        const bool in_i = sweeps(flow->station[i], flow->station[i], half_i, area->from, area->to);
        const bool will_i = sweeps(flow->station[i], station1[i], half_i, area->from, area->to);
        const bool will_j =
            sweeps(flow->station[j], station1[j], half_j, area->other_from, area->other_to);
        if (!in_i && will_i && will_j) {
            return true;
        }
    }
    return false;
}
