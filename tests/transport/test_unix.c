/// Goal: a unix: bus takes a path only where that harms no other program, gives it back, survives
///       what happens to the file and to the program at the other end, and never waits.
/// Method: real sockets in a folder of the test; other programs are child processes.
/// What it shares with all buses is in test_backends.c, hostile datagrams are in test_hostile.c.
#include "check.h"
#include "verge/transport.h"
#include "verge/wire.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

long syscall(long number, ...); // unistd.h declares it for _GNU_SOURCE only

static char folder[] = "/tmp/verge_test_unix_XXXXXX";
static char path[64], url[80];

static transport* open_or_fail(unsigned use)
{
    char       error[256] = "";
    transport* bus = NULL;
    if (transport_open(&bus, url, use, error, sizeof error) != TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    return bus;
}

/// The URL is refused with this result, and with a line that has these words.
static void check_refused(const char* bad, unsigned use, int result, const char* words)
{
    char       error[256] = "";
    transport* bus = (transport*)error;
    assert_int_equal(transport_open(&bus, bad, use, error, sizeof error), result);
    assert_null(bus);
    assert_null(strchr(error, '\n'));
    if (strstr(error, words) == NULL || strstr(error, bad) != error) {
        fail_msg("\"%s\" does not begin with %s or lacks \"%s\"", error, bad, words);
    }
}

static int send_state(transport* bus, int32_t id)
{
    const verge_vehicle_state_t state = { .vehicle_id = id };
    return transport_publish_state(bus, &state);
}

/// The vehicle of the next message; -1: none waits.
static int32_t next_id(transport* bus)
{
    transport_message message;
    return transport_drain(bus, &message, 1) == 1 ? message.as.state.vehicle_id : -1;
}

/// A socket of another program, bound to the path.
static int foreign_socket(int type)
{
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, type, 0);
    assert_int_equal(bind(fd, (const struct sockaddr*)&address, sizeof address), 0);
    return fd;
}

static bool exists(void)
{
    struct stat facts;
    return lstat(path, &facts) == 0;
}

static void wait_for_the_next_look(void)
{
    nanosleep(&(struct timespec){ .tv_sec = 1, .tv_nsec = 100000000 }, NULL);
}

/// What a bus complained of last.
static char complaint[256];

static void keep_complaint(void* context, const char* line)
{
    (void)context;
    snprintf(complaint, sizeof complaint, "%s", line);
}

static transport* open_with_log(unsigned use)
{
    const transport_options options = { .log = keep_complaint };
    char       error[256];
    transport* bus = NULL;
    complaint[0] = '\0';
    assert_int_equal(transport_open_with(&bus, url, use, &options, error, sizeof error), 0);
    return bus;
}

// ---------------------------------------------------------------- the file

static void test_the_socket_has_mode_0660_whatever_the_umask_and_is_removed_at_close(void** state)
{
    (void)state;
    static const mode_t masks[] = { 0, 022, 077, 0777 };
    for (size_t i = 0; i < sizeof masks / sizeof masks[0]; ++i) {
        const mode_t before = umask(masks[i]);
        transport*   bus = open_or_fail(TRANSPORT_STATES);
        umask(before);
        struct stat facts;
        assert_int_equal(lstat(path, &facts), 0);
        assert_int_equal(facts.st_mode, S_IFSOCK | 0660);
        transport_close(bus);
        assert_false(exists());
    }
}

static void test_a_sender_makes_and_removes_no_file(void** state)
{
    (void)state;
    transport* sender = open_or_fail(TRANSPORT_SENDS_STATES);
    assert_false(exists());
    assert_int_equal(transport_fd(sender), -1);
    transport* receiver = open_or_fail(TRANSPORT_STATES);
    transport_close(sender);
    assert_true(exists());
    transport_close(receiver);
}

static void test_a_socket_of_an_ended_program_is_replaced(void** state)
{
    (void)state;
    static const int types[] = { SOCK_DGRAM, SOCK_STREAM };
    for (int i = 0; i < 2; ++i) {
        close(foreign_socket(types[i]));
        assert_true(exists());
        transport* receiver = open_or_fail(TRANSPORT_STATES);
        transport* sender = open_or_fail(TRANSPORT_SENDS_STATES);
        assert_int_equal(send_state(sender, 7), 0);
        assert_int_equal(next_id(receiver), 7);
        transport_close(sender);
        transport_close(receiver);
    }
}

static void test_a_socket_in_use_is_refused_and_stays_in_use(void** state)
{
    (void)state;
    transport* receiver = open_or_fail(TRANSPORT_STATES);
    check_refused(url, TRANSPORT_STATES, TRANSPORT_UNAVAILABLE, "another program receives there");
    transport* sender = open_or_fail(TRANSPORT_SENDS_STATES);
    assert_int_equal(send_state(sender, 7), 0);
    assert_int_equal(next_id(receiver), 7);
    transport_close(sender);
    transport_close(receiver);

    const int stream = foreign_socket(SOCK_STREAM);
    assert_int_equal(listen(stream, 1), 0);
    check_refused(url, TRANSPORT_STATES, TRANSPORT_UNAVAILABLE, "another program receives there");
    assert_true(exists());
    close(stream);
    unlink(path);
}

static void test_a_file_that_is_no_socket_is_refused_and_stays(void** state)
{
    (void)state;
    const int file = open(path, O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(file, "plans", 5), 5);
    close(file);
    check_refused(url, TRANSPORT_STATES, TRANSPORT_UNAVAILABLE, "no socket");
    struct stat facts;
    assert_int_equal(stat(path, &facts), 0);
    assert_int_equal(facts.st_size, 5);
    unlink(path);

    assert_int_equal(symlink("nowhere", path), 0);
    check_refused(url, TRANSPORT_STATES, TRANSPORT_UNAVAILABLE, "no socket");
    assert_true(exists());
    unlink(path);
}

static void test_a_removed_socket_comes_back_under_the_same_descriptor(void** state)
{
    (void)state;
    transport* receiver = open_or_fail(TRANSPORT_STATES);
    transport* sender = open_or_fail(TRANSPORT_SENDS_STATES);
    const int  fd = transport_fd(receiver);
    assert_int_equal(next_id(receiver), -1);
    unlink(path);
    assert_int_equal(send_state(sender, 7), -1);
    wait_for_the_next_look();
    assert_int_equal(next_id(receiver), -1);
    assert_int_equal(send_state(sender, 8), 0);
    assert_int_equal(transport_fd(receiver), fd);
    assert_int_equal(poll(&(struct pollfd){ .fd = fd, .events = POLLIN }, 1, 0), 1);
    assert_int_equal(next_id(receiver), 8);
    assert_int_equal(transport_statistics(receiver).errors, 0);
    transport_close(sender);
    transport_close(receiver);
    assert_false(exists());
}

static void test_a_path_that_another_program_took_is_left_to_it_and_reported(void** state)
{
    (void)state;
    transport* receiver = open_with_log(TRANSPORT_STATES);
    assert_int_equal(next_id(receiver), -1);
    unlink(path);
    const int other = foreign_socket(SOCK_DGRAM);
    wait_for_the_next_look();
    assert_int_equal(next_id(receiver), -1);
    assert_int_equal(next_id(receiver), -1); // logs what the call before has found
    assert_int_equal(transport_statistics(receiver).errors, 1);
    assert_non_null(strstr(complaint, "another program receives there"));
    transport_close(receiver);
    assert_true(exists());
    close(other);
    unlink(path);
}

// ---------------------------------------------------------------- the other end

static void test_a_receiver_that_starts_later_or_again_is_reached(void** state)
{
    (void)state;
    transport* sender = open_with_log(TRANSPORT_SENDS_STATES);
    for (int32_t start = 0; start < 3; ++start) {
        assert_int_equal(send_state(sender, 1), -1);
        transport* receiver = open_or_fail(TRANSPORT_STATES);
        assert_int_equal(send_state(sender, 10 + start), 0);
        assert_int_equal(next_id(receiver), 10 + start);
        transport_close(receiver);
    }
    close(foreign_socket(SOCK_DGRAM)); // ended without removing its file
    assert_int_equal(send_state(sender, 1), -1);
    unlink(path);
    assert_int_equal(transport_statistics(sender).errors, 4);
    assert_int_equal(transport_statistics(sender).published, 3);
    assert_int_equal(next_id(sender), -1); // a sender drains to log
    assert_non_null(strstr(complaint, url));
    assert_non_null(strstr(complaint, "no program receives there"));
    transport_close(sender);
}

static void test_a_trajectory_reaches_its_receiver_whole(void** state)
{
    (void)state;
    transport*        receiver = open_or_fail(TRANSPORT_TRAJECTORIES);
    transport*        sender = open_or_fail(TRANSPORT_SENDS_TRAJECTORIES);
    transport_message message;
    verge_vehicle_trajectory_t sent = { .vehicle_id = 7, .point_count = WIRE_POINTS_MAX };
    sent.points[WIRE_POINTS_MAX - 1].x = 1234.5;
    assert_int_equal(transport_publish_trajectory(sender, &sent), 0);
    assert_int_equal(send_state(sender, 1), 0); // of a kind that nobody wants
    assert_int_equal(transport_drain(receiver, &message, 1), 1);
    assert_int_equal(message.kind, TRANSPORT_TRAJECTORY);
    assert_int_equal(message.as.trajectory.vehicle_id, 7);
    CHECK_SAME_BITS(message.as.trajectory.points[WIRE_POINTS_MAX - 1].x, 1234.5);
    assert_int_equal(transport_drain(receiver, &message, 1), 0);
    assert_int_equal(transport_statistics(receiver).foreign, 1);
    transport_close(sender);
    transport_close(receiver);
}

static void test_a_full_queue_fails_at_once_and_sending_works_again_after_it(void** state)
{
    (void)state;
    transport* receiver = open_or_fail(TRANSPORT_STATES);
    transport* sender = open_with_log(TRANSPORT_SENDS_STATES);
    int32_t    sent = 0;
    while (sent < 100000 && send_state(sender, sent) == 0) {
        ++sent;
    }
    assert_true(sent >= 10 && sent < 100000);
    assert_int_equal(transport_statistics(sender).errors, 1);
    for (int32_t id = 0; id < sent; ++id) {
        assert_int_equal(next_id(receiver), id);
    }
    assert_int_equal(next_id(receiver), -1);
    assert_int_equal(send_state(sender, 7), 0);
    assert_int_equal(next_id(receiver), 7);
    assert_int_equal(next_id(sender), -1);
    assert_non_null(strstr(complaint, "too slow"));
    transport_close(sender);
    transport_close(receiver);
}

/// Runs in a child process; its exit status is 0 if the body is true.
static pid_t in_another_program(bool (*body)(void))
{
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        _exit(body() ? 0 : 1);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    return child;
}

static bool sends_a_state(void)
{
    transport* sender = open_or_fail(TRANSPORT_SENDS_STATES);
    const bool sent = send_state(sender, 7) == 0;
    transport_close(sender);
    return sent;
}

static void test_a_sender_is_the_process_that_sent(void** state)
{
    (void)state;
    static transport *receiver, *sender; // reachable from the child, for valgrind
    receiver = open_or_fail(TRANSPORT_STATES);
    sender = open_or_fail(TRANSPORT_SENDS_STATES);
    const pid_t       child = in_another_program(sends_a_state);
    transport_message messages[3];
    send_state(sender, 1);
    send_state(sender, 2);
    assert_int_equal(transport_drain(receiver, messages, 3), 3);
    assert_int_equal(messages[0].sender, child);
    assert_int_equal(messages[1].sender, getpid());
    assert_int_equal(messages[2].sender, getpid());
    char text[32], expected[32];
    snprintf(expected, sizeof expected, "pid %d", (int)child);
    transport_sender_text(receiver, messages[0].sender, text, sizeof text);
    assert_string_equal(text, expected);
    transport_close(sender);
    transport_close(receiver);
}

static void test_descriptors_that_a_sender_attaches_are_not_kept(void** state)
{
    (void)state;
    transport*         receiver = open_or_fail(TRANSPORT_STATES);
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    union {
        struct cmsghdr head;
        char           bytes[CMSG_SPACE(sizeof(int))];
    } control = { .head = { .cmsg_len = CMSG_LEN(sizeof(int)), .cmsg_level = SOL_SOCKET,
                            .cmsg_type = SCM_RIGHTS } };
    memcpy(CMSG_DATA(&control.head), &(int){ STDIN_FILENO }, sizeof(int));
    struct iovec        part = { .iov_base = address.sun_path, .iov_len = 5 };
    const struct msghdr datagram = {
        .msg_name = &address, .msg_namelen = sizeof address, .msg_iov = &part, .msg_iovlen = 1,
        .msg_control = &control, .msg_controllen = sizeof control.bytes,
    };
    const int fd = socket(AF_UNIX, SOCK_DGRAM, 0);
    const int next = dup(fd); // the lowest free number
    close(next);
    assert_int_equal(sendmsg(fd, &datagram, 0), 5);
    assert_int_equal(next_id(receiver), -1);
    assert_int_equal(transport_statistics(receiver).malformed, 1);
    assert_int_equal(fcntl(next, F_GETFD), -1);
    close(fd);
    transport_close(receiver);
}

// ---------------------------------------------------------------- what is refused

static void test_a_bus_for_both_directions_is_refused(void** state)
{
    (void)state;
    check_refused(url, TRANSPORT_PLANS | TRANSPORT_SENDS_STATES, TRANSPORT_BAD_URL,
                  "one direction");
    assert_false(exists());
    transport* receiver = open_or_fail(TRANSPORT_STATES);
    assert_int_equal(send_state(receiver, 7), -1);
    assert_int_equal(transport_statistics(receiver).errors, 1);
    assert_int_equal(next_id(receiver), -1);
    transport_close(receiver);
}

static void test_a_path_has_at_most_100_characters_and_may_be_relative(void** state)
{
    (void)state;
    char here[256], name[120] = "unix:";
    memset(name + 5, 'a', 101);
    assert_non_null(getcwd(here, sizeof here));
    assert_int_equal(chdir(folder), 0);
    check_refused(name, TRANSPORT_STATES, TRANSPORT_BAD_URL, "1 to 100 characters");
    name[5 + 100] = '\0';
    transport* bus = NULL;
    char       error[256];
    assert_int_equal(transport_open(&bus, name, TRANSPORT_STATES, error, sizeof error), 0);
    assert_int_equal(access(name + 5, F_OK), 0);
    transport_close(bus);
    assert_int_equal(access(name + 5, F_OK), -1);
    assert_int_equal(chdir(here), 0);
}

static void test_a_missing_folder_is_named(void** state)
{
    (void)state;
    check_refused("unix:/nowhere/at/all", TRANSPORT_STATES, TRANSPORT_UNAVAILABLE,
                  "No such file");
}

/// Root without the right to ignore modes.
static bool obey_modes(void)
{
    struct __user_cap_header_struct head = { .version = _LINUX_CAPABILITY_VERSION_3 };
    struct __user_cap_data_struct   none[2] = { { 0 } };
    return syscall(SYS_capset, &head, none) == 0;
}

static bool is_not_permitted(void)
{
    char       error[256];
    transport *sender, *receiver;
    if (!obey_modes() || chmod(path, 0) != 0) {
        return false;
    }
    sender = open_with_log(TRANSPORT_SENDS_STATES);
    const bool refused = send_state(sender, 7) == -1 && next_id(sender) == -1 &&
                         strstr(complaint, strerror(EACCES)) != NULL;
    transport_close(sender);
    // What may not be asked whether it is in use is not replaced.
    return refused &&
           transport_open(&receiver, url, TRANSPORT_STATES, error, sizeof error) ==
               TRANSPORT_UNAVAILABLE &&
           strstr(error, "may not replace") != NULL && exists();
}

static bool folder_is_not_permitted(void)
{
    char       error[256];
    transport* receiver;
    return obey_modes() && chmod(folder, 0500) == 0 &&
           transport_open(&receiver, url, TRANSPORT_STATES, error, sizeof error) ==
               TRANSPORT_UNAVAILABLE &&
           strstr(error, strerror(EACCES)) != NULL && chmod(folder, 0700) == 0;
}

static void test_a_program_without_permission_neither_sends_nor_receives(void** state)
{
    (void)state;
    static transport* receiver; // reachable from the child, for valgrind
    receiver = open_or_fail(TRANSPORT_STATES);
    in_another_program(is_not_permitted);
    assert_int_equal(next_id(receiver), -1);
    transport_close(receiver);
    in_another_program(folder_is_not_permitted);
}

static void test_it_is_not_exposed(void** state)
{
    (void)state;
    char words[256];
    assert_null(transport_url_fault(url));
    assert_false(transport_exposed(url, NULL, words, sizeof words));
}

static int make_folder(void** state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/own", folder);
    snprintf(url, sizeof url, "unix:%s", path);
    return 0;
}

static int remove_folder(void** state)
{
    (void)state;
    unlink(path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_socket_has_mode_0660_whatever_the_umask_and_is_removed_at_close),
        cmocka_unit_test(test_a_sender_makes_and_removes_no_file),
        cmocka_unit_test(test_a_socket_of_an_ended_program_is_replaced),
        cmocka_unit_test(test_a_socket_in_use_is_refused_and_stays_in_use),
        cmocka_unit_test(test_a_file_that_is_no_socket_is_refused_and_stays),
        cmocka_unit_test(test_a_removed_socket_comes_back_under_the_same_descriptor),
        cmocka_unit_test(test_a_path_that_another_program_took_is_left_to_it_and_reported),
        cmocka_unit_test(test_a_receiver_that_starts_later_or_again_is_reached),
        cmocka_unit_test(test_a_trajectory_reaches_its_receiver_whole),
        cmocka_unit_test(test_a_full_queue_fails_at_once_and_sending_works_again_after_it),
        cmocka_unit_test(test_a_sender_is_the_process_that_sent),
        cmocka_unit_test(test_descriptors_that_a_sender_attaches_are_not_kept),
        cmocka_unit_test(test_a_bus_for_both_directions_is_refused),
        cmocka_unit_test(test_a_path_has_at_most_100_characters_and_may_be_relative),
        cmocka_unit_test(test_a_missing_folder_is_named),
        cmocka_unit_test(test_a_program_without_permission_neither_sends_nor_receives),
        cmocka_unit_test(test_it_is_not_exposed),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
