/// How a daemon starts: its command line, the first lines that it may print, its log.
///
/// Memory      As the parts that are started.
/// Threads     The main one.
#ifndef VERGE_DAEMON_START_H
#define VERGE_DAEMON_START_H

#include "common/options.h"
#include "daemon/log.h"
#include "daemon/setup.h"

#include <stdint.h>

/// What the command line of each daemon says. The texts are set by options_parse().
typedef struct start_arguments {
    const char* config_path; ///< --config
    const char* cycles_text; ///< --cycles
    const char* level_text;  ///< --log-level
    const char* format_text; ///< --log-format
    log_format  format;
    bool        check;       ///< --check-config
    bool        print;       ///< --print-config
    uint64_t    cycles;      ///< stop after this many; 0: run until a signal
} start_arguments;

/// Reads the command line with the table of `self`, and the texts that all daemons have; sets the
/// level of the log. Returns 0 or an exit code; 0 without a config path: help or version was
/// printed.
int start_read(start_arguments* args, const program* self, int argc, char** argv);

/// How a daemon runs.
typedef struct start_options {
    const char* config_path;
    const log_format* log_format;   ///< null: the configuration's
    bool        floating_corrected; ///< at the start of the process; it is logged
    int64_t     cycles;             ///< stop after this many; 0: run until a signal
} start_options;

start_options start_options_from(const start_arguments* args, bool floating_corrected);

/// Prints one line of the daemon `name`, not in the format of the log, and returns the code.
int  start_fail(const char* name, int code, const char* line);

/// Sets the format of the log: that of the command line, or else of the configuration.
void start_log_format(const start_options* options, const site* site);
/// Reads the configuration and starts the log. Returns 0, or an exit code after a line of
/// start_fail().
int  start_load(setup* now, const setup_def* def, const start_options* options, const char* name);

/// Logs a complaint of a bus: a refused sender with the reason, an error of its middleware. For
/// setup_def.log; context is not used.
void start_complaint(void* context, const char* line);

#endif
