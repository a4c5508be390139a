/// See humans.h.
#include "traffic/humans.h"

#include "traffic/pairs.h"

// The IDM's parameters in single precision. Constant divisors are given as their inverses.
typedef struct idm {
    float gap, headway_s, acceleration; // [m], [s], [m/s^2]
    float per_closing;                  // [s^2/m]
} idm;

// [m/s^2], with a limit of the braking; the gap is taken as 1 m at least.
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

// The IDM behind the nearest vehicle in the path, controlled or not; the lane is kept as driven.
void vg_flow_human_moves(const vg_model* model, const vg_flow* flow, float dt, float* station_to,
                         float* v_to, float* y_to)
{
    const verge_planner_def* def = model->def;
    const idm p = { (float)def->idm_gap, (float)def->idm_headway_s, (float)def->idm_acceleration,
                    0.5f / (float)def->idm_comfort };
    for (uint32_t i = model->controlled_count; i < model->count; ++i) {
        const vg_neighbours w =
            vg_nearest(model, flow, i, flow->station[i], flow->y[i], flow->station, flow->v, VG_FAR_AWAY);
        const float per_desired = 1.0f / model->cruise[i];
        const float gap = w.gap_ahead - model->half_length[i];
        const float v = flow->v[i];
        const float v_lead = w.gap_ahead < 0.5f * VG_FAR_AWAY ? w.v_ahead : v; // free road: no closing
        const float a = acceleration_of(&p, model->braking[i], v, per_desired, gap, v_lead);
        const float v1 = v + a * dt;
        // A vehicle that stops drives no farther than to the stop.
        const float distance = v1 < 0.0f ? v * v / (-2.0f * a) : (v + v1) * (0.5f * dt);
        station_to[i] = flow->station[i] + distance / flow->rate[i];
        v_to[i] = vg_maxf(v1, 0.0f);
        y_to[i] = flow->y[i];
    }
}
