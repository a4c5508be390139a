/// verge: joint decisions and drivable trajectories for the vehicles around one roadside unit. This
/// header includes all others. Start with planner.h.
#ifndef VERGE_H
#define VERGE_H

#define VERGE_VERSION_MAJOR 0
#define VERGE_VERSION_MINOR 1
#define VERGE_VERSION_PATCH 0
#define VERGE_VERSION_STRING "0.1.0"

#include "verge/config.h"
#include "verge/assert.h"
#include "verge/body.h"
#include "verge/types.h"
#include "verge/limits.h"
#include "verge/road.h"
#include "verge/def.h"
#include "verge/scene.h"
#include "verge/decision.h"
#include "verge/trajectory.h"
#include "verge/plan.h"
#include "verge/planner.h"
#include "verge/simulate.h"

#endif
