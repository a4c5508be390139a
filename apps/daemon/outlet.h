/// A bounded queue between a thread that must never wait and a file that may block a writer, such
/// as a pipe whose reader has stopped, a stopped terminal or a slow disk. Its own thread writes.
///
///     outlet_def def = { .name = "verge-log", .queue_size = 65536, .record_max = 4096,
///                        .write = write_line, .context = self };
///     outlet* outlet = outlet_create(&def);
///     outlet_put(outlet, line, size);          // never waits; if full, drops the record
///     outlet_dropped(outlet);                  // the number of dropped records
///     outlet_close(outlet, 200000);            // writes the rest, for at most 0.2 s
///
/// Records are written in order, with one call of write() for each.
///
/// Memory      outlet_create() allocates everything; outlet_close() frees it.
/// Threads     One thread calls; write() and end() run in the thread of the outlet.
#ifndef VERGE_DAEMON_OUTLET_H
#define VERGE_DAEMON_OUTLET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct outlet outlet;

typedef struct outlet_def {
    const char* name;       ///< of the thread, at most 15 characters
    size_t      queue_size; ///< [B] for waiting records; each takes its size and 4 bytes
    size_t      record_max; ///< [B] of one record, at most queue_size / 2
    /// Writes one record and may block. False: the record is lost, and counted.
    bool      (*write)(void* context, const void* record, size_t size);
    /// Called after the last record. May be null.
    void      (*end)(void* context);
    void*       context;
} outlet_def;

/// Null when the system refuses memory or a thread: errno.
outlet* outlet_create(const outlet_def* def);

/// Queues a record. False: the queue is full, the record is dropped and counted. Never waits.
bool outlet_put(outlet* self, const void* record, size_t size);

/// Records that were dropped because the queue was full, or lost by write().
uint64_t outlet_dropped(const outlet* self);
/// True: no record waits and none is being written.
bool outlet_idle(outlet* self);

/// Waits until everything is written, for at most patience_us [us], and frees the outlet. False:
/// write() still blocks; the thread frees the outlet later, and what write() uses must stay. Null
/// is fine.
bool outlet_close(outlet* self, int64_t patience_us);

#endif
