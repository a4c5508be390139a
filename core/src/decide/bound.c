/// See bound.h.

#include "decide/bound.h"

#include "base/contract.h"
#include "base/scalar.h"

typedef enum kind {
    nothing, // before the first step: any action goes with it
    keep,
    accelerate,
    change,
    kind_count,
} kind;

static_assert(VERGE_ACTION_COUNT == 5, "a bound counts every kind of action: keep, accelerate, change");

// One vehicle's problem.
typedef struct problem {
    const vg_model* scene;
    uint32_t steps, slot;
    uint32_t halves;   // half changes from here to the target's centre
    bool     lost;     // no way to the target is known: nothing is ruled out
    double   v, gain;  // [m/s]
    double   full;     // [m/s] speed at which a step earns all
    double   limit;    // [m/s] beyond which nobody accelerates
} problem;

// Values of one step: [half changes made][times accelerated][last kind].
typedef double layer[VERGE_STEPS_MAX + 1][VERGE_STEPS_MAX + 1][kind_count];

// Worth of a place with this many half changes left; between lanes nothing.
static double worth_of(const problem* self, uint32_t left)
{
    if (self->lost || left == 0) {
        return 1.0;
    }
    return left % 2u == 0 ? VG_VALUE_ONE_CHANGE / (double)(left / 2u) : 0.0;
}

static double pace_of(const problem* self, uint32_t accelerated)
{
    return vg_min((self->v + self->gain * (double)accelerated) / self->full, 1.0);
}

// Ending here, by the horizon or because all are done: the remaining share earns as it stands.
static double end_value(const problem* self, uint32_t left, uint32_t accelerated, double rest)
{
    const verge_planner_def* def = self->scene->def;
    return worth_of(self, left)
               * (def->reward_target + def->reward_lane * rest * pace_of(self, accelerated))
           + def->reward_consistency * rest;
}

// The best that can follow from one state, given the values a step later.
static double best_value(const problem* self, const layer* later, uint32_t step, uint32_t made,
                         uint32_t accelerated, kind last)
{
    const verge_planner_def* def = self->scene->def;
    const double share = 1.0 / (double)self->steps;
    const uint32_t left = self->halves - made;
    double best = end_value(self, left, accelerated, (double)(self->steps - step) * share);
    for (kind k = keep; k <= change; k = (kind)(k + 1)) {
        // Between lanes keeping goes to a centre as well; a change that has arrived is none.
        const uint32_t on = left > 0 && (k == change || left % 2u == 1u) ? 1u : 0u;
        const uint32_t faster = k == accelerate ? 1u : 0u;
        const double v = self->v + self->gain * (double)(accelerated + faster);
        if ((k == change && left == 0) || (k == accelerate && v > self->limit + 1e-3)) {
            continue;
        }
        const double lane = worth_of(self, left - on) * pace_of(self, accelerated + faster);
        const double steady = last == nothing || last == k ? def->reward_consistency : 0.0;
        const double value = share * (def->reward_lane * lane + steady)
                             + (*later)[made + on][accelerated + faster][k];
        best = value > best ? value : best;
    }
    return best;
}

static double solve(const problem* self)
{
    layer buffer[2];
    const uint32_t steps = self->steps;
    for (uint32_t made = 0; made <= steps && made <= self->halves; ++made) {
        for (uint32_t n = 0; n <= steps; ++n) {
            for (uint32_t k = 0; k < kind_count; ++k) {
                buffer[steps % 2u][made][n][k] = end_value(self, self->halves - made, n, 0.0);
            }
        }
    }
    for (uint32_t step = steps; step > 0; --step) {
        const uint32_t t = step - 1u;
        for (uint32_t made = 0; made <= t && made <= self->halves; ++made) {
            for (uint32_t n = 0; n <= t; ++n) {
                for (uint32_t k = 0; k < kind_count; ++k) {
                    buffer[t % 2u][made][n][k] =
                        best_value(self, &buffer[step % 2u], t, made, n, (kind)k);
                }
            }
        }
    }
    return buffer[0][0][0][nothing];
}

static problem problem_of(const vg_model* scene, const vg_flow* root, uint32_t slot, double full,
                          double limit)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)root->lane[slot];
    const int32_t target = scene->target[slot];
    const bool good = ((scene->target_lanes[slot] >> lane) & 1u) != 0;
    const uint8_t changes =
        target < 0 || good ? 0 : (uint8_t)vg_road_changes(road, lane, (uint32_t)target);
    // Off the centre half a change may have been made already.
    const bool begun = root->d[slot] > 0.3f || root->d[slot] < -0.3f;
    const uint32_t halves = 2u * (uint32_t)changes;
    return (problem){
        .scene = scene,
        .steps = scene->def->steps,
        .slot = slot,
        .halves = changes == 255 ? 0u : begun && halves > 0 ? halves - 1u : halves,
        .lost = changes == 255,
        .v = (double)root->v[slot],
        .gain = scene->acceleration[slot] * scene->def->step_s,
        .full = full,
        .limit = limit,
    };
}

double vg_flow_bound(const vg_model* scene, const vg_flow* root)
{
    // The slowest lane is the easiest to drive at full pace, the fastest lets accelerate longest.
    double full = VG_HUGE, limit = 0.0;
    for (uint32_t lane = 0; lane < scene->road->lane_count; ++lane) {
        full = vg_min(full, (double)scene->cruise_share * scene->road->lanes[lane].speed_min);
        limit = vg_max(limit, scene->road->lanes[lane].speed_limit);
    }
    double sum = 0.0;
    for (uint32_t slot = 0; slot < scene->controlled_count; ++slot) {
        const problem alone = problem_of(scene, root, slot, full, limit);
        sum += (double)scene->weight[slot] * solve(&alone);
    }
    // Single-precision credits may round up by a few units in the last place.
    return vg_min(sum + 1e-5, 1.0);
}
