/// See planner_json.h.
#include "planner_json.h"

#include "number.h"

#include <string.h>

static void param_from_json(const json_at* at, const verge_param* param, verge_planner_def* def);
static uint32_t search_from_json(const json_at* at);

/// By value of verge_search.
static const char* const SEARCH_NAMES[] = { "paper", "best", "policy", NULL };
/// By value of verge_habit_kind.
static const char* const HABIT_NAMES[] = { "aggressive", "normal", "conservative", NULL };
/// Largest weight of a cost term. It keeps the sum of costs finite. [1]
static const double WEIGHT_MAX = 1e6;

bool planner_def_from_json(const json_at* at, verge_planner_def* def)
{
    uint32_t           param_count = 0;
    const verge_param* params = verge_planner_params(&param_count);
    if (at->node == NULL) {
        return at->file->error[0] == '\0';
    }
    if (!cJSON_IsObject(at->node)) {
        return json_fail(at, "is not an object, expected one with parameters of the planner");
    }
    for (const cJSON* node = at->node->child; node != NULL; node = node->next) {
        const json_at member = json_member(at, node->string);
        uint32_t      i = 0;
        while (i < param_count && strcmp(params[i].name, node->string) != 0) {
            ++i;
        }
        if (i == param_count) {
            return json_fail(&member, "unknown key \"%.40s\", expected a planner parameter",
                             node->string);
        }
        param_from_json(&member, &params[i], def);
    }
    const char* fault = NULL;
    if (at->file->error[0] == '\0' && verge_planner_check(def, &fault) != VERGE_OK) {
        const json_at member = json_member(at, fault != NULL ? fault : "planner");
        return json_fail(&member, "does not fit the other parameters, expected a planner that can"
                                  " be built");
    }
    return at->file->error[0] == '\0';
}

void planner_def_write(FILE* out, const verge_planner_def* def)
{
    uint32_t           count = 0;
    const verge_param* params = verge_planner_params(&count);
    for (uint32_t i = 0; i < count; ++i) {
        const void* field = (const char*)def + params[i].offset;
        uint32_t    small = 0;
        fprintf(out, "%s\"%s\":", i == 0 ? "{" : ",", params[i].name);
        if (params[i].kind == VERGE_PARAM_DOUBLE) {
            double value;
            memcpy(&value, field, sizeof value);
            number_write(out, value);
            continue;
        }
        if (params[i].kind == VERGE_PARAM_U64) {
            uint64_t value;
            memcpy(&value, field, sizeof value);
            number_write_u64(out, value);
            continue;
        }
        memcpy(&small, field, sizeof small);
        if (params[i].kind == VERGE_PARAM_SEARCH) {
            string_write(out, SEARCH_NAMES[small]);
        } else if (params[i].kind == VERGE_PARAM_BOOL) {
            fputs(small != 0 ? "true" : "false", out);
        } else {
            number_write_u64(out, small);
        }
    }
    fputc('}', out);
}

bool habit_from_json(const json_at* at, verge_habit* habit)
{
    static const char* const keys[] = { "cooperation", "weights", NULL };
    static const char* const weight_keys[] = { "curvature",    "heading", "offset",
                                               "acceleration", "jerk",    "obstacle", NULL };
    *habit = verge_habit_of(VERGE_NORMAL);
    if (!json_given(at)) {
        return at->file->error[0] == '\0';
    }
    if (cJSON_IsString(at->node)) {
        *habit = verge_habit_of((verge_habit_kind)json_choice(at->parent, at->key, HABIT_NAMES));
        return at->file->error[0] == '\0';
    }
    if (!cJSON_IsObject(at->node)) {
        return json_fail(at, "is not a habit, expected \"aggressive\", \"normal\", \"conservative\""
                             " or an object with cooperation and weights");
    }
    const json_at weights = json_member(at, "weights");
    if (!json_expect_object(at, keys) || !json_expect_object(&weights, weight_keys)) {
        return false;
    }
    habit->cooperation = json_double(at, "cooperation", 0.0, 1.0);
    habit->weights = (verge_weights){
        .curvature = json_double(&weights, "curvature", 0.0, WEIGHT_MAX),
        .heading = json_double(&weights, "heading", 0.0, WEIGHT_MAX),
        .offset = json_double(&weights, "offset", 0.0, WEIGHT_MAX),
        .acceleration = json_double(&weights, "acceleration", 0.0, WEIGHT_MAX),
        .jerk = json_double(&weights, "jerk", 0.0, WEIGHT_MAX),
        .obstacle = json_double(&weights, "obstacle", 0.0, WEIGHT_MAX),
    };
    return at->file->error[0] == '\0';
}

static void param_from_json(const json_at* at, const verge_param* param, verge_planner_def* def)
{
    void* field = (char*)def + param->offset;
    switch (param->kind) {
    case VERGE_PARAM_DOUBLE: {
        const double value = json_as_double(at, param->min, param->max);
        memcpy(field, &value, sizeof value);
        break;
    }
    case VERGE_PARAM_U64: {
        const uint64_t value = json_as_u64(at);
        memcpy(field, &value, sizeof value);
        break;
    }
    case VERGE_PARAM_U32: {
        const uint32_t value =
            (uint32_t)json_as_integer(at, (int64_t)param->min, (int64_t)param->max);
        memcpy(field, &value, sizeof value);
        break;
    }
    case VERGE_PARAM_SEARCH: {
        const uint32_t value = search_from_json(at);
        memcpy(field, &value, sizeof value);
        break;
    }
    case VERGE_PARAM_BOOL: {
        const uint32_t value = json_bool_or(at->parent, at->key, false);
        memcpy(field, &value, sizeof value);
        break;
    }
    }
}

static uint32_t search_from_json(const json_at* at)
{
    return json_choice(at->parent, at->key, SEARCH_NAMES);
}
