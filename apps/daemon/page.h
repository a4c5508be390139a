/// Lines of a page of metrics, in the text format of Prometheus, and what all daemons have on it.
///
/// Memory      Only that of the text.
#ifndef VERGE_DAEMON_PAGE_H
#define VERGE_DAEMON_PAGE_H

#include "common/text.h"
#include "verge/transport.h"

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

#endif
