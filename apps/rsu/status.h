/// The state of the daemon in one place, and the status message made from it.
#ifndef VERGE_RSU_STATUS_H
#define VERGE_RSU_STATUS_H

#include "config.h"
#include "cycle.h"
#include "timing.h"

/// Values are those of the wire.
typedef enum rsu_state {
    RSU_STARTING = 0,
    RSU_WAITING = 1,  ///< no usable vehicle state
    RSU_RUNNING = 2,
    RSU_DEGRADED = 3, ///< working, with an active fault
    RSU_STOPPING = 4,
} rsu_state;

/// What is wrong just now. The larger number is the worse fault.
typedef enum rsu_fault {
    RSU_FAULT_NONE = 0,
    RSU_FAULT_CONFIG = 1,    ///< the last configuration read again was refused; the old one holds
    RSU_FAULT_RECORD = 2,    ///< the recording has ended, or lost events lately
    RSU_FAULT_CAPACITY = 3,  ///< vehicles were left out lately: more than the capacities
    RSU_FAULT_DEADLINE = 4,  ///< a cycle took longer than cycle_ms lately
    RSU_FAULT_BUS = 5,       ///< sending or receiving failed lately
    RSU_FAULT_ID_CONFLICT = 6, ///< two senders claimed one vehicle lately; the first one was heard
    RSU_FAULT_PLANNER = 7,   ///< the planner refused a cycle lately: a defect of ours
} rsu_fault;
enum { RSU_FAULT_COUNT = 8 };

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
    uint64_t log_dropped;     ///< lines of the log that nobody took
    uint64_t record_dropped;  ///< events missing in the recording
    timing   cycle_time;
    bool     stopping;
    bool     heard;           ///< the last cycle saw a vehicle
    bool     fault_given[RSU_FAULT_COUNT];
    int64_t  fault_until[RSU_FAULT_COUNT]; ///< [us] INT64_MAX: for good
} status;

/// A fault occurred at now [us] of a clock that never steps back. lasting: it stays until
/// status_fault_clear(), whatever follows.
void status_fault(status* self, rsu_fault fault, int64_t now, bool lasting);
void status_fault_clear(status* self, rsu_fault fault);
/// All active faults: bits 1 << fault.
uint32_t  status_faults(const status* self, int64_t now);
/// The worst of them, the one that the status message has room for.
rsu_fault status_worst(const status* self, int64_t now);
rsu_state status_state(const status* self, int64_t now);

/// The status message; crc32 is left to the transport. utime: wall clock; now: as above.
verge_rsu_status_t status_message(const status* self, const config* config, const cycle* cycle,
                                  const transport_stats* bus, int64_t utime, int64_t now);

#endif
