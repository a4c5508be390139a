/// The daemon's doors for people and their programs: verge-ctl's socket, Prometheus's port and
/// file. Who answers what is here, what is answered in report.h, how in server.h.
///
/// Memory      operators_open() allocates all there is.
/// Threads     The main one.
#ifndef VERGE_RSU_OPERATORS_H
#define VERGE_RSU_OPERATORS_H

#include "config.h"
#include "cycle.h"
#include "reload.h"
#include "report.h"
#include "server.h"

enum { OPERATORS_ENDS = 2 * SERVER_ENDS };

/// What there is to see just now.
typedef struct operators_view {
    const config*      config;
    const cycle*       cycle;
    verge_rsu_status_t status;
    report_details      details;
    transport_stats    bus;
} operators_view;

/// What operators may look at and ask for.
typedef struct operators_def {
    void*          context;
    operators_view (*look)(void* context);
    /// *ticket 0: asks for a reload, and gives it a ticket. Else what came of that one; where it
    /// was refused, *reason says why.
    reload_result  (*reload)(void* context, uint64_t* ticket, const char** reason);
} operators_def;

/// All zero: nobody is served.
typedef struct operators {
    operators_def def;
    server* control;       ///< null: not asked for
    server* metrics;       ///< null: not asked for
    char    metrics_file[SERVICE_FILE_SIZE]; ///< "": not asked for
    int     metrics_trouble; ///< errno of the last time the file was written
} operators;

/// Returns 0, or EXIT_OS with a line in error. self must not move afterwards.
int  operators_open(operators* self, const service* service, const operators_def* def,
                    char error[CONFIG_ERROR_SIZE]);
void operators_close(operators* self);

/// Fills in what to poll for, at most OPERATORS_ENDS; returns how many.
uint32_t operators_ends(const operators* self, struct pollfd* ends);
/// Whatever is possible without waiting. now [us] of a clock that never steps back.
void operators_serve(operators* self, int64_t now);
/// Replaces the file of figures.
void operators_write(operators* self);

#endif
