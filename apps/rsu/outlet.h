/// A bounded queue between a thread that must never wait and a file that may keep a writer waiting:
/// a pipe whose reader has stopped, a terminal on hold, a slow disk. A thread of its own writes.
///
///     outlet_def def = { .name = "verge-log", .queue_size = 65536, .record_max = 4096,
///                        .write = write_line, .context = self };
///     outlet* outlet = outlet_create(&def);
///     outlet_put(outlet, line, size);          // never waits; full: the record is dropped
///     outlet_dropped(outlet);                  // how many were
///     outlet_close(outlet, 200000);            // writes what is left, for 0.2 s at most
///
/// Records are written whole and in order, one call of write() each.
///
/// Memory      outlet_create() allocates everything; outlet_close() frees it.
/// Threads     One thread puts, asks and closes; write() runs in the outlet's own.
#ifndef VERGE_RSU_OUTLET_H
#define VERGE_RSU_OUTLET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct outlet outlet;

typedef struct outlet_def {
    const char* name;       ///< of the thread, at most 15 characters
    size_t      queue_size; ///< [B] for the records that wait; each costs 4 bytes more than its size
    size_t      record_max; ///< [B] of one record, at most queue_size / 2
    /// Takes one record, and may wait for as long as it has to. False: it is lost, and counted.
    bool      (*write)(void* context, const void* record, size_t size);
    /// After the last record, in the same thread. Null: nothing is left to do.
    void      (*end)(void* context);
    void*       context;
} outlet_def;

/// Null when the system refuses memory or a thread: errno.
outlet* outlet_create(const outlet_def* def);

/// False: there is no room, the record is dropped and counted. Never waits.
bool outlet_put(outlet* self, const void* record, size_t size);

/// Records that were not written: put without room, or lost by write().
uint64_t outlet_dropped(const outlet* self);
/// True: every record that was put is written or lost; nothing waits.
bool outlet_idle(outlet* self);

/// Waits until all is written, for at most patience_us [us], and frees the outlet. False: write()
/// still waits. Its thread goes on by itself and frees the outlet when it is done; what write() uses
/// has to stay where it is. Null is closed already.
bool outlet_close(outlet* self, int64_t patience_us);

#endif
