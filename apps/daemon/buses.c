#include "buses.h"

#include <assert.h>
#include <string.h>

static const int64_t DAY_US = 86400 * INT64_C(1000000);

/// The bus works with the files as they are read now, whatever replaces them later.
static void find_expiry(buses* self, const char* url, const transport_options* options)
{
    int64_t expiry = 0;
    char    words[CONFIG_ERROR_SIZE];
    if (transport_expires(url, options, &expiry, words, sizeof words) &&
        (self->expiry == 0 || expiry < self->expiry)) {
        self->expiry = expiry;
        memcpy(self->expiry_text, words, sizeof words);
    }
}

int buses_open(buses* self, const site* site, unsigned use,
               void (*log)(void* context, const char* line), char* error, size_t error_size)
{
    transport_options options = site->bus_options.transport;
    options.log = log;
    memset(self, 0, sizeof *self);
    for (uint32_t i = 0; i < site->bus_count; i++) {
        const int result = transport_open_with(&self->bus[i], site->bus[i], use, &options, error,
                                               error_size);
        if (result != TRANSPORT_OK) {
            buses_close(self);
            return result;
        }
        self->count++;
        find_expiry(self, site->bus[i], &options);
    }
    return TRANSPORT_OK;
}

void buses_close(buses* self)
{
    for (uint32_t i = 0; i < self->count; i++) {
        transport_close(self->bus[i]);
    }
    memset(self, 0, sizeof *self);
}

void buses_succeed(buses* self, const buses* others)
{
    self->past = buses_statistics(others);
}

uint32_t buses_poll(const buses* self, struct pollfd ends[SITE_BUSES_MAX])
{
    for (uint32_t i = 0; i < self->count; i++) {
        ends[i] = (struct pollfd){ .fd = transport_fd(self->bus[i]), .events = POLLIN };
    }
    return self->count;
}

uint32_t buses_drain(buses* self, uint32_t bus, transport_message* messages, uint32_t max)
{
    const uint32_t count = transport_drain(self->bus[bus], messages, max);
    for (uint32_t i = 0; i < count; i++) {
        messages[i].bus = bus;
    }
    return count;
}

static void publish_on(transport* bus, transport_kind kind, const void* message)
{
    switch (kind) {
    case TRANSPORT_STATE: transport_publish_state(bus, message); break;
    case TRANSPORT_PLAN: transport_publish_plan(bus, message); break;
    case TRANSPORT_STATUS: transport_publish_status(bus, message); break;
    case TRANSPORT_SIGNAL: transport_publish_signal(bus, message); break;
    case TRANSPORT_TRAJECTORY: transport_publish_trajectory(bus, message); break;
    default: assert(!"a kind of message that buses carry"); break;
    }
}

void buses_publish(buses* self, transport_kind kind, const void* message)
{
    for (uint32_t i = 0; i < self->count; i++) {
        publish_on(self->bus[i], kind, message);
    }
}

void buses_add(transport_stats* sum, const transport* bus)
{
    const transport_stats stats = transport_statistics(bus);
    sum->received += stats.received;
    sum->published += stats.published;
    sum->malformed += stats.malformed;
    sum->foreign += stats.foreign;
    sum->dropped += stats.dropped;
    sum->errors += stats.errors;
    sum->lost += stats.lost;
    for (uint32_t k = 0; k < TRANSPORT_REFUSALS; k++) {
        sum->refused[k] += stats.refused[k];
    }
}

transport_stats buses_statistics(const buses* self)
{
    transport_stats sum = self->past;
    for (uint32_t i = 0; i < self->count; i++) {
        buses_add(&sum, self->bus[i]);
    }
    return sum;
}

uint64_t buses_new_errors(buses* self, uint32_t bus)
{
    const uint64_t errors = transport_statistics(self->bus[bus]).errors;
    const bool     fresh = errors > self->errors_logged[bus];
    self->errors_logged[bus] = errors;
    return fresh ? errors : 0;
}

int64_t buses_days_left(int64_t expiry, int64_t utime)
{
    const int64_t left = expiry - utime;
    return left / DAY_US - (left % DAY_US < 0 ? 1 : 0);
}

bool buses_expiring(buses* self, int64_t utime)
{
    const bool lately = self->expiry_logged != 0 && utime >= self->expiry_logged &&
                        utime < self->expiry_logged + DAY_US;
    if (self->expiry == 0 || lately || buses_days_left(self->expiry, utime) >= BUSES_EXPIRY_DAYS) {
        return false;
    }
    self->expiry_logged = utime;
    return true;
}
