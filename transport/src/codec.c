#include "codec.h"

#include <assert.h>
#include <string.h>

enum { CRC_SIZE = 4 };

static const uint64_t mark_fingerprint = 0x56455247454d524bu; // "VERGEMRK"

static int      encode_fields(transport_kind kind, const void* value, uint8_t* bytes, int size);
static int      decode_fields(const uint8_t* bytes, int size, transport_message* message);
static void     encode_mark(const transport_mark* mark, uint8_t* bytes);
static bool     decode_mark(const uint8_t* bytes, transport_mark* mark);
static uint32_t checksum(const uint8_t* bytes, size_t size);

const char* codec_channel(transport_kind kind)
{
    switch (kind) {
#define MESSAGE(KIND, ...) \
    case TRANSPORT_##KIND: return "VERGE_" #KIND;
#include "messages.def"
    case TRANSPORT_MARK: return "VERGE_CYCLE";
    case TRANSPORT_NONE: break;
    }
    return NULL;
}

transport_kind codec_kind(const char* channel)
{
    for (int kind = TRANSPORT_STATE; kind <= TRANSPORT_MARK; ++kind) {
        if (strcmp(channel, codec_channel((transport_kind)kind)) == 0) {
            return (transport_kind)kind;
        }
    }
    return TRANSPORT_NONE;
}

size_t codec_size(transport_kind kind)
{
    switch (kind) {
#define MESSAGE(KIND, ...) \
    case TRANSPORT_##KIND: return CODEC_##KIND##_SIZE;
#include "messages.def"
    case TRANSPORT_MARK: return CODEC_MARK_SIZE;
    case TRANSPORT_NONE: break;
    }
    return 0;
}

size_t codec_encode(transport_kind kind, const void* value, uint8_t bytes[CODEC_SIZE_MAX])
{
    const size_t size = codec_encode_as_is(kind, value, bytes);
    codec_put_u32(bytes + size - CRC_SIZE, checksum(bytes, size));
    return size;
}

size_t codec_encode_as_is(transport_kind kind, const void* value, uint8_t bytes[CODEC_SIZE_MAX])
{
    const size_t size = codec_size(kind);
    const int    written = encode_fields(kind, value, bytes, (int)size);
    assert(written == (int)size); // the schema and the sizes in codec.h belong together
    (void)written;
    return size;
}

bool codec_decode(transport_kind kind, const uint8_t* bytes, size_t size,
                  transport_message* message)
{
    if (kind == TRANSPORT_NONE || size != codec_size(kind)) {
        return false;
    }
    if (codec_get_u32(bytes + size - CRC_SIZE) != checksum(bytes, size)) {
        return false;
    }
    message->kind = kind;
    return decode_fields(bytes, (int)size, message) == (int)size;
}

void codec_prepare(void)
{
#define MESSAGE(KIND, type, ...) (void)__verge_##type##_get_hash();
#include "messages.def"
}

/// Everything, with the crc32 the struct holds.
static int encode_fields(transport_kind kind, const void* value, uint8_t* bytes, int size)
{
    switch (kind) {
#define MESSAGE(KIND, type, ...) \
    case TRANSPORT_##KIND: return verge_##type##_encode(bytes, 0, size, value);
#include "messages.def"
    case TRANSPORT_MARK: encode_mark(value, bytes); return size;
    case TRANSPORT_NONE: break;
    }
    return -1;
}

/// The generated decoders compare the fingerprint.
static int decode_fields(const uint8_t* bytes, int size, transport_message* message)
{
    switch (message->kind) {
#define MESSAGE(KIND, type, ...) \
    case TRANSPORT_##KIND: return verge_##type##_decode(bytes, 0, size, (void*)&message->as);
#include "messages.def"
    case TRANSPORT_MARK: return decode_mark(bytes, &message->as.mark) ? size : -1;
    case TRANSPORT_NONE: break;
    }
    return -1;
}

static void encode_mark(const transport_mark* mark, uint8_t* bytes)
{
    codec_put_u64(bytes, mark_fingerprint);
    codec_put_u64(bytes + 8, (uint64_t)mark->utime);
    codec_put_u64(bytes + 16, (uint64_t)mark->cycle);
    codec_put_u32(bytes + 24, (uint32_t)mark->overrun);
}

static bool decode_mark(const uint8_t* bytes, transport_mark* mark)
{
    mark->utime = (int64_t)codec_get_u64(bytes + 8);
    mark->cycle = (int64_t)codec_get_u64(bytes + 16);
    mark->overrun = (int32_t)codec_get_u32(bytes + 24);
    return codec_get_u64(bytes) == mark_fingerprint;
}

static uint32_t checksum(const uint8_t* bytes, size_t size)
{
    return transport_crc32(bytes + CODEC_FINGERPRINT_SIZE, size - CODEC_FINGERPRINT_SIZE - CRC_SIZE);
}

void codec_put_u32(uint8_t* bytes, uint32_t value)
{
    bytes[0] = (uint8_t)(value >> 24);
    bytes[1] = (uint8_t)(value >> 16);
    bytes[2] = (uint8_t)(value >> 8);
    bytes[3] = (uint8_t)value;
}

void codec_put_u64(uint8_t* bytes, uint64_t value)
{
    codec_put_u32(bytes, (uint32_t)(value >> 32));
    codec_put_u32(bytes + 4, (uint32_t)value);
}

uint32_t codec_get_u32(const uint8_t* bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 |
           (uint32_t)bytes[3];
}

uint64_t codec_get_u64(const uint8_t* bytes)
{
    return (uint64_t)codec_get_u32(bytes) << 32 | codec_get_u32(bytes + 4);
}

/// Four bits at a time: sixteen constants instead of 256, and 1.3 KB still take microseconds.
/// remainder_of[n] is the CRC of the nibble n: four shifts right of n, folding 0xEDB88320 in.
uint32_t transport_crc32(const void* bytes, size_t size)
{
    static const uint32_t remainder_of[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
        0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
        0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    const uint8_t* byte = bytes;
    uint32_t       crc = 0xffffffffu;
    for (size_t i = 0; i < size; ++i) {
        crc ^= byte[i];
        crc = crc >> 4 ^ remainder_of[crc & 15u];
        crc = crc >> 4 ^ remainder_of[crc & 15u];
    }
    return ~crc;
}
