/// See start.h.
#include "start.h"

#include "daemon/realtime.h"

#include <stdio.h>

static int usage_error(const program* self, const char* option, const char* text)
{
    fprintf(stderr, "%s:%s: %s\n", self->name, option, text);
    return EXIT_USAGE;
}

int start_read(start_arguments* args, const program* self, int argc, char** argv)
{
    int status = 0;
    if (!options_parse(self, argc, argv, NULL, &status)) {
        args->config_path = NULL;
        return status;
    }
    if (args->config_path == NULL) {
        return usage_error(self, "--config", "missing, see --help");
    }
    bool given = false;
    if (!options_u64(self, "--cycles", args->cycles_text, &args->cycles, &given)) {
        return EXIT_USAGE;
    }
    if (given && (args->cycles == 0 || args->cycles > INT32_MAX)) {
        return usage_error(self, "--cycles", "is out of range, expected 1 to 2147483647");
    }
    log_level level = LOG_INFO;
    if (args->level_text != NULL && !log_level_from(args->level_text, &level)) {
        return usage_error(self, "--log-level",
                           "is unknown, expected error, warning, info or debug");
    }
    if (args->format_text != NULL && !log_format_from(args->format_text, &args->format)) {
        return usage_error(self, "--log-format", "is unknown, expected text or json");
    }
    log_level_set(level);
    return 0;
}

start_options start_options_from(const start_arguments* args, bool floating_corrected)
{
    return (start_options){
        .config_path = args->config_path,
        .log_format = args->format_text != NULL ? &args->format : NULL,
        .floating_corrected = floating_corrected,
        .cycles = (int64_t)args->cycles,
    };
}

int start_fail(const char* name, int code, const char* line)
{
    char text[CONFIG_ERROR_SIZE + 16];
    snprintf(text, sizeof text, "%s: %s", name, line);
    log_plain(text);
    return code;
}

void start_log_format(const start_options* options, const site* site)
{
    const log_format* asked = options->log_format;
    log_setup(asked != NULL ? *asked : site->service.log_format);
}

int start_load(setup* now, const setup_def* def, const start_options* options, const char* name)
{
    char error[CONFIG_ERROR_SIZE];
    const int code = setup_load(now, def, error);
    if (code != 0) {
        return start_fail(name, code, error);
    }
    realtime_prepare(&now->site->service);
    start_log_format(options, now->site);
    return log_start() ? 0
                       : start_fail(name, EXIT_OS, "the system refused a thread for the log, "
                                                   "expected a higher LimitNPROC or TasksMax");
}

void start_complaint(void* context, const char* line)
{
    (void)context;
    char words[384];
    snprintf(words, sizeof words, "%s", line);
    log_event(LOG_WARNING, "bus_complaint", "words=\"%s\"", log_words(words));
}
