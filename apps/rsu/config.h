/// The configuration file of verge-rsu: what every daemon has (daemon/site.h), and two keys more.
///
///     { "format": "verge-rsu/1", "rsu_id": 1, "bus": "lcm:udpm://239.255.76.67:7667?ttl=0",
///       "road_file": "ramp-case1.json", "cycle_ms": 500, "planner": {}, "freshness": {} }
///
/// | key         | unit | range              | default  | meaning                               |
/// |-------------|------|--------------------|----------|---------------------------------------|
/// | `rsu_id`    | 1    | 0 .. 2^31 - 1      | 1        | sender of plans and status            |
/// | `standby`   |      | `lower_id`,        | `lower_  | plans of a unit with a lower rsu_id   |
/// |             |      | `never`            | id`      | replace this unit's for vehicles that |
/// |             |      |                    |          | both plan, see peers.h; or they never |
/// |             |      |                    |          | do                                    |
/// | `cycle_ms`  | ms   | 10 .. 5000         | 500      | time between plans                    |
///
/// Memory      As site.h.
#ifndef VERGE_RSU_CONFIG_H
#define VERGE_RSU_CONFIG_H

#include "cycle.h"
#include "peers.h"

#include "daemon/planning.h"
#include "daemon/site.h"

enum {
    CONFIG_CYCLE_MS_MIN = 10,
    CONFIG_CYCLE_MS_MAX = 5000,
    CONFIG_CYCLE_MS_DEFAULT = 500,
};

/// What the unit receives and sends, for buses_open().
enum { CONFIG_BUS_USE = TRANSPORT_STATES | TRANSPORT_SIGNALS | TRANSPORT_PLANS | TRANSPORT_STATUSES
                        | TRANSPORT_SENDS_PLANS | TRANSPORT_SENDS_STATUSES };

typedef struct config {
    site    site; ///< first, see site_def
    int32_t rsu_id;
    bool    stands_by; ///< for a unit with a lower rsu_id
} config;

/// The keys of verge-rsu, for site_load().
extern const site_def CONFIG_DEF;

/// The configuration that a site belongs to, which was loaded with CONFIG_DEF; null gives null.
const config* config_of(const site* site);

/// What a cycle needs of a configuration and its planner.
cycle_def config_cycle_def(const config* self, const planning* built);
/// Which units it has to tell from others. start_utime [us]: of this run.
peers_def config_peers_def(const config* self, int64_t start_utime);

#endif
