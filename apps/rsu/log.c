#include "log.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum {
    LINE_SIZE = 512,
    JSON_SIZE = 8 * LINE_SIZE, // every character escaped would still fit
    EVENTS_MAX = 48, // distinct event words in this program, with room
};

/// What one event word has written in its current second.
typedef struct event_rate {
    const char* event;
    int64_t     second;
    uint32_t    written;
    uint32_t    held_back;
} event_rate;

static log_level  level_max = LOG_INFO;
static log_format format_now = LOG_TEXT;
static bool       journal;
static event_rate rates[EVENTS_MAX];

static const char* const LEVEL_NAMES[] = { "error", "warning", "info", "debug" };
static const int PRIORITIES[] = { 3, 4, 6, 7 }; // syslog's, of the levels
static const char* const FORMAT_NAMES[] = { "text", "json" };

static bool        stderr_is_journal(void);
static size_t      json_of(const char* pairs, char* json, size_t size);
static event_rate* rate_of(const char* event);
static bool        rate_allows(event_rate* rate, uint32_t* held_back);

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

static void write_line(log_level level, const char* pairs);

void log_event(log_level level, const char* event, const char* format, ...)
{
    if (level > level_max) {
        return;
    }
    uint32_t held_back = 0;
    event_rate* rate = rate_of(event);
    if (rate != NULL && !rate_allows(rate, &held_back)) {
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
        va_list args;
        va_start(args, format);
        vsnprintf(line + size, sizeof line - size, format, args);
        va_end(args);
    }
    write_line(shown, line);
}

/// One write a line keeps lines whole when others share the descriptor. A log that cannot be
/// written is not worth stopping for.
static void write_line(log_level level, const char* pairs)
{
    char line[JSON_SIZE + 8];
    size_t size = journal ? (size_t)snprintf(line, sizeof line, "<%d>", PRIORITIES[level]) : 0;
    if (format_now == LOG_JSON) {
        size += json_of(pairs, line + size, sizeof line - size - 1);
    } else {
        const size_t length = strlen(pairs);
        memcpy(line + size, pairs, length);
        size += length;
    }
    line[size++] = '\n';
    const ssize_t ignored = write(STDERR_FILENO, line, size);
    (void)ignored;
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

/// The journal names its end by device and inode, so that a program started from one that writes
/// to the journal, but itself writes elsewhere, can tell.
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

/// A text that grows; what does not fit is left out.
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

/// A whole or decimal number as JSON spells it, of no more digits than a double holds.
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

/// The slot of an event word; null when there are more words than slots: then it is not limited.
static event_rate* rate_of(const char* event)
{
    for (unsigned i = 0; i < EVENTS_MAX; i++) {
        if (rates[i].event == NULL) {
            rates[i].event = event;
        }
        if (strcmp(rates[i].event, event) == 0) {
            return &rates[i];
        }
    }
    return NULL;
}

static bool rate_allows(event_rate* rate, uint32_t* held_back)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    if (rate->second != (int64_t)now.tv_sec) {
        rate->second = (int64_t)now.tv_sec;
        rate->written = 0;
    }
    if (rate->written >= LOG_BURST) {
        rate->held_back++;
        return false;
    }
    rate->written++;
    *held_back = rate->held_back;
    rate->held_back = 0;
    return true;
}
