/// See service.h.
#define _GNU_SOURCE
#include "service.h"

#include "common/number.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>

static bool read_path(const json_at* of, const char* key, char* path, size_t size);
static bool read_metrics(service* self, const json_at* of);
static bool read_listen(service* self, const json_at* metrics);
static bool read_realtime(service* self, const json_at* of);
static bool read_log_format(service* self, const json_at* of);

bool service_read(service* self, const json_at* of)
{
    memset(self, 0, sizeof *self);
    return read_path(of, "control", self->control, sizeof self->control) &&
           read_metrics(self, of) && read_realtime(self, of) && read_log_format(self, of);
}

/// The canonical path of a file that may not exist yet: the real path of its folder, and its name.
/// So the same text gives the same path before and after the file is created. To be freed.
static char* resolve(char* path)
{
    char* slash = path != NULL ? strrchr(path, '/') : NULL;
    if (path == NULL) {
        return NULL;
    }
    const char* name = slash != NULL ? slash + 1 : path;
    if (slash != NULL) {
        *slash = '\0';
    }
    char* folder = realpath(slash == NULL ? "." : path[0] == '\0' ? "/" : path, NULL);
    char* resolved = NULL;
    if (folder != NULL) {
        resolved = malloc(strlen(folder) + strlen(name) + 2);
        if (resolved != NULL) {
            sprintf(resolved, "%s%s%s", folder, folder[1] != '\0' ? "/" : "", name);
        }
        free(folder);
    } else { // no such folder: creating the file will fail and say so
        if (slash != NULL) {
            *slash = '/';
        }
        resolved = strdup(path);
    }
    free(path);
    return resolved;
}

/// A path or null. A relative path starts in the folder of the configuration file.
static bool read_path(const json_at* of, const char* key, char* path, size_t size)
{
    const json_at at = json_member(of, key);
    if (json_none(&at)) {
        return true;
    }
    const char* name = json_string(of, key);
    if (of->file->error[0] != '\0') {
        return false;
    }
    if (name[0] == '\0') {
        return json_fail(&at, "is empty, expected a path or null");
    }
    char* resolved = resolve(json_join(&at));
    const bool fits = resolved != NULL && strlen(resolved) < size;
    if (fits) {
        strcpy(path, resolved);
    }
    free(resolved);
    return fits || json_fail(&at, "is too long, expected a path of at most %zu bytes", size - 1);
}

static bool read_metrics(service* self, const json_at* of)
{
    static const char* const KEYS[] = { "listen", "file", NULL };
    const json_at at = json_member(of, "metrics");
    if (!json_given(&at)) {
        return true;
    }
    return json_expect_object(&at, KEYS) && read_listen(self, &at) &&
           read_path(&at, "file", self->metrics_file, sizeof self->metrics_file);
}

static bool parse_port(const char* text, in_port_t* port)
{
    char* end = NULL;
    const long number = strtol(text, &end, 10);
    *port = htons((uint16_t)number);
    return text[0] >= '0' && text[0] <= '9' && *end == '\0' && number >= 1 && number <= 65535;
}

/// `127.0.0.1:9464` or `[::1]:9464`. Only loopback: access from other machines needs a proxy, which
/// decides who may read the metrics.
static bool read_listen(service* self, const json_at* metrics)
{
    const json_at at = json_member(metrics, "listen");
    if (json_none(&at)) {
        return true;
    }
    char address[sizeof self->metrics_listen] = "";
    const char* text = json_string(metrics, "listen");
    const char* colon = strrchr(text, ':');
    const bool six = text[0] == '[' && colon != NULL && colon > text + 1 && colon[-1] == ']';
    if (metrics->file->error[0] != '\0') {
        return false;
    }
    if (colon != NULL && strlen(text) < sizeof address) {
        const size_t brackets = six ? 1 : 0;
        memcpy(address, text + brackets, (size_t)(colon - text) - 2 * brackets);
        strcpy(self->metrics_listen, text);
    }
    struct sockaddr_in* v4 = (struct sockaddr_in*)&self->metrics_address;
    struct sockaddr_in6* v6 = (struct sockaddr_in6*)&self->metrics_address;
    in_port_t port = 0;
    bool good = colon != NULL && parse_port(colon + 1, &port);
    if (good && six) {
        good = inet_pton(AF_INET6, address, &v6->sin6_addr) == 1 &&
               IN6_IS_ADDR_LOOPBACK(&v6->sin6_addr);
        v6->sin6_family = AF_INET6;
        v6->sin6_port = port;
        self->metrics_address_size = sizeof *v6;
    } else if (good) {
        good = inet_pton(AF_INET, address, &v4->sin_addr) == 1 &&
               ntohl(v4->sin_addr.s_addr) >> 24 == 127;
        v4->sin_family = AF_INET;
        v4->sin_port = port;
        self->metrics_address_size = sizeof *v4;
    }
    return good || json_fail(&at, "is \"%.60s\", expected a loopback address and a port such as "
                             "127.0.0.1:9464 or [::1]:9464", text);
}

static bool read_realtime(service* self, const json_at* of)
{
    static const char* const KEYS[] = { "priority", "lock_memory", "cpus", NULL };
    const json_at at = json_member(of, "realtime");
    if (!json_given(&at)) {
        return true;
    }
    if (!json_expect_object(&at, KEYS)) {
        return false;
    }
    self->planning.priority = (int32_t)json_integer_or(&at, "priority", 0, 99, 0);
    self->lock_memory = json_bool_or(&at, "lock_memory", false);
    const json_at cpus = json_member(&at, "cpus");
    if (json_given(&cpus)) {
        json_expect_array(&cpus, 0, THREAD_CPUS_MAX);
        const cJSON* node = NULL;
        cJSON_ArrayForEach(node, cpus.node)
        {
            if (self->planning.cpu_count == THREAD_CPUS_MAX) {
                break; // the error is in the file
            }
            const json_at cpu = json_element(&cpus, node, self->planning.cpu_count);
            self->planning.cpus[self->planning.cpu_count++] =
                (uint32_t)json_as_integer(&cpu, 0, SERVICE_CPU_MAX);
        }
    }
    return of->file->error[0] == '\0';
}

static bool read_log_format(service* self, const json_at* of)
{
    const json_at at = json_member(of, "log_format");
    return log_format_from(json_string_or(of, "log_format", "text"), &self->log_format) ||
           json_fail(&at, "is unknown, expected text or json");
}

static void write_path(FILE* out, const char* path)
{
    if (path[0] != '\0') {
        string_write(out, path);
    } else {
        fputs("null", out);
    }
}

void service_write(FILE* out, const service* self)
{
    fputs(",\n  \"control\": ", out);
    write_path(out, self->control);
    fputs(",\n  \"metrics\": { \"listen\": ", out);
    write_path(out, self->metrics_listen);
    fputs(", \"file\": ", out);
    write_path(out, self->metrics_file);
    fprintf(out, " },\n  \"realtime\": { \"priority\": %d, \"lock_memory\": %s, \"cpus\": [",
            self->planning.priority, self->lock_memory ? "true" : "false");
    for (uint32_t i = 0; i < self->planning.cpu_count; i++) {
        fprintf(out, "%s%u", i == 0 ? "" : ", ", self->planning.cpus[i]);
    }
    fprintf(out, "] },\n  \"log_format\": \"%s\"", log_format_name(self->log_format));
}

const char* service_changed(const service* self, const service* other)
{
    if (strcmp(self->control, other->control) != 0) {
        return "control";
    }
    if (strcmp(self->metrics_listen, other->metrics_listen) != 0) {
        return "metrics.listen";
    }
    if (strcmp(self->metrics_file, other->metrics_file) != 0) {
        return "metrics.file";
    }
    if (self->lock_memory != other->lock_memory) {
        return "realtime.lock_memory";
    }
    if (self->planning.priority != other->planning.priority) {
        return "realtime.priority";
    }
    const bool same = self->planning.cpu_count == other->planning.cpu_count &&
                      memcmp(self->planning.cpus, other->planning.cpus,
                             self->planning.cpu_count * sizeof self->planning.cpus[0]) == 0;
    return same ? NULL : "realtime.cpus";
}
