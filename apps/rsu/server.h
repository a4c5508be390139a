/// Answers short requests on a socket without ever waiting for a client: verge-ctl's on a UNIX
/// socket, Prometheus's on a loopback port.
///
///     server_def def = { "\n", 65536, on_request, self };
///     server_open_unix(&server, &def, "/run/verge/rsu.sock", error, sizeof error);
///     count += server_ends(server, ends + count);      // what to poll for
///     server_serve(server, now);                       // whatever is possible just now
///
/// A request is all up to `end`; it gets one answer and the connection is closed. At most
/// SERVER_CLIENTS at a time, others wait in the system's queue; each has SERVER_PATIENCE_US from
/// connecting to having read its answer, not counting the time until there is one, and
/// SERVER_REQUEST bytes to ask.
///
/// Memory      server_open_*() allocate everything; nothing else does.
/// Threads     One. Null is a server that serves nobody.
#ifndef VERGE_RSU_SERVER_H
#define VERGE_RSU_SERVER_H

#include "common/text.h"

#include <poll.h>
#include <stdint.h>
#include <sys/socket.h>

enum {
    SERVER_CLIENTS = 4,
    SERVER_ENDS = SERVER_CLIENTS + 1,
    SERVER_REQUEST = 1024,        ///< [B]
    SERVER_PATIENCE_US = 2000000, ///< [us]
};

typedef struct server server;

typedef struct server_def {
    const char* end;         ///< what ends a request
    size_t      answer_size; ///< [B] room for an answer
    /// request: ends with a zero byte instead of `end`; null: too long or not a text. An answer
    /// that does not fit (answer->cut) is not sent. False: there is no answer yet, ask again at the
    /// next server_serve(). *ticket is 0 when a request is first asked, and keeps what is put there.
    bool      (*answer)(void* context, const char* request, uint64_t* ticket, text* answer);
    void*       context;
} server_def;

/// A socket of mode 0660 at path. What a daemon that is gone left there is replaced; one that
/// answers, or a file that is no socket, is not. False: *opened is null, one line in error.
bool server_open_unix(server** opened, const server_def* def, const char* path, char* error,
                      size_t error_size);
bool server_open_tcp(server** opened, const server_def* def, const struct sockaddr* address,
                     socklen_t size, char* error, size_t error_size);
/// A UNIX socket's file is removed.
void server_close(server* self);

/// Fills in at most SERVER_ENDS; returns how many.
uint32_t server_ends(const server* self, struct pollfd* ends);
/// now [us] of a clock that never steps back.
void server_serve(server* self, int64_t now);

#endif
