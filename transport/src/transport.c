/// From a URL to a backend, and everything that is the same on every bus: encode and count on the
/// way out; filter by channel, check, decode and count on the way in.
#include "verge/transport.h"

#include "backend.h"
#include "codec.h"
#include "lcm_auth.h"

#include <assert.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// Events looked at in one transport_drain(), wanted or not: a flood of garbage must not keep
/// the caller away from its other work. A flood of this length takes about a millisecond.
enum { EVENTS_PER_DRAIN_MAX = 512 };

struct transport {
    const backend* bus;
    void*          self; ///< the backend's
    unsigned       receive;
    counters       counts;
};

static bool admit(transport* bus, const packet* packet, transport_message* message);
static int  publish(transport* bus, int64_t utime, transport_kind kind, const void* value);

#define EXPECTED_URL "expected lcm:udpm://ADDRESS:PORT?ttl=N, dds:N, loop:NAME or log:FILE"

static const backend* const backends[] = {
    &backend_lcm, &backend_loop, &backend_log,
#ifdef VERGE_DDS
    &backend_dds,
#endif
};
static pthread_once_t       prepared = PTHREAD_ONCE_INIT;

static bool begins_with(const char* url, const char* scheme)
{
    return strncmp(url, scheme, strlen(scheme)) == 0;
}

/// The bus a URL begins like; null: none.
static const backend* backend_of(const char* url)
{
    for (size_t i = 0; i < sizeof backends / sizeof backends[0]; ++i) {
        if (begins_with(url, backends[i]->scheme)) {
            return backends[i];
        }
    }
    return NULL;
}

const char* transport_url_fault(const char* url)
{
    if (backend_of(url) != NULL) {
        return NULL;
    }
    return begins_with(url, "dds:")
               ? "this build has no DDS (cmake -DVERGE_DDS=ON), expected another bus"
               : "unknown bus, " EXPECTED_URL;
}

int transport_open(transport** bus, const char* url, unsigned receive, char* error,
                   size_t error_size)
{
    return transport_open_with(bus, url, receive, NULL, error, error_size);
}

int transport_open_with(transport** bus, const char* url, unsigned receive,
                        const transport_options* options, char* error, size_t error_size)
{
    static const transport_options defaults;
    *bus = NULL;
    pthread_once(&prepared, codec_prepare);

    const backend* of = backend_of(url);
    if (of == NULL) {
        snprintf(error, error_size, "%s: %s", url, transport_url_fault(url));
        return TRANSPORT_BAD_URL;
    }
    transport* made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(error, error_size, "%s: out of memory", url);
        return TRANSPORT_UNAVAILABLE;
    }
    made->bus = of;
    made->receive = receive;
    const int result = of->open(&made->self, url + strlen(of->scheme), receive,
                                options != NULL ? options : &defaults, &made->counts, error,
                                error_size);
    if (result != TRANSPORT_OK) {
        free(made);
        return result;
    }
    *bus = made;
    return TRANSPORT_OK;
}

bool transport_exposed(const char* url, const transport_options* options, char* words,
                       size_t words_size)
{
    static const transport_options defaults;
    const backend* bus = backend_of(url);
    return bus != NULL && bus->exposed != NULL &&
           bus->exposed(url + strlen(bus->scheme), options != NULL ? options : &defaults, words,
                        words_size);
}

bool transport_secured(const char* url, const transport_options* options)
{
    const backend* bus = backend_of(url);
    return bus != NULL && bus->secured != NULL && options != NULL && bus->secured(options);
}

bool transport_expires(const char* url, const transport_options* options, int64_t* utime,
                       char* words, size_t words_size)
{
    const backend* bus = backend_of(url);
    return bus != NULL && bus->expires != NULL && options != NULL &&
           bus->expires(options, utime, words, words_size);
}

void transport_close(transport* bus)
{
    if (bus != NULL) {
        bus->bus->close(bus->self);
        free(bus);
    }
}

int transport_fd(const transport* bus)
{
    return bus->bus->fd(bus->self);
}

void transport_sender_text(const transport* bus, uint64_t sender, char* text, size_t size)
{
    if (bus->bus->sender_text != NULL) {
        bus->bus->sender_text(bus->self, sender, text, size);
    } else {
        snprintf(text, size, "%016" PRIx64, sender);
    }
}

bool transport_ended(const transport* bus)
{
    return bus->bus->ended(bus->self);
}

uint32_t transport_drain(transport* bus, transport_message* messages, uint32_t max)
{
    uint32_t count = 0;
    packet   packet;
    for (uint32_t event = 0; event < EVENTS_PER_DRAIN_MAX && count < max; ++event) {
        const take_result taken = bus->bus->take(bus->self, &packet);
        if (taken == TAKE_NOTHING) {
            break;
        }
        if (taken == TAKE_PACKET && admit(bus, &packet, &messages[count])) {
            ++count;
        }
    }
    count_up(&bus->counts.received, count);
    return count;
}

int transport_publish_state(transport* bus, const verge_vehicle_state_t* state)
{
    return publish(bus, backend_utime_now(), TRANSPORT_STATE, state);
}

int transport_publish_plan(transport* bus, const verge_vehicle_plan_t* plan)
{
    return publish(bus, backend_utime_now(), TRANSPORT_PLAN, plan);
}

int transport_publish_status(transport* bus, const verge_rsu_status_t* status)
{
    return publish(bus, backend_utime_now(), TRANSPORT_STATUS, status);
}

int transport_record(transport* bus, int64_t event_utime, const transport_message* message)
{
    if (!bus->bus->keeps_time || codec_size(message->kind) == 0) {
        count_up(&bus->counts.errors, 1);
        return -1;
    }
    return publish(bus, event_utime, message->kind, &message->as);
}

transport_stats transport_statistics(const transport* bus)
{
    const counters* counts = &bus->counts;
    transport_stats stats = {
        .received = atomic_load(&counts->received),
        .published = atomic_load(&counts->published),
        .malformed = atomic_load(&counts->malformed),
        .foreign = atomic_load(&counts->foreign),
        .dropped = atomic_load(&counts->dropped),
        .errors = atomic_load(&counts->errors),
        .lost = atomic_load(&counts->lost),
    };
    for (int i = 0; i < TRANSPORT_REFUSALS; ++i) {
        stats.refused[i] = atomic_load(&counts->refused[i]);
    }
    return stats;
}

const char* transport_refusal_name(transport_refusal refusal)
{
    static const char* const names[] = { "admitted", "not_allowed", "unsigned", "unknown_key",
                                         "forged",   "untimely",    "replayed" };
    static_assert(sizeof names / sizeof names[0] == TRANSPORT_REFUSALS, "a name each");
    return names[refusal];
}

uint64_t transport_refused(const transport_stats* stats)
{
    uint64_t sum = 0;
    for (int i = 0; i < TRANSPORT_REFUSALS; ++i) {
        sum += stats->refused[i];
    }
    return sum;
}

/// Only what was asked for and is whole gets in.
static bool admit(transport* bus, const packet* packet, transport_message* message)
{
    const transport_kind kind = codec_kind(packet->channel);
    if (kind == TRANSPORT_NONE || (bus->receive & 1u << kind) == 0) {
        count_up(&bus->counts.foreign, 1);
        return false;
    }
    // A signature nobody asked to check, as in the log of a signed bus: LCM's decoders pass over
    // what stands behind a message, and so do we.
    size_t size = packet->size;
    if (size == codec_size(kind) + LCM_AUTH_TRAILER_SIZE &&
        lcm_auth_signed(packet->payload, size)) {
        size -= LCM_AUTH_TRAILER_SIZE;
    }
    if (packet->truncated || !codec_decode(kind, packet->payload, size, message)) {
        count_up(&bus->counts.malformed, 1);
        return false;
    }
    message->sender = packet->sender;
    message->bus = 0;
    message->arrival_utime = packet->utime != 0 ? packet->utime : backend_utime_now();
    return true;
}

static int publish(transport* bus, int64_t utime, transport_kind kind, const void* value)
{
    uint8_t      bytes[CODEC_SIZE_MAX];
    const size_t size = codec_encode(kind, value, bytes);
    const int    result = bus->bus->send(bus->self, utime, codec_channel(kind), bytes, size);
    count_up(result == 0 ? &bus->counts.published : &bus->counts.errors, 1);
    return result;
}

int64_t backend_now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec;
}

int64_t backend_utime_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}
