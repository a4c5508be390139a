/// See notify.h.
#define _GNU_SOURCE
#include "notify.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int64_t watchdog_of_environment(void);

bool notify_open(notify* self)
{
    memset(self, 0, sizeof *self);
    self->fd = -1;
    self->watchdog_us = watchdog_of_environment();
    const char* name = getenv("NOTIFY_SOCKET");
    if (name == NULL || name[0] == '\0') {
        return true;
    }
    const size_t length = strlen(name);
    if ((name[0] != '/' && name[0] != '@') || length >= sizeof self->address.sun_path) {
        return false;
    }
    self->address.sun_family = AF_UNIX;
    memcpy(self->address.sun_path, name, length);
    // An abstract name begins with a zero byte and has none at its end.
    const bool abstract = name[0] == '@';
    if (abstract) {
        self->address.sun_path[0] = '\0';
    }
    self->address_size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length +
                                     (abstract ? 0 : 1));
    self->fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    return self->fd >= 0;
}

/// [us] The watchdog's period if it watches this process, else 0.
static int64_t watchdog_of_environment(void)
{
    const char* usec = getenv("WATCHDOG_USEC");
    const char* pid = getenv("WATCHDOG_PID");
    if (usec == NULL || (pid != NULL && strtol(pid, NULL, 10) != (long)getpid())) {
        return 0;
    }
    char* end = NULL;
    const long long value = strtoll(usec, &end, 10);
    return *end == '\0' && value > 0 ? (int64_t)value : 0;
}

void notify_close(notify* self)
{
    if (self->fd >= 0) {
        close(self->fd);
        self->fd = -1;
    }
}

void notify_send(const notify* self, const char* lines)
{
    if (self->fd < 0) {
        return;
    }
    const ssize_t ignored = sendto(self->fd, lines, strlen(lines), MSG_NOSIGNAL,
                                   (const struct sockaddr*)&self->address, self->address_size);
    (void)ignored; // a manager that does not listen is no fault of ours
}

void notify_status(notify* self, const char* text)
{
    char line[sizeof self->status + 8];
    if (strcmp(text, self->status) == 0) {
        return;
    }
    snprintf(self->status, sizeof self->status, "%s", text);
    snprintf(line, sizeof line, "STATUS=%s", self->status);
    notify_send(self, line);
}
