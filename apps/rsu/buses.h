/// The buses of a configuration as one: states come from all of them, plans and statuses go out on
/// all, their counters are added up. A bus that is in trouble costs the others nothing.
///
/// Memory      As the transports (verge/transport.h).
/// Threads     One.
#ifndef VERGE_RSU_BUSES_H
#define VERGE_RSU_BUSES_H

#include "config.h"

#include <poll.h>

/// What the daemon does on its buses, for transport_open_with().
enum { BUSES_USE = TRANSPORT_STATES | TRANSPORT_SENDS_PLANS | TRANSPORT_SENDS_STATUSES };

/// Certificates and permissions that end within so many days are worth a warning.
enum { BUSES_EXPIRY_DAYS = 30 };

typedef struct buses {
    transport*      bus[CONFIG_BUSES_MAX];
    uint32_t        count;
    uint64_t        errors_told[CONFIG_BUSES_MAX]; ///< of each, in the log already
    transport_stats past; ///< of buses that were here before
    int64_t         expiry;      ///< [us] wall clock, first end of what admits us; 0: none
    int64_t         expiry_told; ///< [us] when buses_expiring() last said so; 0: never
    char            expiry_words[CONFIG_ERROR_SIZE];
} buses;

/// Opens all buses of a configuration, or none. What they complain of later goes to log, which may
/// be null. Returns a transport_result; unless TRANSPORT_OK, error holds one line.
int  buses_open(buses* self, const config* config, void (*log)(void* context, const char* line),
                char* error, size_t error_size);
void buses_close(buses* self); ///< all zero is fine

/// Takes the place of others, which are closed later: their counters go on counting here.
void buses_succeed(buses* self, const buses* others);

/// What to poll for, a descriptor a bus. Returns how many.
uint32_t buses_poll(const buses* self, struct pollfd ends[CONFIG_BUSES_MAX]);
/// A portion of the messages that wait on one bus; each says which bus it came from.
uint32_t buses_drain(buses* self, uint32_t bus, transport_message* messages, uint32_t max);

void buses_publish_plan(buses* self, const verge_vehicle_plan_t* plan);
void buses_publish_status(buses* self, const verge_rsu_status_t* status);

transport_stats buses_statistics(const buses* self);
/// Has this bus had errors since the last time this was asked? Their number so far, or 0.
uint64_t buses_trouble(buses* self, uint32_t bus);

/// [days] whole ones from utime to expiry; negative: it is over.
int64_t buses_days_left(int64_t expiry, int64_t utime);
/// Once a day, by the wall clock utime, while no more than BUSES_EXPIRY_DAYS are left: true.
bool buses_expiring(buses* self, int64_t utime);

#endif
