/// The run file, format "verge-run/1": JSON Lines with a closed-loop run from its first tick to its
/// metrics:
///
///     {"format":"verge-run/1","scenario":{..., every parameter as used},"dt":0.1}
///     {"t":..,"vehicles":[[id,x,y,heading,speed,acceleration,lane,action,brake,turn],..]}
///     {"t":..,"plan":{the plan document}}        after the tick of its cycle
///     {"metrics":{..}}                           last
///
/// A run on a bus (verge-publish) also holds the inputs of its plans, so that it can be planned
/// again. The first line has "start_utime", the instant [us] of t = 0: the states of a tick were
/// sent with the utime start_utime + t. A tick has "yaw_rates" [rad/s], one for each vehicle (null:
/// unknown). A plan has the "cycle" of the roadside unit, "valid_until_utime" [us] and
/// "state_utimes" [us]: for each vehicle the utime of the state from which it was planned. A plan
/// that was sent because a cycle was late has none of the three.
///
/// A vehicle with an on-vehicle unit (verge-obu) drives what that unit sends. A line is written
/// when the mode of the unit changes, its reason, or the vehicle that the reason is about:
///
///     {"t":..,"unit":{"id":2,"mode":"departing","reason":"contact","vehicle":4,"cycle":33}}
///
/// mode: "following", "departing", "alone", "stopping" (wire_unit_mode), or "none": without a valid
/// trajectory of the unit. reason: wire_unit_reason, "none" for none. vehicle, cycle: null for
/// none; the cycle is that of the plan which is followed or departed from.
///
/// lane: the one that contains the centre, or null. action: the step of the plan that is active
/// at t ("KS" ..), or null (uncontrolled vehicles). brake: true or false. turn: "right", "none",
/// "left".
#ifndef VERGE_APPS_RUN_H
#define VERGE_APPS_RUN_H

#include "metrics.h"

void run_write_head(FILE* out, const scenario* scene);
void run_write_tick(FILE* out, const world* world);
void run_write_plan(FILE* out, const world* world, const verge_plan* plan);

/// The cycle and the states from which a plan was made.
typedef struct run_origin {
    int32_t cycle;                             ///< -1: sent because a cycle was late
    int64_t valid_until_utime;                 ///< [us]
    int64_t state_utime[VERGE_CONTROLLED_MAX]; ///< [us] in the order of the plan's vehicles
} run_origin;

// The same of a run on a bus.
void run_write_bus_head(FILE* out, const scenario* scene, int64_t start_utime);
void run_write_bus_tick(FILE* out, const world* world);
void run_write_bus_plan(FILE* out, const world* world, const verge_plan* plan,
                        const run_origin* origin);

/// A change of mode of an on-vehicle unit:
///     {"t":..,"unit":{"id":2,"mode":"departing","reason":"contact","vehicle":4,"cycle":33}}
/// vehicle: that the reason is about, or null; cycle: of the plan, or null.
typedef struct run_unit {
    int32_t     vehicle_id;
    const char* mode;
    const char* reason;
    int32_t     about; ///< -1: none
    int32_t     cycle; ///< -1: none
} run_unit;
void run_write_unit(FILE* out, double t, const run_unit* unit);

void run_write_metrics(FILE* out, const metrics* metrics, bool timing);

#endif
