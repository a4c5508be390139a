#include "config.h"

#include "common/number.h"
#include "common/planner_json.h"

#include <string.h>

/// A URL or null.
static bool read_url(const json_at* root, const char* key, char url[SITE_BUS_SIZE])
{
    const json_at at = json_member(root, key);
    url[0] = '\0';
    if (json_none(&at)) {
        return true;
    }
    const char* text = json_string(root, key);
    if (root->file->error[0] != '\0') {
        return false;
    }
    const char* fault = transport_url_fault(text);
    if (fault != NULL) {
        return json_fail(&at, "is \"%.80s\": %s", text, fault);
    }
    if (strlen(text) >= SITE_BUS_SIZE) {
        return json_fail(&at, "is too long, expected at most %d characters", SITE_BUS_SIZE - 1);
    }
    memcpy(url, text, strlen(text) + 1);
    return true;
}

/// One vehicle is planned.
static void planner_defaults(verge_planner_def* def)
{
    def->vehicles_max = OBU_VEHICLES_DEFAULT;
    def->controlled_max = 1;
    def->search = VERGE_SEARCH_POLICY;
}

static bool check_planner(const site* site, const json_at* root)
{
    const json_at planner = json_member(root, "planner");
    const json_at controlled = json_member(&planner, "controlled_max");
    return site->planner.controlled_max == 1
           || json_fail(&controlled, "is %u, expected 1: this unit plans its own vehicle",
                        site->planner.controlled_max);
}

/// The parameters of the roadside unit whose plans are planned again; null: none are.
static bool read_repeat(obu_config* self, const json_at* root)
{
    static const char* const REPEAT_KEYS[] = { "planner", NULL };
    const json_at at = json_member(root, "repeat");
    if (json_none(&at)) {
        return true;
    }
    const json_at planner = json_member(&at, "planner");
    self->repeats = true;
    self->rsu_planner = verge_planner_default_def();
    return json_expect_object(&at, REPEAT_KEYS)
           && planner_def_from_json(&planner, &self->rsu_planner);
}

static bool read_own(site* site, const json_at* root)
{
    obu_config* self = (obu_config*)site;
    const json_at rsu = json_member(root, "rsu_id");
    const json_at state = json_member(root, "state");
    self->vehicle_id = (int32_t)json_integer(root, "vehicle_id", 0, INT32_MAX);
    self->rsu_id = json_none(&rsu) ? -1 : (int32_t)json_integer(root, "rsu_id", 0, INT32_MAX);
    if (root->file->error[0] != '\0' || !read_url(root, "state", self->state)
        || !read_url(root, "trajectory", self->trajectory)) {
        return false;
    }
    if (self->state[0] != '\0' && site->bus_count == SITE_BUSES_MAX) {
        return json_fail(&state, "is one bus too many, expected at most %d in bus beside it",
                         SITE_BUSES_MAX - 1);
    }
    return check_planner(site, root) && read_repeat(self, root);
}

static void print_url(FILE* out, const char* key, const char* url)
{
    fprintf(out, ",\n  \"%s\": ", key);
    if (url[0] != '\0') {
        string_write(out, url);
    } else {
        fputs("null", out);
    }
}

static void print_own(const site* site, FILE* out)
{
    const obu_config* self = obu_config_of(site);
    fprintf(out, ",\n  \"vehicle_id\": %d,\n  \"rsu_id\": ", self->vehicle_id);
    if (self->rsu_id >= 0) {
        fprintf(out, "%d", self->rsu_id);
    } else {
        fputs("null", out);
    }
    print_url(out, "state", self->state);
    print_url(out, "trajectory", self->trajectory);
    fputs(",\n  \"repeat\": ", out);
    if (self->repeats) {
        fputs("{ \"planner\": ", out);
        planner_def_write(out, &self->rsu_planner);
        fputs(" }", out);
    } else {
        fputs("null", out);
    }
}

static const char* changed(const site* site, const struct site* next)
{
    const obu_config *self = obu_config_of(site), *other = obu_config_of(next);
    return self->vehicle_id != other->vehicle_id               ? "vehicle_id"
           : strcmp(self->state, other->state) != 0            ? "state"
           : strcmp(self->trajectory, other->trajectory) != 0 ? "trajectory"
                                                              : NULL;
}

static const char* const KEYS[] = { "vehicle_id", "rsu_id", "state", "trajectory", "repeat",
                                    NULL };

const site_def OBU_CONFIG_DEF = {
    .size = sizeof(obu_config),
    .format = "verge-obu/1",
    .keys = KEYS,
    .cycle_ms_min = OBU_CYCLE_MS_MIN,
    .cycle_ms_max = OBU_CYCLE_MS_MAX,
    .cycle_ms_default = OBU_CYCLE_MS_DEFAULT,
    .planner_defaults = planner_defaults,
    .read = read_own,
    .print = print_own,
    .changed = changed,
};

const obu_config* obu_config_of(const site* site)
{
    return (const obu_config*)site; // its first member
}

unit_def obu_unit_def(const obu_config* self)
{
    return (unit_def){
        .planner = self->site.planner,
        .vehicle_id = self->vehicle_id,
        .rsu_id = self->rsu_id,
        .map_crc32 = self->site.map_crc32,
        .limits = self->site.freshness,
        .repeats = self->repeats,
        .rsu_planner = self->rsu_planner,
        .own_bus = self->state[0] != '\0' ? (int32_t)self->site.bus_count : -1,
    };
}
