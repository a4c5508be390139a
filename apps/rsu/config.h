/// The daemon's configuration file. It is checked as a whole before any of it is used.
///
///     { "format": "verge-rsu/1", "rsu_id": 1, "bus": "lcm:udpm://239.255.76.67:7667?ttl=0",
///       "road_file": "ramp-case1.json", "cycle_ms": 500, "planner": {}, "freshness": {} }
///
/// | key         | unit | range              | default  | meaning                               |
/// |-------------|------|--------------------|----------|---------------------------------------|
/// | `format`    |      | `verge-rsu/1`      | required | what this file is                     |
/// | `rsu_id`    | 1    | 0 .. 2^31 - 1      | 1        | sender of plans and status            |
/// | `bus`       |      | bus URLs           | required | where states come from and plans go:  |
/// |             |      |                    |          | one, or a list of up to four          |
/// | `dds`, `lcm`|     | see bus_json.h     | `{}`     | options of buses beyond their URLs    |
/// | `road`      |      | a road             |          | the lanes, as in a scenario           |
/// | `road_file` |      | path               |          | the same from a file: a road, or a    |
/// |             |      |                    |          | scenario whose `road` is taken;       |
/// |             |      |                    |          | relative to this file                 |
/// | `cycle_ms`  | ms   | 10 .. 5000         | 500      | time between plans                    |
/// | `planner`   |      | see planner.h      | defaults | any planner parameter by its name     |
/// | `freshness` |      | see inbox.h        | defaults | limits on the age of states           |
/// | `control`   |      | path or null       | null     | the socket for verge-ctl              |
/// | `metrics.`  |      | loopback address:  | null     | figures for Prometheus by HTTP, GET   |
/// | `listen`    |      | port, or null      |          | /metrics                              |
/// | `metrics.`  |      | path or null       | null     | the same as a file, replaced each     |
/// | `file`      |      |                    |          | second                                |
/// | `realtime.` |      | 0 .. 99            | 0        | SCHED_FIFO priority of the planning   |
/// | `priority`  |      |                    |          | thread and its helpers; 0: none       |
/// | `realtime.` |      | true, false        | false    | nothing of the process is ever paged  |
/// | `lock_memory`|     |                    |          | out, or in after READY                |
/// | `realtime.` |      | list of 0 .. 1023  | all      | processors the planning thread and    |
/// | `cpus`      |      |                    |          | its helpers may run on                |
/// | `log_format`|      | `text`, `json`     | `text`   | format of the log's lines, see log.h; |
/// |             |      |                    |          | `--log-format` overrides it           |
///
/// One of `road` and `road_file` is required. Unknown keys are errors. `control`, `metrics` and
/// `realtime` are fixed at the start, and so is the planner's memory: a reload that changes one of
/// them is refused and says so.
/// Memory      Heap, until config_free(): at start-up and when the configuration is read again.
#ifndef VERGE_RSU_CONFIG_H
#define VERGE_RSU_CONFIG_H

#include "cycle.h"

#include "common/bus_json.h"
#include "daemon/exit.h"
#include "daemon/service.h"
#include "verge/verge.h"

#include <stdio.h>

enum {
    CONFIG_CYCLE_MS_MIN = 10,
    CONFIG_CYCLE_MS_MAX = 5000,
    CONFIG_CYCLE_MS_DEFAULT = 500,
    CONFIG_BUS_SIZE = 256,
    CONFIG_BUSES_MAX = INBOX_BUSES_MAX,
};

typedef struct config {
    int32_t  rsu_id;
    char     bus[CONFIG_BUSES_MAX][CONFIG_BUS_SIZE];
    uint32_t bus_count;
    bus_options bus_options;
    uint32_t cycle_ms;
    verge_planner_def planner;  ///< road included; the road's memory belongs to the config
    inbox_limits freshness;
    service  service;
    uint32_t map_crc32;         ///< of the road, see wire_map_crc32()
    uint32_t config_crc32;      ///< of what config_print() prints
    char*    road_file;         ///< the path as resolved; null: the road was written inline
    char*    road_text;         ///< the road as JSON on one line
} config;

/// Reads and checks everything. Returns 0, EXIT_NO_INPUT, EXIT_CONFIG or EXIT_OS; unless 0,
/// *loaded is null and error holds one line `file:field: what is wrong, what was expected`.
int  config_load(config** loaded, const char* path, char error[CONFIG_ERROR_SIZE]);
void config_free(config* self); ///< null is fine

/// The configuration as JSON, with every planner parameter. It can be read again.
void config_print(const config* self, FILE* out);

/// The URLs with commas between them, cut to size, which is at least 1.
void config_bus_list(const config* self, char* text, size_t size);
/// Do both name the same buses and the same options for them?
bool config_same_buses(const config* self, const config* other);

/// A planner built from the configuration, and the memory it lives in.
typedef struct config_planner {
    verge_planner* planner;
    void*          memory;
    size_t         size;
} config_planner;

/// Prints the memory a planner needs, term by term.
void config_print_memory(const config* self, FILE* out);

/// Returns 0, EXIT_CONFIG or EXIT_OS with a line in error. executor may be null.
int  config_planner_build(config_planner* built, const config* self, verge_executor* executor,
                          void* executor_context, char error[CONFIG_ERROR_SIZE]);
void config_planner_free(config_planner* built);

/// Can the next configuration take effect without a restart? The planner's memory is fixed at the
/// start, and so are the members that service_changed() names. False: one line in error, with the
/// remedy.
bool config_may_follow(const config* self, const config* next, char error[CONFIG_ERROR_SIZE]);

/// What a cycle needs of a configuration and its planner.
cycle_def config_cycle_def(const config* self, const config_planner* built);

#endif
