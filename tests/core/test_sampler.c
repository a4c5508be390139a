/// Goal: every trajectory can be driven, begins where the vehicle is, and touches nobody.
/// Method: a judge of its own (strict.h) over random scenes; single cases for what is special:
/// standstill, stops, starts, slow changes, dead ends, overlaps, fallbacks.
#include "check.h"
#include "rng.h"
#include "scene.h"
#include "strict.h"

static void check_drivable(const scene* w, uint32_t job, const char* what)
{
    char text[160] = "";
    const char* fault = strict_motion_fault(&w->plans[job], w->def.point_s, text);
    if (fault != NULL) {
        fail_msg("%s: %s: %s", what, fault, text);
    }
    const verge_vehicle* v = &w->vehicles[job];
    const verge_point* p = w->plans[job].points;
    CHECK_SAME_BITS(p->x, v->x);
    CHECK_SAME_BITS(p->y, v->y);
    CHECK_SAME_BITS(p->heading, v->heading);
    CHECK_SAME_BITS(p->speed, v->speed);
    CHECK_SAME_BITS(p->acceleration, v->acceleration);
    assert_int_equal(w->plans[job].point_count, w->def.points);
}

/// One planned vehicle with traffic all around, anywhere on any road.
static scene* random_scene(test_rng* rng)
{
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 60.0, 1.0 / 30.0 };
    scene* w = scene_make(curvatures[test_rng_below(rng, 4)], 0.0);
    const bool slow = test_rng_below(rng, 3) == 0 || fabs(w->curvature) > 0.01;
    const double top = slow ? 8.0 : 25.0;
    const double v = test_rng_below(rng, 8) == 0 ? 0.0 : test_rng_between(rng, 0.0, top);
    const uint32_t lane = test_rng_below(rng, 3);
    // One draw a statement: compilers evaluate arguments in different orders.
    const double off = test_rng_between(rng, -0.5, 0.5);
    const double slant = v > 3.0 ? test_rng_between(rng, -0.03, 0.03) : 0.0;
    const double a = v > 1.0 ? test_rng_between(rng, -1.0, 1.0) : 0.0;
    const double goal = fmax(0.0, v + test_rng_between(rng, -1.0, 1.0));
    vg_job* job = scene_vehicle(w, lane, 30.0, off, slant, v, a, goal);
    w->def.alert_continuous = test_rng_below(rng, 2);
    if (test_rng_below(rng, 2) == 0) { // a change, at once or after a while
        const bool left = lane == 0 || (lane == 1 && test_rng_below(rng, 2) == 0);
        const uint32_t n = test_rng_below(rng, 2);
        job->segment_count = n + 1;
        job->segments[0].t1 = 1.5;
        job->segments[n] = (vg_segment){ .t0 = 1.5 * n, .t1 = 3.0, .v = v,
            .action = left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT,
            .lane = left ? lane + 1 : lane - 1,
            .d = n == 0 ? 0.0 : (left ? -1.0 : 1.0) * 0.5 * SCENE_WIDTH };
    }
    const uint32_t others = test_rng_below(rng, 9);
    for (uint32_t i = 0; i < others; i += 1) {
        const double s = test_rng_between(rng, 0.0, 80.0);
        const double d = test_rng_between(rng, -1.0, 8.0);
        const double other_v = fmax(0.0, v + test_rng_between(rng, -5.0, 5.0));
        const double drift = test_rng_between(rng, -0.5, 0.5);
        if (fabs(s - 30.0) > 6.0 || fabs(d - SCENE_WIDTH * lane) > 3.2) {
            scene_track(w, s, d, other_v, drift);
        }
    }
    return w;
}

static void test_every_accepted_trajectory_passes_the_strict_judge(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("scenes");
    const uint32_t rounds = test_rounds(600);
    uint32_t planned = 0;
    for (uint32_t round = 0; round < rounds; round += 1) {
        scene* w = random_scene(&rng);
        assert_true(scene_run(w) > 0);
        const verge_vehicle_plan* plan = &w->plans[0];
        char what[80];
        snprintf(what, sizeof what, "scene %u, status %d, reason %d", round, (int)plan->status,
                 (int)plan->reason);
        check_drivable(w, 0, what);
        planned += plan->status == VERGE_PLANNED;
        for (uint32_t j = 1; j < w->tracks.count && plan->status == VERGE_PLANNED; j += 1) {
            const double t = strict_contact(&w->tracks.of[0], &w->tracks.of[j], w->def.points,
                                            w->def.point_s, 0.0);
            if (t <= 1e9) {
                fail_msg("%s: touches %u at %.2f s", what, j, t);
            }
        }
        assert_true((plan->reason == VERGE_REASON_NONE) == (plan->status == VERGE_PLANNED));
        assert_true(plan->cost.total >= 0.0 && plan->cost.obstacle >= 0.0);
        scene_free(w);
    }
    printf("             %u of %u planned\n", planned, rounds);
    assert_true(planned * 10 >= rounds * 7);
}

static void test_an_undisturbed_vehicle_keeps_its_lane_and_speed(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.4, 0.0, 15.0, 0.0, 15.0);

    scene_run(w);

    const verge_point* end = &w->plans[0].points[w->def.points - 1];
    assert_int_equal(w->plans[0].status, VERGE_PLANNED);
    CHECK_NEAR(end->speed, 15.0, 0.2);
    CHECK_NEAR(end->y, SCENE_WIDTH, 0.2);
    CHECK_NEAR(end->heading, 0.0, 1e-6);      // the quintic's end conditions
    CHECK_NEAR(end->acceleration, 0.0, 1e-6);
    scene_free(w);
}

static void test_a_lane_change_ends_in_the_other_lane(void** state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        scene* w = scene_make(1.0 / 200.0, 0.0);
        vg_job* job = scene_vehicle(w, 1, 30.0, 0.0, 0.0, 14.0, 0.0, 14.0);
        job->segments[0].action = side > 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        job->segments[0].lane = (uint32_t)(1 + side);
        scene_run(w);
        const verge_point* end = &w->plans[0].points[w->def.points - 1];
        const verge_lane_position at = verge_road_project_on(w->road, 1 + side, end->x, end->y);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        CHECK_NEAR(at.d, 0.0, 0.2);
        check_drivable(w, 0, "change");
        scene_free(w);
    }
}

static void test_a_slow_vehicle_changes_lanes_as_far_as_its_steering_follows(void** state)
{
    (void)state;
    for (double v = 1.0; v < 9.0; v += 1.0) {
        scene* w = scene_make(0.0, 0.0);
        vg_job* job = scene_vehicle(w, 0, 30.0, 0.0, 0.0, v, 0.0, v);
        job->segments[0].action = VERGE_CHANGE_LEFT;
        job->segments[0].lane = 1;
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        CHECK_BETWEEN(w->plans[0].points[w->def.points - 1].y, 0.04 * v, SCENE_WIDTH + 0.75);
        check_drivable(w, 0, "slow change");
        scene_free(w);
    }
}

static void test_a_vehicle_at_rest_stays_at_rest_behind_another(void** state)
{
    (void)state;
    scene* w = scene_make(1.0 / 60.0, 0.0);
    scene_vehicle(w, 0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    scene_track(w, 36.0, 0.0, 0.0, 0.0);

    scene_run(w);

    const verge_vehicle_plan* plan = &w->plans[0];
    assert_int_equal(plan->status, VERGE_PLANNED);
    CHECK_NEAR(plan->points[w->def.points - 1].x, plan->points[0].x, 0.3);
    check_drivable(w, 0, "rest");
    scene_free(w);
}

static void test_a_vehicle_starts_from_rest_when_told_to_accelerate(void** state)
{
    (void)state;
    scene* w = scene_make(1.0 / 60.0, 0.0);
    vg_job* job = scene_vehicle(w, 0, 30.0, 0.2, 0.0, 0.0, 0.0, 1.8);
    job->segments[0].action = VERGE_ACCELERATE;

    scene_run(w);

    assert_int_equal(w->plans[0].status, VERGE_PLANNED);
    CHECK_BETWEEN(w->plans[0].points[w->def.points - 1].speed, 1.0, 2.6);
    check_drivable(w, 0, "start");
    scene_free(w);
}

static void test_a_vehicle_stops_behind_a_standing_one(void** state)
{
    (void)state;
    for (double v = 2.0; v <= 12.0; v += 2.0) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_track(w, 30.0 + 6.5 + v * v / 10.0 + 0.5 * v, SCENE_WIDTH, 0.0, 0.0);
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        assert_true(strict_contact(&w->tracks.of[0], &w->tracks.of[1], w->def.points,
                                   w->def.point_s, 0.0) > 1e9);
        check_drivable(w, 0, "stop");
        scene_free(w);
    }
}

static void test_it_does_not_drive_over_the_end_of_a_dead_end(void** state)
{
    (void)state;
    for (double s = 30.0; s <= 60.0; s += 5.0) {
        scene* w = scene_make(0.0, 80.0);
        assert_true(w->road->lanes[0].dead_end);
        scene_vehicle(w, 0, s, 0.0, 0.0, 8.0, 0.0, 8.0);
        scene_run(w);
        const verge_point* end = &w->plans[0].points[w->def.points - 1];
        CHECK_AT_MOST(end->x + 2.5, 80.0);
        check_drivable(w, 0, "dead end");
        scene_free(w);
    }
}

static void test_a_body_that_overlaps_already_may_leave_the_overlap(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 12.0, 0.0, 12.0);
    scene_track(w, 25.5, SCENE_WIDTH, 8.0, 0.0); // half a metre into the rear, and slower

    scene_run(w);

    assert_int_equal(w->plans[0].status, VERGE_FALLBACK_KEEP_LANE);
    assert_int_equal(w->plans[0].reason, VERGE_REASON_OVERLAP_NOW);
    assert_true(w->plans[0].points[w->def.points - 1].speed > 10.0); // drives, does not starve
    scene_free(w);
}

static void test_fallbacks_say_why(void** state)
{
    (void)state;
    // Off the road: brakes straight ahead.
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.3, 10.0, 0.0, 10.0)->on_road = false;
    scene_run(w);
    assert_int_equal(w->plans[0].status, VERGE_FALLBACK_BRAKE);
    assert_int_equal(w->plans[0].reason, VERGE_REASON_OFF_ROAD);
    check_drivable(w, 0, "off road");
    CHECK_AT_MOST(w->plans[0].points[w->def.points - 1].speed, 2.0);
    scene_free(w);

    // A wall that cannot be missed: brakes as hard as it can, and says it will touch.
    w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 20.0, 0.0, 20.0);
    for (int lane = 0; lane < 3; lane += 1) {
        scene_track(w, 42.0, SCENE_WIDTH * lane, 0.0, 0.0);
    }
    scene_run(w);
    assert_int_equal(w->plans[0].status, VERGE_FALLBACK_BRAKE);
    assert_int_equal(w->plans[0].reason, VERGE_REASON_COLLISION);
    check_drivable(w, 0, "wall");
    scene_free(w);

    // A car that stands across its lane: no candidate is drivable.
    w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 1.5, 3.0, 0.0, 3.0);
    w->vehicles[0].yaw_rate = NAN;
    scene_run(w);
    assert_int_equal(w->plans[0].reason, VERGE_REASON_NO_FEASIBLE);
    assert_true(w->plans[0].status != VERGE_PLANNED);
    check_drivable(w, 0, "across");
    scene_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_undisturbed_vehicle_keeps_its_lane_and_speed),
        cmocka_unit_test(test_a_lane_change_ends_in_the_other_lane),
        cmocka_unit_test(test_a_slow_vehicle_changes_lanes_as_far_as_its_steering_follows),
        cmocka_unit_test(test_a_vehicle_at_rest_stays_at_rest_behind_another),
        cmocka_unit_test(test_a_vehicle_starts_from_rest_when_told_to_accelerate),
        cmocka_unit_test(test_a_vehicle_stops_behind_a_standing_one),
        cmocka_unit_test(test_it_does_not_drive_over_the_end_of_a_dead_end),
        cmocka_unit_test(test_a_body_that_overlaps_already_may_leave_the_overlap),
        cmocka_unit_test(test_fallbacks_say_why),
        cmocka_unit_test(test_every_accepted_trajectory_passes_the_strict_judge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
