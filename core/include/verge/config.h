/// Every capacity of verge in one place: meaning, cost, range.
///
/// A capacity bounds memory that is part of the planner's arena or of a plan. Change one by
/// defining it on the compiler's command line, or all of them by naming your own header:
/// -DVERGE_USER_CONFIG='"my_config.h"'. Library and callers must see the same values.
#ifndef VERGE_CONFIG_H
#define VERGE_CONFIG_H

#ifdef VERGE_USER_CONFIG
#include VERGE_USER_CONFIG
#endif

#include <assert.h>
#include <stdint.h>

/// Vehicles in one step, controlled and uncontrolled. 8 .. 64.
/// Cost: 14 B a vehicle in every tree node, 9 B more if it is controlled; 1 kB a vehicle in a plan
/// (its prediction).
#ifndef VERGE_VEHICLES_MAX
#define VERGE_VEHICLES_MAX 64
#endif

/// Vehicles planned jointly. 1 .. 27 (5^27 joint actions fit a 64-bit number), at most
/// VERGE_VEHICLES_MAX.
/// Cost: a sampler each (42 kB with the default parameters), and 3.3 kB each in a plan.
#ifndef VERGE_CONTROLLED_MAX
#define VERGE_CONTROLLED_MAX 16
#endif

/// Lanes of a road. 1 .. 32767. Cost: 1 B in a road for each pair of the lanes that it has, 3 B in
/// a planner for each of the lanes and 1 B more a controlled vehicle; 32 B of stack a lane while a
/// road is checked.
#ifndef VERGE_LANES_MAX
#define VERGE_LANES_MAX 1024
#endif

/// Lanes near the vehicles that a step relates to one another. 8 .. 64. Vehicles on other lanes
/// drive along them, but are not related to other vehicles. Cost: 9 B for each pair of these
/// lanes, at most 37 kB, and 12 B in memory that has other uses as well.
#ifndef VERGE_LANES_NEAR_MAX
#define VERGE_LANES_NEAR_MAX 64
#endif

/// Points of the surveyed centreline of one lane. Cost: none; points nearer to one another than
/// 0.5 m are averaged, and each point left takes 140 B while the road is built.
#ifndef VERGE_LANE_POINTS_MAX
#define VERGE_LANE_POINTS_MAX 1000000
#endif

/// Length of one lane [m], at most 100000: stations are single precision, 1 cm at that length.
/// Cost: 56 B per metre of lane actually present in the road; while it is built, 700 B per metre of
/// the longest row of lanes joined one to one.
#ifndef VERGE_LANE_LENGTH_MAX
#define VERGE_LANE_LENGTH_MAX 100000
#endif

/// Lanes that may continue one lane. 1 .. 8. Cost: 4 B a lane each.
#ifndef VERGE_SUCCESSORS_MAX
#define VERGE_SUCCESSORS_MAX 8
#endif

/// Legal change stretches of one lane and side. 1 .. 255. Cost: 16 B each.
#ifndef VERGE_STRETCHES_MAX
#define VERGE_STRETCHES_MAX 8
#endif

/// Decision steps of the search. 2 .. 32. Cost: 1 B per step and controlled vehicle and plan kept.
#ifndef VERGE_STEPS_MAX
#define VERGE_STEPS_MAX 16
#endif

/// Points of one planned trajectory, the first one at t = 0. 11 .. 64.
#ifndef VERGE_POINTS_MAX
#define VERGE_POINTS_MAX 31
#endif

/// Nodes of the search tree, 2 .. 1000000 (the default of verge_planner_def.nodes_max,
/// which sizes the arena).
/// Cost: 64 B each, and 14 B a vehicle, 9 B more if it is controlled.
#ifndef VERGE_NODES_MAX
#define VERGE_NODES_MAX 4096
#endif

/// Places where one lane meets others that are not its neighbours. 1 .. 60000. Cost: 60 B for each
/// one that the road has; none for the rest.
#ifndef VERGE_CONFLICTS_MAX
#define VERGE_CONFLICTS_MAX 256
#endif

/// Candidate trajectories of one segment: end speeds x lateral offsets. 2 .. 256 speeds; 8 .. 256
/// offsets in multiples of 8, the width of the sampler's inner loop.
/// Cost: none; the arena is sized by verge_planner_def.sample_speeds and .sample_offsets.
#ifndef VERGE_SAMPLE_SPEEDS_MAX
#define VERGE_SAMPLE_SPEEDS_MAX 32
#endif
#ifndef VERGE_SAMPLE_OFFSETS_MAX
#define VERGE_SAMPLE_OFFSETS_MAX 32
#endif

/// Reference car: BMW 320i, vehicle 2 of the CommonRoad vehicle models (version 3.0.2). Other
/// bodies: body.h. The rear axle lies this far behind the centre, and moves along the heading. [m]
#define VERGE_REAR_AXLE 1.4227
#define VERGE_WHEELBASE 2.5789         ///< [m]
#define VERGE_STEER_MAX 1.0661370137472266 ///< [rad] for a curvature of 0.702 1/m
#define VERGE_STEER_RATE_MAX 0.4       ///< [rad/s]
#define VERGE_CURVATURE_MAX 0.702      ///< [1/m]   tan(steer_max) / wheelbase, of the rear axle
#define VERGE_ACCELERATION_MAX 11.5    ///< [m/s^2] also the radius of the friction circle
#define VERGE_SPEED_SWITCH 7.319       ///< [m/s]   above it a <= a_max * v_switch / v
#define VERGE_SPEED_MAX 50.8           ///< [m/s]

/// The capacities that size public structures, in one number: the fingerprint of a configuration.
/// Library and caller compare theirs; where they differ, calls return VERGE_ERR_CONFIG.
#define VERGE_CONFIG                                                                          \
    ((uint64_t)(VERGE_VEHICLES_MAX) | (uint64_t)(VERGE_CONTROLLED_MAX) << 8                   \
     | (uint64_t)(VERGE_STEPS_MAX) << 16 | (uint64_t)(VERGE_POINTS_MAX) << 24                 \
     | (uint64_t)(VERGE_SUCCESSORS_MAX) << 32 | (uint64_t)(VERGE_STRETCHES_MAX) << 40)

static_assert(VERGE_VEHICLES_MAX >= 8 && VERGE_VEHICLES_MAX <= 64, "VERGE_VEHICLES_MAX: 8 .. 64");
static_assert(VERGE_CONTROLLED_MAX >= 1 && VERGE_CONTROLLED_MAX <= 27,
              "VERGE_CONTROLLED_MAX: 1 .. 27");
static_assert(VERGE_CONTROLLED_MAX <= VERGE_VEHICLES_MAX,
              "VERGE_CONTROLLED_MAX: at most VERGE_VEHICLES_MAX");
static_assert(VERGE_STEPS_MAX >= 2 && VERGE_STEPS_MAX <= 32, "VERGE_STEPS_MAX: 2 .. 32");
static_assert(VERGE_POINTS_MAX >= 11 && VERGE_POINTS_MAX <= 64, "VERGE_POINTS_MAX: 11 .. 64");
static_assert(VERGE_SUCCESSORS_MAX >= 1 && VERGE_SUCCESSORS_MAX <= 8,
              "VERGE_SUCCESSORS_MAX: 1 .. 8");
static_assert(VERGE_LANES_MAX >= 1 && VERGE_LANES_MAX <= 32767, "VERGE_LANES_MAX: 1 .. 32767");
static_assert(VERGE_LANES_NEAR_MAX >= 8 && VERGE_LANES_NEAR_MAX <= 64,
              "VERGE_LANES_NEAR_MAX: 8 .. 64");
static_assert(VERGE_STRETCHES_MAX >= 1 && VERGE_STRETCHES_MAX <= 255,
              "VERGE_STRETCHES_MAX: 1 .. 255");
static_assert(VERGE_CONFLICTS_MAX >= 1 && VERGE_CONFLICTS_MAX <= 60000,
              "VERGE_CONFLICTS_MAX: 1 .. 60000");
static_assert(VERGE_NODES_MAX >= 2 && VERGE_NODES_MAX <= 1000000, "VERGE_NODES_MAX: 2 .. 1000000");
static_assert(VERGE_SAMPLE_SPEEDS_MAX >= 2 && VERGE_SAMPLE_SPEEDS_MAX <= 256,
              "VERGE_SAMPLE_SPEEDS_MAX: 2 .. 256");
static_assert(VERGE_SAMPLE_OFFSETS_MAX >= 8 && VERGE_SAMPLE_OFFSETS_MAX <= 256
                  && VERGE_SAMPLE_OFFSETS_MAX % 8 == 0,
              "VERGE_SAMPLE_OFFSETS_MAX: 8 .. 256 in multiples of 8");

/// Below this speed lateral motion is a function of distance, d(s), and curvature is unknown. [m/s]
#define VERGE_SPEED_SLOW 2.0

#endif
