/// The recording of a running daemon: an LCM event log that its own thread writes, so that planning
/// never waits for a slow disk or for a pipe whose reader has stopped.
///
///     recorder* recorder = NULL;
///     if (!recorder_open(&recorder, path, error, sizeof error)) ...
///     recorder_put(recorder, utime, &message);   // never waits
///     if (recorder_fault(recorder) != 0) ...     // it has ended: the disk is full
///
/// Losses      Events beyond RECORDER_QUEUE_SIZE are dropped, and so are events for a pipe without
///             a reader. Both are counted, and the recording continues when the pipe is read
///             again. Any other failure ends the recording; the log is complete up to that event.
/// Memory      recorder_open() allocates everything; recorder_close() frees it.
/// Threads     The main one.
#ifndef VERGE_DAEMON_RECORDER_H
#define VERGE_DAEMON_RECORDER_H

#include "verge/transport.h"

/// [B] For five seconds of 64 vehicles with 2 plans and 10 states a second each.
enum { RECORDER_QUEUE_SIZE = 2 << 20 };

typedef struct recorder recorder;

/// False: *opened is null, one line in error.
bool recorder_open(recorder** opened, const char* path, char* error, size_t error_size);
/// Writes the waiting events, for at most patience_us [us], and closes the file. False: writing
/// still blocks; the thread and the recorder stay until the end of the process. Null is fine.
bool recorder_close(recorder* self, int64_t patience_us);

/// utime: the event's own time.
void recorder_put(recorder* self, int64_t utime, const transport_message* message);

/// The errno with which the recording has ended; 0: it has not, or self is null.
int      recorder_fault(const recorder* self);
/// Events that are missing in the file. Null: 0.
uint64_t recorder_dropped(const recorder* self);

#endif
