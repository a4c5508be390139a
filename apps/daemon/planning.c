#include "planning.h"

#include "daemon/realtime.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/// Returns 0, or EXIT_OS with a line in error.
static int start_helpers(planning* self, uint32_t threads, const service* service,
                         char error[CONFIG_ERROR_SIZE])
{
    if (threads <= 1 || service == NULL) {
        return 0;
    }
    self->helpers = executor_create_with(threads, &service->planning);
    if (self->helpers == NULL) {
        realtime_explain(service, errno, error, CONFIG_ERROR_SIZE);
        return EXIT_OS;
    }
    return 0;
}

/// Returns 0, or an exit code with a line in error.
static int build(planning* self, const verge_planner_def* def, char error[CONFIG_ERROR_SIZE])
{
    const size_t size = verge_planner_memory_size(def);
    if (size == 0) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: the planner refuses these parameters");
        return EXIT_CONFIG;
    }
    const size_t rounded = (size + 63) / 64 * 64; // aligned_alloc() needs a multiple
    self->memory = aligned_alloc(64, rounded);
    if (self->memory == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: the system refused %zu bytes", rounded);
        return EXIT_OS;
    }
    memset(self->memory, 0, rounded); // touches every page before the first cycle
    self->size = rounded;
    const verge_status status = verge_planner_init(&self->planner, def, self->memory, rounded);
    if (status != VERGE_OK) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: %s", verge_status_text(status));
        return EXIT_CONFIG;
    }
    return 0;
}

int planning_open(planning* self, const verge_planner_def* def, const service* service,
                  char error[CONFIG_ERROR_SIZE])
{
    memset(self, 0, sizeof *self);
    const int code = start_helpers(self, def->threads, service, error);
    if (code != 0) {
        return code;
    }
    verge_planner_def helped = *def;
    helped.executor = self->helpers != NULL ? executor_run : NULL;
    helped.executor_context = self->helpers;
    return build(self, &helped, error);
}

void planning_close(planning* self)
{
    free(self->memory);
    executor_destroy(self->helpers);
    memset(self, 0, sizeof *self);
}

void planning_print_memory(const verge_planner_def* def, FILE* out)
{
    verge_memory_term terms[VERGE_MEMORY_TERMS];
    verge_planner_memory_terms(def, terms);
    size_t sum = 0;
    for (int i = 0; i < VERGE_MEMORY_TERMS; i++) {
        if (terms[i].text != NULL) {
            fprintf(out, "%12zu B  %s\n", terms[i].size, terms[i].text);
            sum += terms[i].size;
        }
    }
    fprintf(out, "%12zu B  planner, all together\n", sum);
}

bool planning_same_memory(const verge_planner_def* now, const verge_planner_def* next,
                          char error[CONFIG_ERROR_SIZE])
{
    verge_memory_term before[VERGE_MEMORY_TERMS], after[VERGE_MEMORY_TERMS];
    verge_planner_memory_terms(now, before);
    verge_planner_memory_terms(next, after);
    for (int i = 0; i < VERGE_MEMORY_TERMS; i++) {
        if (before[i].size != after[i].size) {
            snprintf(error, CONFIG_ERROR_SIZE,
                     "planner: its memory would change from %zu to %zu bytes (%s), expected the "
                     "same until the daemon is restarted", before[i].size, after[i].size,
                     after[i].text != NULL ? after[i].text : before[i].text);
            return false;
        }
    }
    return true;
}
