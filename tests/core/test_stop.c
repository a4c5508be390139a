/// Goal: a stopping continuation slows down along the way that is driven, whatever its bends.
/// Method: random starts on circles of many radii to both sides, far from the line; the speed of
/// the centre, its acceleration and its jerk at every step; the distance between positions.
#include "check.h"
#include "motion/stop.h"
#include "rng.h"
#include "room.h"
#include "scene.h"

TEST_PATH(path);
TEST_PATH(straight);

static const double H = 0.01; // [s]

typedef struct random_start {
    vg_state  state;
    vg_motion rear;
    double    speed, acceleration; // of the centre
} random_start;

/// A start on the middle lane of a circle, turned against it a little.
static random_start start_on(test_rng* rng, double curvature)
{
    random_start start;
    const vg_reference at = vg_path_at(&path, 5.0);
    const double d = test_rng_between(rng, -1.5, 1.5), bend = curvature / (1.0 - curvature * d);
    start.rear.x = at.x - d * at.sin_heading;
    start.rear.y = at.y + d * at.cos_heading;
    start.rear.heading = atan2(at.sin_heading, at.cos_heading) + test_rng_between(rng, -0.1, 0.1);
    start.rear.speed = test_rng_between(rng, 0.0, fmin(25.0, sqrt(8.0 / fabs(bend))));
    start.rear.curvature = bend;
    start.rear.acceleration = start.rear.speed > 1.0 ? test_rng_between(rng, -3.0, 2.0) : 0.0;
    start.state = vg_state_of(&path, &start.rear, 5.0);
    assert_true(start.state.valid);
    const double ratio = sqrt(1.0 + vg_square(scene_car()->rear_axle * bend));
    start.speed = start.rear.speed * ratio;
    start.acceleration = start.rear.acceleration * ratio;
    return start;
}

static void centre_of(const vg_rear* rear, double out[2])
{
    out[0] = rear->x + scene_car()->rear_axle * rear->cos_heading;
    out[1] = rear->y + scene_car()->rear_axle * rear->sin_heading;
}

/// Drives to the end of the horizon; true: always within the limits of the body.
static bool check_drive(vg_stop* stop, double level, double jerk)
{
    const double v0 = stop->speed, a0 = stop->acceleration;
    const double top = v0 + vg_square(fmax(a0, 0.0)) / (2.0 * VG_JERK_MAX) + VG_JERK_MAX * H * H;
    bool holds = true;
    for (double t = 0.0; t < 12.0; t += H) {
        const vg_rear before = vg_stop_at(stop);
        const double v = stop->speed, a = stop->acceleration;
        vg_stop_advance(stop, H);
        const vg_rear after = vg_stop_at(stop);
        double from[2], to[2];
        centre_of(&before, from);
        centre_of(&after, to);
        CHECK_NEAR(hypot(to[0] - from[0], to[1] - from[1]), 0.5 * (v + stop->speed) * H, 2e-5);
        CHECK_BETWEEN(stop->speed, 0.0, top);
        CHECK_BETWEEN(stop->acceleration, -fmax(level, -a0), fmax(a0, 0.0));
        const double change = fabs(stop->acceleration - a);
        assert_true(stop->speed == 0.0 || change <= (a > 0.0 ? VG_JERK_MAX : jerk) * H + 1e-9);
        const vg_motion rear = vg_motion_of(&after);
        const vg_motion centre =
            vg_motion_of_centre(&rear, after.curvature_t, scene_car()->rear_axle);
        CHECK_NEAR(centre.speed, stop->speed, 1e-9);
        CHECK_NEAR(centre.acceleration, stop->acceleration, 1e-9);
        holds = holds && vg_hard_ratio(scene_car(), &after, after.speed) <= 1.0;
    }
    return holds;
}

static void braking_in_a_lane_never_speeds_up_and_ends_at_rest(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("in lane");
    uint32_t held = 0;
    const uint32_t rounds = test_rounds(200);
    for (uint32_t round = 0; round < rounds; ++round) {
        const double side = round % 2 == 0 ? 1.0 : -1.0;
        const double curvature = side / test_rng_between(&rng, 20.0, 120.0);
        scene* w = scene_make(curvature, 0.0);
        vg_path_build(&path, w->road, 1, -1, -30.0, fmin(w->road->lanes[1].length, 300.0));
        const double bend = curvature / (1.0 - curvature * SCENE_WIDTH);
        const random_start start = start_on(&rng, bend);
        const double level = test_rng_between(&rng, 3.0, 8.0);
        const double jerk = test_rng_between(&rng, 4.0, 12.0);
        vg_leg leg;
        vg_stop_in_lane(&leg, &path, scene_car(), &start.state, 0.0);
        vg_stop stop = vg_stop_from(&leg, 0.0, start.speed, start.acceleration, level, jerk);
        held += check_drive(&stop, level, jerk);
        CHECK_SAME_BITS(stop.speed, 0.0);
        scene_free(w);
    }
    assert_true(held > rounds / 2);
}

static void straight_ahead_a_vehicle_always_keeps_to_its_limits(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("straight");
    for (uint32_t round = 0; round < test_rounds(1000); ++round) {
        vg_motion rear = { .heading = test_rng_between(&rng, -3.0, 3.0) };
        rear.speed = test_rng_between(&rng, 0.0, 40.0);
        const double grip = 9.0 / vg_square(fmax(rear.speed, 1.0));
        const double most = fmin(scene_car()->curvature_max, grip);
        rear.curvature = test_rng_between(&rng, -most, most);
        rear.acceleration = rear.speed > 1.0 ? test_rng_between(&rng, -4.0, 2.0) : 0.0;
        vg_leg leg;
        vg_stop_straight(&leg, &straight, scene_car(), &rear);
        vg_stop stop = vg_stop_from(&leg, 0.0, rear.speed, rear.acceleration, 8.0, VG_JERK_MAX);
        assert_true(check_drive(&stop, 8.0, VG_JERK_MAX));
        CHECK_SAME_BITS(stop.speed, 0.0);
        // It turns on a little while the wheel turns back, and ends straight.
        const vg_rear end = vg_stop_at(&stop);
        assert_true(rear.speed < 15.0 || fabs(end.curvature) < 1e-6);
    }
}

static void an_acceleration_ends_at_the_speed_allowed(void** state)
{
    (void)state;
    vg_motion rear = { .speed = 5.0 };
    vg_leg leg;
    vg_stop_straight(&leg, &straight, scene_car(), &rear);
    vg_stop stop = vg_stop_from(&leg, 0.0, 5.0, 0.0, -3.0, 4.0);
    stop.speed_max = 8.0;
    for (double t = 0.0; t < 5.0; t += H) {
        vg_stop_advance(&stop, H);
        CHECK_BETWEEN(stop.acceleration, -1e-9, 3.0);
        CHECK_AT_MOST(stop.speed, 8.0 + 1e-6);
    }
    CHECK_NEAR(stop.speed, 8.0, 0.01);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(braking_in_a_lane_never_speeds_up_and_ends_at_rest),
        cmocka_unit_test(straight_ahead_a_vehicle_always_keeps_to_its_limits),
        cmocka_unit_test(an_acceleration_ends_at_the_speed_allowed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
