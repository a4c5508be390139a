/// Lines from a bus's own threads on their way to the log, which belongs to the main thread.
///
/// Memory      All in the struct, some 4 KiB. A full one gives up the newest line and counts it.
/// Threads     complaints_put() from any, complaints_take() from the main one. Neither waits longer
///             than the other copies a line.
#ifndef VERGE_RSU_COMPLAINTS_H
#define VERGE_RSU_COMPLAINTS_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

enum { COMPLAINT_SIZE = 256, COMPLAINTS_MAX = 16 };

typedef struct complaints {
    pthread_mutex_t lock;
    char     lines[COMPLAINTS_MAX][COMPLAINT_SIZE];
    uint32_t first, count;
    uint64_t given_up; ///< since the last line was taken
} complaints;

void complaints_init(complaints* self);
/// The type of transport_options.log: self is a complaints. A line that is too long is cut.
void complaints_put(void* self, const char* line);
/// The oldest line and how many were given up before it. False: nothing waits.
bool complaints_take(complaints* self, char line[COMPLAINT_SIZE], uint64_t* given_up);

#endif
