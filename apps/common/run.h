/// The run file, format "verge-run/1": JSON Lines that tell a closed-loop run from its first
/// tick to its metrics. Line by line:
///
///     {"format":"verge-run/1","scenario":{..., every parameter as used},"dt":0.1}
///     {"t":..,"vehicles":[[id,x,y,heading,speed,acceleration,lane,action,brake,turn],..]}
///     {"t":..,"plan":{the plan document}}        after the tick of its cycle
///     {"metrics":{..}}                           last
///
/// lane: the one that contains the centre, or null. action: the step of the plan that is active
/// at t ("KS" ..), or null where none is (humans). brake: true or false. turn: "right", "none",
/// "left".
#ifndef VERGE_APPS_RUN_H
#define VERGE_APPS_RUN_H

#include "metrics.h"

void run_write_head(FILE* out, const scenario* scene);
void run_write_tick(FILE* out, const world* world);
void run_write_plan(FILE* out, const world* world, const verge_plan* plan);
void run_write_metrics(FILE* out, const metrics* metrics, bool timing);

#endif
