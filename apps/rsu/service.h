/// How the daemon serves its operators and what it asks of the system, from the members
/// "control", "metrics", "realtime" and "log_format" of its configuration. See config.h for each.
///
/// Memory      All in the struct.
#ifndef VERGE_RSU_SERVICE_H
#define VERGE_RSU_SERVICE_H

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

/// All zero: nothing is served, nothing is asked for.
typedef struct service {
    char control[SERVICE_PATH_SIZE];      ///< path of the socket verge-ctl speaks to; "": none
    char metrics_file[SERVICE_FILE_SIZE]; ///< "": none
    char metrics_listen[64];              ///< as written; "": none
    struct sockaddr_storage metrics_address;
    socklen_t      metrics_address_size;
    bool           lock_memory;
    thread_options planning;              ///< of the planning thread and its helpers
    log_format     log_format;
} service;

/// Reads the four members of an object, which may have others. False: reported.
bool service_read(service* self, const json_at* of);

/// The four members as JSON, each with a comma and a line break before it, defaults written out.
void service_write(FILE* out, const service* self);

/// The first member that cannot be changed without a restart and differs; null: none does.
const char* service_changed(const service* self, const service* other);

#endif
