/// Goal: the pool carries out each task of a run exactly once, before the run returns, and any
/// number of runs after each other; it refuses numbers of threads it has no room for.
/// Method: counters that each task raises, for pools of 1 to 64 threads, runs of 0 to 1,000 tasks,
/// short and uneven; a run that needs all of its threads at the same time.
#define _GNU_SOURCE
#include "check.h"
#include "rng.h"

#include "common/executor.h"

#include <errno.h>
#include <stdatomic.h>
#include <time.h>
#include <unistd.h>

enum { TASKS_MAX = 1000 };

typedef struct work {
    atomic_uint done[TASKS_MAX];
    atomic_uint out_of_range;
    uint32_t    count;
    bool        uneven;
} work;

static void work_task(void* arg, uint32_t index)
{
    work* self = arg;
    if (index >= self->count) {
        atomic_fetch_add(&self->out_of_range, 1);
        return;
    }
    if (self->uneven && index % 7 == 0) {
        usleep(200);
    }
    atomic_fetch_add(&self->done[index], 1);
}

static void run_and_check(executor* pool, uint32_t count, bool uneven)
{
    static work self;
    memset(&self, 0, sizeof self);
    self.count = count;
    self.uneven = uneven;
    executor_run(pool, work_task, &self, count);
    for (uint32_t i = 0; i < count; ++i) {
        assert_int_equal(atomic_load(&self.done[i]), 1);
    }
    assert_int_equal(atomic_load(&self.out_of_range), 0);
}

static void test_every_task_is_done_once_before_the_run_returns(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("executor");
    const uint32_t threads[] = { 1, 2, 3, 8, EXECUTOR_THREADS_MAX };
    for (size_t i = 0; i < sizeof threads / sizeof threads[0]; ++i) {
        executor* pool = executor_create(threads[i]);
        assert_non_null(pool);
        const uint32_t counts[] = { 0, 1, 2, threads[i], threads[i] + 1, TASKS_MAX };
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; ++k) {
            run_and_check(pool, counts[k], false);
        }
        for (uint32_t round = 0; round < test_rounds(300); ++round) {
            run_and_check(pool, test_rng_below(&rng, 40), round % 16 == 0);
        }
        executor_destroy(pool);
    }
}

typedef struct meeting {
    atomic_uint arrived;
    uint32_t    expected;
    atomic_uint missed;
} meeting;

/// Ends when all threads have arrived, or after 20 s.
static void meeting_task(void* arg, uint32_t index)
{
    meeting* self = arg;
    (void)index;
    atomic_fetch_add(&self->arrived, 1);
    for (int tries = 0; atomic_load(&self->arrived) < self->expected; ++tries) {
        if (tries == 20000) {
            atomic_fetch_add(&self->missed, 1);
            return;
        }
        usleep(1000);
    }
}

static void test_as_many_tasks_as_threads_run_at_the_same_time(void** state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 8; ++threads) {
        executor* pool = executor_create(threads);
        meeting   all = { .expected = threads };
        executor_run(pool, meeting_task, &all, threads);
        assert_int_equal(atomic_load(&all.missed), 0);
        executor_destroy(pool);
    }
}

static void test_a_pool_that_never_ran_is_destroyed_at_once(void** state)
{
    (void)state;
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        executor_destroy(executor_create(1 + round % 5));
    }
    executor_destroy(NULL);
}

static void test_numbers_of_threads_without_room_are_refused(void** state)
{
    (void)state;
    const uint32_t wrong[] = { 0, EXECUTOR_THREADS_MAX + 1, UINT32_MAX };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        errno = 0;
        assert_null(executor_create(wrong[i]));
        assert_int_equal(errno, EINVAL);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_task_is_done_once_before_the_run_returns),
        cmocka_unit_test(test_as_many_tasks_as_threads_run_at_the_same_time),
        cmocka_unit_test(test_a_pool_that_never_ran_is_destroyed_at_once),
        cmocka_unit_test(test_numbers_of_threads_without_room_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
