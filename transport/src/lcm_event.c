#include "lcm_event.h"

#include "codec.h"
#include "lcm_auth.h"

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
