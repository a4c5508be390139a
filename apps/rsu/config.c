#include "config.h"

#include "verge/wire.h"

#include <stdlib.h>
#include <string.h>

static bool read_own(void* context, const json_at* root);
static void print_own(const void* context, FILE* out);

static const char* const KEYS[] = { "rsu_id", NULL };
static const site_def DEF = {
    .format = "verge-rsu/1",
    .keys = KEYS,
    .cycle_ms_min = CONFIG_CYCLE_MS_MIN,
    .cycle_ms_max = CONFIG_CYCLE_MS_MAX,
    .cycle_ms_default = CONFIG_CYCLE_MS_DEFAULT,
    .read = read_own,
    .print = print_own,
};

int config_load(config** loaded, const char* path, char error[CONFIG_ERROR_SIZE])
{
    *loaded = NULL;
    config* self = calloc(1, sizeof *self);
    if (self == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "%s: the system refused memory", path);
        return EXIT_OS;
    }
    const int code = site_load(&self->site, &DEF, self, path, error);
    if (code != 0) {
        config_free(self);
        self = NULL;
    }
    *loaded = self;
    return code;
}

void config_free(config* self)
{
    if (self != NULL) {
        site_free(&self->site);
        free(self);
    }
}

/// A vehicle that plans from its message needs decision steps for the whole trajectory.
static bool fits_message(const json_at* planner, const verge_planner_def* def)
{
    const double horizon = (double)(def->points - 1u) * def->point_s;
    const json_at step_s = json_member(planner, "step_s");
    return def->step_s * WIRE_ACTIONS_MAX >= horizon - 1e-9 ||
           json_fail(&step_s, "%d steps of %g s, as many as a plan message holds, end before the"
                     " trajectory of %g s, expected longer steps", (int)WIRE_ACTIONS_MAX,
                     def->step_s, horizon);
}

static bool read_own(void* context, const json_at* root)
{
    config* self = context;
    self->rsu_id = (int32_t)json_integer_or(root, "rsu_id", 0, INT32_MAX, 1);
    const json_at planner = json_member(root, "planner");
    return fits_message(&planner, &self->site.planner);
}

static void print_own(const void* context, FILE* out)
{
    const config* self = context;
    fprintf(out, ",\n  \"rsu_id\": %d", self->rsu_id);
}

void config_print(const config* self, FILE* out)
{
    site_print(&self->site, &DEF, self, out);
}

cycle_def config_cycle_def(const config* self, const planning* built)
{
    const cycle_def def = {
        .planner = built->planner,
        .vehicles_max = self->site.planner.vehicles_max,
        .controlled_max = self->site.planner.controlled_max,
        .limits = self->site.freshness,
        .rsu_id = self->rsu_id,
        .map_crc32 = self->site.map_crc32,
    };
    return def;
}
