/// Planner parameters and habits from and to JSON: every scalar field of verge_planner_def by its
/// name, as verge_planner_params() lists them. `search` is written by name ("paper", "best"), a
/// seed above 2^53 as a string of digits.
#ifndef VERGE_APPS_PLANNER_JSON_H
#define VERGE_APPS_PLANNER_JSON_H

#include "json.h"
#include "verge/planner.h"

#include <stdio.h>

/// Changes the fields of *def (defaulted by the caller) that the object at `at` names. An absent
/// object changes nothing. Ranges and the relations between parameters are checked.
bool planner_def_from_json(const json_at* at, verge_planner_def* def);

/// All parameters as one JSON object on one line.
void planner_def_write(FILE* out, const verge_planner_def* def);

/// "aggressive", "normal", "conservative" or
/// {"cooperation": c, "weights": {"curvature": .., "heading": .., "offset": ..,
///  "acceleration": .., "jerk": .., "obstacle": ..}}; absent: normal.
bool habit_from_json(const json_at* at, verge_habit* habit);

#endif
