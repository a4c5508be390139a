/// See bound.h.

#include "decide/bound.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/reward.h"

#include <string.h>

typedef enum kind {
    nothing, // before the first step; any action counts as a repetition of it
    keep,
    accelerate,
    change,
    kind_count,
} kind;

static_assert(VERGE_ACTION_COUNT == 5,
              "a bound counts every kind of action: keep, accelerate, change");

// One vehicle's problem.
typedef struct problem {
    const vg_model* model;
    uint32_t steps, slot;
    uint32_t halves;      // half lane changes from here to the centre of the target lane
    bool     unreachable; // no route to the target lane: every lane has the full value
    double   v, gain;     // [m/s] speed now; speed gained by AC in one step
    double   full_speed;  // [m/s] lowest speed at which a step earns its full reward
    double   speed_limit; // [m/s] no acceleration above it
} problem;

// Values of one step: [half changes made][times accelerated][last kind].
typedef double layer[VERGE_STEPS_MAX + 1][VERGE_STEPS_MAX + 1][kind_count];

// Value of a position with this many half changes left; 0 between lanes. [1]
static double place_value(const problem* self, uint32_t left)
{
    if (self->unreachable || left == 0) {
        return 1.0;
    }
    return left % 2u == 0 ? VG_VALUE_ONE_CHANGE / (double)(left / 2u) : 0.0;
}

// Share of full_speed that a vehicle has after accelerating this many times. [1]
static double speed_share(const problem* self, uint32_t accelerated)
{
    return vg_min((self->v + self->gain * (double)accelerated) / self->full_speed, 1.0);
}

// Reward of a plan that ends here, at the horizon or in a terminal flow. The remaining steps earn
// what one more step in this state would.
static double end_value(const problem* self, uint32_t left, uint32_t accelerated, double rest)
{
    const verge_planner_def* def = self->model->def;
    return place_value(self, left)
               * (def->reward_target + def->reward_lane * rest * speed_share(self, accelerated))
           + def->reward_consistency * rest;
}

// Largest reward that can follow one state, from the values one step later.
static double best_value(const problem* self, const layer* later, uint32_t step, uint32_t made,
                         uint32_t accelerated, kind last)
{
    const verge_planner_def* def = self->model->def;
    const double share = 1.0 / (double)self->steps;
    const uint32_t left = self->halves - made;
    double best = end_value(self, left, accelerated, (double)(self->steps - step) * share);
    for (kind k = keep; k <= change; k = (kind)(k + 1)) {
        // Between lanes, lane keeping moves to a centre as well. No change beyond the target lane.
        const uint32_t advanced = left > 0 && (k == change || left % 2u == 1u) ? 1u : 0u;
        const uint32_t faster = k == accelerate ? 1u : 0u;
        const double v = self->v + self->gain * (double)(accelerated + faster);
        if ((k == change && left == 0) || (k == accelerate && v > self->speed_limit + 1e-3)) {
            continue;
        }
        const double lane =
            place_value(self, left - advanced) * speed_share(self, accelerated + faster);
        const double steady = last == nothing || last == k ? def->reward_consistency : 0.0;
        const double value = share * (def->reward_lane * lane + steady)
                             + (*later)[made + advanced][accelerated + faster][k];
        best = value > best ? value : best;
    }
    return best;
}

// From the last step to the first one, in one layer: a state leads to no state before it in the
// order of these loops, so its values can be replaced.
static double solve(const problem* self)
{
    layer values;
    const uint32_t steps = self->steps;
    for (uint32_t made = 0; made <= steps && made <= self->halves; ++made) {
        for (uint32_t n = 0; n <= steps; ++n) {
            for (uint32_t k = 0; k < kind_count; ++k) {
                values[made][n][k] = end_value(self, self->halves - made, n, 0.0);
            }
        }
    }
    for (uint32_t t = steps; t-- > 0;) {
        for (uint32_t made = 0; made <= t && made <= self->halves; ++made) {
            for (uint32_t n = 0; n <= t; ++n) {
                double now[kind_count];
                for (uint32_t k = 0; k < kind_count; ++k) {
                    now[k] = best_value(self, &values, t, made, n, (kind)k);
                }
                memcpy(values[made][n], now, sizeof now);
            }
        }
    }
    return values[0][0][nothing];
}

static problem problem_of(const vg_model* model, const vg_flow* root, uint32_t slot,
                          double full_speed, double speed_limit)
{
    const uint32_t lane = (uint32_t)root->lane[slot];
    const int32_t target = model->target[slot];
    const uint32_t changes = target < 0 ? 0 : vg_road_changes(model->road, lane, (uint32_t)target);
    // Away from the centre, half a change may have been made already.
    const bool begun = root->d[slot] > VG_CENTRED || root->d[slot] < -VG_CENTRED;
    const uint32_t halves = 2u * changes;
    return (problem){
        .model = model,
        .steps = model->def->steps,
        .slot = slot,
        .halves = changes == VG_NEVER ? 0u : begun && halves > 0 ? halves - 1u : halves,
        .unreachable = changes == VG_NEVER,
        .v = (double)root->v[slot],
        .gain = model->acceleration[slot] * model->def->step_s,
        .full_speed = full_speed,
        .speed_limit = speed_limit,
    };
}

double vg_flow_bound(const vg_model* model, const vg_flow* root)
{
    if (model->best) {
        double all = 0.0;
        for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
            all += (double)model->weight[slot] * vg_reward_most(model, root, slot);
        }
        return vg_min(all + 1e-5, 1.0);
    }
    // Of all near lanes, the lowest speed for the full reward and the highest speed limit.
    const vg_local* local = model->pairs->local;
    double full_speed = VG_HUGE, speed_limit = 0.0;
    for (uint32_t k = 0; k < local->count; ++k) {
        const vg_lane* lane = &model->road->lanes[local->lanes[k]];
        full_speed = vg_min(full_speed, (double)model->cruise_share * lane->speed_min);
        speed_limit = vg_max(speed_limit, lane->speed_limit);
    }
    double sum = 0.0;
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        const problem alone = problem_of(model, root, slot, full_speed, speed_limit);
        sum += (double)model->weight[slot] * solve(&alone);
    }
    // Single-precision credits may round up by a few units in the last place.
    return vg_min(sum + 1e-5, 1.0);
}
