/// Goal: the lane of a vehicle is the one it drives along: heading comes first, then the distance
///       to the centre; the route of the last cycle holds while the vehicle is on it; the target
///       breaks ties only; between the lanes of a junction nobody is on no lane.
/// Method: vehicles at known places of a small junction and of a lane that crosses itself.
#include "check.h"
#include "road/road.h"
#include "verge/planner.h"

#include <math.h>
#include <stdlib.h>

enum { ROAD_SIZE = 4 << 20 };
static _Alignas(64) char memory[ROAD_SIZE];

static verge_lane_def lane(int32_t id, const double (*points)[2], uint32_t count)
{
    verge_lane_def def = verge_lane_def_default();
    def.id = id;
    def.points = points;
    def.point_count = count;
    return def;
}

static const verge_road* build(const verge_lane_def* lanes, uint32_t count)
{
    const verge_road* road = NULL;
    const verge_road_def def = { lanes, count };
    assert_int_equal(verge_road_init(&road, &def, memory, sizeof memory), VERGE_OK);
    return road;
}

/// Where a vehicle is placed that was on `before` a cycle ago (VERGE_NO_LANE: it is new).
static verge_lane_position placed(const verge_road* road, double x, double y, double heading,
                                  int32_t target, int32_t before)
{
    verge_vehicle vehicles[2];
    verge_lane_position positions[2];
    verge_scene now = verge_scene_make(road, &vehicles[0], &positions[0], 1);
    verge_scene last = verge_scene_make(road, &vehicles[1], &positions[1], 1);
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = 1;
    vehicle.controlled = true;
    vehicle.x = x;
    vehicle.y = y;
    vehicle.heading = heading;
    vehicle.speed = 5.0;
    vehicle.target_lane = target;
    vehicles[1] = vehicle;
    positions[1] = (verge_lane_position){ .lane_id = before };
    last.vehicle_count = 1;
    const bool known = before != VERGE_NO_LANE;
    assert_int_equal(verge_scene_place(&now, 0, &vehicle, 1, known ? &last : NULL), VERGE_OK);
    return positions[0];
}

/// An arm from the west (0), straight on (1, 2), to the right (3, 4), a street from the north (5).
static const verge_road* junction(void)
{
    static const double in[][2] = { { -80, 0 }, { 0, 0 } }, through[][2] = { { 0, 0 }, { 24, 0 } };
    static const double out[][2] = { { 24, 0 }, { 200, 0 } }, down[][2] = { { 12, -12 }, { 12, -90 } };
    static const double street[][2] = { { 12, 90 }, { 12, -12 } };
    static double turn[25][2];
    for (int i = 0; i < 25; ++i) {
        const double angle = 0.5 * M_PI * i / 24.0;
        turn[i][0] = 12.0 * sin(angle);
        turn[i][1] = -12.0 * (1.0 - cos(angle));
    }
    static verge_lane_def lanes[6];
    lanes[0] = lane(0, in, 2);
    lanes[0].successors[0] = 1;
    lanes[0].successors[1] = 3;
    lanes[0].successor_count = 2;
    lanes[1] = lane(1, through, 2);
    lanes[1].successors[0] = 2;
    lanes[2] = lane(2, out, 2);
    lanes[3] = lane(3, (const double (*)[2])turn, 25);
    lanes[3].successors[0] = 4;
    lanes[4] = lane(4, down, 2);
    lanes[5] = lane(5, street, 2);
    lanes[5].successors[0] = 4;
    lanes[1].successor_count = lanes[3].successor_count = lanes[5].successor_count = 1;
    return build(lanes, 6);
}

static void a_vehicle_that_missed_its_turn_is_on_the_lane_it_drives_along(void** state)
{
    (void)state;
    const verge_road* road = junction();
    for (double x = 6.0; x < 24.0; x += 1.0) { // straight on, though the target is to the right
        assert_int_equal(placed(road, x, 0.0, 0.0, 4, 1).lane_id, 1);
        assert_int_equal(placed(road, x, -0.3, 0.1, 4, 1).lane_id, 1);
        assert_int_equal(placed(road, x, 0.0, 0.0, 4, VERGE_NO_LANE).lane_id, 1);
    }
    assert_int_equal(placed(road, 12.0, -1.0, 0.0, 4, 5).lane_id, 1);   // the street is across
    assert_int_equal(placed(road, 12.0, 1.0, -1.5, 2, 1).lane_id, 5);   // now it heads down it
    assert_int_equal(placed(road, 12.0, -0.5, -1.57, 2, VERGE_NO_LANE).lane_id, 5);
}

static void the_target_decides_where_lanes_fit_as_well(void** state)
{
    (void)state;
    const verge_road* road = junction();
    for (double x = 0.5; x < 3.0; x += 0.5) { // both lanes begin as one
        assert_int_equal(placed(road, x, 0.0, 0.0, 4, VERGE_NO_LANE).lane_id, 3);
        assert_int_equal(placed(road, x, 0.0, 0.0, 2, VERGE_NO_LANE).lane_id, 1);
        assert_int_equal(placed(road, x, 0.0, 0.0, 4, 0).lane_id, 3);
        assert_int_equal(placed(road, x, 0.0, 0.0, 2, 0).lane_id, 1);
    }
}

static void in_a_junction_the_lane_of_the_route_holds_while_the_vehicle_is_on_it(void** state)
{
    (void)state;
    const verge_road* road = junction();
    for (double x = 1.0; x < 4.0; x += 0.5) {
        assert_int_equal(placed(road, x, -0.2, -0.1, VERGE_NO_LANE, 3).lane_id, 3);
        assert_int_equal(placed(road, x, -0.2, -0.1, VERGE_NO_LANE, 1).lane_id, 1);
    }
}

static void between_the_lanes_of_a_junction_a_vehicle_keeps_its_lane(void** state)
{
    (void)state;
    const verge_road* road = junction();
    for (double y = -5.9; y <= -4.5; y += 0.2) { // wide of everything there is
        const verge_lane_position at = placed(road, 19.0, y, -0.3, 4, 1);
        assert_int_equal(at.lane_id, 1);
        CHECK_BETWEEN(at.d, -6.0, -1.0);
    }
    assert_int_equal(placed(road, 100.0, -5.0, 0.0, 4, 2).lane_id, VERGE_NO_LANE); // no junction
}

static void whoever_faces_against_a_lane_is_on_it_where_there_is_no_other(void** state)
{
    (void)state;
    const verge_road* road = junction();
    assert_int_equal(placed(road, -40.0, 0.3, M_PI, 4, VERGE_NO_LANE).lane_id, 0);
    assert_int_equal(placed(road, 12.0, 40.0, 0.5 * M_PI, 4, VERGE_NO_LANE).lane_id, 5);
    static const double east[][2] = { { 0, 0 }, { 100, 0 } }, west[][2] = { { 100, 1 }, { 0, 1 } };
    verge_lane_def lanes[2] = { lane(0, east, 2), lane(1, west, 2) }; // a narrow street, both ways
    road = build(lanes, 2);
    for (double y = -0.7; y <= 1.7; y += 0.2) {
        assert_int_equal(placed(road, 50.0, y, 0.0, VERGE_NO_LANE, VERGE_NO_LANE).lane_id, 0);
        assert_int_equal(placed(road, 50.0, y, M_PI, VERGE_NO_LANE, VERGE_NO_LANE).lane_id, 1);
        assert_int_equal(placed(road, 50.0, y, M_PI, VERGE_NO_LANE, 0).lane_id, 1);
    }
}

static void on_a_lane_that_crosses_itself_the_heading_says_where(void** state)
{
    (void)state;
    static double points[100][2];
    uint32_t count = 0;
    for (double x = -60.0; x < 0.0; x += 3.0) { // east, round to the left, and south over itself
        points[count][0] = x;
        points[count++][1] = 0.0;
    }
    for (double angle = -0.5 * M_PI; angle < M_PI; angle += 0.1) {
        points[count][0] = 20.0 * cos(angle);
        points[count++][1] = 20.0 + 20.0 * sin(angle);
    }
    for (double y = 18.0; y > -60.0; y -= 3.0) {
        points[count][0] = -20.0;
        points[count++][1] = y;
    }
    const verge_lane_def only = lane(0, (const double (*)[2])points, count);
    const verge_road* road = build(&only, 1);
    for (double off = -1.2; off <= 1.2; off += 0.3) {
        const verge_lane_position first = placed(road, -20.0 + off, -off, 0.0, -1, 0);
        const verge_lane_position second = placed(road, -20.0 + off, -off, -0.5 * M_PI, -1, 0);
        assert_int_equal(first.lane_id, 0);
        assert_int_equal(second.lane_id, 0);
        CHECK_NEAR(first.s, 40.0 + off, 0.3);
        CHECK_NEAR(second.s, 60.0 + 1.5 * M_PI * 20.0 + 20.0 + off, 1.0);
        CHECK_NEAR(first.heading, 0.0, 0.05);
        CHECK_NEAR(second.heading, -0.5 * M_PI, 0.05);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_vehicle_that_missed_its_turn_is_on_the_lane_it_drives_along),
        cmocka_unit_test(the_target_decides_where_lanes_fit_as_well),
        cmocka_unit_test(in_a_junction_the_lane_of_the_route_holds_while_the_vehicle_is_on_it),
        cmocka_unit_test(between_the_lanes_of_a_junction_a_vehicle_keeps_its_lane),
        cmocka_unit_test(whoever_faces_against_a_lane_is_on_it_where_there_is_no_other),
        cmocka_unit_test(on_a_lane_that_crosses_itself_the_heading_says_where),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
