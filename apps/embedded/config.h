/// Capacities of an on-vehicle unit: one planned vehicle among nine (verge/config.h).
#define VERGE_VEHICLES_MAX 9
#define VERGE_CONTROLLED_MAX 1
#define VERGE_STEPS_MAX 8
#define VERGE_LANES_MAX 64
#define VERGE_LANES_NEAR_MAX 16
