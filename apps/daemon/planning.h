/// A planner with the memory it lives in and the threads that help it.
///
///     planning_open(&planning, &site.planner, &site.service, error);
///     verge_planner_step(planning.planner, ...);
///     planning_close(&planning);
///
/// Memory      Heap, from planning_open() to planning_close(). Each page is touched at once.
#ifndef VERGE_DAEMON_PLANNING_H
#define VERGE_DAEMON_PLANNING_H

#include "common/executor.h"
#include "daemon/exit.h"
#include "daemon/service.h"
#include "verge/verge.h"

#include <stdio.h>

typedef struct planning {
    verge_planner* planner;
    void*          memory;
    size_t         size;    ///< [B] of the memory
    executor*      helpers; ///< null: one thread plans
} planning;

/// Builds the planner of def. If def->threads is above 1, its helpers are started with the priority
/// and the processors of `service`; service null: no helpers, which gives the same plans. Returns
/// 0, EXIT_CONFIG or EXIT_OS with a line in error; planning_close() is due in each case.
int  planning_open(planning* self, const verge_planner_def* def, const service* service,
                   char error[CONFIG_ERROR_SIZE]);
void planning_close(planning* self); ///< all zero is fine

/// Prints the memory that a planner needs, term by term.
void planning_print_memory(const verge_planner_def* def, FILE* out);
/// Do both need the same memory, term by term? False: one line in error, with the remedy.
bool planning_same_memory(const verge_planner_def* now, const verge_planner_def* next,
                          char error[CONFIG_ERROR_SIZE]);

#endif
