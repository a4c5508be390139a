/// The running daemon: receives states, plans each cycle, broadcasts plans and its status.
///
/// One loop waits for everything: buses, timers, signals, operators, and the threads that plan and
/// reload. No call in it blocks, so each is served after at most one short task. Planning runs in a
/// worker thread (worker.h), a reload in another (reload.h), and others write the log, the
/// recording and the file of metrics (outlet.h). After the line `event=READY` only a reload
/// allocates, in its own thread.
#ifndef VERGE_RSU_LIVE_H
#define VERGE_RSU_LIVE_H

#include "daemon/log.h"

#include <stdint.h>

typedef struct live_options {
    const char* config_path;
    const char* record_path; ///< null: no recording
    const log_format* log_format; ///< null: the configuration's
    bool        floating_corrected; ///< at the start of the process; it is logged
    int64_t     cycles;      ///< stop after this many; 0: run until a signal
} live_options;

/// Runs until SIGTERM, SIGINT or the last of options->cycles. Returns the exit code of the process.
int live_run(const live_options* options);

#endif
