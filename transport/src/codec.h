/// Messages to bytes and back: the encoding of transport/types/verge.lcm, for LCM and its logs.
///
/// Bytes       8-byte fingerprint of the type, fields big-endian, crc32 (defined in verge.lcm).
/// Memory      The caller's buffers only: the generated coders of fixed arrays allocate nothing.
/// Marks       VERGE_CYCLE is no LCM type but is framed alike: the eight letters "VERGEMRK",
///             utime, cycle, overrun, crc32.
#ifndef CODEC_H
#define CODEC_H

#include "verge/transport.h"
#include "verge/wire.h"

/// Encoded sizes [B]: the fingerprint and every field; test_wire.c compares them with what lcm-gen
/// made of the schema.
enum {
    CODEC_FINGERPRINT_SIZE = 8,
    CODEC_STATE_SIZE = CODEC_FINGERPRINT_SIZE
#define STATE(type, name, ...) + sizeof((verge_vehicle_state_t*)0)->name
#include "messages.def"
    ,
    CODEC_ACTION_SIZE = 0
#define ACTION(type, name, ...) + sizeof((verge_plan_action_t*)0)->name
#include "messages.def"
    ,
    CODEC_PASS_SIZE = 0
#define PASS(type, name, ...) + sizeof((verge_plan_pass_t*)0)->name
#include "messages.def"
    ,
    CODEC_STOP_SIZE = 0
#define STOP(type, name, ...) + sizeof((verge_plan_stop_t*)0)->name
#include "messages.def"
    ,
    CODEC_POINT_SIZE = 0
#define POINT(type, name, ...) + sizeof((verge_plan_point_t*)0)->name
#include "messages.def"
    ,
    CODEC_PLAN_SIZE = CODEC_FINGERPRINT_SIZE + WIRE_ACTIONS_MAX * CODEC_ACTION_SIZE +
                      WIRE_PASSES_MAX * CODEC_PASS_SIZE + WIRE_STOPS_MAX * CODEC_STOP_SIZE +
                      WIRE_POINTS_MAX * CODEC_POINT_SIZE
#define PLAN(type, name, ...) + sizeof((verge_vehicle_plan_t*)0)->name
#include "messages.def"
    ,
    CODEC_STATUS_SIZE = CODEC_FINGERPRINT_SIZE
#define STATUS(type, name, ...) + sizeof((verge_rsu_status_t*)0)->name
#include "messages.def"
    ,
    CODEC_SIGNAL_SIZE = CODEC_FINGERPRINT_SIZE
#define SIGNAL(type, name, ...) + sizeof((verge_lane_signal_t*)0)->name
#include "messages.def"
    ,
    CODEC_TRAJECTORY_SIZE = CODEC_FINGERPRINT_SIZE + WIRE_POINTS_MAX * CODEC_POINT_SIZE
#define TRAJECTORY(type, name, ...) + sizeof((verge_vehicle_trajectory_t*)0)->name
#include "messages.def"
    ,
    CODEC_MARK_SIZE = 32,
    CODEC_SIZE_MAX = CODEC_PLAN_SIZE,
};

/// "VERGE_STATE" and so on; null for TRANSPORT_NONE.
const char* codec_channel(transport_kind kind);
/// The kind of a channel's messages; TRANSPORT_NONE for channels that are not verge's.
transport_kind codec_kind(const char* channel);
size_t codec_size(transport_kind kind);

/// Encodes the struct of this kind, a message with the crc32 it holds, right or wrong, a mark with
/// its own. Returns codec_size(kind).
size_t codec_encode(transport_kind kind, const void* value, uint8_t bytes[CODEC_SIZE_MAX]);
/// Fills message->kind and message->as. False unless size and fingerprint are right, and of a mark
/// its crc32. A message's crc32 is for message_is_whole() to check.
bool codec_decode(transport_kind kind, const uint8_t* bytes, size_t size,
                  transport_message* message);

/// The generated coders compute their fingerprints at first use, without a lock; calling this
/// from transport_open() makes that happen before there are two threads.
void codec_prepare(void);

/// Big-endian numbers, as in LCM's frames and logs.
void     codec_put_u32(uint8_t* bytes, uint32_t value);
void     codec_put_u64(uint8_t* bytes, uint64_t value);
uint32_t codec_get_u32(const uint8_t* bytes);
uint64_t codec_get_u64(const uint8_t* bytes);

#endif
