/// One trial: a run of a scenario with a method and a seed, and its outcome.
///
///     const trial task = { .text = document, .seed = 7, .method = METHOD_VERGE };
///     outcome result;
///     trial_run(&task, &result);
///     ...
///     outcome_free(&result);
///
/// Methods    VERGE: closed loop, planned every simulation.replan seconds. DECISION_ONLY and
///            SEQUENTIAL: decided once and driven exactly (decided.h). All three use the same ticks
///            and the same metrics (common/metrics.h), over all pairs.
/// Nodes      Of the first decision of the run: the number created until the returned plan was
///            first found, and the total number. Later cycles of VERGE are excluded, because they
///            start from the plan of the cycle before and need fewer nodes.
/// Threads    Trials share nothing; they may run at the same time.
#ifndef VERGE_EXPERIMENT_TRIAL_H
#define VERGE_EXPERIMENT_TRIAL_H

#include "common/metrics.h"

typedef enum method {
    METHOD_VERGE,
    METHOD_DECISION_ONLY,
    METHOD_SEQUENTIAL,
} method;

/// Called at every tick, before the world advances. plan: made at this tick, otherwise null.
typedef void trial_observer(const world* world, const verge_plan* plan, void* notes);

typedef struct trial {
    const char*     text;       ///< the scenario document; must outlive the trial
    uint64_t        seed;
    method          method;
    bool            bound;      ///< computes the bound of X_flow (bound.h)
    bool            record;     ///< keeps the run file
    trial_observer* observe;    ///< may be null
    size_t          notes_size; ///< [B] zeroed memory for the observer
} trial;

typedef struct outcome {
    bool     done;           ///< false: not run, or `error` tells why not
    char     error[256];
    bool     success;
    uint32_t collisions;
    uint32_t intentions, reached;
    double   finish_time;    ///< [s] mean of those who finished; NaN: nobody
    double   finish_last;    ///< [s] of the last one; NaN: not all did
    double   reached_time;   ///< [s] mean, by the stricter test
    double   min_center_gap, min_distance, min_ttc;
    double   max_abs_acceleration, max_abs_jerk;
    double   fallbacks;      ///< [1] share of vehicle plans
    uint32_t nodes, nodes_total;
    double   nodes_cycle;    ///< [1] nodes created, mean over the run's cycles
    double   reward;         ///< [1] X_flow of the first decision; NaN where there is none
    uint32_t conflicts;      ///< planned vehicles in a conflict in the first decision
    double   bound;          ///< [1] that it cannot exceed; NaN: not asked for
    void*    notes;          ///< what the observer noted
    char*    run;            ///< the run file, null: not recorded
    size_t   run_size;       ///< [B]
} outcome;

/// result->error has the reason if the document is refused.
void trial_run(const trial* task, outcome* result);
void outcome_free(outcome* self);

/// "verge", "decision-only" or "sequential".
const char* method_name(method method);

#endif
