/// Decisions in the numbers that a message can hold. See decision.h.
#include "verge/decision.h"

#include "base/contract.h"
#include "base/single.h"

// The largest offset that a message can hold: 16 bits of millimetres. [m]
static const double offset_max = 32.767;

static double whole_millimetres(double d)
{
    if (!vg_finite(d)) {
        return d;
    }
    const double mm = vg_clamp(d, -offset_max, offset_max) * 1000.0;
    return (double)(int32_t)(mm < 0.0 ? mm - 0.5 : mm + 0.5) / 1000.0;
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
            step->t0 = vg_whole_milliseconds(step->t0);
            step->t1 = vg_whole_milliseconds(step->t1);
            step->s = vg_single(step->s);
            step->d = whole_millimetres(step->d);
            step->v = vg_single(step->v);
            step->distance = vg_single(step->distance);
        }
    }
}
