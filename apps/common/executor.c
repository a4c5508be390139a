/// One mutex, two conditions, one counter of tasks. A planning step has a few dozen tasks of about
/// a millisecond each, so the cost of locking the mutex for each task is negligible.
#define _GNU_SOURCE
#include "executor.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>

struct executor {
    pthread_mutex_t mutex;
    pthread_cond_t  work_ready;
    pthread_cond_t  work_done;
    void          (*task)(void* arg, uint32_t index);
    void*           arg;
    uint32_t        count;    // tasks of the current run
    uint32_t        next;     // first task not yet taken
    uint32_t        finished; // tasks that are over
    bool            closing;
    uint32_t        helper_count;
    pthread_t       helpers[EXECUTOR_THREADS_MAX];
};

static void  take_tasks(executor* pool);
static void* help(void* context);

executor* executor_create(uint32_t threads)
{
    return executor_create_with(threads, NULL);
}

executor* executor_create_with(uint32_t threads, const thread_options* options)
{
    if (threads < 1 || threads > EXECUTOR_THREADS_MAX) {
        errno = EINVAL;
        return NULL;
    }
    executor* pool = calloc(1, sizeof *pool);
    if (pool == NULL) {
        return NULL;
    }
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->work_ready, NULL);
    pthread_cond_init(&pool->work_done, NULL);

    int refused = 0;
    while (refused == 0 && pool->helper_count + 1 < threads) {
        refused = thread_start(&pool->helpers[pool->helper_count], options, help, pool);
        pool->helper_count += refused == 0 ? 1 : 0;
    }
    if (refused != 0) {
        executor_destroy(pool);
        errno = refused;
        return NULL;
    }
    return pool;
}

void executor_destroy(executor* pool)
{
    if (pool == NULL) {
        return;
    }
    pthread_mutex_lock(&pool->mutex);
    pool->closing = true;
    pthread_cond_broadcast(&pool->work_ready);
    pthread_mutex_unlock(&pool->mutex);
    for (uint32_t i = 0; i < pool->helper_count; ++i) {
        pthread_join(pool->helpers[i], NULL);
    }
    pthread_cond_destroy(&pool->work_done);
    pthread_cond_destroy(&pool->work_ready);
    pthread_mutex_destroy(&pool->mutex);
    free(pool);
}

void executor_run(void* context, void (*task)(void* arg, uint32_t index), void* arg,
                  uint32_t count)
{
    executor* pool = context;
    pthread_mutex_lock(&pool->mutex);
    pool->task = task;
    pool->arg = arg;
    pool->count = count;
    pool->next = 0;
    pool->finished = 0;
    pthread_cond_broadcast(&pool->work_ready);
    take_tasks(pool);
    while (pool->finished < pool->count) {
        pthread_cond_wait(&pool->work_done, &pool->mutex);
    }
    pthread_mutex_unlock(&pool->mutex);
}

/// Works until no task is left to take. The mutex is held on entry and on return.
static void take_tasks(executor* pool)
{
    while (pool->next < pool->count) {
        const uint32_t index = pool->next++;
        pthread_mutex_unlock(&pool->mutex);
        pool->task(pool->arg, index);
        pthread_mutex_lock(&pool->mutex);
        ++pool->finished;
        if (pool->finished == pool->count) {
            pthread_cond_signal(&pool->work_done);
        }
    }
}

static void* help(void* context)
{
    executor* pool = context;
    pthread_setname_np(pthread_self(), "verge-helper");
    pthread_mutex_lock(&pool->mutex);
    while (!pool->closing) {
        take_tasks(pool);
        // A new run may have begun during the last task, so test for tasks before waiting.
        if (!pool->closing && pool->next >= pool->count) {
            pthread_cond_wait(&pool->work_ready, &pool->mutex);
        }
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}
