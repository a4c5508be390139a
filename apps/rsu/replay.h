/// Runs what a log holds through the daemon's own cycle, with the log's clock, as fast as it goes.
///
/// A log by `verge-rsu --record` tells by its marks when each cycle was planned and gives exactly
/// the digests of the live run. Any other LCM event log is planned at the multiples of cycle_ms
/// of its own time, from the first at or after its first state to the first at or after its last;
/// a gap of more than REPLAY_GAP_US without vehicles is left out.
#ifndef VERGE_RSU_REPLAY_H
#define VERGE_RSU_REPLAY_H

#include "config.h"

#include <stdint.h>
#include <stdio.h>

enum { REPLAY_GAP_US = 10000000 }; ///< [us]

typedef struct replay_options {
    const char* log_path;
    const char* record_path; ///< null: none; else the replay is recorded like a live run
    FILE*       out;         ///< one JSON line a cycle; null: none
    int64_t     cycles;      ///< stop after so many; 0: all
} replay_options;

typedef struct replay_report {
    uint64_t cycles;         ///< planned
    uint64_t compared;       ///< of them, beside plans the log holds
    bool     differs;        ///< the fields below tell the first cycle that does
    int64_t  differs_cycle;
    int64_t  differs_utime;  ///< [us]
    uint64_t recorded_digest, replayed_digest;
    bool     count_differs;  ///< other vehicles were planned than the log says
} replay_report;

/// Returns 0, EXIT_NO_INPUT, EXIT_CONFIG or EXIT_OS with a line in error. A difference is no
/// error: see the report.
int replay_run(const replay_options* options, const config* config, replay_report* report,
               char error[CONFIG_ERROR_SIZE]);

#endif
