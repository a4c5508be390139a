/// The configuration file of verge-rsu: what every daemon has (daemon/site.h), and one key more.
///
///     { "format": "verge-rsu/1", "rsu_id": 1, "bus": "lcm:udpm://239.255.76.67:7667?ttl=0",
///       "road_file": "ramp-case1.json", "cycle_ms": 500, "planner": {}, "freshness": {} }
///
/// | key         | unit | range              | default  | meaning                               |
/// |-------------|------|--------------------|----------|---------------------------------------|
/// | `rsu_id`    | 1    | 0 .. 2^31 - 1      | 1        | sender of plans and status            |
/// | `cycle_ms`  | ms   | 10 .. 5000         | 500      | time between plans                    |
///
/// Memory      Heap, until config_free(): at start-up and when the configuration is read again.
#ifndef VERGE_RSU_CONFIG_H
#define VERGE_RSU_CONFIG_H

#include "cycle.h"

#include "daemon/planning.h"
#include "daemon/site.h"

enum {
    CONFIG_CYCLE_MS_MIN = 10,
    CONFIG_CYCLE_MS_MAX = 5000,
    CONFIG_CYCLE_MS_DEFAULT = 500,
};

/// What the unit receives and sends, for buses_open().
enum { CONFIG_BUS_USE = TRANSPORT_STATES | TRANSPORT_SIGNALS | TRANSPORT_SENDS_PLANS
                        | TRANSPORT_SENDS_STATUSES };

typedef struct config {
    int32_t rsu_id;
    site    site;
} config;

/// Reads and checks everything. Returns 0, EXIT_NO_INPUT, EXIT_CONFIG or EXIT_OS; unless 0,
/// *loaded is null and error holds one line `file:field: what is wrong, what was expected`.
int  config_load(config** loaded, const char* path, char error[CONFIG_ERROR_SIZE]);
void config_free(config* self); ///< null is fine

/// The configuration as JSON, with every planner parameter. It can be read again.
void config_print(const config* self, FILE* out);

/// What a cycle needs of a configuration and its planner.
cycle_def config_cycle_def(const config* self, const planning* built);

#endif
