/// Starts threads with all signals blocked (the main thread handles them), with a stack of a known
/// size and, optionally, with a real-time priority and on given processors.
///
/// Memory      The stack: THREAD_STACK_SIZE, mapped by the C library.
#ifndef VERGE_APPS_THREAD_H
#define VERGE_APPS_THREAD_H

#include <pthread.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// [B] A planning step uses less than a tenth of it. The size is fixed, so that the amount of
/// locked memory is known.
enum { THREAD_STACK_SIZE = 1 << 20 };

enum { THREAD_CPUS_MAX = 64 };

/// All zero: as the caller runs.
typedef struct thread_options {
    int32_t  priority;  ///< 1 .. 99: SCHED_FIFO with it; 0: as the caller
    uint32_t cpu_count; ///< 0: as the caller
    uint32_t cpus[THREAD_CPUS_MAX];
} thread_options;

/// options null: all zero. Returns 0 or an errno: EPERM: the priority is not permitted; EINVAL:
/// none of the processors exists; EAGAIN: no memory or no thread.
int thread_start(pthread_t* thread, const thread_options* options, void* (*run)(void*),
                 void* arg);

/// Gives the calling thread this priority and these processors. Returns 0 or an errno, as above.
int thread_become(const thread_options* options);

#ifdef __cplusplus
}
#endif

#endif
