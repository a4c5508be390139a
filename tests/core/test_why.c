// A vehicle that stands says why, and so does one that cannot go where it wants; the words name who
// and where. Public headers only: scenes are placed, planned once, and the plan is read.
#include "check.h"

#include <verge/verge.h>

#include <math.h>
#include <stdalign.h>

alignas(64) static unsigned char memory[8 << 20];
static verge_plan plan;

// Lane 0 runs east and ends at x = 200; 1 is its left neighbour and goes on as 4; 2 crosses both at
// x = 120, northwards; 3 lies elsewhere and leads nowhere.
enum { LANES = 5 };
static const double centrelines[LANES][2][2] = {
    { { 0, 0 }, { 200, 0 } }, { { 0, 3.5 }, { 200, 3.5 } }, { { 120, -80 }, { 120, 80 } },
    { { 0, 300 }, { 200, 300 } }, { { 200, 3.5 }, { 400, 3.5 } },
};

static verge_planner* open_planner(void)
{
    static verge_lane_def lanes[LANES];
    for (int32_t i = 0; i < LANES; ++i) {
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = centrelines[i];
        lanes[i].point_count = 2;
    }
    lanes[0].left = 1;
    lanes[1].right = 0;
    lanes[1].successors[0] = 4;
    lanes[1].successor_count = 1;
    lanes[0].change_left_given = true; // only before x = 150
    lanes[0].change_left[0] = (verge_stretch){ 0.0, 150.0 };
    lanes[0].change_left_count = 1;
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, LANES };
    def.iterations = 60;
    def.nodes_max = 100;
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, sizeof memory), VERGE_OK);
    return planner;
}

static verge_vehicle vehicle_at(int32_t id, double x, double y, double speed)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = id;
    vehicle.controlled = id == 1;
    vehicle.x = x;
    vehicle.y = y;
    vehicle.speed = speed;
    return vehicle;
}

static const verge_vehicle_plan* plan_with(verge_planner* planner, const verge_vehicle* vehicles,
                                           uint32_t count)
{
    static int64_t utime;
    assert_int_equal(verge_planner_step(planner, utime += 500000, vehicles, count, &plan), VERGE_OK);
    assert_int_equal(plan.vehicles[0].vehicle_id, 1);
    return &plan.vehicles[0];
}

static void says(const verge_vehicle_plan* of, verge_why code, int32_t vehicle, const char* words)
{
    char text[200];
    verge_cause_say(&of->why, text, sizeof text);
    if (of->why.code != code || of->why.vehicle_id != vehicle || strcmp(text, words) != 0) {
        fail_msg("expected %s (vehicle %d, \"%s\"), it is %s (vehicle %d, \"%s\")",
                 verge_why_name(code), vehicle, words, verge_why_name(of->why.code),
                 of->why.vehicle_id, text);
    }
}

static void a_standing_vehicle_names_what_it_stands_for(void** state)
{
    (void)state;
    verge_planner* planner = open_planner();
    verge_vehicle v[3] = { vehicle_at(1, 50.0, 0.0, 0.0), vehicle_at(2, 57.5, 0.0, 0.0),
                           vehicle_at(3, 64.5, 0.0, 0.0) };
    says(plan_with(planner, v, 3), VERGE_WHY_LEADER, 2, "behind vehicle 2");
    says(plan_with(planner, v, 2), VERGE_WHY_OBSTACLE, 2, "vehicle 2 stands in the way");

    verge_vehicle end = vehicle_at(1, 196.0, 0.0, 0.0);
    says(plan_with(planner, &end, 1), VERGE_WHY_LANE_END, -1, "waits at the end of lane 0");

    verge_vehicle light = vehicle_at(1, 196.0, 3.5, 0.0);
    const verge_signal red = { 1, VERGE_SIGNAL_RED, 60.0 };
    assert_int_equal(verge_planner_set_signals(planner, 400000, &red, 1), VERGE_OK);
    says(plan_with(planner, &light, 1), VERGE_WHY_SIGNAL, -1, "waits for the signal of lane 1");
    assert_int_equal(verge_planner_set_signals(planner, 0, NULL, 0), VERGE_OK);

    verge_vehicle beyond = vehicle_at(1, 50.0, 150.0, 0.0);
    says(plan_with(planner, &beyond, 1), VERGE_WHY_OFF_ROAD, -1, "it is on no lane");
}

static void who_stands_before_a_crossing_names_the_vehicle_in_it(void** state)
{
    (void)state;
    verge_planner* planner = open_planner();
    verge_vehicle v[2] = { vehicle_at(1, 113.0, 0.0, 0.0), vehicle_at(2, 120.0, -1.0, 0.0) };
    v[1].heading = 0.5 * 3.14159265358979;
    const verge_vehicle_plan* of = plan_with(planner, v, 2);
    assert_int_equal(of->why.vehicle_id, 2);
    assert_true(of->why.code != VERGE_WHY_NONE && of->why.code != VERGE_WHY_BLOCKED);
}

static void whatever_stands_has_a_reason(void** state)
{
    (void)state;
    verge_planner* planner = open_planner();
    for (int i = 0; i < 160; ++i) {
        const int lane = i % 4;
        verge_vehicle v = vehicle_at(1, 5.0 + 1.2 * i, lane == 0 ? 0.0 : lane == 1 ? 3.5 : 300.0, 0.0);
        if (lane == 2) {
            v = vehicle_at(1, 120.0, -75.0 + 0.9 * i, 0.0);
            v.heading = 0.5 * 3.14159265358979;
        }
        v.target_lane = i % 5;
        assert_int_not_equal(plan_with(planner, &v, 1)->why.code, VERGE_WHY_NONE);
    }
}

static void a_change_that_is_not_made_names_the_lane_and_who_leaves_no_room(void** state)
{
    (void)state;
    verge_planner* planner = open_planner();
    verge_vehicle v[2] = { vehicle_at(1, 80.0, 0.0, 10.0), vehicle_at(7, 76.0, 3.5, 10.0) };
    v[0].target_lane = 4;
    says(plan_with(planner, v, 2), VERGE_WHY_ROOM_BEHIND, 7,
         "left lane: no room ahead of vehicle 7");
    v[1].x = 84.0;
    verge_planner_reset(planner);
    says(plan_with(planner, v, 2), VERGE_WHY_ROOM_AHEAD, 7, "left lane: no room behind vehicle 7");
    v[0].target_lane = 3;
    verge_planner_reset(planner);
    says(plan_with(planner, v, 2), VERGE_WHY_UNREACHABLE, -1, "cannot reach lane 3 from here");
    v[0] = vehicle_at(1, 160.0, 0.0, 5.0);
    v[0].target_lane = 4;
    verge_planner_reset(planner);
    says(plan_with(planner, v, 1), VERGE_WHY_BORDER, -1, "left lane: no lane change is allowed here");
    verge_vehicle free_one = vehicle_at(1, 20.0, 3.5, 10.0);
    verge_planner_reset(planner);
    says(plan_with(planner, &free_one, 1), VERGE_WHY_NONE, -1, "");
}

static void what_is_new_is_said(void** state)
{
    (void)state;
    verge_planner* planner = open_planner();
    verge_vehicle v[2] = { vehicle_at(1, 50.0, 0.0, 0.0), vehicle_at(2, 57.0, 0.0, 0.0) };
    assert_int_equal(plan_with(planner, v, 2)->changed, VERGE_CHANGED_FIRST);
    assert_int_equal(plan_with(planner, v, 2)->changed & VERGE_CHANGED_WHY, 0);
    v[1].id = 3;
    assert_true((plan_with(planner, v, 2)->changed & VERGE_CHANGED_WHY) != 0);
}

static void a_sentence_is_the_action_and_what_the_vehicle_waits_for(void** state)
{
    (void)state;
    static verge_vehicle_plan of;
    char text[200], small[200];
    of.action_count = 1;
    of.actions[0] = (verge_action_step){ .action = VERGE_DECELERATE, .ahead_id = 4, .behind_id = -1 };
    of.why = (verge_cause){ VERGE_WHY_ROOM_BEHIND, 7, 2, 1 };
    const size_t length = verge_plan_say(&of, text, sizeof text);
    assert_string_equal(text, "slowing down behind vehicle 4; left lane: no room ahead of vehicle 7");
    assert_int_equal(length, strlen(text));
    of.why = (verge_cause){ VERGE_WHY_LEADER, 4, 2, 0 };
    verge_plan_say(&of, text, sizeof text);
    assert_string_equal(text, "slowing down behind vehicle 4"); // once is enough
    of.why = (verge_cause){ VERGE_WHY_ROOM_BEHIND, 7, 2, 0 };
    verge_cause_say(&of.why, text, sizeof text);
    assert_string_equal(text, "lane 2: no room ahead of vehicle 7"); // the side is not known
    for (int code = -1; code <= VERGE_WHY_COUNT; ++code) {
        for (int32_t id = -1; id < 2; ++id) {
            of.why = (verge_cause){ (verge_why)code, id, id, 0 };
            const size_t whole = verge_plan_say(&of, text, sizeof text);
            for (size_t size = 1; size <= whole; ++size) { // cut, never beyond the buffer
                memset(small, 'x', sizeof small);
                assert_int_equal(verge_plan_say(&of, small, size), size - 1);
                assert_int_equal(small[size - 1], '\0');
                assert_memory_equal(small, text, size - 1);
                assert_int_equal(small[size], 'x');
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_standing_vehicle_names_what_it_stands_for),
        cmocka_unit_test(who_stands_before_a_crossing_names_the_vehicle_in_it),
        cmocka_unit_test(whatever_stands_has_a_reason),
        cmocka_unit_test(a_change_that_is_not_made_names_the_lane_and_who_leaves_no_room),
        cmocka_unit_test(what_is_new_is_said),
        cmocka_unit_test(a_sentence_is_the_action_and_what_the_vehicle_waits_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
