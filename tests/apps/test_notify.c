/// Goal: the service manager receives each line, at a path or an abstract name. A manager that does
/// not read, or an unusable name, does not block the daemon.
/// Method: real sockets in place of the manager's; an alarm ends a test that waits.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/notify.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { PATIENCE_S = 60 };

static char folder[] = "/tmp/verge-notify-XXXXXX";

static const char* path_of(const char* name)
{
    static char path[80];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

/// The manager's end at a path.
static int manager_at(const char* path)
{
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (const struct sockaddr*)&address, sizeof address), 0);
    setenv("NOTIFY_SOCKET", path, 1);
    return fd;
}

static void test_the_manager_receives_lines_at_a_path_or_an_abstract_name(void** state)
{
    (void)state;
    char abstract[64];
    snprintf(abstract, sizeof abstract, "@verge-test-%d", (int)getpid());
    const char* const names[] = { path_of("notify"), abstract };
    for (int i = 0; i < 2; ++i) {
        struct sockaddr_un address = { .sun_family = AF_UNIX };
        const size_t length = strlen(names[i]);
        memcpy(address.sun_path, names[i], length);
        if (names[i][0] == '@') {
            address.sun_path[0] = '\0';
        }
        const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
        const socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
        assert_int_equal(bind(fd, (const struct sockaddr*)&address, size), 0);
        setenv("NOTIFY_SOCKET", names[i], 1);
        notify self;
        assert_true(notify_open(&self));
        notify_send(&self, "READY=1");
        notify_status(&self, "well");
        notify_status(&self, "well"); // nothing new
        notify_status(&self, "better");
        const char* const expected[] = { "READY=1", "STATUS=well", "STATUS=better" };
        for (int k = 0; k < 3; ++k) {
            char words[64] = "";
            assert_true(recv(fd, words, sizeof words - 1, 0) > 0);
            assert_string_equal(words, expected[k]);
        }
        char rest[8];
        assert_int_equal(recv(fd, rest, sizeof rest, 0), -1);
        notify_close(&self);
        notify_send(&self, "nobody");
        close(fd);
    }
    remove(path_of("notify"));
}

static void test_the_watchdog_is_used_unless_it_names_another_process(void** state)
{
    (void)state;
    unsetenv("NOTIFY_SOCKET");
    const struct { const char *usec, *pid; int64_t expected; } CASES[] = {
        { NULL, NULL, 0 },      { "3000000", NULL, 3000000 }, { "3000000", "1", 0 },
        { "0", NULL, 0 },       { "soon", NULL, 0 },          { "3000000x", NULL, 0 },
        { "-5", NULL, 0 },
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; ++i) {
        CASES[i].usec != NULL ? setenv("WATCHDOG_USEC", CASES[i].usec, 1)
                              : unsetenv("WATCHDOG_USEC");
        CASES[i].pid != NULL ? setenv("WATCHDOG_PID", CASES[i].pid, 1) : unsetenv("WATCHDOG_PID");
        notify self;
        assert_true(notify_open(&self));
        assert_true(self.watchdog_us == CASES[i].expected);
    }
    char own[16];
    snprintf(own, sizeof own, "%d", (int)getpid());
    setenv("WATCHDOG_USEC", "7", 1);
    setenv("WATCHDOG_PID", own, 1);
    notify self;
    assert_true(notify_open(&self) && self.watchdog_us == 7);
}

static void test_an_unusable_name_is_reported_and_then_ignored(void** state)
{
    (void)state;
    static char longest[200];
    memset(longest, 'x', sizeof longest - 1);
    longest[0] = '/';
    const struct { const char* name; bool usable; } CASES[] = {
        { NULL, true }, { "", true }, { "relative/path", false }, { longest, false },
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; ++i) {
        CASES[i].name != NULL ? setenv("NOTIFY_SOCKET", CASES[i].name, 1)
                              : unsetenv("NOTIFY_SOCKET");
        notify self;
        assert_int_equal(notify_open(&self), CASES[i].usable);
        assert_int_equal(self.fd, -1);
        notify_send(&self, "READY=1");
        notify_status(&self, "well");
        notify_close(&self);
    }
}

static void test_a_manager_that_does_not_read_blocks_nothing(void** state)
{
    (void)state;
    const int fd = manager_at(path_of("deaf"));
    notify self;
    assert_true(notify_open(&self));
    for (int i = 0; i < 20000; ++i) { // more than its queue has room for
        notify_send(&self, "WATCHDOG=1");
    }
    close(fd);
    notify_send(&self, "WATCHDOG=1"); // nor one that is gone
    unlink(path_of("deaf"));
    notify_send(&self, "WATCHDOG=1");
    notify_close(&self);
}

static void test_a_status_that_is_too_long_is_cut(void** state)
{
    (void)state;
    const int fd = manager_at(path_of("cut"));
    notify self;
    assert_true(notify_open(&self));
    char words[500], heard[600] = "";
    memset(words, 'w', sizeof words - 1);
    words[sizeof words - 1] = '\0';
    notify_status(&self, words);
    const ssize_t size = recv(fd, heard, sizeof heard - 1, 0);
    assert_int_equal(size, 7 + sizeof self.status - 1);
    assert_int_equal(strncmp(heard, "STATUS=www", 10), 0);
    notify_close(&self);
    close(fd);
    unlink(path_of("cut"));
}

static int make_folder(void** state)
{
    (void)state;
    alarm(PATIENCE_S);
    return mkdtemp(folder) == NULL ? -1 : 0;
}

static int remove_folder(void** state)
{
    (void)state;
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_manager_receives_lines_at_a_path_or_an_abstract_name),
        cmocka_unit_test(test_the_watchdog_is_used_unless_it_names_another_process),
        cmocka_unit_test(test_an_unusable_name_is_reported_and_then_ignored),
        cmocka_unit_test(test_a_manager_that_does_not_read_blocks_nothing),
        cmocka_unit_test(test_a_status_that_is_too_long_is_cut),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
