/// One planning cycle of the roadside unit, as a function of the messages received before.
///
///     cycle_init(&cycle, &def);
///     cycle_offer(&cycle, &message);          // each message, in the order of arrival
///     cycle_run(&cycle, plan_utime);          // = cycle_begin, cycle_plan, cycle_end
///     for (i < cycle.message_count) publish(cycle.messages[i]);
///
/// Time        No clock is read: messages carry the time of their arrival, and the caller gives the
///             instant of a cycle. The same messages and instants give the same plans, bit for bit.
///             A recording holds them, and live daemon, replay and tests share this file.
/// Empty road  A cycle without vehicles resets the planner. Later plans depend only on the messages
///             received since then, so a recording that begins there can be replayed.
/// Memory      Everything is inside the struct (about 1 MiB: keep it static) and in the planner.
/// Threads     cycle_plan() may run in another thread while cycle_offer() is called: it uses the
///             planner, the job and the plan; cycle_offer() uses the inbox only.
/// Isolation   A vehicle with an unusable state can lose its own plan, never that of another one.
#ifndef VERGE_RSU_CYCLE_H
#define VERGE_RSU_CYCLE_H

#include "verge/inbox.h"
#include "verge/transport.h"
#include "verge/verge.h"

/// What a cycle is made with. It can be replaced between two cycles, see cycle_swap().
typedef struct cycle_def {
    verge_planner* planner;         ///< outlives the cycle or the next cycle_swap()
    uint32_t       vehicles_max;    ///< of the planner's def
    uint32_t       controlled_max;  ///< of the planner's def
    inbox_limits   limits;
    int32_t        rsu_id;
    uint32_t       map_crc32;       ///< of the planner's road, see wire_map_crc32()
} cycle_def;

typedef struct cycle_counters {
    uint64_t planned;   ///< cycles with at least one controlled vehicle
    uint64_t plans;     ///< plan messages made, without cancellations
    uint64_t fallbacks; ///< of the plans, fallbacks
    uint64_t overruns;  ///< of the plans, made by cycle_overrun()
    uint64_t cancelled; ///< cancellations made
    uint64_t withheld;  ///< messages made, but not sent; in none of the counts above
    uint64_t unusable;  ///< vehicles removed from a cycle: the planner refuses their values
    uint64_t refused;   ///< cycles the planner refused as a whole: 0 unless verge has a defect
    // As in verge_counters, but of all planners that the cycle has had.
    uint64_t unexpanded, candidates, reordered, unstuck;
} cycle_counters;

/// A cycle may cancel every plan of the one before and issue a whole set of new ones.
enum { CYCLE_MESSAGES_MAX = 2 * VERGE_CONTROLLED_MAX };

typedef struct cycle {
    cycle_def      def;
    inbox          inbox;
    cycle_counters counters;

    // The job: input of cycle_plan().
    int64_t        number;  ///< of this cycle; the first is 0
    int64_t        utime;   ///< [us] the instant of the plan
    inbox_view     view;    ///< the vehicles
    uint32_t       signal_count;
    verge_signal   signals[INBOX_SIGNALS_MAX]; ///< what the traffic signals show
    verge_vehicle_fault fault; ///< of the vehicle removed last, see counters.unusable

    // The result: output of cycle_plan() and cycle_end().
    verge_status   status;  ///< of the planner's step
    verge_plan     plan;    ///< vehicle_count 0 without a controlled vehicle
    verge_counters planner_counters; ///< after the last step
    verge_vehicle_plan_t messages[CYCLE_MESSAGES_MAX]; ///< to publish, ordered by vehicle id
    uint32_t       message_count;

    verge_vehicle_plan_t valid_plans[VERGE_CONTROLLED_MAX]; ///< the last plan of each vehicle
    uint32_t       valid_count;
} cycle;

void cycle_init(cycle* self, const cycle_def* def);

/// Sets another planner and other limits for the next cycle. The states received so far are kept if
/// the new road has them.
void cycle_swap(cycle* self, const cycle_def* def);

/// Receives a message of kind TRANSPORT_STATE or TRANSPORT_SIGNAL; others are ignored. True: it was
/// accepted, and has to be recorded. False: it was refused and counted.
bool cycle_offer(cycle* self, const transport_message* message);

/// Sets the number, the instant and the vehicles of the cycle. If utime steps back, all states and
/// the last plan are forgotten.
void cycle_begin(cycle* self, int64_t number, int64_t utime);
/// Plans for the controlled vehicles. The long part of a cycle.
void cycle_plan(cycle* self);
/// Makes the messages: the plan of each controlled vehicle, and a cancellation for each vehicle
/// that had a plan and is not controlled any more.
void cycle_end(cycle* self);
/// At a tick at which cycle_plan() is still running in another thread: makes one message for each
/// controlled vehicle. It is the rest of its valid plan while two points are left, otherwise
/// overrun_brake() if its state is fresh. The messages have the cycle and digest of the plan they
/// are from (a fallback: this cycle, digest 0) and VERGE_REASON_OVERRUN. Planning is not affected:
/// a recording replays as if there had been no overrun.
void cycle_overrun(cycle* self, int64_t utime);
/// After cycle_end() of a late cycle: lets its messages begin at utime instead of the cycle's
/// instant, so that they are newer than those of cycle_overrun().
void cycle_retime(cycle* self, int64_t utime);
/// Message `index` is not sent, because another unit plans for its vehicle: see counters.withheld.
void cycle_withhold(cycle* self, uint32_t index);
/// cycle_begin(), cycle_plan() and cycle_end().
void cycle_run(cycle* self, int64_t number, int64_t utime);

/// Makes the messages that cancel every valid plan, for a daemon that stops. cycle_plan() may be
/// running in another thread.
void cycle_cancel_all(cycle* self, int64_t number, int64_t utime);

#endif
