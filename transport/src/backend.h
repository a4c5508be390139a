/// The interface between transport.c and a bus, for the author of a new one, such as Zenoh or MQTT.
/// loop.c is the shortest example, lcm.c implements a protocol of bytes, dds.c uses a middleware.
///
/// A backend moves typed messages. It receives a transport_message to send and fills one when it
/// takes one. The encoding on the wire (LCM's, CDR, JSON) is internal to it. transport.c has the
/// parts that all buses share: URLs, checksums, the counters of received and published messages.
/// Above it, inbox.c checks ranges, age, order and identity.
///
/// Ownership   open() allocates whatever the bus needs, close() frees it. Between them the
///             backend's own code does not allocate, so that a cycle of the daemon does not. Where
///             the middleware allocates, say so in transport.h. Strings and arrays of the options,
///             and the URL, live until open() returns: copy what is needed later. `counts` lives
///             until close() returns.
/// Messages    send() gets a sealed message: every field is set, padding is zero, crc32 is right.
///             It must not keep the pointer. take() fills kind, the struct of this kind in `as`,
///             sender and arrival_utime. crc32 is delivered as it was sent: transport.c compares it
///             with the fields and counts a changed message as malformed. The backend does not
///             check fields.
/// Threads     take() is called by one thread at a time and send() by one thread at a time, but
///             these may be two threads: what both use is atomic or guarded. Threads of a
///             middleware may fill a queue of the backend; they must not call options->log (see
///             complaints.h, which passes their lines to the thread that takes).
/// Blocking    take() never waits. send() returns within about 5 ms even if the network is gone or
///             a receiver is slow: drop the message, count it and return -1. open() may take
///             seconds.
/// Polling     fd() is readable while a message waits, and may be readable when none does: the
///             caller polls it, then takes until TAKE_NOTHING. It stays the same descriptor from
///             open() to close(), over every reconnection. Where the middleware has no descriptor,
///             use an eventfd that its threads write to; clear it before the last look at the
///             queue, so that a message in between sets it again (dds_bus_take()).
/// Loss        States are replaced every 0.1 s: deliver the newest, drop the oldest. Plans should
///             be sent again until they are 3 s old. Statuses should also reach a program that
///             starts later. Dropped messages are counted in `dropped`, at either end.
/// Recovery    open() fails where the bus cannot work now (TRANSPORT_UNAVAILABLE) or never will
///             with this URL and these options (TRANSPORT_BAD_URL); the daemon then ends. Once
///             open, a bus does not fail: it counts in `errors`, tries again by itself at least
///             once a second, and recovers. take() is called once a second even when nothing waits;
///             that is the place.
/// Senders     message->sender tells two senders of a bus apart and stays the same while a sender
///             lives: an address, a writer's handle, a session id. The inbox gives a vehicle's id
///             to its first sender, so a number that several senders share disables that
///             protection. 0: not known. sender_text() makes of it what the tools of the bus show.
/// Security    exposed() detects that participants without a key or certificate can receive or
///             send, and gives the remedy: verge-rsu warns at start. secured() is true if the
///             options require signatures or certificates, expires() gives their expiry date. A
///             message of a sender that is not admitted is counted in `refused` by its cause and
///             reported with its sender's address. Bytes from the network are never trusted: check
///             lengths before use, never allocate by a length in a message, and limit the memory
///             that senders can fill (a limit for instances, topics, sessions).
/// Errors      open() writes one line to `error` that names the URL or the option, what is wrong
///             and what was expected or can be done. Later faults go through complaints.h: a
///             line for each cause, rate-limited.
/// Counters    The backend counts `malformed` (no message of ours, wrong length, wrong type),
///             `foreign` (well-formed, but of a kind not in `receive`), `dropped`, `errors` of
///             receiving, `lost` and `refused`. transport.c counts `received`, `published`, wrong
///             checksums and failed sends.
/// Time        arrival_utime stays 0, for the time of the clock; a bus that replays a recording
///             sets the event's own. send()'s utime is for a bus that records (keeps_time).
///
/// Settings    What a bus needs beyond its URL stands in its table: name, kind, range, sentence.
///             From the table come the reading and checking of the configuration, --print-config,
///             the schema and the manual. open() reads the values with settings.h; they are in
///             their ranges, and files are full paths. A change of a file's content counts as a
///             change of the configuration.
///
/// To add one: a file with its `const backend`; its line in buses.def; its library in
/// CMakeLists.txt; a case in tests/transport/test_backends.c, which runs every claim about buses
/// against it; the URL in transport.h; tools/documents for schema and manual.
#ifndef BACKEND_H
#define BACKEND_H

#include "verge/transport.h"

#include <stdatomic.h>

/// The bits of `receive` that request messages, and those that announce what will be sent.
enum {
    RECEIVE_MASK = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_STATUSES | TRANSPORT_SIGNALS
                   | TRANSPORT_TRAJECTORIES | TRANSPORT_MARKS,
    SENDS_MASK = RECEIVE_MASK << 8,
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

typedef enum take_result {
    TAKE_NOTHING, ///< nothing waits
    TAKE_MESSAGE,
    TAKE_REFUSED, ///< not a message to deliver; the backend has counted it
} take_result;

/// A function may be null if its comment states the effect.
typedef struct backend {
    const char* scheme; ///< "lcm:", what a URL of this bus begins with
    const char* form;   ///< a whole URL: "dds:N"
    /// rest is the URL behind the scheme; options is never null; receive has the bits of
    /// TRANSPORT_STATES and its like. Returns a transport_result; *self is null on failure.
    int  (*open)(void** self, const char* rest, unsigned receive,
                 const transport_options* options, counters* counts, char* error,
                 size_t error_size);
    void (*close)(void* self);
    /// For poll(). Null: -1, always ready.
    int  (*fd)(const void* self);
    /// True: all messages were taken. Null: never.
    bool (*ended)(const void* self);
    /// sender, bus and arrival_utime are 0 on entry. On TAKE_MESSAGE the kind is one of `receive`.
    take_result (*take)(void* self, transport_message* message);
    /// utime is the event's own time where the bus records one. 0 or -1.
    int  (*send)(void* self, int64_t utime, const transport_message* message);
    /// A sender as text. Null: as a hexadecimal number.
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
    const transport_setting_def* settings; ///< what this bus needs beyond its URL
    uint32_t                     setting_count;
} backend;

#define BUS(name) extern const backend backend_##name;
#include "buses.def"
/// All of this build; ends with null.
extern const backend* const backend_list[];

/// [us] CLOCK_REALTIME.
int64_t backend_utime_now(void);
/// [s] CLOCK_MONOTONIC.
int64_t backend_now_s(void);

#endif
