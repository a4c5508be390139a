/// The members "control", "metrics", "realtime" and "log_format" of a configuration: what the
/// daemon serves to operators, and what it requests from the system.
///
/// Memory      All in the struct.
#ifndef VERGE_DAEMON_SERVICE_H
#define VERGE_DAEMON_SERVICE_H

#include "log.h"

#include "common/json.h"
#include "common/thread.h"

#include <netinet/in.h>
#include <stdio.h>

enum {
    SERVICE_PATH_SIZE = 108,      ///< [B] of a socket's path, as the system has it
    SERVICE_FILE_SIZE = 1024,     ///< [B]
    SERVICE_CPU_MAX = 1023,
};

/// All zero: nothing is served, nothing is requested.
typedef struct service {
    char control[SERVICE_PATH_SIZE];      ///< path of the socket for verge-ctl; "": none
    char metrics_file[SERVICE_FILE_SIZE]; ///< "": none
    char metrics_listen[64];              ///< as written; "": none
    struct sockaddr_storage metrics_address;
    socklen_t      metrics_address_size;
    bool           lock_memory;
    thread_options planning;              ///< of the planning thread and its helpers
    log_format     log_format;
} service;

/// Reads the four members of an object, which may have others. False: the error is in the file.
bool service_read(service* self, const json_at* of);

/// Writes the four members as JSON with all defaults, each after a comma and a line break.
void service_write(FILE* out, const service* self);

/// The first member that differs and cannot change without a restart; null: none.
const char* service_changed(const service* self, const service* other);

#endif
