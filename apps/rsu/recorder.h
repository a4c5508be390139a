/// The recording of a live daemon: an LCM event log, written by a thread of its own, so that neither
/// a slow disk nor a pipe whose reader has stopped keeps planning waiting.
///
///     recorder* recorder = NULL;
///     if (!recorder_open(&recorder, path, error, sizeof error)) ...
///     recorder_put(recorder, utime, &message);   // never waits
///     if (recorder_fault(recorder) != 0) ...     // it has ended: the disk is full
///
/// Losses      Events beyond RECORDER_QUEUE_SIZE are dropped, and so is what is written to a pipe
///             without a reader; both are counted, and recording goes on when they are read again.
///             Any other failure ends the recording: the log is whole up to there.
/// Memory      recorder_open() allocates everything; recorder_close() frees it.
/// Threads     The main one.
#ifndef VERGE_RSU_RECORDER_H
#define VERGE_RSU_RECORDER_H

#include "verge/transport.h"

/// [B] Five seconds of the largest traffic: 64 vehicles planned twice a second, heard 10 times.
enum { RECORDER_QUEUE_SIZE = 2 << 20 };

typedef struct recorder recorder;

/// False: *opened is null, one line in error.
bool recorder_open(recorder** opened, const char* path, char* error, size_t error_size);
/// Writes what waits, for at most patience_us [us], and closes the file. False: the file still takes
/// nothing; the thread and the recorder are left to the end of the process. Null is fine.
bool recorder_close(recorder* self, int64_t patience_us);

/// utime: the event's own time.
void recorder_put(recorder* self, int64_t utime, const transport_message* message);

/// Why the recording has ended, as an errno; 0: it goes on, or self is null.
int      recorder_fault(const recorder* self);
/// Events that are not in the file and never will be. Null: 0.
uint64_t recorder_dropped(const recorder* self);

#endif
