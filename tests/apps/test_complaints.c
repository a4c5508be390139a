/// Goal: what a bus's threads complain of reaches the main thread in order, and a flood costs no
///       memory and blocks nobody.
#include "check.h"
#include "rsu/complaints.h"

#include <pthread.h>
#include <stdio.h>

static void test_lines_come_in_order_and_a_flood_gives_up_its_newest(void** state)
{
    (void)state;
    static complaints box;
    char              line[COMPLAINT_SIZE];
    uint64_t          given_up = 7;
    complaints_init(&box);
    assert_false(complaints_take(&box, line, &given_up));
    for (int round = 0; round < 3; ++round) { // so that the ring goes round
        for (int i = 0; i < COMPLAINTS_MAX + 5; ++i) {
            snprintf(line, sizeof line, "line %d", i);
            complaints_put(&box, line);
        }
        for (int i = 0; i < COMPLAINTS_MAX; ++i) {
            char expected[32];
            snprintf(expected, sizeof expected, "line %d", i);
            assert_true(complaints_take(&box, line, &given_up));
            assert_string_equal(line, expected);
            assert_int_equal(given_up, i == 0 ? 5 : 0);
        }
        assert_false(complaints_take(&box, line, &given_up));
    }
    char text[2 * COMPLAINT_SIZE];
    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    complaints_put(&box, text);
    assert_true(complaints_take(&box, line, &given_up));
    assert_int_equal(strlen(line), COMPLAINT_SIZE - 1);
}

static void* complain(void* box)
{
    for (int i = 0; i < 10000; ++i) {
        complaints_put(box, "a line that is whole");
    }
    return NULL;
}

static void test_lines_of_many_threads_are_whole(void** state)
{
    (void)state;
    static complaints box;
    pthread_t         threads[3];
    char              line[COMPLAINT_SIZE];
    uint64_t          taken = 0, given_up = 0, lost = 0;
    complaints_init(&box);
    for (int i = 0; i < 3; ++i) {
        assert_int_equal(pthread_create(&threads[i], NULL, complain, &box), 0);
    }
    for (int i = 0; i < 20000; ++i) { // while they speak
        if (complaints_take(&box, line, &given_up)) {
            assert_string_equal(line, "a line that is whole");
            taken += 1;
            lost += given_up;
        }
    }
    for (int i = 0; i < 3; ++i) {
        pthread_join(threads[i], NULL);
    }
    while (complaints_take(&box, line, &given_up)) {
        taken += 1;
        lost += given_up;
    }
    assert_int_equal(taken + lost + box.given_up, 30000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_come_in_order_and_a_flood_gives_up_its_newest),
        cmocka_unit_test(test_lines_of_many_threads_are_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
