/// The tables are the rows of messages.def.
#include "verge/message.h"

#include "crc32.h"
#include "verge/limits.h"

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

/// RANGE() and its like expand to three values, so they have to stay together in the row.
#define ROW(in, before, type, name, ...) \
    { #name, before #name, TYPE_##type, offsetof(in, name), __VA_ARGS__, NULL, 0, 0 },

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define TABLE(type, fields) { #type, sizeof(verge_##type), fields, COUNT(fields) }

static const message_field action_fields[] = {
#define ACTION(...) ROW(verge_plan_action_t, "actions.", __VA_ARGS__)
#include "messages.def"
};
static const message_field pass_fields[] = {
#define PASS(...) ROW(verge_plan_pass_t, "passes.", __VA_ARGS__)
#include "messages.def"
};
static const message_field stop_fields[] = {
#define STOP(...) ROW(verge_plan_stop_t, "stops.", __VA_ARGS__)
#include "messages.def"
};
static const message_field point_fields[] = {
#define POINT(...) ROW(verge_plan_point_t, "points.", __VA_ARGS__)
#include "messages.def"
};
static const message_struct plan_action_t = TABLE(plan_action_t, action_fields);
static const message_struct plan_pass_t = TABLE(plan_pass_t, pass_fields);
static const message_struct plan_stop_t = TABLE(plan_stop_t, stop_fields);
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
static const message_field signal_fields[] = {
#define SIGNAL(...) ROW(verge_lane_signal_t, "", __VA_ARGS__)
#include "messages.def"
};
static const message_field trajectory_fields[] = {
#define TRAJECTORY(...) ROW(verge_vehicle_trajectory_t, "", __VA_ARGS__)
#define TRAJECTORY_ARRAY(part, name, length, count, text)                                \
    { #name, #name, MESSAGE_ARRAY, offsetof(verge_vehicle_trajectory_t, name), "", ANY, text, \
      &part, length, offsetof(verge_vehicle_trajectory_t, count) },
#include "messages.def"
};
static const message_struct vehicle_trajectory_t = TABLE(vehicle_trajectory_t, trajectory_fields);
static const message_struct lane_signal_t = TABLE(lane_signal_t, signal_fields);
static const message_struct vehicle_state_t = TABLE(vehicle_state_t, state_fields);
static const message_struct vehicle_plan_t = TABLE(vehicle_plan_t, plan_fields);
static const message_struct rsu_status_t = TABLE(rsu_status_t, status_fields);

static const char* struct_check(const message_struct* of, const char* at);
static const char* array_check(const message_field* array, const char* in);
static bool        is_in_range(const message_field* field, double value);
static double      number_at(message_type type, const char* at);
static uint32_t    struct_crc32(const message_struct* of, const char* at, uint32_t crc);
static void        struct_copy(const message_struct* of, const char* from, char* to);
static size_t      big_endian(message_type type, const char* at, uint8_t bytes[8]);
static size_t      size_of(message_type type);

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

/// The count precedes its array, so it has been checked.
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

// ---- checksum and copy --------------------------------------------------------------------

/// crc32 is the last field of every message.
static const message_field* crc32_field(const message_struct* of)
{
    const message_field* last = &of->fields[of->field_count - 1];
    assert(strcmp(last->name, "crc32") == 0);
    return last;
}

uint32_t message_crc32(transport_kind kind, const void* message)
{
    message_struct before = *message_of(kind);
    assert(crc32_field(&before) != NULL);
    --before.field_count;
    return crc32_end(struct_crc32(&before, message, crc32_begin));
}

bool message_is_whole(transport_kind kind, const void* message)
{
    uint32_t held;
    memcpy(&held, (const char*)message + crc32_field(message_of(kind))->offset, sizeof held);
    return held == message_crc32(kind, message);
}

void message_seal(transport_kind kind, const void* message, void* sealed)
{
    const message_struct* of = message_of(kind);
    const uint32_t        crc = message_crc32(kind, message);
    memset(sealed, 0, of->size);
    struct_copy(of, message, sealed);
    memcpy((char*)sealed + crc32_field(of)->offset, &crc, sizeof crc);
}

/// Elements beyond an array's count are on the wire, too.
static uint32_t struct_crc32(const message_struct* of, const char* at, uint32_t crc)
{
    for (uint32_t i = 0; i < of->field_count; ++i) {
        const message_field* field = &of->fields[i];
        const char*          from = at + field->offset;
        if (field->type == MESSAGE_ARRAY) {
            for (uint32_t k = 0; k < field->length; ++k) {
                crc = struct_crc32(field->part, from + k * field->part->size, crc);
            }
        } else {
            uint8_t      bytes[8];
            const size_t size = big_endian(field->type, from, bytes);
            crc = crc32_add(crc, bytes, size);
        }
    }
    return crc;
}

static void struct_copy(const message_struct* of, const char* from, char* to)
{
    for (uint32_t i = 0; i < of->field_count; ++i) {
        const message_field* field = &of->fields[i];
        if (field->type == MESSAGE_ARRAY) {
            for (uint32_t k = 0; k < field->length; ++k) {
                const size_t at = field->offset + k * field->part->size;
                struct_copy(field->part, from + at, to + at);
            }
        } else {
            memcpy(to + field->offset, from + field->offset, size_of(field->type));
        }
    }
}

/// The bytes of a number as LCM sends them. Returns how many.
static size_t big_endian(message_type type, const char* at, uint8_t bytes[8])
{
    const size_t size = size_of(type);
    uint64_t     bits = 0;
    uint16_t     half;
    uint32_t     word;
    switch (size) {
    case sizeof half: memcpy(&half, at, sizeof half), bits = half; break;
    case sizeof word: memcpy(&word, at, sizeof word), bits = word; break;
    default: memcpy(&bits, at, sizeof bits); break;
    }
    for (size_t i = 0; i < size; ++i) {
        bytes[i] = (uint8_t)(bits >> 8 * (size - 1 - i));
    }
    return size;
}

static size_t size_of(message_type type)
{
    switch (type) {
    case MESSAGE_INT16: return sizeof(int16_t);
    case MESSAGE_INT32:
    case MESSAGE_BITS32:
    case MESSAGE_COUNT: return sizeof(int32_t);
    case MESSAGE_INT64:
    case MESSAGE_BITS64: return sizeof(int64_t);
    case MESSAGE_FLOAT: return sizeof(float);
    case MESSAGE_DOUBLE: return sizeof(double);
    case MESSAGE_ARRAY: break;
    }
    assert(false);
    return 0;
}
