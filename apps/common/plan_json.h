/// The plan document, format "verge-plan/1": what verge-plan prints and a run file carries per
/// planning cycle. `status` is "planned" or "fallback"; a fallback also has `fallback`
/// ("keep_lane" or "brake") and `reason`, a sentence. Of each vehicle also:
///
///     "why": null or {"code": "merge", "text": .., "vehicle": 3, "area": 7}   what it waits for,
///            or why it makes no lane change: code verge_why_name(), id of the vehicle, id of the
///            lane
///     "passes": [{"area": [7, 9], "after": 3}]   conflict areas ahead: its lane there and that of
///            the vehicle that goes through it directly before
///     "changed": what is new: "first", "status", "action", "why", "order"
///
/// Of each prediction also what the vehicle may be about to do, null where nothing is known:
///
///     "hypotheses": {"keeps_on": 0.8, "speeds_up": 0.15, "yields": 0, "insists": 0,
///                    "changes_lane": 0.05}   how likely each is; the sum is 1
///
/// `search`.`conflicts` is the number of planned vehicles that the decision leaves in a conflict.
///
/// `say` of the first action ends with the reason in words.
#ifndef VERGE_APPS_PLAN_JSON_H
#define VERGE_APPS_PLAN_JSON_H

#include "verge/plan.h"

#include <stdio.h>

typedef enum plan_layout {
    PLAN_ONE_LINE, ///< no newline at all, for JSON Lines
    PLAN_READABLE, ///< a line per action and point, and a newline at the end
} plan_layout;

/// scenario: the document's name for it; dt: between trajectory points [s].
void plan_write(FILE* out, const verge_plan* plan, const char* scenario, double dt,
                plan_layout layout);

/// "right", "none" or "left".
const char* turn_signal_name(int32_t turn_signal);

#endif
