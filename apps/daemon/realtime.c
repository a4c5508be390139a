/// See realtime.h.
#define _GNU_SOURCE
#include "realtime.h"

#include <errno.h>
#include <malloc.h>
#include <string.h>
#include <sys/mman.h>

/// [B] More than the main thread ever uses of its stack, and half of what the unit allows
/// (LimitSTACK=256K), because arguments and environment are on the stack, too.
enum { MAIN_STACK = 128 << 10 };
/// [B] Blocks of this size and more, such as a planner's memory, get mappings of their own, which
/// return to the system when they are freed. By default glibc puts them into the heap, which
/// reloads fragmented by a hundred megabytes.
enum { MAPPED_SIZE = 1 << 20 };

void realtime_prepare(const service* service)
{
    mallopt(M_MMAP_THRESHOLD, MAPPED_SIZE);
    if (service->lock_memory) {
        mallopt(M_ARENA_MAX, 1);
        mallopt(M_TRIM_THRESHOLD, -1);
    }
}

/// Unlike other stacks, that of the main thread grows on first use. This uses it once.
__attribute__((noinline)) static void touch_stack(void)
{
    volatile char stack[MAIN_STACK];
    for (size_t i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
}

bool realtime_lock(const service* service, char* error, size_t size)
{
    if (!service->lock_memory) {
        return true;
    }
    touch_stack();
    if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) {
        return true;
    }
    snprintf(error, size,
             "realtime.lock_memory: the system refused (%s), expected a limit on locked memory "
             "above the process's size: LimitMEMLOCK=infinity in the unit, or ulimit -l, or "
             "set lock_memory to false", strerror(errno));
    return false;
}

void realtime_explain(const service* service, int refused, char* error, size_t size)
{
    if (refused == EPERM && service->planning.priority > 0) {
        snprintf(error, size,
                 "realtime.priority: the system refused SCHED_FIFO with priority %d (%s), "
                 "expected LimitRTPRIO=%d in the unit, or ulimit -r, or CAP_SYS_NICE, or set "
                 "priority to 0", service->planning.priority, strerror(refused),
                 service->planning.priority);
    } else if (refused == EINVAL && service->planning.cpu_count > 0) {
        snprintf(error, size,
                 "realtime.cpus: this process may run on none of them (%s), expected "
                 "processors that nproc counts and CPUAffinity= allows", strerror(refused));
    } else {
        snprintf(error, size,
                 "planner.threads: the system refused to start a thread (%s), expected a higher "
                 "LimitNPROC or TasksMax, or fewer threads", strerror(refused));
    }
}
