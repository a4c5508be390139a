#include "lcm_event.h"

#include "lcm_auth.h"

#include <string.h>

static const uint32_t magic_single = 0x4c433032; // "LC02"

void lcm_datagram_write(lcm_datagram* self, uint32_t sequence, const transport_message* message)
{
    const char*  channel = codec_channel(message->kind);
    const size_t size = codec_encode(message->kind, &message->as, self->payload);
    codec_put_u32(self->header, magic_single);
    codec_put_u32(self->header + 4, sequence);
    self->parts[0] = (struct iovec){ .iov_base = self->header, .iov_len = LCM_HEADER_SIZE };
    self->parts[1] = (struct iovec){ .iov_base = (void*)(uintptr_t)channel,
                                     .iov_len = strlen(channel) + 1 };
    self->parts[2] = (struct iovec){ .iov_base = self->payload, .iov_len = size };
    self->parts[3] = (struct iovec){ .iov_base = NULL };
}

bool lcm_datagram_read(const uint8_t* bytes, size_t size, lcm_event* event)
{
    if (size < LCM_HEADER_SIZE + 2 || codec_get_u32(bytes) != magic_single) {
        return false;
    }
    const uint8_t* name = bytes + LCM_HEADER_SIZE;
    const size_t   room = size - LCM_HEADER_SIZE;
    const size_t   searched = room < sizeof event->channel ? room : sizeof event->channel;
    const uint8_t* end = memchr(name, '\0', searched);
    if (end == NULL || end == name) {
        return false;
    }
    const size_t length = (size_t)(end - name);
    memcpy(event->channel, name, length + 1);
    event->payload = end + 1;
    event->size = room - length - 1;
    return true;
}

take_result lcm_event_read(const lcm_event* event, unsigned receive, counters* counts,
                           transport_message* message)
{
    const transport_kind kind = codec_kind(event->channel);
    if (kind == TRANSPORT_NONE || (receive & 1u << kind) == 0) {
        count_up(&counts->foreign, 1);
        return TAKE_REFUSED;
    }
    // An unchecked signature, as in the log of a signed bus. Bytes after a message are ignored, as
    // by LCM's decoders.
    size_t size = event->size;
    if (size == codec_size(kind) + LCM_AUTH_TRAILER_SIZE &&
        lcm_auth_signed(event->payload, size)) {
        size -= LCM_AUTH_TRAILER_SIZE;
    }
    if (event->truncated || !codec_decode(kind, event->payload, size, message)) {
        count_up(&counts->malformed, 1);
        return TAKE_REFUSED;
    }
    return TAKE_MESSAGE;
}
