/// See site.h.
#define _GNU_SOURCE
#include "site.h"

#include "common/number.h"
#include "common/planner_json.h"
#include "common/road_json.h"
#include "daemon/planning.h"
#include "verge/transport.h"

#include <stdlib.h>
#include <string.h>

/// More than there are freshness limits.
enum { FRESHNESS_KEYS_MAX = 16 };

static int  read_document(site* self, const site_def* def, const json_at* root);
static bool read_bus(site* self, const json_at* root);
static int  read_road(site* self, const json_at* root);
static bool read_freshness(site* self, const json_at* root);
static bool sum_up(site* self, const site_def* def);

int site_load(site** loaded, const site_def* def, const char* path, char error[CONFIG_ERROR_SIZE])
{
    *loaded = NULL;
    error[0] = '\0';
    site* self = calloc(1, def->size);
    if (self == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "%s: the system refused memory", path);
        return EXIT_OS;
    }
    self->planner = verge_planner_default_def();
    if (def->planner_defaults != NULL) {
        def->planner_defaults(&self->planner);
    }
    self->freshness = inbox_default_limits();

    json_file file;
    int code = EXIT_CONFIG;
    if (!json_file_load(&file, path)) {
        code = file.missing ? EXIT_NO_INPUT : EXIT_CONFIG;
    } else {
        const json_at root = json_root(&file);
        code = read_document(self, def, &root);
        if (code == 0) {
            code = read_road(self, &root);
        }
        if (code == 0 && !sum_up(self, def)) {
            code = EXIT_OS;
            json_fail(&root, "the system refused memory");
        }
    }
    if (code != 0) {
        snprintf(error, CONFIG_ERROR_SIZE, "%s", file.error);
        site_free(self);
        self = NULL;
    }
    json_file_free(&file);
    *loaded = self;
    return code;
}

void site_free(site* self)
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

/// Appends to a null-terminated list of keys, which has room for JSON_KEYS_MAX and the null.
static void add_keys(const char** keys, const char* const* more)
{
    uint32_t count = 0;
    while (keys[count] != NULL) {
        count++;
    }
    for (; *more != NULL && count < JSON_KEYS_MAX; more++) {
        keys[count++] = *more;
    }
    keys[count] = NULL;
}

/// Everything but the road.
static int read_document(site* self, const site_def* def, const json_at* root)
{
    static const char* const SITE_KEYS[] = {
        "bus", "road", "road_file", "cycle_ms", "planner", "freshness", "control", "metrics",
        "realtime", "log_format", NULL,
    };
    const char* keys[JSON_KEYS_MAX + 1] = { "format", NULL };
    add_keys(keys, def->keys);
    add_keys(keys, SITE_KEYS);
    bus_options_keys(keys, JSON_KEYS_MAX);
    if (!json_expect_object(root, keys)) {
        return EXIT_CONFIG;
    }
    const json_at format = json_member(root, "format");
    if (strcmp(json_string(root, "format"), def->format) != 0) {
        json_fail(&format, "is not \"%s\", expected the format of the daemon's configuration",
                  def->format);
        return EXIT_CONFIG;
    }
    self->cycle_ms = (uint32_t)json_integer_or(root, "cycle_ms", def->cycle_ms_min,
                                               def->cycle_ms_max, def->cycle_ms_default);
    const json_at planner = json_member(root, "planner");
    const bool fits = planner_def_from_json(&planner, &self->planner) && read_bus(self, root) &&
                      bus_options_read(&self->bus_options, root) && read_freshness(self, root) &&
                      service_read(&self->service, root) && def->read(self, root);
    return fits && root->file->error[0] == '\0' ? 0 : EXIT_CONFIG;
}

static bool read_url(site* self, const json_at* at, const char* url)
{
    const char* fault = transport_url_fault(url);
    if (fault != NULL) {
        return json_fail(at, "is \"%.80s\": %s", url, fault);
    }
    if (strlen(url) >= SITE_BUS_SIZE) {
        return json_fail(at, "is too long, expected at most %d characters", SITE_BUS_SIZE - 1);
    }
    for (uint32_t i = 0; i < self->bus_count; i++) {
        if (strcmp(self->bus[i], url) == 0) {
            return json_fail(at, "is given twice, expected each bus once");
        }
    }
    snprintf(self->bus[self->bus_count++], SITE_BUS_SIZE, "%s", url);
    return true;
}

/// One URL or a list of them.
static bool read_bus(site* self, const json_at* root)
{
    const json_at at = json_member(root, "bus");
    if (!cJSON_IsArray(at.node)) {
        return read_url(self, &at, json_string(root, "bus"));
    }
    const uint32_t count = json_expect_array(&at, 1, SITE_BUSES_MAX);
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

static bool read_freshness(site* self, const json_at* root)
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

static bool take_road(site* self, const json_at* at)
{
    if (!road_from_json(at, &self->planner.road)) {
        return false;
    }
    self->road_text = value_text(at->node);
    return true;
}

/// Reads the road from its own file: a scenario or {"road": {...}}, or the road itself.
static int read_road_file(site* self, const json_at* at)
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

static int read_road(site* self, const json_at* root)
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
static bool sum_up(site* self, const site_def* def)
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
    site_print(self, def, memory);
    const bool written = fclose(memory) == 0;
    if (written) {
        self->config_crc32 = transport_crc32(text, size);
    }
    free(text);
    return written;
}

static void print_bus(const site* self, FILE* out)
{
    fputs(",\n  \"bus\": ", out);
    for (uint32_t i = 0; i < self->bus_count; i++) {
        fputs(self->bus_count == 1 ? "" : i == 0 ? "[" : ", ", out);
        string_write(out, self->bus[i]);
    }
    fputs(self->bus_count == 1 ? "" : "]", out);
    bus_options_write(out, &self->bus_options);
}

static void print_freshness(const site* self, FILE* out)
{
    fputs(",\n  \"freshness\": ", out);
    uint32_t count = 0;
    const inbox_param* params = inbox_params(&count);
    for (uint32_t i = 0; i < count; i++) {
        fprintf(out, "%s\"%s\": ", i == 0 ? "{ " : ", ", params[i].name);
        number_write(out, *(const double*)((const char*)&self->freshness + params[i].offset));
    }
    fputs(" }", out);
}

void site_print(const site* self, const site_def* def, FILE* out)
{
    fprintf(out, "{ \"format\": \"%s\"", def->format);
    def->print(self, out);
    print_bus(self, out);
    fprintf(out, ",\n  \"cycle_ms\": %u", self->cycle_ms);
    print_freshness(self, out);
    service_write(out, &self->service);
    fputs(",\n  \"planner\": ", out);
    planner_def_write(out, &self->planner);
    if (self->road_file != NULL) {
        fputs(",\n  \"road_file\": ", out);
        string_write(out, self->road_file);
    } else {
        fprintf(out, ",\n  \"road\": %s", self->road_text);
    }
    fputs(" }\n", out);
}

// ---- comparing ----------------------------------------------------------------------------

void site_bus_list(const site* self, char* text, size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < self->bus_count && used < size; i++) {
        const int length = snprintf(text + used, size - used, "%s%s", i == 0 ? "" : ",",
                                    self->bus[i]);
        used += length > 0 ? (size_t)length : 0;
    }
}

bool site_same_buses(const site* self, const site* other)
{
    bool same = self->bus_count == other->bus_count &&
                bus_options_same(&self->bus_options, &other->bus_options);
    for (uint32_t i = 0; same && i < self->bus_count; i++) {
        same = strcmp(self->bus[i], other->bus[i]) == 0;
    }
    return same;
}

bool site_may_follow(const site* self, const site* next, const site_def* def,
                     char error[CONFIG_ERROR_SIZE])
{
    const char* key = service_changed(&self->service, &next->service);
    if (key == NULL && def->changed != NULL) {
        key = def->changed(self, next);
    }
    if (key != NULL) {
        snprintf(error, CONFIG_ERROR_SIZE,
                 "%s: differs from what the daemon was started with, expected the same until it "
                 "is restarted", key);
        return false;
    }
    return planning_same_memory(&self->planner, &next->planner, error);
}
