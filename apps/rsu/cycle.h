/// One planning cycle of the roadside unit, as a function of what was heard before.
///
///     cycle_init(&cycle, &def);
///     cycle_offer(&cycle, &message);          // each message, in the order of arrival
///     cycle_run(&cycle, plan_utime);          // = cycle_begin, cycle_plan, cycle_end
///     for (i < cycle.message_count) publish(cycle.messages[i]);
///
/// Time        No clock is read: messages carry their arrival, a cycle is told its instant. The
///             same messages and instants give the same plans, bit for bit; that is what a
///             recording holds, and why live daemon, replay and tests share this file.
/// Empty road  A cycle that sees no vehicle resets the planner: plans depend on what was heard since
///             then alone, so a recording that begins there can be planned again without the past.
/// Memory      Everything is inside the struct (about 1 MiB: keep it static) and in the planner.
/// Threads     cycle_plan() may run in another thread while cycle_offer() goes on: it touches the
///             planner, the job and the plan, and cycle_offer() touches the inbox alone.
/// Isolation   A vehicle whose state is unusable costs its own plan at most, never another's.
#ifndef VERGE_RSU_CYCLE_H
#define VERGE_RSU_CYCLE_H

#include "verge/inbox.h"
#include "verge/transport.h"
#include "verge/verge.h"

/// What a cycle works with; may be exchanged between two cycles, see cycle_swap().
typedef struct cycle_def {
    verge_planner* planner;         ///< outlives the cycle or the next cycle_swap()
    uint32_t       vehicles_max;    ///< of the planner's def
    uint32_t       controlled_max;  ///< of the planner's def
    inbox_limits   limits;
    int32_t        rsu_id;
} cycle_def;

typedef struct cycle_counters {
    uint64_t planned;   ///< cycles that had somebody to plan for
    uint64_t plans;     ///< plan messages made, cancelled ones not counted
    uint64_t fallbacks; ///< of them, fallbacks
    uint64_t overruns;  ///< of them, made by cycle_overrun()
    uint64_t cancelled; ///< cancelled messages made
    uint64_t unusable;  ///< vehicles left out of a cycle: the planner refuses their values
    uint64_t refused;   ///< cycles the planner refused as a whole: 0 unless we have a defect
} cycle_counters;

/// A cycle may cancel every plan of the one before and issue a whole set of new ones.
enum { CYCLE_MESSAGES_MAX = 2 * VERGE_CONTROLLED_MAX };

typedef struct cycle {
    cycle_def      def;
    inbox          inbox;
    cycle_counters counters;

    // The job: input of cycle_plan().
    int64_t        number;  ///< of this cycle; the first is 0
    int64_t        utime;   ///< [us] the plan's instant
    inbox_view     view;    ///< who takes part

    // The result: output of cycle_plan() and cycle_end().
    verge_status   status;  ///< of the planner's step
    verge_plan     plan;    ///< vehicle_count 0 where there was nobody to plan for
    verge_counters planner_counters; ///< after the last step
    verge_vehicle_plan_t messages[CYCLE_MESSAGES_MAX]; ///< to be published, ordered by vehicle id
    uint32_t       message_count;

    verge_vehicle_plan_t in_force[VERGE_CONTROLLED_MAX]; ///< the last plan of each, not cancelled
    uint32_t       planned_count;
} cycle;

void cycle_init(cycle* self, const cycle_def* def);

/// Another planner or other limits from the next cycle on; what was heard is kept.
void cycle_swap(cycle* self, const cycle_def* def);

/// Takes in a message of kind TRANSPORT_STATE; others are ignored. True: it was accepted, and
/// belongs into a recording. False: refused and counted.
bool cycle_offer(cycle* self, const transport_message* message);

/// Fixes the cycle's number and instant and who takes part. utime need not grow: after a step
/// back of the clock all states and the last plan are forgotten.
void cycle_begin(cycle* self, int64_t number, int64_t utime);
/// Plans for those who take part. The long part of a cycle.
void cycle_plan(cycle* self);
/// Turns the plan into messages: one for each controlled vehicle, and `cancelled` for each that
/// does not take part any more.
void cycle_end(cycle* self);
/// At a tick that finds cycle_plan() still at work in another thread: makes one message for each
/// vehicle being planned for. Its plan in force, elapsed points dropped, as long as two are left;
/// else, where its state is fresh, overrun_brake(). They carry the cycle and digest of the plan
/// they come from (a fallback: this cycle, digest 0) and VERGE_REASON_OVERRUN. Plans are not
/// affected: a recording replays as if there had been no overrun.
void cycle_overrun(cycle* self, int64_t utime);
/// After cycle_end() of a cycle that is late: its messages begin at utime instead of at the
/// cycle's instant, so that they are newer than those of cycle_overrun().
void cycle_retime(cycle* self, int64_t utime);
/// cycle_begin(), cycle_plan() and cycle_end().
void cycle_run(cycle* self, int64_t number, int64_t utime);

/// Makes the messages that end every plan in force, for a daemon that stops. A plan under way in
/// another thread is not touched.
void cycle_cancel_all(cycle* self, int64_t number, int64_t utime);

#endif
