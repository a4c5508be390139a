/// See page.h.
#include "page.h"

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
