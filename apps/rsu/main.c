/// verge-rsu: the roadside daemon. This file reads the options; live.c runs the daemon, replay.c a
/// replay. Exit codes: daemon/exit.h.
#include "buses.h"
#include "config.h"
#include "live.h"
#include "replay.h"

#include "common/floating.h"
#include "common/options.h"
#include "common/road_report.h"
#include "daemon/log.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>
#include <time.h>

typedef struct arguments {
    const char* config_path;
    const char* record_path;
    const char* replay_path;
    const char* cycles_text;
    const char* level_text;
    const char* format_text;
    log_format  format;
    bool        check;
    bool        print;
    uint64_t    cycles;
} arguments;

static int  read_arguments(arguments* args, int argc, char** argv);
static bool ends_here(const arguments* args, int* status);
static int  check(const arguments* args, const config* config);
static int  run_replay(const arguments* args, const config* config, const char* log_path);

int main(int argc, char** argv)
{
    arguments args;
    memset(&args, 0, sizeof args);
    const bool floating_corrected = floating_correct(); // before the first number is read
    int status = read_arguments(&args, argc, argv);
    if (status != 0 || args.config_path == NULL) {
        return status;
    }
    if (ends_here(&args, &status)) {
        return status;
    }
    const live_options options = {
        .config_path = args.config_path,
        .record_path = args.record_path,
        .log_format = args.format_text != NULL ? &args.format : NULL,
        .floating_corrected = floating_corrected,
        .cycles = (int64_t)args.cycles,
    };
    return live_run(&options);
}

static int usage_error(const char* option, const char* text)
{
    fprintf(stderr, "verge-rsu:%s: %s\n", option, text);
    return EXIT_USAGE;
}

/// Returns 0 or an exit code. 0 without a config path: help or version was printed.
static int read_arguments(arguments* args, int argc, char** argv)
{
    const option_entry table[] = {
        { "--config", "RSU.json", "the configuration; required", &args->config_path, NULL },
        { "--check-config", NULL, "checks it, prints the memory it needs, and ends", NULL,
          &args->check },
        { "--print-config", NULL, "prints it with every default, and ends", NULL, &args->print },
        { "--cycles", "N", "stops after N planning cycles", &args->cycles_text, NULL },
        { "--record", "LOG", "records states, cycles and plans", &args->record_path, NULL },
        { "--replay", "LOG", "plans the states of a log, prints one line per cycle",
          &args->replay_path, NULL },
        { "--log-level", "LEVEL", "error, warning, info or debug", &args->level_text, NULL },
        { "--log-format", "FORMAT", "text or json, instead of log_format of the configuration",
          &args->format_text, NULL },
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
    int status = 0;
    if (!options_parse(&self, argc, argv, NULL, &status)) {
        args->config_path = NULL;
        return status;
    }
    if (args->config_path == NULL) {
        return usage_error("--config", "missing, see --help");
    }
    bool given = false;
    if (!options_u64(&self, "--cycles", args->cycles_text, &args->cycles, &given)) {
        return EXIT_USAGE;
    }
    if (given && (args->cycles == 0 || args->cycles > INT32_MAX)) {
        return usage_error("--cycles", "is out of range, expected 1 to 2147483647");
    }
    log_level level = LOG_INFO;
    if (args->level_text != NULL && !log_level_from(args->level_text, &level)) {
        return usage_error("--log-level", "is unknown, expected error, warning, info or debug");
    }
    if (args->format_text != NULL && !log_format_from(args->format_text, &args->format)) {
        return usage_error("--log-format", "is unknown, expected text or json");
    }
    log_level_set(level);
    return 0;
}

/// Does everything except running the daemon: --check-config, --print-config, --replay, and a log:
/// as bus. True: done, with *status.
static bool ends_here(const arguments* args, int* status)
{
    char error[CONFIG_ERROR_SIZE];
    config* config = NULL;
    *status = config_load(&config, args->config_path, error);
    if (*status != 0) {
        fprintf(stderr, "%s%s", error, strchr(error, '\n') != NULL ? "" : "\n");
        return true;
    }
    static const char scheme[] = "log:";
    const bool from_log = strncmp(config->bus[0], scheme, sizeof scheme - 1) == 0;
    const char* log_path = args->replay_path != NULL ? args->replay_path
                           : from_log                ? config->bus[0] + sizeof scheme - 1
                                                     : NULL;
    const bool ends = args->check || args->print || log_path != NULL;
    if (args->print) {
        config_print(config, stdout);
    }
    if (args->check) {
        *status = check(args, config);
    } else if (!args->print && log_path != NULL) {
        *status = run_replay(args, config, log_path);
    }
    config_free(config);
    if (ends && fflush(stdout) != 0 && *status == 0) {
        fprintf(stderr, "verge-rsu:standard output: %s\n", strerror(errno));
        *status = EXIT_SOFTWARE;
    }
    return ends;
}

/// Checks one bus by itself, so that a missing bus does not hide the errors of another one.
static int check_bus(const arguments* args, const config* config, const char* url,
                     char error[CONFIG_ERROR_SIZE])
{
    const transport_options* options = &config->bus_options.transport;
    transport* bus = NULL;
    const int result = transport_open_with(&bus, url, BUSES_USE, options, error, CONFIG_ERROR_SIZE);
    transport_close(bus);
    if (result == TRANSPORT_BAD_URL) {
        return EXIT_CONFIG;
    }
    if (result != TRANSPORT_OK) {
        fprintf(stderr, "%s:bus: warning: not available now: %s\n", args->config_path, error);
    }
    if (transport_exposed(url, options, error, CONFIG_ERROR_SIZE)) {
        fprintf(stderr, "%s:bus: warning: %s\n", args->config_path, error);
    }
    int64_t       expiry = 0;
    const int64_t utime = (int64_t)time(NULL) * 1000000;
    if (transport_expires(url, options, &expiry, error, CONFIG_ERROR_SIZE) &&
        buses_days_left(expiry, utime) < BUSES_EXPIRY_DAYS) {
        fprintf(stderr, "%s:bus: warning: %s\n", args->config_path, error);
    }
    return 0;
}

/// Vehicles have the same ids on all buses. A stranger on an open bus can therefore send states for
/// a vehicle of a secured bus, while the states of that vehicle itself are missing.
static void check_beside(const arguments* args, const config* config)
{
    const transport_options* options = &config->bus_options.transport;
    const char* open = NULL;
    const char* secured = NULL;
    for (uint32_t i = 0; i < config->bus_count; i++) {
        char words[CONFIG_ERROR_SIZE];
        if (transport_exposed(config->bus[i], options, words, sizeof words)) {
            open = config->bus[i];
        } else if (transport_secured(config->bus[i], options)) {
            secured = config->bus[i];
        }
    }
    if (open != NULL && secured != NULL) {
        fprintf(stderr, "%s:bus: warning: strangers can reach %s, and can send states there for a "
                "vehicle of %s, which is secured; secure both buses or remove the first\n",
                args->config_path, open, secured);
    }
}

/// Builds the planner and opens the buses, because some errors only show then. A bus that is not
/// available now is not an error of the configuration, but causes a warning.
static int check(const arguments* args, const config* config)
{
    char error[CONFIG_ERROR_SIZE];
    config_planner built;
    int status = config_planner_build(&built, config, NULL, NULL, error);
    for (uint32_t i = 0; status == 0 && i < config->bus_count; i++) {
        status = check_bus(args, config, config->bus[i], error);
    }
    if (status == 0) {
        check_beside(args, config);
    }
    if (status != 0) {
        fprintf(stderr, "%s:%s\n", args->config_path, error);
    } else if (!args->print) {
        config_print_memory(config, stdout);
        printf("road of %u lanes, map_crc32 0x%08" PRIx32 "\n", config->planner.road.lane_count,
               config->map_crc32);
        road_report_print(verge_planner_road(built.planner), &config->planner.road,
                          args->config_path, stdout, stderr);
    }
    config_planner_free(&built);
    return status;
}

static int run_replay(const arguments* args, const config* config, const char* log_path)
{
    char error[CONFIG_ERROR_SIZE];
    replay_report report;
    const replay_options options = {
        .log_path = log_path,
        .record_path = args->record_path,
        .out = stdout,
        .cycles = (int64_t)args->cycles,
    };
    const int status = replay_run(&options, config, &report, error);
    if (status != 0) {
        fprintf(stderr, "verge-rsu: %s\n", error);
    }
    return status;
}
