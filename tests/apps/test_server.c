/// Goal: a server answers each client, waits for none, and removes its socket at the end. A file is
/// replaced completely or not at all.
/// Method: clients in the same thread on real sockets, served step by step; clients that send
/// pieces, too much or nothing, or do not read; the test supplies the time.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/replace.h"
#include "daemon/server.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { ANSWER = 300000, STEPS = 2000 };

static char folder[] = "/tmp/verge-server-XXXXXX";

static const char* path_of(const char* name)
{
    static char paths[4][80];
    static unsigned next;
    char* path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static bool due;

/// "large": more than a socket's buffers hold; "none": an answer that does not fit; "later": one
/// that takes until it is due.
static bool on_request(void* context, const char* request, uint64_t* ticket, text* answer)
{
    int* asked = context;
    (*asked)++;
    if (request != NULL && strcmp(request, "later") == 0 && !due) {
        text_add(answer, "not to be sent");
        ++*ticket;
        return false;
    }
    if (request == NULL) {
        text_add(answer, "what?\n");
    } else if (strcmp(request, "large") == 0) {
        text_add(answer, "%*d\n", ANSWER / 2, 1);
    } else if (strcmp(request, "none") == 0) {
        text_add(answer, "%*d\n", ANSWER * 2, 1);
    } else {
        text_add(answer, "%s!\n", request);
    }
    return true;
}

static server* open_server(const char* path, int* asked)
{
    const server_def def = { "\n", ANSWER, on_request, asked };
    server* self = NULL;
    char error[256];
    if (!server_open_unix(&self, &def, path, error, sizeof error)) {
        fail_msg("%s", error);
    }
    return self;
}

static int connect_to(const char* path)
{
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    assert_int_equal(connect(fd, (const struct sockaddr*)&address, sizeof address), 0);
    return fd;
}

static void say(int fd, const char* words)
{
    assert_int_equal(send(fd, words, strlen(words), MSG_NOSIGNAL), strlen(words));
}

/// Serves until the client's connection ends and returns its answer. Null: it did not end.
static const char* answer_of(server* self, int fd, int64_t now)
{
    static char got[ANSWER + 1];
    size_t size = 0;
    for (int step = 0; step < STEPS; ++step) {
        server_serve(self, now);
        const ssize_t part = recv(fd, got + size, ANSWER - size, 0);
        size += part > 0 ? (size_t)part : 0;
        if (part == 0 || (part < 0 && errno != EAGAIN)) {
            got[size] = '\0';
            close(fd);
            return got;
        }
    }
    return NULL;
}

static void test_a_request_is_answered_however_it_is_split(void** state)
{
    (void)state;
    int asked = 0;
    server* self = open_server(path_of("a.sock"), &asked);
    int fd = connect_to(path_of("a.sock"));
    say(fd, "hel");
    server_serve(self, 0);
    server_serve(self, 1);
    say(fd, "lo");
    server_serve(self, 2);
    assert_int_equal(asked, 0);
    say(fd, "\nand more");
    assert_string_equal(answer_of(self, fd, 3), "hello!\n");
    assert_int_equal(asked, 1);

    fd = connect_to(path_of("a.sock"));
    say(fd, "large\n");
    assert_int_equal(strlen(answer_of(self, fd, 4)), ANSWER / 2 + 1);
    fd = connect_to(path_of("a.sock"));
    say(fd, "none\n");
    assert_string_equal(answer_of(self, fd, 5), ""); // rather nothing than a part
    server_close(self);
    assert_int_equal(access(path_of("a.sock"), F_OK), -1);
}

static void test_unknown_requests_get_an_error_and_silent_clients_a_time_limit(void** state)
{
    (void)state;
    int asked = 0;
    static char flood[SERVER_REQUEST * 4];
    memset(flood, 'x', sizeof flood - 1);
    server* self = open_server(path_of("b.sock"), &asked);
    int fd = connect_to(path_of("b.sock"));
    say(fd, flood);
    assert_string_equal(answer_of(self, fd, 0), "what?\n");
    fd = connect_to(path_of("b.sock"));
    assert_int_equal(send(fd, "a\0b", 3, 0), 3);
    assert_string_equal(answer_of(self, fd, 0), "what?\n");

    fd = connect_to(path_of("b.sock"));
    say(fd, "hal");
    server_serve(self, 10);
    assert_null(answer_of(self, fd, 10 + SERVER_PATIENCE_US));
    assert_string_equal(answer_of(self, fd, 11 + SERVER_PATIENCE_US), "");

    fd = connect_to(path_of("b.sock")); // gone before it has asked
    close(fd);
    server_serve(self, 20);
    server_serve(self, 20);
    fd = connect_to(path_of("b.sock"));
    say(fd, "still\n");
    assert_string_equal(answer_of(self, fd, 30), "still!\n");
    server_close(self);
}

static void test_more_clients_than_places_wait_their_turn(void** state)
{
    (void)state;
    int asked = 0;
    server* self = open_server(path_of("c.sock"), &asked);
    int silent[SERVER_CLIENTS];
    for (int i = 0; i < SERVER_CLIENTS; ++i) {
        silent[i] = connect_to(path_of("c.sock"));
    }
    server_serve(self, 0);
    struct pollfd ends[SERVER_ENDS];
    assert_int_equal(server_ends(self, ends), SERVER_CLIENTS); // no new client is accepted
    const int fd = connect_to(path_of("c.sock"));
    say(fd, "patient\n");
    assert_null(answer_of(self, fd, 1));
    assert_string_equal(answer_of(self, fd, 1 + SERVER_PATIENCE_US), "patient!\n");
    for (int i = 0; i < SERVER_CLIENTS; ++i) {
        close(silent[i]);
    }
    server_serve(self, 2 + SERVER_PATIENCE_US);
    assert_int_equal(server_ends(self, ends), 1);
    server_close(self);
    assert_int_equal(server_ends(NULL, ends), 0);
    server_serve(NULL, 0);
    server_close(NULL);
}

static void test_a_socket_in_use_and_a_file_of_another_kind_are_not_replaced(void** state)
{
    (void)state;
    int asked = 0;
    char error[256];
    const server_def def = { "\n", 100, on_request, &asked };
    server* first = open_server(path_of("d.sock"), &asked);
    struct stat facts;
    assert_int_equal(stat(path_of("d.sock"), &facts), 0);
    assert_int_equal(facts.st_mode & 07777, 0660);
    server* second = NULL;
    assert_false(server_open_unix(&second, &def, path_of("d.sock"), error, sizeof error));
    assert_null(second);
    assert_non_null(strstr(error, "another daemon"));
    assert_int_equal(stat(path_of("d.sock"), &facts), 0);
    server_close(first);

    FILE* file = fopen(path_of("d.sock"), "w");
    fclose(file);
    assert_false(server_open_unix(&second, &def, path_of("d.sock"), error, sizeof error));
    assert_non_null(strstr(error, "no socket"));
    assert_int_equal(remove(path_of("d.sock")), 0);
    assert_false(server_open_unix(&second, &def, path_of("no/e.sock"), error, sizeof error));

    // The socket of a daemon that was killed: bound, without a listener.
    const int dead = socket(AF_UNIX, SOCK_STREAM, 0);
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path_of("d.sock"));
    assert_int_equal(bind(dead, (const struct sockaddr*)&address, sizeof address), 0);
    close(dead);
    server_close(open_server(path_of("d.sock"), &asked));
}

static void test_a_port_that_is_taken_is_refused(void** state)
{
    (void)state;
    int asked = 0;
    char error[256];
    const server_def def = { "\r\n\r\n", 100, on_request, &asked };
    struct sockaddr_in address = { .sin_family = AF_INET,
                                   .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t size = sizeof address;
    const int holder = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(holder, (const struct sockaddr*)&address, size), 0);
    assert_int_equal(listen(holder, 1), 0);
    assert_int_equal(getsockname(holder, (struct sockaddr*)&address, &size), 0);
    server* self = NULL;
    assert_false(server_open_tcp(&self, &def, (struct sockaddr*)&address, size, error,
                                 sizeof error));
    assert_null(self);
    close(holder);
    assert_true(server_open_tcp(&self, &def, (struct sockaddr*)&address, size, error,
                                sizeof error));
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(connect(fd, (const struct sockaddr*)&address, size), 0);
    fcntl(fd, F_SETFL, O_NONBLOCK);
    say(fd, "GET /\r\nHost: x\r\n\r\n");
    const char* answer = NULL;
    for (int i = 0; i < 1000 && answer == NULL; ++i) {
        answer = answer_of(self, fd, 0);
    }
    assert_string_equal(answer, "GET /\r\nHost: x!\n");
    server_close(self);
}

// ---- files, the manager -------------------------------------------------------------------

static void test_a_file_is_replaced_completely_or_not_at_all(void** state)
{
    (void)state;
    char words[16] = "";
    assert_int_equal(replace_file(path_of("f"), "first", 5), 0);
    assert_int_equal(replace_file(path_of("f"), "2nd", 3), 0);
    FILE* file = fopen(path_of("f"), "r");
    assert_non_null(fgets(words, sizeof words, file));
    fclose(file);
    assert_string_equal(words, "2nd");
    assert_int_equal(replace_file(path_of("no/f"), "x", 1), ENOENT);
    static char longest[5000];
    memset(longest, 'x', sizeof longest - 1);
    assert_int_equal(replace_file(longest, "x", 1), ENAMETOOLONG);
    // Somebody's link in its place is not followed, and a FIFO is not waited for.
    assert_int_equal(symlink(path_of("f"), path_of("g.tmp")), 0);
    assert_int_equal(replace_file(path_of("g"), "link", 4), 0);
    assert_int_equal(mkfifo(path_of("g.tmp"), 0600), 0);
    assert_int_equal(replace_file(path_of("g"), "fifo", 4), 0);
    file = fopen(path_of("f"), "r");
    assert_non_null(fgets(words, sizeof words, file));
    fclose(file);
    assert_string_equal(words, "2nd");
    assert_int_equal(mkdir(path_of("g.tmp"), 0700), 0);
    assert_int_equal(replace_file(path_of("g"), "x", 1), EEXIST);
    assert_int_equal(rmdir(path_of("g.tmp")), 0);
    assert_int_equal(remove(path_of("g")), 0);
    assert_int_equal(remove(path_of("f")), 0);
}

static void test_an_answer_may_come_any_time_later(void** state)
{
    (void)state;
    int asked = 0;
    due = false;
    server* self = open_server(path_of("l.sock"), &asked);
    const int fd = connect_to(path_of("l.sock"));
    say(fd, "later\n");
    int64_t now = 0;
    for (int i = 0; i < 10; i++, now += SERVER_PATIENCE_US) {
        server_serve(self, now);
    }
    assert_int_equal(asked, 10);
    struct pollfd ends[SERVER_ENDS];
    assert_int_equal(server_ends(self, ends), 2);
    assert_int_equal(poll(ends, 1, 0), 0); // a waiting client causes no wake-ups
    due = true;
    assert_string_equal(answer_of(self, fd, now), "later!\n");

    due = false;
    const int gone = connect_to(path_of("l.sock"));
    say(gone, "later\n");
    server_serve(self, now);
    close(gone);
    server_serve(self, now);
    assert_int_equal(server_ends(self, ends), 1); // it waits for nothing any more
    server_close(self);
}

static int make_folder(void** state)
{
    (void)state;
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
        cmocka_unit_test(test_a_request_is_answered_however_it_is_split),
        cmocka_unit_test(test_unknown_requests_get_an_error_and_silent_clients_a_time_limit),
        cmocka_unit_test(test_more_clients_than_places_wait_their_turn),
        cmocka_unit_test(test_a_socket_in_use_and_a_file_of_another_kind_are_not_replaced),
        cmocka_unit_test(test_a_port_that_is_taken_is_refused),
        cmocka_unit_test(test_a_file_is_replaced_completely_or_not_at_all),
        cmocka_unit_test(test_an_answer_may_come_any_time_later),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
