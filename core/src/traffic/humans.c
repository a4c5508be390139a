/// See humans.h.
#include "traffic/humans.h"
#include "base/contract.h"

#include "traffic/order.h"
#include "traffic/pairs.h"

// The parameters of the IDM in single precision. Constant divisors are stored as inverses.
typedef struct idm {
    float gap, headway_s, acceleration; // [m], [s], [m/s^2]
    float per_closing;                  // [s^2/m]
} idm;

// Acceleration of the IDM, with limited braking [m/s^2]. Gaps below 1 m count as 1 m.
VG_INLINE float acceleration_of(const idm* p, float braking, float v, float per_desired, float gap,
                                float v_lead)
{
    const float closing = v * (v - v_lead) * p->per_closing;
    const float wanted = vg_maxf(p->gap + v * p->headway_s + closing, p->gap);
    const float ratio = wanted / vg_maxf(gap, 1.0f);
    const float pace = v * per_desired;
    const float pace2 = pace * pace;
    const float a = p->acceleration * (1.0f - pace2 * pace2 - ratio * ratio);
    return vg_maxf(a, -braking);
}

// Within a long step the desired speed is reached, not exceeded. A vehicle that stands and is not
// expected to start stays where it is. The paper's model has neither.
static float fastest_of(const vg_model* model, uint32_t slot, float v)
{
    const bool stays = v < VG_CRUISE_MIN && model->cruise[slot] <= VG_CRUISE_MIN;
    return !model->best ? VG_FAR_AWAY : stays ? v : vg_maxf(v, model->cruise[slot]);
}

// Distance driven in dt from v to v1. A vehicle that comes to a stop within dt drives its stopping
// distance. [m]
VG_INLINE float distance_of(float v, float v1, float a, float dt)
{
    return v1 < 0.0f ? v * v / (-2.0f * a) : (v + v1) * (0.5f * dt);
}

// Motion against the lane, at constant speed or slower: ahead of such a vehicle is who is behind it
// on the lane's axis.
static void move_backwards(const vg_model* model, const vg_flow* flow, const idm* p,
                           const vg_neighbours* w, float dt, uint32_t i, float* station_to,
                           float* v_to)
{
    const float v = -flow->v[i];
    const float gap = w->gap_behind - model->half_length[i];
    const float v_lead = w->gap_behind < 0.5f * VG_FAR_AWAY ? -w->v_behind : v;
    const float a = vg_minf(acceleration_of(p, model->braking[i], v, 1.0f / v, gap, v_lead), 0.0f);
    const float v1 = v + a * dt;
    station_to[i] = flow->station[i] - distance_of(v, v1, a, dt) / flow->rate[i];
    v_to[i] = v1 > 0.0f ? -v1 : 0.0f;
}

static idm idm_of(const verge_planner_def* def)
{
    return (idm){ (float)def->idm_gap, (float)def->idm_headway_s, (float)def->idm_acceleration,
                  0.5f / (float)def->idm_comfort };
}

float vg_human_acceleration(const vg_model* model, uint32_t slot, float v, float gap, float v_lead)
{
    VERGE_ASSERT(slot >= model->controlled_count && slot < model->count);
    const idm p = idm_of(model->def);
    return acceleration_of(&p, model->braking[slot], v, 1.0f / model->cruise[slot], gap, v_lead);
}

float vg_human_following(const vg_model* model, uint32_t slot, float v, float gap, float v_lead)
{
    VERGE_ASSERT(slot >= model->controlled_count && slot < model->count);
    const idm p = idm_of(model->def);
    return acceleration_of(&p, model->braking[slot], v, 0.0f, gap, v_lead);
}

// The leader is the nearest vehicle in the path, controlled or not. The offset d stays as it is.
void vg_flow_human_moves(const vg_model* model, const vg_flow* flow, float dt, float* station_to,
                         float* v_to, float* y_to)
{
    VERGE_ASSERT(dt > 0.0f);
    VERGE_ASSERT(model->count <= VERGE_VEHICLES_MAX);
    const idm p = idm_of(model->def);
    for (uint32_t i = model->controlled_count; i < model->count; ++i) {
        const vg_neighbours w = vg_nearest(model, flow, i, flow->station[i], flow->y[i],
                                           flow->station, flow->v,
                                           vg_order_wall(model, flow, i));
        const float v = flow->v[i];
        if (v < 0.0f) {
            move_backwards(model, flow, &p, &w, dt, i, station_to, v_to);
            y_to[i] = flow->y[i];
            continue;
        }
        const float per_desired = 1.0f / model->cruise[i];
        const float gap = w.gap_ahead - model->half_length[i];
        // With no vehicle ahead the closing speed is 0.
        const float v_lead = w.gap_ahead < 0.5f * VG_FAR_AWAY ? w.v_ahead : v;
        const float a = acceleration_of(&p, model->braking[i], v, per_desired, gap, v_lead);
        const float v1 = vg_minf(v + a * dt, fastest_of(model, i, v));
        station_to[i] = flow->station[i] + distance_of(v, v1, a, dt) / flow->rate[i];
        v_to[i] = vg_maxf(v1, 0.0f);
        y_to[i] = flow->y[i];
    }
}
