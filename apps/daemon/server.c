/// See server.h. A client sends its request, waits until the answer is ready, and receives it.
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { REST_MAX = 64 }; // reads of what follows a request; of more the client loses its answer

typedef enum client_state { ASKING, WAITING, ANSWERED } client_state;

typedef struct client {
    int      fd;     // -1: free
    int64_t  until;  // [us]
    client_state state;
    bool     invalid; // the request is too long or not a text
    uint64_t ticket; // of server_def.answer()
    size_t   size;   // [B] of the request, read so far
    size_t   sent;   // [B] of the answer
    char     request[SERVER_REQUEST];
    text     answer; // in a buffer of its own
} client;

struct server {
    server_def def;
    int        fd;
    char       path[sizeof ((struct sockaddr_un*)0)->sun_path]; // of the file to remove; "": none
    client     clients[SERVER_CLIENTS];
};

static server* server_new(const server_def* def, int family);
static bool listen_at(server* self, const struct sockaddr* address, socklen_t size);
static bool clear_path(const struct sockaddr_un* address, char* error, size_t error_size);

bool server_open_unix(server** opened, const server_def* def, const char* path, char* error,
                      size_t error_size)
{
    *opened = NULL;
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    if (!clear_path(&address, error, error_size)) {
        return false;
    }
    server* self = server_new(def, AF_UNIX);
    // No client can connect before the mode is set.
    if (self == NULL || fchmod(self->fd, 0600) != 0 ||
        !listen_at(self, (const struct sockaddr*)&address, sizeof address)) {
        snprintf(error, error_size, "%s: the system refused a socket there (%s), expected a "
                 "folder this user may write to", path, strerror(errno));
        server_close(self);
        return false;
    }
    memcpy(self->path, address.sun_path, sizeof self->path);
    chmod(path, 0660);
    *opened = self;
    return true;
}

bool server_open_tcp(server** opened, const server_def* def, const struct sockaddr* address,
                     socklen_t size, char* error, size_t error_size)
{
    server* self = server_new(def, address->sa_family);
    const int on = 1;
    if (self == NULL || setsockopt(self->fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        !listen_at(self, address, size)) {
        snprintf(error, error_size, "the system refused the port (%s), expected one that no "
                 "other program uses", strerror(errno));
        server_close(self);
        self = NULL;
    }
    *opened = self;
    return self != NULL;
}

static server* server_new(const server_def* def, int family)
{
    server* self = calloc(1, sizeof *self);
    char*   buffers = malloc(SERVER_CLIENTS * def->answer_size);
    if (self == NULL || buffers == NULL) {
        free(self);
        free(buffers);
        return NULL;
    }
    self->def = *def;
    for (uint32_t i = 0; i < SERVER_CLIENTS; i++) {
        self->clients[i].fd = -1;
        self->clients[i].answer = text_in(buffers + i * def->answer_size, def->answer_size);
    }
    self->fd = socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    return self;
}

static bool listen_at(server* self, const struct sockaddr* address, socklen_t size)
{
    return bind(self->fd, address, size) == 0 && listen(self->fd, SERVER_CLIENTS) == 0;
}

/// True: there is no file at the path now.
static bool clear_path(const struct sockaddr_un* address, char* error, size_t error_size)
{
    struct stat facts;
    if (lstat(address->sun_path, &facts) != 0) {
        return true; // if the folder is missing, bind() fails
    }
    if (!S_ISSOCK(facts.st_mode)) {
        snprintf(error, error_size, "%s: is a file but no socket, expected a free name",
                 address->sun_path);
        return false;
    }
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const int connected = connect(fd, (const struct sockaddr*)address, sizeof *address);
    const bool stale = connected != 0 && errno == ECONNREFUSED;
    close(fd);
    if (!stale || unlink(address->sun_path) != 0) {
        snprintf(error, error_size, "%s: another daemon answers there, expected a socket of its "
                 "own for each", address->sun_path);
        return false;
    }
    return true;
}

void server_close(server* self)
{
    if (self == NULL) {
        return;
    }
    for (uint32_t i = 0; i < SERVER_CLIENTS; i++) {
        if (self->clients[i].fd >= 0) {
            close(self->clients[i].fd);
        }
    }
    if (self->fd >= 0) {
        close(self->fd);
    }
    if (self->path[0] != '\0') {
        unlink(self->path);
    }
    free(self->clients[0].answer.bytes);
    free(self);
}

// ---- serving ------------------------------------------------------------------------------

static void accept_client(server* self, client* client, int64_t now);
static bool serve_client(server* self, client* client, int64_t now);
static bool read_request(server* self, client* client);
static bool make_answer(server* self, client* client, int64_t now);
static bool send_answer(client* client);

uint32_t server_ends(const server* self, struct pollfd* ends)
{
    if (self == NULL) {
        return 0;
    }
    uint32_t count = 0;
    for (uint32_t i = 0; i < SERVER_CLIENTS; i++) {
        const client* client = &self->clients[i];
        if (client->fd >= 0) {
            const short events = client->state == ASKING     ? POLLIN
                                 : client->state == ANSWERED ? POLLOUT
                                                             : 0; // only its end
            ends[count++] = (struct pollfd){ .fd = client->fd, .events = events };
        }
    }
    if (count < SERVER_CLIENTS) { // else new clients wait in the queue of the system
        ends[count++] = (struct pollfd){ .fd = self->fd, .events = POLLIN };
    }
    return count;
}

void server_serve(server* self, int64_t now)
{
    for (uint32_t i = 0; self != NULL && i < SERVER_CLIENTS; i++) {
        client* client = &self->clients[i];
        if (client->fd < 0) {
            accept_client(self, client, now);
        }
        if (client->fd >= 0 && (!serve_client(self, client, now) || now > client->until)) {
            close(client->fd);
            client->fd = -1;
        }
    }
}

static void accept_client(server* self, client* client, int64_t now)
{
    client->fd = accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    client->until = now + SERVER_PATIENCE_US;
    client->state = ASKING;
    client->invalid = false;
    client->ticket = 0;
    client->size = client->sent = 0;
}

/// Serves one client as far as possible without waiting. False: it is done, or has disconnected.
static bool serve_client(server* self, client* client, int64_t now)
{
    return (client->state != ASKING || read_request(self, client)) &&
           (client->state != WAITING || make_answer(self, client, now)) &&
           (client->state != ANSWERED || send_answer(client));
}

/// Reads up to the end of the request. False: the client has disconnected.
static bool read_request(server* self, client* client)
{
    const size_t  room = sizeof client->request - 1 - client->size;
    const ssize_t got = recv(client->fd, client->request + client->size, room, 0);
    if (got <= 0) {
        return got < 0 && (errno == EAGAIN || errno == EINTR);
    }
    client->size += (size_t)got;
    client->request[client->size] = '\0';
    char* end = strstr(client->request, self->def.end);
    client->invalid = end == NULL && (client->size + 1 == sizeof client->request ||
                                      strlen(client->request) != client->size);
    if (end != NULL) {
        *end = '\0';
    }
    client->state = end != NULL || client->invalid ? WAITING : ASKING;
    return true;
}

/// False: the client has disconnected, or its answer does not fit.
static bool make_answer(server* self, client* client, int64_t now)
{
    const char* request = client->invalid ? NULL : client->request;
    client->answer = text_in(client->answer.bytes, client->answer.room);
    if (self->def.answer(self->def.context, request, &client->ticket, &client->answer)) {
        client->state = ANSWERED;
        return !client->answer.cut;
    }
    client->until = now + SERVER_PATIENCE_US;
    struct pollfd end = { .fd = client->fd };
    return poll(&end, 1, 0) == 0;
}

static bool send_answer(client* client)
{
    while (client->sent < client->answer.size) {
        const ssize_t sent = send(client->fd, client->answer.bytes + client->sent,
                                  client->answer.size - client->sent, MSG_NOSIGNAL);
        if (sent < 0) {
            return errno == EAGAIN || errno == EINTR;
        }
        client->sent += (size_t)sent;
    }
    // Closing with unread bytes would reset the connection before the answer has arrived.
    char rest[SERVER_REQUEST];
    shutdown(client->fd, SHUT_WR);
    for (int i = 0; i < REST_MAX && recv(client->fd, rest, sizeof rest, 0) > 0; i++) {
    }
    return false;
}
