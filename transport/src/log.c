/// log: LCM event logs, read or written; lcm-logger, lcm-logplayer and Python's lcm.EventLog
/// know the same format.
///
/// An event is: sync word 0xEDA1DA01, event number (8 bytes), time [us] (8), length of the
/// channel's name (4), length of the payload (4), name, payload; numbers big-endian.
///
/// Reading     What is not an event is skipped up to the next sync word that begins one and
///             counted once as malformed; a file cut off in the middle of an event just ends.
///             A damaged length costs its own event only: one that reaches into the next event
///             is refused, see event_holds_another().
/// Writing     Events reach the file with each mark and at close: a log is complete up to its
///             last whole cycle whatever happens to the program.
#include "backend.h"
#include "codec.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
    EVENT_HEADER_SIZE = 28,
    BUFFER_SIZE = 1 << 16,
    PAYLOAD_ROOM = DATAGRAM_SIZE_MAX, // of longer payloads only the beginning is read
};
static const uint32_t sync_word = 0xEDA1DA01u;

typedef struct log_file {
    FILE*     file;
    counters* counts;
    bool      recording;
    bool      ended;
    bool      in_garbage;   ///< the trouble at this place is counted already
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
static bool        event_read(log_file* self, int64_t start, packet* packet);
static bool        header_read(log_file* self, int64_t start, event_header* header);
static bool        event_body_read(log_file* self, const event_header* header, packet* packet);
static bool        event_holds_another(log_file* self, int64_t start, int64_t end);

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
    FILE*     file = fopen(rest, recording ? "wbe" : "rbe");
    struct stat about = { 0 };
    errno = file == NULL ? errno : 0;
    if (made == NULL || file == NULL || fstat(fileno(file), &about) != 0 ||
        (!recording && !S_ISREG(about.st_mode))) {
        snprintf(error, error_size, "log:%s: %s", rest,
                 errno != 0 ? strerror(errno) : "is no regular file, expected an LCM event log");
        if (file != NULL) {
            fclose(file);
        }
        free(made);
        return TRANSPORT_UNAVAILABLE;
    }
    setvbuf(file, made->buffer, _IOFBF, sizeof made->buffer);
    made->file = file;
    made->counts = counts;
    made->recording = recording;
    made->ended = recording;
    made->size = about.st_size;
    *self = made;
    return TRANSPORT_OK;
}

static void log_close(void* self)
{
    log_file* mine = self;
    fclose(mine->file);
    free(mine);
}

static int log_fd(const void* self)
{
    (void)self;
    return -1;
}

static bool log_ended(const void* self)
{
    return ((const log_file*)self)->ended;
}

static take_result log_take(void* self, packet* packet)
{
    log_file* mine = self;
    if (mine->ended || !sync_find(mine)) {
        mine->ended = true;
        return TAKE_NOTHING;
    }
    const int64_t behind_sync = ftello(mine->file);
    if (!event_read(mine, behind_sync, packet)) {
        return event_refuse(mine, behind_sync);
    }
    mine->in_garbage = false;
    return TAKE_PACKET;
}

static int log_send(void* self, int64_t utime, const char* channel, const uint8_t* payload,
                    size_t size)
{
    log_file* mine = self;
    if (!mine->recording) {
        return -1;
    }
    const size_t length = strlen(channel);
    uint8_t      header[EVENT_HEADER_SIZE];
    codec_put_u32(header, sync_word);
    codec_put_u64(header + 4, mine->event_number);
    codec_put_u64(header + 12, (uint64_t)utime);
    codec_put_u32(header + 20, (uint32_t)length);
    codec_put_u32(header + 24, (uint32_t)size);
    mine->event_number += 1;

    const bool written = fwrite(header, sizeof header, 1, mine->file) == 1 &&
                         fwrite(channel, length, 1, mine->file) == 1 &&
                         fwrite(payload, size, 1, mine->file) == 1;
    const bool cycle_ends = codec_kind(channel) == TRANSPORT_MARK;
    const bool kept = !cycle_ends || fflush(mine->file) == 0;
    if (!written || !kept) {
        clearerr(mine->file); // a disk that is full now may have room for the next event
        return -1;
    }
    return 0;
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

/// That sync word began no event: look for the next one right behind it.
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

/// Reads the event whose sync word ends at start. False: it is none, or not all of it is there.
static bool event_read(log_file* self, int64_t start, packet* packet)
{
    event_header header;
    if (!header_read(self, start, &header) || !event_body_read(self, &header, packet)) {
        return false;
    }
    uint8_t behind[4];
    self->behind_sync = fread(behind, sizeof behind, 1, self->file) == 1 &&
                        codec_get_u32(behind) == sync_word;
    return self->behind_sync || !event_holds_another(self, start, header.end);
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
           header->channel_length <= CHANNEL_SIZE_MAX && header->end <= self->size;
}

static bool event_body_read(log_file* self, const event_header* header, packet* packet)
{
    if (fread(packet->channel, header->channel_length, 1, self->file) != 1) {
        return false;
    }
    packet->channel[header->channel_length] = '\0';
    packet->truncated = header->payload_size > PAYLOAD_ROOM;
    packet->size = packet->truncated ? PAYLOAD_ROOM : header->payload_size;
    packet->payload = self->payload;
    packet->utime = header->utime;
    packet->sender = 0;
    if (packet->size > 0 && fread(self->payload, packet->size, 1, self->file) != 1) {
        return false;
    }
    return !packet->truncated || fseeko(self->file, header->end, SEEK_SET) == 0;
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
    .open = log_open,
    .close = log_close,
    .fd = log_fd,
    .ended = log_ended,
    .take = log_take,
    .send = log_send,
    .keeps_time = true,
};
