#define _GNU_SOURCE
#include "worker.h"

#include <assert.h>
#include <errno.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

struct worker {
    const char* name;
    pthread_t thread;
    sem_t     jobs;    // posted once a job, and once to close
    int       done_fd; // eventfd: ended jobs that are not collected
    bool      busy;    // of the main thread only
    void    (*job)(void* arg); // null: the one that was started is taken
    void*     arg;
};

static void* work(void* context);

worker* worker_create(const char* name, const thread_options* options)
{
    worker* self = calloc(1, sizeof *self);
    if (self == NULL) {
        return NULL;
    }
    self->done_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (self->done_fd < 0) {
        free(self);
        return NULL;
    }
    self->name = name;
    sem_init(&self->jobs, 0, 0);
    const int refused = thread_start(&self->thread, options, work, self);
    if (refused != 0) {
        close(self->done_fd);
        sem_destroy(&self->jobs);
        free(self);
        errno = refused;
        return NULL;
    }
    return self;
}

void worker_destroy(worker* self)
{
    if (self == NULL) {
        return;
    }
    sem_post(&self->jobs); // after a job that was started, one that is none
    pthread_join(self->thread, NULL);
    sem_destroy(&self->jobs);
    close(self->done_fd);
    free(self);
}

int worker_fd(const worker* self)
{
    return self->done_fd;
}

void worker_start(worker* self, void (*job)(void* arg), void* arg)
{
    assert(!self->busy);
    self->busy = true;
    self->job = job;
    self->arg = arg;
    sem_post(&self->jobs);
}

bool worker_busy(const worker* self)
{
    return self->busy;
}

bool worker_collect(worker* self)
{
    uint64_t ended = 0;
    if (read(self->done_fd, &ended, sizeof ended) != (ssize_t)sizeof ended) {
        return false;
    }
    assert(self->busy && ended == 1);
    self->busy = false;
    return true;
}

static void* work(void* context)
{
    worker* self = context;
    pthread_setname_np(pthread_self(), self->name);
    for (;;) {
        while (sem_wait(&self->jobs) != 0) {
        }
        void (*const job)(void* arg) = self->job;
        if (job == NULL) {
            return NULL;
        }
        self->job = NULL;
        job(self->arg);
        const uint64_t one = 1;
        const ssize_t ignored = write(self->done_fd, &one, sizeof one);
        (void)ignored;
    }
}
