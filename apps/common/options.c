/// See options.h.
#include "options.h"

#include "output.h"

#include "verge/verge.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool wrong(const program* self, int* status, const char* what, const char* about);
static const option_entry* find(const program* self, const char* text);
static void help(const program* self);

bool options_parse(const program* self, int argc, char** argv, const char** argument, int* status)
{
    const char* positional = NULL;
    bool        ended = false;
    for (int i = 1; i < argc; ++i) {
        const char* text = argv[i];
        if (ended || text[0] != '-' || text[1] == '\0') {
            if (positional != NULL || self->argument == NULL) {
                return wrong(self, status, positional != NULL
                                               ? "one argument too many, expected one"
                                               : "an argument, expected options only", text);
            }
            positional = text;
            continue;
        }
        if (strcmp(text, "--") == 0) {
            ended = true;
            continue;
        }
        if (strcmp(text, "--help") == 0 || strcmp(text, "--version") == 0) {
            if (text[2] == 'h') {
                help(self);
            } else {
                printf("%s %s\n", self->name, VERGE_VERSION_STRING);
            }
            *status = output_flush(self->name) ? 0 : 1;
            return false;
        }
        const option_entry* option = find(self, text);
        const char*         equals = strchr(text, '=');
        if (option == NULL) {
            return wrong(self, status, "unknown option, expected one that --help lists", text);
        }
        if (option->value_name == NULL) {
            if (equals != NULL) {
                return wrong(self, status, "takes no value, expected the option alone", text);
            }
            *option->flag = true;
        } else if (equals != NULL) {
            *option->value = equals + 1;
        } else if (i + 1 < argc) {
            *option->value = argv[++i];
        } else {
            return wrong(self, status, "a value is missing, expected one after it", text);
        }
    }
    if (self->argument != NULL && positional == NULL) {
        return wrong(self, status, "missing, expected one (see --help)", self->argument);
    }
    if (argument != NULL) {
        *argument = positional;
    }
    return true;
}

bool options_u64(const program* self, const char* name, const char* text, uint64_t* value,
                 bool* given)
{
    if (given != NULL) {
        *given = text != NULL;
    }
    if (text == NULL) {
        return true;
    }
    char* end = NULL;
    errno = 0;
    const unsigned long long number = strtoull(text, &end, 10);
    const bool digits = text[0] >= '0' && text[0] <= '9' && *end == '\0';
    if (!digits || errno != 0) {
        fprintf(stderr, "%s:%s: is \"%.40s\", %s\n", self->name, name, text,
                digits ? "expected at most 18446744073709551615"
                       : "not a whole number, expected digits only");
        return false;
    }
    *value = number;
    return true;
}

bool options_number(const program* self, const char* name, const char* text, double min, double max,
                    double* value)
{
    if (text == NULL) {
        return true;
    }
    char* end = NULL;
    const double number = strtod(text, &end);
    if (end == text || *end != '\0' || !(number >= min && number <= max)) {
        fprintf(stderr, "%s:%s: is \"%.40s\", expected a number from %g to %g\n", self->name, name,
                text, min, max);
        return false;
    }
    *value = number;
    return true;
}

/// One line in the form of all others: program:argument: what is wrong.
static bool wrong(const program* self, int* status, const char* what, const char* about)
{
    fprintf(stderr, "%s:%.80s: %s\n", self->name, about, what);
    *status = self->usage_status;
    return false;
}

static const option_entry* find(const program* self, const char* text)
{
    const size_t length = strcspn(text, "=");
    for (uint32_t i = 0; i < self->option_count; ++i) {
        const char* name = self->options[i].name;
        if (strlen(name) == length && strncmp(name, text, length) == 0) {
            return &self->options[i];
        }
    }
    return NULL;
}

static void help(const program* self)
{
    printf("usage: %s [options]%s%s\n\n%s\n\noptions:\n", self->name,
           self->argument != NULL ? " " : "", self->argument != NULL ? self->argument : "",
           self->text);
    for (uint32_t i = 0; i < self->option_count; ++i) {
        const option_entry* option = &self->options[i];
        char head[40];
        snprintf(head, sizeof head, "%s%s%s", option->name, option->value_name != NULL ? " " : "",
                 option->value_name != NULL ? option->value_name : "");
        printf("  %-18s %s\n", head, option->text);
    }
    printf("  %-18s %s\n  %-18s %s\n", "--help", "prints this and ends", "--version",
           "prints the version and ends");
}
