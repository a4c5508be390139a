/// Goal: the quintic meets both of its end states, and is the smoothest curve that does.
/// Method: closed cases; end conditions over random states; jerk of disturbed curves as oracle.
#include "check.h"
#include "geometry/quintic.h"
#include "rng.h"

#include <math.h>

static vg_axis_state random_state(test_rng* rng)
{
    return (vg_axis_state){ .position = test_rng_between(rng, -100.0, 100.0),
                            .velocity = test_rng_between(rng, -30.0, 30.0),
                            .acceleration = test_rng_between(rng, -8.0, 8.0) };
}

static void test_rest_to_rest_is_symmetric(void** state)
{
    (void)state;
    const vg_axis_state start = { .position = 0.0 };
    const vg_axis_state end = { .position = 3.5 }; // one lane width

    const vg_quintic q = vg_quintic_between(start, end, 4.0);

    CHECK_NEAR(vg_quintic_at(&q, 2.0).position, 1.75, 1e-12);
    CHECK_NEAR(vg_quintic_at(&q, 2.0).velocity, 1.875 * 3.5 / 4.0, 1e-12);
    CHECK_NEAR(vg_quintic_at(&q, 2.0).acceleration, 0.0, 1e-12);
    CHECK_NEAR(vg_quintic_at(&q, 1.0).position + vg_quintic_at(&q, 3.0).position, 3.5, 1e-12);
}

static void test_both_end_states_are_met(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("quintic ends");
    for (uint32_t i = 0; i < test_rounds(20000); ++i) {
        const vg_axis_state start = random_state(&rng), end = random_state(&rng);
        const double t = test_rng_between(&rng, 0.3, 10.0);
        const vg_quintic q = vg_quintic_between(start, end, t);
        const vg_axis_sample a = vg_quintic_at(&q, 0.0), b = vg_quintic_at(&q, t);
        CHECK_SAME_BITS(a.position, start.position);
        CHECK_SAME_BITS(a.velocity, start.velocity);
        CHECK_NEAR(a.acceleration, start.acceleration, 1e-12);
        CHECK_NEAR(b.position, end.position, 1e-9);
        CHECK_NEAR(b.velocity, end.velocity, 1e-8);
        CHECK_NEAR(b.acceleration, end.acceleration, 1e-7);
    }
}

static void test_each_field_is_the_derivative_of_the_one_before(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("quintic derivatives");
    const double e = 1e-4;
    for (uint32_t i = 0; i < test_rounds(5000); ++i) {
        const vg_quintic q = vg_quintic_between(random_state(&rng), random_state(&rng),
                                                test_rng_between(&rng, 2.0, 6.0));
        const double t = test_rng_between(&rng, 0.0, 2.0);
        const vg_axis_sample a = vg_quintic_at(&q, t - e), b = vg_quintic_at(&q, t + e);
        const vg_axis_sample at = vg_quintic_at(&q, t);
        CHECK_NEAR(at.velocity, (b.position - a.position) / (2.0 * e), 1e-4);
        CHECK_NEAR(at.acceleration, (b.velocity - a.velocity) / (2.0 * e), 1e-4);
        CHECK_NEAR(at.jerk, (b.acceleration - a.acceleration) / (2.0 * e), 1e-4);
    }
}

static double squared_jerk(const vg_quintic* q, double t, double bump)
{
    // bump * t^3 (T - t)^3 disturbs the curve without touching its end states.
    double sum = 0.0;
    for (int i = 0; i < 2000; ++i) {
        const double x = t * (i + 0.5) / 2000.0;
        const double r = t - x;
        const double extra = 6.0 * (r * r * r - 9.0 * x * r * r + 9.0 * x * x * r - x * x * x);
        const double jerk = vg_quintic_at(q, x).jerk + bump * extra;
        sum += jerk * jerk * t / 2000.0;
    }
    return sum;
}

static void test_any_disturbance_adds_jerk(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("quintic optimality");
    for (uint32_t i = 0; i < test_rounds(200); ++i) {
        const double t = test_rng_between(&rng, 1.0, 4.0);
        const vg_quintic q = vg_quintic_between(random_state(&rng), random_state(&rng), t);
        const double bump = test_rng_between(&rng, 0.5, 2.0);
        assert_true(squared_jerk(&q, t, bump) > squared_jerk(&q, t, 0.0));
        assert_true(squared_jerk(&q, t, -bump) > squared_jerk(&q, t, 0.0));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rest_to_rest_is_symmetric),
        cmocka_unit_test(test_both_end_states_are_met),
        cmocka_unit_test(test_each_field_is_the_derivative_of_the_one_before),
        cmocka_unit_test(test_any_disturbance_adds_jerk),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
