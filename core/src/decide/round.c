/// Decisions in the numbers that a message can hold. See decision.h.
#include "verge/decision.h"

#include "base/contract.h"
#include "base/scalar.h"

// A time that is a whole number of milliseconds but for the last bits stays this number. [ms]
static const double time_slack = 1e-7;
// The largest offset that a message can hold: 16 bits of millimetres. [m]
static const double offset_max = 32.767;
// Beyond it a time is no time of a decision, and its milliseconds need not fit an integer. [s]
static const double time_max = 1e4;

// Upwards: a decision as long as a trajectory stays as long.
static double whole_milliseconds(double t)
{
    if (!(t >= 0.0 && t <= time_max)) {
        return t;
    }
    const double ms = t * 1000.0 - time_slack;
    int32_t whole = (int32_t)ms;
    whole += (double)whole < ms ? 1 : 0;
    return (double)whole / 1000.0;
}

static double whole_millimetres(double d)
{
    if (!vg_finite(d)) {
        return d;
    }
    const double mm = vg_clamp(d, -offset_max, offset_max) * 1000.0;
    return (double)(int32_t)(mm < 0.0 ? mm - 0.5 : mm + 0.5) / 1000.0;
}

// Of a number too large for single precision the message would hold none at all.
static double single(double x)
{
    return vg_abs(x) <= 1e30 ? (double)(float)x : x;
}

void verge_decision_round(verge_decision* decision)
{
    const uint32_t count =
        decision == NULL || decision->vehicles == NULL ? 0 : decision->vehicle_count;
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle_decision* vehicle = &decision->vehicles[i];
        VERGE_ASSERT(vehicle->step_count <= VERGE_STEPS_MAX);
        for (uint32_t t = 0; t < vehicle->step_count; ++t) {
            verge_action_step* step = &vehicle->steps[t];
            step->t0 = whole_milliseconds(step->t0);
            step->t1 = whole_milliseconds(step->t1);
            step->s = single(step->s);
            step->d = whole_millimetres(step->d);
            step->v = single(step->v);
            step->distance = single(step->distance);
        }
    }
}
