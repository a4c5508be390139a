/// Latencies of plans and trajectories: from a sent state to the first plan made from it, from the
/// instant of a plan to its arrival, and from a sent state to the trajectory made from it by the
/// on-vehicle unit. The second one needs the wall clocks of vehicle and roadside unit to agree.
///
/// Memory      All in the struct, 3 x 256 KiB. After LATENCY_MAX samples no more are added.
#ifndef VERGE_PUBLISH_LATENCY_H
#define VERGE_PUBLISH_LATENCY_H

#include "verge/transport.h"

#include <stdio.h>

enum { LATENCY_MAX = 1 << 16 };

typedef struct latency_series {
    uint32_t count;
    int32_t  us[LATENCY_MAX];
} latency_series;

typedef struct latency {
    latency_series state_to_plan; ///< from sending a state to the arrival of its first plan,
                                  ///< including the wait for the cycle
    latency_series plan_to_here;  ///< from the start of a cycle to the arrival of its plan
    latency_series state_to_trajectory; ///< from sending a state to the arrival of a trajectory
} latency;

/// state_sent_us: when the state of the plan was sent; 0: unknown, or not the first plan from it.
void latency_add(latency* self, const verge_vehicle_plan_t* plan, int64_t arrival_us,
                 int64_t state_sent_us);

/// A trajectory arrived that was made from the state sent at state_sent_us.
void latency_add_trajectory(latency* self, int64_t arrival_us, int64_t state_sent_us);

/// {"state_to_plan_ms":{"count","p50","p99","max"},"plan_to_here_ms":{...},
/// "state_to_trajectory_ms":{...}}; sorts the series.
void latency_write(FILE* out, latency* self);

#endif
