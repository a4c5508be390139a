/// Goal: an output file is complete or absent.
/// Method: the content of an own folder is compared before, during and after.
#include "check.h"

#include "common/output.h"

#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

static char folder[] = "/tmp/verge_output_XXXXXX";

static int set_up(void** state)
{
    (void)state;
    strcpy(folder + sizeof folder - 7, "XXXXXX");
    return mkdtemp(folder) == NULL || chdir(folder) != 0;
}

static int tear_down(void** state)
{
    (void)state;
    unlink("run");
    return chdir("/") != 0 || rmdir(folder) != 0; // fails where something was left behind
}

static void check_content(const char* expected)
{
    char  text[64] = "";
    FILE* file = fopen("run", "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(text, expected);
}

static void test_a_file_appears_when_it_is_complete(void** state)
{
    (void)state;
    output out;
    assert_true(output_open(&out, "run"));
    fputs("all of it", out.stream);
    fflush(out.stream);
    assert_int_not_equal(access("run", F_OK), 0);
    assert_true(output_close(&out));
    check_content("all of it");
}

static void test_a_file_without_a_name_is_refused_before_the_work(void** state)
{
    (void)state;
    output out;
    assert_false(output_open(&out, ""));
    output_abandon(&out); // nothing is open: harmless
}

static void test_an_abandoned_output_leaves_only_the_old_file(void** state)
{
    (void)state;
    output out;
    assert_true(output_open(&out, "run"));
    fputs("old", out.stream);
    assert_true(output_close(&out));
    assert_true(output_open(&out, "run"));
    fputs("half of the ne", out.stream);
    output_abandon(&out);
    output_abandon(&out); // harmless
    check_content("old");
}

static void test_a_device_is_written_and_stays_one(void** state)
{
    (void)state;
    output out;
    assert_true(output_open(&out, "/dev/null"));
    fputs("gone", out.stream);
    assert_true(output_close(&out));
    assert_int_equal(access("/dev/null", W_OK), 0);
    assert_true(output_open(&out, "/dev/full"));
    fputs("no room", out.stream);
    assert_false(output_close(&out));
    assert_false(output_open(&out, "/"));
    assert_false(output_open(&out, "no/such/folder/run"));
}

static void test_a_signal_takes_the_partial_file_away(void** state)
{
    (void)state;
    const pid_t child = fork();
    if (child == 0) {
        output out;
        output_guard_signals();
        if (output_open(&out, "run")) {
            fputs("half", out.stream);
            fflush(out.stream);
            raise(SIGTERM);
        }
        _exit(0);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGTERM);
    assert_int_not_equal(access("run", F_OK), 0); // tear_down sees to the rest
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_file_appears_when_it_is_complete, set_up, tear_down),
        cmocka_unit_test_setup_teardown(
            test_a_file_without_a_name_is_refused_before_the_work, set_up, tear_down),
        cmocka_unit_test_setup_teardown(
            test_an_abandoned_output_leaves_only_the_old_file, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_device_is_written_and_stays_one, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_signal_takes_the_partial_file_away, set_up,
                                        tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
