/// See progress.h.
#include "progress.h"

#include <stdio.h>
#include <string.h>

static bool changes(printed_plan* last, const verge_vehicle_plan* plan);
static void plan_print(double time, const verge_vehicle_plan_t* message,
                       const verge_vehicle_plan* plan);

void progress_init(progress* self, const char* bus, bool quiet, bool all, int64_t now_us)
{
    *self = (progress){ .bus = bus, .quiet = quiet, .all = all, .received_us = now_us };
}

void progress_plan(progress* self, uint32_t index, double time,
                   const verge_vehicle_plan_t* message, const verge_vehicle_plan* plan,
                   int64_t now_us)
{
    if (self->silent) {
        fprintf(stderr, "verge-publish: plans are received, after %.1f s\n",
                (double)(now_us - self->received_us) * 1e-6);
    }
    self->silent = false;
    self->received = true;
    self->received_us = now_us;
    const bool changed = changes(&self->last[index], plan);
    if (!self->quiet && (changed || self->all)) {
        plan_print(time, message, plan);
    }
}

void progress_silence(progress* self, bool expected, int64_t now_us)
{
    const int64_t most = self->received ? PROGRESS_SILENCE_US : PROGRESS_SILENCE_FIRST_US;
    if (!expected) {
        self->received_us = now_us; // no vehicle waits for a plan
        return;
    }
    if (self->silent || now_us - self->received_us < most) {
        return;
    }
    self->silent = true;
    fprintf(stderr, "verge-publish: no plan for %d s on %s; expected a verge-rsu on this bus, with"
                    " this road and this clock (verge-echo shows what is on the bus, verge-ctl"
                    " status what the daemon refuses)\n", (int)(most / 1000000), self->bus);
}

/// Compares the plan with the last one and stores it.
static bool changes(printed_plan* last, const verge_vehicle_plan* plan)
{
    const bool         acts = plan->action_count > 0;
    const printed_plan now = {
        .printed = true,
        .status = (int32_t)plan->status,
        .reason = (int32_t)plan->reason,
        .action = acts ? (int32_t)plan->actions[0].action : -1,
        .lane = acts ? plan->actions[plan->action_count - 1].lane_id : VERGE_NO_LANE,
    };
    const bool same = last->printed && last->status == now.status && last->reason == now.reason &&
                      last->action == now.action && last->lane == now.lane;
    *last = now;
    return !same;
}

static const char* status_word(int32_t status)
{
    static const char* const WORDS[] = { "planned", "keeps lane", "brakes", "cancelled" };
    return WORDS[status];
}

/// One line: vehicle, cycle, actions, the first action in words, and the state at the end.
static void plan_print(double time, const verge_vehicle_plan_t* message,
                       const verge_vehicle_plan* plan)
{
    printf("%6.1f s  vehicle %-3d cycle %-4d %-10s", time, plan->vehicle_id, message->cycle,
           status_word(message->status));
    for (uint32_t i = 0; i < plan->action_count; ++i) {
        printf(" %s", verge_action_name(plan->actions[i].action));
    }
    if (plan->action_count > 0) {
        char say[200];
        verge_plan_say(plan, say, sizeof say);
        const verge_action_step* last = &plan->actions[plan->action_count - 1];
        printf("  (%s; lane %d, %.1f m/s in %.1f s)", say, last->lane_id, last->v, last->t1);
    }
    if (plan->status != VERGE_PLANNED && plan->reason != VERGE_REASON_NONE) {
        printf("  %s", verge_reason_text(plan->reason));
    }
    printf("\n");
    fflush(stdout);
}
