/// Goal: a certificate or permission near its expiry date is reported once a day until it is
/// renewed, and not before.
/// Method: the test supplies the time.
#include "check.h"

#include "daemon/buses.h"

static const int64_t HOUR = 3600 * INT64_C(1000000), DAY = 24 * 3600 * INT64_C(1000000);

static void test_days_left_are_whole_days(void** state)
{
    (void)state;
    const int64_t end = 20000 * DAY;
    assert_int_equal(buses_days_left(end, end - 2 * DAY), 2);
    assert_int_equal(buses_days_left(end, end - 2 * DAY + 1), 1);
    assert_int_equal(buses_days_left(end, end), 0);
    assert_int_equal(buses_days_left(end, end + 1), -1);
    assert_int_equal(buses_days_left(end, end + 2 * DAY), -2);
}

static void test_an_expiry_date_is_reported_once_a_day_and_after_it(void** state)
{
    (void)state;
    const int64_t end = 20000 * DAY;
    buses         self = { .expiry = end };
    int           told = 0;
    for (int64_t utime = end - 40 * DAY; utime < end + 5 * DAY; utime += HOUR) {
        const bool tells = buses_expiring(&self, utime);
        assert_false(tells && buses_days_left(end, utime) >= BUSES_EXPIRY_DAYS);
        told += tells ? 1 : 0;
    }
    assert_int_equal(told, BUSES_EXPIRY_DAYS + 5);
}

static void test_a_clock_set_back_does_not_silence_it(void** state)
{
    (void)state;
    const int64_t end = 20000 * DAY;
    buses         self = { .expiry = end };
    assert_true(buses_expiring(&self, end - DAY));
    assert_true(buses_expiring(&self, end - 5 * DAY));
    assert_false(buses_expiring(&self, end - 5 * DAY + HOUR));
}

static void test_a_certificate_without_an_expiry_date_is_not_reported(void** state)
{
    (void)state;
    buses self = { .expiry = 0 };
    assert_false(buses_expiring(&self, 20000 * DAY));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_days_left_are_whole_days),
        cmocka_unit_test(test_an_expiry_date_is_reported_once_a_day_and_after_it),
        cmocka_unit_test(test_a_clock_set_back_does_not_silence_it),
        cmocka_unit_test(test_a_certificate_without_an_expiry_date_is_not_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
