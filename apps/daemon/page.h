/// What all daemons say to operators: lines of a page of metrics, in the text format of Prometheus,
/// and members of answers in JSON.
///
/// Memory      Only that of the text.
#ifndef VERGE_DAEMON_PAGE_H
#define VERGE_DAEMON_PAGE_H

#include "common/text.h"
#include "verge/transport.h"
#include "verge/verge.h"

#include <stdint.h>

/// The lines before the values of a metric. type: "gauge" or "counter".
void page_head(text* out, const char* name, const char* type, const char* help);
/// A metric with one value.
void page_value(text* out, const char* name, const char* type, const char* help, int64_t value);
/// One value of a metric with a label: name{label="key"} value.
void page_labelled(text* out, const char* name, const char* label, const char* key, uint64_t value);

/// Messages that lcm: buses with keys or an allow list refused, by reason: the metric
/// verge_strangers_total, and the member "strangers" of a status in JSON, with a comma before it.
void page_strangers(text* out, const transport_stats* bus);
void page_strangers_json(text* out, const transport_stats* bus);

/// The metric verge_cycle_seconds, from times in [us]: of the last cycle, the 99th percentile of the
/// last 1024, the longest.
void page_cycle_times(text* out, const char* help, uint32_t last, uint32_t p99, uint32_t max);

/// A vehicle as an element of "vehicles". lane: id, or VERGE_NO_LANE; plan: null, or its valid one.
void page_vehicle_json(text* out, const verge_vehicle* vehicle, int64_t age_ms, int32_t lane,
                       const verge_vehicle_plan_t* plan);

#endif
