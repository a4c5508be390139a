/// The closed loop: moves the vehicles of a scenario, ten ticks a second.
///
///     world scene;
///     world_init(&scene, &loaded);
///     for (;;) {
///         world_plan(&scene, &plan);
///         world_follow(&scene, &plan.vehicles[i], world_time(&scene)); // each i
///         world_advance(&scene);
///     }
///
/// Controlled  Follow their latest trajectory, linearly between its points. After its end, or with
///             a cancelled plan, they keep their lane and brake gently. Before the first plan they
///             keep their lane at constant speed.
/// Humans      Follow their track, or the car-following model with which the planner predicts them.
///             Parked ones stand.
///             They see the signals, but for those that keep no rule.
/// Leaving     A vehicle leaves after the last row of its track, or at the end of a lane without a
///             successor.
/// Time        t = 0 is the start of the scenario. A tick is WORLD_DT; no clock is read.
/// Memory      Heap in world_init() only.
#ifndef VERGE_APPS_WORLD_H
#define VERGE_APPS_WORLD_H

#include "scenario.h"

#define WORLD_DT 0.1 ///< [s]
enum { WORLD_TICKS_PER_SECOND = 10 };

typedef struct world_vehicle {
    verge_vehicle           state;
    const scenario_vehicle* origin;
    bool     present;        ///< in the scene now
    bool     left;           ///< has left the scene for good
    int32_t  lane;           ///< the lane that contains its centre, else VERGE_NO_LANE
    int32_t  lane_last;      ///< the last lane that contained it
    bool     off_road;       ///< on no lane, or left the scene while it was on none, or, if it is
                             ///< controlled, over the end of a lane beside one that goes on
    bool     planned;        ///< `plan` is valid
    double   plan_time;      ///< [s] t = 0 of its plan, in the world's time
    verge_vehicle_plan plan;
    double   curvature;      ///< [1/m] driven; 0 without a trajectory
    double   jerk;           ///< [m/s^3] driven; 0 without a trajectory
} world_vehicle;

typedef struct world {
    const scenario*   scene;
    const verge_road* road;
    uint32_t          tick;
    uint32_t          vehicle_count;
    world_vehicle*    vehicles;  ///< in the scenario's order
    uint32_t          signal_count;
    verge_signal*     signals;   ///< what they show now, ascending lane ids
    uint32_t          lawless_count;
    int32_t*          lawless;   ///< ids of the humans that keep no rule
} world;

/// scene must outlive the world. False: out of memory.
bool world_init(world* self, const scenario* scene);
void world_free(world* self);

double  world_time(const world* self);  ///< [s]
int64_t world_utime(const world* self); ///< [us] since the scenario's start

/// The vehicles in the scene, as input of a planning step. Returns their number.
uint32_t world_states(const world* self, verge_vehicle states[VERGE_VEHICLES_MAX]);

/// One step of the scenario's planner for the present state: its vehicles and its signals.
verge_status world_plan(const world* self, verge_plan* plan);

/// Gives a vehicle its newest plan, whose t = 0 is at plan_time [s] of the world. Plans for
/// unknown, uncontrolled or absent vehicles are ignored.
void world_follow(world* self, const verge_vehicle_plan* plan, double plan_time);

/// Moves all vehicles by one tick.
void world_advance(world* self);

/// Does a lane end without a successor beside one that goes on? A vehicle has to leave it before.
bool world_dead_end(const world* self, int32_t lane);

/// The step of the vehicle's plan that is active now; null: there is none.
const verge_action_step* world_action(const world* self, const world_vehicle* vehicle);

#endif
