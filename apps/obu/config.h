/// The configuration file of verge-obu: what every daemon has (daemon/site.h), and its own keys.
///
///     { "format": "verge-obu/1", "vehicle_id": 7, "bus": "lcm:udpm://239.255.76.67:7667?ttl=0",
///       "state": "unix:/run/verge/own-state", "trajectory": "unix:/run/vehicle/trajectory",
///       "road_file": "road.json" }
///
/// | key         | unit | range              | default  | meaning                               |
/// |-------------|------|--------------------|----------|---------------------------------------|
/// | `vehicle_id`| 1    | 0 .. 2^31 - 1      | required | the vehicle that this unit drives     |
/// | `rsu_id`    | 1    | 0 .. 2^31 - 1, or  | null     | the roadside unit to follow; null:    |
/// |             |      | null               |          | the one with the lowest id            |
/// | `state`     |      | bus URL or null    | null     | where the vehicle's own states come   |
/// |             |      |                    |          | from; they are forwarded to `bus`.    |
/// |             |      |                    |          | null: they come on `bus`              |
/// | `trajectory`|      | bus URL or null    | null     | where the trajectories go to; null:   |
/// |             |      |                    |          | to `bus`                              |
/// | `repeat`    |      | {"planner": …} or  | null     | plans each cycle of the roadside unit |
/// |             |      | null               |          | again, with these parameters of it,   |
/// |             |      |                    |          | and logs what differs (repeat.h);     |
/// |             |      |                    |          | `freshness` has to be its own, too    |
/// | `cycle_ms`  | ms   | 20 .. 1000         | 100      | time between trajectories             |
/// | `planner.`  |      | as in planner.h    | "policy" | how the unit decides where it is      |
/// | `search`    |      |                    |          | alone                                 |
/// | `planner.`  | 1    | 1 .. 64            | 9        | the own vehicle and the nearest ones  |
/// | `vehicles_max`|    |                    |          |                                       |
///
/// planner.controlled_max is 1. `vehicle_id`, `state` and `trajectory` are fixed at the start.
/// Memory      As site.h.
#ifndef VERGE_OBU_CONFIG_H
#define VERGE_OBU_CONFIG_H

#include "unit.h"

#include "daemon/site.h"

enum {
    OBU_CYCLE_MS_MIN = 20,
    OBU_CYCLE_MS_MAX = 1000,
    OBU_CYCLE_MS_DEFAULT = 100,
    OBU_VEHICLES_DEFAULT = 9,
};

/// What the unit receives and sends on `bus`, for buses_open().
enum { OBU_BUS_USE = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_SIGNALS
                     | TRANSPORT_SENDS_STATES | TRANSPORT_SENDS_TRAJECTORIES };

typedef struct obu_config {
    site    site; ///< first, see site_def
    int32_t vehicle_id;
    int32_t rsu_id;                    ///< -1: the lowest one
    char    state[SITE_BUS_SIZE];      ///< "": on the buses of the site
    char    trajectory[SITE_BUS_SIZE]; ///< "": to the buses of the site
    bool    repeats;
    verge_planner_def rsu_planner;     ///< of the plans that are repeated; without a road
} obu_config;

/// The keys of verge-obu, for site_load().
extern const site_def OBU_CONFIG_DEF;

/// The configuration that a site belongs to, which was loaded with OBU_CONFIG_DEF; null gives null.
const obu_config* obu_config_of(const site* site);

/// The definition of the unit, with the road of the configuration.
unit_def obu_unit_def(const obu_config* self);

#endif
