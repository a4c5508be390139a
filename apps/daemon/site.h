/// What the configurations of all daemons have in common: where they are, on which buses, on which
/// road, how they plan, and what they serve to operators. It is checked as a whole before any of it
/// is used.
///
/// | key         | unit | range              | default  | meaning                               |
/// |-------------|------|--------------------|----------|---------------------------------------|
/// | `format`    |      | the daemon's word  | required | what this file is                     |
/// | `bus`       |      | bus URLs           | required | where messages come from and go to:   |
/// |             |      |                    |          | one, or a list of up to four          |
/// | `dds`, `lcm`|     | see bus_json.h     | `{}`     | options of buses beyond their URLs    |
/// | `road`      |      | a road             |          | the lanes, as in a scenario           |
/// | `road_file` |      | path               |          | the same from a file: a road, or a    |
/// |             |      |                    |          | scenario whose `road` is taken;       |
/// |             |      |                    |          | relative to this file                 |
/// | `cycle_ms`  | ms   | the daemon's       | its own  | time between plans                    |
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
/// Memory      Heap, until site_free(): at start-up and when the configuration is read again.
#ifndef VERGE_DAEMON_SITE_H
#define VERGE_DAEMON_SITE_H

#include "common/bus_json.h"
#include "common/json.h"
#include "daemon/exit.h"
#include "daemon/service.h"
#include "verge/inbox.h"
#include "verge/verge.h"

#include <stdio.h>

enum { SITE_BUS_SIZE = 256, SITE_BUSES_MAX = INBOX_BUSES_MAX };

typedef struct site {
    char         bus[SITE_BUSES_MAX][SITE_BUS_SIZE];
    uint32_t     bus_count;
    bus_options  bus_options;
    uint32_t     cycle_ms;
    verge_planner_def planner;  ///< road included; the road's memory belongs to the site
    inbox_limits freshness;
    service      service;
    uint32_t     map_crc32;     ///< of the road, see wire_map_crc32()
    uint32_t     config_crc32;  ///< of what site_print() prints
    char*        road_file;     ///< the path as resolved; null: the road was written inline
    char*        road_text;     ///< the road as JSON on one line
} site;

/// What a daemon adds: its own keys. Its configuration is a struct whose first member is a site.
typedef struct site_def {
    size_t             size;    ///< [B] of that struct
    const char*        format;  ///< the value of the key "format", such as "verge-rsu/1"
    const char* const* keys;    ///< the daemon's own keys, null-terminated
    uint32_t           cycle_ms_min, cycle_ms_max, cycle_ms_default;
    /// Changes the defaults of the planner, before its parameters are read. May be null.
    void             (*planner_defaults)(verge_planner_def* def);
    /// Reads the own keys, and may check the site, which is complete but for its road. False: the
    /// error is in the file. The struct has been filled with zeros.
    bool             (*read)(site* self, const json_at* root);
    /// Writes the own members as JSON with all defaults, each after a comma and a line break.
    void             (*print)(const site* self, FILE* out);
    /// The first own key that differs and cannot change without a restart; null: none. The function
    /// may be null.
    const char*      (*changed)(const site* self, const site* next);
} site_def;

/// Reads and checks everything. Returns 0, EXIT_NO_INPUT, EXIT_CONFIG or EXIT_OS; unless 0,
/// *loaded is null and error holds one line `file:field: what is wrong, what was expected`.
int  site_load(site** loaded, const site_def* def, const char* path,
               char error[CONFIG_ERROR_SIZE]);
void site_free(site* self); ///< null is fine

/// The whole configuration as JSON, with every planner parameter. It can be read again.
void site_print(const site* self, const site_def* def, FILE* out);

/// The URLs with commas between them, cut to size, which is at least 1.
void site_bus_list(const site* self, char* text, size_t size);
/// Do both name the same buses and the same options for them?
bool site_same_buses(const site* self, const site* other);

/// Can the next configuration take effect without a restart? The planner's memory is fixed at the
/// start, and so are the members that service_changed() and def->changed() name. False: one line in
/// error, with the remedy.
bool site_may_follow(const site* self, const site* next, const site_def* def,
                     char error[CONFIG_ERROR_SIZE]);

#endif
