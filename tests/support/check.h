/// What every test includes: cmocka with the headers it needs, and checks that show numbers.
///
/// A failed check prints the expression, what it was and what it should have been, with 17
/// significant digits, at the line of the check.
#ifndef TEST_CHECK_H
#define TEST_CHECK_H

// cmocka.h wants these four before it.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

/// |actual - expected| <= tolerance. A NaN on either side fails.
#define CHECK_NEAR(actual, expected, tolerance)                                                 \
    do {                                                                                        \
        const double check_a = (double)(actual);                                                \
        const double check_e = (double)(expected);                                              \
        const double check_t = (double)(tolerance);                                             \
        const double check_diff = check_a > check_e ? check_a - check_e : check_e - check_a;    \
        if (!(check_diff <= check_t)) {                                                         \
            fail_msg("%s = %.17g, expected %.17g within %g (differs by %g)", #actual, check_a,  \
                     check_e, check_t, check_diff);                                             \
        }                                                                                       \
    } while (0)

/// low <= actual <= high. A NaN fails.
#define CHECK_BETWEEN(actual, low, high)                                                        \
    do {                                                                                        \
        const double check_a = (double)(actual);                                                \
        const double check_l = (double)(low);                                                   \
        const double check_h = (double)(high);                                                  \
        if (!(check_l <= check_a && check_a <= check_h)) {                                      \
            fail_msg("%s = %.17g, expected within [%.17g, %.17g]", #actual, check_a, check_l,   \
                     check_h);                                                                  \
        }                                                                                       \
    } while (0)

/// actual <= bound. A NaN fails.
#define CHECK_AT_MOST(actual, bound)                                                            \
    do {                                                                                        \
        const double check_a = (double)(actual);                                                \
        const double check_b = (double)(bound);                                                 \
        if (!(check_a <= check_b)) {                                                            \
            fail_msg("%s = %.17g, expected at most %.17g", #actual, check_a, check_b);          \
        }                                                                                       \
    } while (0)

/// The two doubles are the same 64 bits: 0 and -0 differ, a NaN equals itself.
#define CHECK_SAME_BITS(actual, expected)                                                       \
    do {                                                                                        \
        const double check_a = (actual);                                                        \
        const double check_e = (expected);                                                      \
        if (memcmp(&check_a, &check_e, sizeof check_a) != 0) {                                  \
            fail_msg("%s = %.17g (%a), expected the same bits as %.17g (%a)", #actual, check_a, \
                     check_a, check_e, check_e);                                                \
        }                                                                                       \
    } while (0)

#endif
