/// The second configuration that tools/check builds and tests: a small unit, which takes every
/// scenario of apps/scenarios.
#define VERGE_LANES_MAX 24
#define VERGE_VEHICLES_MAX 24
#define VERGE_CONTROLLED_MAX 9
#define VERGE_STEPS_MAX 8
