/// The experiments by name. Each fills its rows from the lab's settings.
///
/// freeway-table  The paper's Table 3: three methods, 2 to 4 controlled vehicles, both settings.
/// pareto         Finish time against smallest gap, over the parameters that influence both.
/// beyond         5, 6 and 8 controlled vehicles, on the authors' freeway and in random dense
///                traffic; the paper's own search beside the default one.
/// regret         The first decision in random dense traffic, over the budget: how far X_flow is
///                from the best that is known, and from the bound.
/// ramp-cases     Cases 1, 2 and 3 of section 4.2, from both of the authors' states.
/// roundabout     Entering and circulating vehicles.
/// recorded       Recorded US-101 traffic with replayed humans; empty if the data is absent.
/// diversity      The same scenes with the three habits; yielding over the cooperation factor.
#ifndef VERGE_EXPERIMENT_EXPERIMENTS_H
#define VERGE_EXPERIMENT_EXPERIMENTS_H

#include "lab.h"

/// False: interrupted or failed; the rows are incomplete.
typedef bool experiment_run(lab* self, table* rows);

enum { EXPERIMENT_PICTURES = 3 };

typedef struct experiment {
    const char*     name;
    const char*     text;    ///< one line
    uint32_t        repeats; ///< where --repeats is not given
    experiment_run* run;
    const char*     pictures[EXPERIMENT_PICTURES + 1]; ///< run files the page shows; null ends them
} experiment;

extern const experiment experiments[];
extern const uint32_t   experiment_count;

experiment_run freeway_table, pareto, beyond, regret, ramp_cases, roundabout, recorded, diversity;

#endif
