/// Goal: a vehicle that stands is static where nothing explains it, and temporarily stopped where a
///       queue, a junction, an end of the lane or its own start does.
/// Method: one vehicle at a time against the rule, on straight lanes and before a crossing.
#include "stage.h"

static vg_standing class_at(stage* at, uint32_t slot)
{
    stage_begin(at);
    return (vg_standing)at->scene.standing[slot];
}

static void without_a_cause_a_vehicle_that_stands_is_static(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 500.0);
    stage_add(at, false, 0, 200.0, 0.4, 0.0, -1);
    assert_int_equal(class_at(at, 0), VG_STATIC);
    at->vehicles[0].acceleration = 0.8; // sets off
    assert_int_equal(class_at(at, 0), VG_TEMPORARILY_STOPPED);
    at->vehicles[0].acceleration = 0.0;
    at->vehicles[0].speed = 3.0;
    assert_int_equal(class_at(at, 0), VG_MOVING);
    at->vehicles[0].speed = -3.0;
    assert_int_equal(class_at(at, 0), VG_MOVING);
    at->vehicles[0].speed = 0.0;
    at->vehicles[0].controlled = true;
    assert_int_equal(class_at(at, 0), VG_TEMPORARILY_STOPPED);
    stage_close(at);
}

static void a_queue_waits_but_not_who_stands_beside_or_across_it(void** state)
{
    (void)state;
    static const struct { double d, turn, leader_v, gap; vg_standing expected; } cases[] = {
        { 0.0, 0.0, 0.0, 4.0, VG_TEMPORARILY_STOPPED },
        { 0.9, 0.4, 1.5, 9.0, VG_TEMPORARILY_STOPPED },
        { 0.0, 0.0, 0.0, 11.0, VG_STATIC },  // too far to be the cause
        { 0.0, 0.0, 5.0, 4.0, VG_STATIC },   // the one ahead drives away
        { -1.1, 0.0, 0.0, 4.0, VG_STATIC },  // half on the shoulder
        { 0.0, 0.6, 0.0, 4.0, VG_STATIC },   // across
        { 0.0, M_PI, 0.0, 4.0, VG_STATIC },  // faces back
    };
    stage* at = stage_open_best(1, 500.0);
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
        stage_clear(at);
        stage_add(at, false, 0, 200.0, cases[k].d, 0.0, -1)->heading = cases[k].turn;
        stage_add(at, false, 0, 205.0 + cases[k].gap, 0.0, cases[k].leader_v, -1);
        assert_int_equal(class_at(at, 0), cases[k].expected);
    }
    stage_close(at);
}

static void before_a_crossing_or_the_end_of_the_lane_a_vehicle_may_wait(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 300.0);
    at->points[1][0][0] = at->points[1][1][0] = 150.0; // lane 1 crosses lane 0
    at->points[1][0][1] = -100.0;
    at->points[1][1][1] = 100.0;
    at->lanes[0].left = at->lanes[1].right = VERGE_NO_LANE;
    stage_build(at);
    for (double s = 20.0; s < 296.0; s += 5.0) {
        stage_clear(at);
        stage_add(at, false, 0, s, 0.0, 0.0, -1);
        const vg_conflict* area = &at->road->conflicts[at->road->conflicts_from[0]];
        const double front = s + 2.5;
        const bool waits = (front + 20.0 > area->from && front < area->to) || front + 20.0 > 300.0;
        assert_int_equal(class_at(at, 0), waits ? VG_TEMPORARILY_STOPPED : VG_STATIC);
    }
    stage_close(at);
}

static void whoever_stands_is_still_there_at_the_horizon(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    stage_add(at, true, 0, 100.0, 0.0, 5.0, -1);
    stage_add(at, false, 0, 200.0, 0.0, 0.0, -1);
    stage_add(at, false, 0, 300.0, 0.0, 0.0, -1)->heading = M_PI;
    stage_begin(at);
    const uint8_t keep = VERGE_KEEP_SPEED;
    for (uint32_t t = 0; t < at->def.steps; ++t) {
        stage_step(at, &at->root, &keep);
        for (uint32_t slot = 1; slot < 3; ++slot) {
            CHECK_NEAR((double)at->root.station[slot], 100.0 + 100.0 * slot, 0.6);
            CHECK_AT_MOST((double)at->root.v[slot], 0.051);
        }
    }
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_a_cause_a_vehicle_that_stands_is_static),
        cmocka_unit_test(a_queue_waits_but_not_who_stands_beside_or_across_it),
        cmocka_unit_test(whoever_stands_is_still_there_at_the_horizon),
        cmocka_unit_test(before_a_crossing_or_the_end_of_the_lane_a_vehicle_may_wait),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
