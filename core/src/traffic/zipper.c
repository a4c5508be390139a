/// Merging one by one at the end of a lane: the vehicles of the lane that ends and of the lane
/// beside it form one sequence, by their distance to the end, alternating where both lanes are
/// full. See order.h.
#include "traffic/order.h"

#include "base/contract.h"

// The sequence begins this far before the end. [m]
static const float zip_reach = 100.0f;
// A vehicle follows the one before it in the sequence with this distance. [m], [s]
static const float zip_gap = 2.0f, zip_headway = 0.6f;
// A vehicle in the lane that goes on lets one in unless it had to brake harder for it. [m/s^2]
static const float braking_to_let_in = 2.5f;
static const float standing = 0.5f; // [m/s]

// Vehicles of one lane, by their distance to the end.
typedef struct queue {
    uint32_t count, at;
    uint8_t  slots[VERGE_VEHICLES_MAX];
    float    left[VERGE_VEHICLES_MAX]; // [m] from the centre to the end
} queue;

static void queue_up(queue* self, const vg_model* model, const vg_flow* flow, int32_t lane,
                     float end)
{
    self->count = self->at = 0;
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        const float left = (end - flow->station[slot]) * flow->rate[slot];
        if (flow->lane[slot] != lane || left < 0.0f || left > zip_reach) {
            continue;
        }
        uint32_t k = self->count++;
        for (; k > 0 && self->left[k - 1u] > left; --k) {
            self->slots[k] = self->slots[k - 1u];
            self->left[k] = self->left[k - 1u];
        }
        self->slots[k] = (uint8_t)slot;
        self->left[k] = left;
    }
}

// The lane beside that goes on: on the side of the target, else to the left.
static int32_t lane_that_goes_on(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const verge_road* road = model->road;
    const vg_lane* lane = &road->lanes[flow->lane[slot]];
    const int32_t target = model->target[slot];
    const int32_t turn =
        target < 0 ? 0 : vg_road_turn(road, (uint32_t)flow->lane[slot], (uint32_t)target);
    const int32_t first = turn < 0 ? lane->right : lane->left;
    const int32_t second = turn < 0 ? lane->left : lane->right;
    return first >= 0 && !road->lanes[first].dead_end ? first
           : second >= 0 && !road->lanes[second].dead_end ? second : -1;
}

static float length_of(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return 2.0f * model->half_length[slot] + zip_gap + zip_headway * flow->v[slot];
}

// Can the head of the lane that goes on stay behind the head of the lane that ends?
static bool lets_in(const vg_model* model, const vg_flow* flow, const queue* on,
                    const queue* ending)
{
    const uint32_t c = on->slots[on->at], e = ending->slots[ending->at];
    const float v = flow->v[c], v_in = flow->v[e];
    const float gap = on->left[on->at] - ending->left[ending->at] - model->half_length[c]
                      - model->half_length[e];
    if (gap < 0.0f && v < standing && v_in < standing) {
        return false; // they stand side by side
    }
    return v <= v_in || v * v - v_in * v_in <= 2.0f * braking_to_let_in * vg_maxf(gap, 0.0f);
}

// Is the next vehicle one of the lane that ends? last: the one before was; 2: there was none.
static bool next_is_ending(const vg_model* model, const vg_flow* flow, const queue* on,
                           const queue* ending, uint32_t last)
{
    if (on->at == on->count || ending->at == ending->count) {
        return on->at == on->count;
    }
    const float lead = on->left[on->at] - ending->left[ending->at]; // of the one that ends
    const bool nearer = lead > 0.0f;
    bool next = nearer;
    if (last == 1 && nearer && lead < length_of(model, flow, ending->slots[ending->at])) {
        next = false;
    } else if (last == 0 && !nearer && -lead < length_of(model, flow, on->slots[on->at])) {
        next = true;
    }
    return next && lets_in(model, flow, on, ending);
}

static void zip(vg_order* self, const vg_model* model, const vg_flow* flow, queue* on,
                queue* ending)
{
    int32_t before = -1, others[2] = { -1, -1 }; // the last of the lane that goes on, that ends
    uint32_t last = 2;
    while (on->at < on->count || ending->at < ending->count) {
        const uint32_t ends = next_is_ending(model, flow, on, ending, last) ? 1 : 0;
        queue* from = ends == 1 ? ending : on;
        const uint32_t slot = from->slots[from->at];
        const float left = from->left[from->at++];
        if (before >= 0) {
            self->before[slot] |= (uint64_t)1 << before;
        }
        const int32_t other = others[1u - ends];
        if (other >= 0 && slot < model->controlled_count) {
            const vg_share share = {
                .enter = left, .leave = left, .other_enter = left, .other_leave = left,
                .lane = (uint16_t)flow->lane[slot], .other_lane = (uint16_t)flow->lane[other],
                .other = (uint8_t)other, .kind = VG_SHARE_ZIP,
            };
            vg_order_share(self, slot, &share);
        }
        before = others[ends] = (int32_t)slot;
        last = ends;
    }
}

void vg_order_zip(vg_order* self, const vg_model* model, const vg_flow* flow)
{
    queue on, ending;
    uint64_t done = 0; // slots of lanes that have been looked at
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
        if (!lane->dead_end || (done >> slot & 1u) != 0) {
            continue;
        }
        const float end = (float)lane->station_end;
        const int32_t beside = lane_that_goes_on(model, flow, slot);
        queue_up(&ending, model, flow, flow->lane[slot], end);
        for (uint32_t k = 0; k < ending.count; ++k) {
            done |= (uint64_t)1 << ending.slots[k];
        }
        if (beside >= 0 && ending.count > 0) {
            queue_up(&on, model, flow, beside, end);
            zip(self, model, flow, &on, &ending);
        }
    }
}

float vg_order_zip_wall(const vg_model* model, const vg_flow* flow, uint32_t slot, uint32_t first)
{
    VERGE_ASSERT(slot < model->controlled_count);
    const verge_road* road = model->road;
    const float ahead = (flow->station[first] - flow->station[slot]) * flow->rate[slot];
    if (flow->lane[first] == flow->lane[slot] || ahead <= 0.0f
        || road->lanes[flow->lane[first]].bundle != road->lanes[flow->lane[slot]].bundle) {
        return VG_FAR_AWAY; // it has changed lane and is the leader, or is left behind
    }
    static const float falling_back = 1.0f; // [m/s^2]
    const float v = flow->v[slot], half = model->half_length[slot];
    const float behind = ahead - model->half_length[first] - zip_gap - zip_headway * v
                         + vg_order_stopping(model, flow->v[first]);
    return vg_maxf(behind, half + v * v / (2.0f * falling_back));
}
