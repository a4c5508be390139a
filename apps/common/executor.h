/// A fixed pool of threads that runs the tasks of one planning step.
///
///     executor* pool = executor_create(4);
///     def.executor = executor_run;
///     def.executor_context = pool;
///     ...
///     executor_destroy(pool);
///
/// Memory      executor_create() allocates and starts the threads; executor_run() does neither.
/// Threads     One caller at a time. The caller runs tasks too, so threads - 1 helpers are started.
/// Digests     Any thread may run any task. Tasks share nothing, so the plan does not depend on it.
#ifndef VERGE_APPS_EXECUTOR_H
#define VERGE_APPS_EXECUTOR_H

#include "thread.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct executor executor;

enum { EXECUTOR_THREADS_MAX = 64 };

/// threads: 1 .. EXECUTOR_THREADS_MAX, including the caller. Null: the reason is in errno.
executor* executor_create(uint32_t threads);
/// The same with options for the helpers (null: as the caller).
executor* executor_create_with(uint32_t threads, const thread_options* options);
void executor_destroy(executor* pool); ///< null: no effect

/// A verge_executor: context is the pool.
void executor_run(void* context, void (*task)(void* arg, uint32_t index), void* arg,
                  uint32_t count);

#ifdef __cplusplus
}
#endif

#endif
