/// The metrics of a closed-loop run, collected at each tick and each planning cycle.
///
/// success          every intention of a controlled vehicle reached by the end of the run, no
///                  contact of a controlled vehicle, none off the road and none standing without a
///                  cause (standing.h) at the end
/// collisions       pairs of vehicles that touched at some tick, at least one of them controlled
/// collisions_human the same between humans (recorded positions can overlap)
/// off_road         controlled vehicles that are on no lane at the end; one that drove off the end
///                  of the road is not off it
/// standing         controlled vehicles that stand at the end without a cause
/// finish_time      [s] per vehicle: first tick at which its centre is in the target lane or in
///                  a lane that continues it; `mean` is that of the vehicles that reached it
/// reached_time     [s] the same, but within 0.5 m of that lane's centreline
///                  A vehicle that starts in its target lane counts for success and is not listed
///                  in these two. Null: not reached.
/// min_distance     [m] between two bodies, over all pairs and ticks
/// min_center_gap   [m] as in the paper: distance of centres less 5 m, of vehicles within 2 m of
///                  each other across the road. "Across" is measured from the direction of the
///                  lane, or from the heading of a vehicle on no lane.
/// min_ttc          [s] gap over closing speed of a vehicle and one ahead of it that drives in the
///                  same direction (within 45 degrees) and overlaps it laterally
/// max_abs_*        over controlled vehicles, at each tick
/// fallbacks        vehicle plans that were fallbacks
/// nodes_mean       [1] search nodes a cycle
/// reordered        circles of standing vehicles that the planner gave a new order
/// unstuck          vehicles that stood for 3 s without a cause and that the planner let go first
/// cycle_ms         [ms] of planning: p50, p99 (nearest rank), max
/// units            per vehicle whose on-vehicle unit sent a trajectory: [s] in each mode that the
///                  unit was in, "none": without a valid trajectory after the first; `changes`
///                  counts changes of the mode. Not listed without any such vehicle.
///
/// A quantity without any measurement is infinite or NaN here, null in JSON. Plans from a bus tell
/// neither nodes nor standstills.
#ifndef VERGE_APPS_METRICS_H
#define VERGE_APPS_METRICS_H

#include "world.h"

enum { METRICS_MODES_MAX = 8 };

/// What the on-vehicle unit of a vehicle did.
typedef struct metrics_unit {
    const char* modes[METRICS_MODES_MAX]; ///< names, in the order in which they occurred
    uint32_t    ticks[METRICS_MODES_MAX]; ///< in each of them
    uint32_t    mode_count;
    uint32_t    latest;                   ///< index of the mode at the latest tick
    uint32_t    changes;
} metrics_unit;

typedef struct metrics_vehicle {
    int32_t id;
    bool    intends;       ///< controlled, with a target lane
    bool    keeps;         ///< its target lane is the one it starts in
    double  finish_time;   ///< [s] NaN: not yet
    double  reached_time;  ///< [s] NaN: not yet
    bool    off_road;      ///< controlled, at the latest tick
    bool    standing;      ///< controlled, without a cause, at the latest tick
    metrics_unit unit;
} metrics_vehicle;

/// A unit vector. [1]
typedef struct metrics_direction {
    double x, y;
} metrics_direction;

typedef struct metrics {
    uint32_t         vehicle_count;
    metrics_vehicle* vehicles;     ///< in the scenario's order
    bool*            touched;      ///< [vehicle][vehicle]
    metrics_direction* road_directions; ///< in the scenario's order, of the present tick
    uint32_t collisions, collisions_human;
    double   min_distance, min_center_gap, min_ttc;
    double   max_abs_acceleration, max_abs_jerk, max_abs_curvature;
    uint64_t fallbacks, nodes, cycles;
    double   reordered, unstuck;
    double*  cycle_ms;
    uint32_t cycle_ms_count, cycle_ms_capacity;
} metrics;

/// The world at its start; metrics_tick() is due for its first tick, too. False: out of memory.
bool metrics_init(metrics* self, const world* world);
void metrics_free(metrics* self);

/// Adds the state of the world at one tick.
void metrics_tick(metrics* self, const world* world);
/// One planning cycle. counters: of the planner, after it; null: not known. ms: how long it took
/// [ms]; negative: not measured.
void metrics_cycle(metrics* self, const verge_plan* plan, const verge_counters* counters,
                   double ms);

bool   metrics_success(const metrics* self);
/// The paper's success: every intention reached and no contact; the state at the end has no
/// influence. For runs that end after the last decision, where vehicles have braked to a
/// standstill.
bool   metrics_reached(const metrics* self);
double metrics_finish_mean(const metrics* self);  ///< [s] NaN: no vehicle finished
double metrics_reached_mean(const metrics* self); ///< [s] NaN: no vehicle finished

/// {"success": .., ...}. timing: with cycle_ms. line: separator of the fields, "" or "\n".
void metrics_write(FILE* out, const metrics* self, bool timing, const char* line);

/// Smallest value that at least `share` (0 .. 1] of the sorted values do not exceed; NaN: none.
double percentile(const double* sorted, uint32_t count, double share);

#endif
