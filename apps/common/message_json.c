/// See message_json.h. Each message is a table of its fields; a new field is a new row.
#include "message_json.h"

#include "verge/wire.h"

#include <inttypes.h>
#include <string.h>

typedef enum field_kind { FIELD_I16, FIELD_I32, FIELD_I64, FIELD_FLOAT, FIELD_DOUBLE,
                          FIELD_HEX32, FIELD_HEX64, FIELD_CHECKSUM } field_kind;

typedef struct field {
    const char* name;
    size_t      offset;
    field_kind  kind;
} field;

#define FIELD(type, name, kind) { #name, offsetof(type, name), kind }
#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static void add_fields(text* out, const void* message, const field* fields, size_t count);

void message_json_state(text* out, const verge_vehicle_state_t* state)
{
    typedef verge_vehicle_state_t T;
    static const field FIELDS[] = {
        FIELD(T, utime, FIELD_I64),           FIELD(T, vehicle_id, FIELD_I32),
        FIELD(T, sequence, FIELD_I32),        FIELD(T, controlled, FIELD_I16),
        FIELD(T, x, FIELD_DOUBLE),            FIELD(T, y, FIELD_DOUBLE),
        FIELD(T, heading, FIELD_FLOAT),       FIELD(T, speed, FIELD_FLOAT),
        FIELD(T, acceleration, FIELD_FLOAT),  FIELD(T, yaw_rate, FIELD_FLOAT),
        FIELD(T, length, FIELD_FLOAT),        FIELD(T, width, FIELD_FLOAT),
        FIELD(T, position_sigma, FIELD_FLOAT), FIELD(T, target_lane, FIELD_I32),
        FIELD(T, habit, FIELD_I16),           FIELD(T, cooperation, FIELD_FLOAT),
        FIELD(T, followed_cycle, FIELD_I32),  FIELD(T, crc32, FIELD_CHECKSUM),
    };
    text_add(out, "{");
    add_fields(out, state, FIELDS, COUNT(FIELDS));
    text_add(out, "}");
}

static void add_actions(text* out, const verge_vehicle_plan_t* plan)
{
    typedef verge_plan_action_t T;
    static const field FIELDS[] = {
        FIELD(T, action, FIELD_I16),      FIELD(T, lane, FIELD_I32),
        FIELD(T, brake_light, FIELD_I16), FIELD(T, turn_signal, FIELD_I16),
        FIELD(T, t0_ms, FIELD_I32),       FIELD(T, t1_ms, FIELD_I32),
        FIELD(T, speed, FIELD_FLOAT),
    };
    text_add(out, ",\"actions\":[");
    for (int32_t i = 0; i < plan->action_count && i < WIRE_ACTIONS_MAX; i++) {
        text_add(out, "%s{", i > 0 ? "," : "");
        add_fields(out, &plan->actions[i], FIELDS, COUNT(FIELDS));
        text_add(out, "}");
    }
    text_add(out, "]");
}

static void add_points(text* out, const verge_vehicle_plan_t* plan)
{
    typedef verge_plan_point_t T;
    static const field FIELDS[] = {
        FIELD(T, x, FIELD_DOUBLE),           FIELD(T, y, FIELD_DOUBLE),
        FIELD(T, heading, FIELD_FLOAT),      FIELD(T, speed, FIELD_FLOAT),
        FIELD(T, acceleration, FIELD_FLOAT), FIELD(T, curvature, FIELD_FLOAT),
    };
    text_add(out, ",\"points\":[");
    for (int32_t i = 0; i < plan->point_count && i < WIRE_POINTS_MAX; i++) {
        text_add(out, "%s{", i > 0 ? "," : "");
        add_fields(out, &plan->points[i], FIELDS, COUNT(FIELDS));
        text_add(out, "}");
    }
    text_add(out, "]");
}

void message_json_plan(text* out, const verge_vehicle_plan_t* plan)
{
    typedef verge_vehicle_plan_t T;
    static const field FIELDS[] = {
        FIELD(T, utime, FIELD_I64),          FIELD(T, valid_until_utime, FIELD_I64),
        FIELD(T, rsu_id, FIELD_I32),         FIELD(T, cycle, FIELD_I32),
        FIELD(T, plans_in_cycle, FIELD_I32), FIELD(T, vehicle_id, FIELD_I32),
        FIELD(T, state_utime, FIELD_I64),    FIELD(T, status, FIELD_I16),
        FIELD(T, reason, FIELD_I16),         FIELD(T, dt_ms, FIELD_I32),
        FIELD(T, digest, FIELD_HEX64),       FIELD(T, crc32, FIELD_CHECKSUM),
    };
    text_add(out, "{");
    add_fields(out, plan, FIELDS, COUNT(FIELDS));
    add_actions(out, plan);
    add_points(out, plan);
    text_add(out, "}");
}

void message_json_status(text* out, const verge_rsu_status_t* status)
{
    typedef verge_rsu_status_t T;
    static const field FIELDS[] = {
        FIELD(T, utime, FIELD_I64),               FIELD(T, start_utime, FIELD_I64),
        FIELD(T, rsu_id, FIELD_I32),              FIELD(T, version, FIELD_I32),
        FIELD(T, map_crc32, FIELD_HEX32),         FIELD(T, config_crc32, FIELD_HEX32),
        FIELD(T, cycle, FIELD_I32),               FIELD(T, state, FIELD_I16),
        FIELD(T, fault, FIELD_I16),               FIELD(T, vehicles_seen, FIELD_I32),
        FIELD(T, vehicles_controlled, FIELD_I32), FIELD(T, cycle_us_last, FIELD_I32),
        FIELD(T, cycle_us_p99, FIELD_I32),        FIELD(T, cycle_us_max, FIELD_I32),
        FIELD(T, deadline_misses, FIELD_I32),     FIELD(T, plans_sent, FIELD_I32),
        FIELD(T, fallbacks, FIELD_I32),           FIELD(T, rx_accepted, FIELD_I32),
        FIELD(T, rx_stale, FIELD_I32),            FIELD(T, rx_future, FIELD_I32),
        FIELD(T, rx_duplicate, FIELD_I32),        FIELD(T, rx_out_of_order, FIELD_I32),
        FIELD(T, rx_malformed, FIELD_I32),        FIELD(T, rx_out_of_range, FIELD_I32),
        FIELD(T, rx_off_map, FIELD_I32),          FIELD(T, rx_over_capacity, FIELD_I32),
        FIELD(T, rx_id_conflict, FIELD_I32),      FIELD(T, rx_dropped, FIELD_I32),
        FIELD(T, arena_size_bytes, FIELD_I64),    FIELD(T, arena_peak_bytes, FIELD_I64),
        FIELD(T, nodes_peak, FIELD_I32),          FIELD(T, crc32, FIELD_CHECKSUM),
    };
    text_add(out, "{");
    add_fields(out, status, FIELDS, COUNT(FIELDS));
    text_add(out, "}");
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
    };
    return name_in(NAMES, COUNT(NAMES), fault);
}

// ---- fields -------------------------------------------------------------------------------

static void add_value(text* out, const void* at, field_kind kind)
{
    union {
        int16_t i16;
        int32_t i32;
        int64_t i64;
        float   f;
        double  d;
    } value;
    switch (kind) {
    case FIELD_I16:
        memcpy(&value.i16, at, sizeof value.i16);
        text_add(out, "%d", value.i16);
        break;
    case FIELD_I32:
        memcpy(&value.i32, at, sizeof value.i32);
        text_add(out, "%" PRId32, value.i32);
        break;
    case FIELD_I64:
        memcpy(&value.i64, at, sizeof value.i64);
        text_add(out, "%" PRId64, value.i64);
        break;
    case FIELD_FLOAT:
        memcpy(&value.f, at, sizeof value.f);
        text_add_float(out, value.f);
        break;
    case FIELD_DOUBLE:
        memcpy(&value.d, at, sizeof value.d);
        text_add_double(out, value.d);
        break;
    case FIELD_HEX32:
    case FIELD_CHECKSUM:
        memcpy(&value.i32, at, sizeof value.i32);
        text_add(out, "\"%08" PRIx32 "\"", (uint32_t)value.i32);
        break;
    case FIELD_HEX64:
        memcpy(&value.i64, at, sizeof value.i64);
        text_add(out, "\"%016" PRIx64 "\"", (uint64_t)value.i64);
        break;
    }
}

/// The transport puts the checksum into what it sends: what was not sent has none.
static bool is_left_out(const void* at, field_kind kind)
{
    static const int32_t none;
    return kind == FIELD_CHECKSUM && memcmp(at, &none, sizeof none) == 0;
}

static void add_fields(text* out, const void* message, const field* fields, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (is_left_out((const char*)message + fields[i].offset, fields[i].kind)) {
            continue;
        }
        text_add(out, "%s\"%s\":", i > 0 ? "," : "", fields[i].name);
        add_value(out, (const char*)message + fields[i].offset, fields[i].kind);
    }
}
