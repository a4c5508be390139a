/// Telling the service manager (systemd's sd_notify protocol, by hand): one datagram a call to the
/// socket that $NOTIFY_SOCKET names, a path or, with a leading @, an abstract name.
///
///     notify_open(&notify);                  // once; reads the environment
///     notify_send(&notify, "READY=1");
///     notify_status(&notify, "running");     // what `systemctl status` shows
///     if (notify.watchdog_us > 0) ...        // $WATCHDOG_USEC is set, for this process
///
/// Without $NOTIFY_SOCKET, or where the manager does not listen, every call does nothing: the
/// daemon does not depend on being watched. Nothing allocates, nothing blocks.
#ifndef VERGE_RSU_NOTIFY_H
#define VERGE_RSU_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/un.h>

typedef struct notify {
    int                fd;            ///< -1: nobody asked
    struct sockaddr_un address;
    socklen_t          address_size;
    int64_t            watchdog_us;   ///< [us] the manager's patience; 0: none set
    char               told[160];     ///< the last status text
} notify;

/// False: $NOTIFY_SOCKET is set and is no usable name; then as if it were not set.
bool notify_open(notify* self);
void notify_close(notify* self);
/// Lines `NAME=value` with newlines between them.
void notify_send(const notify* self, const char* lines);
/// notify_send() of "STATUS=" and this text, unless the last text sent was the same.
void notify_status(notify* self, const char* text);

#endif
