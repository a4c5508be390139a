#define _GNU_SOURCE
#include "config.h"

#include "common/json.h"
#include "common/number.h"
#include "common/planner_json.h"
#include "common/road_json.h"
#include "verge/transport.h"

#include <stdlib.h>
#include <string.h>

/// More than there are freshness limits.
enum { FRESHNESS_KEYS_MAX = 16 };

static int  read_document(config* self, const json_at* root);
static bool read_bus(config* self, const json_at* root);
static int  read_road(config* self, const json_at* root);
static bool read_freshness(config* self, const json_at* root);
static bool sum_up(config* self);

int config_load(config** loaded, const char* path, char error[CONFIG_ERROR_SIZE])
{
    *loaded = NULL;
    error[0] = '\0';
    config* self = calloc(1, sizeof *self);
    if (self == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "%s: the system refused memory", path);
        return EXIT_OS;
    }
    self->planner = verge_planner_default_def();
    self->freshness = inbox_default_limits();

    json_file file;
    int code = EXIT_CONFIG;
    if (!json_file_load(&file, path)) {
        code = file.missing ? EXIT_NO_INPUT : EXIT_CONFIG;
    } else {
        const json_at root = json_root(&file);
        code = read_document(self, &root);
        if (code == 0) {
            code = read_road(self, &root);
        }
        if (code == 0 && !sum_up(self)) {
            code = EXIT_OS;
            json_fail(&root, "the system refused memory");
        }
    }
    if (code != 0) {
        snprintf(error, CONFIG_ERROR_SIZE, "%s", file.error);
        config_free(self);
        self = NULL;
    }
    json_file_free(&file);
    *loaded = self;
    return code;
}

void config_free(config* self)
{
    if (self == NULL) {
        return;
    }
    road_json_free(&self->planner.road);
    bus_options_free(&self->bus_options);
    free(self->road_file);
    free(self->road_text);
    free(self);
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

/// Everything but the road.
static int read_document(config* self, const json_at* root)
{
    const char* keys[JSON_KEYS_MAX] = {
        "format", "rsu_id", "bus", "road", "road_file", "cycle_ms", "planner", "freshness",
        "control", "metrics", "realtime", "log_format", NULL,
    };
    bus_options_keys(keys, JSON_KEYS_MAX - 1);
    if (!json_expect_object(root, keys)) {
        return EXIT_CONFIG;
    }
    const json_at format = json_member(root, "format");
    if (strcmp(json_string(root, "format"), "verge-rsu/1") != 0) {
        json_fail(&format, "is not \"verge-rsu/1\", expected the format of the daemon's "
                           "configuration");
        return EXIT_CONFIG;
    }
    self->rsu_id = (int32_t)json_integer_or(root, "rsu_id", 0, INT32_MAX, 1);
    self->cycle_ms = (uint32_t)json_integer_or(root, "cycle_ms", CONFIG_CYCLE_MS_MIN,
                                               CONFIG_CYCLE_MS_MAX, CONFIG_CYCLE_MS_DEFAULT);
    const json_at planner = json_member(root, "planner");
    const bool fits = planner_def_from_json(&planner, &self->planner) &&
                      fits_message(&planner, &self->planner) && read_bus(self, root) &&
                      bus_options_read(&self->bus_options, root) && read_freshness(self, root) &&
                      service_read(&self->service, root);
    return fits && root->file->error[0] == '\0' ? 0 : EXIT_CONFIG;
}

static bool read_url(config* self, const json_at* at, const char* url)
{
    const char* fault = transport_url_fault(url);
    if (fault != NULL) {
        return json_fail(at, "is \"%.80s\": %s", url, fault);
    }
    if (strlen(url) >= CONFIG_BUS_SIZE) {
        return json_fail(at, "is too long, expected at most %d characters", CONFIG_BUS_SIZE - 1);
    }
    for (uint32_t i = 0; i < self->bus_count; i++) {
        if (strcmp(self->bus[i], url) == 0) {
            return json_fail(at, "is given twice, expected each bus once");
        }
    }
    snprintf(self->bus[self->bus_count++], CONFIG_BUS_SIZE, "%s", url);
    return true;
}

/// One URL or a list of them.
static bool read_bus(config* self, const json_at* root)
{
    const json_at at = json_member(root, "bus");
    if (!cJSON_IsArray(at.node)) {
        return read_url(self, &at, json_string(root, "bus"));
    }
    const uint32_t count = json_expect_array(&at, 1, CONFIG_BUSES_MAX);
    if (root->file->error[0] != '\0') {
        return false;
    }
    const cJSON* node = at.node->child;
    for (uint32_t i = 0; i < count; i++, node = node->next) {
        const json_at element = json_element(&at, node, i);
        if (!cJSON_IsString(node)) {
            return json_fail(&element, "is not a string, expected the URL of a bus");
        }
        if (count > 1 && strncmp(node->valuestring, "log:", 4) == 0) {
            return json_fail(&element, "is a log among buses, expected it alone or not at all");
        }
        if (!read_url(self, &element, node->valuestring)) {
            return false;
        }
    }
    return true;
}

static bool read_freshness(config* self, const json_at* root)
{
    uint32_t count = 0;
    const inbox_param* params = inbox_params(&count);
    const char* keys[FRESHNESS_KEYS_MAX + 1] = { NULL };
    for (uint32_t i = 0; i < count && i < FRESHNESS_KEYS_MAX; i++) {
        keys[i] = params[i].name;
    }
    const json_at at = json_member(root, "freshness");
    if (!json_given(&at)) {
        return true;
    }
    if (!json_expect_object(&at, keys)) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        double* limit = (double*)((char*)&self->freshness + params[i].offset);
        *limit = json_double_or(&at, params[i].name, params[i].min, params[i].max, *limit);
    }
    const char* fault = inbox_limits_check(&self->freshness);
    if (fault != NULL) {
        const json_at member = json_member(&at, fault);
        return json_fail(&member, "does not fit the other limits, expected fresh_ms <= "
                                  "obstacle_ms <= drop_ms, obstacle_margin_m <= old_margin_m");
    }
    return true;
}

// ---- the road -----------------------------------------------------------------------------

static bool take_road(config* self, const json_at* at)
{
    if (!road_from_json(at, &self->planner.road)) {
        return false;
    }
    self->road_text = value_text(at->node);
    return true;
}

/// Reads the road from its own file: a scenario or {"road": {...}}, or the road itself.
static int read_road_file(config* self, const json_at* at)
{
    self->road_file = json_path(at);
    if (self->road_file == NULL) {
        json_fail(at, "the system refused memory");
        return EXIT_OS;
    }
    json_file file;
    int code = EXIT_CONFIG;
    if (!json_file_load(&file, self->road_file)) {
        code = file.missing ? EXIT_NO_INPUT : EXIT_CONFIG;
    } else {
        const json_at root = json_root(&file);
        const json_at road = json_member(&root, "road");
        code = take_road(self, json_given(&road) ? &road : &root) ? 0 : EXIT_CONFIG;
    }
    if (code != 0) {
        memcpy(at->file->error, file.error, sizeof at->file->error);
    }
    json_file_free(&file);
    return code;
}

static int read_road(config* self, const json_at* root)
{
    const json_at road = json_member(root, "road");
    const json_at road_file = json_member(root, "road_file");
    if (json_given(&road_file) && json_string(root, "road_file")[0] == '\0') {
        json_fail(&road_file, "is not a path, expected the name of a file with a road");
        return EXIT_CONFIG;
    }
    if (json_given(&road) == json_given(&road_file)) {
        json_fail(&road, "%s, expected one of road and road_file",
                  json_given(&road) ? "is given twice" : "is missing");
        return EXIT_CONFIG;
    }
    if (json_given(&road)) {
        return take_road(self, &road) ? 0 : EXIT_CONFIG;
    }
    return read_road_file(self, &road_file);
}

// ---- checksums and printing ---------------------------------------------------------------

/// The checksums identify a road and a configuration to operators.
static bool sum_up(config* self)
{
    if (self->road_text == NULL) {
        return false;
    }
    self->map_crc32 = wire_map_crc32(&self->planner.road);
    char* text = NULL;
    size_t size = 0;
    FILE* memory = open_memstream(&text, &size);
    if (memory == NULL) {
        return false;
    }
    config_print(self, memory);
    const bool written = fclose(memory) == 0;
    if (written) {
        self->config_crc32 = transport_crc32(text, size);
    }
    free(text);
    return written;
}

void config_print(const config* self, FILE* out)
{
    fprintf(out, "{ \"format\": \"verge-rsu/1\",\n  \"rsu_id\": %d,\n  \"bus\": ", self->rsu_id);
    for (uint32_t i = 0; i < self->bus_count; i++) {
        fputs(self->bus_count == 1 ? "" : i == 0 ? "[" : ", ", out);
        string_write(out, self->bus[i]);
    }
    fputs(self->bus_count == 1 ? "" : "]", out);
    bus_options_write(out, &self->bus_options);
    fprintf(out, ",\n  \"cycle_ms\": %u,\n  \"freshness\": ", self->cycle_ms);
    uint32_t count = 0;
    const inbox_param* params = inbox_params(&count);
    for (uint32_t i = 0; i < count; i++) {
        fprintf(out, "%s\"%s\": ", i == 0 ? "{ " : ", ", params[i].name);
        number_write(out, *(const double*)((const char*)&self->freshness + params[i].offset));
    }
    fprintf(out, " }");
    service_write(out, &self->service);
    fprintf(out, ",\n  \"planner\": ");
    planner_def_write(out, &self->planner);
    if (self->road_file != NULL) {
        fprintf(out, ",\n  \"road_file\": ");
        string_write(out, self->road_file);
    } else {
        fprintf(out, ",\n  \"road\": %s", self->road_text);
    }
    fprintf(out, " }\n");
}

void config_bus_list(const config* self, char* text, size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < self->bus_count && used < size; i++) {
        const int length = snprintf(text + used, size - used, "%s%s", i == 0 ? "" : ",",
                                    self->bus[i]);
        used += length > 0 ? (size_t)length : 0;
    }
}

bool config_same_buses(const config* self, const config* other)
{
    bool same = self->bus_count == other->bus_count &&
                bus_options_same(&self->bus_options, &other->bus_options);
    for (uint32_t i = 0; same && i < self->bus_count; i++) {
        same = strcmp(self->bus[i], other->bus[i]) == 0;
    }
    return same;
}

void config_print_memory(const config* self, FILE* out)
{
    verge_memory_term terms[VERGE_MEMORY_TERMS];
    verge_planner_memory_terms(&self->planner, terms);
    size_t sum = 0;
    for (int i = 0; i < VERGE_MEMORY_TERMS; i++) {
        if (terms[i].text != NULL) {
            fprintf(out, "%12zu B  %s\n", terms[i].size, terms[i].text);
            sum += terms[i].size;
        }
    }
    fprintf(out, "%12zu B  planner, all together\n", sum);
}

int config_planner_build(config_planner* built, const config* self, verge_executor* executor,
                         void* executor_context, char error[CONFIG_ERROR_SIZE])
{
    memset(built, 0, sizeof *built);
    verge_planner_def def = self->planner;
    def.executor = executor;
    def.executor_context = executor_context;
    const size_t size = verge_planner_memory_size(&def);
    if (size == 0) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: the planner refuses these parameters");
        return EXIT_CONFIG;
    }
    const size_t rounded = (size + 63) / 64 * 64; // aligned_alloc() needs a multiple
    built->memory = aligned_alloc(64, rounded);
    if (built->memory == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: the system refused %zu bytes", rounded);
        return EXIT_OS;
    }
    memset(built->memory, 0, rounded); // touches every page before the first cycle
    built->size = rounded;
    const verge_status status = verge_planner_init(&built->planner, &def, built->memory, rounded);
    if (status != VERGE_OK) {
        snprintf(error, CONFIG_ERROR_SIZE, "planner: %s", verge_status_text(status));
        config_planner_free(built);
        return EXIT_CONFIG;
    }
    return 0;
}

void config_planner_free(config_planner* built)
{
    free(built->memory);
    memset(built, 0, sizeof *built);
}

bool config_may_follow(const config* self, const config* next, char error[CONFIG_ERROR_SIZE])
{
    const char* key = service_changed(&self->service, &next->service);
    if (key != NULL) {
        snprintf(error, CONFIG_ERROR_SIZE,
                 "%s: differs from what the daemon was started with, expected the same until it "
                 "is restarted", key);
        return false;
    }
    verge_memory_term now[VERGE_MEMORY_TERMS], then[VERGE_MEMORY_TERMS];
    verge_planner_memory_terms(&self->planner, now);
    verge_planner_memory_terms(&next->planner, then);
    for (int i = 0; i < VERGE_MEMORY_TERMS; i++) {
        if (now[i].size != then[i].size) {
            snprintf(error, CONFIG_ERROR_SIZE,
                     "planner: its memory would change from %zu to %zu bytes (%s), expected the "
                     "same until the daemon is restarted", now[i].size, then[i].size,
                     then[i].text != NULL ? then[i].text : now[i].text);
            return false;
        }
    }
    return true;
}

cycle_def config_cycle_def(const config* self, const config_planner* built)
{
    const cycle_def def = {
        .planner = built->planner,
        .vehicles_max = self->planner.vehicles_max,
        .controlled_max = self->planner.controlled_max,
        .limits = self->freshness,
        .rsu_id = self->rsu_id,
        .map_crc32 = self->map_crc32,
    };
    return def;
}
