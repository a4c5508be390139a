/// The daemon's log: one line for each event on standard error.
///
///     text  level=info event=READY version=0.1.0 rsu_id=1 bus=lcm:udpm://... map_crc32=0x5ac635d8
///     json  {"level":"info","event":"READY","version":"0.1.0","rsu_id":1,...}
///
/// Both formats have the same pairs. In JSON a value that is written like a JSON number is a
/// number, every other value a string. If standard error is the journal ($JOURNAL_STREAM names it),
/// each line begins with its priority, <3> error to <7> debug, which the journal removes again.
///
/// Each event has a rate limit of LOG_BURST lines a second, so that a flood of bad messages cannot
/// hide the rest. An event that repeats while its cause lasts (log_repeated()) is logged at once
/// for each cause, then every LOG_PERIOD_S. In the next line of a limited event, held_back is the
/// number of lines that were left out.
///
/// Blocking    After log_start() a thread writes the lines, so that a caller never waits, not even
///             for a pipe that is not read. Lines beyond LOG_QUEUE_SIZE are dropped; when writing
///             works again, the event log_dropped gives their number.
/// Memory      log_start() allocates the queue; nothing else allocates.
/// Threads     Only the main thread calls.
#ifndef VERGE_DAEMON_LOG_H
#define VERGE_DAEMON_LOG_H

#include <stdbool.h>
#include <stdint.h>

typedef enum log_level {
    LOG_ALWAYS = -1, ///< info at every level, for programs that wait for this line
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

/// Sets the format of the following lines, and finds out whether standard error is the journal.
/// Before the first call the format is text, without priorities.
void log_setup(log_format format);

/// Starts the thread that writes the lines. False: the system refuses a thread or memory: errno;
/// the caller's thread writes as before.
bool log_start(void);
/// Writes the waiting lines, for at most patience_us [us], and ends the thread. The caller's thread
/// writes later lines; if the time was not enough, they are left out.
void log_stop(int64_t patience_us);

/// Lines that were dropped because the queue was full, or lost because writing failed.
uint64_t log_dropped(void);
/// To be called once a second: logs log_dropped if lines were dropped and writing works again.
void log_report_dropped(void);

/// Writes a line without level and event, such as the reason of an exit. It may end with a line
/// break.
void log_plain(const char* line);

/// event: a static string, one word in lower case. format: pairs `key=value` or `key="some words"`
/// with single spaces between them; may be empty. Words from outside go through log_words().
void log_event(log_level level, const char* event, const char* format, ...)
    __attribute__((format(printf, 3, 4)));

/// The same for an event that repeats while its cause lasts, such as a sender that uses the id of
/// another one. cause distinguishes the causes of one event word.
void log_repeated(log_level level, const char* event, uint32_t cause, const char* format, ...)
    __attribute__((format(printf, 4, 5)));

/// Makes a text from outside fit between double quotes: one line, single quotes. Returns text.
char* log_words(char* text);

#endif
