/// The daemon at work: listens to the bus, plans each cycle, broadcasts plans and its status.
///
/// One loop waits on everything (buses, timers, signals, operators, and the threads that plan and
/// reload); no call in it blocks, so each is answered within the length of one short task. Planning
/// runs in a worker thread (worker.h), a reload in another (reload.h), and two more write the log and
/// the recording (outlet.h). After the line `event=READY` only a reload allocates, in its thread.
#ifndef VERGE_RSU_LIVE_H
#define VERGE_RSU_LIVE_H

#include "log.h"

#include <stdint.h>

typedef struct live_options {
    const char* config_path;
    const char* record_path; ///< null: no recording
    const log_format* log_format; ///< null: the configuration's
    bool        floating_corrected; ///< at the start of the process: worth a line in the log
    int64_t     cycles;      ///< stop after so many; 0: run until told to stop
} live_options;

/// Runs until SIGTERM, SIGINT or the last of options->cycles. Returns the process's exit code.
int live_run(const live_options* options);

#endif
