/// One thread for long jobs, such as a planning step or a reload, so that the main thread can go on
/// with its loop.
///
/// A planning step may take most of a cycle, and stopping has to work within a second whatever
/// the planner does. So the step runs here, and a descriptor shows its end to the main thread. One
/// job at a time; from worker_start() to worker_collect() the job's data belongs to the worker.
/// Nothing is allocated after worker_create().
#ifndef VERGE_DAEMON_WORKER_H
#define VERGE_DAEMON_WORKER_H

#include "common/thread.h"

#include <stdbool.h>

typedef struct worker worker;

/// name: of the thread, at most 15 characters; it outlives the worker. options null: as the caller
/// runs. Null when the system refuses a thread or a descriptor: errno.
worker* worker_create(const char* name, const thread_options* options);
/// Waits for a job that was started. Null is fine.
void worker_destroy(worker* self);

/// A descriptor that becomes readable when the job is over.
int worker_fd(const worker* self);
/// Starts job(arg). No other job may be running or waiting to be collected.
void worker_start(worker* self, void (*job)(void* arg), void* arg);
/// Is a job running, or over but not yet collected?
bool worker_busy(const worker* self);
/// True once for each job, when it is over: its results may be read now.
bool worker_collect(worker* self);

#endif
