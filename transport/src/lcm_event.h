/// An LCM event, a channel and a payload, as a datagram or an event log holds it, and the message
/// it carries.
#ifndef LCM_EVENT_H
#define LCM_EVENT_H

#include "backend.h"

/// LCM's own limit for a channel name, without its terminator. [B]
enum { LCM_CHANNEL_SIZE_MAX = 63 };
/// What one Ethernet frame of 1,500 bytes leaves for a UDP payload over IPv4. [B]
enum { LCM_DATAGRAM_SIZE_MAX = 1472 };

typedef struct lcm_event {
    char           channel[LCM_CHANNEL_SIZE_MAX + 1];
    const uint8_t* payload;
    size_t         size;
    bool           truncated; ///< longer than any message of verge; payload holds its beginning
} lcm_event;

/// Fills kind and content of the message. TAKE_REFUSED: its channel is not in `receive` (counted as
/// foreign), or its length or type is wrong (counted as malformed).
take_result lcm_event_read(const lcm_event* event, unsigned receive, counters* counts,
                           transport_message* message);

#endif
