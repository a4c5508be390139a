/// Goal: recording never waits for its file. The file holds complete events in order; dropped ones
/// are counted. A full disk ends the recording, a reader that pauses does not.
/// Method: FIFOs that the test reads or does not read, /dev/full; an alarm ends a test that waits.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { PATIENCE_S = 120, CLOSE_US = 20000000 };

static char folder[] = "/tmp/verge-recorder-XXXXXX";
static char fifo[64], file[64];

static recorder* open_recorder(const char* path)
{
    char error[256];
    recorder* self = NULL;
    if (!recorder_open(&self, path, error, sizeof error)) {
        fail_msg("%s", error);
    }
    return self;
}

static void put_mark(recorder* self, int64_t cycle)
{
    transport_message message;
    memset(&message, 0, sizeof message);
    message.kind = TRANSPORT_MARK;
    message.as.mark = (transport_mark){ .utime = cycle, .cycle = cycle };
    recorder_put(self, cycle, &message);
}

static void put_plan(recorder* self, int64_t cycle)
{
    static transport_message message;
    message.kind = TRANSPORT_PLAN;
    message.as.plan.cycle = (int32_t)cycle;
    recorder_put(self, cycle, &message);
}

/// The marks and plans of a log; fails where one is not whole.
static uint64_t events_in(const char* path, int64_t* last_cycle)
{
    char url[128], error[256];
    transport* log = NULL;
    static transport_message messages[64];
    snprintf(url, sizeof url, "log:%s", path);
    if (transport_open(&log, url, TRANSPORT_MARKS | TRANSPORT_PLANS, error, sizeof error) !=
        TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    uint64_t count = 0;
    *last_cycle = -1;
    while (!transport_ended(log)) {
        const uint32_t got = transport_drain(log, messages, 64);
        for (uint32_t i = 0; i < got; ++i) {
            assert_true(messages[i].arrival_utime >= *last_cycle);
            *last_cycle = messages[i].arrival_utime;
        }
        count += got;
    }
    assert_int_equal(transport_statistics(log).malformed, 0);
    transport_close(log);
    return count;
}

static void wait_until(bool (*holds)(const recorder*, uint64_t), const recorder* self, uint64_t n)
{
    for (int tries = 0; !holds(self, n); ++tries) {
        assert_true(tries < 20000);
        usleep(1000);
    }
}

static bool has_fault(const recorder* self, uint64_t fault)
{
    return recorder_fault(self) == (int)fault;
}

static bool has_dropped(const recorder* self, uint64_t count)
{
    return recorder_dropped(self) == count;
}

static void test_a_file_holds_every_event(void** state)
{
    (void)state;
    recorder* self = open_recorder(file);
    for (int64_t cycle = 1; cycle <= 200; ++cycle) {
        put_mark(self, cycle);
        put_plan(self, cycle);
    }
    assert_int_equal(recorder_dropped(self), 0);
    assert_int_equal(recorder_fault(self), 0);
    assert_true(recorder_close(self, CLOSE_US));
    int64_t last = 0;
    assert_int_equal(events_in(file, &last), 400); // the plan after the last mark, too
    assert_int_equal(last, 200);
}

/// Moves what is in the FIFO to the file, until nothing comes for a while.
static void pour(int reader, int out)
{
    char bytes[65536];
    for (int quiet = 0; quiet < 200;) {
        const ssize_t got = read(reader, bytes, sizeof bytes);
        quiet = got > 0 ? 0 : quiet + 1;
        if (got > 0) {
            assert_int_equal(write(out, bytes, (size_t)got), got);
        } else {
            usleep(1000);
        }
    }
}

static void test_a_reader_that_stops_costs_counted_events_and_no_time(void** state)
{
    (void)state;
    const int reader = open(fifo, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    const int out = open(file, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    recorder* self = open_recorder(fifo);
    uint64_t put = 2; // an event of time 0 would be given the time of reading
    while (recorder_dropped(self) == 0) { // unread, and the caller does not block
        put_mark(self, (int64_t)put);
        put_plan(self, (int64_t)put);
        put += 2;
        assert_true(put < 100000);
    }
    pour(reader, out);
    const uint64_t dropped = recorder_dropped(self);
    put_mark(self, (int64_t)put);
    ++put;
    pour(reader, out);
    assert_int_equal(recorder_dropped(self), dropped); // and works again
    assert_int_equal(recorder_fault(self), 0);
    assert_true(recorder_close(self, CLOSE_US));
    pour(reader, out);
    close(out);
    close(reader);
    int64_t last = 0;
    assert_int_equal(events_in(file, &last), put - 2 - dropped);
    assert_int_equal(last, put - 1);
}

static void test_a_fifo_without_a_reader_loses_counted_events_until_one_comes(void** state)
{
    (void)state;
    recorder* self = open_recorder(fifo);
    put_mark(self, 1);
    put_plan(self, 1);
    put_mark(self, 2);
    wait_until(has_dropped, self, 3);
    const int reader = open(fifo, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    put_mark(self, 3);
    assert_true(recorder_close(self, CLOSE_US));
    char bytes[256];
    assert_true(read(reader, bytes, sizeof bytes) > 0);
    close(reader);
}

static void test_closing_does_not_wait_for_a_reader_that_stops(void** state)
{
    (void)state;
    const int   reader = open(fifo, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    const pid_t child = fork(); // its thread is left waiting, and ends with it
    if (child == 0) {
        recorder* self = open_recorder(fifo);
        for (int64_t cycle = 1; cycle <= 1000; ++cycle) {
            put_mark(self, cycle);
            put_plan(self, cycle);
        }
        if (!recorder_close(self, 10000)) {
            raise(SIGKILL); // it came this far
        }
        _exit(1);
    }
    int end = -1;
    assert_int_equal(waitpid(child, &end, 0), child);
    assert_true(WIFSIGNALED(end) && WTERMSIG(end) == SIGKILL);
    close(reader);
}

static void test_a_full_disk_ends_the_recording(void** state)
{
    (void)state;
    recorder* self = open_recorder("/dev/full");
    put_mark(self, 1);
    wait_until(has_fault, self, ENOSPC);
    put_mark(self, 2);
    assert_true(recorder_close(self, CLOSE_US));
    assert_true(recorder_close(NULL, 0));
}

static void test_a_recording_that_cannot_be_opened_is_reported_with_its_path(void** state)
{
    (void)state;
    char error[256] = "";
    recorder* self = (recorder*)&error;
    assert_false(recorder_open(&self, "/none/here", error, sizeof error));
    assert_null(self);
    assert_non_null(strstr(error, "/none/here"));
    static char longer[5000];
    memset(longer, 'x', sizeof longer - 1);
    assert_false(recorder_open(&self, longer, error, sizeof error));
    assert_non_null(strstr(error, "too long"));
}

static int make_places(void** state)
{
    (void)state;
    signal(SIGPIPE, SIG_IGN);
    alarm(PATIENCE_S);
    if (mkdtemp(folder) == NULL) {
        return -1;
    }
    snprintf(fifo, sizeof fifo, "%s/fifo", folder);
    snprintf(file, sizeof file, "%s/file", folder);
    return mkfifo(fifo, 0600);
}

static int remove_places(void** state)
{
    (void)state;
    unlink(fifo);
    unlink(file);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_file_holds_every_event),
        cmocka_unit_test(test_a_reader_that_stops_costs_counted_events_and_no_time),
        cmocka_unit_test(test_a_fifo_without_a_reader_loses_counted_events_until_one_comes),
        cmocka_unit_test(test_a_full_disk_ends_the_recording),
        cmocka_unit_test(test_a_recording_that_cannot_be_opened_is_reported_with_its_path),
        cmocka_unit_test(test_closing_does_not_wait_for_a_reader_that_stops),
    };
    return cmocka_run_group_tests(tests, make_places, remove_places);
}
