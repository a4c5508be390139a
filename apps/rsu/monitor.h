/// What the daemon reports about itself: status messages on its buses, lines in its log, one line
/// for the service manager. A change of state is reported at once, everything else once a second.
///
/// Memory      The caller's; nothing is allocated.
/// Threads     One.
#ifndef VERGE_RSU_MONITOR_H
#define VERGE_RSU_MONITOR_H

#include "cycle.h"
#include "status.h"

#include "daemon/events.h"
#include "daemon/notify.h"
#include "daemon/setup.h"

typedef struct monitor {
    setup*       setup;  ///< in effect; its buses take the messages
    const cycle* cycle;
    status*      status;
    notify*      notify;
    rsu_state    state;         ///< of the last status message
    uint32_t     faults;        ///< active at that time, bits 1 << rsu_fault
    uint64_t     refusals;      ///< refused states already in the log
    uint64_t     lacking;       ///< incomplete states already in the log
    uint64_t     standstills;   ///< reordered and unstuck, already in the log
    uint64_t     over_capacity; ///< refused for want of room, already in the log
    uint64_t     version;       ///< of an unknown protocol_version, already in the log
    uint64_t     other_map;     ///< messages made with another road, already in the log
    uint64_t     record_dropped;      ///< a second ago
    uint64_t     record_dropped_logged; ///< in the log
} monitor;

/// The status message of this moment.
verge_rsu_status_t monitor_message(const monitor* self, instant at);
/// Sends it.
void monitor_publish(monitor* self, instant at);
/// Sends it if the state or the active faults have changed since the last one.
void monitor_update(monitor* self, instant at);
/// Once a second: logs errors of buses, losses, refused states, standstills and certificates that
/// end soon, and sends the status.
void monitor_each_second(monitor* self, instant at);
/// Logs all counters on one line.
void monitor_log_statistics(const monitor* self, instant at);

#endif
