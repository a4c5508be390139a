#include "settings.h"

#include "backend.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const transport_setting_def* def_of(const char* name);
static bool number_parse(const char* text, uint32_t* value);
static bool value_check(const transport_options* options, uint32_t at, char* error,
                        size_t error_size);
static bool members_check(const transport_options* options, const char* group, uint32_t first,
                          char* error, size_t error_size);

const transport_setting_def* transport_setting_at(uint32_t index)
{
    for (const backend* const* bus = backend_list; *bus != NULL; ++bus) {
        if (index < (*bus)->setting_count) {
            return &(*bus)->settings[index];
        }
        index -= (*bus)->setting_count;
    }
    return NULL;
}

uint32_t setting_count(const transport_options* options, const char* name)
{
    uint32_t count = 0;
    while (setting_text(options, name, count) != NULL) {
        ++count;
    }
    return count;
}

const char* setting_text(const transport_options* options, const char* name, uint32_t index)
{
    for (uint32_t i = 0; i < options->setting_count; ++i) {
        if (strcmp(options->settings[i].name, name) == 0 && index-- == 0) {
            return options->settings[i].value;
        }
    }
    return NULL;
}

uint32_t setting_number(const transport_options* options, const char* name, uint32_t index)
{
    const char* text = setting_text(options, name, index);
    const transport_setting_def* def = def_of(name);
    uint32_t value = 0;
    if (text == NULL && def != NULL) {
        text = def->preset;
    }
    return text != NULL && number_parse(text, &value) ? value : 0;
}

bool settings_check(const transport_options* options, char* error, size_t error_size)
{
    for (uint32_t i = 0; i < options->setting_count; ++i) {
        if (!value_check(options, i, error, error_size)) {
            return false;
        }
    }
    const transport_setting_def* def;
    for (uint32_t i = 0; (def = transport_setting_at(i)) != NULL; ++i) {
        if (def->kind == TRANSPORT_SETTING_GROUP &&
            !members_check(options, def->name, i + 1, error, error_size)) {
            return false;
        }
    }
    return true;
}

static const transport_setting_def* def_of(const char* name)
{
    const transport_setting_def* def;
    for (uint32_t i = 0; (def = transport_setting_at(i)) != NULL; ++i) {
        if (strcmp(def->name, name) == 0) {
            return def;
        }
    }
    return NULL;
}

static bool number_parse(const char* text, uint32_t* value)
{
    char* end = NULL;
    errno = 0;
    const unsigned long long number = strtoull(text, &end, 10);
    *value = (uint32_t)number;
    return text[0] >= '0' && text[0] <= '9' && *end == '\0' && errno == 0 && number <= UINT32_MAX;
}

static bool is_member(const char* name, const char* group)
{
    const size_t length = strlen(group);
    return strncmp(name, group, length) == 0 && name[length] == '.';
}

/// The object or list of objects a setting is a member of; null: none.
static const transport_setting_def* group_of(const char* name)
{
    const transport_setting_def* def;
    for (uint32_t i = 0; (def = transport_setting_at(i)) != NULL; ++i) {
        if (def->kind == TRANSPORT_SETTING_GROUP && is_member(name, def->name)) {
            return def;
        }
    }
    return NULL;
}

static bool value_check(const transport_options* options, uint32_t at, char* error,
                        size_t error_size)
{
    const transport_setting*     given = &options->settings[at];
    const transport_setting_def* def = def_of(given->name);
    if (def == NULL || def->kind == TRANSPORT_SETTING_GROUP) {
        snprintf(error, error_size, "%s: unknown setting, expected one of a bus of this build",
                 given->name);
        return false;
    }
    const transport_setting_def* group = group_of(def->name);
    const uint32_t list_max = group != NULL ? group->list_max : def->list_max;
    const uint32_t max = list_max > 0 ? list_max : 1;
    uint32_t       value = 0;
    if (setting_count(options, def->name) > max) {
        snprintf(error, error_size, "%s: is given %u times, expected at most %u", def->name,
                 setting_count(options, def->name), max);
        return false;
    }
    if (def->kind == TRANSPORT_SETTING_NUMBER &&
        (!number_parse(given->value, &value) || value < def->min || value > def->max)) {
        snprintf(error, error_size, "%s: is %.40s, expected %u to %u", def->name, given->value,
                 def->min, def->max);
        return false;
    }
    return true;
}

/// Each member of an object is given as often as the others.
static bool members_check(const transport_options* options, const char* group, uint32_t first,
                          char* error, size_t error_size)
{
    const transport_setting_def* def;
    const uint32_t               count =
        setting_count(options, transport_setting_at(first)->name);
    for (uint32_t i = first; (def = transport_setting_at(i)) != NULL && is_member(def->name, group);
         ++i) {
        if (setting_count(options, def->name) != count) {
            snprintf(error, error_size, "%s: is given %u times, expected %u times, as %s is",
                     def->name, setting_count(options, def->name), count,
                     transport_setting_at(first)->name);
            return false;
        }
    }
    return true;
}
