/// Goal: a vehicle that stands has a cause where somebody moves nearby, or where a body or the end
/// of the road is in its way, along whatever lanes lead on; none elsewhere.
/// Method: one vehicle placed by hand on a road of lanes in sequence, on a lane that ends beside
/// them, and on a ring; the distance to the end is a closed form.
#include "check.h"

#include "common/standing.h"

#include <math.h>
#include <stdio.h>

/// Lanes 0, 1, 2 follow each other along y = 0: to x = 100, to 110, to 200. Lane 3 beside lane 0
/// ends at x = 100. Lanes 4 and 5 make a ring of two half circles of radius 10 at (0, 100).
static const char TEXT[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"standing\", \"road\": { \"lanes\": ["
    "{ \"id\": 0, \"centerline\": [[0, 0], [100, 0]], \"width\": 4, \"speed_limit\": 20,"
    "  \"right\": 3, \"successors\": [1] },"
    "{ \"id\": 1, \"centerline\": [[100, 0], [110, 0]], \"width\": 4, \"speed_limit\": 20,"
    "  \"successors\": [2] },"
    "{ \"id\": 2, \"centerline\": [[110, 0], [200, 0]], \"width\": 4, \"speed_limit\": 20 },"
    "{ \"id\": 3, \"centerline\": [[0, -4], [100, -4]], \"width\": 4, \"speed_limit\": 20,"
    "  \"left\": 0 },"
    "{ \"id\": 4, \"centerline\": [[10, 100], [7.07, 107.07], [0, 110], [-7.07, 107.07],"
    "  [-10, 100]], \"width\": 4, \"speed_limit\": 10, \"successors\": [5] },"
    "{ \"id\": 5, \"centerline\": [[-10, 100], [-7.07, 92.93], [0, 90], [7.07, 92.93],"
    "  [10, 100]], \"width\": 4, \"speed_limit\": 10, \"successors\": [4] } ] }, \"vehicles\": ["
    "{ \"id\": 1, \"control\": \"controlled\", \"x\": 20, \"y\": 0, \"heading\": 0, \"speed\": 10,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 },"
    "{ \"id\": 2, \"control\": \"human\", \"x\": 20, \"y\": -4, \"heading\": 0, \"speed\": 0,"
    "  \"acceleration\": 0, \"length\": 5, \"width\": 2 } ] }";

typedef struct stage {
    scenario scene;
    world    world;
} stage;

/// The vehicle alone.
static void open_stage(stage* self)
{
    if (!scenario_parse(&self->scene, "standing", TEXT, sizeof TEXT - 1, NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    assert_true(world_init(&self->world, &self->scene));
    self->world.vehicles[1].present = false;
}

static void close_stage(stage* self)
{
    world_free(&self->world);
    scenario_free(&self->scene);
}

/// Does the vehicle stand there without a cause?
static bool stands(stage* self, double x, double y, int32_t lane, double speed)
{
    world_vehicle* vehicle = &self->world.vehicles[0];
    vehicle->state.x = x;
    vehicle->state.y = y;
    vehicle->state.speed = speed;
    vehicle->lane = vehicle->lane_last = lane;
    return standing_without_cause(&self->world, vehicle);
}

static void test_the_end_of_the_road_is_a_cause_across_lanes(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    for (int x = 5; x < 200; x += 5) { // the road ends at 200; the front is 2.5 m ahead
        const int32_t lane = x < 100 ? 0 : x < 110 ? 1 : 2;
        assert_int_equal(stands(&self, x + 0.5, 0.0, lane, 0.0), x + 0.5 + 2.5 + 15.0 <= 200.0);
    }
    close_stage(&self);
}

static void test_a_lane_that_ends_beside_one_that_goes_on_is_to_be_left(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    assert_true(world_dead_end(&self.world, 3));
    for (int32_t lane = 0; lane < 3; ++lane) {
        assert_false(world_dead_end(&self.world, lane));
    }
    assert_true(stands(&self, 49.0, -4.0, 3, 0.0));
    assert_true(stands(&self, 95.0, -4.0, 3, 0.0)); // the lane beside is empty
    self.world.vehicles[1].present = true;
    self.world.vehicles[1].state.x = 80.0;
    self.world.vehicles[1].state.y = 0.0;
    self.world.vehicles[1].state.speed = 5.0;
    assert_false(stands(&self, 95.0, -4.0, 3, 0.0)); // it waits for a gap
    close_stage(&self);
}

static void test_a_ring_has_no_end(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    assert_true(stands(&self, 10.0, 100.0, 4, 0.0));
    assert_true(stands(&self, 0.0, 90.0, 5, 0.0));
    close_stage(&self);
}

static void test_off_the_road_only_vehicles_are_a_cause(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    assert_true(stands(&self, 195.0, 30.0, VERGE_NO_LANE, 0.0));
    self.world.vehicles[1].present = true;
    self.world.vehicles[1].state.x = 210.0;
    self.world.vehicles[1].state.y = 30.0;
    assert_false(stands(&self, 195.0, 30.0, VERGE_NO_LANE, 0.0));
    close_stage(&self);
}

static void test_a_body_that_stands_is_a_cause_only_in_the_way(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle* other = &self.world.vehicles[1].state;
    self.world.vehicles[1].present = true;
    for (int x = -10; x <= 40; x += 5) {
        for (int y = -6; y <= 6; y += 2) {
            other->x = 92.0 + x; // beyond the end of lane 0, too
            other->y = y;
            const bool in_way = x > -2 && x <= 20 && y > -3 && y < 3;
            assert_int_equal(stands(&self, 92.0, 0.0, 0, 0.0), !in_way);
        }
    }
    other->x = 0.0; // round the bend of the ring
    other->y = 110.0;
    assert_false(stands(&self, 10.0, 100.0, 4, 0.0));
    close_stage(&self);
}

static void test_whoever_moves_nearby_may_be_the_cause(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    verge_vehicle* other = &self.world.vehicles[1].state;
    self.world.vehicles[1].present = true;
    for (int distance = 30; distance <= 50; distance += 4) {
        other->x = 50.0;
        other->y = distance;
        other->speed = 5.0;
        assert_int_equal(stands(&self, 50.0, 0.0, 0, 0.0), distance > 40);
        other->speed = 0.0;
        assert_true(stands(&self, 50.0, 0.0, 0, 0.0));
    }
    close_stage(&self);
}

static void test_moving_and_absent_vehicles_do_not_stand(void** state)
{
    (void)state;
    stage self;
    open_stage(&self);
    assert_true(stands(&self, 50.0, 0.0, 0, 0.49));
    assert_true(stands(&self, 50.0, 0.0, 0, -0.49));
    assert_false(stands(&self, 50.0, 0.0, 0, 0.5));
    assert_false(stands(&self, 50.0, 0.0, 0, -3.0));
    self.world.vehicles[0].present = false;
    assert_false(stands(&self, 50.0, 0.0, 0, 0.0));
    close_stage(&self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_end_of_the_road_is_a_cause_across_lanes),
        cmocka_unit_test(test_a_lane_that_ends_beside_one_that_goes_on_is_to_be_left),
        cmocka_unit_test(test_a_ring_has_no_end),
        cmocka_unit_test(test_off_the_road_only_vehicles_are_a_cause),
        cmocka_unit_test(test_a_body_that_stands_is_a_cause_only_in_the_way),
        cmocka_unit_test(test_whoever_moves_nearby_may_be_the_cause),
        cmocka_unit_test(test_moving_and_absent_vehicles_do_not_stand),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
