/// Starting a thread the way every thread of ours is started: it takes no signals (they belong to
/// the thread that started it), its stack has a known size, and where asked it runs with a
/// real-time priority and on named processors.
///
/// Memory      The stack: THREAD_STACK_SIZE, mapped by the C library.
#ifndef VERGE_APPS_THREAD_H
#define VERGE_APPS_THREAD_H

#include <pthread.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// [B] A planning step needs less than a tenth of it. Fixed, so that locked memory can be told
/// beforehand.
enum { THREAD_STACK_SIZE = 1 << 20 };

enum { THREAD_CPUS_MAX = 64 };

/// All zero: as the caller runs.
typedef struct thread_options {
    int32_t  priority;  ///< 1 .. 99: SCHED_FIFO with it; 0: as the caller
    uint32_t cpu_count; ///< 0: as the caller
    uint32_t cpus[THREAD_CPUS_MAX];
} thread_options;

/// options null: all zero. Returns 0 or an errno: EPERM where the system refuses the priority,
/// EINVAL where it has none of the processors, EAGAIN where it refuses memory or a thread.
int thread_start(pthread_t* thread, const thread_options* options, void* (*run)(void*),
                 void* arg);

#ifdef __cplusplus
}
#endif

#endif
