/// lcm: LCM's UDP multicast protocol, implemented without LCM's library.
///
/// One datagram holds one event (lcm_event.h). Every message fits one datagram, so longer events,
/// which LCM splits into "LC03" fragments, are refused. LCM's library is not used because it
/// crashes on a fragment whose offset wraps around, keeps the oldest instead of the newest events,
/// and needs a thread and a heap.
///
/// Receiving   A socket bound to the address of the group. Bound to any address, it would receive
///             every group of this port. The kernel reports its count of lost datagrams with each
///             datagram.
/// Sending     A second socket; the kernel selects the interface by its route to the group.
/// Loss        A send without a route fails, is counted, and succeeds again when the route is back.
///             Once a second the receiver joins the group again. This has no effect while it is a
///             member, and restores membership after the interface was removed and added again. A
///             broken receiving socket is replaced under the same descriptor.
/// Security    With an allow list or keys, messages of other addresses and unsigned, forged or
///             replayed ones are refused, counted and logged: lcm_auth.h. Channels that were not
///             requested are not checked.
#include "backend.h"
#include "codec.h"
#include "complaints.h"
#include "lcm_auth.h"
#include "lcm_event.h"
#include "settings.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { RECEIVE_BUFFER_SIZE = 1 << 20 }; // [B] of the kernel: 700 datagrams wait while we plan

/// udpm://ADDRESS:PORT?ttl=N&recv_buf_size=N, each part optional as in LCM.
typedef struct target {
    struct sockaddr_in group;
    uint8_t            ttl;
    int                buffer_size; ///< [B] requested; the kernel limits it to net.core.rmem_max
} target;

typedef struct lcm {
    target    to;
    counters* counts;
    // Sender only.
    int       send_fd;
    uint32_t  sequence;
    // Receiver only.
    unsigned  receive;
    int       receive_fd; ///< -1: opened for sending only
    uint32_t  lost_before; ///< the kernel's count at the last datagram
    int64_t   retry_at_s;  ///< [s] monotonic: when to join again
    uint8_t   datagram[LCM_ROOM];
    // Both.
    lcm_auth  auth;
    complaints complaints;
} lcm;

static bool target_parse(target* to, const char* url);
static int  sender_open(const target* to);
static int  receiver_open(const target* to);
static int  group_join(int fd, const target* to);
static void explain(char* error, size_t error_size, const char* url, int cause);
static void receiver_mend(lcm* self, bool broken);
static void count_lost(lcm* self, struct msghdr* message);
static transport_refusal judge(lcm* self, const struct sockaddr_in* from, lcm_event* event);
static void complain(lcm* self, transport_refusal refusal, uint64_t sender);

static int lcm_open(void** self, const char* rest, unsigned receive,
                    const transport_options* options, counters* counts, char* error,
                    size_t error_size)
{
    *self = NULL;
    target to;
    if (!target_parse(&to, rest)) {
        snprintf(error, error_size,
                 "lcm:%s: expected udpm://ADDRESS:PORT?ttl=N with a multicast address "
                 "(224.0.0.0 to 239.255.255.255), a port and a ttl of 0 to 255", rest);
        return TRANSPORT_BAD_URL;
    }
    lcm* made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(error, error_size, "lcm:%s: out of memory", rest);
        return TRANSPORT_UNAVAILABLE;
    }
    if (!lcm_auth_init(&made->auth, options, error, error_size)) {
        free(made);
        return TRANSPORT_BAD_URL;
    }
    made->to = to;
    made->counts = counts;
    made->receive = receive;
    complaints_init(&made->complaints, options);
    made->send_fd = sender_open(&to);
    made->receive_fd = -1;
    const bool wanted = (receive & RECEIVE_MASK) != 0;
    if (made->send_fd >= 0 && wanted) {
        made->receive_fd = receiver_open(&to);
    }
    if (made->send_fd < 0 || (wanted && made->receive_fd < 0)) {
        explain(error, error_size, rest, errno);
        if (made->send_fd >= 0) {
            close(made->send_fd);
        }
        lcm_auth_wipe(&made->auth);
        complaints_destroy(&made->complaints);
        free(made);
        return TRANSPORT_UNAVAILABLE;
    }
    *self = made;
    return TRANSPORT_OK;
}

static void lcm_close(void* self)
{
    lcm* mine = self;
    close(mine->send_fd);
    if (mine->receive_fd >= 0) {
        close(mine->receive_fd);
    }
    lcm_auth_wipe(&mine->auth);
    complaints_destroy(&mine->complaints);
    free(mine);
}

static int lcm_fd(const void* self)
{
    return ((const lcm*)self)->receive_fd;
}

static take_result lcm_take(void* self, transport_message* message)
{
    lcm* mine = self;
    if (mine->receive_fd < 0) {
        return TAKE_NOTHING;
    }
    char          control[CMSG_SPACE(sizeof(uint32_t))];
    struct iovec  part = { .iov_base = mine->datagram, .iov_len = sizeof mine->datagram };
    struct sockaddr_in from = { 0 };
    struct msghdr datagram = {
        .msg_name = &from,
        .msg_namelen = sizeof from,
        .msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control,
    };
    complaints_log(&mine->complaints, backend_now_s());
    const ssize_t size = recvmsg(mine->receive_fd, &datagram, MSG_DONTWAIT);
    if (size < 0) {
        const bool idle = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
        if (!idle) {
            count_up(&mine->counts->errors, 1);
        }
        receiver_mend(mine, !idle);
        return TAKE_NOTHING;
    }
    count_lost(mine, &datagram);
    lcm_event event = { .truncated = (datagram.msg_flags & MSG_TRUNC) != 0 };
    if (!lcm_datagram_read(mine->datagram, (size_t)size, &event)) {
        count_up(&mine->counts->malformed, 1);
        return TAKE_REFUSED;
    }
    message->sender = (uint64_t)ntohl(from.sin_addr.s_addr) << 16 | ntohs(from.sin_port);
    const transport_refusal refusal = judge(mine, &from, &event);
    if (refusal != TRANSPORT_ADMITTED) {
        count_up(&mine->counts->refused[refusal], 1);
        complain(mine, refusal, message->sender);
        return TAKE_REFUSED;
    }
    return lcm_event_read(&event, mine->receive, mine->counts, message);
}

static int lcm_send(void* self, int64_t utime, const transport_message* message)
{
    (void)utime;
    lcm*         mine = self;
    lcm_datagram event;
    uint8_t      trailer[LCM_AUTH_TRAILER_SIZE];
    lcm_datagram_write(&event, mine->sequence++, message);
    if (mine->auth.own_key != NULL) {
        lcm_auth_sign(&mine->auth, backend_utime_now(), &event.parts[1], 2, trailer);
        event.parts[3] = (struct iovec){ .iov_base = trailer, .iov_len = sizeof trailer };
    }
    const struct msghdr datagram = {
        .msg_name = &mine->to.group,
        .msg_namelen = sizeof mine->to.group,
        .msg_iov = event.parts,
        .msg_iovlen = 4,
    };
    return sendmsg(mine->send_fd, &datagram, MSG_DONTWAIT | MSG_NOSIGNAL) < 0 ? -1 : 0;
}

static void lcm_sender_text(const void* self, uint64_t sender, char* text, size_t size)
{
    (void)self;
    const unsigned address = (unsigned)(sender >> 16), port = (unsigned)sender & 65535;
    snprintf(text, size, "%u.%u.%u.%u:%u", address >> 24, address >> 16 & 255, address >> 8 & 255,
             address & 255, port);
}

/// The end of a number and its value in [0, max], or null.
static const char* number_parse(const char* text, long max, long* value)
{
    char* end = NULL;
    if (*text < '0' || *text > '9') {
        return NULL;
    }
    errno = 0;
    *value = strtol(text, &end, 10);
    return errno == 0 && *value <= max ? end : NULL;
}

/// "ttl=1&recv_buf_size=2000000"; where it ended, or null.
static const char* options_parse(const char* at, target* to)
{
    static const char ttl_key[] = "ttl=", size_key[] = "recv_buf_size=";
    do {
        long value = 0;
        if (strncmp(at, ttl_key, sizeof ttl_key - 1) == 0) {
            at = number_parse(at + sizeof ttl_key - 1, 255, &value);
            to->ttl = (uint8_t)value;
        } else if (strncmp(at, size_key, sizeof size_key - 1) == 0) {
            at = number_parse(at + sizeof size_key - 1, 1 << 30, &value);
            to->buffer_size = (int)value;
        } else {
            return NULL;
        }
    } while (at != NULL && *at++ == '&');
    return at != NULL ? at - 1 : NULL;
}

static bool target_parse(target* to, const char* url)
{
    static const char scheme[] = "udpm://";
    if (strncmp(url, scheme, sizeof scheme - 1) != 0) {
        return false;
    }
    const char*  at = url + sizeof scheme - 1;
    char         address[16] = "239.255.76.67"; // LCM's default group, port and ttl
    long         port = 7667;
    const size_t length = strcspn(at, ":?");
    if (length >= sizeof address) {
        return false;
    }
    if (length > 0) {
        memcpy(address, at, length);
        address[length] = '\0';
    }
    at += length;
    if (*at == ':') {
        at = number_parse(at + 1, 65535, &port);
    }
    *to = (target){ .ttl = 0, .buffer_size = RECEIVE_BUFFER_SIZE };
    if (at != NULL && *at == '?') {
        at = options_parse(at + 1, to);
    }
    if (at == NULL || *at != '\0' || port == 0) {
        return false;
    }
    to->group.sin_family = AF_INET;
    to->group.sin_port = htons((uint16_t)port);
    return inet_pton(AF_INET, address, &to->group.sin_addr) == 1 &&
           IN_MULTICAST(ntohl(to->group.sin_addr.s_addr));
}

/// -1 with errno. Connecting a temporary socket tests for a route without sending.
static int sender_open(const target* to)
{
    const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (probe < 0) {
        return -1;
    }
    const int routed = connect(probe, (const struct sockaddr*)&to->group, sizeof to->group);
    const int cause = errno;
    close(probe);
    if (routed != 0) {
        errno = cause;
        return -1;
    }
    const int     fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const uint8_t heard_here = 1; // other programs of this machine listen too
    if (fd >= 0) {
        (void)setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &to->ttl, sizeof to->ttl);
        (void)setsockopt(fd, IPPROTO_IP, IP_MULTICAST_LOOP, &heard_here, sizeof heard_here);
    }
    return fd;
}

/// -1 with errno.
static int receiver_open(const target* to)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return -1;
    }
    const int on = 1;
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &to->buffer_size, sizeof to->buffer_size);
    (void)setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (bind(fd, (const struct sockaddr*)&to->group, sizeof to->group) != 0 ||
        group_join(fd, to) != 0) {
        const int cause = errno;
        close(fd);
        errno = cause;
        return -1;
    }
    return fd;
}

/// Returns 0 also if the socket is already a member of the group.
static int group_join(int fd, const target* to)
{
    const struct ip_mreq membership = {
        .imr_multiaddr = to->group.sin_addr,
        .imr_interface.s_addr = htonl(INADDR_ANY), // the interface of the route to the group
    };
    const int result = setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership,
                                  sizeof membership);
    return result != 0 && errno == EADDRINUSE ? 0 : result;
}

static void explain(char* error, size_t error_size, const char* url, int cause)
{
    if (cause == ENETUNREACH || cause == ENODEV || cause == EADDRNOTAVAIL) {
        snprintf(error, error_size,
                 "lcm:%s: no multicast route on this machine; for one machine run: "
                 "ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo", url);
    } else {
        snprintf(error, error_size, "lcm:%s: %s", url, strerror(cause));
    }
}

/// At most once a second, without waiting for anything.
static void receiver_mend(lcm* self, bool broken)
{
    const int64_t now_s = backend_now_s();
    if (now_s < self->retry_at_s) {
        return;
    }
    self->retry_at_s = now_s + 1;
    if (!broken) {
        if (group_join(self->receive_fd, &self->to) != 0) {
            count_up(&self->counts->errors, 1);
        }
        return;
    }
    const int fresh = receiver_open(&self->to);
    if (fresh < 0) {
        count_up(&self->counts->errors, 1);
        return;
    }
    // The descriptor that the caller polls must not change.
    if (dup3(fresh, self->receive_fd, O_CLOEXEC) >= 0) {
        self->lost_before = 0;
    }
    close(fresh);
}

/// The kernel's count starts at 0 with the socket and wraps at 32 bits.
static void count_lost(lcm* self, struct msghdr* message)
{
    for (struct cmsghdr* part = CMSG_FIRSTHDR(message); part != NULL;
         part = CMSG_NXTHDR(message, part)) {
        if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_RXQ_OVFL) {
            uint32_t lost;
            memcpy(&lost, CMSG_DATA(part), sizeof lost);
            count_up(&self->counts->dropped, lost - self->lost_before);
            self->lost_before = lost;
        }
    }
}

enum { INTERFACE_SIZE = 32 };

/// The interface to which the kernel routes the group; "lo" without a route. The route with the
/// longest prefix in the main table applies. (The source address that the kernel would choose is no
/// indication: on loopback it can be that of any interface.)
static void interface_of(const struct sockaddr_in* group, char best[INTERFACE_SIZE])
{
    FILE* table = fopen("/proc/self/net/route", "re");
    char  line[256], name[INTERFACE_SIZE];
    unsigned target, mask, best_mask = 0;
    bool     found = false;
    snprintf(best, INTERFACE_SIZE, "lo");
    while (table != NULL && fgets(line, sizeof line, table) != NULL) {
        // Iface Destination Gateway Flags RefCnt Use Metric Mask ..., addresses as in memory
        if (sscanf(line, "%31s %8x %*s %*s %*s %*s %*s %8x", name, &target, &mask) == 3 &&
            (group->sin_addr.s_addr & mask) == target && (!found || ntohl(mask) > best_mask)) {
            memcpy(best, name, INTERFACE_SIZE);
            best_mask = ntohl(mask);
            found = true;
        }
    }
    if (table != NULL) {
        fclose(table);
    }
}

static bool lcm_secured(const transport_options* options)
{
    return setting_count(options, "lcm.keys.id") > 0;
}

/// A bus is limited to this machine by two conditions: a ttl of 0, so that own datagrams do not
/// leave it, and a route to the group on loopback, so that those of the network do not enter it.
static bool lcm_exposed(const char* rest, const transport_options* options, char* words,
                        size_t words_size)
{
    target to;
    char   interface[INTERFACE_SIZE], address[INET_ADDRSTRLEN];
    if (!target_parse(&to, rest) || lcm_secured(options)) {
        return false;
    }
    interface_of(&to.group, interface);
    const bool here = strcmp(interface, "lo") == 0;
    inet_ntop(AF_INET, &to.group.sin_addr, address, sizeof address);
    if (here && to.ttl > 0) {
        snprintf(words, words_size,
                 "lcm:%s: messages are not signed, and ttl=%u lets them leave this machine if "
                 "%s is routed to a network; set lcm.keys and lcm.sign_with, or ttl=0, or use "
                 "secured DDS", rest, to.ttl, address);
    } else if (!here) {
        snprintf(words, words_size,
                 "lcm:%s: messages are not signed, and %s is routed to %s: every machine on "
                 "that network can send as any vehicle%s; set lcm.keys and lcm.sign_with, or keep "
                 "the bus on this machine (%sip route add %s dev lo), or use secured DDS",
                 rest, address, interface,
                 to.ttl == 0 ? " (ttl=0 keeps only our own messages here)" : "",
                 to.ttl == 0 ? "" : "ttl=0 and ", address);
    }
    return !here || to.ttl > 0;
}

/// Removes the signature of an accepted message.
static transport_refusal judge(lcm* self, const struct sockaddr_in* from, lcm_event* event)
{
    const transport_kind kind = codec_kind(event->channel);
    if (kind == TRANSPORT_NONE || (self->receive & 1u << kind) == 0) {
        return TRANSPORT_ADMITTED;
    }
    if (!lcm_auth_allows(&self->auth, ntohl(from->sin_addr.s_addr))) {
        return TRANSPORT_NOT_ALLOWED;
    }
    if (self->auth.key_count == 0 || event->truncated) { // lcm_event_read() refuses the latter
        return TRANSPORT_ADMITTED;
    }
    const uint8_t* bytes = self->datagram + LCM_HEADER_SIZE;
    const size_t   size = (size_t)(event->payload - bytes) + event->size;
    const transport_refusal refusal =
        lcm_auth_verify(&self->auth, backend_utime_now(), bytes, size);
    if (refusal == TRANSPORT_ADMITTED) {
        event->size -= LCM_AUTH_TRAILER_SIZE;
    }
    return refusal;
}

/// One line for each cause, with the last sender and the remedy.
static void complain(lcm* self, transport_refusal refusal, uint64_t sender)
{
    char line[COMPLAINT_SIZE], address[32];
    lcm_sender_text(NULL, sender, address, sizeof address);
    snprintf(line, sizeof line, "lcm: a message from %s was refused as %s: %s", address,
             transport_refusal_name(refusal), lcm_auth_text(refusal));
    complaints_add(&self->complaints, refusal, line);
}

const backend backend_lcm = {
    .scheme = "lcm:",
    .form = "lcm:udpm://ADDRESS:PORT?ttl=N",
    .settings = lcm_auth_settings,
    .setting_count = LCM_AUTH_SETTINGS,
    .open = lcm_open,
    .close = lcm_close,
    .fd = lcm_fd,
    .take = lcm_take,
    .send = lcm_send,
    .sender_text = lcm_sender_text,
    .exposed = lcm_exposed,
    .secured = lcm_secured,
    .keeps_time = false,
};
