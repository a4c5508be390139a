/// What a bus complains of on its way to transport_options.log: the same trouble at once, then
/// every ten seconds at most with how often it came, and never more than five lines a second.
///
/// Memory      All in the struct, some 4 KiB. Where more kinds wait than there is room for, the
///             newest are only counted.
/// Threads     complaints_add() from any; complaints_tell() from the one that drains, so that log
///             is called there alone. Neither waits longer than the other copies lines.
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
    uint64_t untold;    ///< times since it was told; 0 in a free place
    int64_t  told_at_s; ///< 0: never
    char     line[COMPLAINT_SIZE];
} complaint;

typedef struct complaints {
    void          (*log)(void* context, const char* line); ///< null: nobody listens
    void*           log_context;
    atomic_bool     waiting; ///< something is untold
    pthread_mutex_t lock;
    complaint       kinds[COMPLAINT_KINDS_MAX];
    uint64_t        crowded;   ///< lines that found no place
    int64_t         told_at_s; ///< when anything was told last
} complaints;

void complaints_init(complaints* self, const transport_options* options);
void complaints_destroy(complaints* self);

/// Of one kind the newest line is told. Where a line is its own kind: its checksum.
void complaints_add(complaints* self, uint32_t kind, const char* line);

/// Tells what is due. now_s: a clock that never steps back, 1 or more. Cheap while nothing waits.
void complaints_tell(complaints* self, int64_t now_s);

#endif
