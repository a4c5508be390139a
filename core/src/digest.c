#include "digest.h"

#include <string.h>

static uint64_t digest_u64(uint64_t digest, uint64_t value)
{
    for (uint32_t i = 0; i < 8; ++i) {
        digest = (digest ^ ((value >> (8u * i)) & 255u)) * 0x100000001b3u;
    }
    return digest;
}

static uint64_t digest_i32(uint64_t digest, int32_t value)
{
    return digest_u64(digest, (uint64_t)(int64_t)value);
}

static uint64_t digest_double(uint64_t digest, double value)
{
    uint64_t bits = 0;
    value += 0.0; // minus zero becomes zero: equal numbers have equal digests
    memcpy(&bits, &value, sizeof bits);
    return digest_u64(digest, bits);
}

static uint64_t digest_actions(uint64_t digest, const verge_vehicle_plan* plan)
{
    digest = digest_u64(digest, plan->action_count);
    digest = digest_i32(digest, (int32_t)plan->decided);
    for (uint32_t i = 0; i < plan->action_count; ++i) {
        const verge_action_step* step = &plan->actions[i];
        digest = digest_i32(digest, (int32_t)step->action);
        digest = digest_i32(digest, step->lane_id);
        const double values[] = { step->t0, step->t1, step->s, step->d, step->v };
        for (uint32_t k = 0; k < sizeof values / sizeof values[0]; ++k) {
            digest = digest_double(digest, values[k]);
        }
        digest = digest_i32(digest, step->brake_light);
        digest = digest_i32(digest, step->turn_signal);
        digest = digest_i32(digest, step->ahead_id);
        digest = digest_i32(digest, step->behind_id);
    }
    return digest;
}

// A vehicle that nothing holds back has the digest that it had before plans stated a reason.
static uint64_t digest_order(uint64_t digest, const verge_vehicle_plan* plan)
{
    if (plan->why.code != VERGE_WHY_NONE) {
        digest = digest_i32(digest, (int32_t)plan->why.code);
        digest = digest_i32(digest, plan->why.vehicle_id);
        digest = digest_i32(digest, plan->why.lane_id);
    }
    for (uint32_t i = 0; i < plan->pass_count; ++i) {
        digest = digest_i32(digest, plan->passes[i].lane_id);
        digest = digest_i32(digest, plan->passes[i].other_lane_id);
        digest = digest_i32(digest, plan->passes[i].after_id);
    }
    return digest;
}

static uint64_t digest_points(uint64_t digest, const verge_vehicle_plan* plan)
{
    digest = digest_u64(digest, plan->point_count);
    for (uint32_t i = 0; i < plan->point_count; ++i) {
        const verge_point* p = &plan->points[i];
        const double values[] = { p->t,     p->x,            p->y,         p->heading,
                                  p->speed, p->acceleration, p->curvature, p->jerk };
        for (uint32_t k = 0; k < sizeof values / sizeof values[0]; ++k) {
            digest = digest_double(digest, values[k]);
        }
    }
    const verge_cost* c = &plan->cost;
    const double costs[] = { c->total,        c->curvature, c->heading, c->offset,
                             c->acceleration, c->jerk,      c->obstacle };
    for (uint32_t k = 0; k < sizeof costs / sizeof costs[0]; ++k) {
        digest = digest_double(digest, costs[k]);
    }
    return digest;
}

uint64_t vg_digest_plan(const verge_plan* plan)
{
    uint64_t digest = digest_u64(0xcbf29ce484222325u, (uint64_t)plan->utime);
    for (uint32_t v = 0; v < plan->vehicle_count; ++v) {
        const verge_vehicle_plan* vehicle = &plan->vehicles[v];
        digest = digest_i32(digest, vehicle->vehicle_id);
        digest = digest_i32(digest, (int32_t)vehicle->status);
        digest = digest_i32(digest, (int32_t)vehicle->reason);
        digest = digest_actions(digest, vehicle);
        digest = digest_order(digest, vehicle);
        digest = digest_points(digest, vehicle);
    }
    for (uint32_t v = 0; v < plan->prediction_count; ++v) {
        const verge_prediction* prediction = &plan->predictions[v];
        digest = digest_i32(digest, prediction->vehicle_id);
        for (uint32_t i = 0; i < prediction->point_count; ++i) {
            digest = digest_double(digest, prediction->points[i].x);
            digest = digest_double(digest, prediction->points[i].y);
            digest = digest_double(digest, prediction->points[i].heading);
        }
    }
    return digest;
}
