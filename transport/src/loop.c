/// loop: an in-process bus for tests and simulation.
///
/// Every open end has a ring of waiting messages. A sender copies its message into the ring of
/// every other end of the same name that receives its kind. A full ring drops its oldest message
/// and counts it, because the newest states matter most. One lock guards all ends; it is held for
/// one copy.
#include "backend.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

enum {
    ENDS_MAX = 32,
    NAME_SIZE = 64,
    RING_MAX = 256, ///< four cycles of 64 vehicles
};

typedef struct end {
    char      name[NAME_SIZE];
    uint64_t  number; ///< 1 for the first end that was opened in this process
    counters* counts;
    unsigned  receive;
    int       fd; ///< eventfd: readable while the ring holds messages
    uint32_t  first, count;
    transport_message ring[RING_MAX];
} end;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static end*            ends[ENDS_MAX];
static uint64_t        ends_opened;

static bool enlist(end* self);
static void deliver(end* to, uint64_t sender, const transport_message* message);

static int loop_open(void** self, const char* rest, unsigned receive,
                     const transport_options* options, counters* counts, char* error,
                     size_t error_size)
{
    (void)options;
    *self = NULL;
    if (strlen(rest) >= NAME_SIZE) {
        snprintf(error, error_size, "loop:%s: name too long, at most %d characters", rest,
                 NAME_SIZE - 1);
        return TRANSPORT_BAD_URL;
    }
    end* made = calloc(1, sizeof *made);
    const int fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (made != NULL && fd >= 0) {
        strcpy(made->name, rest);
        made->counts = counts;
        made->receive = receive;
        made->fd = fd;
        if (enlist(made)) {
            *self = made;
            return TRANSPORT_OK;
        }
    }
    if (fd >= 0) {
        close(fd);
    }
    free(made);
    snprintf(error, error_size, "loop:%s: no room for another end, at most %d in a process", rest,
             ENDS_MAX);
    return TRANSPORT_UNAVAILABLE;
}

static void loop_close(void* self)
{
    end* mine = self;
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < ENDS_MAX; ++i) {
        if (ends[i] == mine) {
            ends[i] = NULL;
        }
    }
    pthread_mutex_unlock(&lock);
    close(mine->fd);
    free(mine);
}

static int loop_fd(const void* self)
{
    return ((const end*)self)->fd;
}

static take_result loop_take(void* self, transport_message* message)
{
    end* mine = self;
    take_result result = TAKE_NOTHING;
    pthread_mutex_lock(&lock);
    if (mine->count > 0) {
        *message = mine->ring[mine->first];
        mine->first = (mine->first + 1) % RING_MAX;
        --mine->count;
        result = TAKE_MESSAGE;
    }
    if (mine->count == 0) {
        uint64_t readings; // a successful or failed read leaves the descriptor unreadable
        (void)!read(mine->fd, &readings, sizeof readings);
    }
    pthread_mutex_unlock(&lock);
    return result;
}

static int loop_send(void* self, int64_t utime, const transport_message* message)
{
    (void)utime;
    const end* mine = self;
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < ENDS_MAX; ++i) {
        if (ends[i] != NULL && ends[i] != mine && strcmp(ends[i]->name, mine->name) == 0) {
            deliver(ends[i], mine->number, message);
        }
    }
    pthread_mutex_unlock(&lock);
    return 0;
}

static bool enlist(end* self)
{
    bool done = false;
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < ENDS_MAX && !done; ++i) {
        if (ends[i] == NULL) {
            ends[i] = self;
            self->number = ++ends_opened;
            done = true;
        }
    }
    pthread_mutex_unlock(&lock);
    return done;
}

static void deliver(end* to, uint64_t sender, const transport_message* message)
{
    if ((to->receive & 1u << message->kind) == 0) {
        count_up(&to->counts->foreign, 1);
        return;
    }
    if (to->count == RING_MAX) {
        to->first = (to->first + 1) % RING_MAX;
        --to->count;
        count_up(&to->counts->dropped, 1);
    }
    transport_message* slot = &to->ring[(to->first + to->count) % RING_MAX];
    *slot = *message;
    slot->sender = sender;
    ++to->count;

    const uint64_t one = 1;
    (void)!write(to->fd, &one, sizeof one); // fails only when the counter is full: still readable
}

const backend backend_loop = {
    .scheme = "loop:",
    .form = "loop:NAME",
    .open = loop_open,
    .close = loop_close,
    .fd = loop_fd,
    .take = loop_take,
    .send = loop_send,
    .keeps_time = false,
};
