/// See belief.h.
#include "traffic/belief.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/humans.h"
#include "traffic/pairs.h"

#include <string.h>

// Between two updates lies at least this, and at most that: else the belief begins anew. [s]
static const double interval_min = 0.4, interval_max = 2.0;
// Differences that halve the weight of a hypothesis. [m/s^2], [m/s]
static const double acceleration_scale = 0.7, lateral_scale = 0.3;
// So much of a weight is what is usual; and the least that an option has had before. [1]
static const double usual_share = 0.1, weight_min = 0.02;
// What is usual: of a vehicle with nothing to wait for, and of one that has to yield. 0: not an
// option there. One that has to yield and goes on as before is one that insists. [1]
static const double usual_free[VERGE_HYPOTHESIS_COUNT] = { 0.80, 0.15, 0.0, 0.0, 0.05 };
static const double usual_yielding[VERGE_HYPOTHESIS_COUNT] = { 0.0, 0.0, 0.90, 0.05, 0.05 };
// Drivers begin to brake for a line where they need this. [m/s^2]
static const float braking_usual = 1.0f;
// Acceleration of one that speeds up, lateral speed of one that changes lane. [m/s^2], [m/s]
static const float speeding_up = 1.0f;
static const double changing = 0.7;

const char* verge_hypothesis_name(verge_hypothesis hypothesis)
{
    static const char* const names[VERGE_HYPOTHESIS_COUNT] = {
        "keeps_on", "speeds_up", "yields", "insists", "changes_lane",
    };
    return (unsigned)hypothesis < VERGE_HYPOTHESIS_COUNT ? names[hypothesis] : "??";
}

const verge_belief* vg_belief_of(const verge_beliefs* beliefs, int32_t id)
{
    for (uint32_t k = 0; beliefs != NULL && k < beliefs->count && k < VERGE_VEHICLES_MAX; ++k) {
        if (beliefs->of[k].vehicle_id == id) {
            return &beliefs->of[k];
        }
    }
    return NULL;
}

// Lateral speed towards a lane that lies there; 0: it keeps its lane. [m/s]
static double lateral_speed(const vg_model* model, const vg_flow* flow, const verge_scene* scene,
                            uint32_t slot)
{
    const uint32_t i = model->input_index[slot];
    const verge_vehicle* vehicle = &scene->vehicles[i];
    double sine, cosine;
    vg_sincos(vg_wrap_angle(vehicle->heading - scene->positions[i].heading), &sine, &cosine);
    const double rate = vehicle->speed * sine;
    const float gap = rate > 0.0 ? flow->left_gap[slot] : flow->right_gap[slot];
    return gap > 0.0f ? vg_abs(rate) : 0.0;
}

// The acceleration from now on, by each hypothesis. line: [m] where it has to wait, from its front.
static void expect(verge_belief* belief, const vg_model* model, const vg_flow* flow, uint32_t slot,
                   float line)
{
    const vg_neighbours w = vg_nearest(model, flow, slot, flow->station[slot], flow->y[slot],
                                       flow->station, flow->v, VG_FAR_AWAY);
    const float v = flow->v[slot];
    const bool alone = w.gap_ahead >= 0.5f * VG_FAR_AWAY || v < 0.0f;
    const float gap = w.gap_ahead - model->half_length[slot];
    const float keeps =
        alone ? 0.0f : vg_minf(vg_human_following(model, slot, v, gap, w.v_ahead), 0.0f);
    const float up = v < flow->limit[slot] ? speeding_up : 0.0f;
    const float needed = line >= VG_FAR_AWAY ? 0.0f : 0.5f * v * v / vg_maxf(line, 0.5f);
    belief->expected[VERGE_KEEPS_ON] = keeps;
    belief->expected[VERGE_SPEEDS_UP] = keeps < 0.0f ? keeps : up;
    belief->expected[VERGE_YIELDS] = vg_minf(keeps, needed < braking_usual ? 0.0f : -needed);
    belief->expected[VERGE_INSISTS] = keeps;
    belief->expected[VERGE_CHANGES_LANE] = keeps;
}

// How well a hypothesis explains what was measured. [1] 0 .. 1
static double likelihood(const verge_belief* belief, uint32_t hypothesis, double acceleration,
                         double lateral)
{
    const double expected = (double)belief->expected[hypothesis];
    const double across = hypothesis == VERGE_CHANGES_LANE ? changing : 0.0;
    double a = (acceleration - expected) / acceleration_scale;
    double y = (lateral - across) / lateral_scale;
    // Who insists may speed up, who yields may brake early, and who changes lane do it faster.
    const bool more = (hypothesis == VERGE_INSISTS && a > 0.0)
                      || (hypothesis == VERGE_YIELDS && a < 0.0);
    a = more ? 0.0 : a;
    y = hypothesis == VERGE_CHANGES_LANE && y > 0.0 ? 0.0 : y;
    return 1.0 / ((1.0 + a * a) * (1.0 + y * y));
}

static void weigh(verge_belief* belief, const double* usual, double acceleration, double lateral)
{
    double weights[VERGE_HYPOTHESIS_COUNT], sum = 0.0;
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        const double before = vg_max((double)belief->weights[k], weight_min);
        weights[k] = usual[k] > 0.0 ? before * likelihood(belief, k, acceleration, lateral) : 0.0;
        sum += weights[k];
    }
    double whole = 0.0;
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        weights[k] = (1.0 - usual_share) * weights[k] / sum + usual_share * usual[k];
        whole += weights[k];
    }
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        belief->weights[k] = (float)(weights[k] / whole);
    }
}

static verge_belief belief_at_first(int32_t id, const double* usual)
{
    verge_belief belief = { .vehicle_id = id };
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        belief.weights[k] = (float)usual[k];
    }
    return belief;
}

void vg_belief_update(verge_beliefs* beliefs, const vg_model* model, const vg_flow* flow,
                      const verge_scene* scene, const vg_order* order)
{
    VERGE_ASSERT(model->count <= VERGE_VEHICLES_MAX);
    verge_beliefs now;
    memset(&now, 0, sizeof now);
    for (uint32_t slot = model->controlled_count; slot < model->count; ++slot) {
        const int32_t id = scene->vehicles[model->input_index[slot]].id;
        const float line = order != NULL ? vg_order_line_to_yield(order, model, slot) : VG_FAR_AWAY;
        const double* usual = line < VG_FAR_AWAY ? usual_yielding : usual_free;
        const verge_belief* before = vg_belief_of(beliefs, id);
        const double v = (double)flow->v[slot];
        const double dt = before != NULL ? vg_seconds_between(before->utime, scene->utime) : -1.0;
        verge_belief* belief = &now.of[now.count++];
        *belief = dt >= 0.0 && dt <= interval_max ? *before : belief_at_first(id, usual);
        if (dt >= 0.0 && dt < interval_min) {
            continue;
        }
        if (dt >= interval_min && dt <= interval_max) {
            weigh(belief, usual, (v - before->speed) / dt,
                  lateral_speed(model, flow, scene, slot));
        }
        belief->utime = scene->utime;
        belief->speed = v;
        expect(belief, model, flow, slot, line);
    }
    *beliefs = now;
}
