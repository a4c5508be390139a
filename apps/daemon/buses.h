/// The buses of a configuration as one: messages are received from all of them and sent on all of
/// them, and their counters are added. A bus that fails does not affect the others.
///
/// Memory      As the transports (verge/transport.h).
/// Threads     One.
#ifndef VERGE_DAEMON_BUSES_H
#define VERGE_DAEMON_BUSES_H

#include "daemon/site.h"

#include <poll.h>

/// [days] Certificates and permissions that end sooner cause a warning.
enum { BUSES_EXPIRY_DAYS = 30 };

typedef struct buses {
    transport*      bus[SITE_BUSES_MAX];
    uint32_t        count;
    uint64_t        errors_logged[SITE_BUSES_MAX]; ///< of each bus, when they were last logged
    transport_stats past; ///< counters of the buses before a reload
    int64_t         expiry;      ///< [us] wall clock, first end of a certificate or permission;
                                 ///< 0: none
    int64_t         expiry_logged; ///< [us] when buses_expiring() was last true; 0: never
    char            expiry_text[CONFIG_ERROR_SIZE];
} buses;

/// Opens all buses of a configuration, or none. use: the kinds to receive and to send, TRANSPORT_
/// bits. Later complaints of the buses go to log, which may be null. Returns a transport_result;
/// unless TRANSPORT_OK, error holds one line.
int  buses_open(buses* self, const site* site, unsigned use,
                void (*log)(void* context, const char* line), char* error, size_t error_size);
void buses_close(buses* self); ///< all zero is fine

/// Continues the counters of `others`, which are closed later.
void buses_succeed(buses* self, const buses* others);

/// What to poll for, a descriptor a bus. Returns how many.
uint32_t buses_poll(const buses* self, struct pollfd ends[SITE_BUSES_MAX]);
/// Takes up to max messages of one bus. Each gets the number of its bus.
uint32_t buses_drain(buses* self, uint32_t bus, transport_message* messages, uint32_t max);

/// Sends a message, the struct of its kind (verge/transport.h), on every bus.
void buses_publish(buses* self, transport_kind kind, const void* message);

transport_stats buses_statistics(const buses* self);
/// Adds the counters of one bus.
void buses_add(transport_stats* sum, const transport* bus);
/// The errors of this bus so far if there are new ones since the last call, else 0.
uint64_t buses_new_errors(buses* self, uint32_t bus);

/// Whole days from utime to expiry; negative after it.
int64_t buses_days_left(int64_t expiry, int64_t utime);
/// True once a day, by the wall clock utime, while less than BUSES_EXPIRY_DAYS are left.
bool buses_expiring(buses* self, int64_t utime);

#endif
