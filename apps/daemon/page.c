/// See page.h.
#include "page.h"

#include "common/message_json.h"

#include <inttypes.h>

void page_head(text* out, const char* name, const char* type, const char* help)
{
    text_add(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

void page_value(text* out, const char* name, const char* type, const char* help, int64_t value)
{
    page_head(out, name, type, help);
    text_add(out, "%s %" PRId64 "\n", name, value);
}

void page_labelled(text* out, const char* name, const char* label, const char* key, uint64_t value)
{
    text_add(out, "%s{%s=\"%s\"} %" PRIu64 "\n", name, label, key, value);
}

void page_strangers(text* out, const transport_stats* bus)
{
    page_head(out, "verge_strangers_total", "counter",
              "Messages refused because of their sender, by reason.");
    for (int i = TRANSPORT_ADMITTED + 1; i < TRANSPORT_REFUSALS; i++) {
        page_labelled(out, "verge_strangers_total", "reason",
                      transport_refusal_name((transport_refusal)i), bus->refused[i]);
    }
}

void page_strangers_json(text* out, const transport_stats* bus)
{
    text_add(out, ",\"strangers\":{");
    for (int i = TRANSPORT_ADMITTED + 1; i < TRANSPORT_REFUSALS; i++) {
        text_add(out, "%s\"%s\":%" PRIu64, i > TRANSPORT_ADMITTED + 1 ? "," : "",
                 transport_refusal_name((transport_refusal)i), bus->refused[i]);
    }
    text_add(out, "}");
}

void page_cycle_times(text* out, const char* help, uint32_t last, uint32_t p99, uint32_t max)
{
    const struct { const char* stat; uint32_t us; } rows[] = {
        { "last", last }, { "p99", p99 }, { "max", max },
    };
    page_head(out, "verge_cycle_seconds", "gauge", help);
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        text_add(out, "verge_cycle_seconds{stat=\"%s\"} %.6f\n", rows[i].stat,
                 (double)rows[i].us * 1e-6);
    }
}

void page_vehicle_json(text* out, const verge_vehicle* vehicle, int64_t age_ms, int32_t lane,
                       const verge_vehicle_plan_t* plan)
{
    text_add(out, "{\"id\":%" PRId32 ",\"controlled\":%s,\"age_ms\":%" PRId64 ",\"lane\":%" PRId32,
             vehicle->id, vehicle->controlled ? "true" : "false", age_ms, lane);
    text_add(out, ",\"target_lane\":%" PRId32 ",\"x\":", vehicle->target_lane);
    text_add_double(out, vehicle->x);
    text_add(out, ",\"y\":");
    text_add_double(out, vehicle->y);
    text_add(out, ",\"heading\":");
    text_add_double(out, vehicle->heading);
    text_add(out, ",\"speed\":");
    text_add_double(out, vehicle->speed);
    text_add(out, ",\"plan\":");
    if (plan != NULL) {
        text_add_string(out, message_plan_status(plan->status));
    } else {
        text_add(out, "null");
    }
    text_add(out, "}");
}
