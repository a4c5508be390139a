/// Goal: a job runs in a thread of its own, one at a time, and its end is signalled once on a
/// descriptor. The caller is never blocked. Destroying waits for the job.
/// Method: jobs that wait until the test releases them.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/worker.h"

#include <errno.h>
#include <poll.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

typedef struct gate {
    sem_t      open;
    atomic_int passed;
    pthread_t  thread;
    char       name[16];
} gate;

static gate door;

static void wait_at_gate(void* arg)
{
    gate* self = arg;
    while (sem_wait(&self->open) != 0) {
    }
    self->thread = pthread_self();
    pthread_getname_np(self->thread, self->name, sizeof self->name);
    atomic_fetch_add(&self->passed, 1);
}

static bool readable(int fd, int patience_ms)
{
    struct pollfd end = { .fd = fd, .events = POLLIN };
    return poll(&end, 1, patience_ms) == 1;
}

static worker* make_worker(void)
{
    worker* self = worker_create("test-worker", NULL);
    assert_non_null(self);
    return self;
}

static void test_a_job_runs_elsewhere_and_its_end_is_seen_once(void** state)
{
    (void)state;
    worker* self = make_worker();
    assert_false(worker_busy(self));
    assert_false(worker_collect(self));
    worker_start(self, wait_at_gate, &door);
    assert_true(worker_busy(self)); // and here we are
    assert_false(worker_collect(self));
    assert_false(readable(worker_fd(self), 10));
    sem_post(&door.open);
    assert_true(readable(worker_fd(self), 20000));
    assert_true(worker_busy(self)); // until it is collected
    assert_true(worker_collect(self));
    assert_false(worker_busy(self));
    assert_false(worker_collect(self));
    assert_false(readable(worker_fd(self), 0));
    assert_int_equal(door.passed, 1);
    assert_false(pthread_equal(door.thread, pthread_self()));
    assert_string_equal(door.name, "test-worker");
    worker_destroy(self);
}

static void test_many_jobs_run_one_after_the_other(void** state)
{
    (void)state;
    enum { JOBS = 2000 };
    worker* self = make_worker();
    door.passed = 0;
    for (int i = 0; i < JOBS; ++i) {
        worker_start(self, wait_at_gate, &door);
        sem_post(&door.open);
        assert_true(readable(worker_fd(self), 20000));
        assert_true(worker_collect(self));
        assert_int_equal(door.passed, i + 1);
    }
    worker_destroy(self);
}

static void test_destroying_waits_for_the_job(void** state)
{
    (void)state;
    worker* self = make_worker();
    door.passed = 0;
    worker_start(self, wait_at_gate, &door);
    sem_post(&door.open);
    worker_destroy(self);
    assert_int_equal(door.passed, 1);
    worker_destroy(make_worker()); // one that never had a job
    worker_destroy(NULL);
}

static void test_a_refusal_of_the_system_is_an_errno(void** state)
{
    (void)state;
    const thread_options nowhere = { .cpu_count = 1, .cpus = { 1023 } };
    errno = 0;
    assert_null(worker_create("test-worker", &nowhere));
    assert_int_equal(errno, EINVAL);
}

static int make_gate(void** state)
{
    (void)state;
    return sem_init(&door.open, 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_job_runs_elsewhere_and_its_end_is_seen_once),
        cmocka_unit_test(test_many_jobs_run_one_after_the_other),
        cmocka_unit_test(test_destroying_waits_for_the_job),
        cmocka_unit_test(test_a_refusal_of_the_system_is_an_errno),
    };
    return cmocka_run_group_tests(tests, make_gate, NULL);
}
