/// See operators.h.
#include "operators.h"

#include "daemon/log.h"
#include "daemon/replace.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static bool on_control(void* context, const char* request, uint64_t* ticket, text* answer);
static bool on_scrape(void* context, const char* request, uint64_t* ticket, text* answer);
static bool write_metrics(void* context, const void* record, size_t size);

/// [us] For the last file of metrics.
enum { METRICS_PATIENCE_US = 100000 };

int operators_open(operators* self, const service* service, const operators_def* def,
                   char error[CONFIG_ERROR_SIZE])
{
    const server_def control = { "\n", def->answer_size, on_control, self };
    const server_def metrics = { "\r\n\r\n", OPERATORS_PAGE_SIZE, on_scrape, self };
    char why[CONFIG_ERROR_SIZE - 32];
    self->def = *def;
    memcpy(self->metrics_file, service->metrics_file, sizeof self->metrics_file);
    if (service->control[0] != '\0' &&
        !server_open_unix(&self->control, &control, service->control, why, sizeof why)) {
        snprintf(error, CONFIG_ERROR_SIZE, "control: %s", why);
        return EXIT_OS;
    }
    if (service->metrics_listen[0] != '\0' &&
        !server_open_tcp(&self->metrics, &metrics,
                         (const struct sockaddr*)&service->metrics_address,
                         service->metrics_address_size, why, sizeof why)) {
        snprintf(error, CONFIG_ERROR_SIZE, "metrics.listen: %s", why);
        return EXIT_OS;
    }
    const outlet_def file = { .name = "verge-metrics", .queue_size = 4 * OPERATORS_PAGE_SIZE,
                              .record_max = OPERATORS_PAGE_SIZE, .write = write_metrics,
                              .context = self };
    if (service->metrics_file[0] != '\0' && (self->metrics_out = outlet_create(&file)) == NULL) {
        snprintf(error, CONFIG_ERROR_SIZE, "metrics.file: the system refused a thread (%s)",
                 strerror(errno));
        return EXIT_OS;
    }
    return 0;
}

void operators_close(operators* self)
{
    server_close(self->control);
    server_close(self->metrics);
    outlet_close(self->metrics_out, METRICS_PATIENCE_US);
    self->control = self->metrics = NULL;
    self->metrics_out = NULL;
}

uint32_t operators_ends(const operators* self, struct pollfd* ends)
{
    const uint32_t count = server_ends(self->control, ends);
    return count + server_ends(self->metrics, ends + count);
}

void operators_serve(operators* self, int64_t now)
{
    server_serve(self->control, now);
    server_serve(self->metrics, now);
}

static bool on_reload(const operators_def* def, uint64_t* ticket, text* answer)
{
    const char* reason = "";
    const reload_result result = def->reload(def->context, ticket, &reason);
    if (result == RELOAD_PENDING) {
        return false;
    }
    const bool accepted = result == RELOAD_ACCEPTED;
    text_add(answer, "{\"accepted\":%s,\"reason\":", accepted ? "true" : "false");
    text_add_string(answer, accepted ? "" : reason);
    text_add(answer, "}\n");
    return true;
}

static void add_unknown(const operators_request* requests, text* answer)
{
    text_add(answer, "{\"error\":\"unknown request, expected ");
    for (const operators_request* one = requests; one->word != NULL; one++) {
        text_add(answer, "%s%s", one == requests ? "" : ", ", one->word);
    }
    text_add(answer, " or reload\"}\n");
}

/// A request of verge-ctl is one word, the answer one line of JSON. `reload` is answered when the
/// reload is over.
static bool on_control(void* context, const char* request, uint64_t* ticket, text* answer)
{
    const operators_def* def = &((operators*)context)->def;
    const char* word = request != NULL ? request : "";
    if (strcmp(word, "reload") == 0) {
        return on_reload(def, ticket, answer);
    }
    for (const operators_request* one = def->requests; one->word != NULL; one++) {
        if (strcmp(word, one->word) == 0) {
            one->answer(def->context, answer);
            return true;
        }
    }
    add_unknown(def->requests, answer);
    return true;
}

/// A request of Prometheus, by HTTP. There is one page.
static bool on_scrape(void* context, const char* request, uint64_t* ticket, text* answer)
{
    (void)ticket;
    static const char PAGE[] = "GET /metrics";
    const operators_def* def = &((operators*)context)->def;
    const char* line = request != NULL ? request : "";
    const bool  get = strncmp(line, "GET ", 4) == 0;
    const bool  here = strncmp(line, PAGE, sizeof PAGE - 1) == 0 &&
                       (line[sizeof PAGE - 1] == ' ' || line[sizeof PAGE - 1] == '?');
    text_add(answer, "HTTP/1.1 %s\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\n"
             "Connection: close\r\n\r\n",
             here              ? "200 OK"
             : request == NULL ? "400 Bad Request"
             : get             ? "404 Not Found"
                               : "405 Method Not Allowed");
    if (here) {
        def->metrics(def->context, answer);
    }
    return true;
}

void operators_write(operators* self)
{
    static char buffer[OPERATORS_PAGE_SIZE];
    if (self->metrics_out == NULL) {
        return;
    }
    const int error = atomic_load(&self->metrics_error);
    if (error != 0 && error != self->metrics_error_logged) {
        log_event(LOG_WARNING, "metrics_failed", "file=\"%s\" error=\"%s\"", self->metrics_file,
                  strerror(error));
    }
    self->metrics_error_logged = error;
    text out = text_in(buffer, sizeof buffer);
    self->def.metrics(self->def.context, &out);
    outlet_put(self->metrics_out, out.bytes, out.size); // while the disk is slow, some are left out
}

/// In the thread of the outlet.
static bool write_metrics(void* context, const void* record, size_t size)
{
    operators* self = context;
    atomic_store(&self->metrics_error, replace_file(self->metrics_file, record, size));
    return true;
}
