/// Goal: our sine, cosine, arctangent and logarithm are as good as the machine's own.
/// Method: the C library's functions (within 0.55 ulp of the true value) as oracle.
#include "check.h"
#include "rng.h"
#include "base/scalar.h"

#include <math.h>

/// Allowed: 2 ulp of ours and the oracle's own error, or 2e-16.
static void check_close(double actual, double expected, double argument)
{
    int exponent;
    (void)frexp(expected, &exponent);
    const double ulp = ldexp(1.0, exponent - 53);
    const double error = fabs(actual - expected);
    if (!(error <= 2.6 * ulp || error <= 2e-16)) {
        fail_msg("f(%.17g) = %.17g, expected %.17g, %.2f ulp", argument, actual, expected,
                 error / ulp);
    }
}

static void test_sine_and_cosine_are_those_of_the_library(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sincos");
    const uint32_t rounds = test_rounds(200000);
    for (uint32_t i = 0; i < rounds; ++i) {
        const double reach = i % 2 == 0 ? 10.0 : 1e6;
        double x = test_rng_between(&rng, -reach, reach);
        if (i % 5 == 0) { // next to a multiple of pi/2, where digits cancel
            x = (double)(int)(x / 1.5707963267948966) * 1.5707963267948966;
        }
        double sine, cosine;
        vg_sincos(x, &sine, &cosine);
        check_close(sine, sin(x), x);
        check_close(cosine, cos(x), x);
        CHECK_SAME_BITS(vg_sin(x), sine);
        CHECK_SAME_BITS(vg_cos(x), cosine);
    }
}

static void test_arctangent_is_that_of_the_library_in_all_quadrants(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("atan2");
    const uint32_t rounds = test_rounds(200000);
    for (uint32_t i = 0; i < rounds; ++i) {
        const double y = test_rng_between(&rng, -1.0, 1.0)
                         * exp(test_rng_between(&rng, -30.0, 30.0));
        const double x = test_rng_between(&rng, -1.0, 1.0);
        const double expected = atan2(y, x);
        check_close(vg_atan2(y, x), expected == -VG_PI ? VG_PI : expected, y / x);
    }
    for (int k = 0; k <= 8; ++k) { // the points the reduction is anchored at, and between
        check_close(vg_atan2(k / 8.0, 1.0), atan2(k / 8.0, 1.0), k / 8.0);
        check_close(vg_atan2((k + 0.5) / 8.0, 1.0), atan2((k + 0.5) / 8.0, 1.0), k / 8.0);
    }
}

static void test_arctangent_of_axes_and_nothing(void** state)
{
    (void)state;
    CHECK_SAME_BITS(vg_atan2(0.0, 0.0), 0.0);
    CHECK_SAME_BITS(vg_atan2(0.0, 2.0), 0.0);
    CHECK_SAME_BITS(vg_atan2(-0.0, -2.0), VG_PI); // in (-pi, pi], whatever the zero's sign
    CHECK_SAME_BITS(vg_atan2(3.0, 0.0), 0.5 * VG_PI);
    CHECK_SAME_BITS(vg_atan2(-3.0, 0.0), -0.5 * VG_PI);
    CHECK_SAME_BITS(vg_atan2(-1e-300, -1.0), VG_PI);
}

static void test_logarithm_is_that_of_the_library(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("log");
    const uint32_t rounds = test_rounds(200000);
    for (uint32_t i = 0; i < rounds; ++i) {
        const double reach = i % 2 == 0 ? 1.0 : 700.0;
        const double x = exp(test_rng_between(&rng, -reach, reach));
        check_close(vg_log(x), log(x), x);
    }
    CHECK_SAME_BITS(vg_log(1.0), 0.0);
    check_close(vg_log(4.9e-324), log(4.9e-324), 4.9e-324); // the smallest there is
    for (uint32_t n = 1; n < 4096; ++n) {                   // visit counts of the search
        check_close(vg_log((double)n), log((double)n), (double)n);
    }
}

static void test_wrapped_angles_lie_in_the_half_open_turn(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("wrap");
    const uint32_t rounds = test_rounds(50000);
    for (uint32_t i = 0; i < rounds; ++i) {
        const double x = test_rng_between(&rng, -1e3, 1e3);
        const double wrapped = vg_wrap_angle(x);
        assert_true(wrapped > -VG_PI && wrapped <= VG_PI);
        CHECK_NEAR(sin(wrapped), sin(x), 1e-12);
        CHECK_NEAR(cos(wrapped), cos(x), 1e-12);
    }
    const double vast[] = { 1e6 + 1.0, -3e7, 1e15, -1e100, 1.7976931348623157e308 };
    for (uint32_t i = 0; i < sizeof vast / sizeof vast[0]; ++i) {
        const double wrapped = vg_wrap_angle(vast[i]);
        assert_true(wrapped > -VG_PI && wrapped <= VG_PI);
        if (fabs(vast[i]) < 1e8) { // beyond, the digits of pi after a double's decide
            CHECK_NEAR(sin(wrapped), sin(vast[i]), 1e-8);
        }
    }
    CHECK_SAME_BITS(vg_wrap_angle(VG_PI), VG_PI);
    CHECK_SAME_BITS(vg_wrap_angle(-VG_PI), VG_PI);
    CHECK_SAME_BITS(vg_wrap_angle(3.0 * VG_PI), VG_PI);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sine_and_cosine_are_those_of_the_library),
        cmocka_unit_test(test_arctangent_is_that_of_the_library_in_all_quadrants),
        cmocka_unit_test(test_arctangent_of_axes_and_nothing),
        cmocka_unit_test(test_logarithm_is_that_of_the_library),
        cmocka_unit_test(test_wrapped_angles_lie_in_the_half_open_turn),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
