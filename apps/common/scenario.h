/// A scenario: a road, the vehicles on it with their target lanes, and the planner parameters.
///
///     scenario scene;
///     if (!scenario_load(&scene, path, NULL)) { fputs(scene.file.error, stderr); return 2; }
///     verge_planner_step(scene.planner, 0, ...);
///     scenario_free(&scene);
///
/// File        JSON, format "verge-scenario/1": name, road, vehicles; optional source, planner,
///             simulation {duration [s] 0.1 .. 3600, default 20; replan [s] 0.1 .. 5, default
///             0.5; both multiples of 0.1}. A vehicle has id, control ("controlled" or
///             "human"), x, y, heading, speed, acceleration, length, width; optional target_lane
///             (null or absent: none), habit, body (body_json.h). A human may have a track of rows
///             [t, x, y, heading, speed] with growing t; one without a track may have yields
///             (false: it keeps no rule) and parked (true: it stands). Optional: signals
///             (signals_json.h).
/// Refused     Documents that json.h, road_json.h or planner_json.h refuse; two vehicles with one
///             id or overlapping at t = 0; a vehicle whose first position is on no lane; more
///             vehicles than the planner's capacities; an unknown target_lane.
/// Memory      Heap, until scenario_free(). The planner lives in one arena of it.
#ifndef VERGE_APPS_SCENARIO_H
#define VERGE_APPS_SCENARIO_H

#include "json.h"
#include "signals_json.h"
#include "verge/planner.h"
#include "verge/simulate.h"

#include <stdio.h>

/// One row of a recorded drive.
typedef struct scenario_row {
    double t;          ///< [s] of the simulation
    double x, y;       ///< [m]
    double heading;    ///< [rad]
    double speed;      ///< [m/s]
} scenario_row;

typedef struct scenario_vehicle {
    verge_vehicle start;         ///< as in the file; with a track: as in its first row
    bool          lawless;       ///< a human that yields to nobody and passes red signals
    bool          parked;        ///< a human that stands
    uint32_t      track_count;   ///< 0: no track
    scenario_row* track;
} scenario_vehicle;

typedef struct scenario {
    json_file          file;     ///< the document, and the error line where loading failed
    const char*        name;
    verge_planner_def  def;
    uint32_t           vehicle_count;
    scenario_vehicle*  vehicles; ///< in the order of the file
    uint32_t           signal_count;
    signal_program*    signals;  ///< ascending lane ids
    double             duration; ///< [s]
    double             replan;   ///< [s]
    verge_planner*     planner;  ///< built, no step done
    verge_humans*      humans;   ///< moves the humans of a simulation
    void*              arena;    ///< of the planner, then of the humans
    size_t             arena_size; ///< [B]
} scenario;

/// Loads, checks and builds. seed (may be null) replaces the file's.
/// False: the reason is in scene->file.error, and there is nothing to free.
bool scenario_load(scenario* scene, const char* path, const uint64_t* seed);
/// The same from text; `name` stands for the file in error lines.
bool scenario_parse(scenario* scene, const char* name, const char* text, size_t size,
                    const uint64_t* seed);
/// Keeps the error line.
void scenario_free(scenario* scene);

/// The state of a vehicle with a track at t; false: it is not in the scene at that time. Linear
/// between rows, the heading along the shorter arc; acceleration and yaw rate are the slopes of the
/// rows around t.
bool scenario_track_at(const scenario_vehicle* vehicle, double t, verge_vehicle* state);

/// The whole document on one line, with the seed and every planner parameter as used.
void scenario_write(FILE* out, const scenario* scene);

#endif
