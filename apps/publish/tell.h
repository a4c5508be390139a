/// What verge-publish prints while it runs: the plans that change something, and that none come.
///
/// A plan changes something where it is the vehicle's first, or its status, its reason, its present
/// action or the lane it leads to is another one than in the plan before.
#ifndef VERGE_PUBLISH_TELL_H
#define VERGE_PUBLISH_TELL_H

#include "verge/plan.h"
#include "verge/transport.h"

/// How long no plan has to come until that is told [us]: at first, and between plans (a roadside
/// unit may plan as rarely as every 5 s).
#define TELL_SILENCE_FIRST_US 3000000
#define TELL_SILENCE_US 6000000

/// The last plan printed of one vehicle.
typedef struct told_plan {
    bool    told;
    int32_t status, reason, action, lane;
} told_plan;

typedef struct tell {
    const char* bus;       ///< URL
    bool        quiet;     ///< prints no plans
    bool        all;       ///< prints every plan
    int64_t     heard_us;  ///< monotonic clock: the last plan, before it the start
    bool        heard;     ///< a plan has come
    bool        silent;    ///< that none come has been told
    told_plan   last[VERGE_VEHICLES_MAX]; ///< by the index of the vehicle
} tell;

/// bus must outlive it. now_us: on a clock that never steps, as below.
void tell_init(tell* self, const char* bus, bool quiet, bool all, int64_t now_us);

/// A plan has come for the vehicle of this index, at a time [s] of the scenario.
void tell_plan(tell* self, uint32_t index, double time, const verge_vehicle_plan_t* message,
               const verge_vehicle_plan* plan, int64_t now_us);

/// Once a tick: says once on standard error that no plans come. expected: a vehicle asks for them.
void tell_silence(tell* self, bool expected, int64_t now_us);

#endif
