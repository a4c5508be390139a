/// An upper bound of X_flow (Eq. 5): the weighted sum of the best reward of each vehicle alone on
/// the road, over all action sequences. Other vehicles can only forbid actions or delay a vehicle,
/// so the bound is never exceeded. The gap to the optimum is not known.
///
/// Cost       At most 5 ^ steps flow steps a vehicle: about 10 ms for the default 7 steps. With
///            more than BOUND_STEPS_MAX steps it is not computed.
#ifndef VERGE_EXPERIMENT_BOUND_H
#define VERGE_EXPERIMENT_BOUND_H

#include "common/world.h"

enum { BOUND_STEPS_MAX = 7 };

/// For the present state of the world. NaN: too many steps, or no controlled vehicle.
double bound_of(const world* world);

#endif
