/// Goal: of two roadside units that plan the same vehicles one sends, by rule; the other one takes
/// over when the first is silent, and gives back when it returns, without switching back and forth.
/// Method: units in a world of one millisecond steps; each hears the messages of the others, and on
/// a bus that loops back its own as well. Every plan that is sent is written down.
#include "check.h"

#include "rsu/peers.h"
#include "rsu/status.h"

#include "verge/wire.h"

#include <string.h>

enum { UNITS = 3, VEHICLES = 3, LOG_MAX = 20000, PERIOD_MS = 500 };

typedef struct unit {
    peers     peers;
    int64_t   begun_ms;    // start; 0: does not run
    int64_t   phase_ms;    // of its ticks
    int64_t   period_ms;
    int64_t   status_ms;   // when the last status was sent
    bool      running, deaf[UNITS]; // deaf: hears nothing of that unit
    unsigned  vehicles;    // which it plans, bits
    unsigned  loses;       // of its messages every n-th is lost; 0: none
    unsigned  messages;
    int32_t   cycle;
    unsigned  cancelled;   // cancellations sent
} unit;

typedef struct sending {
    int64_t  ms;
    unsigned unit, vehicle;
} sending;

static struct {
    unit     units[UNITS];
    int64_t  ms;
    bool     loops_back;
    sending  log[LOG_MAX];
    unsigned log_count;
} world;

static int64_t now_us(void)
{
    return world.ms * 1000;
}

static void hear(unsigned to, unsigned from, const transport_message* message);

static void broadcast(unsigned from, const transport_message* message)
{
    unit* sender = &world.units[from];
    sender->messages++;
    if (sender->loses != 0 && sender->messages % sender->loses == 0) {
        return;
    }
    for (unsigned to = 0; to < UNITS; ++to) {
        if (world.units[to].running && (to != from || world.loops_back)) {
            hear(to, from, message);
        }
    }
}

static void send_status(unsigned index, int state)
{
    static transport_message message; // large
    unit* self = &world.units[index];
    self->status_ms = world.ms;
    message.kind = TRANSPORT_STATUS;
    message.as.status = (verge_rsu_status_t){
        .utime = now_us(), .start_utime = self->peers.def.start_utime, .cycle = self->cycle,
        .rsu_id = self->peers.def.rsu_id, .map_crc32 = (int32_t)self->peers.def.map_crc32,
        .state = (int16_t)state,
    };
    broadcast(index, &message);
}

/// As the daemon: whom it hears for the first time hears it at once.
static void hear(unsigned to, unsigned from, const transport_message* message)
{
    unit* self = &world.units[to];
    if (!self->deaf[from] && peers_offer(&self->peers, message, now_us()) != NULL) {
        send_status(to, RSU_RUNNING);
    }
}

static verge_vehicle_plan_t plan_of(const unit* self, unsigned vehicle)
{
    const wire_plan_header header = {
        .utime = now_us(), .valid_until_utime = now_us() + 100000, .state_utime = now_us(),
        .rsu_id = self->peers.def.rsu_id, .cycle = self->cycle,
    };
    verge_vehicle_plan_t plan = wire_plan_cancelled(&header, (int32_t)vehicle, VERGE_REASON_NONE);
    plan.status = VERGE_PLANNED;
    plan.point_count = 2;
    plan.dt_ms = 100;
    assert_null(wire_plan_check(&plan));
    return plan;
}

static void send_plan(unsigned index, unsigned vehicle)
{
    static transport_message message;
    message.kind = TRANSPORT_PLAN;
    message.as.plan = plan_of(&world.units[index], vehicle);
    broadcast(index, &message);
}

static void tick(unsigned index)
{
    unit* self = &world.units[index];
    self->cycle++;
    peers_begin(&self->peers, now_us());
    for (unsigned vehicle = 0; vehicle < VEHICLES; ++vehicle) {
        if ((self->vehicles >> vehicle & 1) != 0 &&
            peers_sends(&self->peers, (int32_t)vehicle, now_us())) {
            assert_in_range(world.log_count, 0, LOG_MAX - 1);
            world.log[world.log_count++] = (sending){ world.ms, index, vehicle };
            send_plan(index, vehicle);
        }
    }
    if (peers_any(&self->peers, now_us())) {
        send_status(index, RSU_RUNNING);
    }
}

static void run(int64_t ms)
{
    for (const int64_t end = world.ms + ms; world.ms < end; ++world.ms) {
        for (unsigned i = 0; i < UNITS; ++i) {
            unit* self = &world.units[i];
            if (!self->running) {
                continue;
            }
            while (peers_silent(&self->peers, now_us()) != NULL) {
            }
            if ((world.ms + self->phase_ms) % self->period_ms == 0 && world.ms > self->begun_ms) {
                tick(i);
            }
            if (world.ms - self->status_ms >= 1000) {
                send_status(i, RSU_RUNNING);
            }
        }
    }
}

static void start(unsigned index, int32_t rsu_id, uint32_t map, bool never)
{
    unit* self = &world.units[index];
    const int64_t period = self->period_ms;
    const peers_def def = { .rsu_id = rsu_id, .start_utime = now_us() + index, .map_crc32 = map,
                            .period_us = period * 1000, .never = never };
    self->begun_ms = world.ms;
    self->cycle = -1;
    self->running = true;
    peers_init(&self->peers, &def);
    send_status(index, RSU_WAITING);
}

static void begin(void)
{
    memset(&world, 0, sizeof world);
    world.ms = 1000000;
    world.loops_back = true;
    for (unsigned i = 0; i < UNITS; ++i) {
        world.units[i] = (unit){ .phase_ms = 100 + 150 * i, .period_ms = PERIOD_MS,
                                 .vehicles = (1u << VEHICLES) - 1 };
    }
}

/// Plans of a unit since an instant.
static unsigned sent(unsigned unit, int64_t since_ms)
{
    unsigned count = 0;
    for (unsigned i = 0; i < world.log_count; ++i) {
        count += world.log[i].unit == unit && world.log[i].ms >= since_ms ? 1 : 0;
    }
    return count;
}

static int64_t first_sent(unsigned unit, int64_t since_ms)
{
    for (unsigned i = 0; i < world.log_count; ++i) {
        if (world.log[i].unit == unit && world.log[i].ms >= since_ms) {
            return world.log[i].ms;
        }
    }
    fail_msg("unit %u sends nothing", unit);
    return 0;
}

static int64_t last_sent(unsigned unit)
{
    int64_t last = 0;
    for (unsigned i = 0; i < world.log_count; ++i) {
        last = world.log[i].unit == unit ? world.log[i].ms : last;
    }
    return last;
}

static bool stands_by(unsigned unit)
{
    return peers_leader(&world.units[unit].peers, now_us()) != NULL;
}

static bool faulty(unsigned unit)
{
    return peers_fault(&world.units[unit].peers, now_us());
}

/// The cut cable of one unit, and its repair.
static void connect_unit(unsigned unit, bool connected)
{
    for (unsigned other = 0; other < UNITS; ++other) {
        if (other != unit) {
            world.units[unit].deaf[other] = !connected;
            world.units[other].deaf[unit] = !connected;
        }
    }
}

// ---- one unit -----------------------------------------------------------------------------

static void test_a_unit_that_hears_only_itself_sends_everything(void** state)
{
    (void)state;
    begin();
    start(0, 5, 1, false);
    run(5000);
    assert_int_equal(sent(0, 0), 10 * VEHICLES);
    assert_false(stands_by(0) || faulty(0));
    assert_false(peers_any(&world.units[0].peers, now_us()));
}

// ---- the same id --------------------------------------------------------------------------

static void begin_same_id(void)
{
    begin();
    start(0, 5, 1, false);
    run(3000);
    start(1, 5, 1, false);
}

static void test_of_one_id_the_unit_that_was_started_first_sends(void** state)
{
    (void)state;
    begin_same_id();
    run(10000);
    assert_int_equal(sent(0, 0), 26 * VEHICLES);
    assert_int_equal(sent(1, 0), 0);
    assert_true(stands_by(1) && faulty(1));
    assert_true(!stands_by(0) && faulty(0));
}

static void test_of_one_id_the_second_takes_over_within_three_cycles_of_silence(void** state)
{
    (void)state;
    for (int64_t cut = 0; cut < PERIOD_MS; cut += 25) {
        begin_same_id();
        run(6000 + cut);
        world.units[0].running = false;
        run(4000);
        const int64_t missing = last_sent(0) + PERIOD_MS; // the first plan that did not come
        CHECK_AT_MOST((double)(first_sent(1, 0) - missing), 3.0 * PERIOD_MS);
        assert_int_equal(sent(1, 0) % VEHICLES, 0);
        assert_false(stands_by(1) || faulty(1));

        const int64_t restart = world.ms; // now the second one was started first
        start(0, 5, 1, false);
        run(6000);
        assert_int_equal(sent(0, restart), 0);
        assert_true(stands_by(0) && !stands_by(1));
    }
}

static void test_a_first_that_returns_gets_the_vehicles_back_after_three_cycles(void** state)
{
    (void)state;
    begin_same_id();
    run(6000);
    connect_unit(0, false);
    run(6000);
    assert_false(stands_by(1));
    const int64_t repair = world.ms;
    connect_unit(0, true);
    run(8000);
    CHECK_AT_MOST((double)(last_sent(1) - repair), 4.0 * PERIOD_MS);
    assert_in_range(sent(1, repair), 2 * VEHICLES, 4 * VEHICLES);
    assert_true(stands_by(1) && !stands_by(0));
}

// ---- another id ---------------------------------------------------------------------------

/// The unit with the lower id is the one that was started second.
static void begin_other_id(uint32_t other_map, bool never)
{
    begin();
    start(1, 7, other_map, never);
    start(0, 3, 1, false);
}

static void test_of_two_ids_on_one_road_the_lower_one_sends(void** state)
{
    (void)state;
    begin_other_id(1, false);
    world.units[0].vehicles = world.units[1].vehicles = 3;
    run(5000);
    world.units[0].vehicles = world.units[1].vehicles = 7; // a new vehicle
    run(5000);
    assert_int_equal(sent(0, 0), 10 * 2 + 10 * 3);
    assert_int_equal(sent(1, 0), 0);
    assert_true(stands_by(1) && faulty(1));
    assert_false(stands_by(0) || faulty(0));
}

static void test_of_two_ids_the_higher_one_takes_over_and_gives_back(void** state)
{
    (void)state;
    for (int64_t cut = 0; cut < PERIOD_MS; cut += 25) {
        begin_other_id(1, false);
        run(6000 + cut);
        world.units[0].running = false;
        run(4000);
        const int64_t missing = last_sent(0) + PERIOD_MS;
        CHECK_AT_MOST((double)(first_sent(1, 0) - missing), 3.0 * PERIOD_MS);
        assert_false(stands_by(1) || faulty(1));

        const int64_t restart = world.ms;
        start(0, 3, 1, false);
        run(6000);
        CHECK_AT_MOST((double)(last_sent(1) - restart), 4.0 * PERIOD_MS);
        assert_true(stands_by(1) && faulty(1) && !faulty(0));
    }
}

static void test_a_unit_that_says_that_it_stops_is_replaced_in_the_next_cycle(void** state)
{
    (void)state;
    begin_other_id(1, false);
    run(6000);
    send_status(0, RSU_STOPPING);
    world.units[0].running = false;
    const int64_t stopped = world.ms;
    run(2000);
    CHECK_AT_MOST((double)(first_sent(1, 0) - stopped), 1.0 * PERIOD_MS);
}

static void test_a_link_that_loses_messages_does_not_switch_the_sender(void** state)
{
    (void)state;
    begin_other_id(1, false);
    world.units[0].loses = 3;
    run(60000);
    assert_int_equal(sent(1, 0), 0);
    assert_true(stands_by(1));
}

/// Unit 0 leads, and is heard for two of each ten cycles.
static void check_weak_link(void)
{
    run(6000);
    connect_unit(0, false);
    run(6000);
    const int64_t since = world.ms;
    for (int i = 0; i < 5; ++i) {
        connect_unit(0, true);
        run(2 * PERIOD_MS);
        connect_unit(0, false);
        run(8 * PERIOD_MS);
    }
    assert_int_equal(sent(1, since), 50 * VEHICLES);
}

static void test_a_unit_that_is_heard_now_and_then_does_not_get_the_vehicles(void** state)
{
    (void)state;
    begin_same_id();
    check_weak_link();
    begin_other_id(1, false);
    check_weak_link();
}

static void test_of_two_units_that_send_the_lower_id_counts_for_a_third_one(void** state)
{
    (void)state;
    begin();
    start(2, 9, 1, false);
    run(3000);
    start(1, 7, 1, true);
    start(0, 3, 1, false);
    run(4 * PERIOD_MS);
    const int64_t since = world.ms;
    run(5000);
    assert_int_equal(sent(2, since), 0);
    assert_int_equal(sent(1, since), 10 * VEHICLES);
}

static void test_a_vehicle_that_the_lower_id_does_not_plan_gets_plans_of_the_higher_one(void** state)
{
    (void)state;
    begin_other_id(1, false);
    world.units[0].vehicles = 3;
    run(10000);
    for (unsigned i = 0; i < world.log_count; ++i) {
        assert_int_equal(world.log[i].unit, world.log[i].vehicle == 2 ? 1 : 0);
    }
    assert_true(sent(1, 0) >= 14);
    assert_false(stands_by(1) || faulty(1) || faulty(0));
}

static void test_neighbours_on_different_roads_share_only_what_both_plan(void** state)
{
    (void)state;
    begin_other_id(2, false);
    world.units[0].vehicles = 1 | 2;
    world.units[1].vehicles = 2 | 4;
    run(10000);
    unsigned from_higher[VEHICLES] = { 0 };
    for (unsigned i = 0; i < world.log_count; ++i) {
        from_higher[world.log[i].vehicle] += world.log[i].unit == 1 ? 1 : 0;
    }
    assert_int_equal(from_higher[0], 0);
    assert_in_range(from_higher[1], 0, PEERS_RETURN_CYCLES + 1); // until the lower one was heard
    assert_int_equal(from_higher[2], 20);
    assert_false(stands_by(1) || faulty(1) || faulty(0));
}

static void test_without_vehicles_a_unit_stands_by_on_the_same_road_only(void** state)
{
    (void)state;
    for (uint32_t map = 1; map <= 2; ++map) {
        begin_other_id(map, false);
        world.units[0].vehicles = world.units[1].vehicles = 0;
        run(5000);
        assert_int_equal(stands_by(1), map == 1);
        assert_int_equal(faulty(1), map == 1);
        assert_false(stands_by(0) || faulty(0));
    }
}

static void test_never_lets_both_send_and_both_report_it(void** state)
{
    (void)state;
    begin_other_id(1, true);
    run(10000);
    assert_int_equal(sent(0, 0), 20 * VEHICLES);
    assert_int_equal(sent(1, 0), 20 * VEHICLES);
    assert_true(faulty(0) && faulty(1));
    assert_false(stands_by(0) || stands_by(1));
}

static void test_of_three_units_the_next_id_takes_over(void** state)
{
    (void)state;
    begin();
    start(2, 9, 1, false);
    start(1, 7, 1, false);
    start(0, 3, 1, false);
    run(6000);
    world.units[0].running = false;
    run(10000);
    assert_int_equal(sent(2, 0), 0);
    assert_true(sent(1, 0) > 0);
}

// ---- cancellations ------------------------------------------------------------------------

static void test_only_a_vehicle_with_a_plan_of_its_own_is_cancelled(void** state)
{
    (void)state;
    begin_other_id(1, false);
    run(6000);
    unit* self = &world.units[1];
    assert_false(peers_cancels(&self->peers, 0, now_us())); // it stands by
    world.units[0].running = false;
    run(4000);
    assert_true(peers_cancels(&self->peers, 0, now_us())); // it sends
    assert_false(peers_cancels(&self->peers, 0, now_us())); // once
    start(0, 3, 1, false);
    run(700); // both send
    assert_false(peers_cancels(&self->peers, 1, now_us()));
    assert_false(peers_cancels(&self->peers, 99, now_us()));
}

static void test_a_cancellation_of_the_lower_id_frees_the_vehicle(void** state)
{
    (void)state;
    begin_other_id(1, false);
    run(6000);
    static transport_message message;
    message.kind = TRANSPORT_PLAN;
    message.as.plan = plan_of(&world.units[0], 1);
    message.as.plan.status = VERGE_CANCELLED;
    message.as.plan.point_count = 0;
    assert_null(peers_offer(&world.units[1].peers, &message, now_us()));
    peers_begin(&world.units[1].peers, now_us());
    assert_true(peers_sends(&world.units[1].peers, 1, now_us()));
    assert_false(peers_sends(&world.units[1].peers, 0, now_us()));
}

// ---- strangers ----------------------------------------------------------------------------

static void test_messages_of_no_unit_change_nothing(void** state)
{
    (void)state;
    begin();
    start(0, 5, 1, false);
    run(3000);
    peers* self = &world.units[0].peers;
    static transport_message message;
    message.kind = TRANSPORT_STATUS;
    const verge_rsu_status_t wrong[] = {
        { .rsu_id = -1, .start_utime = 7, .utime = now_us() },
        { .rsu_id = 1, .start_utime = 0, .utime = now_us() },
        { .rsu_id = 1, .start_utime = 7, .utime = now_us(), .state = RSU_STOPPING },
        { .rsu_id = 1, .start_utime = self->def.start_utime, .utime = now_us() },
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        message.as.status = wrong[i];
        assert_null(peers_offer(self, &message, now_us()));
    }
    message.kind = TRANSPORT_PLAN; // of a unit without a status
    message.as.plan = plan_of(&world.units[0], 1);
    message.as.plan.rsu_id = 1;
    assert_null(peers_offer(self, &message, now_us()));
    assert_false(peers_any(self, now_us()));

    message.kind = TRANSPORT_STATUS; // of a unit that sends plans no vehicle can use
    message.as.status = (verge_rsu_status_t){ .rsu_id = 1, .start_utime = 7, .utime = INT64_MIN };
    assert_non_null(peers_offer(self, &message, now_us()));
    message.as.status.cycle = 1;
    message.as.status.utime = INT64_MAX;
    assert_null(peers_offer(self, &message, now_us()));
    message.kind = TRANSPORT_PLAN;
    message.as.plan = plan_of(&world.units[0], 1);
    message.as.plan.rsu_id = 1;
    message.as.plan.point_count = 1;
    assert_null(peers_offer(self, &message, now_us()));
    run(3000);
    assert_int_equal(sent(0, 0), 12 * VEHICLES);
}

static void test_many_units_and_vehicles_replace_those_heard_longest_ago(void** state)
{
    (void)state;
    begin();
    start(0, 5000, 2, false);
    world.units[0].cycle = 0;
    peers* self = &world.units[0].peers;
    static transport_message message;
    for (int32_t i = 0; i < 1000; ++i, world.ms += 1) {
        message.kind = TRANSPORT_STATUS;
        message.as.status = (verge_rsu_status_t){ .rsu_id = i, .start_utime = 7, .utime = 1 + i };
        assert_non_null(peers_offer(self, &message, now_us()));
        message.kind = TRANSPORT_PLAN;
        message.as.plan = plan_of(&world.units[0], (unsigned)i);
        message.as.plan.rsu_id = i;
        peers_offer(self, &message, now_us());
    }
    peers_begin(self, now_us());
    assert_false(peers_sends(self, 999, now_us())); // planned by a unit that is remembered
    assert_true(peers_sends(self, 985, now_us()));  // by one that is forgotten
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_unit_that_hears_only_itself_sends_everything),
        cmocka_unit_test(test_of_one_id_the_unit_that_was_started_first_sends),
        cmocka_unit_test(test_of_one_id_the_second_takes_over_within_three_cycles_of_silence),
        cmocka_unit_test(test_a_first_that_returns_gets_the_vehicles_back_after_three_cycles),
        cmocka_unit_test(test_of_two_ids_on_one_road_the_lower_one_sends),
        cmocka_unit_test(test_of_two_ids_the_higher_one_takes_over_and_gives_back),
        cmocka_unit_test(test_a_unit_that_says_that_it_stops_is_replaced_in_the_next_cycle),
        cmocka_unit_test(test_a_link_that_loses_messages_does_not_switch_the_sender),
        cmocka_unit_test(test_a_unit_that_is_heard_now_and_then_does_not_get_the_vehicles),
        cmocka_unit_test(test_of_two_units_that_send_the_lower_id_counts_for_a_third_one),
        cmocka_unit_test(
            test_a_vehicle_that_the_lower_id_does_not_plan_gets_plans_of_the_higher_one),
        cmocka_unit_test(test_neighbours_on_different_roads_share_only_what_both_plan),
        cmocka_unit_test(test_without_vehicles_a_unit_stands_by_on_the_same_road_only),
        cmocka_unit_test(test_never_lets_both_send_and_both_report_it),
        cmocka_unit_test(test_of_three_units_the_next_id_takes_over),
        cmocka_unit_test(test_only_a_vehicle_with_a_plan_of_its_own_is_cancelled),
        cmocka_unit_test(test_a_cancellation_of_the_lower_id_frees_the_vehicle),
        cmocka_unit_test(test_messages_of_no_unit_change_nothing),
        cmocka_unit_test(test_many_units_and_vehicles_replace_those_heard_longest_ago),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
