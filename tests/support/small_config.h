/// The second configuration that tools/check builds and tests: a small unit, with room for exactly
/// the scenarios of apps/scenarios.
#define VERGE_LANES_MAX 20
#define VERGE_VEHICLES_MAX 10
#define VERGE_CONTROLLED_MAX 9
#define VERGE_STEPS_MAX 8
