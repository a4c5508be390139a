/// See log.h. The main thread makes a line, the thread of the outlet writes it: with one write(),
/// so that lines stay whole if other programs write to the same pipe.
#include "log.h"

#include "outlet.h"

#include <assert.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum {
    LINE_SIZE = 512,
    JSON_SIZE = 4 * LINE_SIZE, // the worst pair, `= `, becomes three times as long
    WRITTEN_SIZE = JSON_SIZE + 8, // with the priority before it and the line break
    RATES_MAX = 64, // event words of this program, and some causes of them
};
static_assert(WRITTEN_SIZE <= PIPE_BUF, "a pipe takes a line whole or not at all");

/// A line that waits in the outlet. A line log_dropped has the number of dropped lines so far in
/// `reports`, other lines 0.
typedef struct queued_line {
    uint64_t reports;
    char     text[WRITTEN_SIZE];
} queued_line;
enum { QUEUED_HEAD = offsetof(queued_line, text) };

/// How much an event word, or one cause of it, has written since a time.
typedef struct event_rate {
    const char* event; // null: free
    bool        of_cause;
    uint32_t    cause;
    int64_t     since; // [s] of a clock that never steps back
    uint32_t    written;
    uint32_t    held_back;
} event_rate;

static log_level  level_max = LOG_INFO;
static log_format format_now = LOG_TEXT;
static bool       journal;
static event_rate rates[RATES_MAX];
static outlet*    queue;      // null: lines are written by the caller
static bool       silent;     // after log_stop(): the thread still waits for standard error
static uint64_t   dropped_before; // by a queue that is closed
static atomic_uint_fast64_t reported; // dropped lines of which the log gives the number

static const char* const LEVEL_NAMES[] = { "error", "warning", "info", "debug" };
static const int PRIORITIES[] = { 3, 4, 6, 7 }; // syslog's, of the levels
static const char* const FORMAT_NAMES[] = { "text", "json" };

static bool        stderr_is_journal(void);
static size_t      json_of(const char* pairs, char* json, size_t size);
static bool        rate_allows(const char* event, const uint32_t* cause, uint32_t* held_back);

bool log_level_from(const char* text, log_level* level)
{
    for (unsigned i = 0; i < sizeof LEVEL_NAMES / sizeof LEVEL_NAMES[0]; i++) {
        if (strcmp(text, LEVEL_NAMES[i]) == 0) {
            *level = (log_level)i;
            return true;
        }
    }
    return false;
}

void log_level_set(log_level level)
{
    level_max = level;
}

bool log_format_from(const char* text, log_format* format)
{
    for (unsigned i = 0; i < sizeof FORMAT_NAMES / sizeof FORMAT_NAMES[0]; i++) {
        if (strcmp(text, FORMAT_NAMES[i]) == 0) {
            *format = (log_format)i;
            return true;
        }
    }
    return false;
}

const char* log_format_name(log_format format)
{
    return FORMAT_NAMES[format];
}

void log_setup(log_format format)
{
    format_now = format;
    journal = stderr_is_journal();
}

static void write_line(log_level level, const char* pairs, uint64_t reports);

static void log_made(log_level level, const char* event, const uint32_t* cause,
                     const char* format, va_list args)
{
    uint32_t held_back = 0;
    if (level > level_max || !rate_allows(event, cause, &held_back)) {
        return;
    }
    char line[LINE_SIZE];
    const log_level shown = level == LOG_ALWAYS ? LOG_INFO : level;
    size_t size = (size_t)snprintf(line, sizeof line, "level=%s event=%s", LEVEL_NAMES[shown],
                                   event);
    if (held_back > 0 && size < sizeof line) {
        size += (size_t)snprintf(line + size, sizeof line - size, " held_back=%u", held_back);
    }
    if (format[0] != '\0' && size + 1 < sizeof line) {
        line[size++] = ' ';
        vsnprintf(line + size, sizeof line - size, format, args);
    }
    write_line(shown, line, 0);
}

void log_event(log_level level, const char* event, const char* format, ...)
{
    va_list args;
    va_start(args, format);
    log_made(level, event, NULL, format, args);
    va_end(args);
}

void log_repeated(log_level level, const char* event, uint32_t cause, const char* format, ...)
{
    va_list args;
    va_start(args, format);
    log_made(level, event, &cause, format, args);
    va_end(args);
}

static void queue_or_write(queued_line* line, size_t size);

static void write_line(log_level level, const char* pairs, uint64_t reports)
{
    queued_line line = { .reports = reports };
    size_t size = 0;
    if (journal) {
        size = (size_t)snprintf(line.text, sizeof line.text, "<%d>", PRIORITIES[level]);
    }
    if (format_now == LOG_JSON) {
        size += json_of(pairs, line.text + size, sizeof line.text - size - 1);
    } else {
        const size_t length = strlen(pairs);
        memcpy(line.text + size, pairs, length);
        size += length;
    }
    line.text[size++] = '\n';
    queue_or_write(&line, size);
}

void log_plain(const char* text)
{
    queued_line line = { .reports = 0 };
    size_t size = strnlen(text, sizeof line.text - 1);
    memcpy(line.text, text, size);
    if (size == 0 || text[size - 1] != '\n') {
        line.text[size++] = '\n';
    }
    queue_or_write(&line, size);
}

// ---- writing --------------------------------------------------------------------------------

static bool write_queued(void* context, const void* record, size_t size);
static bool write_whole(const char* text, size_t size);

bool log_start(void)
{
    const outlet_def def = {
        .name = "verge-log",
        .queue_size = LOG_QUEUE_SIZE,
        .record_max = sizeof(queued_line),
        .write = write_queued,
    };
    queue = outlet_create(&def);
    return queue != NULL;
}

void log_stop(int64_t patience_us)
{
    if (queue != NULL) {
        dropped_before = log_dropped();
        silent = !outlet_close(queue, patience_us);
        queue = NULL;
    }
}

uint64_t log_dropped(void)
{
    return dropped_before + (queue != NULL ? outlet_dropped(queue) : 0);
}

void log_report_dropped(void)
{
    const uint64_t dropped = log_dropped();
    const uint64_t before = atomic_load(&reported);
    if (queue == NULL || dropped == before || level_max < LOG_WARNING || !outlet_idle(queue)) {
        return;
    }
    char line[LINE_SIZE];
    snprintf(line, sizeof line,
             "level=warning event=log_dropped lines=%" PRIu64 " total=%" PRIu64, dropped - before,
             dropped);
    write_line(LOG_WARNING, line, dropped);
}

static void queue_or_write(queued_line* line, size_t size)
{
    if (queue != NULL) {
        outlet_put(queue, line, QUEUED_HEAD + size);
    } else if (!silent) {
        write_whole(line->text, size); // a log that cannot be written does not stop the daemon
    }
}

/// In the outlet's thread. A lost line log_dropped is not counted, because the next one replaces
/// it.
static bool write_queued(void* context, const void* record, size_t size)
{
    (void)context;
    uint64_t reports = 0;
    memcpy(&reports, record, sizeof reports);
    const bool written = write_whole((const char*)record + QUEUED_HEAD, size - QUEUED_HEAD);
    if (reports > 0 && written) {
        atomic_store(&reported, reports);
    }
    return written || reports > 0;
}

/// Writes a line, however long it takes. If a full disk has cut the line before, a line break ends
/// that one first.
static bool write_whole(const char* text, size_t size)
{
    static bool cut;
    if (cut && write(STDERR_FILENO, "\n", 1) == 1) {
        cut = false;
    }
    size_t written = 0;
    while (written < size && !cut) {
        const ssize_t part = write(STDERR_FILENO, text + written, size - written);
        if (part > 0) {
            written += (size_t)part;
        } else if (errno == EAGAIN) { // another program has made it non-blocking
            struct pollfd end = { .fd = STDERR_FILENO, .events = POLLOUT };
            poll(&end, 1, -1);
        } else if (errno != EINTR) {
            cut = written > 0;
            return false;
        }
    }
    return written == size;
}

char* log_words(char* text)
{
    for (char* c = text; *c != '\0'; c++) {
        *c = *c == '"' ? '\'' : (unsigned char)*c < ' ' ? ' ' : *c;
    }
    for (size_t length = strlen(text); length > 0 && text[length - 1] == ' '; length--) {
        text[length - 1] = '\0';
    }
    return text;
}

/// The journal gives the device and inode of its stream, so that a program whose standard error is
/// elsewhere notices.
static bool stderr_is_journal(void)
{
    const char* name = getenv("JOURNAL_STREAM");
    uint64_t device = 0, inode = 0;
    struct stat end;
    return name != NULL && sscanf(name, "%" SCNu64 ":%" SCNu64, &device, &inode) == 2 &&
           fstat(STDERR_FILENO, &end) == 0 && (uint64_t)end.st_dev == device &&
           (uint64_t)end.st_ino == inode;
}

// ---- JSON -----------------------------------------------------------------------------------

/// A growing text. What does not fit is left out.
typedef struct writer {
    char*  text;
    size_t size, room;
} writer;

static void put(writer* out, char c)
{
    if (out->size < out->room) {
        out->text[out->size++] = c;
    }
}

static void put_string(writer* out, const char* text, size_t length)
{
    put(out, '"');
    for (size_t i = 0; i < length; i++) {
        const char c = text[i];
        if (c == '"' || c == '\\') {
            put(out, '\\');
        }
        put(out, (unsigned char)c < ' ' ? ' ' : c);
    }
    put(out, '"');
}

/// A decimal number in the syntax of JSON, with at most as many digits as a double holds.
static bool is_number(const char* text, size_t length)
{
    const size_t sign = length > 0 && text[0] == '-' ? 1 : 0;
    size_t points = 0;
    for (size_t i = sign; i < length; i++) {
        points += text[i] == '.' ? 1 : 0;
        if ((text[i] < '0' || text[i] > '9') && text[i] != '.') {
            return false;
        }
    }
    const bool leads = length > sign + 1 && text[sign] == '0' && text[sign + 1] != '.';
    return length > sign && length - sign <= 16 && points <= 1 && !leads && text[sign] != '.' &&
           text[length - 1] != '.';
}

/// Turns `key=value key="some words"` into an object. Returns its size.
static size_t json_of(const char* pairs, char* json, size_t size)
{
    writer out = { .text = json, .size = 0, .room = size };
    put(&out, '{');
    while (*pairs != '\0') {
        const size_t key = strcspn(pairs, "= ");
        put_string(&out, pairs, key);
        put(&out, ':');
        pairs += key + (pairs[key] == '=' ? 1 : 0);
        const bool quoted = *pairs == '"';
        pairs += quoted ? 1 : 0;
        const size_t length = strcspn(pairs, quoted ? "\"" : " ");
        if (!quoted && is_number(pairs, length)) {
            for (size_t i = 0; i < length; i++) {
                put(&out, pairs[i]);
            }
        } else {
            put_string(&out, pairs, length);
        }
        pairs += length;
        pairs += quoted && *pairs == '"' ? 1 : 0;
        pairs += *pairs == ' ' ? 1 : 0;
        if (*pairs != '\0') {
            put(&out, ',');
        }
    }
    put(&out, '}');
    return out.size;
}

// ---- rates ----------------------------------------------------------------------------------

static event_rate* rate_of(const char* event, const uint32_t* cause, const event_rate* keep,
                           int64_t now);
static bool        rate_open(event_rate* rate, int64_t period_s, uint32_t burst, int64_t now);

/// cause null: only the event word has a limit.
static bool rate_allows(const char* event, const uint32_t* cause, uint32_t* held_back)
{
    struct timespec clock;
    clock_gettime(CLOCK_MONOTONIC, &clock);
    const int64_t now = (int64_t)clock.tv_sec;
    event_rate* all = rate_of(event, NULL, NULL, now);
    event_rate* one = cause != NULL ? rate_of(event, cause, all, now) : all;
    if ((cause != NULL && !rate_open(one, LOG_PERIOD_S, 1, now)) ||
        !rate_open(all, 1, LOG_BURST, now)) {
        one->held_back++;
        return false;
    }
    all->written++;
    one->written += one != all ? 1 : 0;
    *held_back = one->held_back;
    one->held_back = 0;
    return true;
}

/// The slot of an event or cause. A new one gets the slot that was not used for the longest time,
/// but not `keep`.
static event_rate* rate_of(const char* event, const uint32_t* cause, const event_rate* keep,
                           int64_t now)
{
    event_rate* oldest = NULL;
    for (unsigned i = 0; i < RATES_MAX; i++) {
        event_rate* rate = &rates[i];
        if (rate->event != NULL && strcmp(rate->event, event) == 0 &&
            rate->of_cause == (cause != NULL) && (cause == NULL || rate->cause == *cause)) {
            return rate;
        }
        if (rate != keep && (oldest == NULL || rate->since < oldest->since)) {
            oldest = rate; // a free one was never used: 0
        }
    }
    *oldest = (event_rate){ .event = event, .of_cause = cause != NULL,
                            .cause = cause != NULL ? *cause : 0, .since = now };
    return oldest;
}

static bool rate_open(event_rate* rate, int64_t period_s, uint32_t burst, int64_t now)
{
    if (now >= rate->since + period_s) {
        rate->since = now;
        rate->written = 0;
    }
    return rate->written < burst;
}
