/// The answers of an on-vehicle unit for operators: JSON for verge-ctl, the text format of
/// Prometheus for metrics.
///
/// Memory      Only that of the text.
#ifndef VERGE_OBU_REPORT_H
#define VERGE_OBU_REPORT_H

#include "config.h"

#include "common/text.h"
#include "daemon/timing.h"

enum { OBU_REPORT_SIZE = 64 << 10 }; ///< [B] of the longest answer to a request

/// What an answer is made of.
typedef struct obu_report {
    const obu_config* config;
    const unit*       unit;
    const timing*     cycle_time;
    transport_stats   bus;             ///< of all buses
    int64_t           utime;           ///< [us] now
    int64_t           start_utime;     ///< [us]
    uint64_t          deadline_misses;
    uint64_t          log_dropped;     ///< lines
} obu_report;

/// {"version":…, "vehicle_id":…, "mode":…, "reason":…, "about":…, "rsu_id":…, "followed_cycle":…,
/// "bus":…, "cycle_ms":…, "utime":…, "start_utime":…, "map_crc32":…, "config_crc32":…,
/// "neighbours":…, "cycle_us":{last, p99, max}, "deadline_misses":…, "log_dropped":…,
/// "trajectories":{by mode}, "counters":{…}, "plans":{by verdict}, "states":{by verdict},
/// "strangers":{by reason}}.
void obu_report_status(text* out, const obu_report* from);
/// {"utime":…, "vehicles":[…]}: the vehicles of the last cycle, as verge-rsu has them.
void obu_report_vehicles(text* out, const obu_report* from);
/// {"plans":[…]}: the plan of the roadside unit for this vehicle, if there is one to follow.
void obu_report_plans(text* out, const obu_report* from);

void obu_report_metrics(text* out, const obu_report* from);

#endif
