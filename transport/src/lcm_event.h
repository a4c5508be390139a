/// An LCM event, a channel and a payload, as a datagram or an event log holds it, and the message
/// it carries.
///
/// Datagram    "LC02", a sequence number, the channel's name with its terminator, the payload;
///             numbers big-endian.
#ifndef LCM_EVENT_H
#define LCM_EVENT_H

#include "backend.h"
#include "codec.h"

#include <sys/uio.h>

/// LCM's own limit for a channel name, without its terminator. [B]
enum { LCM_CHANNEL_SIZE_MAX = 63 };
/// What one Ethernet frame of 1,500 bytes leaves for a UDP payload over IPv4. [B]
enum { LCM_DATAGRAM_SIZE_MAX = 1472 };
enum {
    LCM_HEADER_SIZE = 8,                     // [B] magic, sequence number
    LCM_ROOM = LCM_DATAGRAM_SIZE_MAX + 64,   // [B] more than any message of ours in its datagram
};

typedef struct lcm_event {
    char           channel[LCM_CHANNEL_SIZE_MAX + 1];
    const uint8_t* payload;
    size_t         size;
    bool           truncated; ///< longer than any message of verge; payload holds its beginning
} lcm_event;

/// A datagram to send.
typedef struct lcm_datagram {
    uint8_t      header[LCM_HEADER_SIZE], payload[CODEC_SIZE_MAX];
    struct iovec parts[4]; ///< header, channel, payload, and an empty one for a signature
} lcm_datagram;

/// `parts` point into *self and at static text.
void lcm_datagram_write(lcm_datagram* self, uint32_t sequence, const transport_message* message);
/// True: the bytes are an unfragmented LCM event. Then channel, payload and size are set, and
/// payload points into the bytes.
bool lcm_datagram_read(const uint8_t* bytes, size_t size, lcm_event* event);

/// Fills kind and content of the message. TAKE_REFUSED: its channel is not in `receive` (counted as
/// foreign), or its length or type is wrong (counted as malformed).
take_result lcm_event_read(const lcm_event* event, unsigned receive, counters* counts,
                           transport_message* message);

#endif
