#include "reload.h"

#include "realtime.h"

#include <errno.h>
#include <string.h>

/// Starts the helpers a configuration asks for. Returns 0, or EXIT_OS with a line in error.
static int pool_start(executor** pool, const config* config, char error[CONFIG_ERROR_SIZE])
{
    const uint32_t threads = config->planner.threads;
    *pool = threads > 1 ? executor_create_with(threads, &config->service.planning) : NULL;
    if (*pool != NULL || threads <= 1) {
        return 0;
    }
    realtime_explain(&config->service, errno, error, CONFIG_ERROR_SIZE);
    return EXIT_OS;
}

int setup_build(setup* self, char error[CONFIG_ERROR_SIZE])
{
    const int code = pool_start(&self->pool, self->config, error);
    if (code != 0) {
        return code;
    }
    return config_planner_build(&self->planner, self->config,
                                self->pool != NULL ? executor_run : NULL, self->pool, error);
}

void setup_free(setup* self)
{
    buses_close(&self->buses);
    config_planner_free(&self->planner);
    executor_destroy(self->pool);
    config_free(self->config);
    memset(self, 0, sizeof *self);
}

int reload_prepare(setup* next, const setup* now, const char* path,
                   void (*log)(void* context, const char* line), char error[CONFIG_ERROR_SIZE])
{
    int code = config_load(&next->config, path, error);
    if (code == 0 && !config_may_follow(now->config, next->config, error)) {
        code = EXIT_CONFIG;
    }
    if (code == 0) {
        code = setup_build(next, error);
    }
    if (code == 0 && !config_same_buses(next->config, now->config)) {
        code = buses_open(&next->buses, next->config, log, error, CONFIG_ERROR_SIZE);
    }
    if (code != 0) {
        setup_free(next);
    }
    return code;
}

void reload_install(setup* now, setup* next)
{
    if (next->buses.count > 0) {
        buses_succeed(&next->buses, &now->buses);
    } else {
        next->buses = now->buses;
        memset(&now->buses, 0, sizeof now->buses);
    }
    setup_free(now);
    *now = *next;
    memset(next, 0, sizeof *next);
}
