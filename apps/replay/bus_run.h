/// Plans a run of verge-publish again. The states that it sent go through the inbox and the cycles
/// of the daemon, for each vehicle up to the state from which its plan was made. For vehicles
/// without a plan the run does not state which one was used; if states were sent at the instant of
/// a cycle, each possibility is planned until one has the recorded digest.
///
///     bus_run_init(&run, &scene, start_utime, &def, &planner_def, memory, memory_size);
///     for each line: bus_run_tick(&run, &at) or bus_run_plan(&run, &at, digest);
///     bus_run_free(&run);
///
/// The plans are equal if the roadside unit used the same planner, received no other states, and
/// had an empty road before the run. After a cycle whose plans did not arrive no more cycles can be
/// compared.
#ifndef VERGE_REPLAY_BUS_RUN_H
#define VERGE_REPLAY_BUS_RUN_H

#include "common/json.h"
#include "common/scenario.h"
#include "rsu/cycle.h"

typedef struct bus_run {
    const scenario* scene;
    int64_t  start_utime;          ///< [us] of t = 0
    uint32_t map_crc32;            ///< of the scenario's road, as verge-publish states it
    int64_t  horizon_us;           ///< from a plan's instant to the end of its validity
    cycle    cycle;
    verge_vehicle_state_t* waiting; ///< sent, and not yet used by a cycle
    uint32_t waiting_count, waiting_capacity;
    void*    memory;               ///< of the planner
    size_t   memory_size;
    void*    memory_before;        ///< before the present cycle
    cycle*   cycle_before;

    uint32_t compared;             ///< cycles
    int32_t  last_number;          ///< of a cycle; -1: none
    int32_t  gap_number;           ///< -1; else the first cycle that is missing in the run
    bool     ended;                ///< no more cycles can be compared
    bool     differs;              ///< the cycle below has another digest
    int32_t  differs_number;
    uint64_t recorded, replayed;   ///< digests of the cycle that differs
} bus_run;

/// def: of the daemon. Its planner has the parameters `planner`, has made no step yet, and lives in
/// `memory`, which is saved and restored. False: out of memory.
bool bus_run_init(bus_run* self, const scenario* scene, int64_t start_utime, const cycle_def* def,
                  const verge_planner_def* planner, void* memory, size_t memory_size);
void bus_run_free(bus_run* self);

/// A line of the run with "vehicles". False: the reason is in the error line of its file.
bool bus_run_tick(bus_run* self, const json_at* line);
/// One with "plan", whose digest is given. False: as above.
bool bus_run_plan(bus_run* self, const json_at* line, uint64_t digest);

#endif
