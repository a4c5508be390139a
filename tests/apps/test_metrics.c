/// Goal: the metrics agree with their definitions in metrics.h.
/// Method: vehicles are placed by hand at each tick on a straight road of two lanes, so that
/// distances and times are closed forms.
#include "check.h"
#include "rng.h"

#include "common/metrics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/// Lanes 0 (y = 0) and 1 (y = 4) from x = -1000 to 900; vehicle 1 keeps lane 0, 2 changes from
/// lane 0 to 1, 3 is human.
static const char TEXT[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"metrics\", \"road\": { \"lanes\": ["
    "{ \"id\": 0, \"centerline\": [[-1000, 0], [900, 0]], \"width\": 4, \"speed_limit\": 20,"
    "  \"left\": 1 },"
    "{ \"id\": 1, \"centerline\": [[-1000, 4], [900, 4]], \"width\": 4, \"speed_limit\": 20,"
    "  \"right\": 0 } ] }, \"vehicles\": ["
    "{ \"id\": 1, \"control\": \"controlled\", \"x\": 0, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2, \"target_lane\": 0 },"
    "{ \"id\": 2, \"control\": \"controlled\", \"x\": 50, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2, \"target_lane\": 1 },"
    "{ \"id\": 3, \"control\": \"human\", \"x\": 100, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 } ] }";

typedef struct stage {
    scenario scene;
    world    world;
    metrics  metrics;
} stage;

static void open_stage(stage* self)
{
    if (!scenario_parse(&self->scene, "metrics", TEXT, sizeof TEXT - 1, NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    assert_true(world_init(&self->world, &self->scene));
    assert_true(metrics_init(&self->metrics, &self->world));
}

static void close_stage(stage* self)
{
    metrics_free(&self->metrics);
    world_free(&self->world);
    scenario_free(&self->scene);
}

static void put(stage* self, uint32_t index, double x, double y, double heading, double speed)
{
    verge_vehicle* state = &self->world.vehicles[index].state;
    state->x = x;
    state->y = y;
    state->heading = heading;
    state->speed = speed;
}

static void tick(stage* self)
{
    metrics_tick(&self->metrics, &self->world);
    ++self->world.tick;
}

static void test_finish_and_reached_times_are_the_first_instants(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    const double ys[] = { 0.0, 1.9, 2.1, 3.4, 3.6, 2.9, 0.0 }; // in lane 1 from 2.0, close from 3.5
    for (uint32_t i = 0; i < 7; ++i) {
        put(&self, 1, 50.0 + i, ys[i], 0.0, 10.0);
        assert_false(i <= 3 && metrics_success(&self.metrics));
        tick(&self);
    }
    CHECK_NEAR(self.metrics.vehicles[1].finish_time, 0.2, 1e-12);
    CHECK_NEAR(self.metrics.vehicles[1].reached_time, 0.4, 1e-12);
    CHECK_NEAR(metrics_finish_mean(&self.metrics), 0.2, 1e-12);  // the keeper does not count
    CHECK_NEAR(metrics_reached_mean(&self.metrics), 0.4, 1e-12);
    assert_true(self.metrics.vehicles[0].keeps);
    assert_false(self.metrics.vehicles[2].intends);
    assert_true(metrics_success(&self.metrics));
    close_stage(&self);
}

static void test_a_contact_counts_once_and_ends_success_only_with_a_controlled_vehicle(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    self.world.vehicles[1].state.target_lane = 0; // every vehicle is in its target lane
    self.metrics.vehicles[1].intends = false;
    tick(&self);
    assert_true(metrics_success(&self.metrics));
    CHECK_NEAR(self.metrics.min_distance, 45.0, 1e-9);
    for (uint32_t i = 0; i < 3; ++i) { // in contact, apart, in contact again
        put(&self, 0, i == 1 ? 10.0 : 46.0, 0.0, 0.0, 10.0);
        tick(&self);
    }
    assert_int_equal(self.metrics.collisions, 1);
    assert_int_equal(self.metrics.collisions_human, 0);
    assert_false(metrics_success(&self.metrics));
    CHECK_NEAR(self.metrics.min_distance, 0.0, 0.0);
    close_stage(&self);

    open_stage(&self);
    self.metrics.vehicles[1].intends = false;
    self.world.vehicles[1].state.controlled = false;
    put(&self, 1, 97.0, 0.0, 0.0, 10.0);
    tick(&self);
    assert_int_equal(self.metrics.collisions, 0);
    assert_int_equal(self.metrics.collisions_human, 1);
    assert_true(metrics_success(&self.metrics));
    close_stage(&self);
}

/// Everybody is where they want to be, at their speed, and the run may end at any tick.
static void open_content(stage* self)
{
    open_stage(self);
    self->metrics.vehicles[1].intends = false;
    tick(self);
    assert_true(metrics_success(&self->metrics));
}

static void test_success_requires_controlled_vehicles_on_the_road_at_the_end(void** state)
{
    (void)state;
    stage self;
    open_content(&self);
    self.world.vehicles[2].off_road = true; // a human's place is not ours to answer for
    tick(&self);
    assert_true(metrics_success(&self.metrics));
    self.world.vehicles[1].off_road = true;
    tick(&self);
    assert_false(metrics_success(&self.metrics));
    assert_true(self.metrics.vehicles[1].off_road && !self.metrics.vehicles[0].off_road);
    self.world.vehicles[1].present = false; // left the scene beside the road
    tick(&self);
    assert_false(metrics_success(&self.metrics));
    self.world.vehicles[1].off_road = false; // back on it, or left by its end
    tick(&self);
    assert_true(metrics_success(&self.metrics));
    close_stage(&self);
}

static void test_success_requires_that_no_vehicle_stands_without_a_cause_at_the_end(void** state)
{
    (void)state;
    const struct { double x, speed, other_x, other_y; bool success; const char* text; } cases[] = {
        { 0.0, 0.0, -300.0, 0.0, false, "nobody is near" },
        { 0.0, 0.49, -300.0, 0.0, false, "this slow is standing" },
        { 0.0, 0.5, -300.0, 0.0, true, "it drives" },
        { 0.0, 0.0, 18.0, 0.0, true, "a body in its way" },
        { 0.0, 0.0, 25.0, 0.0, false, "one too far ahead" },
        { 0.0, 0.0, 10.0, 10.0, false, "one beside its way" },
        { 0.0, 0.0, -8.0, 0.0, false, "one behind it" },
        { 884.0, 0.0, -300.0, 0.0, true, "the end of the road" },
        { 882.0, 0.0, -300.0, 0.0, false, "too far from the end of the road" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        stage self;
        open_content(&self);
        put(&self, 0, cases[i].x, 0.0, 0.0, cases[i].speed);
        put(&self, 1, -600.0, 0.0, 0.0, 10.0);
        put(&self, 2, cases[i].other_x, cases[i].other_y, 0.0, 0.0); // the human may stand
        tick(&self);
        if (metrics_success(&self.metrics) != cases[i].success) {
            fail_msg("%s: success %d, expected %d", cases[i].text, !cases[i].success,
                     cases[i].success);
        }
        assert_true(metrics_reached(&self.metrics));
        self.world.vehicles[2].present = false; // a vehicle that left is not a cause
        tick(&self);
        assert_int_equal(metrics_success(&self.metrics),
                         cases[i].x > 883.0 || cases[i].speed >= 0.5);
        close_stage(&self);
    }
}

static void test_time_to_collision_is_gap_over_closing_speed_in_any_direction(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("ttc");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        stage self;
        open_stage(&self);
        const double heading = test_rng_between(&rng, -3.14159, 3.14159);
        const double gap = test_rng_between(&rng, 0.5, 60.0);
        const double side = test_rng_between(&rng, -1.9, 1.9);
        const double fast = test_rng_between(&rng, 5.0, 20.0);
        const double slow = test_rng_between(&rng, 0.0, 5.0);
        const double c = cos(heading), s = sin(heading);
        self.world.vehicles[2].present = false;
        // On no lane: what is across is across their own way.
        self.world.vehicles[0].lane = self.world.vehicles[1].lane = VERGE_NO_LANE;
        put(&self, 0, 10.0, 2.0, heading, fast);
        put(&self, 1, 10.0 + (gap + 5.0) * c - side * s, 2.0 + (gap + 5.0) * s + side * c, heading,
            slow);
        tick(&self);
        CHECK_NEAR(self.metrics.min_ttc, gap / (fast - slow), 1e-9);
        const double centres = sqrt((gap + 5.0) * (gap + 5.0) + side * side);
        CHECK_NEAR(self.metrics.min_center_gap, centres - 5.0, 1e-9);
        close_stage(&self);
    }
}

static void test_the_gap_is_measured_across_the_road_however_a_body_is_turned(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    self.world.vehicles[2].present = false;
    put(&self, 0, 20.0, 0.0, 0.3, 10.0); // in a lane change, its nose towards the other
    put(&self, 1, 29.0, 3.0, 0.0, 10.0);
    tick(&self);
    assert_true(isinf(self.metrics.min_center_gap));
    put(&self, 1, 29.0, 1.9, 0.0, 10.0);
    tick(&self);
    CHECK_NEAR(self.metrics.min_center_gap, sqrt(81.0 + 1.9 * 1.9) - 5.0, 1e-12);
    close_stage(&self);
}

static void test_slower_vehicles_beside_or_behind_have_no_time_to_collision(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    self.world.vehicles[2].present = false;
    put(&self, 0, 0.0, 0.0, 0.0, 10.0);
    put(&self, 1, 20.0, 0.0, 0.0, 10.0); // as fast
    tick(&self);
    put(&self, 1, 20.0, 0.0, 0.0, 10.0 - 1e-14); // as fast but for the last bit
    tick(&self);
    put(&self, 1, 20.0, 0.0, 0.0, 15.0); // runs away
    tick(&self);
    put(&self, 1, 20.0, 2.1, 0.0, 5.0); // passes beside
    tick(&self);
    assert_true(isinf(self.metrics.min_ttc));
    CHECK_NEAR(self.metrics.min_center_gap, 15.0, 1e-12);
    close_stage(&self);
}

static void test_extremes_are_those_of_controlled_vehicles(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    self.world.vehicles[0].state.acceleration = -2.0;
    self.world.vehicles[0].jerk = 3.0;
    self.world.vehicles[1].curvature = -0.1;
    self.world.vehicles[2].state.acceleration = -9.0; // human
    tick(&self);
    self.world.vehicles[0].state.acceleration = 1.0;
    tick(&self);
    CHECK_SAME_BITS(self.metrics.max_abs_acceleration, 2.0);
    CHECK_SAME_BITS(self.metrics.max_abs_jerk, 3.0);
    CHECK_SAME_BITS(self.metrics.max_abs_curvature, 0.1);
    close_stage(&self);
}

/// What metrics_write() prints, in a static buffer.
static const char* written(const metrics* self)
{
    static char text[2048];
    FILE* out = fmemopen(text, sizeof text, "w");
    assert_non_null(out);
    metrics_write(out, self, false, "");
    assert_int_equal(fclose(out), 0);
    return text;
}

static void test_standstills_are_those_of_the_planner_and_null_where_it_is_not_known(void** state)
{
    (void)state;
    static const verge_plan plan;
    stage self;
    open_stage(&self);
    metrics_cycle(&self.metrics, &plan, NULL, -1.0); // from a bus
    assert_non_null(strstr(written(&self.metrics), "\"reordered\":null,\"unstuck\":null"));
    metrics_cycle(&self.metrics, &plan, &(verge_counters){ .reordered = 1, .unstuck = 2 }, -1.0);
    metrics_cycle(&self.metrics, &plan, &(verge_counters){ .reordered = 1, .unstuck = 3 }, -1.0);
    assert_non_null(strstr(written(&self.metrics), "\"reordered\":1,\"unstuck\":3"));
    close_stage(&self);
}

static int by_value(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

static void test_a_percentile_is_the_smallest_value_enough_others_do_not_exceed(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("percentile");
    assert_true(isnan(percentile(NULL, 0, 0.5)));
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        double         values[40];
        const uint32_t count = 1 + test_rng_below(&rng, 40);
        const double   share = round % 3 == 0 ? 0.99 : round % 3 == 1 ? 0.5 : 1.0;
        for (uint32_t i = 0; i < count; ++i) {
            values[i] = test_rng_below(&rng, 10);
        }
        qsort(values, count, sizeof values[0], by_value);
        double oracle = values[count - 1];
        for (uint32_t i = count; i-- > 0;) { // from the largest down, while enough stay below
            uint32_t not_above = 0;
            for (uint32_t k = 0; k < count; ++k) {
                not_above += values[k] <= values[i];
            }
            if ((double)not_above >= share * (double)count) {
                oracle = values[i];
            }
        }
        CHECK_SAME_BITS(percentile(values, count, share), oracle);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_finish_and_reached_times_are_the_first_instants),
        cmocka_unit_test(
            test_a_contact_counts_once_and_ends_success_only_with_a_controlled_vehicle),
        cmocka_unit_test(test_success_requires_controlled_vehicles_on_the_road_at_the_end),
        cmocka_unit_test(test_success_requires_that_no_vehicle_stands_without_a_cause_at_the_end),
        cmocka_unit_test(test_time_to_collision_is_gap_over_closing_speed_in_any_direction),
        cmocka_unit_test(test_the_gap_is_measured_across_the_road_however_a_body_is_turned),
        cmocka_unit_test(test_slower_vehicles_beside_or_behind_have_no_time_to_collision),
        cmocka_unit_test(test_extremes_are_those_of_controlled_vehicles),
        cmocka_unit_test(test_standstills_are_those_of_the_planner_and_null_where_it_is_not_known),
        cmocka_unit_test(test_a_percentile_is_the_smallest_value_enough_others_do_not_exceed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
