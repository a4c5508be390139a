/// Goal: a planner that is given the decision of another one plans what that one has planned, bit
///       for bit, and refuses what it cannot plan.
/// Method: two planners with different seeds on a road of two lanes; the vehicles drive as the
///         first one plans.
#include "check.h"
#include "closed_loop.h"

#include <verge/verge.h>

#include <math.h>
#include <stdalign.h>
#include <string.h>

enum { LANES = 2, VEHICLES = 5, CONTROLLED = 3, CYCLES = 12 };

alignas(64) static unsigned char memory[2][8 << 20];
alignas(64) static unsigned char road_memory[1 << 20];
static verge_planner *first, *second;
static verge_vehicle vehicles[VEHICLES];
static verge_vehicle_decision decided[CONTROLLED];
static verge_decision decision;
static verge_vehicle_plan last[CONTROLLED];
static verge_plan plan, again;

static verge_planner_def def_of(uint64_t seed, uint32_t iterations)
{
    static const double points[LANES][2][2] = { { { 0, 0 }, { 900, 0 } },
                                                { { 0, 3.5 }, { 900, 3.5 } } };
    static verge_lane_def lanes[LANES];
    for (int32_t i = 0; i < LANES; ++i) {
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = points[i];
        lanes[i].point_count = 2;
        lanes[i].left = i == 0 ? 1 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 0 : VERGE_NO_LANE;
    }
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, LANES };
    def.seed = seed;
    def.iterations = iterations;
    return def;
}

static int open_planners(void** state)
{
    (void)state;
    const verge_planner_def a = def_of(1, 200), b = def_of(99, 1);
    assert_int_equal(verge_planner_init(&first, &a, memory[0], sizeof memory[0]), VERGE_OK);
    assert_int_equal(verge_planner_init(&second, &b, memory[1], sizeof memory[1]), VERGE_OK);
    for (int32_t i = 0; i < VEHICLES; ++i) {
        vehicles[i] = verge_vehicle_default();
        vehicles[i].id = 10 + i;
        vehicles[i].controlled = i < CONTROLLED;
        vehicles[i].x = 60.0 + 22.0 * i;
        vehicles[i].y = 3.5 * (i % LANES);
        vehicles[i].speed = 10.0 + 0.5 * i;
        vehicles[i].target_lane = i < CONTROLLED ? 1 - i % LANES : VERGE_NO_LANE;
    }
    return 0;
}

/// A step of the first planner, and the decision that it has made. Returns the scene, on the road
/// of the second planner.
static const verge_scene* step(uint32_t cycle)
{
    static verge_scene scene;
    assert_int_equal(verge_planner_step(first, (int64_t)cycle * 500000, vehicles, VEHICLES, &plan),
                     VERGE_OK);
    decision = verge_decision_make(decided, CONTROLLED);
    for (uint32_t i = 0; i < plan.vehicle_count; ++i) {
        const verge_vehicle_plan* of = &plan.vehicles[i];
        verge_vehicle_decision* own = &decided[decision.vehicle_count++];
        memset(own, 0, sizeof *own);
        own->vehicle_id = of->vehicle_id;
        own->step_count = of->action_count;
        memcpy(own->steps, of->actions, sizeof own->steps);
        own->steps[0].action = of->decided;
        own->why = of->why;
        own->pass_count = of->pass_count;
        memcpy(own->passes, of->passes, sizeof own->passes);
    }
    scene = *verge_planner_scene(first);
    scene.road = verge_planner_road(second);
    return &scene;
}

static void drive_on(void)
{
    for (uint32_t i = 0; i < VEHICLES; ++i) {
        if (i < CONTROLLED) {
            take_point(&vehicles[i], &plan.vehicles[i].points[5]);
            last[i] = plan.vehicles[i];
            verge_vehicle_plan_round(&last[i]);
        } else {
            vehicles[i].x += 0.5 * vehicles[i].speed;
        }
    }
}

static void a_decision_repeated_gives_the_plan_of_the_planner_that_made_it(void** state)
{
    (void)state;
    uint32_t changes = 0;
    for (uint32_t cycle = 0; cycle < CYCLES; ++cycle) {
        const verge_scene* scene = step(cycle);
        assert_int_equal(verge_planner_repeat(second, scene, &decision, last,
                                              cycle == 0 ? 0 : CONTROLLED, &again), VERGE_OK);
        assert_true(again.digest == plan.digest);
        for (uint32_t i = 0; i < CONTROLLED; ++i) {
            assert_int_equal(again.vehicles[i].changed, plan.vehicles[i].changed);
            changes += plan.vehicles[i].change_lane_id != VERGE_NO_LANE ? 1 : 0;
        }
        drive_on();
    }
    assert_true(changes > 0);
}

static void without_the_last_plans_a_plan_may_be_another_one(void** state)
{
    (void)state;
    uint32_t differ = 0;
    for (uint32_t cycle = 0; cycle < CYCLES; ++cycle) {
        const verge_scene* scene = step(cycle);
        assert_int_equal(verge_planner_repeat(second, scene, &decision, NULL, 0, &again),
                         VERGE_OK);
        differ += again.digest != plan.digest ? 1 : 0;
        drive_on();
    }
    assert_true(differ > 0);
}

static void a_scene_of_another_road_is_refused(void** state)
{
    (void)state;
    verge_scene scene = *step(0);
    const verge_planner_def def = def_of(1, 1);
    assert_int_equal(verge_road_init(&scene.road, &def.road, road_memory, sizeof road_memory),
                     VERGE_OK);
    memset(&again, 7, sizeof again);
    const verge_plan untouched = again;
    assert_int_equal(verge_planner_repeat(second, &scene, &decision, NULL, 0, &again),
                     VERGE_ERR_ARGUMENT);
    assert_memory_equal(&again, &untouched, sizeof again);
}

static void a_decision_that_lacks_a_vehicle_or_is_too_short_is_refused(void** state)
{
    (void)state;
    const verge_scene* scene = step(0);
    --decision.vehicle_count;
    assert_int_equal(verge_planner_repeat(second, scene, &decision, NULL, 0, &again),
                     VERGE_ERR_DEF);
    ++decision.vehicle_count;
    decided[1].step_count = 1;
    assert_int_equal(verge_planner_repeat(second, scene, &decision, NULL, 0, &again),
                     VERGE_ERR_DEF);
}

static void more_last_plans_than_vehicles_can_be_controlled_are_refused(void** state)
{
    (void)state;
    static verge_vehicle_plan many[VERGE_CONTROLLED_MAX + 1];
    const verge_scene* scene = step(0);
    assert_int_equal(verge_planner_repeat(second, scene, &decision, many, VERGE_CONTROLLED_MAX + 1,
                                          &again), VERGE_ERR_CAPACITY);
}

static void a_rounded_plan_is_near_the_plan_and_rounded_again_the_same(void** state)
{
    (void)state;
    (void)step(0);
    verge_vehicle_plan rounded = plan.vehicles[0];
    rounded.change_lane_id = 1;
    rounded.change_end = 1.2341;
    verge_vehicle_plan_round(&rounded);
    CHECK_SAME_BITS(rounded.change_end, 1.235); // upwards
    for (uint32_t k = 0; k < rounded.point_count; ++k) {
        const verge_point *a = &rounded.points[k], *b = &plan.vehicles[0].points[k];
        CHECK_SAME_BITS(a->x, b->x);
        CHECK_SAME_BITS(a->y, b->y);
        CHECK_NEAR(a->heading, b->heading, 1e-6);
        CHECK_NEAR(a->speed, b->speed, 1e-5);
        CHECK_NEAR(a->acceleration, b->acceleration, 1e-5);
        CHECK_NEAR(a->curvature, b->curvature, 1e-6);
        CHECK_SAME_BITS(a->speed, (double)(float)b->speed);
    }
    const verge_vehicle_plan once = rounded;
    verge_vehicle_plan_round(&rounded);
    assert_memory_equal(&rounded, &once, sizeof once);
    rounded.change_end = -0.25; // it is over
    verge_vehicle_plan_round(&rounded);
    CHECK_SAME_BITS(rounded.change_end, 0.0);
    verge_vehicle_plan_round(NULL);
}

#define CASE(claim) cmocka_unit_test_setup(claim, open_planners)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CASE(a_decision_repeated_gives_the_plan_of_the_planner_that_made_it),
        CASE(without_the_last_plans_a_plan_may_be_another_one),
        CASE(a_scene_of_another_road_is_refused),
        CASE(a_decision_that_lacks_a_vehicle_or_is_too_short_is_refused),
        CASE(more_last_plans_than_vehicles_can_be_controlled_are_refused),
        CASE(a_rounded_plan_is_near_the_plan_and_rounded_again_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
