/// The lines that verge-publish prints while it runs: plans that differ from the last one of their
/// vehicle, and the absence of plans.
///
/// Two plans differ in their status, their reason, their present action or their last lane. The
/// first plan of a vehicle is printed, too.
#ifndef VERGE_PUBLISH_PROGRESS_H
#define VERGE_PUBLISH_PROGRESS_H

#include "verge/plan.h"
#include "verge/transport.h"

/// Time without a plan after which a line is printed [us]: at the start, and between plans. The
/// cycle of a roadside unit lasts up to 5 s.
#define PROGRESS_SILENCE_FIRST_US 3000000
#define PROGRESS_SILENCE_US 6000000

/// The last plan printed of one vehicle.
typedef struct printed_plan {
    bool    printed;
    int32_t status, reason, action, lane;
} printed_plan;

typedef struct progress {
    const char* bus;         ///< URL
    bool        quiet;       ///< prints no plans
    bool        all;         ///< prints every plan
    int64_t     received_us; ///< monotonic clock: the last plan, before it the start
    bool        received;    ///< a plan was received
    bool        silent;      ///< the absence of plans was printed
    printed_plan last[VERGE_VEHICLES_MAX]; ///< by the index of the vehicle
} progress;

/// bus must outlive self. now_us: monotonic clock, as below.
void progress_init(progress* self, const char* bus, bool quiet, bool all, int64_t now_us);

/// A plan was received for the vehicle of this index, at a time [s] of the scenario.
void progress_plan(progress* self, uint32_t index, double time,
                   const verge_vehicle_plan_t* message, const verge_vehicle_plan* plan,
                   int64_t now_us);

/// Once a tick: prints one line on standard error when plans stop. expected: a vehicle is
/// controlled.
void progress_silence(progress* self, bool expected, int64_t now_us);

#endif
