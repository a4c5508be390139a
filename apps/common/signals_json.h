/// The programs of traffic signals, for simulations: what each signal shows at any time.
///
///     "signals": [ { "lane": 3, "start": 0, "phases": [ { "state": "green", "seconds": 20 },
///                                                       { "state": "yellow", "seconds": 3 },
///                                                       { "state": "red", "seconds": 17 } ] } ]
///
/// The phases follow one another from `start` [s] on, and again from the first one, also before
/// `start`. A signal of one phase never changes.
#ifndef VERGE_APPS_SIGNALS_JSON_H
#define VERGE_APPS_SIGNALS_JSON_H

#include "json.h"
#include "verge/scene.h"

enum { SIGNAL_PHASES_MAX = 16 };

typedef struct signal_program {
    int32_t  lane_id;
    double   start;                                ///< [s] of the simulation
    uint32_t phase_count;                          ///< 1 ..
    verge_signal_state states[SIGNAL_PHASES_MAX];
    double   seconds[SIGNAL_PHASES_MAX];           ///< [s]
} signal_program;

/// The programs, ascending by lane; to be freed. *count is 0 where there are none. Refused: a lane
/// that the road does not have, a second program of a lane. False: the fault is in the file's
/// error.
bool signals_from_json(const json_at* at, const verge_road_def* road, signal_program** programs,
                       uint32_t* count);

/// The signal at t [s] of the simulation.
verge_signal signal_at(const signal_program* program, double t);

#endif
