/// Selects the backend of a URL, and does what all buses share: checksums and counters.
#include "verge/transport.h"

#include "backend.h"
#include "codec.h"
#include "settings.h"
#include "verge/message.h"

#include <assert.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// Largest number of events, requested or not, in one transport_drain(), so that a flood of
/// messages does not block the caller. This number takes about a millisecond.
enum { EVENTS_PER_DRAIN_MAX = 512 };

struct transport {
    const backend* bus;
    void*          self; ///< the backend's
    unsigned       receive;
    counters       counts;
};

static bool admit(transport* bus, transport_message* message);
static int  publish(transport* bus, int64_t utime, transport_kind kind, const void* value);

const backend* const backend_list[] = {
#define BUS(name) &backend_##name,
#include "buses.def"
    NULL,
};
static pthread_once_t       prepared = PTHREAD_ONCE_INIT;

static bool begins_with(const char* url, const char* scheme)
{
    return strncmp(url, scheme, strlen(scheme)) == 0;
}

/// The bus a URL begins like; null: none.
static const backend* backend_of(const char* url)
{
    for (const backend* const* bus = backend_list; *bus != NULL; ++bus) {
        if (begins_with(url, (*bus)->scheme)) {
            return *bus;
        }
    }
    return NULL;
}

static char unknown_bus[256];

/// The line that names the buses of this build; one thread writes it, once.
static void unknown_bus_write(void)
{
    size_t used = (size_t)snprintf(unknown_bus, sizeof unknown_bus,
                                   "unknown bus, or left out of this build, expected");
    for (const backend* const* bus = backend_list; *bus != NULL; ++bus) {
        const char* before = bus == backend_list ? "" : bus[1] == NULL ? " or" : ",";
        used = used < sizeof unknown_bus ? used : sizeof unknown_bus;
        used += (size_t)snprintf(unknown_bus + used, sizeof unknown_bus - used, "%s %s", before,
                                 (*bus)->form);
    }
}

const char* transport_url_fault(const char* url)
{
    static pthread_once_t written = PTHREAD_ONCE_INIT;
    pthread_once(&written, unknown_bus_write);
    return backend_of(url) != NULL ? NULL : unknown_bus;
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
    options = options != NULL ? options : &defaults;
    if (!settings_check(options, error, error_size)) {
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
                                options, &made->counts, error, error_size);
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
    return bus->bus->fd != NULL ? bus->bus->fd(bus->self) : -1;
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
    return bus->bus->ended != NULL && bus->bus->ended(bus->self);
}

uint32_t transport_drain(transport* bus, transport_message* messages, uint32_t max)
{
    uint32_t count = 0;
    for (uint32_t event = 0; event < EVENTS_PER_DRAIN_MAX && count < max; ++event) {
        transport_message* message = &messages[count];
        message->sender = 0;
        message->bus = 0;
        message->arrival_utime = 0;
        const take_result taken = bus->bus->take(bus->self, message);
        if (taken == TAKE_NOTHING) {
            break;
        }
        if (taken == TAKE_MESSAGE && admit(bus, message)) {
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

int transport_publish_signal(transport* bus, const verge_lane_signal_t* signal)
{
    return publish(bus, backend_utime_now(), TRANSPORT_SIGNAL, signal);
}

int transport_publish_trajectory(transport* bus, const verge_vehicle_trajectory_t* trajectory)
{
    return publish(bus, backend_utime_now(), TRANSPORT_TRAJECTORY, trajectory);
}

int transport_record(transport* bus, int64_t event_utime, const transport_message* message)
{
    if (!bus->bus->keeps_time || message->kind == TRANSPORT_NONE) {
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

/// True: the checksum is wrong. The log backend checks that of a mark.
static bool admit(transport* bus, transport_message* message)
{
    assert(message->kind != TRANSPORT_NONE && (bus->receive & 1u << message->kind) != 0);
    if (message->kind != TRANSPORT_MARK && !message_is_whole(message->kind, &message->as)) {
        count_up(&bus->counts.malformed, 1);
        return false;
    }
    if (message->arrival_utime == 0) {
        message->arrival_utime = backend_utime_now();
    }
    return true;
}

static int publish(transport* bus, int64_t utime, transport_kind kind, const void* value)
{
    transport_message message = { .kind = kind };
    if (kind == TRANSPORT_MARK) {
        message.as.mark = *(const transport_mark*)value;
    } else {
        message_seal(kind, value, &message.as);
    }
    const int result = bus->bus->send(bus->self, utime, &message);
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
