/// See goal.h. In a scene without such bodies the cost is one comparison a vehicle and step.
#include "traffic/goal.h"

#include "base/contract.h"
#include "base/scalar.h"

// Room to pass a body, besides the own width: both sides together; and of a narrow body, who may be
// on a bicycle. [m]
static const float room_min = 0.6f, room_min_narrow = 1.0f;
static const float narrow = 0.5f; // half width
// Distance kept from the body, and at least to the other side of the lane. [m]
static const float clear = 0.5f, clear_narrow = 1.0f, clear_border = 0.1f;
// Highest speed beside a body, the same with less than `clear`, and braking down to it. [m/s],
// [m/s^2]
static const float speed_beside = 8.0f, speed_close = 5.0f, braking = 1.5f;
// A vehicle is at its goal this far, or this time, before it reaches the body, and until it is
// past. [m], [s], [m]
static const float lead_distance = 15.0f, lead_time = 3.0f, tail_distance = 1.0f;

static void add_body(vg_model* model, const vg_flow* flow, uint32_t slot, int32_t lane, float d)
{
    const float half = 0.5f * (float)model->road->lanes[lane].width;
    const float low = d - model->half_width[slot], high = d + model->half_width[slot];
    if (high > -half && low < half && model->body_count < VG_BODIES_MAX) {
        const float reach = model->half_length[slot] / flow->rate[slot];
        model->bodies[model->body_count++] = (vg_body_beside){
            .lane = lane, .from = flow->station[slot] - reach, .to = flow->station[slot] + reach,
            .low = low, .high = high, .narrow = model->half_width[slot] < narrow,
        };
    }
}

void vg_model_find_bodies(vg_model* model, const vg_flow* flow)
{
    VERGE_ASSERT(model->body_count == 0);
    for (uint32_t slot = model->controlled_count; slot < model->count; ++slot) {
        if (model->standing[slot] != VG_STATIC) {
            continue;
        }
        const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
        add_body(model, flow, slot, flow->lane[slot], flow->d[slot]);
        if (lane->left >= 0 && flow->left_gap[slot] > 0.0f) {
            add_body(model, flow, slot, lane->left, flow->d[slot] - flow->left_gap[slot]);
        }
        if (lane->right >= 0 && flow->right_gap[slot] > 0.0f) {
            add_body(model, flow, slot, lane->right, flow->d[slot] + flow->right_gap[slot]);
        }
    }
}

// The part of a lane that bodies leave free between two stations.
typedef struct gap {
    float low, high;      // [m] d of its sides
    float clear;          // [m] to be kept from bodies
    float room;           // [m] needed besides the own width
    float from;           // [m] station at which the first body begins
    bool  low_is_body, high_is_body;
} gap;

static gap gap_between(const vg_model* model, int32_t lane, float from, float to)
{
    const float half = 0.5f * (float)model->road->lanes[lane].width;
    gap free = { .low = -half, .high = half, .clear = clear, .room = room_min, .from = to };
    for (uint32_t k = 0; k < model->body_count; ++k) {
        const vg_body_beside* body = &model->bodies[k];
        if (body->lane != lane || body->to < from || body->from > to) {
            continue;
        }
        const bool on_right = body->low + body->high < 0.0f;
        free.low = on_right ? vg_maxf(free.low, body->high) : free.low;
        free.high = on_right ? free.high : vg_minf(free.high, body->low);
        free.low_is_body = free.low_is_body || on_right;
        free.high_is_body = free.high_is_body || !on_right;
        free.clear = body->narrow ? clear_narrow : free.clear;
        free.room = body->narrow ? room_min_narrow : free.room;
        free.from = vg_minf(free.from, body->from);
    }
    return free;
}

// The d nearest to the centre at which the vehicle fits through; false: it does not. kept: the
// distance that is left to the bodies. [m]
static bool fits_through(const vg_model* model, const gap* free, uint32_t slot, float* d,
                         float* kept)
{
    const float half = model->half_width[slot];
    const float room = free->high - free->low - 2.0f * half;
    const bool both = free->low_is_body && free->high_is_body;
    *kept = vg_minf(free->clear, both ? 0.5f * room : room - clear_border);
    const float lowest = free->low + half + (free->low_is_body ? *kept : clear_border);
    const float highest = free->high - half - (free->high_is_body ? *kept : clear_border);
    *d = vg_maxf(vg_minf(0.0f, highest), lowest);
    return room >= free->room;
}

float vg_lane_goal(const vg_model* model, const vg_flow* flow, uint32_t slot, float station)
{
    return vg_goal_in(model, flow, slot, flow->lane[slot], station);
}

float vg_goal_in(const vg_model* model, const vg_flow* flow, uint32_t slot, int32_t lane,
                 float station)
{
    VERGE_ASSERT(slot < model->controlled_count);
    VERGE_ASSERT(lane >= 0 && lane < (int32_t)model->road->lane_count);
    if (model->body_count == 0) {
        return 0.0f;
    }
    const float per_metre = 1.0f / flow->rate[slot];
    const float half = model->half_length[slot];
    const float lead = vg_maxf(lead_distance, lead_time * flow->v[slot]);
    const gap free = gap_between(model, lane,
                                 flow->station[slot] - (half + tail_distance) * per_metre,
                                 station + (half + lead) * per_metre);
    float d, kept;
    const bool passes = (free.low_is_body || free.high_is_body)
                        && fits_through(model, &free, slot, &d, &kept);
    return passes ? d : 0.0f;
}

void vg_goal_limit(const vg_model* model, vg_flow* flow, uint32_t slot)
{
    VERGE_ASSERT(slot < model->controlled_count);
    const float rate = flow->rate[slot], half = model->half_length[slot];
    const float v = vg_maxf(flow->v[slot], flow->limit[slot]);
    const float view = half + v * v / (2.0f * braking);
    const gap free = gap_between(model, flow->lane[slot],
                                 flow->station[slot] - (half + tail_distance) / rate,
                                 flow->station[slot] + view / rate);
    float d, kept;
    if ((free.low_is_body || free.high_is_body) && fits_through(model, &free, slot, &d, &kept)) {
        // A body that leaves the centre of the lane free is passed as if it were not there.
        const bool aside = d != 0.0f || kept < clear;
        const float beside = kept < clear ? speed_close : speed_beside;
        const float left = vg_maxf((free.from - flow->station[slot]) * rate - half, 0.0f);
        const float now = (float)vg_sqrt((double)(beside * beside + 2.0f * braking * left));
        flow->limit[slot] = aside ? vg_minf(flow->limit[slot], now) : flow->limit[slot];
    }
}
