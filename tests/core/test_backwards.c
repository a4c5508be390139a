/// Goal: a vehicle that moves against its lane, faces back or stands across it is what it is: for
///       the decision, for the prediction and for the vehicles behind it.
/// Method: scenes of two vehicles on straight lanes, against plain arithmetic.
#include "decide.h"

#include "verge/plan.h"
#include "verge/simulate.h"

static verge_track bodies[VERGE_VEHICLES_MAX];
static verge_tracks tracks = { .tracks_max = VERGE_VEHICLES_MAX, .of = bodies };

/// Positions as the stage `place` finds them.
static void place(stage* at)
{
    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    verge_scene placed = verge_scene_make(at->road, vehicles, at->positions, VERGE_VEHICLES_MAX);
    assert_int_equal(verge_scene_place(&placed, 0, at->vehicles, at->count, NULL), VERGE_OK);
    memcpy(at->vehicles, vehicles, sizeof vehicles);
    stage_begin(at);
}

static verge_vehicle* other(stage* at, double s, double turn, double speed)
{
    verge_vehicle* vehicle = stage_add(at, false, 0, s, 0.0, speed, -1);
    vehicle->heading = turn;
    return vehicle;
}

static void speed_along_the_lane_is_signed_by_heading_and_direction(void** state)
{
    (void)state;
    static const struct { double turn, speed, along; } cases[] = {
        { 0.1, 8.0, 8.0 }, { 0.1, -3.0, -3.0 }, { M_PI, 8.0, -8.0 }, { -3.0, -3.0, 3.0 },
        { M_PI - 6.0 * M_PI, 5.0, -5.0 }, { 2e9 * M_PI, 0.0, 0.0 },
    };
    stage* at = stage_open_best(1, 500.0);
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
        stage_clear(at);
        other(at, 200.0, cases[k].turn, cases[k].speed);
        place(at);
        assert_int_equal(at->positions[0].lane_id, 0);
        CHECK_NEAR(at->root.v[0], cases[k].along, 1e-6);
        assert_true(vg_flow_holds(&at->scene, &at->root));
    }
    stage_close(at);
}

static void whoever_moves_against_the_lane_goes_on_over_its_start(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 100.0);
    at->points[1][0][1] = at->points[1][1][1] = 0.0; // lane 1 continues lane 0
    at->points[1][0][0] = 100.0;
    at->points[1][1][0] = 200.0;
    at->lanes[0].left = at->lanes[1].right = VERGE_NO_LANE;
    at->lanes[0].successors[0] = 1;
    at->lanes[0].successor_count = 1;
    stage_build(at);
    static const struct { double turn, speed; } cases[] = { { M_PI, 10.0 }, { 0.0, -10.0 } };
    for (size_t k = 0; k < 2; ++k) {
        stage_clear(at);
        verge_vehicle* vehicle = other(at, 110.0, cases[k].turn, cases[k].speed);
        vehicle->y = 0.3;
        place(at);
        assert_int_equal(at->positions[0].lane_id, 1);
        stage_predict(at, NULL, &tracks);
        for (uint32_t i = 0; i < at->def.points; ++i) {
            CHECK_NEAR(bodies[0].x[i], 110.0 - 10.0 * at->def.point_s * i, 0.02);
            CHECK_NEAR(bodies[0].y[i], 0.3, 0.02);
            CHECK_NEAR(bodies[0].cos_heading[i], cos(cases[k].turn), 1e-6);
            CHECK_NEAR(bodies[0].speed[i], cases[k].speed, 1e-6);
        }
        const uint8_t none = 0;
        stage_step(at, &at->root, &none);
        assert_int_equal(at->root.lane[0], 0);
        CHECK_NEAR(vg_lane_s(&at->road->lanes[0], at->root.station[0]), 95.0, 0.02);
    }
    stage_close(at);
}

static void a_body_across_the_lane_reaches_as_far_as_its_corners_and_stays_turned(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    for (int degrees = 0; degrees <= 180; degrees += 15) {
        const double turn = degrees * M_PI / 180.0;
        const double along = fabs(cos(turn)), across = fabs(sin(turn));
        stage_clear(at);
        other(at, 200.0, turn, 0.0);
        place(at);
        CHECK_NEAR(at->scene.half_length[0], 2.5 * along + 1.0 * across, 1e-5);
        CHECK_NEAR(at->scene.half_width[0], 2.5 * across + 1.0 * along, 1e-5);
        stage_predict(at, NULL, &tracks);
        const uint32_t last = at->def.points - 1;
        CHECK_NEAR(bodies[0].cos_heading[last], cos(turn), 1e-12);
        CHECK_NEAR(bodies[0].sin_heading[last], sin(turn), 1e-12);
        CHECK_NEAR(bodies[0].x[last], 200.0, 0.2);
    }
    at->def.search = VERGE_SEARCH_PAPER; // bodies of the paper have no heading
    stage_begin(at);
    CHECK_NEAR(at->scene.half_length[0], 2.5, 0.0);
    CHECK_NEAR(at->scene.half_width[0], 1.0, 0.0);
    stage_close(at);
}

static void no_decision_keeps_its_speed_towards_an_oncoming_vehicle(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    const double gap = 40.0; // more than 10 m/s needs before a body that stands
    for (double speed = 0.0; speed <= 15.0; speed += 5.0) {
        stage_clear(at);
        stage_add(at, true, 0, 100.0, 0.0, 10.0, -1);
        other(at, 105.0 + gap, M_PI, speed);
        place(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        const bool keeps = (moves.legal[0] & 1u << VERGE_KEEP_SPEED) != 0;
        const double closing = 10.0 + speed, left = gap - closing * at->def.step_s;
        assert_int_equal(keeps, left - 0.5 * 10.0 > 3.0 * closing);
    }
    stage_close(at);
}

/// One vehicle planned before another in its lane: the smallest distance in closed loop. [m]
static double approach(double gap, double turn, double other_speed, double* braking)
{
    stage* at = stage_open_best(1, 900.0);
    const verge_planner_def def = at->def;
    const size_t size = verge_planner_memory_size(&def);
    void* memory = aligned_alloc(64, (size + 63) / 64 * 64);
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, size), VERGE_OK);
    verge_vehicle both[2] = { verge_vehicle_default(), verge_vehicle_default() };
    both[0].controlled = true;
    both[0].x = 100.0;
    both[0].speed = 10.0;
    both[1].id = 1;
    both[1].x = 100.0 + gap;
    both[1].heading = turn;
    both[1].speed = other_speed;
    static verge_plan plan;
    double least = gap;
    *braking = 0.0;
    for (int64_t cycle = 0; cycle < 40 && both[0].speed > 0.05; ++cycle) {
        assert_int_equal(verge_planner_step(planner, 500000 * cycle, both, 2, &plan), VERGE_OK);
        for (uint32_t k = 1; k <= 5; ++k) {
            const verge_point* p = &plan.vehicles[0].points[k];
            both[0].x = p->x;
            both[0].y = p->y;
            both[0].heading = p->heading;
            both[0].speed = p->speed;
            both[0].acceleration = p->acceleration;
            both[1].x += other_speed * 0.1 * cos(turn);
            least = fmin(least, verge_vehicles_distance(&both[0], &both[1]));
            *braking = fmax(*braking, -p->acceleration);
        }
    }
    free(memory);
    stage_close(at);
    return least;
}

static void a_vehicle_stops_in_time_before_a_wreck_at_any_angle(void** state)
{
    (void)state;
    for (int degrees = 0; degrees <= 180; degrees += 15) {
        double braking = 0.0;
        CHECK_BETWEEN(approach(60.0, degrees * M_PI / 180.0, 0.0, &braking), 1.0, 120.0);
        CHECK_AT_MOST(braking, 4.0);
    }
}

static void a_vehicle_stands_before_an_oncoming_or_reversing_one_arrives(void** state)
{
    (void)state;
    for (double speed = 1.0; speed <= 9.0; speed += 2.0) {
        double braking = 0.0;
        CHECK_BETWEEN(approach(120.0, M_PI, speed, &braking), 1.0, 120.0);
        CHECK_AT_MOST(braking, 5.0);
        CHECK_BETWEEN(approach(120.0, 0.0, -speed, &braking), 1.0, 120.0);
        CHECK_AT_MOST(braking, 5.0);
    }
}

static void a_controlled_vehicle_that_faces_back_or_reverses_brakes_and_is_seen(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    stage_add(at, true, 0, 200.0, 0.0, 5.0, -1)->heading = M_PI;
    stage_add(at, true, 0, 150.0, 0.0, 5.0, -1);
    stage_add(at, true, 0, 100.0, 0.0, -3.0, -1);
    stage_add(at, true, 0, 50.0, 0.0, -0.1, -1); // stands: the error of a measurement
    place(at);
    assert_int_equal(at->scene.controlled_count, 2);
    assert_int_equal(at->scene.count, 4);
    assert_false(vg_scene_moves_along(&at->given, 0) || vg_scene_moves_along(&at->given, 2));
    assert_true(vg_scene_moves_along(&at->given, 1) && vg_scene_moves_along(&at->given, 3));
    stage_close(at);
}

static void a_controlled_vehicle_that_reverses_comes_to_rest_within_its_limits(void** state)
{
    (void)state;
    static const double accelerations[] = { 0.0, -3.0, 4.0 };
    stage* at = stage_open_best(1, 500.0);
    const size_t size = (verge_planner_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &at->def, memory, size), VERGE_OK);
    static verge_plan plan;
    for (double speed = -15.0; speed < -0.2; speed += 0.7) {
        for (size_t i = 0; i < 3; ++i) {
            verge_vehicle vehicle = verge_vehicle_default();
            vehicle.controlled = true;
            vehicle.x = 200.0;
            vehicle.heading = 0.1;
            vehicle.speed = speed;
            vehicle.acceleration = accelerations[i];
            assert_int_equal(verge_planner_step(planner, 0, &vehicle, 1, &plan), VERGE_OK);
            const verge_vehicle_plan* of = &plan.vehicles[0];
            assert_int_equal(of->status, VERGE_FALLBACK_BRAKE);
            CHECK_NEAR(of->points[0].speed, speed, 0.0);
            for (uint32_t k = 1; k < of->point_count; ++k) {
                const verge_point *p = &of->points[k], *q = p - 1;
                const double mean = 0.5 * (p->speed + q->speed) * at->def.point_s;
                CHECK_NEAR(p->x - q->x, mean * cos(0.1), 5e-3);
                CHECK_NEAR(p->y - q->y, mean * sin(0.1), 5e-3);
                CHECK_BETWEEN(p->speed - q->speed, -0.31, 0.41);
                CHECK_AT_MOST(p->speed, 0.0);
            }
            const double rest = fmin(speed + 3.0 * (3.0 - 0.75), 0.0);
            CHECK_BETWEEN(of->points[of->point_count - 1].speed, rest - 1.5, 0.0);
        }
    }
    free(memory);
    stage_close(at);
}

static void simulated_humans_go_on_backwards_and_stop_for_what_they_meet(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    const size_t size = (verge_humans_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_humans* humans = NULL;
    assert_int_equal(verge_humans_init(&humans, &at->def, memory, size), VERGE_OK);
    other(at, 300.0, M_PI, 8.0);
    other(at, 60.0, 0.0, 0.0)->controlled = true; // never moves here
    other(at, 400.0, 0.0, -2.0);
    const double turned = at->vehicles[0].heading;
    for (int k = 0; k < 100; ++k) {
        assert_int_equal(verge_humans_advance(humans, at->road, NULL, at->vehicles, 3, 0.1),
                         VERGE_OK);
    }
    CHECK_NEAR(at->vehicles[0].x, 220.0, 2.0);
    CHECK_NEAR(at->vehicles[2].x, 380.0, 0.5);
    for (int k = 0; k < 400; ++k) {
        assert_int_equal(verge_humans_advance(humans, at->road, NULL, at->vehicles, 3, 0.1),
                         VERGE_OK);
    }
    CHECK_BETWEEN(at->vehicles[0].x, 65.5, 75.0);
    CHECK_NEAR(at->vehicles[0].speed, 0.0, 0.05);
    CHECK_NEAR(at->vehicles[0].heading, turned, 1e-6);
    free(memory);
    stage_close(at);
}

static void simulated_humans_stay_possible_vehicles_whatever_way_they_face(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("facing any way");
    stage* at = stage_open(2, 500.0);
    const size_t size = (verge_humans_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_humans* humans = NULL;
    assert_int_equal(verge_humans_init(&humans, &at->def, memory, size), VERGE_OK);
    for (uint32_t k = 0; k < test_rounds(300); ++k) {
        stage_clear(at);
        const double speed = k % 3 == 0 ? 0.0 : test_rng_between(&rng, -15.0, 30.0);
        other(at, 250.0, test_rng_between(&rng, -9.0, 9.0), speed);
        for (int tick = 0; tick < 30; ++tick) {
            const verge_vehicle before = at->vehicles[0];
            assert_int_equal(verge_humans_advance(humans, at->road, NULL, at->vehicles, 1, 0.1),
                             VERGE_OK);
            const verge_vehicle* now = &at->vehicles[0];
            verge_vehicle_fault fault;
            if (!verge_vehicle_check(now, &fault)) {
                fail_msg("%s is %g", fault.field, fault.value);
            }
            CHECK_AT_MOST(fabs(remainder(now->heading - before.heading, 2.0 * M_PI)), 0.2001);
            CHECK_AT_MOST(fabs(now->acceleration), 5.0);
        }
    }
    free(memory);
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(speed_along_the_lane_is_signed_by_heading_and_direction),
        cmocka_unit_test(whoever_moves_against_the_lane_goes_on_over_its_start),
        cmocka_unit_test(a_body_across_the_lane_reaches_as_far_as_its_corners_and_stays_turned),
        cmocka_unit_test(no_decision_keeps_its_speed_towards_an_oncoming_vehicle),
        cmocka_unit_test(a_vehicle_stops_in_time_before_a_wreck_at_any_angle),
        cmocka_unit_test(a_vehicle_stands_before_an_oncoming_or_reversing_one_arrives),
        cmocka_unit_test(a_controlled_vehicle_that_faces_back_or_reverses_brakes_and_is_seen),
        cmocka_unit_test(a_controlled_vehicle_that_reverses_comes_to_rest_within_its_limits),
        cmocka_unit_test(simulated_humans_go_on_backwards_and_stop_for_what_they_meet),
        cmocka_unit_test(simulated_humans_stay_possible_vehicles_whatever_way_they_face),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
