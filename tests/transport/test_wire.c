/// Goal: a message has exactly the bytes that verge.lcm defines, and no value out of range is
///       accepted.
/// Method: the encoding is written out again by hand, field by field, and compared byte by byte;
///         each field of a good message is pushed over each of its limits, one at a time.
#include "check.h"
#include "codec.h"
#include "lcm_auth.h"
#include "rng.h"
#include "verge/limits.h"
#include "verge/message.h"
#include "verge/wire.h"

#include <math.h>

// ---------------------------------------------------------------- a second encoder, by hand

typedef struct writer {
    uint8_t bytes[2048];
    size_t  size;
} writer;

static void write_big_endian(writer* to, const void* value, size_t size)
{
    for (size_t i = 0; i < size; ++i) { // this test runs on little-endian machines
        to->bytes[to->size++] = ((const uint8_t*)value)[size - 1 - i];
    }
}

#define WRITE(to, type, value)                          \
    do {                                                \
        const type written = (value);                   \
        write_big_endian((to), &written, sizeof(type)); \
    } while (0)

/// zlib's CRC-32 one bit at a time, straight from its definition.
static uint32_t crc32_by_bits(const uint8_t* bytes, size_t size)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < size; ++i) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc & 1u) != 0 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
        }
    }
    return crc ^ 0xffffffffu;
}

// ---------------------------------------------------------------- good messages

static verge_vehicle_state_t good_state(void)
{
    return (verge_vehicle_state_t){
        .utime = 1700000000123456, .vehicle_id = 7, .sequence = 41, .controlled = 1,
        .protocol_version = 1, .map_crc32 = 0x1234567,
        .x = 123.456, .y = -7.25, .heading = 0.1f, .speed = 15.5f, .acceleration = -0.5f,
        .yaw_rate = 0.02f, .length = 4.8f, .width = 1.9f, .position_sigma = 0.3f,
        .target_lane = 2, .habit = 0, .cooperation = 0.25f, .followed_cycle = 12,
    };
}

static verge_vehicle_plan_t good_plan(void)
{
    verge_vehicle_plan_t plan = {
        .utime = 1700000000500000, .valid_until_utime = 1700000001500000, .rsu_id = 3,
        .cycle = 17, .plans_in_cycle = 2, .vehicle_id = 7, .state_utime = 1700000000400000,
        .status = 1, .reason = 2, .protocol_version = 1, .why = 2, .map_crc32 = 0x1234567,
        .scene_sum = 0x7654321, .change_lane = 5, .change_end_ms = 2400,
        .why_vehicle = 8, .why_lane = 4, .action_count = 7, .pass_count = 4, .stop_count = 3,
        .point_count = 31, .dt_ms = 100, .decided = 2,
        .digest = 0x0123456789abcdef,
    };
    for (int i = 0; i < 7; ++i) {
        plan.actions[i] = (verge_plan_action_t){
            .action = (int16_t)(i % 5), .lane = i, .brake_light = (int16_t)(i % 2),
            .turn_signal = (int16_t)(i % 3 - 1), .t1_ms = 500 * (i + 1),
            .speed = 10.0f + (float)i, .s = 0.25f * (float)i, .d_mm = (int16_t)(100 * i - 300),
            .distance = 0.5f * (float)i,
        };
    }
    for (int i = 0; i < 4; ++i) {
        plan.passes[i] = (verge_plan_pass_t){ .lane = i, .after = 10 + i };
    }
    for (int i = 0; i < 3; ++i) {
        plan.stops[i] = (verge_plan_stop_t){ .duration = 0.5f, .jerk = (float)(1 - i) };
    }
    for (int i = 0; i < 31; ++i) {
        plan.points[i] = (verge_plan_point_t){
            .x = 1.5 * i, .y = -0.1 * i, .heading = 0.01f * (float)i, .speed = 15.0f,
            .acceleration = 0.2f * (float)i, .curvature = 0.001f * (float)i,
        };
    }
    return plan;
}

// ---------------------------------------------------------------- encoding

static void test_crc32_is_that_of_zlib(void** state)
{
    (void)state;
    // Known vectors: the check value of the CRC catalogue, and zlib.crc32 of the others.
    assert_int_equal(transport_crc32("", 0), 0x00000000);
    assert_int_equal(transport_crc32("a", 1), 0xe8b7be43);
    assert_int_equal(transport_crc32("123456789", 9), 0xcbf43926);
    static const char fox[] = "The quick brown fox jumps over the lazy dog";
    assert_int_equal(transport_crc32(fox, 43), 0x414fa339);

    test_rng rng = test_rng_seeded("crc32");
    uint8_t  bytes[300];
    for (size_t size = 0; size < sizeof bytes; ++size) {
        for (size_t i = 0; i < size; ++i) {
            bytes[i] = (uint8_t)test_rng_next(&rng);
        }
        assert_int_equal(transport_crc32(bytes, size), crc32_by_bits(bytes, size));
    }
}

static void check_encoding(transport_kind kind, const void* value, const writer* fields)
{
    static transport_message sealed;
    uint8_t                  bytes[CODEC_SIZE_MAX];
    message_seal(kind, value, &sealed.as);
    const size_t size = codec_encode(kind, &sealed.as, bytes);

    assert_int_equal(size, 8 + fields->size + 4);
    assert_memory_equal(bytes + 8, fields->bytes, fields->size);
    assert_int_equal(codec_get_u32(bytes + size - 4), crc32_by_bits(fields->bytes, fields->size));
}

static void test_a_state_message_has_its_documented_fields_in_order(void** state)
{
    (void)state;
    const verge_vehicle_state_t m = good_state();
    writer w = { .size = 0 };
    WRITE(&w, int64_t, m.utime);
    WRITE(&w, int32_t, m.vehicle_id);
    WRITE(&w, int32_t, m.sequence);
    WRITE(&w, int16_t, m.controlled);
    WRITE(&w, int16_t, m.protocol_version);
    WRITE(&w, int32_t, m.map_crc32);
    WRITE(&w, double, m.x);
    WRITE(&w, double, m.y);
    WRITE(&w, float, m.heading);
    WRITE(&w, float, m.speed);
    WRITE(&w, float, m.acceleration);
    WRITE(&w, float, m.yaw_rate);
    WRITE(&w, float, m.length);
    WRITE(&w, float, m.width);
    WRITE(&w, float, m.position_sigma);
    WRITE(&w, int32_t, m.target_lane);
    WRITE(&w, int16_t, m.habit);
    WRITE(&w, float, m.cooperation);
    WRITE(&w, int32_t, m.followed_cycle);
    check_encoding(TRANSPORT_STATE, &m, &w);
}

static void test_a_plan_message_has_its_documented_fields_in_order(void** state)
{
    (void)state;
    const verge_vehicle_plan_t m = good_plan();
    writer w = { .size = 0 };
    WRITE(&w, int64_t, m.utime);
    WRITE(&w, int64_t, m.valid_until_utime);
    WRITE(&w, int32_t, m.rsu_id);
    WRITE(&w, int32_t, m.cycle);
    WRITE(&w, int32_t, m.plans_in_cycle);
    WRITE(&w, int32_t, m.vehicle_id);
    WRITE(&w, int64_t, m.state_utime);
    WRITE(&w, int16_t, m.status);
    WRITE(&w, int16_t, m.reason);
    WRITE(&w, int16_t, m.protocol_version);
    WRITE(&w, int16_t, m.why);
    WRITE(&w, int32_t, m.map_crc32);
    WRITE(&w, int32_t, m.scene_sum);
    WRITE(&w, int32_t, m.change_lane);
    WRITE(&w, int32_t, m.change_end_ms);
    WRITE(&w, int32_t, m.why_vehicle);
    WRITE(&w, int32_t, m.why_lane);
    WRITE(&w, int32_t, m.action_count);
    for (int i = 0; i < 7; ++i) {
        WRITE(&w, int16_t, m.actions[i].action);
        WRITE(&w, int16_t, m.actions[i].brake_light);
        WRITE(&w, int16_t, m.actions[i].turn_signal);
        WRITE(&w, int16_t, m.actions[i].d_mm);
        WRITE(&w, int32_t, m.actions[i].lane);
        WRITE(&w, int32_t, m.actions[i].t1_ms);
        WRITE(&w, float, m.actions[i].s);
        WRITE(&w, float, m.actions[i].speed);
        WRITE(&w, float, m.actions[i].distance);
    }
    WRITE(&w, int32_t, m.pass_count);
    for (int i = 0; i < 4; ++i) {
        WRITE(&w, int32_t, m.passes[i].lane);
        WRITE(&w, int32_t, m.passes[i].after);
    }
    WRITE(&w, int32_t, m.stop_count);
    for (int i = 0; i < 3; ++i) {
        WRITE(&w, float, m.stops[i].duration);
        WRITE(&w, float, m.stops[i].jerk);
    }
    WRITE(&w, int32_t, m.point_count);
    WRITE(&w, int16_t, m.dt_ms);
    WRITE(&w, int16_t, m.decided);
    for (int i = 0; i < 31; ++i) {
        WRITE(&w, double, m.points[i].x);
        WRITE(&w, double, m.points[i].y);
        WRITE(&w, float, m.points[i].heading);
        WRITE(&w, float, m.points[i].speed);
        WRITE(&w, float, m.points[i].acceleration);
        WRITE(&w, float, m.points[i].curvature);
    }
    WRITE(&w, int64_t, m.digest);
    check_encoding(TRANSPORT_PLAN, &m, &w);
}

static void test_a_signal_message_has_its_documented_fields_in_order(void** state)
{
    (void)state;
    const verge_lane_signal_t m = { .utime = 1700000000500000, .change_utime = 1700000003500000,
                                    .lane = 12, .state = 3, .protocol_version = 1,
                                    .map_crc32 = 0x1234567 };
    writer w = { .size = 0 };
    WRITE(&w, int64_t, m.utime);
    WRITE(&w, int64_t, m.change_utime);
    WRITE(&w, int32_t, m.lane);
    WRITE(&w, int16_t, m.state);
    WRITE(&w, int16_t, m.protocol_version);
    WRITE(&w, int32_t, m.map_crc32);
    check_encoding(TRANSPORT_SIGNAL, &m, &w);
    assert_null(wire_signal_check(&m));
    verge_lane_signal_t bad = m;
    bad.change_utime = m.utime - 1;
    assert_string_equal(wire_signal_check(&bad), "change_utime");
    bad = m;
    bad.state = 4;
    assert_string_equal(wire_signal_check(&bad), "state");
}

static void test_a_trajectory_message_has_its_documented_fields_in_order(void** state)
{
    (void)state;
    verge_vehicle_trajectory_t m = {
        .utime = 1700000000500000, .valid_until_utime = 1700000003500000,
        .state_utime = 1700000000400000, .vehicle_id = 7, .sequence = 12, .mode = WIRE_DEPARTING,
        .mode_reason = WIRE_UNIT_CONTACT, .mode_vehicle = 4, .rsu_id = 1, .followed_cycle = 33,
        .map_crc32 = 0x1234567, .protocol_version = WIRE_PROTOCOL_VERSION, .status = 1, .reason = 2,
        .why = 3, .why_vehicle = 4, .why_lane = 5, .lane = 6, .action = 2, .brake_light = 1,
        .turn_signal = -1, .dt_ms = 100, .point_count = 2,
    };
    m.points[1] = (verge_plan_point_t){ 1.5, -2.5, 0.25f, 9.0f, -1.0f, 0.125f };
    writer w = { .size = 0 };
    WRITE(&w, int64_t, m.utime);
    WRITE(&w, int64_t, m.valid_until_utime);
    WRITE(&w, int64_t, m.state_utime);
    WRITE(&w, int32_t, m.vehicle_id);
    WRITE(&w, int32_t, m.sequence);
    WRITE(&w, int16_t, m.mode);
    WRITE(&w, int16_t, m.mode_reason);
    WRITE(&w, int32_t, m.mode_vehicle);
    WRITE(&w, int32_t, m.rsu_id);
    WRITE(&w, int32_t, m.followed_cycle);
    WRITE(&w, int32_t, m.map_crc32);
    WRITE(&w, int16_t, m.protocol_version);
    WRITE(&w, int16_t, m.status);
    WRITE(&w, int16_t, m.reason);
    WRITE(&w, int16_t, m.why);
    WRITE(&w, int32_t, m.why_vehicle);
    WRITE(&w, int32_t, m.why_lane);
    WRITE(&w, int32_t, m.lane);
    WRITE(&w, int16_t, m.action);
    WRITE(&w, int16_t, m.brake_light);
    WRITE(&w, int16_t, m.turn_signal);
    WRITE(&w, int16_t, m.dt_ms);
    WRITE(&w, int32_t, m.point_count);
    for (int i = 0; i < WIRE_POINTS_MAX; ++i) {
        WRITE(&w, double, m.points[i].x);
        WRITE(&w, double, m.points[i].y);
        WRITE(&w, float, m.points[i].heading);
        WRITE(&w, float, m.points[i].speed);
        WRITE(&w, float, m.points[i].acceleration);
        WRITE(&w, float, m.points[i].curvature);
    }
    check_encoding(TRANSPORT_TRAJECTORY, &m, &w);
    assert_null(wire_trajectory_check(&m));
    verge_vehicle_trajectory_t bad = m;
    bad.valid_until_utime = m.utime - 1;
    assert_string_equal(wire_trajectory_check(&bad), "valid_until_utime");
    bad = m;
    bad.mode = WIRE_UNIT_MODES;
    assert_string_equal(wire_trajectory_check(&bad), "mode");
    bad = m;
    bad.mode_reason = WIRE_UNIT_REASONS;
    assert_string_equal(wire_trajectory_check(&bad), "mode_reason");
}

static void test_each_mode_and_reason_of_an_on_vehicle_unit_has_a_name_of_its_own(void** state)
{
    (void)state;
    for (int32_t i = 0; i < WIRE_UNIT_REASONS; ++i) {
        assert_string_not_equal(wire_unit_reason_name(i), "unknown");
        for (int32_t k = 0; k < i; ++k) {
            assert_string_not_equal(wire_unit_reason_name(i), wire_unit_reason_name(k));
        }
    }
    for (int32_t i = 0; i < WIRE_UNIT_MODES; ++i) {
        assert_string_not_equal(wire_unit_mode_name(i), "unknown");
    }
    assert_string_equal(wire_unit_mode_name(-1), "unknown");
    assert_string_equal(wire_unit_reason_name(WIRE_UNIT_REASONS), "unknown");
}

/// With LCM's header and its signature; on DDS with RTPS's headers, a heartbeat and the address of
/// one reader, which a repeated plan has.
static void test_every_message_fits_one_datagram(void** state)
{
    (void)state;
    const verge_vehicle_state_t s = good_state();
    const verge_vehicle_plan_t  p = good_plan();
    const verge_rsu_status_t    r = { .utime = 1 };
    const verge_lane_signal_t   l = { .utime = 1 };
    assert_int_equal(verge_vehicle_state_t_encoded_size(&s), CODEC_STATE_SIZE);
    assert_int_equal(verge_vehicle_plan_t_encoded_size(&p), CODEC_PLAN_SIZE);
    assert_int_equal(verge_rsu_status_t_encoded_size(&r), CODEC_STATUS_SIZE);
    for (int kind = TRANSPORT_STATE; kind <= TRANSPORT_MARK; ++kind) {
        const size_t header = 8 + strlen(codec_channel((transport_kind)kind)) + 1;
        CHECK_AT_MOST(header + codec_size((transport_kind)kind) + LCM_AUTH_TRAILER_SIZE, 1472);
    }
    assert_int_equal(verge_lane_signal_t_encoded_size(&l), CODEC_SIGNAL_SIZE);
    const size_t rtps = 20 + 16 + 12 + 24 + 4 + 32;
    CHECK_AT_MOST(rtps + offsetof(verge_vehicle_plan_t, crc32) + sizeof p.crc32, 1472);
}

static void test_decoding_returns_what_was_encoded(void** state)
{
    (void)state;
    uint8_t           bytes[CODEC_SIZE_MAX];
    transport_message message;

    verge_vehicle_plan_t plan = good_plan();
    plan.crc32 = 0x12345678;
    size_t size = codec_encode(TRANSPORT_PLAN, &plan, bytes);
    assert_true(codec_decode(TRANSPORT_PLAN, bytes, size, &message));
    assert_int_equal(message.as.plan.crc32, 0x12345678);
    assert_memory_equal(&message.as.plan.points, &plan.points, sizeof plan.points);
    assert_int_equal(message.as.plan.digest, plan.digest);
    assert_int_equal(message.as.plan.actions[6].t1_ms, 3500);

    const transport_mark mark = { .utime = 1700000000500000, .cycle = 99, .overrun = 1 };
    size = codec_encode(TRANSPORT_MARK, &mark, bytes);
    assert_true(codec_decode(TRANSPORT_MARK, bytes, size, &message));
    assert_int_equal(message.as.mark.utime, mark.utime);
    assert_int_equal(message.as.mark.cycle, 99);
    assert_int_equal(message.as.mark.overrun, 1);
}

/// The checksum is taken over the fields of the struct, without encoding it. On LCM others take it
/// over the bytes. Any bits may be in the fields and in the padding between them.
static void test_the_checksum_of_the_fields_is_that_of_the_bytes(void** state)
{
    (void)state;
    static transport_message message, sealed, other;
    test_rng                 rng = test_rng_seeded("checksum");
    for (uint32_t round = 0; round < test_rounds(3000); ++round) {
        const transport_kind kind = TRANSPORT_STATE + round % 4;
        uint8_t              bytes[CODEC_SIZE_MAX];
        for (size_t i = 0; i < sizeof message.as; ++i) {
            ((uint8_t*)&message.as)[i] = (uint8_t)test_rng_next(&rng);
        }
        message_seal(kind, &message.as, &sealed.as);
        const size_t size = codec_encode(kind, &sealed.as, bytes);
        assert_int_equal(codec_get_u32(bytes + size - 4), crc32_by_bits(bytes + 8, size - 12));
        assert_int_equal(message_crc32(kind, &message.as), codec_get_u32(bytes + size - 4));
        assert_true(message_is_whole(kind, &sealed.as));
        // The padding is gone: what was decoded into zero bytes is the same memory.
        memset(&other, 0, sizeof other);
        assert_true(codec_decode(kind, bytes, size, &other));
        assert_memory_equal(&other.as, &sealed.as, message_of(kind)->size);
    }
}

static bool arrives_whole(const uint8_t* bytes, size_t size)
{
    transport_message message;
    return codec_decode(TRANSPORT_STATE, bytes, size, &message) &&
           message_is_whole(TRANSPORT_STATE, &message.as);
}

static void test_any_flipped_bit_and_any_other_length_is_refused(void** state)
{
    (void)state;
    verge_vehicle_state_t good = good_state();
    uint8_t               bytes[CODEC_SIZE_MAX + 8] = { 0 };
    transport_message     message;
    good.crc32 = (int32_t)message_crc32(TRANSPORT_STATE, &good);
    const size_t size = codec_encode(TRANSPORT_STATE, &good, bytes);

    for (size_t bit = 0; bit < 8 * size; ++bit) {
        bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
        assert_false(arrives_whole(bytes, size));
        bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
    }
    for (size_t other = 0; other < sizeof bytes; ++other) {
        assert_int_equal(arrives_whole(bytes, other), other == size);
    }
    assert_false(codec_decode(TRANSPORT_PLAN, bytes, size, &message));
}

// ---------------------------------------------------------------- ranges

typedef enum number { I16, I32, I64, F32, F64 } number;

/// One field and its limits.
typedef struct field {
    const char* name;
    number      type;
    size_t      offset;
    double      min, max;   ///< infinite: the type's own limit
    bool        nan_allowed;
} field;

#define FIELD(name, type, min, max, nan) \
    { #name, type, offsetof(verge_vehicle_state_t, name), min, max, nan }

static const field state_fields[] = {
    FIELD(utime, I64, 1, INFINITY, false),
    FIELD(vehicle_id, I32, 0, INFINITY, false),
    FIELD(controlled, I16, 0, 1, false),
    FIELD(x, F64, -1e7, 1e7, false),
    FIELD(y, F64, -1e7, 1e7, false),
    FIELD(heading, F32, -3e38, INFINITY, true),
    FIELD(speed, F32, -15, 70, true),
    FIELD(acceleration, F32, -30, 30, true),
    FIELD(yaw_rate, F32, -5, 5, true),
    FIELD(length, F32, 0.5, 30, false),
    FIELD(width, F32, 0.3, 4, false),
    FIELD(position_sigma, F32, -1e9, 100, true),
    FIELD(target_lane, I32, -1, INFINITY, false),
    FIELD(habit, I16, 0, 2, false),
    FIELD(cooperation, F32, 0, 1, true),
    FIELD(followed_cycle, I32, -1, INFINITY, false),
};

static void put(void* message, const field* f, double value)
{
    void* at = (char*)message + f->offset;
    switch (f->type) {
    case I16: *(int16_t*)at = (int16_t)value; break;
    case I32: *(int32_t*)at = (int32_t)value; break;
    case I64: *(int64_t*)at = (int64_t)value; break;
    case F32: *(float*)at = (float)value; break;
    case F64: *(double*)at = value; break;
    }
}

static const char* fault_with(const field* f, double value)
{
    verge_vehicle_state_t message = good_state();
    put(&message, f, value);
    return wire_state_check(&message);
}

static void test_every_field_of_a_state_is_held_to_its_range(void** state)
{
    (void)state;
    const verge_vehicle_state_t good = good_state();
    assert_null(wire_state_check(&good));

    for (size_t i = 0; i < sizeof state_fields / sizeof state_fields[0]; ++i) {
        const field* f = &state_fields[i];
        const bool   real = f->type == F32 || f->type == F64;
        const double step = real ? 1e-4 * (1.0 + fabs(f->min)) : 1.0;
        const bool   any_below = strcmp(f->name, "position_sigma") == 0 // negative: unknown
                                 || strcmp(f->name, "heading") == 0;    // any finite angle

        assert_null(fault_with(f, f->min));
        if (!any_below) {
            assert_string_equal(fault_with(f, f->min - step), f->name);
            assert_string_equal(fault_with(f, -30000.0 - (real ? 1e8 : 0.0)), f->name);
        }
        if (!isinf(f->max)) {
            assert_null(fault_with(f, f->max));
            assert_string_equal(fault_with(f, f->max + step), f->name);
        }
        if (real) {
            assert_string_equal(fault_with(f, INFINITY), f->name);
            assert_string_equal(fault_with(f, -INFINITY), f->name);
            if (f->nan_allowed) {
                assert_null(fault_with(f, NAN));
            } else {
                assert_string_equal(fault_with(f, NAN), f->name);
            }
        }
    }
}

static void test_the_quantities_of_a_message_have_the_ranges_of_a_vehicle(void** state)
{
    (void)state;
    static const transport_kind kinds[] = { TRANSPORT_STATE, TRANSPORT_PLAN };
    uint32_t found = 0;
    for (size_t k = 0; k < 2; ++k) {
        const message_struct* of = message_of(kinds[k]);
        if (kinds[k] == TRANSPORT_PLAN) { // the last array: points
            for (uint32_t i = 0; i < message_of(kinds[k])->field_count; ++i) {
                of = message_of(kinds[k])->fields[i].part != NULL
                         ? message_of(kinds[k])->fields[i].part : of;
            }
        }
        for (uint32_t i = 0; i < of->field_count; ++i) {
            const verge_vehicle_limit* limit = verge_vehicle_limit_of(of->fields[i].name);
            if (limit != NULL && strcmp(limit->name, "heading") != 0) { // wrapped in plans
                CHECK_NEAR(of->fields[i].min, limit->min, 0.0);
                CHECK_NEAR(of->fields[i].max, limit->max, 0.0);
                // A message may leave open what the inbox fills in.
                assert_true(of->fields[i].unknown != MESSAGE_KNOWN || !limit->or_nan);
                ++found;
            }
        }
    }
    assert_int_equal(found, 7 + 4);
}

#define CHECK_PLAN_FAULT(assignment, name)               \
    do {                                                 \
        verge_vehicle_plan_t plan = good_plan();         \
        plan.assignment;                                 \
        assert_non_null(wire_plan_check(&plan));         \
        assert_string_equal(wire_plan_check(&plan), name); \
    } while (0)

static void test_every_field_of_a_plan_is_held_to_its_range(void** state)
{
    (void)state;
    const verge_vehicle_plan_t good = good_plan();
    assert_null(wire_plan_check(&good));

    CHECK_PLAN_FAULT(utime = 0, "utime");
    CHECK_PLAN_FAULT(valid_until_utime = plan.utime - 1, "valid_until_utime");
    CHECK_PLAN_FAULT(state_utime = -1, "state_utime");
    CHECK_PLAN_FAULT(rsu_id = -1, "rsu_id");
    CHECK_PLAN_FAULT(cycle = -1, "cycle");
    CHECK_PLAN_FAULT(plans_in_cycle = -1, "plans_in_cycle");
    CHECK_PLAN_FAULT(vehicle_id = -1, "vehicle_id");
    CHECK_PLAN_FAULT(status = 4, "status");
    CHECK_PLAN_FAULT(status = -1, "status");
    CHECK_PLAN_FAULT(reason = -1, "reason");
    CHECK_PLAN_FAULT(action_count = 8, "action_count");
    CHECK_PLAN_FAULT(action_count = -1, "action_count");
    CHECK_PLAN_FAULT(point_count = 32, "point_count");
    CHECK_PLAN_FAULT(point_count = 1, "point_count");
    CHECK_PLAN_FAULT(dt_ms = 0, "dt_ms");
    CHECK_PLAN_FAULT(dt_ms = 1001, "dt_ms");
    CHECK_PLAN_FAULT(actions[6].action = 5, "actions.action");
    CHECK_PLAN_FAULT(actions[6].lane = -2, "actions.lane");
    CHECK_PLAN_FAULT(actions[6].brake_light = 2, "actions.brake_light");
    CHECK_PLAN_FAULT(actions[6].turn_signal = -2, "actions.turn_signal");
    CHECK_PLAN_FAULT(actions[6].t1_ms = plan.actions[5].t1_ms - 1, "actions.t1_ms");
    CHECK_PLAN_FAULT(actions[6].speed = NAN, "actions.speed");
    CHECK_PLAN_FAULT(actions[6].s = NAN, "actions.s");
    CHECK_PLAN_FAULT(actions[6].distance = -1.0f, "actions.distance");
    CHECK_PLAN_FAULT(protocol_version = 0, "protocol_version");
    CHECK_PLAN_FAULT(protocol_version = 2, "protocol_version");
    CHECK_PLAN_FAULT(why = VERGE_WHY_COUNT, "why");
    CHECK_PLAN_FAULT(change_lane = -2, "change_lane");
    CHECK_PLAN_FAULT(change_end_ms = -1, "change_end_ms");
    CHECK_PLAN_FAULT(pass_count = 5, "pass_count");
    CHECK_PLAN_FAULT(passes[3].after = -1, "passes.after");
    CHECK_PLAN_FAULT(stop_count = 4, "stop_count");
    CHECK_PLAN_FAULT(stops[2].jerk = 51.0f, "stops.jerk");
    CHECK_PLAN_FAULT(points[30].x = NAN, "points.x");
    CHECK_PLAN_FAULT(points[30].y = 1.1e7, "points.y");
    CHECK_PLAN_FAULT(points[30].heading = 3.15f, "points.heading");
    CHECK_PLAN_FAULT(points[30].speed = -15.1f, "points.speed");
    CHECK_PLAN_FAULT(points[30].acceleration = 30.1f, "points.acceleration");
    CHECK_PLAN_FAULT(points[30].curvature = INFINITY, "points.curvature");
}

// ---------------------------------------------------------------- conversion

static void test_a_vehicle_is_the_same_after_conversion_there_and_back(void** state)
{
    (void)state;
    const verge_vehicle_state_t sent = good_state();

    const verge_vehicle vehicle = wire_vehicle_from_state(&sent);
    const verge_vehicle_state_t back =
        wire_state_from_vehicle(&vehicle, VERGE_AGGRESSIVE, sent.utime, 41, 12);

    assert_null(wire_state_check(&back));
    assert_true(vehicle.controlled);
    assert_int_equal(vehicle.target_lane, 2);
    CHECK_NEAR(vehicle.habit.cooperation, 0.25, 0.0);
    CHECK_SAME_BITS(back.x, sent.x);
    CHECK_SAME_BITS(back.y, sent.y);
    CHECK_NEAR(back.heading, sent.heading, 0.0);
    CHECK_NEAR(back.yaw_rate, sent.yaw_rate, 0.0);
    CHECK_NEAR(back.cooperation, sent.cooperation, 0.0);
    CHECK_NEAR(back.length, sent.length, 0.0);
    assert_int_equal(back.habit, sent.habit);
}

static void test_an_unknown_cooperation_is_the_habits(void** state)
{
    (void)state;
    for (int kind = VERGE_AGGRESSIVE; kind <= VERGE_CONSERVATIVE; ++kind) {
        verge_vehicle_state_t sent = good_state();
        sent.habit = (int16_t)kind;
        sent.cooperation = NAN;
        const verge_vehicle vehicle = wire_vehicle_from_state(&sent);
        const verge_habit   habit = verge_habit_of((verge_habit_kind)kind);
        assert_memory_equal(&vehicle.habit, &habit, sizeof habit);
        assert_true(isnan(wire_state_from_vehicle(&vehicle, (verge_habit_kind)kind, 1, 0, -1)
                              .cooperation));
    }
}

static verge_vehicle_plan core_plan(uint32_t steps)
{
    verge_vehicle_plan plan = { .vehicle_id = 7, .status = VERGE_PLANNED, .point_count = 31 };
    plan.action_count = steps;
    for (uint32_t i = 0; i < steps; ++i) {
        plan.actions[i] = (verge_action_step){
            .action = VERGE_KEEP_SPEED, .lane_id = 1, .t0 = 0.5 * i, .t1 = 0.5 * (i + 1),
            .v = 10.0 + i,
        };
    }
    for (uint32_t i = 0; i < 31; ++i) {
        plan.points[i] = (verge_point){
            .t = 0.1 * i, .x = i, .speed = 10, .acceleration = 0.1 * i,
        };
    }
    return plan;
}

static const wire_plan_header header = {
    .utime = 1000000, .valid_until_utime = 2000000, .state_utime = 900000, .rsu_id = 3,
    .cycle = 17, .plans_in_cycle = 2, .digest = 0xfedcba9876543210u, .map_crc32 = 0x00c0ffee,
};

static void test_each_decision_step_is_an_action_and_the_first_seven_are_kept(void** state)
{
    (void)state;
    enum { STEPS = VERGE_STEPS_MAX < 9 ? VERGE_STEPS_MAX : 9 };
    verge_vehicle_plan plan = core_plan(STEPS);
    for (uint32_t i = 0; i < STEPS; ++i) {
        plan.actions[i].action = i % 2 == 0 ? VERGE_KEEP_SPEED : VERGE_CHANGE_LEFT;
        plan.actions[i].turn_signal = i % 2 == 0 ? 0 : 1;
        plan.actions[i].s = 100.5 + i;
        plan.actions[i].d = 0.25 - 0.125 * i;
        plan.actions[i].distance = 5.5 + i;
    }
    plan.decided = VERGE_ACCELERATE;
    plan.why = (verge_cause){ VERGE_WHY_MERGE, 12, 4, 0 };
    plan.pass_count = 2;
    plan.passes[1] = (verge_pass){ 4, 6, 12 };

    const verge_vehicle_plan_t message = wire_plan_from_vehicle_plan(&header, &plan);
    verge_vehicle_decision     decision;
    assert_null(wire_plan_check(&message));
    assert_true(wire_decision_from_plan(&message, &decision));
    assert_int_equal(decision.vehicle_id, 7);
    assert_int_equal(decision.step_count, 7);
    plan.actions[0].action = VERGE_ACCELERATE; // what was decided, not what is driven
    for (uint32_t i = 0; i < 7; ++i) {
        const verge_action_step *expected = &plan.actions[i], *step = &decision.steps[i];
        assert_int_equal(step->action, expected->action);
        assert_int_equal(step->lane_id, expected->lane_id);
        assert_true(step->t0 == expected->t0 && step->t1 == expected->t1);
        assert_true(step->s == expected->s && step->d == expected->d && step->v == expected->v);
        assert_true(step->distance == expected->distance);
        assert_int_equal(step->brake_light, expected->brake_light);
        assert_int_equal(step->turn_signal, expected->turn_signal);
        assert_int_equal(step->ahead_id, -1);
        assert_int_equal(step->behind_id, -1);
    }
    assert_memory_equal(&decision.why, &plan.why, sizeof plan.why);
    assert_int_equal(decision.pass_count, 2);
    assert_int_equal(decision.passes[1].lane_id, 4);
    assert_int_equal(decision.passes[1].after_id, 12);
    assert_int_equal(message.point_count, 31);
    assert_int_equal(message.dt_ms, 100);
    assert_int_equal(message.protocol_version, WIRE_PROTOCOL_VERSION);
    assert_int_equal(message.map_crc32, 0x00c0ffee);
    assert_true((uint64_t)message.digest == header.digest);

    const verge_vehicle_plan_t none = wire_plan_cancelled(&header, 7, VERGE_REASON_NONE);
    assert_int_equal(none.why_vehicle, -1);
    assert_false(wire_decision_from_plan(&none, &decision));
}

static void test_the_checksum_of_a_road_is_over_what_it_states(void** state)
{
    (void)state;
    const double points[2][2][2] = { { { 0, 0 }, { 100, 0 } }, { { 0, 4 }, { 100, 4 } } };
    verge_lane_def lanes[2] = { verge_lane_def_default(), verge_lane_def_default() };
    for (int i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].points = points[i];
        lanes[i].point_count = 2;
    }
    const verge_road_def road = { lanes, 2 };
    const uint32_t       crc = wire_map_crc32(&road);
    const verge_lane_def swapped[2] = { lanes[1], lanes[0] };
    assert_int_equal(wire_map_crc32(&(verge_road_def){ swapped, 2 }), crc); // in any order
    assert_int_not_equal(wire_map_crc32(&(verge_road_def){ lanes, 1 }), crc);
#define CHECK_COUNTS(change)                                      \
    do {                                                          \
        const verge_lane_def kept = lanes[1];                     \
        lanes[1].change;                                          \
        assert_int_not_equal(wire_map_crc32(&road), crc);         \
        lanes[1] = kept;                                          \
    } while (0)
    CHECK_COUNTS(id = 2);
    CHECK_COUNTS(width = nextafter(3.5, 4.0));
    CHECK_COUNTS(speed_limit = 14.0);
    CHECK_COUNTS(right = 0);
    CHECK_COUNTS(successor_count = 1);
    CHECK_COUNTS(change_left_given = true);
    CHECK_COUNTS(priority = VERGE_PRIORITY_MINOR);
    CHECK_COUNTS(stop_line_given = true);
    CHECK_COUNTS(points = points[0]);
    assert_int_equal(wire_map_crc32(&road), crc);
}

static void test_points_come_back_with_time_and_jerk(void** state)
{
    (void)state;
    const verge_vehicle_plan   plan = core_plan(4);
    const verge_vehicle_plan_t message = wire_plan_from_vehicle_plan(&header, &plan);
    verge_point                points[VERGE_POINTS_MAX];

    assert_int_equal(wire_points_from_plan(&message, points), 31);
    for (int i = 0; i < 31; ++i) {
        CHECK_NEAR(points[i].t, 0.1 * i, 1e-12);
        CHECK_NEAR(points[i].x, i, 0.0);
        CHECK_NEAR(points[i].jerk, i < 30 ? 1.0 : 0.0, 1e-5);
    }
    assert_null(wire_action_at(&message, header.utime - 1));
    assert_ptr_equal(wire_action_at(&message, header.utime), &message.actions[0]);
}

static void test_the_rest_of_a_plan_is_a_plan_that_ends_where_it_ended(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("rest");
    uint32_t lefts = 0;
    for (uint32_t round = 0; round < test_rounds(20000); ++round) {
        verge_vehicle_plan_t plan = good_plan();
        plan.dt_ms = (int16_t)(1 + test_rng_next(&rng) % 1000);
        plan.point_count = 2 + (int32_t)(test_rng_next(&rng) % (WIRE_POINTS_MAX - 1));
        plan.action_count = (int32_t)(test_rng_next(&rng) % (WIRE_ACTIONS_MAX + 1));
        for (int32_t i = 0; i < plan.point_count; ++i) {
            plan.points[i] = (verge_plan_point_t){ .x = i, .speed = (float)i };
        }
        int32_t t = 0;
        for (int32_t i = 0; i < plan.action_count; ++i) {
            plan.actions[i] = (verge_plan_action_t){ .action = (int16_t)(i % 5) };
            t += (int32_t)(test_rng_next(&rng) % 6000);
            plan.actions[i].t1_ms = t;
        }
        const int64_t whole = (int64_t)(plan.point_count - 1) * plan.dt_ms * 1000;
        plan.valid_until_utime = plan.utime + whole;
        assert_null(wire_plan_check(&plan));

        const int64_t at = plan.utime - 1000000 + (int64_t)(test_rng_next(&rng) %
                                                            (uint64_t)(whole + 2000000));
        verge_vehicle_plan_t rest;
        const bool left = wire_plan_rest(&plan, at, &rest);
        assert_int_equal(left, at < plan.utime + whole);
        if (!left) {
            continue;
        }
        ++lefts;
        assert_null(wire_plan_check(&rest));
        assert_true(rest.utime >= plan.utime && (rest.utime <= at || rest.utime == plan.utime));
        assert_true(at - rest.utime < (int64_t)plan.dt_ms * 1000);
        assert_true(rest.utime + (int64_t)(rest.point_count - 1) * rest.dt_ms * 1000 ==
                    plan.valid_until_utime);
        assert_true(rest.valid_until_utime == plan.valid_until_utime);
        assert_true(rest.points[rest.point_count - 1].x == plan.point_count - 1);
        // What it says to do at any later instant is what the whole plan said.
        const verge_plan_action_t* now = wire_action_at(&rest, at < plan.utime ? plan.utime : at);
        const verge_plan_action_t* then = wire_action_at(&plan, at < plan.utime ? plan.utime : at);
        assert_int_equal(now != NULL, then != NULL);
        assert_true(now == NULL || now->action == then->action);
        // And the rest of the rest is the rest of the whole.
        verge_vehicle_plan_t twice, once;
        const int64_t later = at + (int64_t)plan.dt_ms * 1500;
        assert_int_equal(wire_plan_rest(&rest, later, &twice), wire_plan_rest(&plan, later, &once));
        if (later < plan.utime + whole) {
            assert_true(twice.utime == once.utime && twice.point_count == once.point_count);
            assert_int_equal(twice.action_count, once.action_count);
        }
    }
    assert_true(lefts > 0);
    verge_vehicle_plan_t cancelled = wire_plan_cancelled(&header, 3, VERGE_REASON_NONE), rest;
    assert_false(wire_plan_rest(&cancelled, header.utime, &rest));
}

static void test_a_cancelled_plan_is_acceptable_and_empty(void** state)
{
    (void)state;
    const verge_vehicle_plan_t message = wire_plan_cancelled(&header, 7, VERGE_REASON_STALE);
    verge_point                points[VERGE_POINTS_MAX];
    assert_null(wire_plan_check(&message));
    assert_int_equal(message.status, 3);
    assert_int_equal(message.reason, VERGE_REASON_STALE);
    assert_int_equal(wire_points_from_plan(&message, points), 0);
    assert_null(wire_action_at(&message, header.utime));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_crc32_is_that_of_zlib),
        cmocka_unit_test(test_a_state_message_has_its_documented_fields_in_order),
        cmocka_unit_test(test_a_plan_message_has_its_documented_fields_in_order),
        cmocka_unit_test(test_a_signal_message_has_its_documented_fields_in_order),
        cmocka_unit_test(test_a_trajectory_message_has_its_documented_fields_in_order),
        cmocka_unit_test(test_each_mode_and_reason_of_an_on_vehicle_unit_has_a_name_of_its_own),
        cmocka_unit_test(test_every_message_fits_one_datagram),
        cmocka_unit_test(test_decoding_returns_what_was_encoded),
        cmocka_unit_test(test_the_checksum_of_the_fields_is_that_of_the_bytes),
        cmocka_unit_test(test_any_flipped_bit_and_any_other_length_is_refused),
        cmocka_unit_test(test_every_field_of_a_state_is_held_to_its_range),
        cmocka_unit_test(test_the_quantities_of_a_message_have_the_ranges_of_a_vehicle),
        cmocka_unit_test(test_every_field_of_a_plan_is_held_to_its_range),
        cmocka_unit_test(test_a_vehicle_is_the_same_after_conversion_there_and_back),
        cmocka_unit_test(test_an_unknown_cooperation_is_the_habits),
        cmocka_unit_test(test_each_decision_step_is_an_action_and_the_first_seven_are_kept),
        cmocka_unit_test(test_the_checksum_of_a_road_is_over_what_it_states),
        cmocka_unit_test(test_points_come_back_with_time_and_jerk),
        cmocka_unit_test(test_the_rest_of_a_plan_is_a_plan_that_ends_where_it_ended),
        cmocka_unit_test(test_a_cancelled_plan_is_acceptable_and_empty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
