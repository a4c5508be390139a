/// The daemon's log: one line an event on standard error.
///
///     text  level=info event=READY version=0.1.0 rsu_id=1 bus=lcm:udpm://... map_crc32=0x5ac635d8
///     json  {"level":"info","event":"READY","version":"0.1.0","rsu_id":1,...}
///
/// The same pairs in both; in JSON what is written like a JSON number is one, all else a string.
/// Where standard error is the journal's own ($JOURNAL_STREAM names it) each line begins with its
/// priority, <3> error to <7> debug, which the journal takes off again.
///
/// Each event has its own rate limit, LOG_BURST lines in a second, so that a flood of bad
/// messages cannot drown the rest. An event that goes on by itself (log_repeated()) is logged at
/// once for each cause, then every LOG_PERIOD_S for as long as it goes on. The next line of a
/// limited event tells with held_back how many were left out.
///
/// Blocking    From log_start() on a thread of its own writes the lines, so that a caller never
///             waits, not even for a pipe that nobody reads. Lines beyond LOG_QUEUE_SIZE are
///             dropped; when writing works again the event log_dropped tells how many.
/// Memory      log_start() allocates the queue; nothing else does.
/// Threads     Calls come from the main thread alone.
#ifndef VERGE_RSU_LOG_H
#define VERGE_RSU_LOG_H

#include <stdbool.h>
#include <stdint.h>

typedef enum log_level {
    LOG_ALWAYS = -1, ///< info that no level hides: what other programs wait for
    LOG_ERROR = 0,
    LOG_WARNING = 1,
    LOG_INFO = 2,
    LOG_DEBUG = 3,
} log_level;

typedef enum log_format {
    LOG_TEXT = 0,
    LOG_JSON = 1,
} log_format;

enum {
    LOG_BURST = 5,
    LOG_PERIOD_S = 10,
    LOG_QUEUE_SIZE = 256 << 10, ///< [B] some thousand lines
};

/// "error", "warning", "info" or "debug". False: not one of them, nothing changed.
bool log_level_from(const char* text, log_level* level);

/// Lines above this level are not written. The default is LOG_INFO.
void log_level_set(log_level level);

/// "text" or "json". False: neither, nothing changed.
bool log_format_from(const char* text, log_format* format);
const char* log_format_name(log_format format);

/// The format of the lines to come, and whether standard error is the journal. Without a call:
/// text, and it is not.
void log_setup(log_format format);

/// From now on lines are written by a thread. False when the system refuses one, or memory: errno;
/// the caller's thread goes on writing them.
bool log_start(void);
/// Writes what waits, for at most patience_us [us]. Lines after it are written by the caller's
/// thread; where time ran out they are left out.
void log_stop(int64_t patience_us);

/// Lines that were dropped because the queue was full, or lost because writing failed.
uint64_t log_dropped(void);
/// Once a second: a line log_dropped when lines were dropped and writing works again.
void log_tell_dropped(void);

/// A line without level and event, for what ends the program. A line break at its end is fine.
void log_plain(const char* line);

/// event: a static string, lower case, one word. format: pairs `key=value` or `key="some words"`
/// with single spaces between them, may be empty. Words from elsewhere go through log_words().
void log_event(log_level level, const char* event, const char* format, ...)
    __attribute__((format(printf, 3, 4)));

/// The same for an event that happens again and again while its cause lasts: one sender that uses
/// another one's id, a planner that is late. cause tells causes of one event word apart.
void log_repeated(log_level level, const char* event, uint32_t cause, const char* format, ...)
    __attribute__((format(printf, 4, 5)));

/// Makes a text of other people's fit between double quotes: on one line, with single quotes.
char* log_words(char* text);

#endif
