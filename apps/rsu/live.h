/// The running daemon: receives states, plans each cycle, broadcasts plans and its status.
///
/// One loop waits for everything: buses, timers, signals, operators, and the threads that plan and
/// reload. No call in it blocks, so each is served after at most one short task. Planning runs in a
/// worker thread (worker.h), a reload in another (reload.h), and others write the log, the
/// recording and the file of metrics (outlet.h). After the line `event=READY` only a reload
/// allocates, in its own thread.
#ifndef VERGE_RSU_LIVE_H
#define VERGE_RSU_LIVE_H

#include "daemon/start.h"

#include <stdint.h>

typedef struct live_options {
    start_options start;
    const char*   record_path; ///< null: no recording
} live_options;

/// Runs until SIGTERM, SIGINT or the last cycle of the options. Returns the exit code of the
/// process.
int live_run(const live_options* options);

#endif
