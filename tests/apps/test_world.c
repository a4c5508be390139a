/// Goal: the closed loop moves every vehicle as world.h states.
/// Method: plans written by hand, tracks and road ends on a straight road of two lanes.
#include "check.h"
#include "rng.h"

#include "common/world.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/// Lane 0 (y = 0, to x = 200) and lane 1 (y = 4, to x = 200). Vehicle 1 is controlled; 2 drives
/// a track from t = 0.5 to 1.5; 3 is human, 4 m before the end of the road.
static const char TEXT[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"world\", \"road\": { \"lanes\": ["
    "{ \"id\": 0, \"centerline\": [[0, 0], [200, 0]], \"width\": 4, \"speed_limit\": 20,"
    "  \"left\": 1 },"
    "{ \"id\": 1, \"centerline\": [[0, 4], [200, 4]], \"width\": 4, \"speed_limit\": 20,"
    "  \"right\": 0 } ] }, \"vehicles\": ["
    "{ \"id\": 1, \"control\": \"controlled\", \"x\": 20, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 },"
    "{ \"id\": 2, \"control\": \"human\", \"x\": 90, \"y\": 4, \"heading\": 0, \"speed\": 8,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2,"
    "  \"track\": [[0.5, 90, 4, 0, 8], [1.0, 94, 4, 0, 8], [1.5, 98, 3, 0, 8]] },"
    "{ \"id\": 3, \"control\": \"human\", \"x\": 196, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 } ] }";

typedef struct stage {
    scenario scene;
    world    world;
} stage;

static void open_stage(stage* self)
{
    if (!scenario_parse(&self->scene, "world", TEXT, sizeof TEXT - 1, NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    assert_true(world_init(&self->world, &self->scene));
}

static void close_stage(stage* self)
{
    world_free(&self->world);
    scenario_free(&self->scene);
}

/// Points of a plan for vehicle 1, anywhere on the map.
static verge_vehicle_plan random_plan(test_rng* rng)
{
    verge_vehicle_plan plan = { .vehicle_id = 1, .point_count = 31 };
    for (uint32_t i = 0; i < plan.point_count; ++i) {
        plan.points[i] = (verge_point){
            .t = 0.1 * i,
            .x = test_rng_between(rng, 10.0, 190.0),
            .y = test_rng_between(rng, -1.5, 1.5),
            .heading = test_rng_between(rng, -0.3, 0.3),
            .speed = test_rng_between(rng, 0.0, 20.0),
            .acceleration = test_rng_between(rng, -3.0, 3.0),
            .curvature = test_rng_between(rng, -0.1, 0.1),
            .jerk = test_rng_between(rng, -5.0, 5.0),
        };
    }
    return plan;
}

static void put_on(verge_vehicle* state, const verge_point* point)
{
    state->x = point->x;
    state->y = point->y;
    state->heading = point->heading;
    state->speed = point->speed;
}

static void test_a_controlled_vehicle_is_exactly_at_the_points_of_its_plan(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("points");
    stage    self;
    open_stage(&self);
    for (uint32_t round = 0; round < 20; ++round) {
        const verge_vehicle_plan plan = random_plan(&rng);
        put_on(&self.world.vehicles[0].state, &plan.points[0]);
        world_follow(&self.world, &plan, world_time(&self.world));
        for (uint32_t i = 1; i < 30; ++i) {
            world_advance(&self.world);
            const world_vehicle* vehicle = &self.world.vehicles[0];
            const verge_point*   point = &plan.points[i];
            CHECK_SAME_BITS(vehicle->state.x, point->x);
            CHECK_SAME_BITS(vehicle->state.y, point->y);
            CHECK_SAME_BITS(vehicle->state.heading, point->heading);
            CHECK_SAME_BITS(vehicle->state.speed, point->speed);
            CHECK_SAME_BITS(vehicle->state.acceleration, point->acceleration);
            CHECK_SAME_BITS(vehicle->state.yaw_rate, point->curvature * point->speed);
            CHECK_SAME_BITS(vehicle->jerk, point->jerk);
        }
    }
    close_stage(&self);
}

static void test_between_two_points_it_is_on_the_line_between_them(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("between");
    stage    self;
    open_stage(&self);
    const verge_vehicle_plan plan = random_plan(&rng);
    verge_point              at;
    assert_true(world_point_at(&plan, 0.125, &at));
    put_on(&self.world.vehicles[0].state, &at);
    world_follow(&self.world, &plan, -0.125); // made an eighth of a second ago
    for (uint32_t i = 1; i < 25; ++i) {
        world_advance(&self.world);
        const world_vehicle* vehicle = &self.world.vehicles[0];
        const verge_point*   a = &plan.points[i + 1];
        const verge_point*   b = &plan.points[i + 2];
        CHECK_NEAR(vehicle->state.x, 0.75 * a->x + 0.25 * b->x, 1e-9);
        CHECK_NEAR(vehicle->state.y, 0.75 * a->y + 0.25 * b->y, 1e-9);
        CHECK_NEAR(vehicle->state.heading, 0.75 * a->heading + 0.25 * b->heading, 1e-9);
        CHECK_NEAR(vehicle->state.speed, 0.75 * a->speed + 0.25 * b->speed, 1e-9);
    }
    close_stage(&self);
}

/// A plan that comes late, or for another place: the vehicle moves as one with a mass does, and is
/// on the plan after a second.
static void test_what_lies_between_a_vehicle_and_its_plan_is_taken_up_within_a_second(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("take up");
    for (uint32_t round = 0; round < 50; ++round) {
        stage self;
        open_stage(&self);
        self.world.takes_up = true;
        verge_vehicle*     vehicle = &self.world.vehicles[0].state;
        verge_vehicle_plan plan = { .vehicle_id = vehicle->id, .point_count = VERGE_POINTS_MAX };
        const double speed = test_rng_between(&rng, 8.0, 12.0);
        const double x = vehicle->x + test_rng_between(&rng, -1.0, 1.0);
        const double y = vehicle->y + test_rng_between(&rng, -0.5, 0.5);
        for (uint32_t i = 0; i < VERGE_POINTS_MAX; ++i) {
            plan.points[i] = (verge_point){ .t = 0.1 * i, .x = x + 0.1 * i * speed, .y = y,
                                            .speed = speed };
        }
        world_follow(&self.world, &plan, 0.0);
        verge_vehicle before = *vehicle;
        for (uint32_t i = 1; i < 15; ++i) {
            world_advance(&self.world);
            const double way = vehicle->x - before.x;
            CHECK_NEAR(way, 0.05 * (vehicle->speed + before.speed), 0.1);
            assert_true(fabs(vehicle->y - before.y) < 0.12);
            if (i >= 10) {
                CHECK_NEAR(vehicle->x, plan.points[i].x, 1e-9);
                CHECK_NEAR(vehicle->y, plan.points[i].y, 1e-9);
                CHECK_NEAR(vehicle->speed, speed, 1e-9);
            }
            before = *vehicle;
        }
        close_stage(&self);
    }
}

static void test_without_a_plan_it_keeps_its_lane_and_its_speed(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    for (uint32_t i = 0; i < 50; ++i) {
        world_advance(&self.world);
    }
    const verge_vehicle* vehicle = &self.world.vehicles[0].state;
    CHECK_NEAR(vehicle->x, 70.0, 1e-6);
    CHECK_NEAR(vehicle->y, 0.0, 1e-6);
    CHECK_NEAR(vehicle->speed, 10.0, 1e-12);
    assert_null(world_action(&self.world, &self.world.vehicles[0]));
    close_stage(&self);
}

static void test_a_cancelled_plan_ends_in_standstill_on_the_lane(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const verge_vehicle_plan cancelled = { .vehicle_id = 1, .status = VERGE_CANCELLED };
    world_follow(&self.world, &cancelled, 0.0);
    for (uint32_t i = 0; i < 100; ++i) {
        world_advance(&self.world);
    }
    const verge_vehicle* vehicle = &self.world.vehicles[0].state;
    CHECK_SAME_BITS(vehicle->speed, 0.0);
    CHECK_NEAR(vehicle->x, 20.0 + 10.0 * 10.0 / (2.0 * 2.0), 0.1); // v^2 / 2a from 10 m/s
    CHECK_NEAR(vehicle->y, 0.0, 1e-6);
    close_stage(&self);
}

static void test_a_recorded_vehicle_is_there_from_its_first_row_to_its_last(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    for (uint32_t tick = 0; tick <= 20; ++tick) {
        const world_vehicle* vehicle = &self.world.vehicles[1];
        assert_int_equal(vehicle->present, tick >= 5 && tick <= 15);
        if (vehicle->present) {
            CHECK_NEAR(vehicle->state.x, 90.0 + 8.0 * (tick / 10.0 - 0.5), 1e-9);
            CHECK_NEAR(vehicle->state.y, tick <= 10 ? 4.0 : 4.0 - 0.2 * (tick - 10.0), 1e-9);
            assert_int_equal(vehicle->lane, 1);
        }
        world_advance(&self.world);
    }
    close_stage(&self);
}

static void test_a_vehicle_that_drives_off_the_end_of_the_road_leaves(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const world_vehicle* vehicle = &self.world.vehicles[2];
    for (uint32_t tick = 0; tick < 20 && vehicle->present; ++tick) {
        assert_true(vehicle->state.x <= 200.0);
        world_advance(&self.world);
    }
    assert_false(vehicle->present);
    assert_true(vehicle->left);
    verge_vehicle states[VERGE_VEHICLES_MAX];
    const uint32_t count = world_states(&self.world, states);
    for (uint32_t i = 0; i < count; ++i) {
        assert_int_not_equal(states[i].id, 3);
    }
    close_stage(&self);
}

/// Vehicle 1 drives straight on at 10 m/s from its start, with this heading.
static const world_vehicle* send_off(stage* self, double heading)
{
    world_vehicle* vehicle = &self->world.vehicles[0];
    vehicle->state.heading = heading;
    verge_vehicle_plan plan = { .vehicle_id = 1, .point_count = 31 };
    for (uint32_t i = 0; i < plan.point_count; ++i) {
        plan.points[i] = (verge_point){ .t = i, .x = 20.0 + 10.0 * i * cos(heading), .speed = 10.0,
                                        .y = 10.0 * i * sin(heading), .heading = heading };
    }
    world_follow(&self->world, &plan, 0.0);
    return vehicle;
}

static void test_off_the_road_is_on_no_lane_and_not_past_its_end(void** state)
{
    (void)state;
    const double headings[] = { 0.0, 0.2, -0.2, -1.5 };
    for (uint32_t i = 0; i < 4; ++i) {
        stage self;
        open_stage(&self);
        const world_vehicle* vehicle = send_off(&self, headings[i]);
        while (vehicle->present && self.world.tick < 200) {
            const bool on_lane = vehicle->state.y >= -2.0 && vehicle->state.y <= 6.0;
            assert_int_equal(vehicle->off_road, !on_lane);
            world_advance(&self.world);
        }
        // Who passes the end of the road beside it left the road before.
        assert_int_equal(vehicle->off_road, i != 0);
        assert_int_equal(vehicle->left, i < 3);
        close_stage(&self);
    }
    stage self;
    open_stage(&self);
    assert_false(self.world.vehicles[1].off_road); // not there yet is not off the road
    close_stage(&self);
}

static void test_over_the_end_of_a_lane_beside_one_that_goes_on_is_off_the_road(void** state)
{
    (void)state;
    for (int shorter = 0; shorter < 2; ++shorter) {
        char text[sizeof TEXT];
        memcpy(text, TEXT, sizeof TEXT);
        if (shorter != 0) { // lane 0 ends at 100 m, lane 1 goes on
            memcpy(strstr(text, "[200, 0]"), "[100, 0]", 8);
            char* third = strstr(text, "\"x\": 196, \"y\": 0");
            memcpy(third, "\"x\": 196, \"y\": 4", 16);
        }
        stage self;
        if (!scenario_parse(&self.scene, "world", text, sizeof text - 1, NULL)) {
            fail_msg("%s", self.scene.file.error);
        }
        assert_true(world_init(&self.world, &self.scene));
        const world_vehicle* vehicle = send_off(&self, 0.0);
        while (vehicle->present && self.world.tick < 200) {
            world_advance(&self.world);
        }
        assert_true(vehicle->left);
        assert_int_equal(vehicle->off_road, shorter);
        assert_int_equal(world_dead_end(&self.world, 0), shorter);
        close_stage(&self);
    }
}

static void test_a_parked_human_stands_as_it_was_put(void** state)
{
    (void)state;
    char text[sizeof TEXT + 64];
    const char* put = strstr(TEXT, "{ \"id\": 3");
    snprintf(text, sizeof text, "%.*s{ \"parked\": true, \"id\": 3%s", (int)(put - TEXT), TEXT,
             put + strlen("{ \"id\": 3"));
    char* speed = strstr(strstr(text, "\"x\": 196"), "\"speed\": 10");
    memcpy(speed, "\"speed\":  0", 11);
    memcpy(strstr(strstr(text, "\"x\": 196"), "\"heading\": 0"), "\"heading\": 2", 12);
    stage self;
    if (!scenario_parse(&self.scene, "world", text, strlen(text), NULL)) {
        fail_msg("%s", self.scene.file.error);
    }
    assert_true(world_init(&self.world, &self.scene));
    for (int k = 0; k < 100; ++k) {
        world_advance(&self.world);
    }
    const verge_vehicle* parked = &self.world.vehicles[2].state;
    CHECK_NEAR(parked->x, 196.0, 0.0);
    CHECK_NEAR(parked->y, 0.0, 0.0);
    CHECK_NEAR(parked->heading, 2.0, 0.0);
    CHECK_NEAR(parked->speed, 0.0, 0.0);
    close_stage(&self);
}

static void test_the_action_of_a_tick_is_the_active_step(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("action");
    stage    self;
    open_stage(&self);
    verge_vehicle_plan plan = random_plan(&rng);
    plan.action_count = 2;
    plan.actions[0] = (verge_action_step){ .action = VERGE_ACCELERATE, .t0 = 0.0, .t1 = 1.0 };
    plan.actions[1] = (verge_action_step){ .action = VERGE_CHANGE_LEFT, .t0 = 1.0, .t1 = 2.0 };
    world_follow(&self.world, &plan, 0.0);
    for (uint32_t tick = 0; tick < 25; ++tick) {
        const verge_action_step* step = world_action(&self.world, &self.world.vehicles[0]);
        if (tick < 20) {
            assert_non_null(step);
            assert_int_equal(step->action, tick < 10 ? VERGE_ACCELERATE : VERGE_CHANGE_LEFT);
        } else {
            assert_null(step);
        }
        world_advance(&self.world);
    }
    close_stage(&self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_controlled_vehicle_is_exactly_at_the_points_of_its_plan),
        cmocka_unit_test(test_between_two_points_it_is_on_the_line_between_them),
        cmocka_unit_test(
            test_what_lies_between_a_vehicle_and_its_plan_is_taken_up_within_a_second),
        cmocka_unit_test(test_without_a_plan_it_keeps_its_lane_and_its_speed),
        cmocka_unit_test(test_a_cancelled_plan_ends_in_standstill_on_the_lane),
        cmocka_unit_test(test_a_recorded_vehicle_is_there_from_its_first_row_to_its_last),
        cmocka_unit_test(test_a_vehicle_that_drives_off_the_end_of_the_road_leaves),
        cmocka_unit_test(test_off_the_road_is_on_no_lane_and_not_past_its_end),
        cmocka_unit_test(test_over_the_end_of_a_lane_beside_one_that_goes_on_is_off_the_road),
        cmocka_unit_test(test_a_parked_human_stands_as_it_was_put),
        cmocka_unit_test(test_the_action_of_a_tick_is_the_active_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
