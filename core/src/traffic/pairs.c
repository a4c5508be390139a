/// See pairs.h.
#include "traffic/pairs.h"

#include "base/contract.h"
#include "traffic/order.h"

// Vehicles on merging lanes see each other from this distance before the lanes come close. [m]
static const float merge_range = 40.0f;

vg_pairs* vg_pairs_take(vg_arena* arena, const verge_planner_def* def)
{
    const uint32_t vehicles_max = def->vehicles_max, lane_count = def->road.lane_count;
    vg_pairs* pairs = vg_arena_take(arena, sizeof *pairs);
    vg_pair* of = vg_arena_take(arena, (size_t)vehicles_max * vehicles_max * sizeof *of);
    int32_t* lane = vg_arena_take(arena, vehicles_max * sizeof *lane);
    vg_local* local = vg_local_take(arena, lane_count, vehicles_max, def->controlled_max);
    if (pairs != NULL) {
        *pairs = (vg_pairs){ vehicles_max, of, lane, local, lane_count };
    }
    return pairs;
}

static void relate(const vg_model* model, const vg_flow* flow, uint32_t seen, uint32_t observer)
{
    const vg_local* local = model->pairs->local;
    const uint32_t from = (uint32_t)flow->lane[observer];
    const uint32_t to = (uint32_t)flow->lane[seen];
    const vg_relation relation = vg_local_relation(local, from, to);
    const bool visible = vg_local_matters(local, model->column[observer], from, to);
    model->pairs->of[observer * model->pairs->stride + seen] = (vg_pair){
        .offset = visible ? relation.offset : VG_FAR_AWAY,
        .lateral = relation.lateral,
        .touch = relation.kind == VG_MERGING ? relation.touch : -VG_FAR_AWAY,
        .period = visible ? relation.period : 0.0f,
    };
}

void vg_pairs_update(const vg_model* model, const vg_flow* flow)
{
    VERGE_ASSERT(model->count <= model->pairs->stride);
    vg_pairs* pairs = model->pairs;
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        if (pairs->lane[slot] == flow->lane[slot]) {
            continue;
        }
        for (uint32_t other = 0; other < model->count; ++other) {
            relate(model, flow, slot, other);
            relate(model, flow, other, slot);
        }
        pairs->lane[slot] = flow->lane[slot];
    }
}

// Vehicles on merging lanes do not see each other until the lanes come close. A vehicle that goes
// first there need not follow one that waits before the merge.
VG_INLINE bool is_visible(const vg_model* model, const vg_flow* flow, uint32_t i, uint32_t j)
{
    const float touch = vg_pair_row(model, i)[j].touch;
    return model->single_axis
           || (flow->station[i] > touch - merge_range
               && (touch == -VG_FAR_AWAY || !vg_order_cedes(model->order, i, j)
                   || flow->station[j] > vg_pair_row(model, j)[i].touch));
}

// One search for neighbours: its inputs and its result.
typedef struct neighbour_query {
    const vg_model* model;
    const vg_flow*  flow;
    uint32_t i;           // the observing slot
    float    station, y;  // of the observer
    const float *stations, *v; // of all slots
    vg_neighbours found;
} neighbour_query;

// The innermost loop of the search, over the slots from `from` to `to` - 1, without the observer.
// Its inputs are local variables, and the case of a single axis is compiled separately, for speed.
VG_INLINE void scan(neighbour_query* self, uint32_t from, uint32_t to, bool single_axis)
{
    const vg_model* model = self->model;
    const float* restrict ys = self->flow->y;
    const float* restrict stations = self->stations;
    const float* restrict half_width = model->half_width;
    const float* restrict half_length = model->half_length;
    const vg_pair* restrict row = vg_pair_row(model, self->i);
    const float width = model->half_width[self->i] + VG_PATH_GAP, rate = self->flow->rate[self->i];
    const float station = self->station, y = self->y;
    vg_neighbours w = self->found;
    for (uint32_t j = from; j < to; ++j) {
        const float dy = single_axis ? ys[j] - y : ys[j] - y + row[j].lateral;
        if (__builtin_fabsf(dy) >= width + half_width[j]
            || (!single_axis && !is_visible(model, self->flow, self->i, j))) {
            continue;
        }
        const float ds = single_axis ? (stations[j] - station) * rate
                                     : vg_gap_along(model, self->i, j, rate, station, stations[j]);
        const float gap = __builtin_fabsf(ds) - half_length[j];
        if (ds > 0.0f && gap < w.gap_ahead) {
            w.gap_ahead = gap;
            w.v_ahead = self->v[j];
            w.ahead = (int32_t)j;
        } else if (ds <= 0.0f && gap < w.gap_behind) {
            w.gap_behind = gap;
            w.v_behind = self->v[j];
            w.behind = (int32_t)j;
        }
    }
    self->found = w;
}

vg_neighbours vg_nearest(const vg_model* model, const vg_flow* flow, uint32_t i, float station,
                         float y, const float* stations, const float* v, float free_ahead)
{
    VERGE_ASSERT(i < model->count);
    neighbour_query self = { model, flow, i, station, y, stations, v,
                             { .gap_ahead = free_ahead, .gap_behind = VG_FAR_AWAY,
                               .ahead = -1, .behind = -1 } };
    if (model->single_axis) {
        scan(&self, 0, i, true);
        scan(&self, i + 1u, model->count, true);
    } else {
        scan(&self, 0, i, false);
        scan(&self, i + 1u, model->count, false);
    }
    return self.found;
}

uint64_t vg_all_ahead(const vg_model* model, const vg_flow* flow, uint32_t i,
                      float gaps[VERGE_VEHICLES_MAX])
{
    VERGE_ASSERT(i < model->count);
    uint64_t found = 0;
    for (uint32_t j = 0; j < model->count; ++j) {
        const float width = model->half_width[i] + model->half_width[j] + VG_PATH_GAP;
        if (j == i || vg_fabsf(vg_gap_left(model, i, j, flow->y[i], flow->y[j])) >= width
            || !is_visible(model, flow, i, j)) {
            continue;
        }
        const float ds = vg_gap_along(model, i, j, flow->rate[i], flow->station[i],
                                      flow->station[j]);
        gaps[j] = ds - model->half_length[j];
        found |= ds > 0.0f && gaps[j] < VG_FAR_AWAY ? (uint64_t)1 << j : 0;
    }
    return found;
}

void vg_flow_neighbours(const vg_model* model, const vg_flow* flow, uint32_t slot, int32_t* ahead,
                        int32_t* behind)
{
    VERGE_ASSERT(slot < model->count);
    float lead = 0.1f * VG_FAR_AWAY, back = -0.1f * VG_FAR_AWAY;
    *ahead = *behind = -1;
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    for (uint32_t j = 0; j < model->count; ++j) {
        const float width = model->half_width[slot] + model->half_width[j] + VG_PATH_GAP;
        const float dy = vg_gap_left(model, slot, j, flow->y[slot], flow->y[j]);
        const float ds = vg_gap_along(model, slot, j, 1.0f, flow->station[slot], flow->station[j]);
        if (vg_fabsf(dy) >= width || j == slot) {
            continue;
        }
        if (ds > 0.0f && ds < lead) {
            lead = ds;
            *ahead = (int32_t)j;
        } else if (ds <= 0.0f && ds > back) {
            back = ds;
            *behind = (int32_t)j;
        }
    }
}
