/// What the daemon asks of the system so that planning is not kept waiting: a priority and
/// processors for the planning threads (given where they are started, see thread.h), and memory
/// that stays where it is. What the system refuses ends the start, with the reason and the remedy.
#ifndef VERGE_RSU_REALTIME_H
#define VERGE_RSU_REALTIME_H

#include "service.h"

#include <stddef.h>

/// Before the first thread and the first large block: large blocks go back to the system when they
/// are freed. With lock_memory: one heap for all threads, which gives nothing back.
void realtime_prepare(const service* service);

/// Once everything is built: all memory of the process, now and later, is resident and stays so.
/// Does nothing unless lock_memory. False: one line in error.
bool realtime_lock(const service* service, char* error, size_t size);

/// Why a planning thread could not be started (an errno of thread_start()), as one line.
void realtime_explain(const service* service, int refused, char* error, size_t size);

#endif
