/// Goal: every trajectory can be driven, begins at the state of its vehicle, and touches no body.
/// Method: an independent judge (strict.h) over random scenes; single cases for standstill, stops,
/// starts, slow changes, dead ends, overlaps and fallbacks.
#include "check.h"
#include "closed_loop.h"
#include "rng.h"
#include "scene.h"
#include "strict.h"

static void check_drivable(const scene* w, uint32_t job, const char* what)
{
    char text[160] = "";
    const verge_body body = verge_vehicle_body(&w->vehicles[job]);
    const char* fault = strict_motion_fault(&w->plans[job], &body, w->def.point_s, text);
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
    for (uint32_t i = 0; i < others; ++i) {
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
    for (uint32_t round = 0; round < rounds; ++round) {
        scene* w = random_scene(&rng);
        const uint64_t evaluated = scene_run(w);
        const verge_vehicle_plan* plan = &w->plans[0];
        // A slow body that drifts stands across its lane and may overlap from the start.
        assert_true(evaluated > 0 || plan->reason == VERGE_REASON_OVERLAP_NOW);
        char what[80];
        snprintf(what, sizeof what, "scene %u, status %d, reason %d", round, (int)plan->status,
                 (int)plan->reason);
        check_drivable(w, 0, what);
        planned += plan->status == VERGE_PLANNED;
        for (uint32_t j = 1; j < w->tracks.count && plan->status == VERGE_PLANNED; ++j) {
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

/// Beside the line of a bend the speed of the vehicle is the decided one, not that along the line.
static void test_the_decided_speed_is_that_of_the_vehicle_beside_a_bend(void** state)
{
    (void)state;
    for (int k = 0; k < 16; ++k) {
        const double d = k % 2 == 0 ? 0.7 : -0.7, radius = 15.0 + 5.0 * (k / 4);
        const double goal = 5.0 + (k / 2 % 2), side = k % 4 < 2 ? 1.0 : -1.0;
        scene* w = scene_make(side / (radius + (side > 0.0 ? SCENE_WIDTH : 0.0)), 0.0);
        vg_job* job = scene_vehicle(w, 1, 15.0, d, 0.0, 6.0, 0.0, goal);
        job->segments[0].d = d;
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        const verge_point* end = &w->plans[0].points[w->def.points - 1];
        CHECK_NEAR(end->speed, goal, 0.03 * goal);
        CHECK_NEAR(verge_road_project_on(w->road, 1, end->x, end->y).d, d, 0.25);
        scene_free(w);
    }
}

/// A decision that brakes by 3 m/s^2, or for one step as hard as the body can, is driven.
static void test_hard_braking_that_was_decided_is_driven(void** state)
{
    (void)state;
    for (int k = 0; k < 24; ++k) {
        scene* w = scene_make(0.0, 0.0);
        const bool step = k % 2 == 0; // one step of 1.5 s, then the speed is kept; else for 3 s
        const double v = 8.0 + k / 2, braking = step ? 2.5 : 3.0;
        vg_job* job = scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, fmax(v - 3.0 * braking, 0.0));
        job->segments[0].action = VERGE_DECELERATE;
        if (step) {
            job->segments[0].t1 = 1.5;
            job->segments[0].v = v - 1.5 * braking;
            job->segments[1] = (vg_segment){ .t0 = 1.5, .t1 = 3.0, .action = VERGE_KEEP_SPEED,
                                             .lane = 1, .v = job->segments[0].v };
            job->segment_count = 2;
        }
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        const double wanted = job->segments[job->segment_count - 1].v;
        CHECK_NEAR(w->plans[0].points[step ? 15 : 30].speed, wanted, 0.6);
        check_drivable(w, 0, "braking");
        scene_free(w);
    }
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

static void test_brakes_take_their_time_at_walking_speed_too(void** state)
{
    (void)state;
    for (double v = 0.01; v <= 0.5; v += 0.01) {
        scene* w = scene_make(0.0, 0.0);
        vg_job* job = scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, 0.0);
        job->segments[0].t1 = 1.5; // a short step asks for a short stop
        job->segments[1] = job->segments[0];
        job->segments[1].t1 = 3.0;
        job->segment_count = 2;
        scene_track(w, 36.0, SCENE_WIDTH, 0.0, 0.0);
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        check_drivable(w, 0, "walking speed");
        scene_free(w);
    }
}

static void test_a_vehicle_at_rest_starts_when_its_action_accelerates(void** state)
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

/// Drives the first vehicle's plan for half a second; all other tracks have to stand.
static void drive_on(scene* w)
{
    const verge_point* p = &w->plans[0].points[5];
    vg_job* job = &w->jobs[0];
    take_point(&w->vehicles[0], p);
    job->curvature = p->curvature;
    const verge_lane_position at = verge_road_project_on(w->road, (int32_t)job->lane, p->x, p->y);
    job->s = at.s;
    job->d = at.d;
}

static void test_the_standstill_gap_is_kept_behind_a_standing_body(void** state)
{
    (void)state;
    for (double v = 0.0; v <= 16.0; v += 4.0) {
        scene* w = scene_make(1.0 / 125.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_track(w, 30.0 + 12.0 + v * v / 3.0, SCENE_WIDTH, 0.0, 0.0);
        for (uint32_t cycle = 0; cycle < 80; ++cycle) {
            w->jobs[0].segments[0].v = w->vehicles[0].speed + 0.9; // the decision wants to go on
            scene_run(w);
            assert_int_equal(w->plans[0].status, VERGE_PLANNED);
            for (uint32_t k = 0; k < w->def.points; ++k) {
                CHECK_AT_MOST(-w->plans[0].points[k].acceleration, 3.5); // early, not hard
            }
            drive_on(w);
        }
        const verge_track* other = &w->tracks.of[1];
        const double gap = hypot(other->x[0] - w->vehicles[0].x, other->y[0] - w->vehicles[0].y)
                         - 5.0;
        CHECK_BETWEEN(gap, w->def.idm_gap - 0.3, w->def.idm_gap + 1.2);
        CHECK_AT_MOST(w->vehicles[0].speed, 0.05);
        scene_free(w);
    }
}

static void test_a_vehicle_faster_than_the_limit_slows_down_gently(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0); // limit 25
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 33.0, 0.0, 33.0);
    scene_run(w);
    assert_int_equal(w->plans[0].status, VERGE_PLANNED);
    CHECK_BETWEEN(w->plans[0].points[w->def.points - 1].speed, 28.0, 29.5);
    for (uint32_t k = 0; k < w->def.points; ++k) {
        CHECK_AT_MOST(-w->plans[0].points[k].acceleration, 3.0);
    }
    scene_free(w);
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

static void test_a_body_in_the_rear_of_another_one_stops_and_stays(void** state)
{
    (void)state;
    for (double offset = 0.0; offset <= 1.0; offset += 0.5) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, 6.0, 0.0, 6.0);
        scene_track(w, 34.5, SCENE_WIDTH + offset, 0.0, 0.0);
        for (uint32_t cycle = 0; cycle < 6; ++cycle) {
            scene_run(w);
            assert_int_equal(w->plans[0].reason, VERGE_REASON_OVERLAP_NOW);
            CHECK_AT_MOST(w->plans[0].points[w->def.points - 1].speed, 1e-6);
            drive_on(w);
        }
        CHECK_AT_MOST(w->vehicles[0].x, 30.0 + 6.0 * 6.0 / 16.0 + 2.5); // 8 m/s^2 after 0.4 s
        scene_free(w);
    }
}

static void test_a_body_in_the_rear_of_one_that_draws_away_drives_on(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 12.0, 0.0, 12.0);
    scene_track(w, 34.9, SCENE_WIDTH, 13.0, 0.0);
    scene_run(w);
    assert_int_equal(w->plans[0].status, VERGE_FALLBACK_KEEP_LANE);
    assert_int_equal(w->plans[0].reason, VERGE_REASON_OVERLAP_NOW);
    CHECK_AT_MOST(11.0, w->plans[0].points[w->def.points - 1].speed);
    scene_free(w);
}

static void test_a_fallback_brakes_for_a_dead_end_with_any_vehicle_behind(void** state)
{
    (void)state;
    for (double v = 3.0; v <= 9.0; v += 2.0) {
        scene* w = scene_make(0.0, 80.0);
        scene_vehicle(w, 0, 80.0 - 4.0 - v * v / 9.0 - 0.3 * v, 0.0, 0.0, v, 0.0, v);
        scene_track(w, w->vehicles[0].x - 5.5, 0.0, v, 0.0); // would run into a vehicle that brakes
        scene_run(w);
        assert_true(w->plans[0].status != VERGE_PLANNED);
        assert_int_equal(w->plans[0].reason, VERGE_REASON_COLLISION);
        CHECK_AT_MOST(w->plans[0].points[w->def.points - 1].x + 2.5, 80.0);
        check_drivable(w, 0, "dead end, follower");
        scene_free(w);
    }
}

static void test_keeping_a_lane_does_not_end_beyond_its_border(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("border");
    uint32_t planned = 0, refused = 0;
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        const double off = test_rng_between(&rng, -1.6, 1.6);
        const double slant = test_rng_between(&rng, -0.5, 0.5);
        const double v = test_rng_between(&rng, 0.5, 15.0);
        scene* w = scene_make(round % 2 ? 1.0 / 30.0 : 0.0, 0.0);
        scene_vehicle(w, 1, 30.0, off, slant, v, 0.0, v);
        scene_run(w);
        const verge_point* end = &w->plans[0].points[w->def.points - 1];
        const verge_lane_position at = verge_road_project_on(w->road, 1, end->x, end->y);
        if (w->plans[0].status == VERGE_PLANNED) {
            CHECK_AT_MOST(fabs(at.d), 0.5 * SCENE_WIDTH + 1e-2);
            ++planned;
        } else {
            assert_int_equal(w->plans[0].reason, VERGE_REASON_NO_FEASIBLE);
            ++refused;
        }
        scene_free(w);
    }
    printf("             %u planned, %u refused\n", planned, refused);
    assert_true(planned > 0 && refused > 0);
}

static void test_a_fallback_states_its_reason(void** state)
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

    // An unavoidable wall: the vehicle brakes as hard as it can, and the contact is reported.
    w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 20.0, 0.0, 20.0);
    for (int lane = 0; lane < 3; ++lane) {
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
        cmocka_unit_test(test_the_decided_speed_is_that_of_the_vehicle_beside_a_bend),
        cmocka_unit_test(test_hard_braking_that_was_decided_is_driven),
        cmocka_unit_test(test_a_lane_change_ends_in_the_other_lane),
        cmocka_unit_test(test_a_slow_vehicle_changes_lanes_as_far_as_its_steering_follows),
        cmocka_unit_test(test_a_vehicle_at_rest_stays_at_rest_behind_another),
        cmocka_unit_test(test_brakes_take_their_time_at_walking_speed_too),
        cmocka_unit_test(test_a_vehicle_at_rest_starts_when_its_action_accelerates),
        cmocka_unit_test(test_a_vehicle_stops_behind_a_standing_one),
        cmocka_unit_test(test_the_standstill_gap_is_kept_behind_a_standing_body),
        cmocka_unit_test(test_a_vehicle_faster_than_the_limit_slows_down_gently),
        cmocka_unit_test(test_it_does_not_drive_over_the_end_of_a_dead_end),
        cmocka_unit_test(test_a_body_that_overlaps_already_may_leave_the_overlap),
        cmocka_unit_test(test_a_body_in_the_rear_of_another_one_stops_and_stays),
        cmocka_unit_test(test_a_body_in_the_rear_of_one_that_draws_away_drives_on),
        cmocka_unit_test(test_a_fallback_brakes_for_a_dead_end_with_any_vehicle_behind),
        cmocka_unit_test(test_keeping_a_lane_does_not_end_beyond_its_border),
        cmocka_unit_test(test_a_fallback_states_its_reason),
        cmocka_unit_test(test_every_accepted_trajectory_passes_the_strict_judge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
