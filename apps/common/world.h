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
/// Controlled  Follow their latest trajectory, linearly between its points. Where it has them
///             elsewhere or at another speed, as a plan that comes late does, they are there at
///             once, or with `takes_up` take up the difference within a second. After its end, or
///             with a cancelled plan, they keep their lane and brake gently. Before the first plan
///             they keep their lane at constant speed.
/// Units       A vehicle may have an on-vehicle unit. While a trajectory of the unit is valid, the
///             vehicle drives it and no plan. After it, the vehicle brakes to a stop along the rest
///             of the trajectory, then in its lane: as a car does whose unit has failed.
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

/// The difference of a vehicle from its trajectory, in one direction, at the instant at which it
/// began to follow it.
typedef struct world_offset {
    double position;         ///< [m]
    double speed;            ///< [m/s]
    double acceleration;     ///< [m/s^2]
} world_offset;

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
    double   followed_from;  ///< [s] since when it follows the plan, in the world's time
    world_offset ahead, left_of; ///< from the plan at that instant, in its direction and left of it
    bool     unit;           ///< `plan` is, or will be, a trajectory of its on-vehicle unit
    double   valid_until;    ///< [s] of that trajectory, in the world's time
    const char* mode;        ///< of its unit, or WORLD_MODE_NONE; null: no trajectory until now
    double   along;          ///< [s] t of the trajectory at which its path is where the vehicle is
    double   curvature;      ///< [1/m] driven; 0 without a trajectory
    double   jerk;           ///< [m/s^3] driven; 0 without a trajectory
} world_vehicle;

/// The mode of a vehicle without a valid trajectory of a unit, after it had one.
#define WORLD_MODE_NONE "none"

typedef struct world {
    const scenario*   scene;
    bool              takes_up;   ///< a difference from a new plan is taken up within a second
    bool              units_only; ///< controlled vehicles drive trajectories of their units only
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
/// unknown, uncontrolled or absent vehicles are ignored, and so are plans for vehicles that drive a
/// trajectory of their unit.
void world_follow(world* self, const verge_vehicle_plan* plan, double plan_time);

/// Every controlled vehicle has an on-vehicle unit: plans of world_follow() are not driven. Call it
/// at t = 0. The vehicles drive on at constant speed for the first second, while their units start.
void world_expect_units(world* self);

/// Gives a vehicle a trajectory of its on-vehicle unit, with t = 0 at `time` and valid until
/// `until` [s] of the world. mode: of the unit; static lifetime. Trajectories for unknown,
/// uncontrolled or absent vehicles are ignored.
void world_drive(world* self, const verge_vehicle_plan* trajectory, double time, double until,
                 const char* mode);

/// The point of a trajectory at t [s], on the line between two points; before the first point the
/// first one. False: the trajectory has ended.
bool world_point_at(const verge_vehicle_plan* trajectory, double t, verge_point* point);

/// Moves all vehicles by one tick.
void world_advance(world* self);

/// Does a lane end without a successor beside one that goes on? A vehicle has to leave it before.
bool world_dead_end(const world* self, int32_t lane);

/// The step of the vehicle's plan that is active now; null: there is none.
const verge_action_step* world_action(const world* self, const world_vehicle* vehicle);

#endif
