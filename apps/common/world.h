/// The closed loop: a scenario's vehicles in motion, ten times a second.
///
///     world scene;
///     world_init(&scene, &loaded);
///     for (;;) {
///         verge_vehicle now[VERGE_VEHICLES_MAX];
///         uint32_t count = world_states(&scene, now);
///         verge_planner_step(planner, world_utime(&scene), now, count, &plan);
///         world_follow(&scene, &plan.vehicles[i], world_time(&scene)); // each i
///         world_advance(&scene);
///     }
///
/// Controlled  follow their latest trajectory exactly at its points and linearly between them.
///             Beyond its end, or with a cancelled plan, they keep to their lane and brake
///             gently; before the first plan they keep to their lane at constant speed.
/// Humans      follow their track, or the car-following model the planner predicts them with.
/// Leaving     After the last row of a track, or off the end of a lane that nothing continues.
/// Time        t = 0 is the scenario's start. A tick is WORLD_DT; nothing reads a clock.
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
    bool     left;           ///< was in the scene and comes no more
    int32_t  lane;           ///< the lane that contains its centre, else VERGE_NO_LANE
    int32_t  lane_last;      ///< the last lane that did
    bool     off_road;       ///< on no lane, or left the scene while it was on none
    bool     planned;        ///< `plan` holds something
    double   plan_time;      ///< [s] t = 0 of its plan, in the world's time
    verge_vehicle_plan plan;
    double   curvature;      ///< [1/m] driven; 0 where no trajectory is followed
    double   jerk;           ///< [m/s^3] driven; 0 where no trajectory is followed
} world_vehicle;

typedef struct world {
    const scenario*   scene;
    const verge_road* road;
    uint32_t          tick;
    uint32_t          vehicle_count;
    world_vehicle*    vehicles;  ///< in the scenario's order
} world;

/// scene must outlive the world. False: out of memory.
bool world_init(world* self, const scenario* scene);
void world_free(world* self);

double  world_time(const world* self);  ///< [s]
int64_t world_utime(const world* self); ///< [us] since the scenario's start

/// The vehicles in the scene, as a planning step wants them. Returns how many.
uint32_t world_states(const world* self, verge_vehicle states[VERGE_VEHICLES_MAX]);

/// Hands a vehicle its newest plan, whose t = 0 is at plan_time [s] of the world. Plans for
/// unknown, human or absent vehicles are ignored.
void world_follow(world* self, const verge_vehicle_plan* plan, double plan_time);

/// Moves everyone on by one tick.
void world_advance(world* self);

/// The step of the vehicle's plan that is active now; null where there is none.
const verge_action_step* world_action(const world* self, const world_vehicle* vehicle);

#endif
