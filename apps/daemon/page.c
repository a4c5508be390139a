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
