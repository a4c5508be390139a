/// See recorder.h. A queued record is the used part of a transport_message, which depends on its
/// kind.
#include "recorder.h"

#include "outlet.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct recorder {
    transport*        log;
    outlet*           queue;
    atomic_int        fault;   // errno that ended it
    transport_message message; // of the outlet's thread
};

static bool write_event(void* context, const void* record, size_t size);
static void close_log(void* context);

bool recorder_open(recorder** opened, const char* path, char* error, size_t error_size)
{
    *opened = NULL;
    char url[4096];
    const int length = snprintf(url, sizeof url, "log:%s", path);
    if (length < 0 || (size_t)length >= sizeof url) {
        snprintf(error, error_size, "--record: is too long, expected a path of at most 4000 bytes");
        return false;
    }
    recorder* self = calloc(1, sizeof *self);
    if (self == NULL) {
        snprintf(error, error_size, "--record: the system refused memory");
        return false;
    }
    if (transport_open(&self->log, url, TRANSPORT_RECORD, error, error_size) != TRANSPORT_OK) {
        free(self);
        return false;
    }
    const outlet_def def = {
        .name = "verge-record",
        .queue_size = RECORDER_QUEUE_SIZE,
        .record_max = sizeof(transport_message),
        .write = write_event,
        .end = close_log,
        .context = self,
    };
    self->queue = outlet_create(&def);
    if (self->queue == NULL) {
        snprintf(error, error_size, "--record: the system refused a thread (%s)", strerror(errno));
        transport_close(self->log);
        free(self);
        return false;
    }
    *opened = self;
    return true;
}

bool recorder_close(recorder* self, int64_t patience_us)
{
    if (self == NULL || outlet_close(self->queue, patience_us)) {
        free(self);
        return true;
    }
    return false; // its thread still uses self
}

static size_t size_of(transport_kind kind)
{
    switch (kind) {
    case TRANSPORT_STATE: return sizeof(verge_vehicle_state_t);
    case TRANSPORT_SIGNAL: return sizeof(verge_lane_signal_t);
    case TRANSPORT_PLAN: return sizeof(verge_vehicle_plan_t);
    case TRANSPORT_TRAJECTORY: return sizeof(verge_vehicle_trajectory_t);
    case TRANSPORT_MARK: return sizeof(transport_mark);
    default: return sizeof(((transport_message*)0)->as);
    }
}

void recorder_put(recorder* self, int64_t utime, const transport_message* message)
{
    transport_message record;
    const size_t size = offsetof(transport_message, as) + size_of(message->kind);
    memcpy(&record, message, size);
    record.arrival_utime = utime;
    outlet_put(self->queue, &record, size);
}

/// In the thread of the outlet. The log counts the events that it loses.
static bool write_event(void* context, const void* record, size_t size)
{
    recorder* self = context;
    if (atomic_load(&self->fault) != 0) {
        return true;
    }
    memcpy(&self->message, record, size);
    const bool written =
        transport_record(self->log, self->message.arrival_utime, &self->message) == 0;
    if (!written && errno != EPIPE) {
        atomic_store(&self->fault, errno);
    }
    return true;
}

/// Writes the last events of the log, which may block as well.
static void close_log(void* context)
{
    recorder* self = context;
    transport_close(self->log);
}

int recorder_fault(const recorder* self)
{
    return self != NULL ? atomic_load(&self->fault) : 0;
}

uint64_t recorder_dropped(const recorder* self)
{
    return self != NULL ? outlet_dropped(self->queue) + transport_statistics(self->log).dropped : 0;
}
