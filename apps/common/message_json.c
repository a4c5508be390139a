/// See message_json.h. The fields come from the tables of verge/message.h; none is named here.
#include "message_json.h"

#include "verge/message.h"

#include <inttypes.h>
#include <string.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static void add_struct(text* out, const message_struct* of, const char* at);
static void add_array(text* out, const message_field* array, const char* in);
static void add_value(text* out, message_type type, const char* at);
static bool is_left_out(const message_field* field, const char* at);

void message_json(text* out, transport_kind kind, const void* message)
{
    add_struct(out, message_of(kind), message);
}

static const char* name_in(const char* const* names, size_t count, int32_t code)
{
    return code >= 0 && (size_t)code < count ? names[code] : "unknown";
}

const char* message_plan_status(int32_t status)
{
    static const char* const NAMES[] = { "planned", "keep_lane", "brake", "cancelled" };
    return name_in(NAMES, COUNT(NAMES), status);
}

const char* message_rsu_state(int32_t state)
{
    static const char* const NAMES[] = { "starting", "waiting", "running", "degraded", "stopping" };
    return name_in(NAMES, COUNT(NAMES), state);
}

const char* message_rsu_fault(int32_t fault)
{
    static const char* const NAMES[] = {
        "none", "config", "record", "capacity", "deadline", "bus", "id_conflict", "planner",
        "other_rsu",
    };
    return name_in(NAMES, COUNT(NAMES), fault);
}

// ---- fields -------------------------------------------------------------------------------

static void add_struct(text* out, const message_struct* of, const char* at)
{
    const char* comma = "";
    text_add(out, "{");
    for (uint32_t i = 0; i < of->field_count; ++i) {
        const message_field* field = &of->fields[i];
        if (is_left_out(field, at + field->offset)) {
            continue;
        }
        text_add(out, "%s\"%s\":", comma, field->name);
        comma = ",";
        if (field->type == MESSAGE_ARRAY) {
            add_array(out, field, at);
        } else {
            add_value(out, field->type, at + field->offset);
        }
    }
    text_add(out, "}");
}

/// A count is omitted, because its array has that length. The transport computes the checksum when
/// it sends, so a message that was not sent has none.
static bool is_left_out(const message_field* field, const char* at)
{
    static const int32_t none;
    return field->type == MESSAGE_COUNT ||
           (strcmp(field->name, "crc32") == 0 && memcmp(at, &none, sizeof none) == 0);
}

static void add_array(text* out, const message_field* array, const char* in)
{
    int32_t count;
    memcpy(&count, in + array->count_offset, sizeof count);
    text_add(out, "[");
    for (int32_t i = 0; i < count && i < (int32_t)array->length; ++i) {
        text_add(out, "%s", i > 0 ? "," : "");
        add_struct(out, array->part, in + array->offset + (size_t)i * array->part->size);
    }
    text_add(out, "]");
}

static void add_value(text* out, message_type type, const char* at)
{
    union {
        int16_t i16;
        int32_t i32;
        int64_t i64;
        float   f;
        double  d;
    } value;
    switch (type) {
    case MESSAGE_INT16:
        memcpy(&value.i16, at, sizeof value.i16);
        text_add(out, "%d", value.i16);
        break;
    case MESSAGE_INT32:
        memcpy(&value.i32, at, sizeof value.i32);
        text_add(out, "%" PRId32, value.i32);
        break;
    case MESSAGE_INT64:
        memcpy(&value.i64, at, sizeof value.i64);
        text_add(out, "%" PRId64, value.i64);
        break;
    case MESSAGE_FLOAT:
        memcpy(&value.f, at, sizeof value.f);
        text_add_float(out, value.f);
        break;
    case MESSAGE_DOUBLE:
        memcpy(&value.d, at, sizeof value.d);
        text_add_double(out, value.d);
        break;
    case MESSAGE_BITS32:
        memcpy(&value.i32, at, sizeof value.i32);
        text_add(out, "\"%08" PRIx32 "\"", (uint32_t)value.i32);
        break;
    case MESSAGE_BITS64:
        memcpy(&value.i64, at, sizeof value.i64);
        text_add(out, "\"%016" PRIx64 "\"", (uint64_t)value.i64);
        break;
    case MESSAGE_COUNT:
    case MESSAGE_ARRAY: break;
    }
}
