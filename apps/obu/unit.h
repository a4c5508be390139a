/// What an on-vehicle unit does: in each cycle it makes one trajectory for its vehicle.
///
///     unit* unit = unit_open(&def);
///     unit_offer(unit, &message);              // each state, plan and signal that is received
///     if (unit_cycle(unit, utime, &trajectory)) publish(&trajectory);     // ten times a second
///
/// Modes       following   The plan of the roadside unit is fresh, begins where the vehicle is, and
///                         meets no body as this unit predicts them now. Its points are driven, or,
///                         further than 0.05 m or 0.1 m/s from them, new ones along its actions.
///             departing   It meets a body, or is more than 1 m or 1 m/s from the vehicle, or there
///                         is no trajectory along its actions. The vehicle gets a trajectory of its
///                         own: along the actions of the plan if that is possible, else by its own
///                         decision, else a fallback. A newer plan that fits is followed again; the
///                         same plan is not.
///             alone       There is no plan to follow. The unit decides for its vehicle alone.
///             stopping    The own position is missing, the body overlaps another one, or the
///                         vehicle is on no lane. It brakes to standstill in its lane; where there
///                         is no position, from its last trajectory.
/// Prediction  A neighbour that drives a valid plan of the roadside unit moves as planned. Others
///             are predicted as by verge_predict(), but one that brakes harder than 1 m/s^2 is
///             expected to go on braking.
/// Memory      unit_open() allocates everything; nothing else does.
/// Threads     One.
/// Time        No clock is read: the same messages and cycles give the same trajectories, bit for
///             bit.
#ifndef VERGE_OBU_UNIT_H
#define VERGE_OBU_UNIT_H

#include "leader.h"

#include "verge/repeat.h"
#include "verge/verge.h"

typedef struct unit_def {
    verge_planner_def planner;  ///< road included, which is read in unit_open() only. vehicles_max:
                                ///< the own one and the nearest others; controlled_max is 1
    int32_t           vehicle_id;
    int32_t           rsu_id;   ///< to follow; -1: the lowest id that is heard
    uint32_t          map_crc32;
    inbox_limits      limits;
    int32_t           own_bus;  ///< number of the bus on which own states arrive, -1: any
    bool              repeats;  ///< the plans of the roadside unit are planned again (repeat.h)
    verge_planner_def rsu_planner; ///< its parameters, for this; the road is that of `planner`
} unit_def;

typedef struct unit_counters {
    uint64_t cycles;
    uint64_t without;         ///< cycles without a trajectory
    uint64_t by_mode[WIRE_UNIT_MODES]; ///< trajectories
    uint64_t mode_changes;
    uint64_t tracked;         ///< trajectories that are the points of the roadside unit's plan
    uint64_t fallbacks;       ///< own trajectories that are fallbacks
    uint64_t own_id_elsewhere; ///< states with the own id from another bus than own_bus
    uint64_t left_out;        ///< neighbours beyond vehicles_max, summed over cycles
    uint64_t unusable;        ///< neighbours that the planner refuses
    uint64_t clock_steps;     ///< times the clock has stepped back, or ahead by over 1.5 s
    uint64_t repeated;        ///< plans of the roadside unit that were planned again
    uint64_t repeated_same;   ///< of these, equal to the message, bit for bit
} unit_counters;

typedef struct unit unit;

/// Null: the system refuses memory, or the planner the definition; a line in error.
unit* unit_open(const unit_def* def, char* error, size_t error_size);
void  unit_close(unit* self); ///< null is fine

/// Offers a message that was received: a state, a plan or a signal; others are ignored. True: it is
/// used. An own state has message->bus own_bus.
bool  unit_offer(unit* self, const transport_message* message);

/// The trajectory of the cycle at utime [us]. False: there is none, because no position was ever
/// known; *trajectory is unchanged.
bool  unit_cycle(unit* self, int64_t utime, verge_vehicle_trajectory_t* trajectory);

/// Plans the last whole cycle of the roadside unit again, if there is a new one and the unit does
/// so. True: *result says whether the own plan is the same, and what differs. It takes as long as the
/// trajectories of a cycle of the roadside unit.
bool  unit_repeat(unit* self, repeat_result* result);

/// Continues what another unit of the same vehicle did, with its last trajectory and mode: a new
/// configuration takes effect. `before` is unchanged.
void  unit_continue(unit* self, const unit* before);

/// What the last cycle found.
typedef struct unit_view {
    wire_unit_mode   mode;
    wire_unit_reason reason;
    int32_t          vehicle;        ///< that the reason is about, -1 none
    int64_t          utime;          ///< [us] of the cycle, 0: there was none
    int64_t          state_utime;    ///< [us] of the own state, 0: there is none
    uint32_t         neighbours;     ///< in the cycle
    const verge_scene* scene;        ///< the vehicles of the cycle, own one included
    const verge_vehicle_plan* plan;  ///< the trajectory of the cycle, in the planner's form
    verge_vehicle_state_t own;       ///< the last own state that was accepted
} unit_view;
unit_view unit_look(const unit* self);

unit_counters unit_count(const unit* self);
const inbox*  unit_inbox(const unit* self);
const leader* unit_leader(const unit* self);
const verge_road* unit_road(const unit* self);
/// Memory of the planning stages and the road, term by term. [B]
typedef struct unit_memory {
    size_t road, stages, rest;
} unit_memory;
unit_memory unit_memory_of(const unit* self);

#endif
