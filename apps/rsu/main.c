/// verge-rsu: the roadside daemon. This file reads the options; live.c runs the daemon, replay.c a
/// replay. Exit codes: daemon/exit.h.
#include "config.h"
#include "live.h"
#include "replay.h"

#include "common/floating.h"
#include "common/options.h"
#include "daemon/check.h"
#include "daemon/start.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>

typedef struct arguments {
    start_arguments start;
    const char*     record_path;
    const char*     replay_path;
} arguments;

static int  read_arguments(arguments* args, int argc, char** argv);
static bool ends_here(const arguments* args, int* status);
static int  run_replay(const arguments* args, const config* config, const char* log_path);

int main(int argc, char** argv)
{
    arguments args;
    memset(&args, 0, sizeof args);
    const bool floating_corrected = floating_correct(); // before the first number is read
    int status = read_arguments(&args, argc, argv);
    if (status != 0 || args.start.config_path == NULL) {
        return status;
    }
    if (ends_here(&args, &status)) {
        return status;
    }
    const live_options options = {
        .start = start_options_from(&args.start, floating_corrected),
        .record_path = args.record_path,
    };
    return live_run(&options);
}

/// Returns 0 or an exit code. 0 without a config path: help or version was printed.
static int read_arguments(arguments* args, int argc, char** argv)
{
    const option_entry table[] = {
        { "--config", "RSU.json", "the configuration; required", &args->start.config_path, NULL },
        { "--check-config", NULL, "checks it, prints the memory it needs, and ends", NULL,
          &args->start.check },
        { "--print-config", NULL, "prints it with every default, and ends", NULL,
          &args->start.print },
        { "--cycles", "N", "stops after N planning cycles", &args->start.cycles_text, NULL },
        { "--record", "LOG", "records states, cycles and plans", &args->record_path, NULL },
        { "--replay", "LOG", "plans the states of a log, prints one line per cycle",
          &args->replay_path, NULL },
        { "--log-level", "LEVEL", "error, warning, info or debug", &args->start.level_text, NULL },
        { "--log-format", "FORMAT", "text or json, instead of log_format of the configuration",
          &args->start.format_text, NULL },
    };
    const program self = {
        .name = "verge-rsu",
        .argument = NULL,
        .text = "The roadside daemon: receives vehicle states, plans jointly in each cycle, and\n"
                "sends a plan to each controlled vehicle.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = EXIT_USAGE,
    };
    return start_read(&args->start, &self, argc, argv);
}

/// Does everything except running the daemon: --check-config, --print-config, --replay, and a log:
/// as bus. True: done, with *status.
static bool ends_here(const arguments* args, int* status)
{
    char error[CONFIG_ERROR_SIZE];
    site* site = NULL;
    *status = site_load(&site, &CONFIG_DEF, args->start.config_path, error);
    if (*status != 0) {
        fprintf(stderr, "%s%s", error, strchr(error, '\n') != NULL ? "" : "\n");
        return true;
    }
    static const char scheme[] = "log:";
    const bool from_log = strncmp(site->bus[0], scheme, sizeof scheme - 1) == 0;
    const char* log_path = args->replay_path != NULL ? args->replay_path
                           : from_log                ? site->bus[0] + sizeof scheme - 1
                                                     : NULL;
    const bool ends = args->start.check || args->start.print || log_path != NULL;
    if (args->start.print) {
        site_print(site, &CONFIG_DEF, stdout);
    }
    if (args->start.check) {
        *status = check_site(site, CONFIG_BUS_USE, args->start.config_path, args->start.print);
    } else if (!args->start.print && log_path != NULL) {
        *status = run_replay(args, config_of(site), log_path);
    }
    site_free(site);
    if (ends && fflush(stdout) != 0 && *status == 0) {
        fprintf(stderr, "verge-rsu:standard output: %s\n", strerror(errno));
        *status = EXIT_SOFTWARE;
    }
    return ends;
}

static int run_replay(const arguments* args, const config* config, const char* log_path)
{
    char error[CONFIG_ERROR_SIZE];
    replay_report report;
    const replay_options options = {
        .log_path = log_path,
        .record_path = args->record_path,
        .out = stdout,
        .cycles = (int64_t)args->start.cycles,
    };
    const int status = replay_run(&options, config, &report, error);
    if (status != 0) {
        fprintf(stderr, "verge-rsu: %s\n", error);
    }
    return status;
}
