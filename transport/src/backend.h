/// What a bus has to be able to do for transport.c: move (channel, payload) pairs.
///
/// Encoding, checking, filtering by channel and most counting happen above it, once for all.
/// A backend allocates in open() only. take() and send() may be called by two threads at a time
/// (one each), so what they share is atomic.
#ifndef BACKEND_H
#define BACKEND_H

#include "verge/transport.h"

#include <stdatomic.h>

/// LCM's own limit for a channel name, without its terminator. [B]
enum { CHANNEL_SIZE_MAX = 63 };
/// What one Ethernet frame of 1,500 bytes leaves for a UDP payload over IPv4. [B]
enum { DATAGRAM_SIZE_MAX = 1472 };

/// The bits of `receive` that ask for messages.
enum {
    RECEIVE_MASK = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_STATUSES | TRANSPORT_MARKS,
};

/// transport_stats, countable by two threads.
typedef struct counters {
    atomic_uint_fast64_t received, published, malformed, foreign, dropped, errors, lost;
    atomic_uint_fast64_t refused[TRANSPORT_REFUSALS];
} counters;

static inline void count_up(atomic_uint_fast64_t* counter, uint64_t by)
{
    atomic_fetch_add_explicit(counter, by, memory_order_relaxed);
}

/// One taken event. The payload stays valid until the next take().
typedef struct packet {
    int64_t        utime; ///< [us] the event's own time, 0: the bus has none
    uint64_t       sender; ///< who sent it, 0: the bus does not know
    char           channel[CHANNEL_SIZE_MAX + 1];
    const uint8_t* payload;
    size_t         size;
    bool           truncated; ///< longer than any message of ours; payload holds its beginning
} packet;

typedef enum take_result {
    TAKE_NOTHING, ///< nothing waits
    TAKE_PACKET,
    TAKE_REFUSED, ///< something came that is no event; the backend has counted it
} take_result;

typedef struct backend {
    const char* scheme; ///< "lcm:", what a URL of this bus begins with
    /// rest is the URL behind the scheme; options is never null. Returns a transport_result;
    /// *self is null on failure.
    int  (*open)(void** self, const char* rest, unsigned receive,
                 const transport_options* options, counters* counts, char* error,
                 size_t error_size);
    void (*close)(void* self);
    int  (*fd)(const void* self);
    bool (*ended)(const void* self);
    take_result (*take)(void* self, packet* packet);
    /// utime is the event's own time where the bus records one. 0 or -1.
    int  (*send)(void* self, int64_t utime, const char* channel, const uint8_t* payload,
                size_t size);
    /// A sender in words; null: as a number.
    void (*sender_text)(const void* self, uint64_t sender, char* text, size_t size);
    /// As transport_exposed(). Null: never.
    bool (*exposed)(const char* rest, const transport_options* options, char* words,
                    size_t words_size);
    /// As transport_secured(). Null: never.
    bool (*secured)(const transport_options* options);
    /// As transport_expires(). Null: never.
    bool (*expires)(const transport_options* options, int64_t* utime, char* words,
                    size_t words_size);
    bool keeps_time; ///< send() stores utime: transport_record() makes sense
} backend;

extern const backend backend_lcm, backend_loop, backend_log, backend_dds;

/// [us] CLOCK_REALTIME.
int64_t backend_utime_now(void);
/// [s] CLOCK_MONOTONIC.
int64_t backend_now_s(void);

#endif
