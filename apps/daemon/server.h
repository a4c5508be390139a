/// Answers short requests on a socket without ever waiting for a client: those of verge-ctl on a
/// UNIX socket, those of Prometheus on a loopback port.
///
///     server_def def = { "\n", 65536, on_request, self };
///     server_open_unix(&server, &def, "/run/verge/rsu.sock", error, sizeof error);
///     count += server_ends(server, ends + count);      // the descriptors to poll
///     server_serve(server, now);                       // as far as possible without waiting
///
/// A request is all bytes up to `end`. It gets one answer, then the connection is closed. At most
/// SERVER_CLIENTS are connected at a time, others wait in the queue of the system. A client is
/// disconnected SERVER_PATIENCE_US after it has connected, not counting the time until its answer
/// is ready, and if its request is longer than SERVER_REQUEST.
///
/// Memory      server_open_*() allocate everything; nothing else does.
/// Threads     One. Null is a server without clients.
#ifndef VERGE_DAEMON_SERVER_H
#define VERGE_DAEMON_SERVER_H

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
    size_t      answer_size; ///< [B] of the longest answer
    /// Makes the answer to a request, which ends with a zero byte instead of `end`; null: it was
    /// too long or not a text. An answer that does not fit (answer->cut) is not sent. False: there
    /// is no answer yet, and the next server_serve() calls again. *ticket belongs to the callee; it
    /// is 0 at the first call for a request.
    bool      (*answer)(void* context, const char* request, uint64_t* ticket, text* answer);
    void*       context;
} server_def;

/// Opens a socket of mode 0660 at path. A socket that a dead daemon has left there is replaced; one
/// that answers, and a file that is not a socket, is an error. False: *opened is null, one line in
/// error.
bool server_open_unix(server** opened, const server_def* def, const char* path, char* error,
                      size_t error_size);
bool server_open_tcp(server** opened, const server_def* def, const struct sockaddr* address,
                     socklen_t size, char* error, size_t error_size);
/// Also removes the file of a UNIX socket.
void server_close(server* self);

/// Fills in at most SERVER_ENDS descriptors to poll; returns how many.
uint32_t server_ends(const server* self, struct pollfd* ends);
/// now [us] of a clock that never steps back.
void server_serve(server* self, int64_t now);

#endif
