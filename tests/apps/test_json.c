/// Goal: the error line of a wrong file names the place, the fault and what was expected. Valid
/// JSON is read unchanged.
/// Method: tables of texts that are not JSON, each with the line and text of its fault; tables of
/// values of the wrong type or range, each with its field; a document with random characters
/// removed, added or replaced: the error line has the documented form.
#define _GNU_SOURCE
#include "check.h"
#include "rng.h"

#include "common/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

/// The error line of a text; to be freed. "" where it is read.
static char* error_of(const char* text, size_t size)
{
    json_file file;
    if (json_file_parse(&file, "a.json", text, size)) {
        json_file_free(&file);
        return strdup("");
    }
    return strdup(file.error);
}

typedef struct wrong_text {
    const char* text;
    const char* line; ///< the whole line, without its end
} wrong_text;

static void check_refused(const wrong_text* cases, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        char  expected[JSON_ERROR_SIZE];
        char* error = error_of(cases[i].text, strlen(cases[i].text));
        snprintf(expected, sizeof expected, "%s\n", cases[i].line);
        assert_string_equal(error, expected);
        free(error);
    }
}
#define REFUSED(cases) check_refused(cases, sizeof(cases) / sizeof(cases)[0])

#define VALUE "a value: a number, a string, true, false, null, an object or an array"

static void test_the_character_that_separates_values_is_named(void** state)
{
    (void)state;
    const wrong_text cases[] = {
        { "{\n\"a\": 1,\n}", "a.json:2: a comma before \"}\", expected no comma after the last member" },
        { "[1,\n2,\n\n]", "a.json:2: a comma before \"]\", expected no comma after the last element" },
        { "{\"a\": [1, 2], \"b\": {\"c\": 1,}}",
          "a.json:1: a comma before \"}\", expected no comma after the last member" },
        { "[1,,2]", "a.json:1: found \",\", expected " VALUE },
        { "[,]", "a.json:1: found \",\", expected " VALUE },
        { "{\"a\": 1,, \"b\": 2}", "a.json:1: found \",\", expected a key in double quotes" },
        { "{\"a\": 1\n\"b\": 2}",
          "a.json:2: found the string \"b\", expected \",\" or \"}\" after a value" },
        { "[1 2]", "a.json:1: found \"2\", expected \",\" or \"]\" after a value" },
        { "[1;2]", "a.json:1: \"1;2\" is not a JSON number, expected one like 15, 15.0 or 1e-3" },
        { "{\"a\" 1}", "a.json:1: found \"1\", expected \":\" after a key" },
        { "{\"a\" = 1}", "a.json:1: found \"=\", expected \":\" after a key" },
        { "{\"a\", 1}", "a.json:1: found \",\", expected \":\" after a key" },
        { "{\"a\":}", "a.json:1: found \"}\", expected " VALUE },
        { "[1}", "a.json:1: found \"}\", expected \",\" or \"]\" after a value" },
        { "{\"a\": 1]", "a.json:1: found \"]\", expected \",\" or \"}\" after a value" },
        { "{} {}", "a.json:1: found \"{\", expected the end of the file after the document" },
        { "[1]]", "a.json:1: found \"]\", expected the end of the file after the document" },
    };
    REFUSED(cases);
}

static void test_a_text_that_ends_too_early_names_the_open_bracket(void** state)
{
    (void)state;
    const wrong_text cases[] = {
        { "", "a.json:1: is empty, expected a JSON document" },
        { " \n\n", "a.json:3: is empty, expected a JSON document" },
        { "{", "a.json:1: ends too early: the \"{\" of line 1 is not closed, expected a key in"
               " double quotes" },
        { "{\n\"a\": [1,\n 2\n", "a.json:4: ends too early: the \"[\" of line 2 is not closed,"
                                 " expected \",\" or \"]\" after a value" },
        { "\n{\"a\": [1, 2]", "a.json:2: ends too early: the \"{\" of line 2 is not closed,"
                              " expected \",\" or \"}\" after a value" },
        { "{\"a\":", "a.json:1: ends too early: the \"{\" of line 1 is not closed, expected " VALUE },
        { "[1,", "a.json:1: ends too early: the \"[\" of line 1 is not closed, expected " VALUE },
        { "{\"a\": \"b", "a.json:1: a string that does not end on its line, expected its closing"
                         " quote" },
    };
    REFUSED(cases);
}

static void test_text_in_other_languages_is_shown(void** state)
{
    (void)state;
    const wrong_text cases[] = {
        { "{a: 1}", "a.json:1: found \"a\", expected a key in double quotes" },
        { "{'a': 1}", "a.json:1: found \"'a'\", expected a key in double quotes" },
        { "{\"a\": True}", "a.json:1: found \"True\", expected " VALUE },
        { "{\"a\": None}", "a.json:1: found \"None\", expected " VALUE },
        { "{\"a\": NaN}", "a.json:1: found \"NaN\", expected " VALUE },
        { "{\"a\": -Infinity}",
          "a.json:1: \"-Infinity\" is not a JSON number, expected one like 15, 15.0 or 1e-3" },
        { "{\"a\": 'b'}", "a.json:1: found \"'b'\", expected " VALUE },
        { "{\"a\": 0x1f}",
          "a.json:1: \"0x1f\" is not a JSON number, expected one like 15, 15.0 or 1e-3" },
        { "[1.]", "a.json:1: \"1.\" is not a JSON number, expected one like 15, 15.0 or 1e-3" },
        { "[1,5.e3]", "a.json:1: \"5.e3\" is not a JSON number, expected one like 15, 15.0 or 1e-3" },
        { "// hello\n{}", "a.json:1: a comment, which JSON does not have, expected " VALUE },
        { "{\"a\": 1, /* b */ \"c\": 2}",
          "a.json:1: a comment, which JSON does not have, expected a key in double quotes" },
        { "{\"a\": \"b\nc\"}",
          "a.json:1: a string that does not end on its line, expected its closing quote" },
        { "[\"a\tb\"]", "a.json:1: a control character in a string, expected it escaped as \\u0009" },
        { "[\"\\x41\"]", "a.json:1: \"\\x\" is not a JSON escape, expected one of"
                         " \\\" \\\\ \\/ \\b \\f \\n \\r \\t \\u" },
        { "[\"\\ud800\"]", "a.json:1: \"\\ud800\" is not a character, expected \\u and four hexadecimal"
                           " digits, above ffff a pair of them" },
        { "[\"\\u0000\"]", "a.json:1: \"\\u0000\" is not a character, expected \\u and four hexadecimal"
                           " digits, above ffff a pair of them" },
        { "\x7f", "a.json:1: found \"?\", expected " VALUE },
    };
    REFUSED(cases);
}

static void test_a_byte_that_is_no_text_names_its_line(void** state)
{
    (void)state;
    const char* const bytes[] = { "\xff", "\xc0\x80", "\xed\xa0", "\xf5\x80\x80\x80", "\x80" };
    for (size_t i = 0; i < sizeof bytes / sizeof bytes[0]; ++i) {
        char text[32];
        snprintf(text, sizeof text, "[\n\"%s\"]", bytes[i]);
        char* error = error_of(text, strlen(text));
        assert_string_equal(error, "a.json:2: not text, expected JSON in UTF-8\n");
        free(error);
    }
    char* error = error_of("[1]\0", 4); // a byte of zero is no text either
    assert_string_equal(error, "a.json:1: not text, expected JSON in UTF-8\n");
    free(error);
}

static void test_valid_json_is_read(void** state)
{
    (void)state;
    const char* const right[] = {
        "{}", "[]", " [ ] ", "1", "-0.5e-3", "\"a\"", "null", "true", "\xef\xbb\xbf{}",
        "{\"\": {\"a\": [[], {}, [1]]}}", "[\"\\u00e9\\ud83d\\ude00\\\"\\\\\\/\\b\\f\\n\\r\\t\"]",
        "\r\n\t{\"a\"\n:\n1\n,\n\"b\"\n:\n2\n}\n", "[\"\xc3\xa9\x7f\"]",
    };
    for (size_t i = 0; i < sizeof right / sizeof right[0]; ++i) {
        char* error = error_of(right[i], strlen(right[i]));
        assert_string_equal(error, "");
        free(error);
    }
}

static void test_depth_is_bounded(void** state)
{
    (void)state;
    char text[2100];
    for (int depth = 999; depth <= 1001; ++depth) {
        memset(text, '[', (size_t)depth);
        memset(text + depth, ']', (size_t)depth);
        char* error = error_of(text, 2 * (size_t)depth);
        assert_string_equal(error, depth <= 1000 ? "" : "a.json:1: more than 1000 brackets inside"
                                                        " each other, expected fewer\n");
        free(error);
    }
}

/// What a reader of our files does, on one member of every kind.
static void read_all(const json_at* root)
{
    static const char* const keys[] = { "number", "whole", "flag", "text", "word", "list", "seed",
                                        NULL };
    static const char* const words[] = { "left", "right", NULL };
    if (!json_expect_object(root, keys)) {
        return;
    }
    CHECK_BETWEEN(json_double(root, "number", 0.5, 2.0), 0.5, 2.0);
    CHECK_BETWEEN(json_integer(root, "whole", -3, 7), -3, 7);
    json_bool_or(root, "flag", false);
    assert_non_null(json_string(root, "text"));
    assert_true(json_choice(root, "word", words) < 2);
    const json_at list = json_member(root, "list");
    const uint32_t count = json_expect_array(&list, 2, 3);
    CHECK_BETWEEN(count, 2, 3);
    const cJSON* node = cJSON_IsArray(list.node) ? list.node->child : NULL;
    for (uint32_t i = 0; i < count && node != NULL; i++, node = node->next) {
        const json_at element = json_element(&list, node, i);
        json_as_double(&element, 0.0, 9.0);
    }
    const json_at seed = json_member(root, "seed");
    json_as_u64(&seed);
}

static const char GOOD[] = "{\"number\": 1.5, \"whole\": -3, \"flag\": true, \"text\": \"t\","
                           " \"word\": \"left\", \"list\": [1, 2, 3], \"seed\": 7}";

/// GOOD with one text in place of another.
static void check_field(const char* from, const char* to, const char* expected)
{
    char text[512], line[JSON_ERROR_SIZE];
    const char* at = strstr(GOOD, from);
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - GOOD), GOOD, to, at + strlen(from));
    json_file file;
    assert_true(json_file_parse(&file, "a.json", text, strlen(text)));
    const json_at root = json_root(&file);
    read_all(&root);
    snprintf(line, sizeof line, "%s%s", expected, expected[0] != '\0' ? "\n" : "");
    assert_string_equal(file.error, line);
    json_file_free(&file);
}

static void test_a_wrong_value_names_its_field_and_what_was_expected(void** state)
{
    (void)state;
    check_field("1.5", "2", "");
    check_field("1.5", "2.1", "a.json:number: is 2.1, expected 0.5 to 2");
    check_field("1.5", "\"1.5\"", "a.json:number: is a string, expected a number from 0.5 to 2");
    check_field("1.5", "null", "a.json:number: is null, expected a number from 0.5 to 2");
    check_field("\"number\": 1.5, ", "",
                "a.json:number: is missing, expected a number from 0.5 to 2");
    check_field("-3", "-3.5", "a.json:whole: is -3.5, expected -3 to 7");
    check_field("-3", "2.5", "a.json:whole: is 2.5, expected a whole number");
    check_field("-3", "1234567.125", "a.json:whole: is 1234567.125, expected -3 to 7");
    check_field("true", "1", "a.json:flag: is a number, expected true or false");
    check_field("\"flag\": true, ", "", "");
    check_field("\"t\"", "[]", "a.json:text: is an array, expected a string");
    check_field("\"left\"", "\"up\"", "a.json:word: is \"up\", expected \"left\" or \"right\"");
    check_field("\"left\"", "{}", "a.json:word: is an object, expected \"left\" or \"right\"");
    check_field("\"word\": \"left\", ", "",
                "a.json:word: is missing, expected \"left\" or \"right\"");
    check_field("[1, 2, 3]", "[1]", "a.json:list: has 1 element, expected 2 to 3");
    check_field("[1, 2, 3]", "{}", "a.json:list: is an object, expected an array");
    check_field("[1, 2, 3]", "[1, 20]", "a.json:list[1]: is 20, expected 0 to 9");
    check_field("7", "\"18446744073709551615\"", "");
    check_field("7", "\"18446744073709551616\"", "a.json:seed: is \"18446744073709551616\","
                " expected a whole number from 0 to 18446744073709551615");
    check_field("\"flag\"", "\"flog\"", "a.json:flog: unknown key \"flog\", expected one of:"
                " number, whole, flag, text, word, list, seed");
    check_field("\"whole\"", "\"n\\nx\"", "a.json:n?x: unknown key \"n?x\", expected one of:"
                " number, whole, flag, text, word, list, seed");
}

static void test_a_key_given_twice_and_a_number_too_large_are_refused(void** state)
{
    (void)state;
    const wrong_text cases[] = {
        { "{\"a\": {\"b\": 1, \"c\": 2, \"b\": 3}}", "a.json:a.b: appears twice, expected once" },
        { "{\"a\": [0, 1e999]}", "a.json:a[1]: is too large, expected a finite number" },
        { "{\"a\": -1e999}", "a.json:a: is too large, expected a finite number" },
    };
    REFUSED(cases);
}

/// One line, `file:line-or-field: what is wrong, what was expected`.
static void check_form(const char* error, const char* text)
{
    const size_t length = strlen(error);
    if (length == 0) {
        return;
    }
    const char* place = error + strlen("a.json:");
    if (strncmp(error, "a.json:", 7) != 0 || strstr(place, ": ") == NULL ||
        strchr(error, '\n') != error + length - 1) {
        fail_msg("%s\nis told as: %s", text, error);
    }
}

static void test_every_fault_in_a_file_is_reported_in_one_line(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("json");
    static const char SLIPS[] = "{}[]\",:\\'/-+.0eE1tfnu \t\n\x01\x7f\xc3\xff";
    for (uint32_t i = 0; i < test_rounds(20000); ++i) {
        char   text[sizeof GOOD + 4];
        size_t size = sizeof GOOD - 1;
        memcpy(text, GOOD, sizeof GOOD);
        for (uint32_t slips = 1 + test_rng_below(&rng, 3); slips > 0; --slips) {
            const uint32_t at = test_rng_below(&rng, (uint32_t)size);
            const char     slip = SLIPS[test_rng_below(&rng, sizeof SLIPS - 1)];
            switch (test_rng_below(&rng, 3)) {
            case 0: text[at] = slip; break;
            case 1: memmove(text + at, text + at + 1, size - at); size--; break;
            default: memmove(text + at + 1, text + at, size - at); text[at] = slip; size++; break;
            }
        }
        json_file file;
        if (json_file_parse(&file, "a.json", text, size)) {
            const json_at root = json_root(&file);
            read_all(&root);
        }
        check_form(file.error, text);
        json_file_free(&file);
    }
}

static void test_a_file_that_cannot_be_read_says_why(void** state)
{
    (void)state;
    json_file file;
    assert_false(json_file_load(&file, "/no/such/file"));
    assert_true(file.missing);
    assert_string_equal(file.error, "/no/such/file:file: cannot be read (No such file or directory),"
                                    " expected a JSON file of at most 64 MiB\n");
    assert_false(json_file_load(&file, "/tmp"));
    assert_true(file.missing);
    assert_non_null(strstr(file.error, "directory"));
}

static void test_a_path_starts_in_the_folder_of_its_file(void** state)
{
    (void)state;
    const struct { const char* file; const char* path; const char* joined; } cases[] = {
        { "here/a.json", "b.json", "here/b.json" }, { "a.json", "b.json", "b.json" },
        { "/x/y/a.json", "../b.json", "/x/y/../b.json" }, { "here/a.json", "/b.json", "/b.json" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        char      text[64];
        json_file file;
        snprintf(text, sizeof text, "{\"p\": \"%s\"}", cases[i].path);
        assert_true(json_file_parse(&file, cases[i].file, text, strlen(text)));
        const json_at root = json_root(&file);
        const json_at at = json_member(&root, "p");
        char* joined = json_join(&at);
        assert_string_equal(joined, cases[i].joined);
        free(joined);
        json_file_free(&file);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_character_that_separates_values_is_named),
        cmocka_unit_test(test_a_text_that_ends_too_early_names_the_open_bracket),
        cmocka_unit_test(test_text_in_other_languages_is_shown),
        cmocka_unit_test(test_a_byte_that_is_no_text_names_its_line),
        cmocka_unit_test(test_valid_json_is_read),
        cmocka_unit_test(test_depth_is_bounded),
        cmocka_unit_test(test_a_wrong_value_names_its_field_and_what_was_expected),
        cmocka_unit_test(test_a_key_given_twice_and_a_number_too_large_are_refused),
        cmocka_unit_test(test_every_fault_in_a_file_is_reported_in_one_line),
        cmocka_unit_test(test_a_file_that_cannot_be_read_says_why),
        cmocka_unit_test(test_a_path_starts_in_the_folder_of_its_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
