/// Goal: the motion of axle and centre belong to one rigid body.
/// Method: the rigid body's velocity field as oracle; round trips.
#include "check.h"
#include "motion/kinematics.h"
#include "rng.h"
#include "base/scalar.h"

#include <math.h>

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
        const double a = test_rng_between(&rng, 0.0, 4.0); // from the axle to the centre
        const vg_motion c = vg_motion_of_centre(&rear, rate, a);
        double speed[2];
        for (int k = 0; k < 2; ++k) { // the body's velocity field a moment before and after
            const double t = k == 0 ? -e : e;
            const double v = rear.speed + t * rear.acceleration;
            speed[k] = hypot(v, (rear.curvature + t * rate) * v * a);
        }
        CHECK_NEAR(c.acceleration, (speed[1] - speed[0]) / (2.0 * e), 1e-5);
        CHECK_NEAR(c.speed * c.curvature, rear.speed * rear.curvature, 1e-9); // one yaw rate

        const vg_motion still = vg_motion_of_centre(&rear, 0.0, a);
        const vg_motion back = vg_motion_of_rear(&still, a);
        CHECK_NEAR(back.x, rear.x, 1e-9);
        CHECK_NEAR(back.speed, rear.speed, 1e-9);
        CHECK_NEAR(back.curvature, rear.curvature, 1e-9);
        CHECK_NEAR(back.acceleration, rear.acceleration, 1e-9);
    }
}

static void test_an_extreme_curvature_gives_finite_motion(void** state)
{
    (void)state;
    const vg_motion spin = { .speed = 0.01, .curvature = 500.0 };
    const vg_motion rear = vg_motion_of_rear(&spin, 1.4);
    assert_true(vg_finite(rear.speed) && vg_finite(rear.curvature));
    assert_true(rear.speed >= 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_centre_moves_as_the_rigid_body_says),
        cmocka_unit_test(test_an_extreme_curvature_gives_finite_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
