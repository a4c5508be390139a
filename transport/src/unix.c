/// unix: datagrams on a Unix socket of this machine, from programs that send to one that receives.
///
/// The datagrams are those of LCM (lcm_event.h), so a program in any language can send a message
/// with an encoder of LCM and a socket, or receive one.
///
/// Direction   One socket file has one receiver, which owns it; senders have no address to answer
///             to. A bus is therefore opened to receive or to send, not for both.
/// Receiving   The socket is bound with mode 0600 and then changed to 0660, so that no program with
///             fewer rights can send meanwhile. The kernel reports the process id of each sender,
///             which a sender cannot forge.
/// Sending     Each send looks up the path, so that a receiver that starts later or again is
///             reached without any action. The kernel keeps few datagrams for a receiver
///             (net.unix.max_dgram_qlen); when its queue is full, a send fails.
/// Loss        Once a second the receiver checks that the file at its path is its own. If the file
///             was removed, it binds a new socket under the same descriptor.
#include "backend.h"
#include "complaints.h"
#include "lcm_event.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum {
    PATH_SIZE_MAX = 100, // [B] sun_path has 108
    REASON_SIZE = 128,
};

typedef struct unix_bus {
    struct sockaddr_un address;
    counters*  counts;
    complaints complaints;
    int        fd;
    // Sender only.
    uint32_t   sequence;
    // Receiver only.
    unsigned   receive;    ///< 0: opened for sending
    struct stat file;      ///< the socket file as it was bound
    int64_t    retry_at_s; ///< [s] monotonic: when to look at the file again
    uint8_t    datagram[LCM_ROOM];
} unix_bus;

static bool path_admitted(const char* path, unsigned use, char* error, size_t error_size);
static int  socket_open(void);
static int  receiver_open(const struct sockaddr_un* address, struct stat* file,
                          char reason[REASON_SIZE]);
static bool path_clear(const struct sockaddr_un* address, char reason[REASON_SIZE]);
static bool file_is_own(const unix_bus* self);
static void receiver_mend(unix_bus* self);
static uint64_t sender_of(struct msghdr* datagram);
static void complain(unix_bus* self, uint32_t kind, const char* reason);

static int unix_open(void** self, const char* rest, unsigned receive,
                     const transport_options* options, counters* counts, char* error,
                     size_t error_size)
{
    *self = NULL;
    if (!path_admitted(rest, receive, error, error_size)) {
        return TRANSPORT_BAD_URL;
    }
    unix_bus* made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(error, error_size, "unix:%s: out of memory", rest);
        return TRANSPORT_UNAVAILABLE;
    }
    made->address.sun_family = AF_UNIX;
    strcpy(made->address.sun_path, rest);
    made->counts = counts;
    made->receive = receive & RECEIVE_MASK;
    char reason[REASON_SIZE] = "the system refused a socket";
    made->fd = made->receive != 0 ? receiver_open(&made->address, &made->file, reason)
                                  : socket_open();
    if (made->fd < 0) {
        snprintf(error, error_size, "unix:%s: %s", rest, reason);
        free(made);
        return TRANSPORT_UNAVAILABLE;
    }
    complaints_init(&made->complaints, options);
    *self = made;
    return TRANSPORT_OK;
}

static void unix_close(void* self)
{
    unix_bus* mine = self;
    if (mine->receive != 0 && file_is_own(mine)) {
        unlink(mine->address.sun_path);
    }
    close(mine->fd);
    complaints_destroy(&mine->complaints);
    free(mine);
}

static int unix_fd(const void* self)
{
    const unix_bus* mine = self;
    return mine->receive != 0 ? mine->fd : -1;
}

static take_result unix_take(void* self, transport_message* message)
{
    unix_bus* mine = self;
    complaints_log(&mine->complaints, backend_now_s());
    if (mine->receive == 0) {
        return TAKE_NOTHING;
    }
    // No room for descriptors that a sender may attach: the kernel closes them.
    char          control[CMSG_SPACE(sizeof(struct ucred))];
    struct iovec  part = { .iov_base = mine->datagram, .iov_len = sizeof mine->datagram };
    struct msghdr datagram = {
        .msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control,
    };
    const ssize_t size = recvmsg(mine->fd, &datagram, MSG_DONTWAIT);
    if (size < 0) {
        const bool idle = errno == EAGAIN || errno == EINTR;
        count_up(&mine->counts->errors, idle ? 0 : 1);
        receiver_mend(mine);
        return TAKE_NOTHING;
    }
    lcm_event event = { .truncated = (datagram.msg_flags & MSG_TRUNC) != 0 };
    if (!lcm_datagram_read(mine->datagram, (size_t)size, &event)) {
        count_up(&mine->counts->malformed, 1);
        return TAKE_REFUSED;
    }
    message->sender = sender_of(&datagram);
    return lcm_event_read(&event, mine->receive, mine->counts, message);
}

static int unix_send(void* self, int64_t utime, const transport_message* message)
{
    (void)utime;
    unix_bus* mine = self;
    if (mine->receive != 0) {
        return -1; // the only receiver at this path is this bus itself
    }
    lcm_datagram event;
    lcm_datagram_write(&event, mine->sequence++, message);
    const struct msghdr datagram = {
        .msg_name = &mine->address,
        .msg_namelen = sizeof mine->address,
        .msg_iov = event.parts,
        .msg_iovlen = 3,
    };
    if (sendmsg(mine->fd, &datagram, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) {
        return 0;
    }
    const int  cause = errno;
    const bool nobody = cause == ENOENT || cause == ECONNREFUSED;
    complain(mine, (uint32_t)cause,
             nobody            ? "no program receives there; messages are lost"
             : cause == EAGAIN ? "the receiver is too slow; messages are lost"
                               : strerror(cause));
    return -1;
}

static void unix_sender_text(const void* self, uint64_t sender, char* text, size_t size)
{
    (void)self;
    snprintf(text, size, "pid %u", (unsigned)sender);
}

static bool path_admitted(const char* path, unsigned use, char* error, size_t error_size)
{
    const size_t length = strlen(path);
    if (length == 0 || length > PATH_SIZE_MAX) {
        snprintf(error, error_size, "unix:%s: expected a path of 1 to %d characters", path,
                 PATH_SIZE_MAX);
        return false;
    }
    if ((use & RECEIVE_MASK) != 0 && (use & SENDS_MASK) != 0) {
        snprintf(error, error_size, "unix:%s: carries messages in one direction, but this program "
                 "would receive and send on it; expected another bus", path);
        return false;
    }
    return true;
}

/// -1 with errno.
static int socket_open(void)
{
    return socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

/// -1 with a reason.
static int receiver_open(const struct sockaddr_un* address, struct stat* file,
                         char reason[REASON_SIZE])
{
    if (!path_clear(address, reason)) {
        return -1;
    }
    const int on = 1, fd = socket_open();
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) != 0 ||
        fchmod(fd, 0600) != 0 ||
        bind(fd, (const struct sockaddr*)address, sizeof *address) != 0 ||
        chmod(address->sun_path, 0660) != 0 || lstat(address->sun_path, file) != 0) {
        snprintf(reason, REASON_SIZE, "the system refused a socket there (%s), expected a folder "
                 "this user may write to", strerror(errno));
        if (fd >= 0) {
            close(fd);
        }
        return -1;
    }
    return fd;
}

/// Removes a socket file that no program has bound. False with a reason: another file is there.
static bool path_clear(const struct sockaddr_un* address, char reason[REASON_SIZE])
{
    struct stat facts;
    if (lstat(address->sun_path, &facts) != 0) {
        return true; // if the folder is missing, bind() fails
    }
    if (!S_ISSOCK(facts.st_mode)) {
        snprintf(reason, REASON_SIZE, "is a file but no socket, expected a free name");
        return false;
    }
    const int probe = socket_open();
    const int cause = connect(probe, (const struct sockaddr*)address, sizeof *address) == 0
                          ? 0 : errno;
    close(probe);
    if (cause == ECONNREFUSED && unlink(address->sun_path) == 0) {
        return true;
    }
    const bool live = cause == 0 || cause == EPROTOTYPE; // the latter: as a stream
    snprintf(reason, REASON_SIZE, "%s",
             live ? "another program receives there, expected a socket of its own for each"
                  : "is a socket that this user may not replace, expected a free name");
    return false;
}

static bool file_is_own(const unix_bus* self)
{
    struct stat facts;
    return lstat(self->address.sun_path, &facts) == 0 && facts.st_dev == self->file.st_dev &&
           facts.st_ino == self->file.st_ino;
}

/// At most once a second, without waiting for anything.
static void receiver_mend(unix_bus* self)
{
    const int64_t now_s = backend_now_s();
    if (now_s < self->retry_at_s) {
        return;
    }
    self->retry_at_s = now_s + 1;
    if (file_is_own(self)) {
        return;
    }
    char      reason[REASON_SIZE];
    const int fresh = receiver_open(&self->address, &self->file, reason);
    if (fresh < 0) {
        count_up(&self->counts->errors, 1);
        complain(self, 0, reason);
        return;
    }
    // The descriptor that the caller polls must not change.
    (void)dup3(fresh, self->fd, O_CLOEXEC);
    close(fresh);
}

/// The process id that the kernel attached; 0: the process is not visible from here.
static uint64_t sender_of(struct msghdr* datagram)
{
    const struct cmsghdr* part = CMSG_FIRSTHDR(datagram);
    if (part == NULL || part->cmsg_level != SOL_SOCKET ||
        part->cmsg_type != SCM_CREDENTIALS) {
        return 0;
    }
    struct ucred credentials;
    memcpy(&credentials, CMSG_DATA(part), sizeof credentials);
    return (uint64_t)credentials.pid;
}

static void complain(unix_bus* self, uint32_t kind, const char* reason)
{
    char line[COMPLAINT_SIZE];
    snprintf(line, sizeof line, "unix:%s: %s", self->address.sun_path, reason);
    complaints_add(&self->complaints, kind, line);
}

const backend backend_unix = {
    .scheme = "unix:",
    .form = "unix:PATH",
    .open = unix_open,
    .close = unix_close,
    .fd = unix_fd,
    .take = unix_take,
    .send = unix_send,
    .sender_text = unix_sender_text,
    .keeps_time = false,
};
