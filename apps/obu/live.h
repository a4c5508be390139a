/// The running on-vehicle unit: receives states and plans, makes a trajectory each cycle, sends it.
///
/// One thread does everything but writing the log, reloading, and writing the file of metrics. A
/// cycle takes a few milliseconds; while it runs, messages wait in the sockets. After the line
/// `event=READY` only a reload allocates, in its own thread.
#ifndef VERGE_OBU_LIVE_H
#define VERGE_OBU_LIVE_H

#include "config.h"

#include "daemon/start.h"

#include <stdint.h>

/// Runs until SIGTERM, SIGINT or the last of options->cycles. Returns the exit code of the process.
int obu_run(const start_options* options);

/// Makes the unit of a configuration, for setup_def.make and --check-config. Returns 0, EXIT_CONFIG
/// or EXIT_OS with a line in error.
int  obu_make(void** made, const site* site, char error[CONFIG_ERROR_SIZE]);
void obu_unmake(void* made); ///< null is fine

#endif
