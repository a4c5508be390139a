#include "check.h"

#include "common/road_report.h"
#include "daemon/buses.h"
#include "daemon/planning.h"

#include <inttypes.h>
#include <string.h>
#include <time.h>

int check_bus(const site* site, const char* key, const char* url, unsigned use,
              const char* config_path, char error[CONFIG_ERROR_SIZE])
{
    const transport_options* options = &site->bus_options.transport;
    transport* bus = NULL;
    const int result = transport_open_with(&bus, url, use, options, error, CONFIG_ERROR_SIZE);
    transport_close(bus);
    if (result == TRANSPORT_BAD_URL) {
        return EXIT_CONFIG;
    }
    if (result != TRANSPORT_OK) {
        fprintf(stderr, "%s:%s: warning: not available now: %s\n", config_path, key, error);
    }
    if (transport_exposed(url, options, error, CONFIG_ERROR_SIZE)) {
        fprintf(stderr, "%s:%s: warning: %s\n", config_path, key, error);
    }
    int64_t       expiry = 0;
    const int64_t utime = (int64_t)time(NULL) * 1000000;
    if (transport_expires(url, options, &expiry, error, CONFIG_ERROR_SIZE) &&
        buses_days_left(expiry, utime) < BUSES_EXPIRY_DAYS) {
        fprintf(stderr, "%s:%s: warning: %s\n", config_path, key, error);
    }
    return 0;
}

/// Vehicles have the same ids on all buses. A stranger on an open bus can therefore send states for
/// a vehicle of a secured bus, while the states of that vehicle itself are missing.
static void check_beside(const site* site, const char* config_path)
{
    const transport_options* options = &site->bus_options.transport;
    const char* open = NULL;
    const char* secured = NULL;
    for (uint32_t i = 0; i < site->bus_count; i++) {
        char words[CONFIG_ERROR_SIZE];
        if (transport_exposed(site->bus[i], options, words, sizeof words)) {
            open = site->bus[i];
        } else if (transport_secured(site->bus[i], options)) {
            secured = site->bus[i];
        }
    }
    if (open != NULL && secured != NULL) {
        fprintf(stderr, "%s:bus: warning: strangers can reach %s, and can send states there for a "
                "vehicle of %s, which is secured; secure both buses or remove the first\n",
                config_path, open, secured);
    }
}

static void print_road(const site* site, const planning* built, const char* config_path)
{
    const verge_road_def* road = &site->planner.road;
    printf("road of %u lanes, map_crc32 0x%08" PRIx32 "\n", road->lane_count, site->map_crc32);
    road_report_print(verge_planner_road(built->planner), road, config_path, stdout, stderr);
}

int check_site(const site* site, unsigned use, const char* config_path, bool quiet)
{
    char     error[CONFIG_ERROR_SIZE];
    planning built;
    int status = planning_open(&built, &site->planner, NULL, error);
    // Each by itself, so that a missing bus does not hide the errors of another one.
    for (uint32_t i = 0; status == 0 && i < site->bus_count; i++) {
        status = check_bus(site, "bus", site->bus[i], use, config_path, error);
    }
    if (status == 0) {
        check_beside(site, config_path);
    }
    if (status != 0) {
        fprintf(stderr, "%s:%s\n", config_path, error);
    } else if (!quiet) {
        planning_print_memory(&site->planner, stdout);
        print_road(site, &built, config_path);
    }
    planning_close(&built);
    return status;
}
