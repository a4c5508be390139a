/// What the daemon tells of itself: status messages on its buses, lines in its log, one line for
/// the service manager. A change of state is told at once, all else once a second, however much
/// there is of it.
///
/// Memory      The caller's; nothing is allocated.
/// Threads     One.
#ifndef VERGE_RSU_TELL_H
#define VERGE_RSU_TELL_H

#include "cycle.h"
#include "notify.h"
#include "reload.h"
#include "status.h"

/// One moment by both clocks.
typedef struct instant {
    int64_t now;   ///< [us] CLOCK_MONOTONIC
    int64_t utime; ///< [us] CLOCK_REALTIME
} instant;

typedef struct teller {
    setup*       setup;  ///< what is told of, and where
    const cycle* cycle;
    status*      status;
    notify*      notify;
    rsu_state    state;         ///< in the last status message
    uint32_t     faults;        ///< active then, bits 1 << rsu_fault
    uint64_t     refusals;      ///< refused states already in the log
    uint64_t     over_capacity; ///< the same of these alone
    uint64_t     record_dropped;      ///< a second ago
    uint64_t     record_dropped_told; ///< in the log
} teller;

/// The status message of this moment.
verge_rsu_status_t tell_message(const teller* self, instant at);
/// Sends it.
void tell_status(teller* self, instant at);
/// Sends it if its state or the active faults are not what they were last time.
void tell_changes(teller* self, instant at);
/// Once a second: trouble with buses, refused states, ends of certificates, the status.
void tell_periodically(teller* self, instant at);
/// What has been counted so far, on one line of the log.
void tell_statistics(const teller* self, instant at);

#endif
