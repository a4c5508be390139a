/// Goal: a program reads regular files only. A file of another kind is refused at once, and its
/// kind is named. A file above the size limit is refused before it is read.
/// Method: real FIFOs, folders, sockets, devices and a sparse file. An alarm ends a test that
/// waits.
#define _GNU_SOURCE
#include "check.h"

#include "common/input.h"
#include "common/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { PATIENCE_S = 60 };

static char folder[] = "/tmp/verge-input-XXXXXX";

static const char* path_of(const char* name)
{
    static char path[80];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void test_a_file_that_is_not_regular_is_refused_with_its_kind(void** state)
{
    (void)state;
    static const struct { const char *name, *reason; } CASES[] = {
        { "fifo", "not a regular file" }, { "folder", "a directory" },
        { "socket", "No such device or address" }, { "none", "No such file or directory" },
        { "zero", "not a regular file" }, { "to-fifo", "not a regular file" },
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; ++i) {
        const char* reason = NULL;
        assert_null(input_open(path_of(CASES[i].name), &reason));
        assert_string_equal(reason, CASES[i].reason);
        json_file file;
        assert_false(json_file_load(&file, path_of(CASES[i].name)));
        assert_true(file.missing);
        assert_non_null(strstr(file.error, CASES[i].reason));
        assert_ptr_equal(strchr(file.error, '\n'), file.error + strlen(file.error) - 1);
    }
}

static void test_a_file_above_the_limit_is_refused(void** state)
{
    (void)state;
    FILE* out = fopen(path_of("large"), "w");
    assert_non_null(out);
    assert_int_equal(ftruncate(fileno(out), (off_t)JSON_FILE_SIZE_MAX + 1), 0);
    fclose(out);
    json_file file;
    assert_false(json_file_load(&file, path_of("large")));
    assert_non_null(strstr(file.error, "too large"));
}

static void test_a_regular_file_is_read(void** state)
{
    (void)state;
    FILE* out = fopen(path_of("good"), "w");
    assert_non_null(out);
    fputs("{ \"a\": 1 }", out);
    fclose(out);
    json_file file;
    assert_true(json_file_load(&file, path_of("good")));
    json_file_free(&file);
}

static int make_places(void** state)
{
    (void)state;
    alarm(PATIENCE_S);
    if (mkdtemp(folder) == NULL || mkfifo(path_of("fifo"), 0600) != 0 ||
        mkdir(path_of("folder"), 0700) != 0 || symlink("/dev/zero", path_of("zero")) != 0 ||
        symlink("fifo", path_of("to-fifo")) != 0) {
        return -1;
    }
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s/socket", folder);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int bound = bind(fd, (const struct sockaddr*)&address, sizeof address);
    close(fd);
    return bound;
}

static int remove_places(void** state)
{
    (void)state;
    static const char* const NAMES[] = { "fifo", "socket", "zero", "to-fifo", "large", "good" };
    for (size_t i = 0; i < sizeof NAMES / sizeof NAMES[0]; ++i) {
        unlink(path_of(NAMES[i]));
    }
    return rmdir(path_of("folder")) | rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_file_that_is_not_regular_is_refused_with_its_kind),
        cmocka_unit_test(test_a_file_above_the_limit_is_refused),
        cmocka_unit_test(test_a_regular_file_is_read),
    };
    return cmocka_run_group_tests(tests, make_places, remove_places);
}
