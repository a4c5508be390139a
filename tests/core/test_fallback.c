/// Goal: a fallback can be driven, slows down, and is the gentlest one without a contact. It goes
/// on with the last plan while that is clear.
/// Method: the fallback is called directly in single and random scenes; strict.h judges motion and
/// contacts; braking distances are closed forms.
#include "check.h"
#include "motion/workspace.h"
#include "rng.h"
#include "scene.h"
#include "strict.h"

/// The hardest level of the fallback [m/s^2]: what tyres do on a dry road.
#define BRAKING_MAX 8.0
/// Brakes build up so fast. [m/s^3]
#define JERK_MAX 12.0

/// The fallback of the scene's vehicle; its body at all instants is track 0 afterwards.
static const verge_vehicle_plan* fall_back(scene* w)
{
    vg_workspace_begin(w->workspaces[0], &w->jobs[0], &w->tracks);
    vg_vehicle_fall_back(w->workspaces[0], &w->jobs[0], &w->tracks, &w->plans[0],
                         VERGE_REASON_COLLISION);
    w->tracks.of[0] = w->workspaces[0]->body;
    assert_int_equal(w->plans[0].reason, VERGE_REASON_COLLISION);
    assert_int_equal(w->plans[0].point_count, w->def.points);
    return &w->plans[0];
}

static void check_drivable(const scene* w)
{
    char text[160] = "";
    const verge_body body = verge_vehicle_body(&w->vehicles[0]);
    const char* fault = strict_motion_fault(&w->plans[0], &body, w->def.point_s, text);
    if (fault != NULL) {
        fail_msg("%s: %s", fault, text);
    }
}

static const verge_point* last_of(const scene* w)
{
    return &w->plans[0].points[w->def.points - 1];
}

static bool touches(const scene* w, uint32_t other)
{
    return strict_contact(&w->tracks.of[0], &w->tracks.of[other], w->def.points, w->def.point_s,
                          0.0) < 1e9;
}

/// Distance from v to rest: brakes build up to BRAKING_MAX at JERK_MAX, and are released so. [m]
static double braking_distance(double v)
{
    return v * v / (2.0 * BRAKING_MAX) + 0.5 * v * BRAKING_MAX / JERK_MAX;
}

static void test_alone_a_vehicle_goes_on_at_its_speed(void** state)
{
    (void)state;
    for (double v = 1.0; v <= 24.0; v += 1.0) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        assert_int_equal(fall_back(w)->status, VERGE_FALLBACK_KEEP_LANE);
        for (uint32_t k = 0; k < w->def.points; ++k) {
            CHECK_NEAR(w->plans[0].points[k].speed, v, 1e-9);
            CHECK_NEAR(w->plans[0].points[k].y, SCENE_WIDTH, 1e-6);
        }
        scene_free(w);
    }
}

/// A vehicle on a straight road, other bodies around it that it does not overlap.
static scene* random_scene(test_rng* rng)
{
    scene* w = scene_make(0.0, 0.0);
    const double v = test_rng_between(rng, 0.0, 25.0), off = test_rng_between(rng, -0.8, 0.8);
    const double slant = v > 3.0 ? test_rng_between(rng, -0.03, 0.03) : 0.0;
    const double a = v > 1.0 ? test_rng_between(rng, -3.0, 2.0) : 0.0;
    scene_vehicle(w, 1, 30.0, off, slant, v, a, v);
    const uint32_t others = test_rng_below(rng, 6);
    for (uint32_t i = 0; i < others; ++i) {
        const double s = test_rng_between(rng, -20.0, 90.0), d = test_rng_between(rng, -1.0, 8.0);
        const double speed = test_rng_between(rng, 0.0, 20.0);
        if (fabs(s - 30.0) > 6.0 || fabs(d - SCENE_WIDTH) > 3.4) {
            scene_track(w, s, d, speed, 0.0);
        }
    }
    return w;
}

/// Is a body behind the vehicle or beside its lane, which braking does not avoid?
static bool threatened(const scene* w)
{
    bool threat = false;
    for (uint32_t j = 1; j < w->tracks.count; ++j) {
        threat |= w->tracks.of[j].x[0] < 30.0 || fabs(w->tracks.of[j].y[0] - SCENE_WIDTH) > 1.0;
    }
    return threat;
}

static void test_on_a_straight_road_a_fallback_is_drivable_and_never_faster(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("straight");
    uint32_t keeps = 0, brakes = 0, escapes = 0;
    for (uint32_t round = 0; round < test_rounds(400); ++round) {
        scene* w = random_scene(&rng);
        const verge_vehicle_plan* plan = fall_back(w);
        check_drivable(w);
        // An acceleration ends at the largest jerk: a^2 / (2 j) on top.
        const double a = fmax(0.0, w->vehicles[0].acceleration);
        const double top = w->vehicles[0].speed + a * a / (2.0 * JERK_MAX) + 0.01;
        const bool escape = last_of(w)->speed > top; // it drives out of the way of a body
        for (uint32_t k = 1; k < w->def.points; ++k) {
            CHECK_AT_MOST(plan->points[k].speed, escape ? 25.0 : top);
            CHECK_BETWEEN(plan->points[k].acceleration,
                          -fmax(BRAKING_MAX, -w->vehicles[0].acceleration), fmax(3.0, a));
        }
        assert_true(!escape || threatened(w));
        for (uint32_t j = 1; j < w->tracks.count; ++j) {
            assert_true(!escape || !touches(w, j));
        }
        keeps += plan->status == VERGE_FALLBACK_KEEP_LANE;
        brakes += plan->status == VERGE_FALLBACK_BRAKE;
        escapes += escape;
        scene_free(w);
    }
    assert_true(!test_rounds_suffice() || (keeps > 0 && brakes > 0 && escapes > 0));
}

// Braking straight ahead, the last rung, leaves it where the vehicle is turned away from the lane.
static void test_on_a_straight_road_a_fallback_stays_in_its_lane_or_goes_straight_on(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lane");
    for (uint32_t round = 0; round < test_rounds(400); ++round) {
        scene* w = random_scene(&rng);
        fall_back(w);
        const verge_vehicle* v = &w->vehicles[0];
        for (uint32_t k = 0; k < w->def.points; ++k) {
            const verge_point* at = &w->plans[0].points[k];
            const double straight = v->y - SCENE_WIDTH + tan(v->heading) * (at->x - v->x);
            CHECK_AT_MOST(fabs(at->y - SCENE_WIDTH),
                          fmax(0.5 * SCENE_WIDTH, fabs(straight) + 0.01));
        }
        scene_free(w);
    }
}

static void test_a_fallback_that_only_slows_down_meets_no_vehicle_ahead(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("clear");
    uint32_t met = 0;
    for (uint32_t round = 0; round < test_rounds(400); ++round) {
        scene* w = random_scene(&rng);
        const bool keeps = fall_back(w)->status == VERGE_FALLBACK_KEEP_LANE;
        // Braking may be worse with a vehicle behind, or with a contact from the side.
        bool other = false, touched = false;
        for (uint32_t j = 1; j < w->tracks.count; ++j) {
            const double beside = fabs(w->tracks.of[j].y[0] - SCENE_WIDTH);
            other |= w->tracks.of[j].x[0] < 30.0 || (beside > 1.0 && beside < 3.0);
            touched |= touches(w, j);
        }
        assert_true(other || !keeps || !touched);
        met += !other && keeps && w->tracks.count > 1;
        scene_free(w);
    }
    assert_true(!test_rounds_suffice() || met > 0);
}

static void test_it_stops_behind_a_standing_body_wherever_brakes_can(void** state)
{
    (void)state;
    for (double v = 1.0; v <= 19.0; v += 0.5) { // from 19 m/s on the horizon ends before the stop
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_track(w, 30.0 + 5.0 + braking_distance(v) + 0.1 + 0.06 * v, SCENE_WIDTH, 0.0, 0.0);
        fall_back(w);
        check_drivable(w);
        assert_false(touches(w, 1));
        scene_free(w);
    }
}

static void test_more_distance_means_a_gentler_fallback(void** state)
{
    (void)state;
    double hardest_before = 100.0;
    bool kept = false;
    for (double room = 14.0; room <= 80.0; room += 2.0) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, 12.0, 0.0, 12.0);
        scene_track(w, 30.0 + 5.0 + room, SCENE_WIDTH, 0.0, 0.0);
        const verge_vehicle_plan* plan = fall_back(w);
        double hardest = 0.0;
        for (uint32_t k = 0; k < w->def.points; ++k) {
            hardest = fmax(hardest, -plan->points[k].acceleration);
        }
        CHECK_AT_MOST(hardest, hardest_before + 1e-6);
        assert_true(!kept || plan->status == VERGE_FALLBACK_KEEP_LANE);
        kept = plan->status == VERGE_FALLBACK_KEEP_LANE;
        hardest_before = hardest;
        scene_free(w);
    }
    assert_true(kept);
    CHECK_NEAR(hardest_before, 0.0, 1e-9); // 80 m: beyond the horizon
}

static void test_before_an_unavoidable_contact_a_vehicle_brakes_as_hard_as_it_can(void** state)
{
    (void)state;
    for (double v = 10.0; v <= 24.0; v += 2.0) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_track(w, 30.0 + 5.0 + 0.85 * braking_distance(v), SCENE_WIDTH, 0.0, 0.0);
        const verge_vehicle_plan* plan = fall_back(w);
        assert_int_equal(plan->status, VERGE_FALLBACK_BRAKE);
        check_drivable(w);
        double hardest = 0.0;
        for (uint32_t k = 0; k < w->def.points; ++k) {
            hardest = fmax(hardest, -plan->points[k].acceleration);
        }
        CHECK_NEAR(hardest, BRAKING_MAX, 1e-6);
        scene_free(w);
    }
}

static void test_off_the_road_it_brakes_at_once_and_straight_ahead(void** state)
{
    (void)state;
    for (double slant = -0.5; slant <= 0.5; slant += 0.1) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, slant, 10.0, 0.0, 10.0)->on_road = false;
        assert_int_equal(fall_back(w)->status, VERGE_FALLBACK_BRAKE);
        check_drivable(w);
        const verge_point* start = &w->plans[0].points[0];
        for (uint32_t k = 1; k < w->def.points; ++k) {
            const verge_point* p = &w->plans[0].points[k];
            const double x = p->x - start->x, y = p->y - start->y;
            CHECK_NEAR(y * cos(slant) - x * sin(slant), 0.0, 1e-6);
            CHECK_NEAR(p->heading, slant, 1e-6);
        }
        CHECK_AT_MOST(last_of(w)->speed, 10.0 - 3.0 * 2.0);
        scene_free(w);
    }
}

static void test_at_rest_it_stays_at_rest_behind_another_body(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.3, 0.0, 0.0, 0.0, 0.0);
    scene_track(w, 35.5, SCENE_WIDTH, 0.0, 0.0);
    fall_back(w);
    CHECK_SAME_BITS(last_of(w)->speed, 0.0);
    CHECK_NEAR(last_of(w)->x, 30.0, 1e-9);
    scene_free(w);
}

static void test_a_lane_that_ends_is_not_left_over_its_end(void** state)
{
    (void)state;
    for (double v = 2.0; v <= 10.0; v += 1.0) {
        scene* w = scene_make(0.0, 80.0);
        assert_true(w->road->lanes[0].dead_end);
        scene_vehicle(w, 0, 80.0 - 2.5 - braking_distance(v) - 0.3 - 0.1 * v, 0.0, 0.0, v, 0.0, v);
        fall_back(w);
        check_drivable(w);
        CHECK_AT_MOST(last_of(w)->x + 2.5, 80.0);
        scene_free(w);
    }
}

/// A scene with the vehicle at point k of its last plan, which `w` has just made.
static scene* later(const scene* w, uint32_t k)
{
    const verge_point* p = &w->plans[0].points[k];
    scene* now = scene_make(w->curvature, 0.0);
    const verge_lane_position at =
        verge_road_project(now->road, p->x, p->y, p->heading, VERGE_NO_LANE);
    vg_job* job = scene_vehicle(now, (uint32_t)at.lane_id, 30.0, 0.0, 0.0, p->speed,
                                p->acceleration, p->speed);
    verge_vehicle* v = &now->vehicles[0];
    v->x = p->x;
    v->y = p->y;
    v->heading = p->heading;
    v->yaw_rate = p->curvature * p->speed;
    job->s = at.s;
    job->d = at.d;
    job->curvature = p->curvature;
    job->before = &w->plans[0];
    job->before_age = w->def.point_s * k;
    return now;
}

/// A scene with a plan on an empty road: it changes its speed, and in half of the cases its lane.
static scene* planned_scene(test_rng* rng)
{
    for (;;) {
        scene* w = scene_make(test_rng_between(rng, -0.02, 0.02), 0.0);
        const double v = test_rng_between(rng, 3.0, 14.0);
        const double goal = fmax(v + test_rng_between(rng, -5.0, 3.0), 1.0);
        vg_job* job = scene_vehicle(w, 1, 30.0, test_rng_between(rng, -0.5, 0.5),
                                    test_rng_between(rng, -0.02, 0.02), v, 0.0, goal);
        if (test_rng_below(rng, 2) == 0) {
            job->segments[0].action = VERGE_CHANGE_LEFT;
            job->segments[0].lane = 2;
            job->change_lane = 2;
        }
        scene_run(w);
        if (w->plans[0].status == VERGE_PLANNED) {
            return w;
        }
        scene_free(w);
    }
}

static void test_it_goes_on_with_the_last_plan_and_stops_after_its_end(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("goes on");
    uint32_t changed = 0, resumed = 0;
    const uint32_t rounds = test_rounds(200);
    for (uint32_t round = 0; round < rounds; ++round) {
        scene* w = planned_scene(&rng);
        const uint32_t k = 1 + test_rng_below(&rng, 14), end = w->def.points - 1;
        scene* now = later(w, k);
        const verge_vehicle_plan *last = &w->plans[0], *plan = fall_back(now);
        check_drivable(now);
        assert_int_equal(plan->status, VERGE_FALLBACK_KEEP_LANE);
        const bool resumes = now->workspaces[0]->resumes; // else it is too near to the limits
        resumed += resumes;
        const double v = last->points[k].speed, a = fmax(last->points[k].acceleration, 0.0);
        bool faster = false; // the last plan, but never the fallback
        for (uint32_t i = 0; i <= end; ++i) {
            faster |= i >= k && last->points[i].speed > v + 0.01;
            CHECK_AT_MOST(plan->points[i].speed, v + a * a / (2.0 * JERK_MAX) + 0.01);
        }
        for (uint32_t i = 0; resumes && !faster && i + k <= end; ++i) {
            const verge_point *p = &plan->points[i], *was = &last->points[i + k];
            CHECK_AT_MOST(hypot(p->x - was->x, p->y - was->y), 0.05);
            CHECK_NEAR(p->heading, was->heading, 0.01);
            CHECK_NEAR(p->speed, was->speed, 0.1);
        }
        if (resumes) {
            CHECK_AT_MOST(plan->points[end].speed, last->points[end].speed + 0.1);
            assert_true(plan->points[end].acceleration < 0.0 || plan->points[end].speed < 0.3);
        }
        changed += resumes && w->jobs[0].change_lane == 2;
        scene_free(now);
        scene_free(w);
    }
    printf("             %u of %u gone on with, %u of these change lane\n", resumed, rounds,
           changed);
    assert_true(!test_rounds_suffice() || (10 * resumed >= 9 * rounds && changed > 0));
}

static void test_a_last_plan_that_would_meet_a_body_now_is_given_up(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("given up");
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        scene* w = scene_make(0.0, 0.0);
        const double v = test_rng_between(&rng, 5.0, 15.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        scene* now = later(w, 5);
        const double x = now->vehicles[0].x;
        scene_track(now, x + 5.0 + braking_distance(v) + 0.5 + 0.06 * v, SCENE_WIDTH, 0.0, 0.0);
        assert_int_equal(fall_back(now)->status, VERGE_FALLBACK_BRAKE);
        check_drivable(now);
        assert_false(touches(now, 1) || now->workspaces[0]->resumes);
        scene_free(now);
        scene_free(w);
    }
}

static void test_a_last_plan_that_is_not_followed_is_given_up(void** state)
{
    (void)state;
    enum { ITS_OWN, NONE, OTHER_VEHICLE, OVER, FUTURE, BRAKED, BESIDE, AHEAD, FASTER, NO_NUMBER,
           SHORTER, CASES };
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 12.0, 0.0, 7.0);
    scene_run(w);
    assert_int_equal(w->plans[0].status, VERGE_PLANNED);
    for (int k = 0; k < CASES; ++k) {
        scene* now = later(w, 5);
        verge_vehicle_plan last = w->plans[0];
        verge_vehicle* v = &now->vehicles[0];
        now->jobs[0].before = k == NONE ? NULL : &last;
        last.vehicle_id += k == OTHER_VEHICLE;
        last.status = k == BRAKED ? VERGE_FALLBACK_BRAKE : VERGE_PLANNED;
        last.points[7].y = k == NO_NUMBER ? NAN : last.points[7].y;
        last.point_count -= k == SHORTER;
        now->jobs[0].before_age = k == OVER ? 3.0 : k == FUTURE ? -0.1 : 0.5;
        v->y += k == BESIDE ? 0.35 : 0.0;
        v->x += k == AHEAD ? 1.5 : 0.0;
        now->jobs[0].s += k == AHEAD ? 1.5 : 0.0;
        v->speed += k == FASTER ? 1.5 : 0.0;
        fall_back(now);
        check_drivable(now);
        assert_int_equal(now->workspaces[0]->resumes, k == ITS_OWN);
        assert_true((last_of(now)->speed < v->speed - 2.0) == (k == ITS_OWN)); // else it keeps it
        scene_free(now);
    }
    scene_free(w);
}

static void test_whatever_the_last_plan_says_a_fallback_is_drivable(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("whatever");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        scene* w = planned_scene(&rng);
        scene* now = later(w, 5);
        const double size = pow(10.0, test_rng_between(&rng, -2.0, 8.0));
        const uint32_t first = test_rng_below(&rng, w->def.points);
        for (uint32_t k = first; k < w->def.points; ++k) {
            verge_point* p = &w->plans[0].points[k];
            p->x += size * test_rng_between(&rng, -1.0, 1.0);
            p->y += size * test_rng_between(&rng, -1.0, 1.0);
            p->heading += fmin(size, 3.0) * test_rng_between(&rng, -1.0, 1.0);
            p->speed = fmax(p->speed + size * test_rng_between(&rng, -1.0, 1.0), 0.0);
            p->curvature += size * test_rng_between(&rng, -1.0, 1.0);
        }
        fall_back(now);
        check_drivable(now);
        scene_free(now);
        scene_free(w);
    }
}

static void test_a_body_in_front_that_it_overlaps_goes_before_the_last_plan(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 30.0, 0.0, 0.0, 5.0, 0.0, 5.0);
    scene_run(w);
    scene* now = later(w, 5);
    scene_track(now, now->vehicles[0].x + 4.9, SCENE_WIDTH, 0.0, 0.0);
    fall_back(now);
    assert_false(now->workspaces[0]->resumes);
    CHECK_AT_MOST(last_of(now)->speed, 0.01);
    scene_free(now);
    scene_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_alone_a_vehicle_goes_on_at_its_speed),
        cmocka_unit_test(test_on_a_straight_road_a_fallback_is_drivable_and_never_faster),
        cmocka_unit_test(test_on_a_straight_road_a_fallback_stays_in_its_lane_or_goes_straight_on),
        cmocka_unit_test(test_a_fallback_that_only_slows_down_meets_no_vehicle_ahead),
        cmocka_unit_test(test_it_stops_behind_a_standing_body_wherever_brakes_can),
        cmocka_unit_test(test_more_distance_means_a_gentler_fallback),
        cmocka_unit_test(test_before_an_unavoidable_contact_a_vehicle_brakes_as_hard_as_it_can),
        cmocka_unit_test(test_off_the_road_it_brakes_at_once_and_straight_ahead),
        cmocka_unit_test(test_at_rest_it_stays_at_rest_behind_another_body),
        cmocka_unit_test(test_a_lane_that_ends_is_not_left_over_its_end),
        cmocka_unit_test(test_it_goes_on_with_the_last_plan_and_stops_after_its_end),
        cmocka_unit_test(test_a_last_plan_that_would_meet_a_body_now_is_given_up),
        cmocka_unit_test(test_a_last_plan_that_is_not_followed_is_given_up),
        cmocka_unit_test(test_whatever_the_last_plan_says_a_fallback_is_drivable),
        cmocka_unit_test(test_a_body_in_front_that_it_overlaps_goes_before_the_last_plan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
