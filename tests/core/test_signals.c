// Traffic signals of a scene and of a planner, priorities and stop lines of lanes: what is refused,
// and what they are at the instant of a step.
#include "check.h"

#include <verge/verge.h>

#include <math.h>
#include <stdalign.h>

alignas(64) static unsigned char memory[8 << 20];
static verge_plan plan;

enum { LANES = 4 };
static const double centrelines[LANES][2][2] = {
    { { 0, 0 }, { 200, 0 } }, { { 0, 50 }, { 200, 50 } }, { { 0, 100 }, { 200, 100 } },
    { { 0, 150 }, { 200, 150 } },
};

static verge_road_def road_of(verge_lane_def lanes[LANES])
{
    for (int32_t i = 0; i < LANES; ++i) {
        lanes[i] = verge_lane_def_default();
        lanes[i].id = 10 * i;
        lanes[i].points = centrelines[i];
        lanes[i].point_count = 2;
    }
    return (verge_road_def){ lanes, LANES };
}

static verge_planner* planner_on(const verge_road_def* road)
{
    verge_planner_def def = verge_planner_default_def();
    def.road = *road;
    def.iterations = 10;
    def.nodes_max = 50;
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, sizeof memory), VERGE_OK);
    return planner;
}

static const verge_scene* step_at(verge_planner* planner, double seconds)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.x = 50.0;
    vehicle.speed = 5.0;
    vehicle.controlled = true;
    const int64_t utime = (int64_t)(seconds * 1e6);
    assert_int_equal(verge_planner_step(planner, utime, &vehicle, 1, &plan), VERGE_OK);
    return verge_planner_scene(planner);
}

static void a_signal_counts_down_and_one_whose_change_has_passed_is_red(void** state)
{
    (void)state;
    verge_lane_def lanes[LANES];
    const verge_road_def road = road_of(lanes);
    verge_planner* planner = planner_on(&road);
    const verge_signal set[] = { { 30, VERGE_SIGNAL_GREEN, 4.0 }, { 0, VERGE_SIGNAL_RED, 4.0 },
                                 { 20, VERGE_SIGNAL_OFF, 4.0 }, { 10, VERGE_SIGNAL_GREEN, -1.0 } };
    assert_int_equal(verge_planner_set_signals(planner, 1000000, set, 4), VERGE_OK);

    const verge_scene* scene = step_at(planner, 1.5);
    assert_int_equal(scene->signal_count, 4);
    for (uint32_t i = 0; i < 4; ++i) { // in the order of the lanes, and found
        assert_int_equal(scene->signals[i].lane_id, 10 * i);
        assert_ptr_equal(verge_scene_signal(scene, 10 * (int32_t)i), &scene->signals[i]);
    }
    assert_null(verge_scene_signal(scene, 15));
    CHECK_NEAR(scene->signals[0].change_s, 3.5, 1e-12);
    assert_int_equal(scene->signals[3].state, VERGE_SIGNAL_GREEN);

    scene = step_at(planner, 5.5);
    static const verge_signal_state later[] = { VERGE_SIGNAL_RED, VERGE_SIGNAL_GREEN,
                                                VERGE_SIGNAL_OFF, VERGE_SIGNAL_RED };
    for (uint32_t i = 0; i < 4; ++i) {
        assert_int_equal(scene->signals[i].state, later[i]);
        assert_true(scene->signals[i].change_s < 0.0);
    }
    assert_int_equal(verge_planner_set_signals(planner, 0, NULL, 0), VERGE_OK);
    assert_int_equal(step_at(planner, 6.0)->signal_count, 0);
}

static void a_signal_that_is_refused_changes_nothing_and_its_field_is_named(void** state)
{
    (void)state;
    verge_lane_def lanes[LANES];
    const verge_road_def road = road_of(lanes);
    verge_planner* planner = planner_on(&road);
    const verge_signal good = { 10, VERGE_SIGNAL_RED, 2.0 };
    assert_int_equal(verge_planner_set_signals(planner, 0, &good, 1), VERGE_OK);
    const struct {
        verge_signal signal;
        const char*  field;
    } bad[] = {
        { { 11, VERGE_SIGNAL_RED, 2.0 }, "lane" },
        { { -1, VERGE_SIGNAL_RED, 2.0 }, "lane" },
        { { 10, VERGE_SIGNAL_GREEN, 2.0 }, "lane" }, // a second one of lane 10
        { { 20, (verge_signal_state)4, 2.0 }, "state" },
        { { 20, (verge_signal_state)-1, 2.0 }, "state" },
        { { 20, VERGE_SIGNAL_RED, NAN }, "change_s" },
        { { 20, VERGE_SIGNAL_RED, INFINITY }, "change_s" },
        { { 20, VERGE_SIGNAL_RED, 1e6 }, "change_s" },
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        const verge_signal both[] = { good, bad[i].signal };
        verge_signal_fault fault;
        assert_int_equal(verge_planner_set_signals(planner, 0, both, 2), VERGE_ERR_SIGNAL);
        assert_int_equal(
            verge_signals_check(verge_planner_road(planner), both, 2, &fault), VERGE_ERR_SIGNAL);
        assert_int_equal(fault.signal_index, 1);
        assert_string_equal(fault.field, bad[i].field);
        assert_non_null(fault.expected);
        assert_int_equal(step_at(planner, 1.0)->signal_count, 1);
    }
}

static void signals_of_a_scene_are_ordered_by_lane(void** state)
{
    (void)state;
    verge_lane_def lanes[LANES];
    const verge_road_def def = road_of(lanes);
    const verge_road* road = NULL;
    assert_int_equal(verge_road_init(&road, &def, memory, sizeof memory), VERGE_OK);
    verge_vehicle vehicles[2];
    verge_lane_position positions[2];
    verge_scene scene = verge_scene_make(road, vehicles, positions, 2);
    verge_signal signals[] = { { 10, VERGE_SIGNAL_RED, 2.0 }, { 20, VERGE_SIGNAL_GREEN, 2.0 } };
    scene.signals = signals;
    scene.signal_count = 2;
    assert_int_equal(verge_scene_place(&scene, 0, NULL, 0, NULL), VERGE_OK);
    signals[0].lane_id = 30;
    assert_int_equal(verge_scene_place(&scene, 0, NULL, 0, NULL), VERGE_ERR_ARGUMENT);
    signals[0].lane_id = 20;
    assert_int_equal(verge_scene_place(&scene, 0, NULL, 0, NULL), VERGE_ERR_ARGUMENT);
    scene.signals = NULL;
    assert_int_equal(verge_scene_place(&scene, 0, NULL, 0, NULL), VERGE_ERR_ARGUMENT);
}

static void a_lane_keeps_its_priority_and_its_stop_line(void** state)
{
    (void)state;
    verge_lane_def lanes[LANES];
    const verge_road_def def = road_of(lanes);
    const verge_road* road = NULL;
    lanes[1].priority = VERGE_PRIORITY_STOP;
    lanes[1].stop_line_given = true;
    lanes[1].stop_line = 150.0;
    assert_int_equal(verge_road_init(&road, &def, memory, sizeof memory), VERGE_OK);
    assert_int_equal(verge_road_priority(road, 0), VERGE_PRIORITY_NONE);
    assert_int_equal(verge_road_priority(road, 10), VERGE_PRIORITY_STOP);
    CHECK_NEAR(verge_road_stop_line(road, 10), 150.0, 1e-9);
    CHECK_NEAR(verge_road_stop_line(road, 0), verge_road_length(road, 0), 1e-9);
    assert_int_equal(verge_road_priority(road, 11), VERGE_PRIORITY_NONE);
    assert_true(verge_road_stop_line(road, 11) == 0.0);
}

static void a_priority_or_stop_line_out_of_range_is_refused_by_name(void** state)
{
    (void)state;
    const double lines[] = { -1.0, 202.0, NAN, INFINITY };
    verge_lane_def lanes[LANES];
    verge_road_fault fault;
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; ++i) {
        const verge_road_def def = road_of(lanes);
        lanes[2].stop_line_given = true;
        lanes[2].stop_line = lines[i];
        assert_int_equal(verge_road_check(&def, &fault), VERGE_ERR_ROAD);
        assert_int_equal(fault.lane_index, 2);
        assert_string_equal(fault.field, "stop_line");
    }
    const verge_road_def def = road_of(lanes);
    lanes[3].priority = (verge_priority)5;
    assert_int_equal(verge_road_check(&def, &fault), VERGE_ERR_ROAD);
    assert_int_equal(fault.lane_index, 3);
    assert_string_equal(fault.field, "priority");
}

// Each vehicle stands, or nearly, with its front this far from the line.
static void a_vehicle_that_stops_a_little_over_the_line_waits_for_green(void** state)
{
    (void)state;
    verge_lane_def lanes[LANES];
    const verge_road_def road = road_of(lanes);
    lanes[0].stop_line_given = true;
    lanes[0].stop_line = 120.0;
    verge_planner* planner = planner_on(&road);
    const double fronts[] = { -3.0, -0.5, 0.05, 0.3, 1.0 };
    int64_t utime = 0;
    for (size_t i = 0; i < sizeof fronts / sizeof fronts[0]; ++i) {
        verge_vehicle vehicle = verge_vehicle_default();
        vehicle.controlled = true;
        vehicle.x = 120.0 + fronts[i] - 0.5 * vehicle.length;
        vehicle.speed = i % 2 == 0 ? 0.0 : 0.3;
        verge_planner_reset(planner);
        for (int cycle = 0; cycle < 12; ++cycle, utime += 500000) {
            const verge_signal red = { 0, VERGE_SIGNAL_RED, 60.0 };
            assert_int_equal(verge_planner_set_signals(planner, utime, &red, 1), VERGE_OK);
            assert_int_equal(verge_planner_step(planner, utime, &vehicle, 1, &plan), VERGE_OK);
            const verge_point* at = &plan.vehicles[0].points[5];
            vehicle.x = at->x;
            vehicle.y = at->y;
            vehicle.heading = at->heading;
            vehicle.speed = at->speed;
            vehicle.acceleration = at->acceleration;
        }
        CHECK_AT_MOST(vehicle.x + 0.5 * vehicle.length - 120.0, fmax(fronts[i], 0.0) + 0.5);
    }
}

static void every_code_has_a_text_of_its_own(void** state)
{
    (void)state;
    for (int i = -1; i <= VERGE_WHY_COUNT; ++i) {
        const char* text = verge_why_text((verge_why)i);
        assert_true(strlen(text) > 0);
        for (int k = 0; k < i && i < VERGE_WHY_COUNT; ++k) {
            assert_string_not_equal(text, verge_why_text((verge_why)k));
        }
    }
    assert_string_equal(verge_priority_name(VERGE_PRIORITY_RIGHT_BEFORE_LEFT), "right-before-left");
    assert_string_equal(verge_priority_name((verge_priority)5), "??");
    assert_string_equal(verge_signal_state_name(VERGE_SIGNAL_YELLOW), "yellow");
    assert_string_equal(verge_signal_state_name((verge_signal_state)-1), "??");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_signal_counts_down_and_one_whose_change_has_passed_is_red),
        cmocka_unit_test(a_signal_that_is_refused_changes_nothing_and_its_field_is_named),
        cmocka_unit_test(signals_of_a_scene_are_ordered_by_lane),
        cmocka_unit_test(a_lane_keeps_its_priority_and_its_stop_line),
        cmocka_unit_test(a_priority_or_stop_line_out_of_range_is_refused_by_name),
        cmocka_unit_test(a_vehicle_that_stops_a_little_over_the_line_waits_for_green),
        cmocka_unit_test(every_code_has_a_text_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
