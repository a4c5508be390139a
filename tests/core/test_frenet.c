/// Goal: the closed forms between road and plane are exact, there and back.
/// Method: round trips; numeric derivatives of positions in the plane as oracle; a circle's own
/// formulas; the rigid body's velocity field for axle and centre.
#include "check.h"
#include "frenet.h"
#include "rng.h"
#include "scalar.h"

#include <math.h>

static vg_reference random_reference(test_rng* rng)
{
    const double heading = test_rng_between(rng, -3.1, 3.1);
    return (vg_reference){ .x = test_rng_between(rng, -500.0, 500.0),
                           .y = test_rng_between(rng, -500.0, 500.0),
                           .cos_heading = cos(heading), .sin_heading = sin(heading),
                           .curvature = test_rng_between(rng, -0.1, 0.1),
                           .curvature_rate = test_rng_between(rng, -0.01, 0.01) };
}

static void test_motion_survives_the_round_trip(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("frenet round trip");
    for (uint32_t i = 0; i < test_rounds(20000); ++i) {
        const vg_reference at = random_reference(&rng);
        const vg_frenet f = { .s = 12.0, .s_t = test_rng_between(&rng, 0.1, 30.0),
                              .s_tt = test_rng_between(&rng, -8.0, 8.0),
                              .d = test_rng_between(&rng, -5.0, 5.0),
                              .d_t = test_rng_between(&rng, -3.0, 3.0),
                              .d_tt = test_rng_between(&rng, -3.0, 3.0) };
        const vg_motion m = vg_motion_from_frenet(&at, &f, 0.0);
        const vg_frenet g = vg_frenet_from_motion(&at, f.s, &m);
        CHECK_NEAR(g.s_t, f.s_t, 1e-9);
        CHECK_NEAR(g.s_tt, f.s_tt, 1e-9);
        CHECK_NEAR(g.d, f.d, 1e-9);
        CHECK_NEAR(g.d_t, f.d_t, 1e-9);
        CHECK_NEAR(g.d_tt, f.d_tt, 1e-9);
    }
}

/// A line whose curvature is linear in s (a clothoid), integrated in small steps: knows nothing of
/// the formulas under test.
static vg_reference clothoid_at(double k0, double rate, double s)
{
    vg_reference at = { .curvature = k0 + rate * s, .curvature_rate = rate };
    const int steps = 400;
    const double h = s / steps;
    for (int i = 0; i < steps; ++i) { // Simpson's rule of (cos, sin) of the exact heading
        for (int k = 0; k < 3; ++k) {
            const double w = h * (i + 0.5 * k), weight = (k == 1 ? 4.0 : 1.0) / 6.0;
            const double heading = k0 * w + 0.5 * rate * w * w;
            at.x += h * weight * cos(heading);
            at.y += h * weight * sin(heading);
        }
    }
    at.cos_heading = cos(k0 * s + 0.5 * rate * s * s);
    at.sin_heading = sin(k0 * s + 0.5 * rate * s * s);
    return at;
}

static void test_motion_is_the_derivative_of_the_position(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("frenet derivatives");
    const double e = 1e-3;
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        const double k0 = test_rng_between(&rng, -0.08, 0.08);
        const double rate = test_rng_between(&rng, -0.005, 0.005);
        const vg_frenet f = { .s = 20.0, .s_t = test_rng_between(&rng, 2.0, 15.0),
                              .s_tt = test_rng_between(&rng, -4.0, 4.0),
                              .d = test_rng_between(&rng, -3.0, 3.0),
                              .d_t = test_rng_between(&rng, -2.0, 2.0),
                              .d_tt = test_rng_between(&rng, -2.0, 2.0) };
        double x[3], y[3];
        for (int i = 0; i < 3; ++i) {
            const double t = e * (i - 1);
            const vg_reference r = clothoid_at(k0, rate, f.s + t * (f.s_t + 0.5 * t * f.s_tt));
            const double d = f.d + t * (f.d_t + 0.5 * t * f.d_tt);
            x[i] = r.x - d * r.sin_heading;
            y[i] = r.y + d * r.cos_heading;
        }
        const double vx = (x[2] - x[0]) / (2.0 * e), vy = (y[2] - y[0]) / (2.0 * e);
        const double ax = (x[2] - 2.0 * x[1] + x[0]) / (e * e);
        const double ay = (y[2] - 2.0 * y[1] + y[0]) / (e * e);
        const double v = hypot(vx, vy);

        const vg_reference at = clothoid_at(k0, rate, f.s);
        const vg_motion m = vg_motion_from_frenet(&at, &f, 0.0);

        CHECK_NEAR(m.x, x[1], 1e-9);
        CHECK_NEAR(m.speed, v, 1e-4);
        CHECK_NEAR(remainder(m.heading - atan2(vy, vx), 2.0 * VG_PI), 0.0, 1e-5);
        CHECK_NEAR(m.acceleration, (vx * ax + vy * ay) / v, 1e-3);
        CHECK_NEAR(m.curvature, (vx * ay - vy * ax) / (v * v * v), 1e-3);
    }
}

static void test_on_a_circle_the_offset_changes_radius_and_speed(void** state)
{
    (void)state;
    const vg_reference at = { .cos_heading = 1.0, .curvature = 0.1 }; // radius 10, to the left
    const vg_frenet f = { .s_t = 5.0, .d = 2.0 };
    const vg_motion m = vg_motion_from_frenet(&at, &f, 0.0);
    CHECK_NEAR(m.speed, 4.0, 1e-12);
    CHECK_NEAR(m.curvature, 1.0 / 8.0, 1e-12);
    CHECK_NEAR(m.acceleration, 0.0, 1e-12);
}

static void test_standstill_keeps_its_heading_and_its_acceleration(void** state)
{
    (void)state;
    const vg_reference at = { .cos_heading = 1.0, .curvature = 0.05 };
    const vg_motion still = { .heading = 0.3, .acceleration = 1.5, .curvature = 0.4 };
    const vg_frenet f = vg_frenet_from_motion(&at, 0.0, &still);
    const vg_motion back = vg_motion_from_frenet(&at, &f, 0.3);
    CHECK_SAME_BITS(f.s_t, 0.0);
    CHECK_SAME_BITS(f.d_t, 0.0);
    CHECK_NEAR(f.d_tt, f.s_tt * tan(0.3), 1e-12);
    CHECK_SAME_BITS(back.heading, 0.3);
    CHECK_SAME_BITS(back.curvature, 0.0);
    CHECK_NEAR(back.acceleration, 1.5, 1e-12);
}

static void test_centre_moves_as_the_rigid_body_says(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("centre");
    const double e = 1e-5;
    for (uint32_t i = 0; i < test_rounds(5000); ++i) {
        const vg_motion rear = { .heading = test_rng_between(&rng, -3.0, 3.0),
                                 .speed = test_rng_between(&rng, 0.5, 20.0),
                                 .acceleration = test_rng_between(&rng, -5.0, 5.0),
                                 .curvature = test_rng_between(&rng, -0.5, 0.5) };
        const double rate = test_rng_between(&rng, -0.5, 0.5);
        const vg_motion c = vg_motion_of_centre(&rear, rate);
        const double a = VERGE_REAR_AXLE;
        double speed[2];
        for (int k = 0; k < 2; ++k) { // the body's velocity field a moment before and after
            const double t = k == 0 ? -e : e;
            const double v = rear.speed + t * rear.acceleration;
            speed[k] = hypot(v, (rear.curvature + t * rate) * v * a);
        }
        CHECK_NEAR(c.acceleration, (speed[1] - speed[0]) / (2.0 * e), 1e-5);
        CHECK_NEAR(c.speed * c.curvature, rear.speed * rear.curvature, 1e-9); // one yaw rate

        const vg_motion still = vg_motion_of_centre(&rear, 0.0);
        const vg_motion back = vg_motion_of_rear(&still);
        CHECK_NEAR(back.x, rear.x, 1e-9);
        CHECK_NEAR(back.speed, rear.speed, 1e-9);
        CHECK_NEAR(back.curvature, rear.curvature, 1e-9);
        CHECK_NEAR(back.acceleration, rear.acceleration, 1e-9);
    }
}

static void test_a_spinning_measurement_gives_no_nonsense(void** state)
{
    (void)state;
    const vg_motion spin = { .speed = 0.01, .curvature = 500.0 };
    const vg_motion rear = vg_motion_of_rear(&spin);
    assert_true(vg_finite(rear.speed) && vg_finite(rear.curvature));
    assert_true(rear.speed >= 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_motion_survives_the_round_trip),
        cmocka_unit_test(test_motion_is_the_derivative_of_the_position),
        cmocka_unit_test(test_on_a_circle_the_offset_changes_radius_and_speed),
        cmocka_unit_test(test_standstill_keeps_its_heading_and_its_acceleration),
        cmocka_unit_test(test_centre_moves_as_the_rigid_body_says),
        cmocka_unit_test(test_a_spinning_measurement_gives_no_nonsense),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
