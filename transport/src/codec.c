#include "codec.h"

#include <assert.h>
#include <string.h>

static const uint64_t mark_fingerprint = 0x56455247454d524bu; // "VERGEMRK"

static int      encode_fields(transport_kind kind, const void* value, uint8_t* bytes, int size);
static int      decode_fields(const uint8_t* bytes, int size, transport_message* message);
static void     encode_mark(const transport_mark* mark, uint8_t* bytes);
static bool     decode_mark(const uint8_t* bytes, transport_mark* mark);
static uint32_t mark_crc32(const uint8_t* bytes);

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
    message->kind = kind;
    return decode_fields(bytes, (int)size, message) == (int)size;
}

void codec_prepare(void)
{
#define MESSAGE(KIND, type, ...) (void)__verge_##type##_get_hash();
#include "messages.def"
}

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
    codec_put_u32(bytes + 28, mark_crc32(bytes));
}

static bool decode_mark(const uint8_t* bytes, transport_mark* mark)
{
    mark->utime = (int64_t)codec_get_u64(bytes + 8);
    mark->cycle = (int64_t)codec_get_u64(bytes + 16);
    mark->overrun = (int32_t)codec_get_u32(bytes + 24);
    return codec_get_u64(bytes) == mark_fingerprint &&
           codec_get_u32(bytes + 28) == mark_crc32(bytes);
}

static uint32_t mark_crc32(const uint8_t* bytes)
{
    return transport_crc32(bytes + CODEC_FINGERPRINT_SIZE, 28 - CODEC_FINGERPRINT_SIZE);
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
