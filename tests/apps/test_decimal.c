/// Goal: a number is written in the shortest form that reads back as the same number, whatever the
/// number and whatever the locale.
/// Method: cases with known texts; then all powers of two and random doubles and floats of every
/// size: what is written reads back as the same bits, and neither of the two neighbouring decimals
/// with one digit less does, found in the exact decimal expansion.
#define _GNU_SOURCE
#include "check.h"
#include "rng.h"

#include "common/decimal.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/// The digits of a text without its sign, point, exponent and outer zeros.
static int digits_of(const char* text, char digits[40])
{
    int count = 0;
    for (const char* c = text; *c != '\0' && *c != 'e'; ++c) {
        if (*c >= '0' && *c <= '9' && (count > 0 || *c != '0')) {
            digits[count++] = *c;
        }
    }
    while (count > 0 && digits[count - 1] == '0') {
        --count;
    }
    digits[count] = '\0';
    return count;
}

/// Does value, cut after so many digits and with `up` in the last one, read back as itself?
static bool reads_back_cut(double value, int digits, bool up, bool as_float)
{
    char exact[800], text[64];
    snprintf(exact, sizeof exact, "%.780e", value);
    const int exponent = atoi(strchr(exact, 'e') + 1);
    exact[1] = exact[0]; // the digits without their point
    unsigned long long whole = 0;
    for (int i = 0; i < digits; ++i) {
        whole = 10 * whole + (unsigned long long)(exact[1 + i] - '0');
    }
    snprintf(text, sizeof text, "%llue%d", whole + (up ? 1 : 0), exponent - digits + 1);
    return as_float ? (double)strtof(text, NULL) == value : strtod(text, NULL) == value;
}

static void check_shortest(double value, const char* text, bool as_float)
{
    char      digits[40];
    const int count = digits_of(text, digits);
    const double size = fabs(value);
    for (int up = 0; up <= 1 && count > 1; ++up) {
        if (reads_back_cut(size, count - 1, up == 1, as_float)) {
            fail_msg("%a is written %s, and a shorter text reads back, too", value, text);
        }
    }
}

static void check_double(double value)
{
    char text[DECIMAL_SIZE];
    decimal_from_double(value, text);
    CHECK_SAME_BITS(strtod(text, NULL), value + 0.0);
    assert_true(strlen(text) < DECIMAL_SIZE - 1);
    check_shortest(value, text, false);
}

static void check_float(float value)
{
    char text[DECIMAL_SIZE];
    decimal_from_float(value, text);
    if (strtof(text, NULL) != value) {
        fail_msg("%a is written %s, which reads back as another float", (double)value, text);
    }
    check_shortest((double)value, text, true);
}

static void test_known_numbers_have_their_known_texts(void** state)
{
    (void)state;
    const struct { double value; const char* text; } cases[] = {
        { 0.0, "0" }, { -0.0, "0" }, { 1.0, "1" }, { -1.0, "-1" }, { 10.0, "10" },
        { 0.1, "0.1" }, { 3.35, "3.35" }, { -2.5, "-2.5" }, { 0.3, "0.3" },
        { 0.1 + 0.2, "0.30000000000000004" }, { 100000.0, "100000" }, { 1e15, "1000000000000000" },
        { 9007199254740991.0, "9007199254740991" }, { 9007199254740992.0, "9007199254740992" },
        { 1e16, "1e16" }, { 1e21, "1e21" }, { -1.5e300, "-1.5e300" },
        { 123456789012345680.0, "1.2345678901234568e17" },
        { 0.0001, "0.0001" }, { 0.00012, "0.00012" }, { 0.00001, "1e-5" }, { 1.5e-7, "1.5e-7" },
        { 5e-324, "5e-324" }, { -5e-324, "-5e-324" }, { DBL_MIN, "2.2250738585072014e-308" },
        { 2.225073858507201e-308, "2.225073858507201e-308" }, // the largest subnormal
        { DBL_MAX, "1.7976931348623157e308" }, { -DBL_MAX, "-1.7976931348623157e308" },
        { 0x1p-1017, "7.120236347223045e-307" }, // its nearest 16 digits read back as another
        { 1764286248000000.0, "1764286248000000" }, // an instant of today [us]
        { 5e6, "5000000" }, { 4999999.999, "4999999.999" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        char text[DECIMAL_SIZE];
        decimal_from_double(cases[i].value, text);
        assert_string_equal(text, cases[i].text);
    }
    const struct { float value; const char* text; } floats[] = {
        { 0.0f, "0" }, { -0.0f, "0" }, { 0.1f, "0.1" }, { 13.9f, "13.9" }, { 16777216.0f, "16777216" },
        { 1e-45f, "1e-45" }, { FLT_MAX, "3.4028235e38" }, { FLT_MIN, "1.1754944e-38" },
        { 1.0f / 3.0f, "0.33333334" },
    };
    for (size_t i = 0; i < sizeof floats / sizeof floats[0]; ++i) {
        char text[DECIMAL_SIZE];
        decimal_from_float(floats[i].value, text);
        assert_string_equal(text, floats[i].text);
    }
}

static void test_powers_of_two_and_their_neighbours_are_shortest(void** state)
{
    (void)state;
    const int step = test_rounds(100) < 100 ? 11 : 1; // under valgrind some of them
    for (int exponent = -1074; exponent <= 1023; exponent += step) {
        const double power = ldexp(1.0, exponent);
        check_double(power);
        check_double(nextafter(power, 0.0));
        check_double(-nextafter(power, DBL_MAX));
    }
    for (int exponent = -149; exponent <= 127; exponent += step) {
        const float power = ldexpf(1.0f, exponent);
        check_float(power);
        check_float(nextafterf(power, 0.0f));
        check_float(-nextafterf(power, FLT_MAX));
    }
}

static void test_any_number_is_shortest(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("decimal");
    for (uint32_t i = 0; i < test_rounds(10000); ++i) {
        const uint64_t bits = test_rng_next(&rng);
        const uint32_t half = (uint32_t)(bits >> 32);
        double value;
        float  single;
        memcpy(&value, &bits, sizeof value);
        memcpy(&single, &half, sizeof single);
        if (isfinite(value)) {
            check_double(value);
        }
        if (isfinite(single)) {
            check_float(single);
        }
        check_double(test_rng_between(&rng, -1e3, 1e3)); // the size of what we write
        check_double(ldexp((double)(bits >> 12), -1074)); // subnormal
        check_double(round(test_rng_between(&rng, -1e6, 1e6)) / 1000.0);
        check_double((double)(int64_t)(bits >> 11)); // integers up to 2^53
    }
}

/// Builds a locale of Debian's sources in a folder. False: this machine has none.
static bool locale_enter(const char* folder, const char* name)
{
    char command[512];
    snprintf(command, sizeof command, "localedef -i %s -f UTF-8 %s/%s >/dev/null 2>&1", name,
             folder, name);
    setenv("LOCPATH", folder, 1);
    return system(command) != -1 && setlocale(LC_ALL, name) != NULL;
}

static void folder_remove(const char* folder)
{
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
}

static void test_the_locale_does_not_matter(void** state)
{
    (void)state;
    const char* const names[] = { "de_DE", "ps_AF" }; // a comma; a point of two bytes
    char folder[] = "/tmp/verge-locale-XXXXXX";
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < 2; ++i) {
        char expected[32], text[DECIMAL_SIZE];
        if (!locale_enter(folder, names[i])) {
            folder_remove(folder);
            printf("SKIPPED: no locale %s on this machine (Debian: locales)\n", names[i]);
            skip();
        }
        snprintf(expected, sizeof expected, "%.1f", 0.5);
        assert_string_not_equal(expected, "0.5");
        decimal_from_double(-1234.5678, text);
        assert_string_equal(text, "-1234.5678");
        decimal_from_double(0x1p-1017, text);
        assert_string_equal(text, "7.120236347223045e-307");
        decimal_from_float(0.1f, text);
        assert_string_equal(text, "0.1");
        setlocale(LC_ALL, "C");
    }
    folder_remove(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_numbers_have_their_known_texts),
        cmocka_unit_test(test_powers_of_two_and_their_neighbours_are_shortest),
        cmocka_unit_test(test_any_number_is_shortest),
        cmocka_unit_test(test_the_locale_does_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
