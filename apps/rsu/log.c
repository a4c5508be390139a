#include "log.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    LINE_SIZE = 512,
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
static event_rate rates[EVENTS_MAX];

static const char* const LEVEL_NAMES[] = { "error", "warning", "info", "debug" };

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
    const size_t room = sizeof line - 1; // the newline always fits
    size_t size = (size_t)snprintf(line, room, "level=%s event=%s",
                                   LEVEL_NAMES[level == LOG_ALWAYS ? LOG_INFO : level], event);
    if (held_back > 0 && size < room) {
        size += (size_t)snprintf(line + size, room - size, " held_back=%u", held_back);
    }
    if (format[0] != '\0' && size + 1 < room) {
        line[size++] = ' ';
        va_list args;
        va_start(args, format);
        const int written = vsnprintf(line + size, room - size, format, args);
        va_end(args);
        size += written > 0 ? (size_t)written : 0;
    }
    size = size < room - 1 ? size : room - 1;
    line[size++] = '\n';
    // One write a line keeps lines whole when others share the descriptor. A log that cannot be
    // written is not worth stopping for.
    const ssize_t ignored = write(STDERR_FILENO, line, size);
    (void)ignored;
}

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
