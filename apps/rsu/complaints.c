#include "complaints.h"

#include <stdio.h>
#include <string.h>

void complaints_init(complaints* self)
{
    memset(self, 0, sizeof *self);
    pthread_mutex_init(&self->lock, NULL);
}

void complaints_put(void* self, const char* line)
{
    complaints* mine = self;
    pthread_mutex_lock(&mine->lock);
    if (mine->count == COMPLAINTS_MAX) {
        mine->given_up += 1;
    } else {
        char* place = mine->lines[(mine->first + mine->count) % COMPLAINTS_MAX];
        snprintf(place, COMPLAINT_SIZE, "%s", line);
        mine->count += 1;
    }
    pthread_mutex_unlock(&mine->lock);
}

bool complaints_take(complaints* self, char line[COMPLAINT_SIZE], uint64_t* given_up)
{
    pthread_mutex_lock(&self->lock);
    const bool waits = self->count > 0;
    if (waits) {
        memcpy(line, self->lines[self->first], COMPLAINT_SIZE);
        self->first = (self->first + 1) % COMPLAINTS_MAX;
        self->count -= 1;
        *given_up = self->given_up;
        self->given_up = 0;
    }
    pthread_mutex_unlock(&self->lock);
    return waits;
}
