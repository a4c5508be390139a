/// The state and the active faults of the daemon, and the status message made from them.
#ifndef VERGE_RSU_STATUS_H
#define VERGE_RSU_STATUS_H

#include "config.h"
#include "cycle.h"

#include "daemon/timing.h"

/// Values are those of the wire.
typedef enum rsu_state {
    RSU_STARTING = 0,
    RSU_WAITING = 1,  ///< no usable vehicle state
    RSU_RUNNING = 2,
    RSU_DEGRADED = 3, ///< working, with an active fault
    RSU_STOPPING = 4,
} rsu_state;

/// Faults. The larger number is the worse one.
typedef enum rsu_fault {
    RSU_FAULT_NONE = 0,
    RSU_FAULT_CONFIG = 1,    ///< the last reload was refused; the old configuration is in effect
    RSU_FAULT_RECORD = 2,    ///< the recording has ended, or lost events lately
    RSU_FAULT_CAPACITY = 3,  ///< there were more vehicles than the capacities; some were ignored
    RSU_FAULT_DEADLINE = 4,  ///< a cycle took longer than cycle_ms
    RSU_FAULT_BUS = 5,       ///< sending or receiving failed
    RSU_FAULT_ID_CONFLICT = 6, ///< two senders used one vehicle id; the second one was refused
    RSU_FAULT_PLANNER = 7,   ///< the planner refused a cycle, which is a defect of verge
    RSU_FAULT_OTHER_RSU = 8, ///< another unit has this rsu_id, or plans the same vehicles
} rsu_fault;
enum { RSU_FAULT_COUNT = 9 };

enum { RSU_FAULTS_SIZE = 128 }; ///< [B] the names of all faults

/// "none", "config", ...
const char* rsu_fault_name(rsu_fault fault);
/// The names of several (bits 1 << fault), the worst first: "deadline,record"; "none" without any.
void rsu_fault_names(uint32_t faults, char names[RSU_FAULTS_SIZE]);
const char* rsu_state_name(rsu_state state);

/// A fault stays active this long after its last occurrence. [us]
enum { STATUS_FAULT_HOLD_US = 5000000 };

typedef struct status {
    int64_t  start_utime;     ///< [us]
    uint64_t deadline_misses;
    uint64_t log_dropped;     ///< lines missing in the log
    uint64_t record_dropped;  ///< events missing in the recording
    timing   cycle_time;
    bool     stopping;
    bool     has_vehicles;    ///< the last cycle had at least one
    bool     fault_given[RSU_FAULT_COUNT];
    int64_t  fault_until[RSU_FAULT_COUNT]; ///< [us] INT64_MAX: for good
} status;

/// A fault occurred at now [us] of a clock that never steps back. lasting: it stays active until
/// status_fault_clear().
void status_fault(status* self, rsu_fault fault, int64_t now, bool lasting);
void status_fault_clear(status* self, rsu_fault fault);
/// All active faults: bits 1 << fault.
uint32_t  status_faults(const status* self, int64_t now);
/// The worst active fault, which is the one in the status message.
rsu_fault status_worst(const status* self, int64_t now);
rsu_state status_state(const status* self, int64_t now);

/// The status message. The transport fills in crc32. utime: wall clock; now: as above.
verge_rsu_status_t status_message(const status* self, const config* config, const cycle* cycle,
                                  const transport_stats* bus, int64_t utime, int64_t now);

#endif
