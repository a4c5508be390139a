/// Detects a vehicle that stands without a cause: a failure of the planner that no other metric
/// shows.
///
/// A vehicle stands if it is slower than STANDING_SPEED. It has a cause if
///   - another vehicle moves within STANDING_VIEW;
///   - within STANDING_WAY of its front, along the lanes ahead, there is a body, a red or yellow
///     traffic signal, or the end of the road. A lane that ends beside one that goes on is no
///     cause: there the vehicle is to change lane.
#ifndef VERGE_APPS_STANDING_H
#define VERGE_APPS_STANDING_H

#include "world.h"

#define STANDING_SPEED 0.5 ///< [m/s] lowest speed of a moving vehicle
#define STANDING_VIEW 40.0 ///< [m] between centres
#define STANDING_WAY 15.0  ///< [m]

bool standing_without_cause(const world* world, const world_vehicle* vehicle);

#endif
