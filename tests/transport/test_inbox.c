/// Goal: the inbox accepts states that are new, timely and in range, counts each refusal by its
///       reason, and gives the planner every vehicle at one instant, by age.
/// Method: each rule at its exact limit; then many random good and bad states, where a refused one
///         changes only its counter.
#include "check.h"
#include "rng.h"
#include "verge/inbox.h"
#include "verge/planner.h"

#include <math.h>
#include <stdlib.h>

static const int64_t start = 1700000000000000; // [us] any instant
enum { MS = 1000 };

static inbox      box;
static inbox_view view;

static int fresh_inbox(void** state)
{
    (void)state;
    const inbox_limits limits = inbox_default_limits();
    inbox_init(&box, &limits, VERGE_VEHICLES_MAX, VERGE_CONTROLLED_MAX);
    return 0;
}

static verge_vehicle_state_t car(int32_t id, int64_t utime)
{
    return (verge_vehicle_state_t){
        .utime = utime, .vehicle_id = id, .controlled = 1, .x = 10.0 * id, .y = 1.0,
        .speed = 10.0f, .yaw_rate = NAN, .length = 5.0f, .width = 2.0f, .position_sigma = NAN,
        .target_lane = -1, .habit = 1, .cooperation = NAN, .followed_cycle = -1,
    };
}

static inbox_verdict offer(verge_vehicle_state_t state, int64_t now)
{
    return inbox_offer(&box, &state, now, NULL);
}

static uint64_t refusals(const inbox_counters* c)
{
    return c->rx_stale + c->rx_future + c->rx_duplicate + c->rx_out_of_order + c->rx_out_of_range +
           c->rx_off_map + c->rx_over_capacity + c->rx_id_conflict + c->rx_version;
}

// ---------------------------------------------------------------- what gets in

static void test_a_state_40_ms_ahead_is_accepted_and_one_more_is_not(void** state)
{
    (void)state;
    assert_int_equal(offer(car(1, start + 40 * MS), start), INBOX_ACCEPTED);
    assert_int_equal(offer(car(2, start + 40 * MS + 1), start), INBOX_FUTURE);
    assert_int_equal(box.counters.rx_accepted, 1);
    assert_int_equal(box.counters.rx_future, 1);
}

static void test_a_state_2_s_old_is_accepted_and_one_older_is_stale(void** state)
{
    (void)state;
    assert_int_equal(offer(car(1, start - 2000 * MS), start), INBOX_ACCEPTED);
    assert_int_equal(offer(car(2, start - 2000 * MS - 1), start), INBOX_STALE);
    assert_int_equal(box.counters.rx_stale, 1);
}

static void test_duplicate_and_older_states_are_distinguished(void** state)
{
    (void)state;
    verge_vehicle_state_t again = car(1, start);
    again.sequence = 5; // sent again, same fix
    assert_int_equal(offer(car(1, start), start), INBOX_ACCEPTED);
    assert_int_equal(offer(car(1, start), start), INBOX_DUPLICATE);
    assert_int_equal(offer(again, start), INBOX_DUPLICATE);
    assert_int_equal(offer(car(1, start - 1), start), INBOX_OUT_OF_ORDER);
    assert_int_equal(offer(car(1, start + 1), start), INBOX_ACCEPTED);
    assert_int_equal(box.counters.rx_duplicate, 2);
    assert_int_equal(box.counters.rx_out_of_order, 1);
}

static void test_two_senders_with_one_id_are_reported_and_the_first_keeps_it(void** state)
{
    (void)state;
    verge_vehicle_state_t other = car(1, start);
    other.x += 0.5;
    assert_int_equal(offer(car(1, start), start), INBOX_ACCEPTED);
    assert_int_equal(offer(other, start), INBOX_ID_CONFLICT); // same instant, another place

    other.utime = start + 100 * MS; // 10 m/s for 0.1 s and 10 m of tolerance: 11 m
    other.x = 10.0 + 11.0 + 0.001;
    assert_int_equal(offer(other, start + 100 * MS), INBOX_ID_CONFLICT);
    other.x = 10.0 + 11.0 - 0.001;
    assert_int_equal(offer(other, start + 100 * MS), INBOX_ACCEPTED);

    // Once the first has been silent for longer than drop_ms the id is free for anyone.
    other.utime = start + 2101 * MS;
    other.x = 900.0;
    assert_int_equal(offer(other, other.utime), INBOX_ACCEPTED);
    assert_int_equal(box.counters.rx_id_conflict, 2);
}

static inbox_verdict offer_from(verge_vehicle_state_t state, uint32_t bus, uint64_t sender)
{
    return inbox_offer_from(&box, &state, (inbox_source){ .sender = sender, .bus = bus },
                            state.utime, NULL);
}

static void test_an_id_belongs_to_its_first_sender_until_that_is_silent_for_obstacle_ms(void** state)
{
    (void)state;
    assert_int_equal(offer_from(car(1, start), 0, 77), INBOX_ACCEPTED);
    // Another one's states fit perfectly, newer and older ones alike: all the more suspicious.
    assert_int_equal(offer_from(car(1, start), 0, 78), INBOX_ID_TAKEN);
    assert_int_equal(offer_from(car(1, start + 1000 * MS), 0, 78), INBOX_ID_TAKEN);
    assert_int_equal(box.counters.rx_id_conflict, 2);
    assert_int_equal(offer_from(car(2, start), 0, 78), INBOX_ACCEPTED); // its own id is welcome

    // One microsecond more and the id is free; then it is the newcomer's.
    verge_vehicle_state_t late = car(1, start + 1000 * MS + 1);
    assert_int_equal(offer_from(late, 0, 78), INBOX_ACCEPTED);
    late.utime += 100 * MS;
    assert_int_equal(offer_from(late, 0, 77), INBOX_ID_TAKEN);
    assert_int_equal(offer_from(late, 0, 78), INBOX_ACCEPTED);
    assert_int_equal(box.counters.rx_id_conflict, 3);
}

static void test_a_vehicle_heard_on_two_buses_is_one_and_each_bus_has_its_sender(void** state)
{
    (void)state;
    for (int i = 0; i < 20; ++i) { // now one bus is the faster one, now the other
        const verge_vehicle_state_t now = car(1, start + i * 100 * MS);
        const uint32_t              first = (uint32_t)i % 2;
        assert_int_equal(offer_from(now, first, 10 + first), INBOX_ACCEPTED);
        assert_int_equal(offer_from(now, 1 - first, 10 + 1 - first), INBOX_DUPLICATE);
    }
    inbox_snapshot(&box, start + 1900 * MS, &view);
    assert_int_equal(view.count, 1);
    assert_int_equal(box.counters.rx_id_conflict, 0);
    // A second sender is noticed on either of them, whichever was the first this time.
    assert_int_equal(offer_from(car(1, start + 2000 * MS), 0, 99), INBOX_ID_TAKEN);
    assert_int_equal(offer_from(car(1, start + 2000 * MS), 1, 99), INBOX_ID_TAKEN);
}

static void test_senders_and_buses_that_are_unknown_own_no_id(void** state)
{
    (void)state;
    assert_int_equal(offer_from(car(1, start), 0, 77), INBOX_ACCEPTED);
    assert_int_equal(offer_from(car(1, start + 100 * MS), 0, 0), INBOX_ACCEPTED); // a recording
    assert_int_equal(offer_from(car(1, start + 200 * MS), 0, 78), INBOX_ID_TAKEN);
    inbox_forget_senders(&box);
    assert_int_equal(offer_from(car(1, start + 200 * MS), 0, 78), INBOX_ACCEPTED);

    // A vehicle in the slot of a forgotten one does not get its sender.
    inbox_snapshot(&box, start + 9000 * MS, &view);
    assert_int_equal(offer_from(car(5, start + 9000 * MS), 0, 90), INBOX_ACCEPTED);
    assert_int_equal(offer_from(car(5, start + 9100 * MS), 0, 78), INBOX_ID_TAKEN);
    assert_int_equal(offer_from(car(1, start + 9100 * MS), 0, 90), INBOX_ACCEPTED);
}

/// Accepted states that are offered again without a sender are accepted: a replay of a recording
/// sees the same vehicles as the live run.
static void test_accepted_states_are_accepted_again_without_their_senders(void** state)
{
    (void)state;
    test_rng     rng = test_rng_seeded("senders");
    static inbox again;
    again = box;
    for (uint32_t round = 0; round < test_rounds(2000); ++round) {
        const int64_t         now = start + round * 20 * MS;
        verge_vehicle_state_t s = car((int32_t)test_rng_below(&rng, 4), now);
        const inbox_source    source = { .sender = 1 + test_rng_below(&rng, 2),
                                         .bus = test_rng_below(&rng, 2) };
        s.utime -= test_rng_below(&rng, 100) * MS;
        if (inbox_offer_from(&box, &s, source, now, NULL) == INBOX_ACCEPTED) {
            assert_int_equal(inbox_offer(&again, &s, now, NULL), INBOX_ACCEPTED);
        }
    }
    static inbox_view other;
    const int64_t     end = start + test_rounds(2000) * 20 * MS;
    inbox_snapshot(&box, end, &view);
    inbox_snapshot(&again, end, &other);
    assert_true(view.count > 0 && box.counters.rx_id_conflict > 0);
    assert_int_equal(view.count, other.count);
    for (uint32_t i = 0; i < view.count; ++i) {
        assert_int_equal(view.vehicles[i].id, other.vehicles[i].id);
        CHECK_SAME_BITS(view.vehicles[i].x, other.vehicles[i].x);
        assert_true(view.state_utime[i] == other.state_utime[i]);
    }
}

static void test_out_of_range_comes_before_everything_else(void** state)
{
    (void)state;
    verge_vehicle_state_t bad = car(1, start + 3600000000);
    bad.speed = INFINITY;
    assert_int_equal(offer(bad, start), INBOX_OUT_OF_RANGE);
    assert_string_equal(box.fault_field, "speed");
    assert_int_equal(box.counters.rx_future, 0);
}

static void test_a_full_table_takes_known_vehicles_and_replaces_forgotten_ones(void** state)
{
    (void)state;
    for (int32_t id = 0; id < VERGE_VEHICLES_MAX; ++id) {
        assert_int_equal(offer(car(id, start + id), start + id), INBOX_ACCEPTED);
    }
    assert_int_equal(offer(car(100, start + 100), start + 100), INBOX_OVER_CAPACITY);
    assert_int_equal(offer(car(5, start + 200), start + 200), INBOX_ACCEPTED);

    const int64_t border = start + 2000 * MS; // vehicle 0 is exactly 2 s old, then older
    assert_int_equal(offer(car(100, border), border), INBOX_OVER_CAPACITY);
    assert_int_equal(offer(car(100, border + 1), border + 1), INBOX_ACCEPTED);
    assert_int_equal(offer(car(101, border + 1), border + 1), INBOX_OVER_CAPACITY);
    assert_int_equal(box.counters.rx_over_capacity, 3);

    inbox_snapshot(&box, border + 1, &view);
    assert_int_equal(view.count, VERGE_VEHICLES_MAX);
    assert_int_equal(view.vehicles[0].id, 1);
    assert_int_equal(view.vehicles[view.count - 1].id, 100);
}

// ---------------------------------------------------------------- ages

static void check_class(int64_t age_us, bool present, bool controlled, double margin)
{
    fresh_inbox(NULL);
    assert_int_equal(offer(car(1, start), start), INBOX_ACCEPTED);
    inbox_snapshot(&box, start + age_us, &view);
    assert_int_equal(view.count, present);
    if (present) {
        assert_int_equal(view.vehicles[0].controlled, controlled);
        CHECK_NEAR(view.vehicles[0].margin, margin, 0.0);
        CHECK_NEAR(view.vehicles[0].x, 10.0 + 10.0 * (double)age_us / 1e6, 1e-9);
        assert_int_equal(view.controlled_count, controlled);
        assert_true(view.state_utime[0] == start);
    }
}

static void test_ages_have_their_classes_at_the_exact_borders(void** state)
{
    (void)state;
    check_class(0, true, true, 0.0);
    check_class(-40 * MS, true, true, 0.0);
    check_class(300 * MS, true, true, 0.0);
    check_class(300 * MS + 1, true, false, 0.5);
    check_class(1000 * MS, true, false, 0.5);
    check_class(1000 * MS + 1, true, false, 1.0);
    check_class(2000 * MS, true, false, 1.0);
    check_class(2000 * MS + 1, false, false, 0.0);
}

static void test_a_cancellation_is_sent_exactly_once(void** state)
{
    (void)state;
    offer(car(1, start), start);
    offer(car(2, start), start);
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.controlled_count, 2);
    assert_int_equal(view.cancelled_count, 0);

    offer(car(2, start + 400 * MS), start + 400 * MS);
    inbox_snapshot(&box, start + 400 * MS, &view);
    assert_int_equal(view.cancelled_count, 1);
    assert_int_equal(view.cancelled[0], 1);
    inbox_snapshot(&box, start + 450 * MS, &view);
    assert_int_equal(view.cancelled_count, 0);

    // Silent from planned to forgotten between two snapshots: the cancellation is still sent.
    inbox_snapshot(&box, start + 5000 * MS, &view);
    assert_int_equal(view.count, 0);
    assert_int_equal(view.cancelled_count, 1);
    assert_int_equal(view.cancelled[0], 2);

    // Comes back, then no longer asks to be planned.
    offer(car(1, start + 6000 * MS), start + 6000 * MS);
    inbox_snapshot(&box, start + 6000 * MS, &view);
    verge_vehicle_state_t human = car(1, start + 6100 * MS);
    human.controlled = 0;
    offer(human, start + 6100 * MS);
    inbox_snapshot(&box, start + 6100 * MS, &view);
    assert_int_equal(view.count, 1);
    assert_int_equal(view.cancelled_count, 1);
}

static void test_surplus_vehicles_are_obstacles_and_the_planned_keep_their_places(void** state)
{
    (void)state;
    for (int32_t id = 100; id < 100 + VERGE_CONTROLLED_MAX; ++id) {
        offer(car(id, start), start);
    }
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.controlled_count, VERGE_CONTROLLED_MAX);

    offer(car(1, start), start); // a lower id does not push anyone out
    inbox_snapshot(&box, start + 10 * MS, &view);
    assert_int_equal(view.count, VERGE_CONTROLLED_MAX + 1);
    assert_int_equal(view.controlled_count, VERGE_CONTROLLED_MAX);
    assert_int_equal(view.cancelled_count, 0);
    assert_int_equal(view.vehicles[0].id, 1);
    assert_false(view.vehicles[0].controlled);
}

// ---------------------------------------------------------------- projection

/// The same motion in ten thousand small steps of the rear axle, which moves along the heading.
static void drive(verge_vehicle* v, double dt)
{
    const int    steps = 10000;
    const double h = dt / steps;
    const double axle = verge_body_by_size(v->length, v->width).rear_axle;
    const double rate = isfinite(v->yaw_rate) && v->speed > 0.0 ? v->yaw_rate / v->speed : 0.0;
    const double curvature = fmax(-0.5, fmin(rate, 0.5)); // of the centre's path
    double       x = v->x - axle * cos(v->heading), y = v->y - axle * sin(v->heading);
    for (int i = 0; i < steps && v->speed > 0.0; ++i) {
        const double speed = fmax(0.0, v->speed + v->acceleration * h);
        const double ds = 0.5 * (v->speed + speed) * h;
        const double turn = curvature * ds;
        const double axle_ds = sqrt(ds * ds - axle * axle * turn * turn);
        x += axle_ds * cos(v->heading);
        y += axle_ds * sin(v->heading);
        v->heading += turn;
        v->speed = speed;
    }
    v->x = x + axle * cos(v->heading);
    v->y = y + axle * sin(v->heading);
}

static void test_projection_agrees_with_driving_in_small_steps(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("projection");
    for (uint32_t i = 0; i < test_rounds(300); ++i) {
        verge_vehicle v = { .length = 5.0, .width = 2.0 };
        v.heading = test_rng_between(&rng, -3.0, 3.0);
        v.speed = test_rng_between(&rng, 0.0, 30.0);
        v.acceleration = test_rng_between(&rng, -8.0, 4.0);
        v.yaw_rate = i % 4 == 0 ? (double)NAN : test_rng_between(&rng, -0.4, 0.4);
        const double  dt = test_rng_between(&rng, 0.0, 0.3);
        verge_vehicle slow = v;

        inbox_project(&v, dt);
        drive(&slow, dt);

        CHECK_NEAR(v.x, slow.x, 0.02); // arc and chord, speed that changes within a turn
        CHECK_NEAR(v.y, slow.y, 0.02);
        CHECK_NEAR(v.speed, slow.speed, 1e-6);
        CHECK_NEAR(remainder(v.heading - slow.heading, 6.283185307179586), 0.0, 1e-4);
    }
}

static void test_a_reversing_vehicle_goes_on_backwards_and_never_turns_round(void** state)
{
    (void)state;
    verge_vehicle_state_t back = car(1, start);
    back.speed = -5.0f;
    back.acceleration = 0.0f;
    back.heading = 7.0f;
    assert_int_equal(offer(back, start), INBOX_ACCEPTED);
    verge_vehicle v = wire_vehicle_from_state(&back);
    CHECK_NEAR(v.heading, 7.0 - 6.283185307179586, 1e-6);
    v = (verge_vehicle){ .speed = -5.0, .yaw_rate = NAN };
    inbox_project(&v, 0.2);
    CHECK_NEAR(v.x, -1.0, 1e-9);
    v = (verge_vehicle){ .speed = -1.0, .acceleration = 10.0, .yaw_rate = NAN };
    inbox_project(&v, 0.3);
    CHECK_NEAR(v.x, -0.05, 1e-9);
    CHECK_NEAR(v.speed, 0.0, 0.0);
    v = (verge_vehicle){ .speed = -14.0, .acceleration = -30.0, .yaw_rate = NAN };
    inbox_project(&v, 1.0);
    CHECK_NEAR(v.speed, -15.0, 0.0);
}

static void test_a_braking_vehicle_stops_and_stays_at_rest(void** state)
{
    (void)state;
    verge_vehicle v = { .speed = 4.0, .acceleration = -8.0, .yaw_rate = NAN };
    inbox_project(&v, 2.0);
    CHECK_NEAR(v.x, 1.0, 1e-12); // v^2 / 2a
    CHECK_NEAR(v.speed, 0.0, 0.0);
    CHECK_NEAR(v.acceleration, 0.0, 0.0);

    verge_vehicle standing = { .speed = 0.0, .acceleration = -3.0, .yaw_rate = 1.0 };
    inbox_project(&standing, 2.0);
    CHECK_NEAR(standing.x, 0.0, 0.0);
    CHECK_NEAR(standing.heading, 0.0, 0.0);
}

static void test_no_projection_is_faster_than_a_car(void** state)
{
    (void)state;
    verge_vehicle v = { .speed = 45.0, .acceleration = 20.0, .yaw_rate = NAN };
    inbox_project(&v, 2.0);
    CHECK_NEAR(v.speed, VERGE_SPEED_MAX, 0.0);
}

// ---------------------------------------------------------------- isolation

static verge_vehicle_state_t spoiled(test_rng* rng, verge_vehicle_state_t s, int64_t now)
{
    switch (test_rng_below(rng, 8)) {
    case 0: s.x = NAN; break;
    case 1: s.speed = -1.0f; break;
    case 2: s.heading = INFINITY; break;
    case 3: s.utime = now + 41 * MS; break;
    case 4: s.utime = now - 2001 * MS; break;
    case 5: s.x += 500.0; break;
    case 6: s.length = 0.0f; break;
    default: s.vehicle_id = -3; break;
    }
    return s;
}

static void test_a_refused_state_changes_only_its_counter(void** state)
{
    (void)state;
    test_rng   rng = test_rng_seeded("isolation");
    static inbox clean; // is offered the good ones only
    clean = box;
    int64_t  now = start;
    uint64_t bad = 0;
    for (uint32_t round = 0; round < test_rounds(2000); ++round) {
        now += 20 * MS;
        verge_vehicle_state_t good = car((int32_t)(round % 5), now);
        good.x += 0.01 * round;
        assert_int_equal(offer(good, now), INBOX_ACCEPTED);
        assert_int_equal(inbox_offer(&clean, &good, now, NULL), INBOX_ACCEPTED);
        const inbox_verdict verdict = offer(spoiled(&rng, good, now), now);
        assert_int_not_equal(verdict, INBOX_ACCEPTED);
        ++bad;
        assert_memory_equal(box.slots, clean.slots, sizeof box.slots);
    }
    assert_int_equal(refusals(&box.counters), bad);
    assert_int_equal(box.counters.rx_accepted, clean.counters.rx_accepted);
}

static void test_views_are_ordered_by_id_whatever_the_order_of_arrival(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("order");
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        fresh_inbox(NULL);
        bool sent[1000] = { false };
        for (int i = 0; i < 40; ++i) {
            const uint32_t id = test_rng_below(&rng, 1000);
            offer(car((int32_t)id, start + i), start + i);
            sent[id] = true;
        }
        inbox_snapshot(&box, start + 40, &view);
        uint32_t at = 0; // the ids sent, counted upwards, are the view
        for (int32_t id = 0; id < 1000; ++id) {
            if (sent[id]) {
                assert_int_equal(view.vehicles[at++].id, id);
            }
        }
        assert_int_equal(view.count, at);
    }
}

// ---------------------------------------------------------------- the road

static const double straight[2][2] = { { 0.0, 0.0 }, { 400.0, 0.0 } };

/// A planner with one straight lane, id 3, along the x axis, for its road.
static const verge_road* one_lane(void** memory)
{
    const verge_lane_def lane = {
        .id = 3, .points = straight, .point_count = 2, .width = 4.0, .speed_limit = 30.0,
        .left = VERGE_NO_LANE, .right = VERGE_NO_LANE,
    };
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ .lanes = &lane, .lane_count = 1 };
    def.nodes_max = 64;
    const size_t   size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    verge_planner* planner;
    *memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&planner, &def, *memory, size), VERGE_OK);
    return verge_planner_road(planner);
}

static void test_only_vehicles_that_the_last_plan_found_on_a_lane_are_not_projected(void** state)
{
    (void)state;
    void*                 memory;
    const verge_road*     road = one_lane(&memory);
    const int32_t         placed[] = { 1 };
    verge_vehicle_state_t on_lane = car(1, start), off_lane = car(1, start + 100000);
    off_lane.y = 5.0;
    inbox_placed(&box, placed, 1); // no effect: the inbox does not have this vehicle
    assert_int_equal(inbox_offer(&box, &off_lane, start + 100000, road), INBOX_OFF_MAP);
    assert_int_equal(inbox_offer(&box, &on_lane, start, road), INBOX_ACCEPTED);
    assert_int_equal(inbox_offer(&box, &off_lane, start + 100000, road), INBOX_OFF_MAP);
    inbox_placed(&box, placed, 1);
    assert_int_equal(inbox_offer(&box, &off_lane, start + 100000, road), INBOX_ACCEPTED);
    inbox_placed(&box, placed, 0); // the plan that used this state found it off the map
    off_lane.utime += 100000;
    assert_int_equal(inbox_offer(&box, &off_lane, start + 200000, road), INBOX_OFF_MAP);
    on_lane.utime = start + 300000;
    assert_int_equal(inbox_offer(&box, &on_lane, start + 300000, road), INBOX_ACCEPTED);

    inbox_placed(&box, placed, 1);
    inbox_review(&box, road); // another road: a lane of the old one proves nothing
    off_lane.utime = start + 400000;
    assert_int_equal(inbox_offer(&box, &off_lane, start + 400000, road), INBOX_OFF_MAP);
    free(memory);
}

static void test_an_unknown_target_costs_the_target_and_off_the_road_the_place(void** state)
{
    (void)state;
    void*                 memory;
    const verge_road*     road = one_lane(&memory);
    verge_vehicle_state_t s = car(1, start);
    s.target_lane = 3;
    assert_int_equal(inbox_offer(&box, &s, start, road), INBOX_ACCEPTED);
    s = car(2, start);
    s.y = 30.0;
    assert_int_equal(inbox_offer(&box, &s, start, road), INBOX_OFF_MAP);
    s = car(3, start);
    s.target_lane = 4;
    assert_int_equal(inbox_offer(&box, &s, start, road), INBOX_ACCEPTED);
    assert_int_equal(box.counters.unknown_target, 1);
    assert_int_equal(box.lacking_id, 3);
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.controlled_count, 2);
    assert_int_equal(view.vehicles[0].target_lane, 3);
    assert_int_equal(view.vehicles[1].target_lane, VERGE_NO_LANE);

    // The same two, received before the road was changed to this one.
    s = car(2, start);
    s.y = 30.0;
    offer(s, start);
    s = car(4, start);
    s.target_lane = 4;
    offer(s, start);
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.controlled_count, 4);
    inbox_review(&box, road);
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.count, 3);
    assert_int_equal(view.cancelled_count, 1);
    assert_int_equal(view.vehicles[2].id, 4);
    assert_int_equal(view.vehicles[2].target_lane, VERGE_NO_LANE);
    free(memory);
}

static void test_vehicles_that_get_no_plan_for_want_of_room_are_counted(void** state)
{
    (void)state;
    inbox_limits limits = inbox_default_limits();
    inbox_init(&box, &limits, 8, 2);
    for (int32_t id = 1; id <= 5; ++id) {
        offer(car(id, start), start);
    }
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.count, 5);
    assert_int_equal(view.controlled_count, 2);
    assert_int_equal(box.counters.rx_over_capacity, 3);
    inbox_snapshot(&box, start + 100000, &view);
    assert_int_equal(box.counters.rx_over_capacity, 6);
    assert_int_equal(view.cancelled_count, 0);
}

static void test_a_state_without_heading_or_speed_is_an_obstacle_and_gets_no_plan(void** state)
{
    (void)state;
    void*                 memory;
    const verge_road*     road = one_lane(&memory);
    verge_vehicle_state_t s = car(1, start), next = car(1, start + 100000);
    assert_int_equal(inbox_offer(&box, &s, start, road), INBOX_ACCEPTED);
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.controlled_count, 1);
    next.heading = next.speed = NAN; // as it said last
    assert_int_equal(inbox_offer(&box, &next, start + 100000, road), INBOX_ACCEPTED);
    inbox_snapshot(&box, start + 100000, &view);
    assert_int_equal(view.count, 1);
    assert_int_equal(view.controlled_count, 0);
    assert_int_equal(view.cancelled_count, 1);
    CHECK_NEAR(view.vehicles[0].speed, (double)s.speed, 1e-6);
    CHECK_NEAR(view.vehicles[0].heading, (double)s.heading, 1e-6);
    assert_int_equal(box.counters.incomplete, 1);

    s = car(2, start + 100000); // a stranger: along the lane, at rest
    s.y += 0.5;
    s.heading = s.speed = s.acceleration = s.yaw_rate = NAN;
    assert_int_equal(inbox_offer(&box, &s, start + 100000, road), INBOX_ACCEPTED);
    next = car(1, start + 200000);
    next.acceleration = NAN; // taken as 0: it gets its plan
    assert_int_equal(inbox_offer(&box, &next, start + 200000, road), INBOX_ACCEPTED);
    inbox_snapshot(&box, start + 200000, &view);
    assert_int_equal(view.count, 2);
    assert_int_equal(view.controlled_count, 1);
    assert_true(view.vehicles[0].controlled);
    CHECK_NEAR(view.vehicles[0].acceleration, 0.0, 0.0);
    CHECK_NEAR(view.vehicles[1].speed, 0.0, 0.0);
    CHECK_NEAR(view.vehicles[1].heading, 0.0, 1e-3);
    assert_int_equal(box.counters.incomplete, 2);
    free(memory);
}

// ---------------------------------------------------------------- limits and counters

static void test_limits_are_refused_out_of_range_and_out_of_order(void** state)
{
    (void)state;
    uint32_t           count = 0;
    const inbox_param* params = inbox_params(&count);
    assert_int_equal(count * sizeof(double), sizeof(inbox_limits)); // every field has its row
    for (uint32_t i = 0; i < count; ++i) {
        const double wrong[] = { params[i].min - 0.1, params[i].max + 0.1, NAN };
        for (int k = 0; k < 3; ++k) {
            inbox_limits limits = inbox_default_limits();
            *(double*)((char*)&limits + params[i].offset) = wrong[k];
            assert_string_equal(inbox_limits_check(&limits), params[i].name);
        }
    }
    inbox_limits limits = inbox_default_limits();
    assert_null(inbox_limits_check(&limits));
    limits.obstacle_ms = 299.0;
    assert_string_equal(inbox_limits_check(&limits), "obstacle_ms");
    limits = inbox_default_limits();
    limits.drop_ms = 999.0;
    assert_string_equal(inbox_limits_check(&limits), "drop_ms");
}

static void test_a_status_carries_all_counters_and_never_wraps(void** state)
{
    (void)state;
    box.counters = (inbox_counters){
        .rx_accepted = 1, .rx_stale = 2, .rx_future = 3, .rx_duplicate = 4, .rx_out_of_order = 5,
        .rx_out_of_range = 7, .rx_off_map = 8, .rx_over_capacity = 9, .rx_id_conflict = UINT64_MAX,
    };
    const transport_stats bus = { .malformed = 6, .dropped = 11 };
    verge_rsu_status_t    status = { 0 };
    inbox_fill_status(&box, &bus, &status);
    assert_int_equal(status.rx_accepted, 1);
    assert_int_equal(status.rx_stale, 2);
    assert_int_equal(status.rx_future, 3);
    assert_int_equal(status.rx_duplicate, 4);
    assert_int_equal(status.rx_out_of_order, 5);
    assert_int_equal(status.rx_malformed, 6);
    assert_int_equal(status.rx_out_of_range, 7);
    assert_int_equal(status.rx_off_map, 8);
    assert_int_equal(status.rx_over_capacity, 9);
    assert_int_equal(status.rx_id_conflict, INT32_MAX);
    assert_int_equal(status.rx_dropped, 11);
}

#define TEST(name) cmocka_unit_test_setup(name, fresh_inbox)

// ---------------------------------------------------------------- versions, maps, signals

static void test_a_state_of_an_unknown_version_is_refused_and_named(void** state)
{
    (void)state;
    verge_vehicle_state_t known = car(1, start), strange = car(2, start);
    known.protocol_version = WIRE_PROTOCOL_VERSION;
    strange.protocol_version = WIRE_PROTOCOL_VERSION + 1;
    strange.x = NAN; // what a field means is not known: no other rule is applied
    assert_int_equal(offer(known, start), INBOX_ACCEPTED);
    assert_int_equal(offer(strange, start), INBOX_VERSION);
    assert_int_equal(box.counters.rx_version, 1);
    assert_int_equal(refusals(&box.counters), 1);
    assert_int_equal(box.fault_version, WIRE_PROTOCOL_VERSION + 1);
    assert_string_equal(inbox_verdict_name(INBOX_VERSION), "version");
    verge_rsu_status_t status = { 0 };
    inbox_fill_status(&box, &(transport_stats){ 0 }, &status);
    assert_int_equal(status.rx_version, 1);
}

static void test_a_vehicle_with_another_map_is_used_without_its_target(void** state)
{
    (void)state;
    inbox_set_map(&box, 0xc0ffee);
    for (int32_t id = 1; id <= 3; ++id) {
        verge_vehicle_state_t one = car(id, start);
        one.target_lane = 4;
        one.map_crc32 = id == 1 ? 0 : id == 2 ? 0xc0ffee : 0xbadbad;
        assert_int_equal(offer(one, start), INBOX_ACCEPTED);
    }
    inbox_snapshot(&box, start, &view);
    assert_int_equal(view.count, 3);
    assert_int_equal(view.vehicles[0].target_lane, 4);
    assert_int_equal(view.vehicles[1].target_lane, 4);
    assert_int_equal(view.vehicles[2].target_lane, VERGE_NO_LANE);
    assert_int_equal(box.counters.rx_other_map, 1);
    assert_int_equal(refusals(&box.counters), 0);
}

static verge_lane_signal_t light(int32_t lane, int64_t utime, verge_signal_state shows)
{
    return (verge_lane_signal_t){ .utime = utime, .lane = lane, .state = (int16_t)shows,
                                  .protocol_version = WIRE_PROTOCOL_VERSION };
}

static inbox_verdict offer_light(verge_lane_signal_t signal, int64_t now)
{
    return inbox_offer_signal(&box, &signal, now, NULL);
}

static void test_signals_are_kept_by_lane_and_each_refusal_is_counted(void** state)
{
    (void)state;
    inbox_set_map(&box, 0xc0ffee);
    assert_int_equal(offer_light(light(9, start, VERGE_SIGNAL_GREEN), start), INBOX_ACCEPTED);
    assert_int_equal(offer_light(light(2, start, VERGE_SIGNAL_RED), start), INBOX_ACCEPTED);
    assert_int_equal(offer_light(light(9, start + 1, VERGE_SIGNAL_RED), start), INBOX_ACCEPTED);
    assert_int_equal(offer_light(light(9, start, VERGE_SIGNAL_GREEN), start), INBOX_OUT_OF_ORDER);
    assert_int_equal(offer_light(light(3, start + 41 * MS, VERGE_SIGNAL_RED), start), INBOX_FUTURE);
    assert_int_equal(offer_light(light(3, start - 2001 * MS, VERGE_SIGNAL_RED), start), INBOX_STALE);
    verge_lane_signal_t bad = light(3, start, (verge_signal_state)7);
    assert_int_equal(offer_light(bad, start), INBOX_OUT_OF_RANGE);
    assert_string_equal(box.fault_field, "state");
    bad = light(3, start, VERGE_SIGNAL_RED);
    bad.protocol_version = 2;
    assert_int_equal(offer_light(bad, start), INBOX_VERSION);
    bad.protocol_version = 1;
    bad.map_crc32 = 5;
    assert_int_equal(offer_light(bad, start), INBOX_OTHER_MAP);
    assert_int_equal(refusals(&box.counters), 5);
    assert_int_equal(box.counters.rx_accepted, 0); // counts states
    verge_signal shown[INBOX_SIGNALS_MAX];
    assert_int_equal(inbox_signals(&box, start, shown), 2);
    assert_int_equal(shown[0].lane_id, 2);
    assert_int_equal(shown[1].lane_id, 9);
    assert_int_equal(shown[1].state, VERGE_SIGNAL_RED);
}

static void test_a_signal_that_nobody_confirms_is_red(void** state)
{
    (void)state;
    verge_signal shown[INBOX_SIGNALS_MAX];
    verge_lane_signal_t timed = light(1, start, VERGE_SIGNAL_GREEN);
    timed.change_utime = start + 5000 * MS;
    offer_light(timed, start);
    offer_light(light(2, start, VERGE_SIGNAL_GREEN), start); // no time of change
    offer_light(light(3, start, VERGE_SIGNAL_OFF), start);
    assert_int_equal(inbox_signals(&box, start + 2000 * MS, shown), 3);
    assert_int_equal(shown[0].state, VERGE_SIGNAL_GREEN);
    CHECK_NEAR(shown[0].change_s, 3.0, 1e-9);
    assert_int_equal(shown[1].state, VERGE_SIGNAL_GREEN);
    assert_true(shown[1].change_s < 0.0);
    inbox_signals(&box, start + 2001 * MS, shown); // silent for longer than drop_ms
    assert_int_equal(shown[0].state, VERGE_SIGNAL_GREEN);
    assert_int_equal(shown[1].state, VERGE_SIGNAL_RED);
    inbox_signals(&box, start + 5001 * MS, shown);
    assert_int_equal(shown[0].state, VERGE_SIGNAL_RED);
    assert_int_equal(shown[2].state, VERGE_SIGNAL_OFF);
    // The clock has stepped back: what they show now is not known, but they are there.
    inbox_forget(&box, VERGE_VEHICLES_MAX, VERGE_CONTROLLED_MAX);
    assert_int_equal(inbox_signals(&box, start - 600000 * MS, shown), 3);
    assert_int_equal(shown[0].state, VERGE_SIGNAL_RED);
    assert_int_equal(offer_light(light(1, start - 600000 * MS, VERGE_SIGNAL_GREEN),
                                 start - 600000 * MS), INBOX_ACCEPTED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_a_state_of_an_unknown_version_is_refused_and_named),
        TEST(test_a_vehicle_with_another_map_is_used_without_its_target),
        TEST(test_signals_are_kept_by_lane_and_each_refusal_is_counted),
        TEST(test_a_signal_that_nobody_confirms_is_red),
        TEST(test_a_state_40_ms_ahead_is_accepted_and_one_more_is_not),
        TEST(test_a_state_2_s_old_is_accepted_and_one_older_is_stale),
        TEST(test_duplicate_and_older_states_are_distinguished),
        TEST(test_two_senders_with_one_id_are_reported_and_the_first_keeps_it),
        TEST(test_an_id_belongs_to_its_first_sender_until_that_is_silent_for_obstacle_ms),
        TEST(test_a_vehicle_heard_on_two_buses_is_one_and_each_bus_has_its_sender),
        TEST(test_senders_and_buses_that_are_unknown_own_no_id),
        TEST(test_accepted_states_are_accepted_again_without_their_senders),
        TEST(test_out_of_range_comes_before_everything_else),
        TEST(test_a_full_table_takes_known_vehicles_and_replaces_forgotten_ones),
        TEST(test_ages_have_their_classes_at_the_exact_borders),
        TEST(test_a_cancellation_is_sent_exactly_once),
        TEST(test_surplus_vehicles_are_obstacles_and_the_planned_keep_their_places),
        TEST(test_projection_agrees_with_driving_in_small_steps),
        TEST(test_a_reversing_vehicle_goes_on_backwards_and_never_turns_round),
        TEST(test_a_braking_vehicle_stops_and_stays_at_rest),
        TEST(test_no_projection_is_faster_than_a_car),
        TEST(test_a_refused_state_changes_only_its_counter),
        TEST(test_views_are_ordered_by_id_whatever_the_order_of_arrival),
        TEST(test_only_vehicles_that_the_last_plan_found_on_a_lane_are_not_projected),
        TEST(test_an_unknown_target_costs_the_target_and_off_the_road_the_place),
        TEST(test_vehicles_that_get_no_plan_for_want_of_room_are_counted),
        TEST(test_a_state_without_heading_or_speed_is_an_obstacle_and_gets_no_plan),
        TEST(test_limits_are_refused_out_of_range_and_out_of_order),
        TEST(test_a_status_carries_all_counters_and_never_wraps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
