/// Goal: only a regular file is read as a log, and a file of another kind does not block the
/// reader. A recording opens on a FIFO without a reader, counts the events it loses, and continues
/// when a reader comes.
/// Method: real FIFOs, folders and devices; an alarm ends a test that waits.
#define _GNU_SOURCE
#include "check.h"

#include "secret.h"
#include "verge/transport.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATIENCE_S = 20 };

static char folder[] = "/tmp/verge-log-XXXXXX";
static char fifo[64];

static transport* open_log(const char* path, unsigned use)
{
    char       url[128], error[256];
    transport* bus = NULL;
    snprintf(url, sizeof url, "log:%s", path);
    if (transport_open(&bus, url, use, error, sizeof error) != TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    return bus;
}

static int record_mark(transport* bus, int64_t cycle)
{
    transport_message message;
    memset(&message, 0, sizeof message);
    message.kind = TRANSPORT_MARK;
    message.as.mark = (transport_mark){ .utime = 1000 + cycle, .cycle = cycle };
    return transport_record(bus, 1000 + cycle, &message);
}

static void test_only_regular_files_are_read(void** state)
{
    (void)state;
    const char* const others[] = { fifo, folder, "/dev/zero", "/dev/null", "/dev/tty", "/none" };
    for (size_t i = 0; i < sizeof others / sizeof others[0]; ++i) {
        char       url[128], error[256] = "";
        transport* bus = NULL;
        snprintf(url, sizeof url, "log:%s", others[i]);
        assert_int_equal(transport_open(&bus, url, TRANSPORT_STATES, error, sizeof error),
                         TRANSPORT_UNAVAILABLE);
        assert_null(bus);
        assert_non_null(strstr(error, others[i]));
        assert_null(strchr(error, '\n'));
        assert_int_equal(secret_open(others[i], error, sizeof error), -1);
        assert_non_null(strstr(error, others[i]));
    }
}

static void test_a_fifo_without_a_reader_is_recorded_to_and_its_losses_are_counted(void** state)
{
    (void)state;
    transport* bus = open_log(fifo, TRANSPORT_RECORD);
    assert_int_equal(record_mark(bus, 1), -1);
    assert_int_equal(errno, EPIPE);
    assert_int_equal(record_mark(bus, 2), -1);
    assert_int_equal(transport_statistics(bus).dropped, 2);

    const int reader = open(fifo, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    assert_int_equal(record_mark(bus, 3), 0);
    uint8_t bytes[256];
    assert_true(read(reader, bytes, sizeof bytes) > 28);
    static const uint8_t sync[] = { 0xED, 0xA1, 0xDA, 0x01, 0, 0, 0, 0, 0, 0, 0, 2 };
    assert_memory_equal(bytes, sync, sizeof sync); // the third event, whole
    close(reader);
    assert_int_equal(record_mark(bus, 4), -1);
    assert_int_equal(transport_statistics(bus).dropped, 3);
    transport_close(bus);
}

static void test_a_recording_that_never_was_written_is_an_error_with_its_path(void** state)
{
    (void)state;
    const char* const places[] = { folder, "/none/here" };
    for (size_t i = 0; i < sizeof places / sizeof places[0]; ++i) {
        char       url[128], error[256] = "";
        transport* bus = NULL;
        snprintf(url, sizeof url, "log:%s", places[i]);
        assert_int_equal(transport_open(&bus, url, TRANSPORT_RECORD, error, sizeof error),
                         TRANSPORT_UNAVAILABLE);
        assert_non_null(strstr(error, places[i]));
    }
    transport* full = open_log("/dev/full", TRANSPORT_RECORD);
    assert_int_equal(record_mark(full, 1), -1);
    assert_int_equal(errno, ENOSPC);
    transport_close(full);
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
    return mkfifo(fifo, 0600);
}

static int remove_places(void** state)
{
    (void)state;
    unlink(fifo);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_only_regular_files_are_read),
        cmocka_unit_test(test_a_fifo_without_a_reader_is_recorded_to_and_its_losses_are_counted),
        cmocka_unit_test(test_a_recording_that_never_was_written_is_an_error_with_its_path),
    };
    return cmocka_run_group_tests(tests, make_places, remove_places);
}
