/// What X_flow (Eq. 5) cannot exceed: the weighted sum of what each vehicle would earn alone on
/// the road, over every action sequence there is. Others can only forbid actions or hold a
/// vehicle up, so the bound is admissible; how near it can be come to is not known.
///
/// Cost       5 ^ steps flow steps a vehicle at most: some 10 ms for the default 7 steps; with
///            more than BOUND_STEPS_MAX steps it is not computed.
#ifndef VERGE_EXPERIMENT_BOUND_H
#define VERGE_EXPERIMENT_BOUND_H

#include "common/world.h"

enum { BOUND_STEPS_MAX = 7 };

/// For the world as it is now. NaN: too many steps, or nobody is controlled.
double bound_of(const world* world);

#endif
