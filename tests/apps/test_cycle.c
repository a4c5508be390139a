/// Goal: a planning cycle is a function of the received messages and of its instant. Every
/// controlled vehicle with a fresh state gets one plan. A bad message changes no plan.
/// Method: a planner on a straight road with a small budget; synthetic states on a synthetic clock;
/// a second planner that does not receive the bad messages, for comparison.
#include "check.h"
#include "rng.h"

#include "rsu/cycle.h"
#include "rsu/overrun.h"
#include "rsu/replay.h"
#include "daemon/timing.h"

#include "common/executor.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { START = 1700000000, PERIOD_US = 500000, CONTROLLED_ROOM = 3 };
static const int64_t EPOCH = (int64_t)START * 1000000; // [us] any instant of our time

static const double RIGHT[][2] = { { 0.0, 0.0 }, { 600.0, 0.0 } };
static const double LEFT[][2] = { { 0.0, 3.75 }, { 600.0, 3.75 } };

/// t [s] after the epoch. [us]
static int64_t instant(double t)
{
    return EPOCH + llround(t * 1e6);
}

typedef struct unit {
    void*          memory;
    verge_planner* planner;
    cycle          cycle;
} unit;

static verge_planner_def def_small(void)
{
    static const verge_lane_def lanes[] = {
        { .id = 0, .points = RIGHT, .point_count = 2, .width = 3.75, .speed_limit = 20.0,
          .left = 1, .right = VERGE_NO_LANE },
        { .id = 1, .points = LEFT, .point_count = 2, .width = 3.75, .speed_limit = 20.0,
          .left = VERGE_NO_LANE, .right = 0 },
    };
    verge_planner_def def = verge_planner_default_def();
    def.road.lanes = lanes;
    def.road.lane_count = 2;
    def.iterations = 40;
    def.nodes_max = 64;
    def.sample_speeds = 3;
    def.sample_offsets = 8;
    def.controlled_max = CONTROLLED_ROOM;
    def.vehicles_max = 16;
    return def;
}

static unit* unit_start_with(verge_planner_def def)
{
    unit* self = calloc(1, sizeof *self);
    assert_non_null(self);
    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    assert_true(size > 0);
    self->memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self->planner, &def, self->memory, size), VERGE_OK);
    const cycle_def how = {
        .planner = self->planner,
        .vehicles_max = def.vehicles_max,
        .controlled_max = def.controlled_max,
        .limits = inbox_default_limits(),
        .rsu_id = 9,
    };
    cycle_init(&self->cycle, &how);
    return self;
}

static unit* unit_start(void)
{
    return unit_start_with(def_small());
}

static void unit_end(unit* self)
{
    free(self->memory);
    free(self);
}

/// Vehicle id at t [s] after the epoch: 40 m apart, steady 12 m/s, in the right or left lane.
static verge_vehicle_state_t state_at(int32_t id, double t, bool controlled)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = id;
    vehicle.controlled = controlled;
    vehicle.x = 20.0 + 40.0 * id + 12.0 * t;
    vehicle.y = id % 2 == 0 ? 0.0 : 3.75;
    vehicle.speed = 12.0;
    vehicle.target_lane = 0;
    return wire_state_from_vehicle(&vehicle, VERGE_NORMAL, instant(t),
                                   (int32_t)(t * 10.0), -1);
}

static bool offer(unit* self, const verge_vehicle_state_t* state, double arrival)
{
    static transport_message message;
    message.kind = TRANSPORT_STATE;
    message.arrival_utime = instant(arrival);
    message.as.state = *state;
    return cycle_offer(&self->cycle, &message);
}

static bool hear(unit* self, int32_t id, double t, bool controlled)
{
    const verge_vehicle_state_t state = state_at(id, t, controlled);
    return offer(self, &state, t);
}

static void run_at(unit* self, double t)
{
    cycle_run(&self->cycle, self->cycle.number + 1, instant(t));
}

/// The message for a vehicle in the last cycle, null where there is none.
static const verge_vehicle_plan_t* message_for(const unit* self, int32_t id)
{
    const verge_vehicle_plan_t* found = NULL;
    for (uint32_t i = 0; i < self->cycle.message_count; ++i) {
        if (self->cycle.messages[i].vehicle_id == id) {
            assert_null(found); // one message a vehicle a cycle
            found = &self->cycle.messages[i];
        }
    }
    return found;
}

static void assert_planned(const unit* self, int32_t id)
{
    const verge_vehicle_plan_t* message = message_for(self, id);
    if (message == NULL || message->status == VERGE_CANCELLED) {
        fail_msg("vehicle %d has no plan in cycle %" PRId64, id, self->cycle.number);
    }
}

// ---- traffic signals ------------------------------------------------------------------------

static bool show(unit* self, int32_t lane, verge_signal_state state, double t, double change)
{
    static transport_message message;
    message.kind = TRANSPORT_SIGNAL;
    message.arrival_utime = instant(t);
    message.as.signal = (verge_lane_signal_t){
        .utime = instant(t), .change_utime = change < 0.0 ? 0 : instant(change), .lane = lane,
        .state = (int16_t)state, .protocol_version = WIRE_PROTOCOL_VERSION,
    };
    return cycle_offer(&self->cycle, &message);
}

static void test_a_cycle_plans_with_what_the_signals_show_at_its_instant(void** state)
{
    (void)state;
    unit* self = unit_start();
    hear(self, 2, 0.4, true);
    assert_true(show(self, 0, VERGE_SIGNAL_GREEN, 0.0, 2.5));
    assert_true(show(self, 1, VERGE_SIGNAL_OFF, 0.0, -1.0));
    assert_false(show(self, 7, VERGE_SIGNAL_RED, 0.0, -1.0)); // no such lane
    assert_int_equal(self->cycle.inbox.counters.rx_out_of_range, 1);
    run_at(self, 0.5);
    const verge_scene* scene = verge_planner_scene(self->planner);
    assert_int_equal(scene->signal_count, 2);
    assert_int_equal(scene->signals[0].state, VERGE_SIGNAL_GREEN);
    CHECK_NEAR(scene->signals[0].change_s, 2.0, 1e-9);
    hear(self, 2, 2.9, true);
    run_at(self, 3.0); // green is over, and nobody says what it shows now
    scene = verge_planner_scene(self->planner);
    assert_int_equal(scene->signals[0].state, VERGE_SIGNAL_RED);
    assert_int_equal(scene->signals[1].state, VERGE_SIGNAL_OFF);
    assert_int_equal(self->cycle.status, VERGE_OK);
    unit_end(self);
}

static void test_a_plan_names_the_road_and_the_version(void** state)
{
    (void)state;
    unit* self = unit_start();
    self->cycle.def.map_crc32 = 0xc0ffee;
    hear(self, 2, 0.4, true);
    run_at(self, 0.5);
    const verge_vehicle_plan_t* plan = message_for(self, 2);
    assert_non_null(plan);
    assert_int_equal(plan->map_crc32, 0xc0ffee);
    assert_int_equal(plan->protocol_version, WIRE_PROTOCOL_VERSION);
    assert_null(wire_plan_check(plan));
    unit_end(self);
}

// ---- plans ----------------------------------------------------------------------------------

static void test_every_controlled_vehicle_gets_one_valid_plan_a_cycle(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int k = 0; k < 6; ++k) {
        const double t = 0.5 * k;
        for (int32_t id = 0; id < 4; ++id) {
            assert_true(hear(self, id, t, id != 2));
        }
        run_at(self, t + 0.05);

        assert_int_equal(self->cycle.message_count, 3);
        for (uint32_t i = 0; i < 3; ++i) {
            const verge_vehicle_plan_t* message = &self->cycle.messages[i];
            assert_null(wire_plan_check(message));
            assert_int_equal(message->vehicle_id, i < 2 ? (int)i : 3); // ordered by id
            assert_int_equal(message->cycle, k);
            assert_int_equal(message->plans_in_cycle, 3);
            assert_int_equal(message->rsu_id, 9);
            assert_true(message->utime == instant(t + 0.05));
            assert_true(message->valid_until_utime > message->utime);
            assert_true(message->state_utime == instant(t));
            assert_true((uint64_t)message->digest == self->cycle.plan.digest);
            // Point 0 is the state, projected: 50 ms at 12 m/s.
            const verge_vehicle_state_t sent = state_at(message->vehicle_id, t, true);
            CHECK_NEAR(message->points[0].x, sent.x + 0.6, 1e-6);
            CHECK_NEAR(message->points[0].y, sent.y, 1e-6);
        }
        assert_null(message_for(self, 2));
        // What operators see is what was sent.
        assert_int_equal(self->cycle.valid_count, 3);
        assert_memory_equal(self->cycle.valid_plans, self->cycle.messages,
                            3 * sizeof self->cycle.messages[0]);
    }
    assert_int_equal(self->cycle.counters.plans, 18);
    assert_int_equal(self->cycle.counters.refused, 0);
    unit_end(self);
}

static void test_the_same_messages_and_instants_give_the_same_bytes(void** state)
{
    (void)state;
    unit* one = unit_start();
    unit* two = unit_start();
    for (int k = 0; k < 5; ++k) {
        for (int32_t id = 0; id < 3; ++id) {
            hear(one, id, 0.5 * k, true);
            hear(two, 2 - id, 0.5 * k, true); // another order of arrival
        }
        run_at(one, 0.5 * k + 0.1);
        run_at(two, 0.5 * k + 0.1);
        assert_int_equal(one->cycle.message_count, two->cycle.message_count);
        for (uint32_t i = 0; i < one->cycle.message_count; ++i) {
            uint8_t a[2048], b[2048];
            const int size_a = verge_vehicle_plan_t_encode(a, 0, sizeof a, &one->cycle.messages[i]);
            const int size_b = verge_vehicle_plan_t_encode(b, 0, sizeof b, &two->cycle.messages[i]);
            assert_int_equal(size_a, size_b);
            assert_memory_equal(a, b, (size_t)size_a);
        }
    }
    unit_end(one);
    unit_end(two);
}

static void test_a_cycle_without_vehicles_says_nothing(void** state)
{
    (void)state;
    unit* self = unit_start();
    run_at(self, 0.0);
    assert_int_equal(self->cycle.message_count, 0);
    hear(self, 2, 0.4, false);
    run_at(self, 0.5);
    assert_int_equal(self->cycle.message_count, 0);
    assert_int_equal(self->cycle.view.count, 1);
    assert_int_equal(self->cycle.counters.planned, 0);
    unit_end(self);
}

static void test_after_a_step_back_of_the_clock_planning_starts_afresh(void** state)
{
    (void)state;
    unit* self = unit_start();
    hear(self, 0, 10.0, true);
    hear(self, 1, 10.0, true);
    run_at(self, 10.0);
    run_at(self, 0.0); // the clock is corrected by 10 s: what was heard lies in the future
    assert_int_equal(self->cycle.view.count, 0);
    assert_int_equal(self->cycle.message_count, 2);
    assert_int_equal(message_for(self, 0)->status, VERGE_CANCELLED);
    for (int k = 1; k < 4; ++k) {
        for (int32_t id = 0; id < 3; ++id) {
            assert_true(hear(self, id, 0.5 * k, true)); // not out of order
        }
        run_at(self, 0.5 * k + 0.1);
        assert_int_equal(self->cycle.message_count, 3);
        assert_planned(self, 2);
    }
    unit_end(self);
}

static void test_after_an_empty_road_plans_are_those_of_a_unit_that_just_started(void** state)
{
    (void)state;
    unit* old = unit_start();
    unit* fresh = unit_start();
    for (int k = 0; k < 6; ++k) { // other vehicles in the past, all in the lane of the others
        hear(old, 1, 0.5 * k, true);
        hear(old, 2, 0.5 * k, false);
        run_at(old, 0.5 * k + 0.1);
    }
    run_at(old, 10.0); // no vehicle is left
    assert_int_equal(old->cycle.view.count, 0);
    for (int k = 0; k < 6; ++k) {
        const double t = 20.0 + 0.5 * k;
        for (int32_t id = 0; id < 3; ++id) {
            assert_true(hear(old, id, t, id != 2));
            assert_true(hear(fresh, id, t, id != 2));
        }
        run_at(old, t + 0.1);
        run_at(fresh, t + 0.1);
        assert_int_equal(old->cycle.message_count, 2);
        assert_true(old->cycle.plan.digest == fresh->cycle.plan.digest);
    }
    unit_end(old);
    unit_end(fresh);
}

// ---- cancelled ------------------------------------------------------------------------------

static void test_a_vehicle_that_falls_silent_is_cancelled_once(void** state)
{
    (void)state;
    unit* self = unit_start();
    hear(self, 0, 0.0, true);
    hear(self, 1, 0.0, true);
    run_at(self, 0.1);
    uint32_t cancelled = 0;
    for (int k = 1; k < 8; ++k) {
        const double t = 0.5 * k;
        hear(self, 1, t, true); // vehicle 0 is silent
        run_at(self, t + 0.1);
        const verge_vehicle_plan_t* message = message_for(self, 0);
        if (message != NULL) {
            assert_int_equal(message->status, VERGE_CANCELLED);
            assert_int_equal(message->reason, VERGE_REASON_STALE);
            assert_int_equal(message->point_count, 0);
            assert_null(wire_plan_check(message));
            ++cancelled;
            assert_int_equal(k, 1); // at once
        }
        assert_planned(self, 1);
        const bool still_seen = self->cycle.view.count == 2;
        assert_true(still_seen == (t + 0.1 <= 2.0)); // an obstacle up to 2 s
    }
    assert_int_equal(cancelled, 1);
    assert_int_equal(self->cycle.counters.cancelled, 1);

    hear(self, 0, 4.0, true); // and back
    run_at(self, 4.1);
    assert_planned(self, 0);
    unit_end(self);
}

static void test_a_plan_lives_up_to_the_freshness_limit_and_not_beyond(void** state)
{
    (void)state;
    unit* self = unit_start();
    hear(self, 0, 0.0, true);
    run_at(self, 0.3); // 300 ms old: used
    assert_planned(self, 0);
    run_at(self, 0.300001); // older: not
    assert_non_null(message_for(self, 0));
    assert_int_equal(message_for(self, 0)->status, VERGE_CANCELLED);
    unit_end(self);
}

static void test_a_vehicle_that_is_no_longer_controlled_is_cancelled(void** state)
{
    (void)state;
    unit* self = unit_start();
    hear(self, 0, 0.0, true);
    run_at(self, 0.1);
    hear(self, 0, 0.5, false);
    run_at(self, 0.6);
    assert_non_null(message_for(self, 0));
    assert_int_equal(message_for(self, 0)->status, VERGE_CANCELLED);
    assert_int_equal(message_for(self, 0)->reason, VERGE_REASON_NONE);
    run_at(self, 0.7);
    assert_null(message_for(self, 0));
    unit_end(self);
}

static void test_stopping_cancels_every_plan_in_force_and_no_other(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int32_t id = 0; id < 4; ++id) {
        hear(self, id, 0.0, id != 2);
    }
    run_at(self, 0.1);
    cycle_cancel_all(&self->cycle, 1, EPOCH + 200000);
    assert_int_equal(self->cycle.message_count, 3);
    for (uint32_t i = 0; i < 3; ++i) {
        assert_int_equal(self->cycle.messages[i].status, VERGE_CANCELLED);
        assert_int_equal(self->cycle.messages[i].cycle, 1);
        assert_int_not_equal(self->cycle.messages[i].vehicle_id, 2);
    }
    cycle_cancel_all(&self->cycle, 2, EPOCH + 300000);
    assert_int_equal(self->cycle.message_count, 0);
    unit_end(self);
}

static void test_a_message_that_is_not_sent_is_counted_as_withheld_only(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int32_t id = 0; id < 3; ++id) {
        hear(self, id, 0.0, true);
    }
    run_at(self, 0.1);
    const cycle_counters made = self->cycle.counters;
    assert_int_equal(made.plans, 3);
    cycle_withhold(&self->cycle, 1);
    assert_int_equal(self->cycle.counters.plans, 2);
    assert_int_equal(self->cycle.counters.withheld, 1);
    assert_int_equal(self->cycle.valid_count, 3); // it plans on from all of them
    cycle_overrun(&self->cycle, instant(0.3));
    cycle_withhold(&self->cycle, 2);
    assert_int_equal(self->cycle.counters.overruns, 2);
    assert_int_equal(self->cycle.counters.plans, 4);
    assert_int_equal(self->cycle.counters.fallbacks, made.fallbacks);
    cycle_cancel_all(&self->cycle, 1, instant(0.4));
    cycle_withhold(&self->cycle, 0);
    assert_int_equal(self->cycle.counters.cancelled, 2);
    assert_int_equal(self->cycle.counters.withheld, 3);
    unit_end(self);
}

// ---- capacity -------------------------------------------------------------------------------

static void test_planned_vehicles_stay_planned_when_there_are_too_many(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int32_t id = 5; id < 5 + CONTROLLED_ROOM; ++id) {
        assert_true(hear(self, id, 0.0, true));
    }
    run_at(self, 0.1);
    for (int k = 1; k < 4; ++k) {
        for (int32_t id = 3; id < 5 + CONTROLLED_ROOM; ++id) { // two with lower ids come
            hear(self, id, 0.5 * k, true);
        }
        run_at(self, 0.5 * k + 0.1);
        assert_int_equal(self->cycle.message_count, CONTROLLED_ROOM);
        for (int32_t id = 5; id < 5 + CONTROLLED_ROOM; ++id) {
            assert_planned(self, id);
        }
        assert_int_equal(self->cycle.view.count, CONTROLLED_ROOM + 2); // seen all the same
    }
    unit_end(self);
}

// ---- isolation ------------------------------------------------------------------------------

/// Some field of a state gone bad, in one of the ways the field finds hateful.
static verge_vehicle_state_t spoil(test_rng* rng, verge_vehicle_state_t state)
{
    static const double AWFUL[] = { NAN, INFINITY, -INFINITY, 1e300, -1e300, 1e7 };
    const double bad = AWFUL[test_rng_below(rng, sizeof AWFUL / sizeof AWFUL[0])];
    switch (test_rng_below(rng, 11)) {
    case 0: state.x = bad; break;
    case 1: state.y = bad; break;
    case 2: state.heading = INFINITY; break;
    case 3: state.speed = INFINITY; break;
    case 4: state.acceleration = -INFINITY; break;
    case 5: state.length = (float)bad; break;
    case 6: state.width = (float)bad; break;
    case 7: state.utime += 1000000; break;  // the future
    case 8: state.utime -= 60000000; break; // long ago
    case 9: state.y = 200.0; break;         // off the map
    default: state.habit = 5; break;        // no such habit
    }
    return state;
}

/// Three vehicles on their way along the road, a unit that hears only them, and one that hears bad
/// messages as well.
static void drive_with_bad_messages(test_rng* rng)
{
    unit* spared = unit_start();
    unit* troubled = unit_start();
    uint64_t bad = 0;
    for (uint32_t k = 0; k < 12; ++k) {
        const double t = 0.5 * k;
        for (int32_t id = 0; id < 3; ++id) {
            hear(spared, id, t, true);
            hear(troubled, id, t, true);
            for (int n = 0; n < 6; ++n) { // from the same vehicle, or from an unknown sender
                const int32_t who = test_rng_below(rng, 2) == 0 ? id : 40;
                verge_vehicle_state_t spoilt = spoil(rng, state_at(id, t + 0.01, true));
                spoilt.vehicle_id = who;
                assert_false(offer(troubled, &spoilt, t + 0.01));
                ++bad;
            }
            hear(troubled, id, t, true); // a duplicate
            ++bad;
        }
        run_at(spared, t + 0.1);
        run_at(troubled, t + 0.1);
        assert_int_equal(troubled->cycle.message_count, 3);
        assert_true(troubled->cycle.plan.digest == spared->cycle.plan.digest);
    }
    const inbox_counters* rx = &troubled->cycle.inbox.counters;
    assert_int_equal(rx->rx_accepted, spared->cycle.inbox.counters.rx_accepted);
    assert_int_equal(rx->rx_stale + rx->rx_future + rx->rx_duplicate + rx->rx_out_of_order +
                         rx->rx_out_of_range + rx->rx_off_map + rx->rx_over_capacity +
                         rx->rx_id_conflict,
                     bad);
    unit_end(spared);
    unit_end(troubled);
}

static void test_bad_messages_change_no_plan(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("isolation");
    for (uint32_t round = 0; round < test_rounds(2); ++round) {
        drive_with_bad_messages(&rng);
    }
}

static void test_each_refusal_is_counted_by_its_name(void** state)
{
    (void)state;
    unit* self = unit_start();
    const inbox_counters* rx = &self->cycle.inbox.counters;
    hear(self, 0, 1.0, true);
    assert_int_equal(rx->rx_accepted, 1);
    hear(self, 0, 1.0, true);
    assert_int_equal(rx->rx_duplicate, 1);
    verge_vehicle_state_t state_of_0 = state_at(0, 0.9, true);
    offer(self, &state_of_0, 1.1);
    assert_int_equal(rx->rx_out_of_order, 1);
    state_of_0 = state_at(0, 1.2, true);
    offer(self, &state_of_0, 1.1);
    assert_int_equal(rx->rx_future, 1);
    state_of_0 = state_at(0, 1.1, true);
    offer(self, &state_of_0, 4.0);
    assert_int_equal(rx->rx_stale, 1);
    state_of_0.speed = -15.5f;
    offer(self, &state_of_0, 1.1);
    assert_int_equal(rx->rx_out_of_range, 1);
    state_of_0 = state_at(0, 1.1, true);
    state_of_0.x += 100.0;
    offer(self, &state_of_0, 1.1);
    assert_int_equal(rx->rx_id_conflict, 1);
    verge_vehicle_state_t stranger = state_at(1, 1.1, true);
    stranger.y = 50.0;
    offer(self, &stranger, 1.1);
    assert_int_equal(rx->rx_off_map, 1);
    unit_end(self);
}

static void test_a_vehicle_that_leaves_the_map_is_used_once_more_and_strangers_never(void** state)
{
    (void)state;
    unit* self = unit_start();
    const inbox_counters* rx = &self->cycle.inbox.counters;
    hear(self, 0, 0.0, true);
    hear(self, 2, 0.0, false);
    run_at(self, 0.1);
    assert_int_equal(self->cycle.view.count, 2);
    run_at(self, 0.2); // reports what the cycle at 0.1 s found
    for (int32_t id = 100; id < 140; ++id) { // beside the road, more than the inbox has slots
        verge_vehicle_state_t stranger = state_at(0, 0.3, false);
        stranger.vehicle_id = id;
        stranger.y = 40.0;
        assert_false(offer(self, &stranger, 0.3));
    }
    assert_int_equal(rx->rx_off_map, 40);
    assert_int_equal(rx->rx_over_capacity, 0);
    hear(self, 0, 0.4, true);
    verge_vehicle_state_t leaving = state_at(2, 0.4, false);
    leaving.y = -5.0;
    assert_true(offer(self, &leaving, 0.4));
    run_at(self, 0.5);
    assert_int_equal(self->cycle.view.count, 2);
    assert_int_equal(self->cycle.message_count, 1);
    run_at(self, 0.6); // reports that the cycle at 0.5 s found vehicle 2 on no lane
    leaving = state_at(2, 0.7, false);
    leaving.y = -6.0;
    assert_false(offer(self, &leaving, 0.7));
    assert_int_equal(rx->rx_off_map, 41);
    hear(self, 0, 2.5, true);
    run_at(self, 2.5);
    assert_int_equal(self->cycle.view.count, 1); // the state of vehicle 2 is older than drop_ms
    unit_end(self);
}

// ---- over a bus, and from a recording -------------------------------------------------------

static void test_states_go_in_and_plans_come_out_over_a_bus(void** state)
{
    (void)state;
    char error[256];
    static transport_message batch[16];
    transport *vehicle = NULL, *unit_end_of_bus = NULL;
    assert_int_equal(
        transport_open(&vehicle, "loop:cycle", TRANSPORT_PLANS, error, sizeof error), 0);
    assert_int_equal(
        transport_open(&unit_end_of_bus, "loop:cycle", TRANSPORT_STATES, error, sizeof error), 0);
    unit* self = unit_start();

    const verge_vehicle_state_t sent = state_at(4, 0.0, true);
    assert_int_equal(transport_publish_state(vehicle, &sent), 0);
    assert_int_equal(transport_drain(unit_end_of_bus, batch, 16), 1);
    batch[0].arrival_utime = EPOCH; // the clock of this test
    assert_true(cycle_offer(&self->cycle, &batch[0]));
    run_at(self, 0.1);
    assert_int_equal(self->cycle.message_count, 1);
    assert_int_equal(transport_publish_plan(unit_end_of_bus, &self->cycle.messages[0]), 0);

    assert_int_equal(transport_drain(vehicle, batch, 16), 1);
    assert_int_equal(batch[0].kind, TRANSPORT_PLAN);
    assert_int_equal(batch[0].as.plan.vehicle_id, 4);
    assert_null(wire_plan_check(&batch[0].as.plan));
    unit_end(self);
    transport_close(unit_end_of_bus);
    transport_close(vehicle);
}

static void test_the_ring_of_cycle_times_gives_the_nearest_rank(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("timing");
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        static timing times;
        memset(&times, 0, sizeof times);
        // Every other round a whole hundred, where the rank is a whole number.
        const uint32_t any = 1 + test_rng_below(&rng, 2 * TIMING_RING);
        const uint32_t count = round % 2 == 0 ? any : 100 * (1 + any % 10);
        static uint32_t all[2 * TIMING_RING];
        uint32_t max = 0;
        for (uint32_t i = 0; i < count; ++i) {
            all[i] = test_rng_below(&rng, 100000);
            max = all[i] > max ? all[i] : max;
            timing_add(&times, all[i]);
        }
        // The 99th percentile by its meaning: the smallest value that at least 99 of 100 of the
        // last cycles do not exceed.
        const uint32_t first = count > TIMING_RING ? count - TIMING_RING : 0;
        uint32_t expected = UINT32_MAX;
        for (uint32_t i = first; i < count; ++i) {
            uint32_t not_above = 0;
            for (uint32_t j = first; j < count; ++j) {
                not_above += all[j] <= all[i] ? 1 : 0;
            }
            if (100 * not_above >= 99 * (count - first) && all[i] < expected) {
                expected = all[i];
            }
        }
        assert_int_equal(timing_p99(&times), expected);
        assert_int_equal(times.max, max);
        assert_int_equal(times.last, all[count - 1]);
    }
}

typedef struct tally {
    atomic_uint done[100];
} tally;

static void count_task(void* arg, uint32_t index)
{
    atomic_fetch_add(&((tally*)arg)->done[index], 1);
}

static void test_the_pool_runs_every_task_once_and_waits_for_it(void** state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 4; ++threads) {
        executor* pool = executor_create(threads);
        assert_non_null(pool);
        for (uint32_t round = 0; round < test_rounds(300); ++round) {
            tally work;
            memset(&work, 0, sizeof work);
            const uint32_t count = round % 100;
            executor_run(pool, count_task, &work, count);
            for (uint32_t i = 0; i < 100; ++i) {
                assert_int_equal(atomic_load(&work.done[i]), i < count ? 1 : 0);
            }
        }
        executor_destroy(pool);
    }
    assert_null(executor_create(0));
}

// ---- overruns -------------------------------------------------------------------------------

enum { TOLD = 3 }; // vehicles 0, 1 and 3 ask for plans; 2 does not

static void hear_all(unit* self, double t)
{
    for (int32_t id = 0; id < 4; ++id) {
        assert_true(hear(self, id, t, id != 2));
    }
}

/// A cycle at 0.05 s that was in time, one at 0.55 s whose planning is still under way.
static unit* unit_late(verge_vehicle_plan_t planned[TOLD])
{
    unit* self = unit_start();
    hear_all(self, 0.0);
    run_at(self, 0.05);
    assert_int_equal(self->cycle.message_count, TOLD);
    memcpy(planned, self->cycle.messages, TOLD * sizeof planned[0]);
    hear_all(self, 0.5);
    cycle_begin(&self->cycle, 1, instant(0.55));
    return self;
}

static void test_an_overrun_sends_the_remaining_points_of_each_plan_unchanged(void** state)
{
    (void)state;
    static const struct { double t; int32_t dropped; } CASES[] = {
        { 1.05, 10 }, { 1.149, 10 }, { 1.15, 11 }, { 2.94, 28 }, { 2.95, 29 },
    };
    static verge_vehicle_plan_t planned[TOLD];
    unit* self = unit_late(planned);
    for (size_t c = 0; c < sizeof CASES / sizeof CASES[0]; ++c) {
        const int32_t dropped = CASES[c].dropped;
        cycle_overrun(&self->cycle, instant(CASES[c].t));
        assert_int_equal(self->cycle.message_count, TOLD);
        for (uint32_t i = 0; i < TOLD; ++i) {
            const verge_vehicle_plan_t* rest = &self->cycle.messages[i];
            const verge_vehicle_plan_t* from = &planned[i];
            assert_null(wire_plan_check(rest));
            assert_int_equal(rest->vehicle_id, from->vehicle_id);
            assert_true(rest->utime == from->utime + dropped * 100000);
            assert_true(rest->utime <= instant(CASES[c].t));
            assert_true(rest->valid_until_utime == from->valid_until_utime);
            assert_int_equal(rest->point_count, from->point_count - dropped);
            assert_memory_equal(rest->points, from->points + dropped,
                                (size_t)rest->point_count * sizeof rest->points[0]);
            assert_int_equal(rest->cycle, 0);
            assert_true(rest->digest == from->digest && rest->state_utime == from->state_utime);
            assert_int_equal(rest->status, from->status);
            assert_int_equal(rest->reason, VERGE_REASON_OVERRUN);
            assert_int_equal(rest->plans_in_cycle, TOLD);
            // The lights and the words at an instant are those of the whole plan.
            const verge_plan_action_t* now = wire_action_at(rest, rest->utime);
            const verge_plan_action_t* then = wire_action_at(from, rest->utime);
            assert_true(now != NULL && now->action == then->action && now->lane == then->lane);
            const verge_plan_action_t* last = &rest->actions[rest->action_count - 1];
            assert_int_equal(last->t1_ms + dropped * 100,
                             from->actions[from->action_count - 1].t1_ms);
        }
    }
    assert_int_equal(self->cycle.counters.overruns, TOLD * 5);
    unit_end(self);
}

static void test_where_no_plan_is_left_an_overrun_brakes_from_the_newest_state(void** state)
{
    (void)state;
    static verge_vehicle_plan_t planned[TOLD];
    unit* self = unit_late(planned);
    hear_all(self, 3.0);
    assert_true(hear(self, 1, 3.04, true)); // its newest
    const uint64_t fallbacks = self->cycle.counters.fallbacks;
    cycle_overrun(&self->cycle, instant(3.06));
    assert_int_equal(self->cycle.message_count, TOLD);
    assert_int_equal(self->cycle.counters.fallbacks, fallbacks + TOLD);
    for (uint32_t i = 0; i < TOLD; ++i) {
        const verge_vehicle_plan_t* plan = &self->cycle.messages[i];
        assert_null(wire_plan_check(plan));
        assert_int_equal(plan->status, VERGE_FALLBACK_BRAKE);
        assert_int_equal(plan->reason, VERGE_REASON_OVERRUN);
        assert_int_equal(plan->cycle, 1); // the one that is late
        assert_true(plan->digest == 0 && plan->utime == instant(3.06));
        assert_true(plan->state_utime == instant(plan->vehicle_id == 1 ? 3.04 : 3.0));
        const verge_vehicle_state_t now = state_at(plan->vehicle_id, 3.06, true);
        CHECK_NEAR(plan->points[0].x, now.x, 1e-6);
        CHECK_NEAR(plan->points[0].y, now.y, 1e-6);
        CHECK_NEAR((double)plan->points[0].speed, 12.0, 1e-6);
        CHECK_NEAR((double)plan->points[30].speed, 3.9, 0.2); // 3 m/s^2 after the jerk's ramp
        assert_int_equal(plan->actions[0].brake_light, 1);
        for (int32_t k = 1; k < plan->point_count; ++k) {
            const verge_plan_point_t *a = &plan->points[k - 1], *b = &plan->points[k];
            const double way = 0.05 * (double)(a->speed + b->speed);
            CHECK_NEAR(b->x - a->x, way, 1e-4);
            CHECK_NEAR(b->y, now.y, 1e-6);
            assert_true(b->speed < a->speed && (double)b->acceleration >= -3.0 - 1e-6);
        }
    }
    // The next overrun goes on with it, so that a vehicle brakes once and not anew each time.
    cycle_overrun(&self->cycle, instant(3.56));
    assert_int_equal(self->cycle.message_count, TOLD);
    assert_true(self->cycle.messages[0].utime == instant(3.56));
    assert_int_equal(self->cycle.messages[0].point_count, 26);
    // And stopping cancels it.
    cycle_cancel_all(&self->cycle, 2, instant(3.6));
    assert_int_equal(self->cycle.message_count, TOLD);
    unit_end(self);
}

static void test_a_newcomer_brakes_and_a_silent_vehicle_is_left_to_its_cancellation(void** state)
{
    (void)state;
    unit* self = unit_start();
    assert_true(hear(self, 0, 0.0, true));
    run_at(self, 0.05);
    assert_true(hear(self, 0, 0.5, true));
    assert_true(hear(self, 1, 0.5, true)); // never planned before
    cycle_begin(&self->cycle, 1, instant(0.55));
    cycle_overrun(&self->cycle, instant(0.75));
    assert_int_equal(self->cycle.message_count, 2);
    assert_int_equal(message_for(self, 0)->status, VERGE_PLANNED);
    assert_int_equal(message_for(self, 1)->status, VERGE_FALLBACK_BRAKE);
    cycle_overrun(&self->cycle, instant(4.0)); // both plans are over, no state since
    assert_int_equal(self->cycle.message_count, 0);
    cycle_plan(&self->cycle);
    cycle_end(&self->cycle);
    run_at(self, 4.1);
    assert_int_equal(message_for(self, 0)->status, VERGE_CANCELLED);
    assert_int_equal(message_for(self, 1)->status, VERGE_CANCELLED);
    unit_end(self);
}

static void test_a_vehicle_across_its_lane_turns_along_it_while_it_brakes(void** state)
{
    (void)state;
    unit* self = unit_start();
    verge_vehicle now = verge_vehicle_default();
    now.id = 5;
    now.x = 100.0;
    now.y = 1.0;
    now.heading = 0.12;
    now.speed = 10.0;
    now.acceleration = -2.0;
    const wire_plan_header header = { .utime = instant(1.0), .state_utime = instant(0.9) };
    const verge_road* road = verge_planner_road(self->planner);
    verge_vehicle_plan_t plan = overrun_brake(&header, &now, road);
    assert_null(wire_plan_check(&plan));
    CHECK_NEAR((double)plan.points[0].heading, 0.12, 1e-6);
    CHECK_NEAR((double)plan.points[30].heading, 0.0, 1e-6);
    assert_int_equal(plan.actions[0].lane, 0);
    for (int32_t k = 1; k < plan.point_count; ++k) {
        const verge_plan_point_t *a = &plan.points[k - 1], *b = &plan.points[k];
        const double way = hypot(b->x - a->x, b->y - a->y);
        // It goes where it points, and turns as it says.
        CHECK_NEAR(atan2(b->y - a->y, b->x - a->x),
                   0.5 * (double)(a->heading + b->heading), way > 0.0 ? 0.01 : 10.0);
        CHECK_NEAR((double)(b->heading - a->heading), (double)a->curvature * way, 0.01);
        assert_true(b->y < 1.875 && b->y >= 1.0); // it stays in its lane
    }
    assert_true(plan.points[30].speed < 2.0f);

    now.y = 40.0; // on no lane: straight ahead
    plan = overrun_brake(&header, &now, road);
    assert_null(wire_plan_check(&plan));
    assert_int_equal(plan.actions[0].lane, VERGE_NO_LANE);
    CHECK_NEAR((double)plan.points[30].heading, 0.12, 1e-6);
    now.x = 598.0; // the road's end: straight on
    now.y = 0.0;
    now.heading = 0.0;
    plan = overrun_brake(&header, &now, road);
    assert_null(wire_plan_check(&plan));
    assert_true(plan.points[30].x > 605.0);
    now.speed = 0.0; // it stands
    plan = overrun_brake(&header, &now, road);
    assert_null(wire_plan_check(&plan));
    assert_true(plan.points[30].x == plan.points[0].x);
    unit_end(self);
}

static void test_a_late_plan_begins_with_its_first_point_that_is_not_over(void** state)
{
    (void)state;
    static verge_vehicle_plan_t planned[TOLD];
    unit* self = unit_late(planned);
    cycle_overrun(&self->cycle, instant(1.05));
    const int64_t told = self->cycle.messages[0].utime;
    cycle_plan(&self->cycle);
    cycle_end(&self->cycle);
    static verge_vehicle_plan_t whole[TOLD];
    memcpy(whole, self->cycle.messages, sizeof whole);
    cycle_retime(&self->cycle, instant(1.27));
    for (uint32_t i = 0; i < TOLD; ++i) {
        const verge_vehicle_plan_t* late = &self->cycle.messages[i];
        assert_null(wire_plan_check(late));
        assert_true(late->utime == instant(1.25) && late->utime > told);
        assert_memory_equal(late->points, whole[i].points + 7, sizeof late->points[0]);
        assert_int_equal(late->cycle, 1);
        assert_true(late->digest == whole[i].digest && late->reason == whole[i].reason);
    }
    unit_end(self);
}

static void test_overruns_do_not_change_a_plan(void** state)
{
    (void)state;
    unit* in_time = unit_start();
    unit* late = unit_start();
    for (int k = 0; k < 8; ++k) {
        const double t = 0.5 * k;
        hear_all(in_time, t);
        hear_all(late, t);
        run_at(in_time, t + 0.05);
        cycle_begin(&late->cycle, k, instant(t + 0.05));
        for (int n = 0; n <= k; ++n) {
            cycle_overrun(&late->cycle, instant(t + 0.1 + n));
        }
        cycle_plan(&late->cycle);
        cycle_end(&late->cycle);
        assert_true(in_time->cycle.plan.digest == late->cycle.plan.digest);
        assert_int_equal(in_time->cycle.message_count, late->cycle.message_count);
    }
    unit_end(in_time);
    unit_end(late);
}

/// One lane after another. Only on a road of several lanes in sequence are standing vehicles watched.
static verge_planner_def def_street(void)
{
    static const double first[][2] = { { 0.0, 0.0 }, { 300.0, 0.0 } };
    static const double second[][2] = { { 300.0, 0.0 }, { 600.0, 0.0 } };
    static const verge_lane_def lanes[] = {
        { .id = 0, .points = first, .point_count = 2, .width = 3.75, .speed_limit = 20.0,
          .left = VERGE_NO_LANE, .right = VERGE_NO_LANE, .successors = { 1 },
          .successor_count = 1 },
        { .id = 1, .points = second, .point_count = 2, .width = 3.75, .speed_limit = 20.0,
          .left = VERGE_NO_LANE, .right = VERGE_NO_LANE },
    };
    verge_planner_def def = def_small();
    def.road.lanes = lanes;
    return def;
}

/// A controlled vehicle stands on the free road and follows no plan, for four seconds.
static void stand(unit* self, double from)
{
    for (int32_t k = 0; k < 8; ++k) {
        const double t = from + 0.5 * k;
        verge_vehicle_state_t state = state_at(2, t, true);
        state.x = 100.0;
        state.speed = 0.0f;
        assert_true(offer(self, &state, t));
        cycle_run(&self->cycle, k, instant(t));
    }
}

static void test_counters_of_the_planner_go_on_with_another_planner(void** state)
{
    (void)state;
    unit* self = unit_start_with(def_street());
    stand(self, 1.0);
    assert_int_equal(self->cycle.counters.unstuck, 1);
    assert_int_equal(self->cycle.counters.reordered, 0);
    const uint64_t candidates = self->cycle.counters.candidates;
    assert_true(candidates > 0);
    unit* other = unit_start_with(def_street());
    cycle_def def = self->cycle.def;
    def.planner = other->planner;
    cycle_swap(&self->cycle, &def);
    assert_int_equal(self->cycle.counters.unstuck, 1);
    stand(self, 5.0);
    assert_int_equal(self->cycle.counters.unstuck, 2);
    assert_int_equal(verge_planner_counters(other->planner).unstuck, 1);
    assert_int_equal(self->cycle.counters.candidates,
                     candidates + verge_planner_counters(other->planner).candidates);
    unit_end(other);
    unit_end(self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_cycle_plans_with_what_the_signals_show_at_its_instant),
        cmocka_unit_test(test_a_plan_names_the_road_and_the_version),
        cmocka_unit_test(test_every_controlled_vehicle_gets_one_valid_plan_a_cycle),
        cmocka_unit_test(test_the_same_messages_and_instants_give_the_same_bytes),
        cmocka_unit_test(test_a_cycle_without_vehicles_says_nothing),
        cmocka_unit_test(test_after_an_empty_road_plans_are_those_of_a_unit_that_just_started),
        cmocka_unit_test(test_after_a_step_back_of_the_clock_planning_starts_afresh),
        cmocka_unit_test(test_a_vehicle_that_falls_silent_is_cancelled_once),
        cmocka_unit_test(test_a_plan_lives_up_to_the_freshness_limit_and_not_beyond),
        cmocka_unit_test(test_a_vehicle_that_is_no_longer_controlled_is_cancelled),
        cmocka_unit_test(test_stopping_cancels_every_plan_in_force_and_no_other),
        cmocka_unit_test(test_a_message_that_is_not_sent_is_counted_as_withheld_only),
        cmocka_unit_test(test_planned_vehicles_stay_planned_when_there_are_too_many),
        cmocka_unit_test(test_bad_messages_change_no_plan),
        cmocka_unit_test(test_a_vehicle_that_leaves_the_map_is_used_once_more_and_strangers_never),
        cmocka_unit_test(test_each_refusal_is_counted_by_its_name),
        cmocka_unit_test(test_states_go_in_and_plans_come_out_over_a_bus),
        cmocka_unit_test(test_an_overrun_sends_the_remaining_points_of_each_plan_unchanged),
        cmocka_unit_test(test_where_no_plan_is_left_an_overrun_brakes_from_the_newest_state),
        cmocka_unit_test(test_a_newcomer_brakes_and_a_silent_vehicle_is_left_to_its_cancellation),
        cmocka_unit_test(test_a_vehicle_across_its_lane_turns_along_it_while_it_brakes),
        cmocka_unit_test(test_a_late_plan_begins_with_its_first_point_that_is_not_over),
        cmocka_unit_test(test_overruns_do_not_change_a_plan),
        cmocka_unit_test(test_the_ring_of_cycle_times_gives_the_nearest_rank),
        cmocka_unit_test(test_the_pool_runs_every_task_once_and_waits_for_it),
        cmocka_unit_test(test_counters_of_the_planner_go_on_with_another_planner),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
