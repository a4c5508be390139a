/// Goal: each fault of a bus is logged at once and then at a limited rate, many faults use bounded
///       memory and few lines, and lines of several threads are not mixed.
/// Method: the test supplies the time.
#include "check.h"
#include "complaints.h"

#include <pthread.h>
#include <stdio.h>

static char     told[64][COMPLAINT_SIZE + 80];
static uint32_t told_count;

static void hear(void* context, const char* line)
{
    (void)context;
    snprintf(told[told_count % 64], sizeof told[0], "%s", line);
    ++told_count;
}

static void begin(complaints* box)
{
    complaints_init(box, &(transport_options){ .log = hear });
    told_count = 0;
}

static void test_the_same_fault_is_logged_at_once_and_then_every_ten_seconds(void** state)
{
    (void)state;
    static complaints box;
    begin(&box);
    complaints_log(&box, 100);
    assert_int_equal(told_count, 0);
    for (int64_t second = 100; second < 125; ++second) {
        for (int i = 0; i < 7; ++i) {
            complaints_add(&box, 1, "no certificate");
            complaints_log(&box, second);
        }
    }
    assert_int_equal(told_count, 3);
    assert_string_equal(told[0], "no certificate");
    assert_string_equal(told[1], "no certificate (70 times)"); // 6 + 9 * 7 + 1
    // Another trouble does not wait for the first one's turn; the newest words of a kind count.
    complaints_add(&box, 2, "first words");
    complaints_add(&box, 2, "newest words");
    complaints_log(&box, 126);
    assert_int_equal(told_count, 4);
    assert_string_equal(told[3], "newest words (2 times)");
    complaints_destroy(&box);
}

static void test_different_faults_give_at_most_five_lines_a_second(void** state)
{
    (void)state;
    static complaints box;
    begin(&box);
    char     line[32];
    uint32_t kind = 0;
    for (int64_t second = 1; second <= 20; ++second) {
        for (int i = 0; i < 1000; ++i) {
            snprintf(line, sizeof line, "trouble %u", ++kind);
            complaints_add(&box, kind, line);
            complaints_log(&box, second);
        }
        CHECK_AT_MOST(told_count, 5 * second);
    }
    assert_int_equal(told_count, 96); // the first second had one to tell when it was asked
    assert_non_null(strstr(told[(told_count - 1) % 64], "other lines)"));
    complaints_destroy(&box);
}

static void test_a_missing_listener_is_no_error_and_long_lines_are_cut(void** state)
{
    (void)state;
    static complaints box;
    char              text[2 * COMPLAINT_SIZE];
    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    complaints_init(&box, &(transport_options){ .log = NULL });
    complaints_add(&box, 1, text);
    complaints_log(&box, 1);
    complaints_destroy(&box);

    begin(&box);
    complaints_add(&box, 1, text);
    complaints_log(&box, 1);
    assert_int_equal(strlen(told[0]), COMPLAINT_SIZE - 1);
    complaints_destroy(&box);
}

static void* complain(void* box)
{
    for (uint32_t i = 0; i < 10000; ++i) {
        complaints_add(box, i % 5, "a line that is whole");
    }
    return NULL;
}

static void test_lines_of_many_threads_are_not_mixed(void** state)
{
    (void)state;
    static complaints box;
    pthread_t         threads[3];
    begin(&box);
    for (int i = 0; i < 3; ++i) {
        assert_int_equal(pthread_create(&threads[i], NULL, complain, &box), 0);
    }
    for (int64_t second = 1; second < 1000; ++second) {
        complaints_log(&box, second);
    }
    for (int i = 0; i < 3; ++i) {
        pthread_join(threads[i], NULL);
    }
    complaints_log(&box, 2000);
    CHECK_BETWEEN(told_count, 5, 30000);
    for (uint32_t i = 0; i < 64 && i < told_count; ++i) {
        assert_int_equal(strncmp(told[i], "a line that is whole", 20), 0);
    }
    complaints_destroy(&box);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_same_fault_is_logged_at_once_and_then_every_ten_seconds),
        cmocka_unit_test(test_different_faults_give_at_most_five_lines_a_second),
        cmocka_unit_test(test_a_missing_listener_is_no_error_and_long_lines_are_cut),
        cmocka_unit_test(test_lines_of_many_threads_are_not_mixed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
