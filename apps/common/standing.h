/// Does a vehicle stand without a cause? A vehicle that stands for ever where it could drive is a
/// failure of the planner that no other metric shows.
///
/// A vehicle stands below STANDING_SPEED. It has a cause where within STANDING_VIEW
///   - another vehicle is not behind it: ahead in its lane, beside it, or on a lane it gives way to;
///   - its lane ends and nothing continues that lane: the end of the road, or of the lane on which
///     it waits for a gap.
#ifndef VERGE_APPS_STANDING_H
#define VERGE_APPS_STANDING_H

#include "world.h"

#define STANDING_SPEED 0.5 ///< [m/s] the least speed of a vehicle that drives
#define STANDING_VIEW 50.0 ///< [m] from its centre

bool standing_without_cause(const world* world, const world_vehicle* vehicle);

#endif
