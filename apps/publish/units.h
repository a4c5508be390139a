/// The on-vehicle units of the vehicles: which of their trajectories the vehicles drive, and the
/// modes of the units.
///
/// A vehicle drives the trajectory with the newest utime; of two with the same utime, the one with
/// the larger sequence. Refused, and counted, are trajectories that have an invalid field, that are
/// not newer, that are no longer valid, that begin after the next tick, and that begin more than
/// 1 m or 1 m/s from the vehicle's own state. world.h states what a vehicle does without a valid
/// trajectory.
///
/// Memory      All in the struct. No function allocates.
#ifndef VERGE_PUBLISH_UNITS_H
#define VERGE_PUBLISH_UNITS_H

#include "common/run.h"

#include "verge/transport.h"

typedef enum units_verdict {
    UNITS_DRIVEN,
    UNITS_INVALID, ///< a field is outside its range
    UNITS_OLDER,   ///< not newer than the one that the vehicle has
    UNITS_LATE,    ///< no longer valid
    UNITS_EARLY,   ///< begins after the next tick
    UNITS_FAR,     ///< does not begin at the vehicle
    UNITS_IGNORED, ///< of no controlled vehicle in the scene; not counted
} units_verdict;
enum { UNITS_VERDICTS = UNITS_IGNORED };

/// One vehicle's unit.
typedef struct units_one {
    int64_t  utime;    ///< [us] of the newest trajectory; INT64_MIN: none
    int32_t  sequence; ///< of it
    run_unit now;      ///< what the unit does
    run_unit told;     ///< what was reported of it
} units_one;

typedef struct units {
    int64_t   start;                  ///< [us] wall clock at the world's t = 0
    FILE*     run;                    ///< run file for changes of modes; null: none
    bool      quiet;                  ///< does not print them
    units_one each[VERGE_VEHICLES_MAX]; ///< in the world's order
    uint64_t  counts[UNITS_VERDICTS]; ///< trajectories
} units;

/// start: [us] wall clock at the world's t = 0. run: null, or a run file that outlives self.
void units_init(units* self, const world* world, int64_t start, FILE* run, bool quiet);

/// A trajectory was received: gives it to its vehicle, or refuses it.
units_verdict units_hear(units* self, world* world, const verge_vehicle_trajectory_t* message);

/// After each tick of the world: reports the units whose trajectory is no longer valid.
void units_tick(units* self, const world* world);

/// Cycle of the plan that the unit of this vehicle follows or departs from; -1: none.
int32_t units_cycle(const units* self, uint32_t index);

/// {"driven":..,"invalid":..,"older":..,"late":..,"early":..,"far":..}
void units_write(FILE* out, const units* self);

#endif
