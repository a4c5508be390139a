#include "config.h"

#include "verge/wire.h"

#include <string.h>

static const char* const STANDBY_WORDS[] = { "never", "lower_id" }; // by config.stands_by

/// A vehicle that plans from its message needs decision steps for the whole trajectory.
static bool fits_message(const json_at* root, const verge_planner_def* def)
{
    const double  horizon = (double)(def->points - 1u) * def->point_s;
    const json_at planner = json_member(root, "planner");
    const json_at step_s = json_member(&planner, "step_s");
    return def->step_s * WIRE_ACTIONS_MAX >= horizon - 1e-9 ||
           json_fail(&step_s, "%d steps of %g s, as many as a plan message holds, end before the"
                     " trajectory of %g s, expected longer steps", (int)WIRE_ACTIONS_MAX,
                     def->step_s, horizon);
}

static bool read_standby(config* self, const json_at* root)
{
    const json_at at = json_member(root, "standby");
    const char*   word = json_string_or(root, "standby", STANDBY_WORDS[1]);
    self->stands_by = strcmp(word, STANDBY_WORDS[1]) == 0;
    return self->stands_by || strcmp(word, STANDBY_WORDS[0]) == 0 ||
           json_fail(&at, "is unknown, expected %s or %s", STANDBY_WORDS[1], STANDBY_WORDS[0]);
}

static bool read_own(site* site, const json_at* root)
{
    config* self = (config*)site;
    self->rsu_id = (int32_t)json_integer_or(root, "rsu_id", 0, INT32_MAX, 1);
    return fits_message(root, &site->planner) && read_standby(self, root);
}

static void print_own(const site* site, FILE* out)
{
    const config* self = config_of(site);
    fprintf(out, ",\n  \"rsu_id\": %d,\n  \"standby\": \"%s\"", self->rsu_id,
            STANDBY_WORDS[self->stands_by]);
}

static const char* const KEYS[] = { "rsu_id", "standby", NULL };

const site_def CONFIG_DEF = {
    .size = sizeof(config),
    .format = "verge-rsu/1",
    .keys = KEYS,
    .cycle_ms_min = CONFIG_CYCLE_MS_MIN,
    .cycle_ms_max = CONFIG_CYCLE_MS_MAX,
    .cycle_ms_default = CONFIG_CYCLE_MS_DEFAULT,
    .read = read_own,
    .print = print_own,
};

const config* config_of(const site* site)
{
    return (const config*)site; // its first member
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

peers_def config_peers_def(const config* self, int64_t start_utime)
{
    const peers_def def = {
        .rsu_id = self->rsu_id,
        .start_utime = start_utime,
        .map_crc32 = self->site.map_crc32,
        .period_us = (int64_t)self->site.cycle_ms * 1000,
        .never = !self->stands_by,
    };
    return def;
}
