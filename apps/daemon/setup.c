#include "setup.h"

#include <string.h>

/// [us] For the last events of a recording.
enum { RECORD_PATIENCE_US = 5000000 };

int setup_load(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE])
{
    return site_load(&self->site, def->site, def->path, error);
}

int setup_plan(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE])
{
    if (def->make != NULL) {
        self->unmake = def->unmake;
        return def->make(&self->made, self->site, error);
    }
    return planning_open(&self->planner, &self->site->planner, &self->site->service, error);
}

int setup_connect(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE])
{
    const int result = buses_open(&self->buses, self->site, def->bus_use, def->log, error,
                                  CONFIG_ERROR_SIZE);
    return result == TRANSPORT_OK        ? 0
           : result == TRANSPORT_BAD_URL ? EXIT_CONFIG
                                         : EXIT_UNAVAILABLE;
}

void setup_free(setup* self)
{
    recorder_close(self->record, RECORD_PATIENCE_US);
    buses_close(&self->buses);
    planning_close(&self->planner);
    if (self->unmake != NULL) {
        self->unmake(self->made);
    }
    site_free(self->site);
    memset(self, 0, sizeof *self);
}

int setup_prepare(setup* self, const setup_def* def, const setup* now,
                  char error[CONFIG_ERROR_SIZE])
{
    int code = setup_load(self, def, error);
    if (code == 0 && !site_may_follow(now->site, self->site, def->site, error)) {
        code = EXIT_CONFIG;
    }
    if (code == 0) {
        code = setup_plan(self, def, error);
    }
    if (code == 0 && !site_same_buses(self->site, now->site)) {
        code = setup_connect(self, def, error);
    }
    return code;
}

void setup_replace(setup* now, setup* next, setup* old)
{
    *old = *now;
    *now = *next;
    memset(next, 0, sizeof *next);
    if (now->buses.count > 0) {
        buses_succeed(&now->buses, &old->buses);
    } else {
        now->buses = old->buses;
        memset(&old->buses, 0, sizeof old->buses);
    }
}
