#include "complaints.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static complaint* place_of(complaints* self, uint32_t kind);
static uint32_t   due_take(complaints* self, int64_t now_s, complaint* due);

void complaints_init(complaints* self, const transport_options* options)
{
    memset(self, 0, sizeof *self);
    self->log = options->log;
    self->log_context = options->log_context;
    pthread_mutex_init(&self->lock, NULL);
}

void complaints_destroy(complaints* self)
{
    pthread_mutex_destroy(&self->lock);
}

void complaints_add(complaints* self, uint32_t kind, const char* line)
{
    if (self->log == NULL) {
        return;
    }
    pthread_mutex_lock(&self->lock);
    complaint* place = place_of(self, kind);
    if (place == NULL) {
        ++self->crowded;
    } else {
        ++place->pending;
        snprintf(place->line, sizeof place->line, "%s", line);
    }
    atomic_store(&self->waiting, true);
    pthread_mutex_unlock(&self->lock);
}

void complaints_log(complaints* self, int64_t now_s)
{
    if (!atomic_load(&self->waiting) || now_s == self->logged_at_s) {
        return;
    }
    complaint due[COMPLAINTS_PER_SECOND];
    pthread_mutex_lock(&self->lock);
    const uint32_t count = due_take(self, now_s, due);
    const uint64_t crowded = count > 0 ? self->crowded : 0;
    self->crowded -= crowded;
    pthread_mutex_unlock(&self->lock);

    // Without the lock, because log may take time.
    for (uint32_t i = 0; i < count; ++i) {
        char line[COMPLAINT_SIZE + 80];
        int  size = snprintf(line, sizeof line, "%s", due[i].line);
        if (due[i].pending > 1) {
            size += snprintf(line + size, sizeof line - (size_t)size, " (%" PRIu64 " times)",
                             due[i].pending);
        }
        if (i + 1 == count && crowded > 0) {
            snprintf(line + size, sizeof line - (size_t)size, " (and %" PRIu64 " other lines)",
                     crowded);
        }
        self->logged_at_s = now_s;
        self->log(self->log_context, line);
    }
}

/// The place of this kind, else a place without a pending line, the one logged first. Null: all
/// places have pending lines.
static complaint* place_of(complaints* self, uint32_t kind)
{
    complaint* oldest = NULL;
    for (uint32_t i = 0; i < COMPLAINT_KINDS_MAX; ++i) {
        complaint* place = &self->kinds[i];
        if (place->kind == kind && (place->logged_at_s != 0 || place->pending > 0)) {
            return place;
        }
        if (place->pending == 0 && (oldest == NULL || place->logged_at_s < oldest->logged_at_s)) {
            oldest = place;
        }
    }
    if (oldest != NULL) {
        *oldest = (complaint){ .kind = kind };
    }
    return oldest;
}

static uint32_t due_take(complaints* self, int64_t now_s, complaint* due)
{
    uint32_t count = 0;
    bool     waiting = false;
    for (uint32_t i = 0; i < COMPLAINT_KINDS_MAX; ++i) {
        complaint* place = &self->kinds[i];
        const bool is_due =
            place->logged_at_s == 0 || now_s >= place->logged_at_s + COMPLAINT_PERIOD_S;
        if (place->pending > 0 && is_due && count < COMPLAINTS_PER_SECOND) {
            due[count++] = *place;
            place->logged_at_s = now_s;
            place->pending = 0;
        }
        waiting = waiting || place->pending > 0;
    }
    atomic_store(&self->waiting, waiting);
    return count;
}
