/// Opening the scenario of a command line: its argument, and the value of --seed.
#ifndef VERGE_APPS_SCENARIO_OPEN_H
#define VERGE_APPS_SCENARIO_OPEN_H

#include "options.h"
#include "scenario.h"

/// Loads the scenario at path. seed_text (may be null) replaces its seed. False: one line on
/// standard error names the fault, and there is nothing to free.
bool scenario_open(scenario* scene, const program* self, const char* path, const char* seed_text);

#endif
