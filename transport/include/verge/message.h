/// The fields of the messages as tables: name, type, unit, range and a sentence for each, made from
/// the one list of all fields, transport/src/messages.def.
///
///     const message_struct* of = message_of(TRANSPORT_STATE);
///     for (uint32_t i = 0; i < of->field_count; ++i) ... of->fields[i].name
///
/// For programs that read or write every field of a message without naming any. The tables are
/// constant, with static lifetime. No function allocates; all may be called from any thread.
#ifndef VERGE_MESSAGE_H
#define VERGE_MESSAGE_H

#include "verge/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum message_type {
    MESSAGE_INT16,
    MESSAGE_INT32,
    MESSAGE_INT64,
    MESSAGE_FLOAT,
    MESSAGE_DOUBLE,
    MESSAGE_BITS32, ///< int32_t that is a bit pattern: a checksum
    MESSAGE_BITS64, ///< int64_t that is a bit pattern: a digest
    MESSAGE_COUNT,  ///< int32_t: number of used elements of an array
    MESSAGE_ARRAY,  ///< structs with a table of their own
} message_type;

/// The values that a field may have besides those from min to max.
typedef enum message_unknown {
    MESSAGE_KNOWN,       ///< none
    MESSAGE_OR_NAN,      ///< NaN
    MESSAGE_OR_NEGATIVE, ///< NaN and everything finite below zero
} message_unknown;

typedef struct message_struct message_struct;

typedef struct message_field {
    const char*     name;
    const char*     path; ///< as a check reports it: "speed", "points.speed"
    message_type    type;
    size_t          offset; ///< [B] in its struct
    const char*     unit;   ///< "m/s"; empty: none
    double          min, max; ///< both included; infinite: the type's own limit
    message_unknown unknown;
    const char*     text; ///< its meaning; may be empty
    // Of arrays only.
    const message_struct* part;
    uint32_t              length;       ///< elements
    size_t                count_offset; ///< [B] of the count in the same struct
} message_field;

struct message_struct {
    const char*          name; ///< in the schemas: "vehicle_state_t"
    size_t               size; ///< [B] of the struct in C
    const message_field* fields;
    uint32_t             field_count;
};

/// Null for TRANSPORT_NONE and TRANSPORT_MARK, which are not in the schemas.
const message_struct* message_of(transport_kind kind);

/// Null: every field is in its range. Otherwise the path of the first field that is not (static
/// lifetime). Elements of an array beyond its count are ignored. Relations between fields are
/// checked in wire.h.
const char* message_check(transport_kind kind, const void* message);

/// The crc32 of a message on any bus: zlib's CRC-32 over the big-endian LCM encoding of all fields
/// before crc32. It is computed from the fields, without encoding the message.
uint32_t message_crc32(transport_kind kind, const void* message);

/// True: the crc32 field of a message is correct.
bool message_is_whole(transport_kind kind, const void* message);

/// Copies a message for sending: copies every field, sets the padding between them to zero, because
/// some buses send the memory of the struct, and computes crc32.
void message_seal(transport_kind kind, const void* message, void* sealed);

#ifdef __cplusplus
}
#endif

#endif
