/// Rate limit for the log lines of a bus (transport_options.log). A line is logged at once. Lines
/// of the same kind are then logged at most every ten seconds, with their number. All kinds
/// together give at most five lines a second.
///
/// Memory      All in the struct, about 4 KiB. If more than COMPLAINT_KINDS_MAX kinds wait, the
///             newest are only counted.
/// Threads     complaints_add() from any thread; complaints_log() from the draining thread, the
///             only one that calls log. Each waits at most while the other copies lines.
#ifndef COMPLAINTS_H
#define COMPLAINTS_H

#include "verge/transport.h"

#include <pthread.h>
#include <stdatomic.h>

enum {
    COMPLAINT_SIZE = 256,       // [B] of a line; longer ones are cut
    COMPLAINT_KINDS_MAX = 16,
    COMPLAINT_PERIOD_S = 10,
    COMPLAINTS_PER_SECOND = 5,
};

typedef struct complaint {
    uint32_t kind;
    uint64_t pending;     ///< lines since the last logged one; 0 in a free place
    int64_t  logged_at_s; ///< 0: never
    char     line[COMPLAINT_SIZE];
} complaint;

typedef struct complaints {
    void          (*log)(void* context, const char* line); ///< null: no log
    void*           log_context;
    atomic_bool     waiting; ///< a line is pending
    pthread_mutex_t lock;
    complaint       kinds[COMPLAINT_KINDS_MAX];
    uint64_t        crowded;     ///< lines without a place, not logged yet
    int64_t         logged_at_s; ///< time of the last line of any kind
} complaints;

void complaints_init(complaints* self, const transport_options* options);
void complaints_destroy(complaints* self);

/// The newest line of a kind is logged. kind: a number of the caller's, or the line's checksum if
/// only identical lines are one kind.
void complaints_add(complaints* self, uint32_t kind, const char* line);

/// Logs the lines that are due. now_s: a monotonic clock, 1 or more. Cheap if no line is pending.
void complaints_log(complaints* self, int64_t now_s);

#endif
