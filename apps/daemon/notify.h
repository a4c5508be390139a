/// Messages to the service manager, in systemd's sd_notify protocol: each call sends one datagram
/// to the socket that $NOTIFY_SOCKET names, a path or, with a leading @, an abstract name.
///
///     notify_open(&notify);                  // once; reads the environment
///     notify_send(&notify, "READY=1");
///     notify_status(&notify, "running");     // what `systemctl status` shows
///     if (notify.watchdog_us > 0) ...        // $WATCHDOG_USEC is set, for this process
///
/// Without $NOTIFY_SOCKET, or if the manager does not listen, the calls do nothing. Nothing
/// allocates, nothing blocks.
#ifndef VERGE_DAEMON_NOTIFY_H
#define VERGE_DAEMON_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/un.h>

typedef struct notify {
    int                fd;            ///< -1: no manager
    struct sockaddr_un address;
    socklen_t          address_size;
    int64_t            watchdog_us;   ///< [us] the watchdog's period; 0: no watchdog
    char               status[160];   ///< the last status text that was sent
} notify;

/// False: $NOTIFY_SOCKET is set but is not a usable name; it is ignored.
bool notify_open(notify* self);
void notify_close(notify* self);
/// Lines `NAME=value` with newlines between them.
void notify_send(const notify* self, const char* lines);
/// Sends "STATUS=" and this text, unless the last text was the same.
void notify_status(notify* self, const char* text);

#endif
