/// Goal: a planning cycle is a function of what was heard and of its instant; every controlled
/// vehicle with a fresh state gets one plan; nobody's bad message costs another anything.
/// Method: a real planner on a straight road with a small budget, synthetic states on a synthetic
/// clock; isolation by comparing with a twin that never heard the bad messages.
#include "check.h"
#include "rng.h"

#include "rsu/cycle.h"
#include "rsu/replay.h"
#include "rsu/timing.h"

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

static unit* unit_start(void)
{
    unit* self = calloc(1, sizeof *self);
    assert_non_null(self);
    const verge_planner_def def = def_small();
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
    for (uint32_t i = 0; i < self->cycle.message_count; i++) {
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

// ---- plans ----------------------------------------------------------------------------------

static void test_every_controlled_vehicle_gets_one_valid_plan_a_cycle(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int k = 0; k < 6; k++) {
        const double t = 0.5 * k;
        for (int32_t id = 0; id < 4; id++) {
            assert_true(hear(self, id, t, id != 2));
        }
        run_at(self, t + 0.05);

        assert_int_equal(self->cycle.message_count, 3);
        for (uint32_t i = 0; i < 3; i++) {
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
    for (int k = 0; k < 5; k++) {
        for (int32_t id = 0; id < 3; id++) {
            hear(one, id, 0.5 * k, true);
            hear(two, 2 - id, 0.5 * k, true); // another order of arrival
        }
        run_at(one, 0.5 * k + 0.1);
        run_at(two, 0.5 * k + 0.1);
        assert_int_equal(one->cycle.message_count, two->cycle.message_count);
        for (uint32_t i = 0; i < one->cycle.message_count; i++) {
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
    for (int k = 1; k < 4; k++) {
        for (int32_t id = 0; id < 3; id++) {
            assert_true(hear(self, id, 0.5 * k, true)); // not out of order
        }
        run_at(self, 0.5 * k + 0.1);
        assert_int_equal(self->cycle.message_count, 3);
        assert_planned(self, 2);
    }
    unit_end(self);
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
    for (int k = 1; k < 8; k++) {
        const double t = 0.5 * k;
        hear(self, 1, t, true); // vehicle 0 is silent
        run_at(self, t + 0.1);
        const verge_vehicle_plan_t* message = message_for(self, 0);
        if (message != NULL) {
            assert_int_equal(message->status, VERGE_CANCELLED);
            assert_int_equal(message->reason, VERGE_REASON_STALE);
            assert_int_equal(message->point_count, 0);
            assert_null(wire_plan_check(message));
            cancelled++;
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

static void test_who_asks_no_more_is_cancelled(void** state)
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
    for (int32_t id = 0; id < 4; id++) {
        hear(self, id, 0.0, id != 2);
    }
    run_at(self, 0.1);
    cycle_cancel_all(&self->cycle, 1, EPOCH + 200000);
    assert_int_equal(self->cycle.message_count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        assert_int_equal(self->cycle.messages[i].status, VERGE_CANCELLED);
        assert_int_equal(self->cycle.messages[i].cycle, 1);
        assert_int_not_equal(self->cycle.messages[i].vehicle_id, 2);
    }
    cycle_cancel_all(&self->cycle, 2, EPOCH + 300000);
    assert_int_equal(self->cycle.message_count, 0);
    unit_end(self);
}

// ---- capacity -------------------------------------------------------------------------------

static void test_who_has_a_plan_keeps_it_when_too_many_ask(void** state)
{
    (void)state;
    unit* self = unit_start();
    for (int32_t id = 5; id < 5 + CONTROLLED_ROOM; id++) {
        assert_true(hear(self, id, 0.0, true));
    }
    run_at(self, 0.1);
    for (int k = 1; k < 4; k++) {
        for (int32_t id = 3; id < 5 + CONTROLLED_ROOM; id++) { // two with lower ids come
            hear(self, id, 0.5 * k, true);
        }
        run_at(self, 0.5 * k + 0.1);
        assert_int_equal(self->cycle.message_count, CONTROLLED_ROOM);
        for (int32_t id = 5; id < 5 + CONTROLLED_ROOM; id++) {
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
    case 2: state.heading = (float)bad; break;
    case 3: state.speed = (float)bad; break;
    case 4: state.acceleration = (float)bad; break;
    case 5: state.length = (float)bad; break;
    case 6: state.width = (float)bad; break;
    case 7: state.utime += 1000000; break;  // the future
    case 8: state.utime -= 60000000; break; // long ago
    case 9: state.y = 200.0; break;         // off the map
    default: state.target_lane = 77; break; // no such lane
    }
    return state;
}

static void test_bad_messages_change_nothing_for_anyone(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("isolation");
    unit* spared = unit_start();
    unit* troubled = unit_start();
    uint64_t bad = 0;
    for (uint32_t k = 0; k < test_rounds(12); k++) {
        const double t = 0.5 * k;
        for (int32_t id = 0; id < 3; id++) {
            hear(spared, id, t, true);
            hear(troubled, id, t, true);
            for (int n = 0; n < 6; n++) { // from the same vehicle, or from a stranger
                const int32_t who = test_rng_below(&rng, 2) == 0 ? id : 40;
                verge_vehicle_state_t spoilt = spoil(&rng, state_at(id, t + 0.01, true));
                spoilt.vehicle_id = who;
                assert_false(offer(troubled, &spoilt, t + 0.01));
                bad++;
            }
            hear(troubled, id, t, true); // a duplicate
            bad++;
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
    state_of_0.speed = -1.0f;
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
    for (uint32_t round = 0; round < test_rounds(200); round++) {
        static timing times;
        memset(&times, 0, sizeof times);
        // Every other round a whole hundred, where the rank is a whole number.
        const uint32_t any = 1 + test_rng_below(&rng, 2 * TIMING_RING);
        const uint32_t count = round % 2 == 0 ? any : 100 * (1 + any % 10);
        static uint32_t all[2 * TIMING_RING];
        uint32_t max = 0;
        for (uint32_t i = 0; i < count; i++) {
            all[i] = test_rng_below(&rng, 100000);
            max = all[i] > max ? all[i] : max;
            timing_add(&times, all[i]);
        }
        // The 99th percentile by its meaning: the smallest value that at least 99 of 100 of the
        // last cycles do not exceed.
        const uint32_t first = count > TIMING_RING ? count - TIMING_RING : 0;
        uint32_t expected = UINT32_MAX;
        for (uint32_t i = first; i < count; i++) {
            uint32_t not_above = 0;
            for (uint32_t j = first; j < count; j++) {
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
    for (uint32_t threads = 1; threads <= 4; threads++) {
        executor* pool = executor_create(threads);
        assert_non_null(pool);
        for (uint32_t round = 0; round < test_rounds(300); round++) {
            tally work;
            memset(&work, 0, sizeof work);
            const uint32_t count = round % 100;
            executor_run(pool, count_task, &work, count);
            for (uint32_t i = 0; i < 100; i++) {
                assert_int_equal(atomic_load(&work.done[i]), i < count ? 1 : 0);
            }
        }
        executor_destroy(pool);
    }
    assert_null(executor_create(0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_controlled_vehicle_gets_one_valid_plan_a_cycle),
        cmocka_unit_test(test_the_same_messages_and_instants_give_the_same_bytes),
        cmocka_unit_test(test_a_cycle_without_vehicles_says_nothing),
        cmocka_unit_test(test_after_a_step_back_of_the_clock_planning_starts_afresh),
        cmocka_unit_test(test_a_vehicle_that_falls_silent_is_cancelled_once),
        cmocka_unit_test(test_a_plan_lives_up_to_the_freshness_limit_and_not_beyond),
        cmocka_unit_test(test_who_asks_no_more_is_cancelled),
        cmocka_unit_test(test_stopping_cancels_every_plan_in_force_and_no_other),
        cmocka_unit_test(test_who_has_a_plan_keeps_it_when_too_many_ask),
        cmocka_unit_test(test_bad_messages_change_nothing_for_anyone),
        cmocka_unit_test(test_each_refusal_is_counted_by_its_name),
        cmocka_unit_test(test_states_go_in_and_plans_come_out_over_a_bus),
        cmocka_unit_test(test_the_ring_of_cycle_times_gives_the_nearest_rank),
        cmocka_unit_test(test_the_pool_runs_every_task_once_and_waits_for_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
