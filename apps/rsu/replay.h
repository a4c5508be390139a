/// Runs the messages of a log through the daemon's own cycle, with the time of the log, as fast as
/// possible.
///
/// The marks in a log of `verge-rsu --record` give the instant of each cycle; its replay gives
/// exactly the digests of the live run. Any other LCM event log is planned at multiples of cycle_ms
/// of its own time, from the first at or after its first state to the first at or after its last. A
/// gap of more than REPLAY_GAP_US without vehicles is skipped.
#ifndef VERGE_RSU_REPLAY_H
#define VERGE_RSU_REPLAY_H

#include "config.h"

#include <stdint.h>
#include <stdio.h>

enum { REPLAY_GAP_US = 10000000 }; ///< [us]

typedef struct replay_options {
    const char* log_path;
    const char* record_path; ///< null: none; else the replay is recorded as well
    FILE*       out;         ///< one JSON line a cycle; null: none
    int64_t     cycles;      ///< stop after this many; 0: all
} replay_options;

typedef struct replay_report {
    uint64_t cycles;         ///< planned
    uint64_t compared;       ///< of them, cycles whose plans are in the log
    bool     differs;        ///< some cycle differs; the fields below describe the first one
    int64_t  differs_cycle;
    int64_t  differs_utime;  ///< [us]
    uint64_t recorded_digest, replayed_digest;
    bool     count_differs;  ///< the number of planned vehicles differs from the log
} replay_report;

/// Returns 0, EXIT_NO_INPUT, EXIT_CONFIG or EXIT_OS with a line in error. A difference is not an
/// error; it is in the report.
int replay_run(const replay_options* options, const config* config, replay_report* report,
               char error[CONFIG_ERROR_SIZE]);

#endif
