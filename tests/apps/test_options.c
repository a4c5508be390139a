/// Goal: options are accepted in any order, with their value after a space or "=", and with one
/// argument or none. A fault gives one line on standard error and the given exit status.
/// Method: tables of command lines; standard error is read back from a file.
#define _GNU_SOURCE
#include "check.h"

#include "common/options.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { WRONG = 64, WORDS_MAX = 8 };

typedef struct result {
    const char* out;
    const char* seed;
    bool        quiet;
    const char* argument;
    int         status;
    bool        parsed;
    char        printed[512]; ///< on standard error
    char        shown[2048];  ///< on standard output
} result;

static int stream_divert(FILE* stream, FILE* into)
{
    fflush(stream);
    const int kept = dup(fileno(stream));
    dup2(fileno(into), fileno(stream));
    return kept;
}

static void stream_restore(FILE* stream, int kept, FILE* from, char* text, size_t size)
{
    fflush(stream);
    dup2(kept, fileno(stream));
    close(kept);
    rewind(from);
    text[fread(text, 1, size - 1, from)] = '\0';
    fclose(from);
}

/// Parses words; argument null: the program takes none.
static result parse(const char* argument, const char* const* words)
{
    result r = { .status = -1 };
    const option_entry table[] = {
        { "--out", "FILE", "writes there", &r.out, NULL },
        { "--seed", "N", "a number", &r.seed, NULL },
        { "--quiet", NULL, "says nothing", NULL, &r.quiet },
    };
    const program self = { "verge-x", argument, "does x.", table, 3, WRONG };
    char* argv[WORDS_MAX + 2] = { (char*)"verge-x" };
    int   argc = 1;
    for (; words[argc - 1] != NULL; ++argc) {
        argv[argc] = (char*)words[argc - 1];
    }
    FILE* errors = tmpfile();
    FILE* output = tmpfile();
    const int kept_errors = stream_divert(stderr, errors);
    const int kept_output = stream_divert(stdout, output);
    r.parsed = options_parse(&self, argc, argv, &r.argument, &r.status);
    stream_restore(stdout, kept_output, output, r.shown, sizeof r.shown);
    stream_restore(stderr, kept_errors, errors, r.printed, sizeof r.printed);
    return r;
}
#define PARSE(argument, ...) parse(argument, (const char* const[]){ __VA_ARGS__, NULL })

static void test_options_and_the_argument_come_in_any_order(void** state)
{
    (void)state;
    const char* const lines[][5] = {
        { "a.json", "--out", "o", "--quiet", NULL }, { "--out", "o", "a.json", "--quiet", NULL },
        { "--quiet", "--out=o", "a.json", NULL },    { "--out=o", "--quiet", "--", "a.json", NULL },
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; ++i) {
        const result r = parse("FILE", lines[i]);
        assert_true(r.parsed);
        assert_string_equal(r.out, "o");
        assert_true(r.quiet && r.seed == NULL);
        assert_string_equal(r.argument, "a.json");
        assert_string_equal(r.printed, "");
    }
}

static void test_a_value_may_be_anything(void** state)
{
    (void)state;
    const char* const values[] = { "", "-1", "--quiet", "a=b", "=", "a b" };
    for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
        char joined[32];
        snprintf(joined, sizeof joined, "--out=%s", values[i]);
        const result one = PARSE(NULL, joined);
        assert_true(one.parsed && !one.quiet);
        assert_string_equal(one.out, values[i]);
        const result two = PARSE(NULL, "--out", values[i]);
        assert_true(two.parsed && !two.quiet);
        assert_string_equal(two.out, values[i]);
    }
    const result last = PARSE(NULL, "--out", "first", "--out", "second");
    assert_string_equal(last.out, "second");
}

static void test_after_two_dashes_everything_is_the_argument(void** state)
{
    (void)state;
    assert_string_equal(PARSE("FILE", "--", "--quiet").argument, "--quiet");
    assert_string_equal(PARSE("FILE", "--", "--").argument, "--");
    assert_string_equal(PARSE("FILE", "-").argument, "-"); // a file, as everywhere
}

static void test_a_wrong_command_line_is_one_line_and_its_status(void** state)
{
    (void)state;
    const struct { const char* argument; const char* words[4]; const char* line; } cases[] = {
        { "FILE", { NULL }, "verge-x:FILE: missing, expected one (see --help)\n" },
        { "FILE", { "a", "b" }, "verge-x:b: one argument too many, expected one\n" },
        { NULL, { "a" }, "verge-x:a: an argument, expected options only\n" },
        { NULL, { "--" , "a" }, "verge-x:a: an argument, expected options only\n" },
        { NULL, { "--what" },
          "verge-x:--what: unknown option, expected one that --help lists\n" },
        { NULL, { "-q" }, "verge-x:-q: unknown option, expected one that --help lists\n" },
        { NULL, { "--ou=o" },
          "verge-x:--ou=o: unknown option, expected one that --help lists\n" },
        { NULL, { "--outer", "o" },
          "verge-x:--outer: unknown option, expected one that --help lists\n" },
        { NULL, { "--quiet=yes" }, "verge-x:--quiet=yes: takes no value, expected the option alone\n" },
        { NULL, { "--quiet", "--out" },
          "verge-x:--out: a value is missing, expected one after it\n" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        const result r = parse(cases[i].argument, cases[i].words);
        assert_false(r.parsed);
        assert_int_equal(r.status, WRONG);
        assert_string_equal(r.printed, cases[i].line);
        assert_string_equal(r.shown, "");
    }
}

static void test_help_and_version_exit_with_zero_at_any_position(void** state)
{
    (void)state;
    const result help = PARSE("FILE", "--quiet", "--help");
    assert_false(help.parsed);
    assert_int_equal(help.status, 0);
    const char* const parts[] = { "usage: verge-x [options] FILE\n", "does x.", "--out FILE",
                                  "writes there", "--seed N", "--quiet", "--help", "--version" };
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; ++i) {
        assert_non_null(strstr(help.shown, parts[i]));
    }
    const result version = PARSE("FILE", "--version");
    assert_int_equal(version.status, 0);
    assert_int_equal(strncmp(version.shown, "verge-x ", 8), 0);
    assert_string_equal(help.printed, "");
    assert_string_equal(version.printed, "");
}

static void test_a_number_is_digits_alone_and_fits(void** state)
{
    (void)state;
    const program self = { .name = "verge-x" };
    const struct { const char* text; bool good; uint64_t value; } cases[] = {
        { "0", true, 0 }, { "007", true, 7 }, { "18446744073709551615", true, UINT64_MAX },
        { "18446744073709551616", false, 0 }, { "", false, 0 }, { "-1", false, 0 },
        { "+1", false, 0 }, { " 1", false, 0 }, { "1 ", false, 0 }, { "1.0", false, 0 },
        { "0x10", false, 0 }, { "1e3", false, 0 }, { "one", false, 0 },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        uint64_t value = 99;
        bool     given = false;
        char     printed[256];
        FILE*    errors = tmpfile();
        const int  kept = stream_divert(stderr, errors);
        const bool good = options_u64(&self, "--seed", cases[i].text, &value, &given);
        stream_restore(stderr, kept, errors, printed, sizeof printed);
        assert_int_equal(good, cases[i].good);
        assert_true(given);
        assert_true(value == (good ? cases[i].value : 99));
        assert_int_equal(strlen(printed) > 0, !good);
        assert_int_equal(strncmp(printed, "verge-x:--seed: is \"", 20) == 0, !good);
    }
    uint64_t value = 99;
    bool     given = true;
    assert_true(options_u64(&self, "--seed", NULL, &value, &given));
    assert_true(!given && value == 99);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_options_and_the_argument_come_in_any_order),
        cmocka_unit_test(test_a_value_may_be_anything),
        cmocka_unit_test(test_after_two_dashes_everything_is_the_argument),
        cmocka_unit_test(test_a_wrong_command_line_is_one_line_and_its_status),
        cmocka_unit_test(test_help_and_version_exit_with_zero_at_any_position),
        cmocka_unit_test(test_a_number_is_digits_alone_and_fits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
