/// Goal: a vehicle drives the trajectories of its on-vehicle unit as units.h and world.h state, and
/// brakes to a stop in their path when they end.
/// Method: trajectories written by hand on a straight road of two lanes.
#include "check.h"

#include "publish/units.h"

#include "verge/wire.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/// Lane 0 (y = 0) and lane 1 (y = 4), to x = 600. Vehicle 1 is controlled, 2 is human.
static const char TEXT[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"units\", \"road\": { \"lanes\": ["
    "{ \"id\": 0, \"centerline\": [[0, 0], [600, 0]], \"width\": 4, \"speed_limit\": 20,"
    "  \"left\": 1 },"
    "{ \"id\": 1, \"centerline\": [[0, 4], [600, 4]], \"width\": 4, \"speed_limit\": 20,"
    "  \"right\": 0 } ] }, \"vehicles\": ["
    "{ \"id\": 1, \"control\": \"controlled\", \"x\": 20, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 },"
    "{ \"id\": 2, \"control\": \"human\", \"x\": 90, \"y\": 4, \"heading\": 0, \"speed\": 8,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 } ] }";

static const int64_t START = INT64_C(1700000000000000); // [us] wall clock at t = 0
static const double  STEP = 0.5; // [s] between two points

typedef struct stage {
    scenario scene;
    world    world;
    metrics  metrics;
    units    units;
    FILE*    run;
} stage;

static void open_stage(stage* self)
{
    if (!scenario_parse(&self->scene, "units", TEXT, sizeof TEXT - 1, NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    assert_true(world_init(&self->world, &self->scene));
    assert_true(metrics_init(&self->metrics, &self->world));
    self->run = tmpfile();
    assert_non_null(self->run);
    units_init(&self->units, &self->world, START, self->run, true);
}

static void close_stage(stage* self)
{
    fclose(self->run);
    metrics_free(&self->metrics);
    world_free(&self->world);
    scenario_free(&self->scene);
}

static void advance(stage* self, uint32_t ticks)
{
    for (uint32_t i = 0; i < ticks; ++i) {
        world_advance(&self->world);
        units_tick(&self->units, &self->world);
        metrics_tick(&self->metrics, &self->world);
    }
}

static const world_vehicle* ego(const stage* self)
{
    return &self->world.vehicles[0];
}

/// From where vehicle 1 is now, at `speed` and with `slope` of y over x, for 15 s.
static verge_vehicle_trajectory_t trajectory(const stage* self, double speed, double slope)
{
    verge_vehicle_trajectory_t message = {
        .utime = START + world_utime(&self->world),
        .vehicle_id = 1,
        .mode = WIRE_FOLLOWING,
        .mode_vehicle = -1,
        .followed_cycle = 7,
        .rsu_id = 1,
        .protocol_version = WIRE_PROTOCOL_VERSION,
        .why_vehicle = -1,
        .why_lane = -1,
        .lane = 0,
        .action = 1,
        .brake_light = 1,
        .turn_signal = -1,
        .dt_ms = 500,
        .point_count = 31,
    };
    message.valid_until_utime = message.utime + 400000;
    for (int32_t i = 0; i < 31; ++i) {
        message.points[i] = (verge_plan_point_t){
            .x = ego(self)->state.x + i * STEP * speed,
            .y = ego(self)->state.y + i * STEP * speed * slope,
            .heading = (float)slope, .speed = (float)speed,
        };
    }
    return message;
}

static units_verdict hear(stage* self, const verge_vehicle_trajectory_t* message)
{
    return units_hear(&self->units, &self->world, message);
}

/// What the run file holds until now.
static const char* written(stage* self)
{
    static char text[8192];
    rewind(self->run);
    text[fread(text, 1, sizeof text - 1, self->run)] = '\0';
    return text;
}

static void test_a_vehicle_drives_the_trajectory_and_not_the_plan(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const verge_vehicle_trajectory_t message = trajectory(&self, 10.5, 0.01);
    verge_vehicle_plan plan = { .vehicle_id = 1, .point_count = 2 };
    plan.points[0].x = 300.0;
    plan.points[1] = (verge_point){ .t = 3.0, .x = 400.0 };
    assert_int_equal(hear(&self, &message), UNITS_DRIVEN);
    world_follow(&self.world, &plan, 0.0);
    advance(&self, 3);
    CHECK_NEAR(ego(&self)->state.x, 20.0 + 0.3 * 10.5, 1e-9);
    CHECK_NEAR(ego(&self)->state.y, 0.3 * 10.5 * 0.01, 1e-9);
    CHECK_NEAR(ego(&self)->state.speed, 10.5, 1e-9);
    assert_int_equal(units_cycle(&self.units, 0), 7);
    const verge_action_step* action = world_action(&self.world, ego(&self));
    assert_non_null(action);
    assert_int_equal(action->action, VERGE_ACCELERATE);
    assert_true(action->brake_light);
    assert_int_equal(action->turn_signal, -1);
    close_stage(&self);
}

static void test_the_newer_of_two_trajectories_is_driven(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle_trajectory_t first = trajectory(&self, 10.5, 0.0);
    verge_vehicle_trajectory_t second = trajectory(&self, 9.5, 0.0);
    second.sequence = 1;
    verge_vehicle_trajectory_t before = first;
    before.utime -= 1;
    before.sequence = 2;
    assert_int_equal(hear(&self, &first), UNITS_DRIVEN);
    assert_int_equal(hear(&self, &second), UNITS_DRIVEN);
    assert_int_equal(hear(&self, &second), UNITS_OLDER);
    assert_int_equal(hear(&self, &first), UNITS_OLDER);
    assert_int_equal(hear(&self, &before), UNITS_OLDER);
    advance(&self, 1);
    CHECK_NEAR(ego(&self)->state.speed, 9.5, 1e-9);
    assert_int_equal(self.units.counts[UNITS_DRIVEN], 2);
    assert_int_equal(self.units.counts[UNITS_OLDER], 3);
    close_stage(&self);
}

static void test_far_late_early_and_invalid_trajectories_are_refused_and_counted(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    advance(&self, 10);
    const verge_vehicle_trajectory_t good = trajectory(&self, 10.0, 0.0);
    const struct {
        double  x, speed;   // added to each point
        int64_t utime;      // [us] added to the instants
        int64_t valid;      // [us] after utime
        int16_t mode;
        units_verdict verdict;
    } cases[] = {
        { 1.1, 0.0, 0, 400000, 0, UNITS_FAR },        { -1.1, 0.0, 0, 400000, 0, UNITS_FAR },
        { 0.0, 1.1, 0, 400000, 0, UNITS_FAR },        { 0.0, -1.1, 0, 400000, 0, UNITS_FAR },
        { -5.0, 0.0, -500000, 900000, 0, UNITS_DRIVEN }, // half a second ago it was 5 m behind
        { 0.0, 0.0, -500000, 900000, 0, UNITS_FAR },
        { 0.0, 0.0, -500000, 499999, 0, UNITS_LATE }, { 0.0, 0.0, -900000, 0, 0, UNITS_LATE },
        { 1.0, 0.0, 100000, 400000, 0, UNITS_DRIVEN }, { 0.0, 0.0, 200000, 400000, 0, UNITS_EARLY },
        { 0.0, 0.0, 0, 400000, 4, UNITS_INVALID },    { 0.9, 0.9, 0, 400000, 0, UNITS_DRIVEN },
    };
    uint64_t counts[UNITS_VERDICTS] = { 0 };
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        verge_vehicle_trajectory_t message = good;
        message.utime += cases[i].utime;
        message.valid_until_utime = message.utime + cases[i].valid;
        message.mode = cases[i].mode;
        for (int32_t k = 0; k < message.point_count; ++k) {
            message.points[k].x += cases[i].x;
            message.points[k].speed += (float)cases[i].speed;
        }
        self.units.each[0].utime = INT64_MIN; // each one alone
        assert_int_equal(hear(&self, &message), cases[i].verdict);
        ++counts[cases[i].verdict];
    }
    assert_memory_equal(counts, self.units.counts, sizeof counts);
    close_stage(&self);
}

static void test_trajectories_of_other_vehicles_are_ignored(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle_trajectory_t message = trajectory(&self, 10.0, 0.0);
    const int32_t ids[] = { 2, 3 }; // a human driver, and a vehicle that is not in the scene
    for (uint32_t i = 0; i < 2; ++i) {
        message.vehicle_id = ids[i];
        assert_int_equal(hear(&self, &message), UNITS_IGNORED);
    }
    assert_string_equal(written(&self), "");
    close_stage(&self);
}

static void test_after_the_last_trajectory_a_vehicle_brakes_to_a_stop_in_its_path(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const double slope = 0.05; // on a lane change: 0.9 m to the left when it stands
    verge_vehicle_trajectory_t message = trajectory(&self, 10.0, slope);
    assert_int_equal(hear(&self, &message), UNITS_DRIVEN);
    advance(&self, 4);
    CHECK_NEAR(ego(&self)->state.speed, 10.0, 1e-9); // valid for 0.4 s
    assert_non_null(world_action(&self.world, ego(&self)));
    double before = 10.0;
    for (uint32_t i = 0; i < 40; ++i) {
        advance(&self, 1);
        CHECK_NEAR(ego(&self)->state.speed, fmax(before - 0.3, 0.0), 1e-9);
        CHECK_NEAR(ego(&self)->state.y, slope * (ego(&self)->state.x - 20.0), 1e-9);
        CHECK_NEAR(ego(&self)->state.heading, (double)(float)slope, 1e-9);
        before = ego(&self)->state.speed;
        assert_null(world_action(&self.world, ego(&self)));
        assert_int_equal(units_cycle(&self.units, 0), -1);
    }
    CHECK_SAME_BITS(ego(&self)->state.speed, 0.0);
    const double driven = 4.0 + 10.0 * 10.0 / (2.0 * 3.0); // v^2 / 2a after 0.4 s
    CHECK_NEAR(ego(&self)->state.x, 20.0 + driven, 0.1); // the path is 0.1 % longer than x
    close_stage(&self);
}

static void test_a_short_trajectory_is_left_at_its_end_for_the_lane(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle_trajectory_t message = trajectory(&self, 10.0, 0.0);
    message.point_count = 2; // 0.5 s
    message.valid_until_utime = message.utime + 3000000;
    assert_int_equal(hear(&self, &message), UNITS_DRIVEN);
    advance(&self, 5);
    CHECK_NEAR(ego(&self)->state.speed, 10.0, 1e-9);
    advance(&self, 40);
    CHECK_SAME_BITS(ego(&self)->state.speed, 0.0);
    CHECK_NEAR(ego(&self)->state.x, 20.0 + 5.0 + 10.0 * 10.0 / (2.0 * 3.0), 0.05);
    close_stage(&self);
}

static void test_a_vehicle_that_lost_its_unit_drives_the_next_plan(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle_trajectory_t message = trajectory(&self, 10.0, 0.0);
    hear(&self, &message);
    advance(&self, 10); // 0.4 s of trajectory, 0.6 s of braking
    CHECK_NEAR(ego(&self)->state.speed, 10.0 - 0.6 * 3.0, 1e-9);
    verge_vehicle_plan plan = { .vehicle_id = 1, .point_count = 2 };
    plan.points[0] = (verge_point){ .x = ego(&self)->state.x, .speed = 8.0 };
    plan.points[1] = (verge_point){ .t = 3.0, .x = ego(&self)->state.x + 24.0, .speed = 8.0 };
    world_follow(&self.world, &plan, world_time(&self.world));
    advance(&self, 5);
    CHECK_NEAR(ego(&self)->state.speed, 8.0, 1e-9);
    close_stage(&self);
}

static void test_where_units_are_expected_plans_alone_are_not_driven(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    world_expect_units(&self.world);
    verge_vehicle_plan plan = { .vehicle_id = 1, .point_count = 2 };
    plan.points[1] = (verge_point){ .t = 30.0, .x = 300.0, .speed = 20.0 };
    for (uint32_t i = 0; i < 60; ++i) {
        world_follow(&self.world, &plan, 0.0);
        advance(&self, 1);
        CHECK_NEAR(ego(&self)->state.speed, i < 10 ? 10.0 : fmax(10.0 - 0.3 * (i - 9), 0.0), 1e-9);
        assert_null(ego(&self)->mode);
    }
    CHECK_NEAR(self.world.vehicles[1].state.y, 4.0, 1e-9);
    assert_true(self.world.vehicles[1].state.speed >= 8.0); // the human drives on
    assert_string_equal(written(&self), "");
    close_stage(&self);
}

static void test_changes_of_the_mode_are_written_and_counted(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const struct { int16_t mode, reason; int32_t vehicle, cycle; } cases[] = {
        { WIRE_FOLLOWING, WIRE_UNIT_NONE, -1, 31 },  { WIRE_FOLLOWING, WIRE_UNIT_NONE, -1, 32 },
        { WIRE_DEPARTING, WIRE_UNIT_CONTACT, 2, 33 }, { WIRE_DEPARTING, WIRE_UNIT_CONTACT, 4, 33 },
        { WIRE_ALONE, WIRE_UNIT_SILENT, -1, -1 },    { WIRE_FOLLOWING, WIRE_UNIT_NONE, -1, 40 },
    };
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        verge_vehicle_trajectory_t message = trajectory(&self, 10.0, 0.0);
        message.mode = cases[i].mode;
        message.mode_reason = cases[i].reason;
        message.mode_vehicle = cases[i].vehicle;
        message.followed_cycle = cases[i].cycle;
        assert_int_equal(hear(&self, &message), UNITS_DRIVEN);
        advance(&self, 2);
    }
    advance(&self, 5);
    assert_string_equal(written(&self),
        "{\"t\":0,\"unit\":{\"id\":1,\"mode\":\"following\",\"reason\":\"none\",\"vehicle\":null,"
        "\"cycle\":31}}\n"
        "{\"t\":0.4,\"unit\":{\"id\":1,\"mode\":\"departing\",\"reason\":\"contact\",\"vehicle\":2,"
        "\"cycle\":33}}\n"
        "{\"t\":0.6,\"unit\":{\"id\":1,\"mode\":\"departing\",\"reason\":\"contact\",\"vehicle\":4,"
        "\"cycle\":33}}\n"
        "{\"t\":0.8,\"unit\":{\"id\":1,\"mode\":\"alone\",\"reason\":\"silent\",\"vehicle\":null,"
        "\"cycle\":null}}\n"
        "{\"t\":1,\"unit\":{\"id\":1,\"mode\":\"following\",\"reason\":\"none\",\"vehicle\":null,"
        "\"cycle\":40}}\n"
        "{\"t\":1.5,\"unit\":{\"id\":1,\"mode\":\"none\",\"reason\":\"none\",\"vehicle\":null,"
        "\"cycle\":null}}\n");
    FILE* out = tmpfile();
    char  text[4096] = "";
    metrics_write(out, &self.metrics, false, "");
    rewind(out);
    text[fread(text, 1, sizeof text - 1, out)] = '\0';
    fclose(out);
    assert_non_null(strstr(text, ",\"units\":{\"1\":{\"following\":0.8,\"departing\":0.4,"
                                 "\"alone\":0.2,\"none\":0.3,\"changes\":4}}}"));
    close_stage(&self);
}

static void test_metrics_without_units_do_not_mention_them(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    advance(&self, 3);
    FILE* out = tmpfile();
    char  text[4096] = "";
    metrics_write(out, &self.metrics, false, "");
    rewind(out);
    text[fread(text, 1, sizeof text - 1, out)] = '\0';
    fclose(out);
    assert_null(strstr(text, "units"));
    close_stage(&self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_vehicle_drives_the_trajectory_and_not_the_plan),
        cmocka_unit_test(test_the_newer_of_two_trajectories_is_driven),
        cmocka_unit_test(test_far_late_early_and_invalid_trajectories_are_refused_and_counted),
        cmocka_unit_test(test_trajectories_of_other_vehicles_are_ignored),
        cmocka_unit_test(test_after_the_last_trajectory_a_vehicle_brakes_to_a_stop_in_its_path),
        cmocka_unit_test(test_a_short_trajectory_is_left_at_its_end_for_the_lane),
        cmocka_unit_test(test_a_vehicle_that_lost_its_unit_drives_the_next_plan),
        cmocka_unit_test(test_where_units_are_expected_plans_alone_are_not_driven),
        cmocka_unit_test(test_changes_of_the_mode_are_written_and_counted),
        cmocka_unit_test(test_metrics_without_units_do_not_mention_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
