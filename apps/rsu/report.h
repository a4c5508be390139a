/// The answers for operators: JSON for verge-ctl, the text format of Prometheus for metrics. The
/// numbers are those of the status message, and the counters that it has no field for.
///
/// Memory      Only that of the text.
/// Threads     Everything is only read; cycle_plan() may be running in another thread.
#ifndef VERGE_RSU_REPORT_H
#define VERGE_RSU_REPORT_H

#include "config.h"
#include "cycle.h"
#include "peers.h"
#include "status.h"

#include "common/text.h"

/// [B] Enough for the largest answer: the plans of VERGE_CONTROLLED_MAX vehicles.
enum { REPORT_SIZE = 256 << 10 };

/// What an answer is made of.
typedef struct report_input {
    const config*      config;
    const cycle*       cycle;
    verge_rsu_status_t status;         ///< the message of this moment
    transport_stats    bus;            ///< of all buses
    const peers*       peers;
    int64_t            now;            ///< [us] for peers, see peers.h
    uint32_t           faults;         ///< all active ones, bits 1 << rsu_fault
    uint64_t           log_dropped;    ///< lines
    uint64_t           record_dropped; ///< events
} report_input;

/// {"version":…, "state":…, "fault":…, "faults":[…], "bus":…, "cycle_ms":…, "log_dropped":…,
/// "record_dropped":…, "standby":…, "others":[…], "counters":{…}, "strangers":{…},
/// "status":{the message}}. The faults are ordered, the worst first. "others": the other units that
/// are heard, {"rsu_id":…, "start_utime":…, "leads":…}. "counters": what the message has no field
/// for; NAME is the metric verge_NAME_total. "strangers": messages refused because of their sender, by reason.
void report_status(text* out, const report_input* from);
/// {"utime":…, "vehicles":[…]}: the vehicles of the last cycle, at its instant.
void report_vehicles(text* out, const cycle* cycle);
/// {"plans":[…]}: the plans that are valid.
void report_plans(text* out, const cycle* cycle);

void report_metrics(text* out, const report_input* from);

#endif
