/// Goal: an entry of the log is one line for any values. In JSON it is an object with the same
/// pairs, which can be parsed also where it was cut.
/// Method: standard error is redirected to a file for each line.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/log.h"

#include "common/json.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { TEXT_MAX = 65536, PIPED_MAX = 8 << 20, PATIENCE_S = 300 };

static int catcher = -1, usual = -1;

static void catch_lines(void)
{
    fflush(stderr);
    assert_int_equal(ftruncate(catcher, 0), 0);
    lseek(catcher, 0, SEEK_SET);
    dup2(catcher, STDERR_FILENO);
}

static const char* caught(void)
{
    static char text[TEXT_MAX];
    dup2(usual, STDERR_FILENO);
    const ssize_t size = pread(catcher, text, sizeof text - 1, 0);
    assert_true(size >= 0);
    text[size] = '\0';
    return text;
}

static void test_a_line_is_pairs_or_an_object_of_the_same(void** state)
{
    (void)state;
    catch_lines();
    log_setup(LOG_TEXT);
    log_event(LOG_WARNING, "pairs", "n=%d f=%.1f hex=0x%x words=\"two words\" none=", -3, 1.5, 16);
    log_setup(LOG_JSON);
    log_event(LOG_WARNING, "pairs", "n=%d f=%.1f hex=0x%x words=\"two words\" none=", -3, 1.5, 16);
    log_event(LOG_ERROR, "alone", "%s", "");
    assert_string_equal(caught(),
        "level=warning event=pairs n=-3 f=1.5 hex=0x10 words=\"two words\" none=\n"
        "{\"level\":\"warning\",\"event\":\"pairs\",\"n\":-3,\"f\":1.5,\"hex\":\"0x10\","
        "\"words\":\"two words\",\"none\":\"\"}\n"
        "{\"level\":\"error\",\"event\":\"alone\"}\n");
}

static void test_only_what_json_spells_as_a_number_is_one(void** state)
{
    (void)state;
    static const char* const VALUES[] = {
        "0", "7", "-7", "0.5", "10.25", "007", "1.", ".5", "-", "1.2.3", "0x1f", "1e5", "+1",
        "12345678901234567890", "lcm:udpm://239.255.76.67:7667?ttl=0",
    };
    log_setup(LOG_JSON);
    for (size_t i = 0; i < sizeof VALUES / sizeof VALUES[0]; ++i) {
        static char event[sizeof VALUES / sizeof VALUES[0]][8];
        snprintf(event[i], sizeof event[i], "v%zu", i); // a rate of its own for each
        catch_lines();
        log_event(LOG_INFO, event[i], "value=%s", VALUES[i]);
        const char* line = caught();
        json_file file;
        if (!json_file_parse(&file, "line", line, strlen(line))) {
            fail_msg("%s: %s", line, file.error);
        }
        const cJSON* value = cJSON_GetObjectItem(file.document, "value");
        assert_int_equal(cJSON_IsNumber(value), i < 5);
        if (!cJSON_IsNumber(value)) {
            assert_string_equal(value->valuestring, VALUES[i]);
        }
        json_file_free(&file);
    }
}

static void test_any_words_stay_on_one_line_that_parses(void** state)
{
    (void)state;
    static char event[40][8];
    for (int i = 0; i < 40; ++i) {
        char words[1200];
        const int length = i * 29;
        for (int k = 0; k < length; ++k) {
            words[k] = (char)(1 + (k * 7 + i) % 126);
        }
        words[length] = '\0';
        log_words(words);
        assert_null(strchr(words, '\n'));
        assert_null(strchr(words, '"'));
        snprintf(event[i], sizeof event[i], "w%d", i);
        for (int format = LOG_TEXT; format <= LOG_JSON; ++format) {
            log_setup((log_format)format);
            catch_lines();
            log_event(LOG_INFO, event[i], "words=\"%s\" after=1", words);
            const char* line = caught();
            assert_true(strchr(line, '\n') == line + strlen(line) - 1);
            json_file file;
            if (format == LOG_JSON && !json_file_parse(&file, "line", line, strlen(line))) {
                fail_msg("%s: %s", line, file.error);
            }
            if (format == LOG_JSON) {
                json_file_free(&file);
            }
        }
    }
}

static void test_a_flood_is_held_back_and_counted(void** state)
{
    (void)state;
    log_setup(LOG_TEXT);
    catch_lines();
    for (int i = 0; i < 1000; ++i) {
        log_event(LOG_ERROR, "flood", "i=%d", i);
    }
    const char* text = caught();
    int lines = 0;
    for (const char* c = text; *c != '\0'; ++c) {
        lines += *c == '\n' ? 1 : 0;
    }
    assert_true(lines >= LOG_BURST && lines < 500); // more than a burst where a second has passed
}

static unsigned count_of(const char* text, const char* words)
{
    unsigned count = 0;
    for (const char* at = text; (at = strstr(at, words)) != NULL; ++at) {
        ++count;
    }
    return count;
}

static void test_an_event_that_goes_on_is_logged_once_a_cause_in_ten_seconds(void** state)
{
    (void)state;
    log_setup(LOG_TEXT);
    catch_lines();
    for (int i = 0; i < 1000; ++i) {
        for (uint32_t cause = 0; cause < 3; ++cause) {
            log_repeated(LOG_ERROR, "goes-on", cause, "cause=%u i=%d", cause, i);
        }
    }
    const char* text = caught();
    assert_int_equal(count_of(text, "event=goes-on"), 3); // this takes no ten seconds
    assert_int_equal(count_of(text, "i=0"), 3);
}

static void test_many_causes_at_once_do_not_flood_the_log(void** state)
{
    (void)state;
    log_setup(LOG_TEXT);
    catch_lines();
    for (uint32_t cause = 0; cause < 5000; ++cause) {
        log_repeated(LOG_ERROR, "causes", cause, "cause=%u", cause);
    }
    const unsigned lines = count_of(caught(), "event=causes");
    assert_true(lines >= LOG_BURST && lines < 50); // more than a burst where a second has passed
}

static void test_suppressed_lines_are_counted_in_the_next_line(void** state)
{
    (void)state;
    log_setup(LOG_TEXT);
    catch_lines();
    unsigned calls = 0;
    const char* text = "";
    for (; strstr(text, "held_back=") == NULL; ++calls) {
        log_event(LOG_ERROR, "held", "%s", "");
        usleep(1000);
        text = caught();
        dup2(catcher, STDERR_FILENO); // goes on at the end
        assert_true(calls < 100000);
    }
    text = caught();
    assert_int_equal(atoi(strstr(text, "held_back=") + 10) + count_of(text, "event=held"), calls);
}

/// Reads what is in a pipe to `text`, at its end; how many lines there are by now.
static unsigned pour(int reader, char* text)
{
    const size_t size = strlen(text);
    const ssize_t got = read(reader, text + size, PIPED_MAX - 1 - size);
    text[size + (size_t)(got > 0 ? got : 0)] = '\0';
    unsigned lines = 0;
    for (const char* c = text; *c != '\0'; ++c) {
        lines += *c == '\n' ? 1 : 0;
    }
    return lines;
}

static void wait_for_lines(int reader, char* text, unsigned lines)
{
    for (int tries = 0; pour(reader, text) < lines; ++tries) {
        if (tries >= 20000) {
            fail_msg("%u lines of %u", pour(reader, text), lines);
        }
        usleep(1000);
    }
}

/// Each has an event word of its own, and so none is held back.
static void log_many(unsigned count)
{
    static char event[40000][8];
    static unsigned next;
    for (unsigned i = 0; i < count; i++, ++next) {
        snprintf(event[next], sizeof event[next], "n%u", next);
        log_event(LOG_INFO, event[next], "filler=\"%0100d\"", 0);
    }
}

/// Only complete lines are read, and each dropped one is counted and reported once.
static void check_piped(const char* text, uint64_t put, uint64_t dropped)
{
    uint64_t lines = 0, told = 0;
    for (const char* line = text; *line != '\0'; line = strchr(line, '\n') + 1) {
        assert_int_equal(strncmp(line, "level=", 6), 0);
        unsigned long long more = 0;
        const char* tells = "level=warning event=log_dropped lines=%llu total=";
        if (sscanf(line, tells, &more) == 1) {
            told += more;
        } else {
            ++lines;
        }
    }
    assert_int_equal(lines, put - dropped);
    assert_int_equal(told, dropped);
}

static void test_an_unread_pipe_loses_counted_lines_and_blocks_nothing(void** state)
{
    (void)state;
    static char text[PIPED_MAX];
    int ends[2];
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
    log_setup(LOG_TEXT);
    dup2(ends[1], STDERR_FILENO);
    assert_true(log_start());
    uint64_t put = 0;
    while (log_dropped() == 0) { // fills the pipe and the queue; no thread blocks
        log_many(100);
        put += 100;
    }
    log_report_dropped(); // in vain
    const uint64_t dropped = log_dropped();
    wait_for_lines(ends[0], text, (unsigned)(put - dropped));
    for (unsigned lines = (unsigned)(put - dropped); pour(ends[0], text) == lines;) {
        log_report_dropped(); // once the queue is empty
        usleep(1000);
    }
    log_report_dropped();
    log_many(1);
    log_stop(20000000);
    dup2(usual, STDERR_FILENO);
    pour(ends[0], text);
    check_piped(text, put + 1, dropped);
    assert_int_equal(log_dropped(), dropped);
    close(ends[0]);
    close(ends[1]);
}

static void test_stopping_does_not_wait_for_an_unread_pipe(void** state)
{
    (void)state;
    int ends[2];
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    const pid_t child = fork(); // its thread is left waiting, and ends with it
    if (child == 0) {
        dup2(ends[1], STDERR_FILENO);
        const bool started = log_start();
        log_many(2000);
        log_stop(10000);
        log_event(LOG_ERROR, "left-out", "%s", ""); // would wait for ever
        if (started) {
            raise(SIGKILL); // it came this far
        }
        _exit(1);
    }
    int end = -1;
    assert_int_equal(waitpid(child, &end, 0), child);
    assert_true(WIFSIGNALED(end) && WTERMSIG(end) == SIGKILL);
    close(ends[1]);
    close(ends[0]);
}

static void test_the_journal_is_recognised_by_device_and_inode(void** state)
{
    (void)state;
    struct stat facts;
    assert_int_equal(fstat(catcher, &facts), 0);
    char name[64];
    snprintf(name, sizeof name, "%llu:%llu", (unsigned long long)facts.st_dev,
             (unsigned long long)facts.st_ino);
    const struct { const char* stream; bool journal; } CASES[] = {
        { name, true }, { "0:0", false }, { "", false }, { "nonsense", false }, { "1", false },
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; ++i) {
        setenv("JOURNAL_STREAM", CASES[i].stream, 1);
        static char event[5][8];
        snprintf(event[i], sizeof event[i], "j%zu", i);
        catch_lines();
        log_setup(LOG_TEXT);
        log_event(LOG_WARNING, event[i], "a=1");
        assert_int_equal(strncmp(caught(), "<4>level=warning", 16) == 0, CASES[i].journal);
    }
    unsetenv("JOURNAL_STREAM");
    log_setup(LOG_TEXT);
}

static int open_catcher(void** state)
{
    (void)state;
    signal(SIGPIPE, SIG_IGN);
    alarm(PATIENCE_S);
    char path[] = "/tmp/verge-log-XXXXXX";
    catcher = mkostemp(path, O_APPEND);
    usual = dup(STDERR_FILENO);
    return catcher < 0 || unlink(path) != 0 ? -1 : 0;
}

static int close_catcher(void** state)
{
    (void)state;
    close(catcher);
    return close(usual);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_flood_is_held_back_and_counted),
        cmocka_unit_test(test_an_event_that_goes_on_is_logged_once_a_cause_in_ten_seconds),
        cmocka_unit_test(test_many_causes_at_once_do_not_flood_the_log),
        cmocka_unit_test(test_suppressed_lines_are_counted_in_the_next_line),
        cmocka_unit_test(test_a_line_is_pairs_or_an_object_of_the_same),
        cmocka_unit_test(test_only_what_json_spells_as_a_number_is_one),
        cmocka_unit_test(test_any_words_stay_on_one_line_that_parses),
        cmocka_unit_test(test_the_journal_is_recognised_by_device_and_inode),
        cmocka_unit_test(test_an_unread_pipe_loses_counted_lines_and_blocks_nothing),
        cmocka_unit_test(test_stopping_does_not_wait_for_an_unread_pipe),
    };
    return cmocka_run_group_tests(tests, open_catcher, close_catcher);
}
