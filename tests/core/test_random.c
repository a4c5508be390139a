// PCG32 against its author's published sequence, and the bounded draw.
#include "check.h"

#include "base/random.h"

static void the_sequence_is_that_of_the_reference_implementation(void** state)
{
    (void)state;
    // O'Neill's pcg32-demo: seed 42, stream 54.
    static const uint32_t expected[] = { 0xa15c02b7u, 0x7b47f409u, 0xba1d3330u,
                                         0x83d2f293u, 0xbfa4784bu, 0xcbed606eu };
    vg_random random = vg_random_from(42, 54);
    for (uint32_t i = 0; i < sizeof expected / sizeof expected[0]; ++i) {
        assert_int_equal(vg_random_next(&random), expected[i]);
    }
}

static void a_bounded_draw_stays_below_its_bound_and_is_even(void** state)
{
    (void)state;
    for (uint32_t bound = 1; bound <= 32; ++bound) {
        vg_random random = vg_random_from(bound, 9);
        uint32_t counts[32] = { 0 };
        for (uint32_t i = 0; i < 3200; ++i) {
            const uint32_t drawn = vg_random_below(&random, bound);
            assert_true(drawn < bound);
            ++counts[drawn];
        }
        double sum = 0.0;
        for (uint32_t i = 0; i < bound; ++i) {
            const double expected = 3200.0 / bound;
            sum += (counts[i] - expected) * (counts[i] - expected) / expected;
        }
        CHECK_AT_MOST(sum, 75.0); // chi-square, 31 free at most: p < 1e-5
    }
}

static void streams_of_one_seed_and_seeds_of_one_stream_differ(void** state)
{
    (void)state;
    for (uint64_t k = 0; k < 200; ++k) {
        vg_random a = vg_random_from(1, k), b = vg_random_from(1, k + 1), c = vg_random_from(2, k);
        uint32_t same = 0;
        for (uint32_t i = 0; i < 64; ++i) {
            const uint32_t x = vg_random_next(&a);
            same += x == vg_random_next(&b);
            same += x == vg_random_next(&c);
        }
        assert_true(same <= 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_sequence_is_that_of_the_reference_implementation),
        cmocka_unit_test(a_bounded_draw_stays_below_its_bound_and_is_even),
        cmocka_unit_test(streams_of_one_seed_and_seeds_of_one_stream_differ),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
