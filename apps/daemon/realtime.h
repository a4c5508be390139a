/// What keeps planning on time: a priority and processors for the planning threads (set where they
/// are started, see thread.h), and memory that is never paged out. If the system refuses one of
/// them, the daemon does not start and prints the reason and the remedy.
#ifndef VERGE_DAEMON_REALTIME_H
#define VERGE_DAEMON_REALTIME_H

#include "service.h"

#include <stddef.h>

/// To be called before the first thread and the first large block. Large blocks then return to the
/// system when they are freed. With lock_memory all threads share one heap, which keeps its memory.
void realtime_prepare(const service* service);

/// To be called when everything is built: keeps all memory of the process resident, now and later.
/// Does nothing unless lock_memory. False: one line in error.
bool realtime_lock(const service* service, char* error, size_t size);

/// Why a planning thread could not be started (an errno of thread_start()), as one line.
void realtime_explain(const service* service, int refused, char* error, size_t size);

#endif
