/// What serves operators: the control socket for verge-ctl, and the port and the file of metrics
/// for Prometheus. The daemon makes the answers; this file finds which one is asked for, server.h
/// sends it.
///
/// Memory      operators_open() allocates everything.
/// Threads     The main one.
#ifndef VERGE_DAEMON_OPERATORS_H
#define VERGE_DAEMON_OPERATORS_H

#include "daemon/outlet.h"
#include "daemon/reload.h"
#include "daemon/server.h"
#include "daemon/service.h"

#include <stdatomic.h>

enum { OPERATORS_ENDS = 2 * SERVER_ENDS };
enum { OPERATORS_PAGE_SIZE = 16 << 10 }; ///< [B] of the longest page of metrics

/// A request of verge-ctl, which is one word.
typedef struct operators_request {
    const char* word;
    void      (*answer)(void* context, text* answer); ///< adds one line of JSON
} operators_request;

typedef struct operators_def {
    void*                    context;
    const operators_request* requests; ///< static; the last one has no word
    void                   (*metrics)(void* context, text* page); ///< Prometheus's text format
    size_t                   answer_size; ///< [B] of the longest answer to a request
    /// The request "reload". *ticket 0: begins a reload and sets its ticket. Returns its result so
    /// far; if it was refused, *reason says why.
    reload_result          (*reload)(void* context, uint64_t* ticket, const char** reason);
} operators_def;

/// All zero: nothing is served.
typedef struct operators {
    operators_def def;
    server* control;       ///< null: none configured
    server* metrics;       ///< null: none configured
    char    metrics_file[SERVICE_FILE_SIZE]; ///< "": none configured
    outlet* metrics_out;   ///< writes the file, because a disk may be slow; null: none configured
    atomic_int metrics_error; ///< errno of its last writing; 0: it was written
    int     metrics_error_logged;
} operators;

/// Returns 0, or EXIT_OS with a line in error. self must not move afterwards.
int  operators_open(operators* self, const service* service, const operators_def* def,
                    char error[CONFIG_ERROR_SIZE]);
void operators_close(operators* self);

/// Fills in the descriptors to poll, at most OPERATORS_ENDS; returns how many.
uint32_t operators_ends(const operators* self, struct pollfd* ends);
/// Reads and answers as far as possible without waiting. now [us] of a clock that never steps back.
void operators_serve(operators* self, int64_t now);
/// Replaces the file of metrics, in a thread of its own.
void operators_write(operators* self);

#endif
