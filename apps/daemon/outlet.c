/// See outlet.h. A ring of bytes, in which each record follows its size. The thread copies a record
/// and writes it without the lock, so that outlet_put() waits for a copy at most.
#define _GNU_SOURCE
#include "outlet.h"

#include "common/thread.h"

#include <assert.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct outlet {
    outlet_def      def;
    pthread_t       thread;
    pthread_mutex_t lock;
    pthread_cond_t  more;   // there is a record, or closing is set
    pthread_cond_t  ended;  // over is set
    size_t          first;  // [B] where the oldest record begins in the ring
    size_t          used;   // [B]
    bool            writing;
    bool            closing;
    bool            over;
    bool            abandoned; // outlet_close() has given up: the thread frees everything
    atomic_uint_fast64_t dropped;
    char*           record; // that is being written
    char            ring[];
};

static void* work(void* context);
static void  release(outlet* self);
static void  ring_add(outlet* self, const void* bytes, size_t size);
static void  ring_take(outlet* self, void* bytes, size_t size);

outlet* outlet_create(const outlet_def* def)
{
    assert(def->record_max + sizeof(uint32_t) <= def->queue_size / 2);
    outlet* self = calloc(1, sizeof *self + def->queue_size + def->record_max);
    if (self == NULL) {
        return NULL;
    }
    self->def = *def;
    self->record = self->ring + def->queue_size;
    pthread_condattr_t clock;
    pthread_condattr_init(&clock);
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
    pthread_mutex_init(&self->lock, NULL);
    pthread_cond_init(&self->more, NULL);
    pthread_cond_init(&self->ended, &clock);
    pthread_condattr_destroy(&clock);
    const int refused = thread_start(&self->thread, NULL, work, self);
    if (refused != 0) {
        free(self);
        errno = refused;
        return NULL;
    }
    pthread_setname_np(self->thread, def->name);
    return self;
}

bool outlet_put(outlet* self, const void* record, size_t size)
{
    assert(size <= self->def.record_max);
    const uint32_t head = (uint32_t)size;
    pthread_mutex_lock(&self->lock);
    const bool fits = self->used + sizeof head + size <= self->def.queue_size;
    if (fits) {
        ring_add(self, &head, sizeof head);
        ring_add(self, record, size);
        pthread_cond_signal(&self->more);
    }
    pthread_mutex_unlock(&self->lock);
    if (!fits) {
        atomic_fetch_add(&self->dropped, 1);
    }
    return fits;
}

uint64_t outlet_dropped(const outlet* self)
{
    return atomic_load(&self->dropped);
}

bool outlet_idle(outlet* self)
{
    pthread_mutex_lock(&self->lock);
    const bool idle = self->used == 0 && !self->writing;
    pthread_mutex_unlock(&self->lock);
    return idle;
}

bool outlet_close(outlet* self, int64_t patience_us)
{
    if (self == NULL) {
        return true;
    }
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    const int64_t end_ns = (int64_t)until.tv_nsec + patience_us * 1000;
    until.tv_sec += (time_t)(end_ns / 1000000000);
    until.tv_nsec = (long)(end_ns % 1000000000);

    pthread_mutex_lock(&self->lock);
    self->closing = true;
    pthread_cond_signal(&self->more);
    int late = 0;
    while (!self->over && late == 0) {
        late = pthread_cond_timedwait(&self->ended, &self->lock, &until);
    }
    const bool over = self->over;
    if (!over) {
        self->abandoned = true;
        pthread_detach(self->thread);
    }
    pthread_mutex_unlock(&self->lock);
    if (over) {
        pthread_join(self->thread, NULL);
        release(self);
    }
    return over;
}

static void release(outlet* self)
{
    pthread_cond_destroy(&self->ended);
    pthread_cond_destroy(&self->more);
    pthread_mutex_destroy(&self->lock);
    free(self);
}

/// The lock is held except while a record is written.
static void* work(void* context)
{
    outlet* self = context;
    pthread_mutex_lock(&self->lock);
    while (self->used > 0 || !self->closing) {
        if (self->used == 0) {
            pthread_cond_wait(&self->more, &self->lock);
            continue;
        }
        uint32_t size = 0;
        ring_take(self, &size, sizeof size);
        ring_take(self, self->record, size);
        self->writing = true;
        pthread_mutex_unlock(&self->lock);
        if (!self->def.write(self->def.context, self->record, size)) {
            atomic_fetch_add(&self->dropped, 1);
        }
        pthread_mutex_lock(&self->lock);
        self->writing = false;
    }
    pthread_mutex_unlock(&self->lock);
    if (self->def.end != NULL) {
        self->def.end(self->def.context);
    }
    pthread_mutex_lock(&self->lock);
    self->over = true;
    const bool abandoned = self->abandoned;
    pthread_cond_signal(&self->ended);
    pthread_mutex_unlock(&self->lock);
    if (abandoned) {
        release(self);
    }
    return NULL;
}

// ---- the ring -------------------------------------------------------------------------------

static size_t smaller(size_t a, size_t b)
{
    return a < b ? a : b;
}

static void ring_add(outlet* self, const void* bytes, size_t size)
{
    const size_t end = (self->first + self->used) % self->def.queue_size;
    const size_t straight = smaller(size, self->def.queue_size - end);
    memcpy(self->ring + end, bytes, straight);
    memcpy(self->ring, (const char*)bytes + straight, size - straight);
    self->used += size;
}

static void ring_take(outlet* self, void* bytes, size_t size)
{
    const size_t straight = smaller(size, self->def.queue_size - self->first);
    memcpy(bytes, self->ring + self->first, straight);
    memcpy((char*)bytes + straight, self->ring, size - straight);
    self->first = (self->first + size) % self->def.queue_size;
    self->used -= size;
}
