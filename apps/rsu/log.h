/// The daemon's log: one line an event on standard error, `level=info event=ready key=value ...`.
///
/// Each event has its own rate limit, LOG_BURST lines in a second, so that a flood of bad
/// messages cannot drown the rest; the next line of that event tells how many were held back.
/// Nothing is allocated. Calls come from one thread.
#ifndef VERGE_RSU_LOG_H
#define VERGE_RSU_LOG_H

#include <stdbool.h>

typedef enum log_level {
    LOG_ALWAYS = -1, ///< info that no level hides: what other programs wait for
    LOG_ERROR = 0,
    LOG_WARNING = 1,
    LOG_INFO = 2,
    LOG_DEBUG = 3,
} log_level;

enum { LOG_BURST = 5 };

/// "error", "warning", "info" or "debug". False: not one of them, nothing changed.
bool log_level_from(const char* text, log_level* level);

/// Lines above this level are not written. The default is LOG_INFO.
void log_level_set(log_level level);

/// event: a static string, lower case, one word. format: `key=value` pairs, may be empty.
void log_event(log_level level, const char* event, const char* format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
