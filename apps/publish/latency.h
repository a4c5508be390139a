/// How long a vehicle waits: from a state it sent to the first plan made from it, and from the
/// instant of a plan to its arrival. Both clocks are the wall clock of this machine and the unit's.
///
/// Memory      All in the struct, 2 x 256 KiB; beyond LATENCY_MAX samples nothing is added.
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
    latency_series state_to_plan; ///< a state was sent: its first plan arrived (the wait for the
                                  ///< cycle is in it)
    latency_series plan_to_here;  ///< a cycle began: its plan arrived
} latency;

/// state_sent_us: when the state the plan was made from was sent, 0: not known or not the first
/// plan made from it.
void latency_add(latency* self, const verge_vehicle_plan_t* plan, int64_t arrival_us,
                 int64_t state_sent_us);

/// {"state_to_plan_ms":{"count","p50","p99","max"},"plan_to_here_ms":{...}}; sorts the series.
void latency_write(FILE* out, latency* self);

#endif
