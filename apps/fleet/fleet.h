/// A scenario driven by a roadside unit and one on-vehicle unit for each controlled vehicle, in one
/// process and on a virtual clock. Their messages are the encoded ones of a bus; plans may arrive
/// late or not at all, and the roadside unit may be absent for a while.
///
///     fleet_open(&fleet, &world, &faults, error, sizeof error);
///     for (;;) { fleet_tick(fleet); ...; world_advance(&world); }
///
/// Bus         States arrive at once. A plan arrives delay_s after its cycle, at all units or, with
///             probability loss, at none.
/// Memory      fleet_open() allocates everything.
/// Time        That of the world: the same scenario, faults and seed give the same run.
#ifndef VERGE_FLEET_H
#define VERGE_FLEET_H

#include "obu/unit.h"
#include "rsu/cycle.h"

#include "common/world.h"

typedef struct fleet_options {
    bool     without_units; ///< vehicles drive the plans as they arrive
    double   delay_s;       ///< [s] 0 .. 1
    double   loss;          ///< [1] probability that a plan is lost, 0 .. 1
    double   off_from, off_to; ///< [s] the roadside unit is absent from .. to; equal: never
    uint64_t seed;          ///< of the losses
    bool     repeats;       ///< each unit plans the cycles of the roadside unit again
} fleet_options;

/// A change of mode.
typedef struct fleet_change {
    double           t;       ///< [s]
    int32_t          vehicle_id;
    wire_unit_mode   mode;
    wire_unit_reason reason;
    int32_t          about;   ///< vehicle that the reason is about, -1 none
    int32_t          cycle;   ///< of the plan, -1 none
} fleet_change;

enum { FLEET_CHANGES_MAX = 4096 };

typedef struct fleet fleet;

/// The world's scenario must outlive the fleet. Null: a line in error.
fleet* fleet_open(world* world, const fleet_options* faults, char* error, size_t error_size);
void   fleet_close(fleet* self); ///< null is fine

/// One tick of the world: states are sent; at a cycle the roadside unit plans; plans arrive; each
/// on-vehicle unit makes a trajectory, which its vehicle drives from now on.
void fleet_tick(fleet* self);

/// Did the roadside unit plan in this tick? Its last plan.
const verge_plan* fleet_plan(const fleet* self, bool* planned);

/// The changes of mode so far, the first FLEET_CHANGES_MAX of them.
const fleet_change* fleet_changes(const fleet* self, uint32_t* count);

/// Counters of the unit of a vehicle; all zero for another vehicle.
unit_counters fleet_count(const fleet* self, int32_t vehicle_id);

#endif
