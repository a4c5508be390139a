/// log: LCM event logs, read or written; lcm-logger, lcm-logplayer and Python's lcm.EventLog
/// know the same format.
///
/// An event is: sync word 0xEDA1DA01, event number (8 bytes), time [us] (8), length of the
/// channel's name (4), length of the payload (4), name, payload; numbers big-endian.
///
/// Reading     Bytes that are not an event are skipped up to the next sync word that begins one,
///             and counted once as malformed. A file may end in the middle of an event.
///             A damaged length costs its own event only: one that reaches into the next event
///             is refused, see event_holds_another().
/// Writing     Events are written with each mark and at close, so that a log is complete up to its
///             last whole cycle if the program dies. Writing may block, for example on a pipe with
///             a slow reader. Events that cannot be written are lost and counted as dropped; later
///             ones are written again.
#include "backend.h"
#include "codec.h"
#include "lcm_event.h"
#include "secret.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
    EVENT_HEADER_SIZE = 28,
    BUFFER_SIZE = 1 << 16,
    PAYLOAD_ROOM = LCM_DATAGRAM_SIZE_MAX, // of longer payloads only the beginning is read
};
static const uint32_t sync_word = 0xEDA1DA01u;

static_assert(BUFFER_SIZE >= EVENT_HEADER_SIZE + LCM_CHANNEL_SIZE_MAX + PAYLOAD_ROOM,
              "an event fits into an empty buffer");

typedef struct log_file {
    FILE*     file;         ///< read from; null when recording
    int       fd;           ///< written to; -1 when reading
    unsigned  receive;
    counters* counts;
    size_t    used;         ///< [B] of buffer that are not written yet
    uint64_t  waiting;      ///< events in these bytes
    bool      ended;
    bool      in_garbage;   ///< the bytes at this place are already counted as malformed
    bool      behind_sync;  ///< the next event's sync word is read already
    int64_t   size;         ///< [B] of the file when it was opened for reading
    uint64_t  event_number; ///< of the next event written
    uint8_t   payload[PAYLOAD_ROOM];
    char      buffer[BUFFER_SIZE];
} log_file;

typedef struct event_header {
    int64_t  utime;
    uint32_t channel_length, payload_size;
    int64_t  end; ///< [B] from the beginning of the file
} event_header;

static bool        sync_find(log_file* self);
static take_result event_refuse(log_file* self, int64_t resume_at);
static bool        event_read(log_file* self, int64_t start, event_header* header,
                              lcm_event* event);
static bool        header_read(log_file* self, int64_t start, event_header* header);
static bool        event_body_read(log_file* self, const event_header* header, lcm_event* event);
static bool        event_holds_another(log_file* self, int64_t start, int64_t end);

static bool open_to_read(log_file* self, const char* path, const char** reason);
static int  open_to_write(const char* path);
static int  flush(log_file* self);

static int log_open(void** self, const char* rest, unsigned receive,
                    const transport_options* options, counters* counts, char* error,
                    size_t error_size)
{
    (void)options;
    *self = NULL;
    const bool recording = (receive & TRANSPORT_RECORD) != 0;
    if (*rest == '\0') {
        snprintf(error, error_size, "log: names no file, expected log:FILE");
        return TRANSPORT_BAD_URL;
    }
    log_file* made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(error, error_size, "log:%s: the system refused memory", rest);
        return TRANSPORT_UNAVAILABLE;
    }
    const char* reason = NULL;
    made->fd = recording ? open_to_write(rest) : -1;
    made->receive = receive;
    made->counts = counts;
    made->ended = recording;
    if (recording && made->fd < 0) {
        reason = strerror(errno);
    }
    if (reason == NULL && (recording || open_to_read(made, rest, &reason))) {
        *self = made;
        return TRANSPORT_OK;
    }
    snprintf(error, error_size, "log:%s: cannot be %s (%s), expected %s", rest,
             recording ? "written" : "read", reason,
             recording ? "a file this user may write" : "an LCM event log");
    free(made);
    return TRANSPORT_UNAVAILABLE;
}

static bool open_to_read(log_file* self, const char* path, const char** reason)
{
    const int   fd = regular_open(path, reason);
    struct stat facts;
    if (fd < 0) {
        return false;
    }
    self->file = fstat(fd, &facts) == 0 ? fdopen(fd, "rb") : NULL;
    if (self->file == NULL) {
        *reason = strerror(errno);
        close(fd);
        return false;
    }
    setvbuf(self->file, self->buffer, _IOFBF, sizeof self->buffer);
    self->size = facts.st_size;
    return true;
}

/// Opening a FIFO for writing waits for a reader. So this function opens it for reading, too, until
/// that has returned. Without another reader, writing fails with EPIPE.
static int open_to_write(const char* path)
{
    struct stat facts;
    const bool fifo = stat(path, &facts) == 0 && S_ISFIFO(facts.st_mode);
    const int  reader = fifo ? open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC) : -1;
    const int  fd = fifo && reader < 0
                        ? -1
                        : open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOCTTY, 0666);
    const int  refused = errno;
    if (reader >= 0) {
        close(reader);
    }
    errno = refused;
    return fd;
}

static void log_close(void* self)
{
    log_file* mine = self;
    if (mine->file != NULL) {
        fclose(mine->file);
    } else {
        flush(mine);
        close(mine->fd);
    }
    free(mine);
}

static bool log_ended(const void* self)
{
    return ((const log_file*)self)->ended;
}

static take_result log_take(void* self, transport_message* message)
{
    log_file* mine = self;
    if (mine->ended || !sync_find(mine)) {
        mine->ended = true;
        return TAKE_NOTHING;
    }
    const int64_t behind_sync = ftello(mine->file);
    event_header  header;
    lcm_event     event;
    if (!event_read(mine, behind_sync, &header, &event)) {
        return event_refuse(mine, behind_sync);
    }
    mine->in_garbage = false;
    message->arrival_utime = header.utime;
    return lcm_event_read(&event, mine->receive, mine->counts, message);
}

static int log_send(void* self, int64_t utime, const transport_message* message)
{
    log_file* mine = self;
    if (mine->fd < 0) {
        errno = EBADF;
        return -1;
    }
    const char*  channel = codec_channel(message->kind);
    const size_t length = strlen(channel);
    const size_t size = codec_size(message->kind);
    const size_t event_size = EVENT_HEADER_SIZE + length + size;
    const bool   room = mine->used + event_size <= BUFFER_SIZE || flush(mine) == 0;
    uint8_t*     event = (uint8_t*)mine->buffer + mine->used;
    codec_put_u32(event, sync_word);
    codec_put_u64(event + 4, mine->event_number);
    codec_put_u64(event + 12, (uint64_t)utime);
    codec_put_u32(event + 20, (uint32_t)length);
    codec_put_u32(event + 24, (uint32_t)size);
    memcpy(event + EVENT_HEADER_SIZE, channel, length);
    codec_encode(message->kind, &message->as, event + EVENT_HEADER_SIZE + length);
    ++mine->event_number;
    mine->used += event_size;
    ++mine->waiting;
    const bool cycle_ends = message->kind == TRANSPORT_MARK;
    return cycle_ends && flush(mine) != 0 ? -1 : room ? 0 : -1;
}

/// Writes the waiting events and blocks until that is done. On failure they are lost: -1 with
/// errno.
static int flush(log_file* self)
{
    size_t written = 0;
    while (written < self->used) {
        const ssize_t part = write(self->fd, self->buffer + written, self->used - written);
        if (part < 0 && errno != EINTR) {
            break;
        }
        written += part > 0 ? (size_t)part : 0;
    }
    const bool whole = written == self->used;
    count_up(&self->counts->dropped, whole ? 0 : self->waiting);
    self->used = 0;
    self->waiting = 0;
    return whole ? 0 : -1;
}

/// Reads on until behind the next sync word. False at the end of the file.
static bool sync_find(log_file* self)
{
    if (self->behind_sync) {
        self->behind_sync = false;
        return true;
    }
    uint32_t window = 0;
    for (uint64_t read = 0;; ++read) {
        const int byte = getc(self->file);
        if (byte == EOF) {
            return false;
        }
        if (read >= 4 && !self->in_garbage) {
            self->in_garbage = true;
            count_up(&self->counts->malformed, 1);
        }
        window = window << 8 | (uint32_t)byte;
        if (read >= 3 && window == sync_word) {
            return true;
        }
    }
}

/// That sync word did not begin an event. The search continues directly after it.
static take_result event_refuse(log_file* self, int64_t resume_at)
{
    if (!self->in_garbage) {
        self->in_garbage = true;
        count_up(&self->counts->malformed, 1);
    }
    if (fseeko(self->file, resume_at, SEEK_SET) != 0) {
        count_up(&self->counts->errors, 1);
        self->ended = true;
    }
    return TAKE_REFUSED;
}

/// Reads the event whose sync word ends at start. False: not an event, or not complete.
static bool event_read(log_file* self, int64_t start, event_header* header, lcm_event* event)
{
    if (!header_read(self, start, header) || !event_body_read(self, header, event)) {
        return false;
    }
    uint8_t behind[4];
    self->behind_sync = fread(behind, sizeof behind, 1, self->file) == 1 &&
                        codec_get_u32(behind) == sync_word;
    return self->behind_sync || !event_holds_another(self, start, header->end);
}

/// False: no event has such a header, or the file ends before the event does.
static bool header_read(log_file* self, int64_t start, event_header* header)
{
    uint8_t bytes[EVENT_HEADER_SIZE - 4];
    if (fread(bytes, sizeof bytes, 1, self->file) != 1) {
        return false;
    }
    header->utime = (int64_t)codec_get_u64(bytes + 8);
    header->channel_length = codec_get_u32(bytes + 16);
    header->payload_size = codec_get_u32(bytes + 20);
    header->end = start + (int64_t)sizeof bytes + header->channel_length + header->payload_size;
    return header->utime >= 0 && header->channel_length > 0 &&
           header->channel_length <= LCM_CHANNEL_SIZE_MAX && header->end <= self->size;
}

static bool event_body_read(log_file* self, const event_header* header, lcm_event* event)
{
    if (fread(event->channel, header->channel_length, 1, self->file) != 1) {
        return false;
    }
    event->channel[header->channel_length] = '\0';
    event->truncated = header->payload_size > PAYLOAD_ROOM;
    event->size = event->truncated ? PAYLOAD_ROOM : header->payload_size;
    event->payload = self->payload;
    if (event->size > 0 && fread(self->payload, event->size, 1, self->file) != 1) {
        return false;
    }
    return !event->truncated || fseeko(self->file, header->end, SEEK_SET) == 0;
}

/// Does another event begin between start and end? No sync word follows the event that ends at
/// `end`: either garbage follows it, or one of its lengths is damaged. In the second case it
/// covers the beginning of the event behind it. Leaves the file at end where none begins.
static bool event_holds_another(log_file* self, int64_t start, int64_t end)
{
    bool seeks = fseeko(self->file, start, SEEK_SET) == 0;
    uint32_t window = 0;
    for (int64_t at = start; seeks && at < end + 3; ++at) {
        const int byte = getc(self->file);
        if (byte == EOF) {
            break;
        }
        window = window << 8 | (uint32_t)byte;
        event_header header;
        if (at >= start + 3 && window == sync_word) {
            if (header_read(self, at + 1, &header)) {
                return true;
            }
            seeks = fseeko(self->file, at + 1, SEEK_SET) == 0;
        }
    }
    return !seeks || fseeko(self->file, end, SEEK_SET) != 0;
}

const backend backend_log = {
    .scheme = "log:",
    .form = "log:FILE",
    .open = log_open,
    .close = log_close,
    .ended = log_ended,
    .take = log_take,
    .send = log_send,
    .keeps_time = true,
};
