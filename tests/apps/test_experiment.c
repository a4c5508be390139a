/// Goal: the baselines, the bound, the traffic and the sums of verge-experiment agree with their
/// headers.
/// Method: cases computed by hand; exhaustive search for the searches; random scenes for the bound.
#include "check.h"
#include "rng.h"

#include "experiment/bound.h"
#include "experiment/decided.h"
#include "experiment/lab.h"
#include "experiment/sequential.h"
#include "experiment/summary.h"
#include "experiment/traffic.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { keep = 4, accelerate = 7, brake = 1, to_left = 5, to_right = 3 };

/// A car alone on lanes at y = 0 and 4, which wants to the left one.
static sequential_problem open_road(void)
{
    return (sequential_problem){
        .v = 8.0, .half_length = 2.5, .half_width = 1.0, .target_y = 4.0, .y_min = 0.0,
        .y_max = 4.0, .speed_limit = 10.0, .cruise = 10.0, .step_s = 1.0, .steps = 3,
        .exploration = 0.7, .reward_target = 0.5, .reward_lane = 0.3, .reward_consistency = 0.2,
        .iterations = 2000, .seed = 1,
    };
}

/// An obstacle that stays at a way and an offset.
static sequential_obstacle standing(double s, double y)
{
    sequential_obstacle at = { .half_length = 2.5, .half_width = 1.0 };
    for (uint32_t k = 0; k < SEQUENTIAL_SAMPLES_MAX; ++k) {
        at.s[k] = s;
        at.y[k] = y;
    }
    return at;
}

// ---------------------------------------------------------------------------- sequential

static void test_nine_actions_are_three_accelerations_times_three_lateral_speeds(void** state)
{
    (void)state;
    for (uint8_t action = 0; action < SEQUENTIAL_ACTIONS; ++action) {
        CHECK_NEAR(sequential_acceleration(action), action < 3 ? -1 : action < 6 ? 0 : 1, 0.0);
        CHECK_NEAR(sequential_lateral(action), 1.2 * (action % 3) - 1.2, 1e-15);
    }
}

static void test_acceleration_ends_at_the_limit_and_braking_at_standstill(void** state)
{
    (void)state;
    const sequential_problem problem = open_road();
    const sequential_state   fast = { 0.0, 0.0, 8.0 }, slow = { 0.0, 0.0, 1.0 };
    // Two seconds from 8 to 10 m/s make 18 m, one more at 10 m/s makes 10 m.
    sequential_state at = sequential_move(&problem, &fast, accelerate, 3.0);
    CHECK_NEAR(at.s, 28.0, 1e-12);
    CHECK_NEAR(at.v, 10.0, 0.0);
    at = sequential_move(&problem, &slow, brake, 1.5); // half a metre, then it stands
    CHECK_NEAR(at.s, 0.5, 1e-12);
    CHECK_NEAR(at.v, 0.0, 0.0);
    at = sequential_move(&problem, &fast, to_left, 1.5);
    CHECK_NEAR(at.s, 12.0, 1e-12);
    CHECK_NEAR(at.y, 1.8, 1e-12);
}

static void test_a_candidate_that_meets_an_obstacle_or_leaves_the_road_is_refused(void** state)
{
    (void)state;
    sequential_problem  problem = open_road();
    sequential_obstacle other = standing(8.0, 4.0); // where it will be in a second, one lane left
    const sequential_state here = { 0.0, 0.0, 8.0 };
    problem.obstacles = &other;
    problem.obstacle_count = 1;
    assert_false(sequential_refused(&problem, &here, 0, keep)); // 4 m aside: 2 m of air
    assert_true(sequential_refused(&problem, &here, 0, to_right)); // y = -1.2
    // 2.8 m aside: 0.8 m of air is more than 0.3 m; 2.2 m is not.
    assert_false(sequential_refused(&problem, &here, 0, to_left));
    other = standing(8.0, 3.4);
    assert_true(sequential_refused(&problem, &here, 0, to_left));
    other = standing(8.0 + 5.0 + 1.01, 0.0); // just beyond a metre of air after a second
    assert_false(sequential_refused(&problem, &here, 0, keep));
    other = standing(8.0 + 5.0 + 0.99, 0.0);
    assert_true(sequential_refused(&problem, &here, 0, keep));
}

static void test_alone_a_vehicle_changes_lane_at_once_with_the_computed_reward(void** state)
{
    (void)state;
    sequential_problem problem = open_road();
    sequential_plan    plan;
    problem.v = 10.0;
    problem.steps = 6;
    problem.iterations = 20000;
    assert_true(sequential_search(&problem, &plan));
    assert_false(plan.blocked);
    CHECK_NEAR(plan.states[6].y, 4.0, 0.5);
    // 3.6 m in three steps, then on: in the target lane after steps 3 to 6, one change of action.
    CHECK_NEAR(plan.reward, 0.5 + 0.3 * 4.0 / 6.0 + 0.2 * 5.0 / 6.0, 1e-12);
    CHECK_BETWEEN(plan.nodes_first, 7, plan.nodes);
    CHECK_AT_MOST(plan.nodes, problem.iterations + 1);
}

static void test_without_an_acceptable_candidate_a_vehicle_brakes_and_reports_it(void** state)
{
    (void)state;
    sequential_problem  problem = open_road();
    sequential_obstacle wall[2] = { standing(12.0, 0.0), standing(12.0, 4.0) };
    sequential_plan     plan;
    problem.obstacles = wall;
    problem.obstacle_count = 2;
    assert_true(sequential_search(&problem, &plan));
    assert_true(plan.blocked);
    assert_int_equal(plan.actions[problem.steps - 1], brake);
}

/// The best there is, by trying everything.
static double exhaustive(const sequential_problem* problem, const sequential_state* at,
                         uint32_t step, uint8_t previous, double credit)
{
    if (step == problem->steps) {
        return credit + (fabs(at->y - problem->target_y) <= 0.5 ? problem->reward_target : 0.0);
    }
    double best = -1.0;
    for (uint8_t action = 0; action < SEQUENTIAL_ACTIONS; ++action) {
        if (sequential_refused(problem, at, step, action)) {
            continue;
        }
        const sequential_state next = sequential_move(problem, at, action, problem->step_s);
        double earned = action == previous || step == 0 ? problem->reward_consistency : 0.0;
        earned += fabs(next.y - problem->target_y) <= 0.5
                      ? problem->reward_lane * fmin(next.v / problem->cruise, 1.0) : 0.0;
        best = fmax(best, exhaustive(problem, &next, step + 1, action,
                                     credit + earned / problem->steps));
    }
    return best;
}

static void test_search_results_obey_the_rules_and_are_near_the_optimum(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sequential");
    double   lost = 0.0;
    uint32_t count = 0;
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        sequential_problem  problem = open_road();
        sequential_obstacle others[2] = { standing(test_rng_between(&rng, 5.0, 40.0), 4.0),
                                          standing(test_rng_between(&rng, 30.0, 60.0), 0.0) };
        sequential_plan     plan;
        problem.steps = 4;
        problem.iterations = 8000;
        problem.seed = round;
        problem.obstacles = others;
        problem.obstacle_count = 2;
        assert_true(sequential_search(&problem, &plan));
        const double best = exhaustive(&problem, &plan.states[0], 0, 0, 0.0);
        if (plan.blocked || best < 0.0) {
            continue;
        }
        for (uint32_t k = 0; k < problem.steps; ++k) {
            const sequential_state next =
                sequential_move(&problem, &plan.states[k], plan.actions[k], problem.step_s);
            assert_false(sequential_refused(&problem, &plan.states[k], k, plan.actions[k]));
            CHECK_NEAR(next.s, plan.states[k + 1].s, 1e-12);
            CHECK_NEAR(next.y, plan.states[k + 1].y, 1e-12);
        }
        CHECK_AT_MOST(plan.reward, best + 1e-12);
        lost += best - plan.reward;
        ++count;
    }
    CHECK_AT_MOST(lost, 0.1 * count); // the greedy child of largest mean is not always the best
}

// ---------------------------------------------------------------------------- decided

/// A straight road of two lanes; vehicles 7, 8 and 9, controlled, at 30, 50 and 10 m.
static const char ROAD[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"decided\", \"road\": { \"lanes\": ["
    "{ \"id\": 0, \"centerline\": [[0, 0], [600, 0]], \"width\": 4, \"speed_limit\": 10,"
    "  \"left\": 1 },"
    "{ \"id\": 1, \"centerline\": [[0, 4], [600, 4]], \"width\": 4, \"speed_limit\": 10,"
    "  \"right\": 0 } ] }, \"vehicles\": ["
    "{ \"id\": 7, \"control\": \"controlled\", \"x\": 30, \"y\": 0, \"heading\": 0, \"speed\": 8,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2, \"target_lane\": 1 },"
    "{ \"id\": 8, \"control\": \"controlled\", \"x\": 50, \"y\": 4, \"heading\": 0, \"speed\": 8,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2, \"target_lane\": 0 },"
    "{ \"id\": 9, \"control\": \"controlled\", \"x\": 10, \"y\": 0, \"heading\": 0, \"speed\": 8,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 } ] }";

typedef struct stage {
    scenario scene;
    world    world;
} stage;

static void open_stage(stage* self, const char* text)
{
    if (!scenario_parse(&self->scene, "experiment", text, strlen(text), NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    assert_true(world_init(&self->world, &self->scene));
}

static void close_stage(stage* self)
{
    world_free(&self->world);
    scenario_free(&self->scene);
}

static void test_the_farthest_vehicle_decides_first(void** state)
{
    (void)state;
    static decided decisions;
    stage self;
    open_stage(&self, ROAD);
    assert_true(decided_from_sequential(&decisions, &self.world, 1));
    assert_int_equal(decisions.vehicle_count, 3);
    assert_int_equal(decisions.vehicles[0].id, 8);
    assert_int_equal(decisions.vehicles[1].id, 7);
    assert_int_equal(decisions.vehicles[2].id, 9);
    CHECK_AT_MOST(decisions.nodes, self.scene.def.iterations + 3); // the budget is shared out
    close_stage(&self);
}

static void test_a_decided_step_starts_and_ends_in_its_states(void** state)
{
    (void)state;
    static decided     decisions;
    verge_vehicle_plan plan;
    stage              self;
    open_stage(&self, ROAD);
    decisions = (decided){ .step_s = 1.5, .vehicle_count = 1 };
    decided_vehicle* vehicle = &decisions.vehicles[0];
    vehicle->step_count = 1;
    vehicle->states[0] = (decided_state){ 0, 30.0, 0.0, 8.0 };
    // Half a lane to the left and 0.9 m/s faster: as the joint search has it over the border.
    vehicle->states[1] = (decided_state){ 1, 30.0 + 8.45 * 1.5, -1.0, 8.9 };
    decided_trajectory(&decisions, self.world.road, vehicle, 0, &plan);
    assert_int_equal(plan.point_count, 16);
    CHECK_NEAR(plan.points[0].x, 30.0, 1e-9);
    CHECK_NEAR(plan.points[0].y, 0.0, 1e-9);
    CHECK_NEAR(plan.points[15].x, 30.0 + 8.45 * 1.5, 1e-9);
    CHECK_NEAR(plan.points[15].y, 3.0, 1e-9);
    for (uint32_t k = 0; k < 16; ++k) { // even acceleration, even drift
        const double t = 0.1 * k;
        CHECK_NEAR(plan.points[k].x, 30.0 + 8.0 * t + 0.3 * t * t, 1e-9);
        CHECK_NEAR(plan.points[k].y, 2.0 * t, 1e-9);
        CHECK_NEAR(plan.points[k].acceleration, 0.6, 1e-9);
        CHECK_NEAR(plan.points[k].heading, 0.0, 1e-9);
    }
    close_stage(&self);
}

// ---------------------------------------------------------------------------- bound, traffic

static void test_a_vehicle_in_its_target_lane_at_the_limit_can_reach_reward_one(void** state)
{
    (void)state;
    static const char text[] =
        "{ \"format\": \"verge-scenario/1\", \"name\": \"bound\", \"road\": { \"lanes\": ["
        "{ \"id\": 0, \"centerline\": [[0, 0], [600, 0]], \"width\": 4, \"speed_limit\": 10 }"
        "] }, \"vehicles\": [ { \"id\": 1, \"control\": \"controlled\", \"x\": 30, \"y\": 0,"
        " \"heading\": 0, \"speed\": 10, \"acceleration\": 0, \"length\": 5, \"width\": 2,"
        " \"target_lane\": 0 } ] }";
    stage self;
    open_stage(&self, text);
    CHECK_NEAR(bound_of(&self.world), 1.0, 1e-6);
    close_stage(&self);
}

static void test_no_search_reaches_a_reward_above_the_bound(void** state)
{
    (void)state;
    verge_plan* plan = calloc(1, sizeof *plan);
    test_rng    rng = test_rng_seeded("bound");
    assert_non_null(plan);
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        const traffic with = { .controlled = 2 + test_rng_below(&rng, 5), .humans = 3,
                               .density = 25.0, .speed_min = 4.0, .speed_max = 8.0,
                               .seed = test_rng_next(&rng) % 1000000 };
        lab_document* document = traffic_document(&with);
        char*         text = cJSON_PrintUnformatted(document);
        verge_vehicle vehicles[VERGE_VEHICLES_MAX];
        stage         self;
        open_stage(&self, text);
        const uint32_t count = world_states(&self.world, vehicles);
        assert_int_equal(verge_planner_step(self.scene.planner, 0, vehicles, count, plan),
                         VERGE_OK);
        CHECK_BETWEEN(plan->search.reward, 0.0, bound_of(&self.world) + 1e-6);
        close_stage(&self);
        cJSON_free(text);
        cJSON_Delete(document);
    }
    free(plan);
}

static void test_traffic_is_as_ordered_and_the_same_for_the_same_seed(void** state)
{
    (void)state;
    for (uint32_t seed = 1; seed <= test_rounds(50); ++seed) {
        const traffic with = { .controlled = 8, .humans = 4, .density = 30.0, .speed_min = 4.0,
                               .speed_max = 8.0, .seed = seed };
        lab_document* one = traffic_document(&with);
        lab_document* two = traffic_document(&with);
        char*         text = cJSON_PrintUnformatted(one);
        assert_true(cJSON_Compare(one, two, true));
        stage self;
        open_stage(&self, text); // refuses overlaps and vehicles off the road
        assert_int_equal(self.scene.vehicle_count, 12);
        for (uint32_t i = 0; i < 12; ++i) {
            const verge_vehicle* at = &self.scene.vehicles[i].start;
            const double         lane = at->y / 4.0;
            assert_true(at->controlled == (i < 8));
            CHECK_BETWEEN(at->speed, 4.0, 8.0);
            CHECK_BETWEEN(at->x, 50.0, 150.0); // 12 vehicles, 30 a km on 4 lanes: 100 m
            CHECK_NEAR(at->controlled ? fabs(at->target_lane - lane) : 1.0, 1.0, 1e-9);
            for (uint32_t k = 0; k < i; ++k) {
                const verge_vehicle* other = &self.scene.vehicles[k].start;
                assert_true(other->y != at->y || fabs(other->x - at->x) >= TRAFFIC_SPACING - 1e-9);
            }
        }
        close_stage(&self);
        cJSON_free(text);
        cJSON_Delete(two);
        cJSON_Delete(one);
    }
}

// ---------------------------------------------------------------------------- trials, sums

static void test_trials_side_by_side_give_what_they_give_alone(void** state)
{
    (void)state;
    const lab here = { .experiment = "test" };
    trial     tasks[6];
    outcome   together[6], alone;
    for (uint32_t i = 0; i < 6; ++i) {
        tasks[i] = (trial){ .text = ROAD, .seed = 1 + i / 3, .method = (method)(i % 3),
                            .record = true };
    }
    assert_true(lab_run(&here, tasks, together, 6));
    for (uint32_t i = 0; i < 6; ++i) {
        trial_run(&tasks[i], &alone);
        assert_true(alone.done && together[i].done);
        assert_true(together[i].success);
        assert_int_equal(alone.run_size, together[i].run_size);
        assert_memory_equal(alone.run, together[i].run, alone.run_size);
        CHECK_SAME_BITS(alone.min_distance, together[i].min_distance);
        outcome_free(&alone);
    }
    lab_free_results(together, 6);
}

static void test_a_refused_document_is_an_outcome_with_a_line(void** state)
{
    (void)state;
    const trial task = { .text = "{ \"format\": \"verge-scenario/1\" }" };
    outcome     result;
    trial_run(&task, &result);
    assert_false(result.done);
    assert_true(result.error[0] != '\0');
    outcome_free(&result);
}

static void test_sums_are_means_with_the_worst_beside_them(void** state)
{
    (void)state;
    const outcome runs[3] = {
        { .success = true, .intentions = 2, .reached = 2, .nodes = 10, .nodes_total = 30,
          .finish_time = 4.0, .finish_last = 5.0, .min_center_gap = 6.0, .min_distance = 2.0,
          .reward = 0.8, .bound = 1.0 },
        { .success = true, .intentions = 2, .reached = 2, .nodes = 20, .nodes_total = 30,
          .finish_time = 6.0, .finish_last = 8.0, .min_center_gap = 9.0, .min_distance = 1.0,
          .reward = 0.9, .bound = 1.0 },
        { .success = false, .intentions = 2, .reached = 0, .nodes = 60, .nodes_total = 60,
          .finish_time = NAN, .finish_last = INFINITY, .min_center_gap = INFINITY,
          .min_distance = 3.0, .collisions = 1, .reward = NAN, .bound = NAN },
    };
    const summary two = summary_of(runs, 2), three = summary_of(runs, 3);
    CHECK_NEAR(three.success, 2.0 / 3.0, 1e-15);
    CHECK_NEAR(three.reached, 4.0 / 6.0, 1e-15);
    CHECK_NEAR(three.nodes, 30.0, 1e-12);
    CHECK_NEAR(three.nodes_worst, 60.0, 0.0);
    CHECK_NEAR(three.finish_time, 5.0, 1e-12); // of the vehicles that finished
    CHECK_NEAR(two.finish_worst, 8.0, 0.0);
    assert_true(isinf(three.finish_worst));
    CHECK_NEAR(three.min_center_gap, 7.5, 1e-12);
    CHECK_NEAR(three.min_center_gap_worst, 6.0, 0.0);
    CHECK_NEAR(three.min_distance, 2.0, 1e-12);
    CHECK_NEAR(three.min_distance_worst, 1.0, 0.0);
    CHECK_NEAR(three.gap, 0.15, 1e-12);
    CHECK_NEAR(three.collisions, 1.0, 0.0);
}

static void test_rows_become_json_and_markdown(void** state)
{
    (void)state;
    table rows = { .experiment = "words" };
    for (uint32_t i = 0; i < 2; ++i) {
        table_row(&rows);
        table_text(&rows, "method", i == 0 ? "a \"b\"" : "c");
        table_number(&rows, "finish_time", i == 0 ? 5.25 : (double)NAN);
    }
    char*  text = NULL;
    size_t size = 0;
    FILE*  out = open_memstream(&text, &size);
    table_write_json(out, &rows);
    table_write_markdown(out, &rows);
    fclose(out);
    assert_string_equal(text,
                        "{\"experiment\": \"words\", \"rows\": [\n"
                        "  {\"method\": \"a \\\"b\\\"\", \"finish_time\": 5.25},\n"
                        "  {\"method\": \"c\", \"finish_time\": null}]}\n"
                        "\n|method|finish time|\n|---|---:|\n|a \"b\"|5.250|\n|c|–|\n");
    free(text);
    table_free(&rows);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nine_actions_are_three_accelerations_times_three_lateral_speeds),
        cmocka_unit_test(test_acceleration_ends_at_the_limit_and_braking_at_standstill),
        cmocka_unit_test(test_a_candidate_that_meets_an_obstacle_or_leaves_the_road_is_refused),
        cmocka_unit_test(test_alone_a_vehicle_changes_lane_at_once_with_the_computed_reward),
        cmocka_unit_test(test_without_an_acceptable_candidate_a_vehicle_brakes_and_reports_it),
        cmocka_unit_test(test_search_results_obey_the_rules_and_are_near_the_optimum),
        cmocka_unit_test(test_the_farthest_vehicle_decides_first),
        cmocka_unit_test(test_a_decided_step_starts_and_ends_in_its_states),
        cmocka_unit_test(test_a_vehicle_in_its_target_lane_at_the_limit_can_reach_reward_one),
        cmocka_unit_test(test_no_search_reaches_a_reward_above_the_bound),
        cmocka_unit_test(test_traffic_is_as_ordered_and_the_same_for_the_same_seed),
        cmocka_unit_test(test_trials_side_by_side_give_what_they_give_alone),
        cmocka_unit_test(test_a_refused_document_is_an_outcome_with_a_line),
        cmocka_unit_test(test_sums_are_means_with_the_worst_beside_them),
        cmocka_unit_test(test_rows_become_json_and_markdown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
