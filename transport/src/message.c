/// The tables are the rows of messages.def.
#include "verge/message.h"

#include <assert.h>
#include <float.h>
#include <math.h>
#include <string.h>

#define TYPE_int16_t MESSAGE_INT16
#define TYPE_int32_t MESSAGE_INT32
#define TYPE_int64_t MESSAGE_INT64
#define TYPE_float MESSAGE_FLOAT
#define TYPE_double MESSAGE_DOUBLE
#define TYPE_bits32 MESSAGE_BITS32
#define TYPE_bits64 MESSAGE_BITS64
#define TYPE_count32 MESSAGE_COUNT

#define RANGE(min, max) min, max, MESSAGE_KNOWN
#define OR_NAN(min, max) min, max, MESSAGE_OR_NAN
#define OR_NEGATIVE(min, max) min, max, MESSAGE_OR_NEGATIVE
#define FROM(min) min, (double)INFINITY, MESSAGE_KNOWN
#define ANY -(double)INFINITY, (double)INFINITY, MESSAGE_KNOWN

/// RANGE() and its like are three values: the row ends before they are taken apart.
#define ROW(in, before, type, name, ...) \
    { #name, before #name, TYPE_##type, offsetof(in, name), __VA_ARGS__, NULL, 0, 0 },

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define TABLE(type, fields) { #type, sizeof(verge_##type), fields, COUNT(fields) }

static const message_field action_fields[] = {
#define ACTION(...) ROW(verge_plan_action_t, "actions.", __VA_ARGS__)
#include "messages.def"
};
static const message_field point_fields[] = {
#define POINT(...) ROW(verge_plan_point_t, "points.", __VA_ARGS__)
#include "messages.def"
};
static const message_struct plan_action_t = TABLE(plan_action_t, action_fields);
static const message_struct plan_point_t = TABLE(plan_point_t, point_fields);

static const message_field state_fields[] = {
#define STATE(...) ROW(verge_vehicle_state_t, "", __VA_ARGS__)
#include "messages.def"
};
static const message_field plan_fields[] = {
#define PLAN(...) ROW(verge_vehicle_plan_t, "", __VA_ARGS__)
#define PLAN_ARRAY(part, name, length, count, text)                               \
    { #name, #name, MESSAGE_ARRAY, offsetof(verge_vehicle_plan_t, name), "", ANY, text, \
      &part, length, offsetof(verge_vehicle_plan_t, count) },
#include "messages.def"
};
static const message_field status_fields[] = {
#define STATUS(...) ROW(verge_rsu_status_t, "", __VA_ARGS__)
#include "messages.def"
};
static const message_struct vehicle_state_t = TABLE(vehicle_state_t, state_fields);
static const message_struct vehicle_plan_t = TABLE(vehicle_plan_t, plan_fields);
static const message_struct rsu_status_t = TABLE(rsu_status_t, status_fields);

static const char* struct_check(const message_struct* of, const char* at);
static const char* array_check(const message_field* array, const char* in);
static bool        is_in_range(const message_field* field, double value);
static double      number_at(message_type type, const char* at);

const message_struct* message_of(transport_kind kind)
{
    switch (kind) {
#define MESSAGE(KIND, type, ...) \
    case TRANSPORT_##KIND: return &type;
#include "messages.def"
    case TRANSPORT_MARK:
    case TRANSPORT_NONE: break;
    }
    return NULL;
}

const char* message_check(transport_kind kind, const void* message)
{
    const message_struct* of = message_of(kind);
    assert(of != NULL);
    return struct_check(of, message);
}

static const char* struct_check(const message_struct* of, const char* at)
{
    for (uint32_t i = 0; i < of->field_count; ++i) {
        const message_field* field = &of->fields[i];
        if (field->type == MESSAGE_ARRAY) {
            const char* fault = array_check(field, at);
            if (fault != NULL) {
                return fault;
            }
        } else if (!is_in_range(field, number_at(field->type, at + field->offset))) {
            return field->path;
        }
    }
    return NULL;
}

/// The count stands before its array, so it has been checked.
static const char* array_check(const message_field* array, const char* in)
{
    const double count = number_at(MESSAGE_COUNT, in + array->count_offset);
    assert(count >= 0.0 && count <= array->length);
    for (uint32_t i = 0; i < (uint32_t)count; ++i) {
        const char* fault = struct_check(array->part, in + array->offset + i * array->part->size);
        if (fault != NULL) {
            return fault;
        }
    }
    return NULL;
}

static bool is_in_range(const message_field* field, double value)
{
    if (isnan(value)) {
        return field->unknown != MESSAGE_KNOWN;
    }
    const double min = field->unknown == MESSAGE_OR_NEGATIVE ? -(double)FLT_MAX : field->min;
    return value >= min && value <= field->max;
}

/// A 64-bit integer is rounded to a double; the limits of utimes are far from where that matters.
static double number_at(message_type type, const char* at)
{
    union {
        int16_t i16;
        int32_t i32;
        int64_t i64;
        float   f;
        double  d;
    } value;
    switch (type) {
    case MESSAGE_INT16: return memcpy(&value.i16, at, sizeof value.i16), (double)value.i16;
    case MESSAGE_COUNT:
    case MESSAGE_BITS32:
    case MESSAGE_INT32: return memcpy(&value.i32, at, sizeof value.i32), (double)value.i32;
    case MESSAGE_BITS64:
    case MESSAGE_INT64: return memcpy(&value.i64, at, sizeof value.i64), (double)value.i64;
    case MESSAGE_FLOAT: return memcpy(&value.f, at, sizeof value.f), (double)value.f;
    case MESSAGE_DOUBLE: return memcpy(&value.d, at, sizeof value.d), value.d;
    case MESSAGE_ARRAY: break;
    }
    assert(false);
    return 0.0;
}
