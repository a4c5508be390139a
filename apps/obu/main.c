/// verge-obu: the on-vehicle unit. This file reads the options; live.c runs the daemon. Exit codes:
/// daemon/exit.h.
#include "live.h"

#include "common/floating.h"
#include "common/options.h"
#include "common/road_report.h"
#include "daemon/check.h"
#include "daemon/start.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>


static int  read_arguments(start_arguments* args, int argc, char** argv);
static bool ends_here(const start_arguments* args, int* status);

int main(int argc, char** argv)
{
    start_arguments args;
    memset(&args, 0, sizeof args);
    const bool floating_corrected = floating_correct(); // before the first number is read
    int status = read_arguments(&args, argc, argv);
    if (status != 0 || args.config_path == NULL || ends_here(&args, &status)) {
        return status;
    }
    const start_options options = start_options_from(&args, floating_corrected);
    return obu_run(&options);
}

/// Returns 0 or an exit code. 0 without a config path: help or version was printed.
static int read_arguments(start_arguments* args, int argc, char** argv)
{
    const option_entry table[] = {
        { "--config", "OBU.json", "the configuration; required", &args->config_path, NULL },
        { "--check-config", NULL, "checks it, prints the memory it needs, and ends", NULL,
          &args->check },
        { "--print-config", NULL, "prints it with every default, and ends", NULL, &args->print },
        { "--cycles", "N", "stops after N cycles", &args->cycles_text, NULL },
        { "--log-level", "LEVEL", "error, warning, info or debug", &args->level_text, NULL },
        { "--log-format", "FORMAT", "text or json, instead of log_format of the configuration",
          &args->format_text, NULL },
    };
    const program self = {
        .name = "verge-obu",
        .argument = NULL,
        .text = "The on-vehicle unit: follows the plan of the roadside unit while it is fresh and\n"
                "safe, and otherwise plans for its vehicle itself.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = EXIT_USAGE,
    };
    return start_read(args, &self, argc, argv);
}

/// Prints the memory of the unit, and the road.
static int print_unit(const start_arguments* args, const site* site)
{
    char  error[CONFIG_ERROR_SIZE];
    void* made = NULL;
    const int status = obu_make(&made, site, error);
    if (status != 0) {
        fprintf(stderr, "%s:%s\n", args->config_path, error);
        return status;
    }
    const unit_memory memory = unit_memory_of(made);
    printf("%12zu B  road\n%12zu B  decision, prediction, trajectory\n"
           "%12zu B  messages, vehicles, last trajectories\n"
           "%12zu B  on-vehicle unit, all together\n",
           memory.road, memory.stages, memory.rest, memory.road + memory.stages + memory.rest);
    printf("road of %u lanes, map_crc32 0x%08" PRIx32 "\n", site->planner.road.lane_count,
           site->map_crc32);
    road_report_print(unit_road(made), &site->planner.road, args->config_path, stdout, stderr);
    obu_unmake(made);
    return 0;
}

/// The two buses of the vehicle itself.
static int check_own(const start_arguments* args, const site* site)
{
    const obu_config* config = obu_config_of(site);
    char error[CONFIG_ERROR_SIZE];
    int  status = 0;
    if (config->state[0] != '\0') {
        status = check_bus(site, "state", config->state, TRANSPORT_STATES, args->config_path,
                           error);
    }
    if (status == 0 && config->trajectory[0] != '\0') {
        status = check_bus(site, "trajectory", config->trajectory, TRANSPORT_SENDS_TRAJECTORIES,
                           args->config_path, error);
    }
    if (status != 0) {
        fprintf(stderr, "%s:%s\n", args->config_path, error);
    }
    return status;
}

/// --check-config and --print-config. True: done, with *status.
static bool ends_here(const start_arguments* args, int* status)
{
    char error[CONFIG_ERROR_SIZE];
    site* site = NULL;
    *status = site_load(&site, &OBU_CONFIG_DEF, args->config_path, error);
    if (*status != 0) {
        fprintf(stderr, "%s%s", error, strchr(error, '\n') != NULL ? "" : "\n");
        return true;
    }
    if (args->print) {
        site_print(site, &OBU_CONFIG_DEF, stdout);
    }
    if (args->check) {
        *status = check_site(site, OBU_BUS_USE, args->config_path, true);
    }
    if (args->check && *status == 0) {
        *status = check_own(args, site);
    }
    if (args->check && *status == 0 && !args->print) {
        *status = print_unit(args, site);
    }
    site_free(site);
    const bool ends = args->check || args->print;
    if (ends && fflush(stdout) != 0 && *status == 0) {
        fprintf(stderr, "verge-obu:standard output: %s\n", strerror(errno));
        *status = EXIT_SOFTWARE;
    }
    return ends;
}
