/// Detects a vehicle that stands without a cause: a failure of the planner that no other metric
/// shows.
///
/// A vehicle stands if it is slower than STANDING_SPEED. It has a cause if within STANDING_VIEW
///   - another vehicle is ahead of it or beside it, on any lane;
///   - its lane ends without a successor: at the end of the road, or on a lane on which it waits
///     for a gap.
#ifndef VERGE_APPS_STANDING_H
#define VERGE_APPS_STANDING_H

#include "world.h"

#define STANDING_SPEED 0.5 ///< [m/s] lowest speed of a moving vehicle
#define STANDING_VIEW 50.0 ///< [m] from its centre

bool standing_without_cause(const world* world, const world_vehicle* vehicle);

#endif
