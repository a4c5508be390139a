/// See body_json.h.
#include "body_json.h"

#include <string.h>

/// By value of verge_body_kind.
static const char* const KIND_NAMES[] = { "car", "van", "bus", "truck", "articulated",
                                          "motorcycle", "bicycle", NULL };
/// The length of an articulated truck is that of its tractor. A larger value is taken for the
/// length of the whole truck and refused. [m]
static const double TRACTOR_LENGTH_MAX = 9.0;

enum { KIND_UNKNOWN = -1, NUMBERS_MAX = 32 };

static bool keys_expect(const json_at* at, const verge_body_param* params, uint32_t count);
static double size_from_json(const json_at* vehicle, const json_at* at, const char* key, int kind,
                             double typical);
static void numbers_from_json(const json_at* at, verge_body* body);
static bool body_expect(const json_at* at, const verge_body* body);

static bool good(const json_at* at)
{
    return at->file->error[0] == '\0';
}

bool body_from_json(const json_at* vehicle, verge_vehicle* to)
{
    uint32_t                count = 0;
    const verge_body_param* params = verge_body_params(&count);
    const json_at           at = json_member(vehicle, "body");
    int                     kind = KIND_UNKNOWN;
    if (json_given(&at) && cJSON_IsString(at.node)) {
        kind = (int)json_choice(vehicle, "body", KIND_NAMES);
    } else if (json_given(&at)) {
        if (!cJSON_IsObject(at.node)) {
            return json_fail(&at, "is not a body, expected the name of a kind or an object");
        }
        const json_at name = json_member(&at, "kind");
        kind = keys_expect(&at, params, count) && json_given(&name)
                   ? (int)json_choice(&at, "kind", KIND_NAMES) : KIND_UNKNOWN;
    }
    const verge_body typical = verge_body_of((verge_body_kind)(kind < 0 ? 0 : kind));
    const double length = size_from_json(vehicle, &at, "length", kind, typical.length);
    const double width = size_from_json(vehicle, &at, "width", kind, typical.width);
    if (!good(vehicle)) {
        return false;
    }
    to->length = length;
    to->width = width;
    if (!json_given(&at)) {
        return true; // the planner takes the body of this size
    }
    verge_body body = kind < 0 ? verge_body_by_size(length, width)
                               : verge_body_of_size((verge_body_kind)kind, length, width);
    if (kind == VERGE_BODY_ARTICULATED && length > TRACTOR_LENGTH_MAX) {
        const json_at given = json_member(vehicle, "length");
        return json_fail(json_given(&given) ? &given : &at, "makes a tractor of %g m, expected the"
                         " tractor's length without its trailer, %g m at most", length,
                         TRACTOR_LENGTH_MAX);
    }
    if (cJSON_IsObject(at.node)) {
        numbers_from_json(&at, &body);
    }
    verge_vehicle_set_body(to, &body);
    return good(vehicle) && body_expect(&at, &body);
}

/// No other keys than "kind" and the numbers of a body.
static bool keys_expect(const json_at* at, const verge_body_param* params, uint32_t count)
{
    const char* keys[NUMBERS_MAX + 2] = { "kind" };
    for (uint32_t i = 0; i < count && i < NUMBERS_MAX; ++i) {
        keys[i + 1] = params[i].name;
    }
    return json_expect_object(at, keys);
}

static const verge_body_param* param_of(const char* key)
{
    uint32_t                count = 0;
    const verge_body_param* params = verge_body_params(&count);
    uint32_t                i = 0;
    while (i + 1 < count && strcmp(params[i].name, key) != 0) {
        ++i;
    }
    return &params[i];
}

/// Length or width: of the vehicle, of its body where it is an object, or of the kind. Both given
/// have to be the same.
static double size_from_json(const json_at* vehicle, const json_at* at, const char* key, int kind,
                             double typical)
{
    const verge_body_param* param = param_of(key);
    const json_at           own = json_member(vehicle, key);
    const json_at           inside = json_member(at, key); // absent where the body is no object
    if (!json_given(&own) && !json_given(&inside) && kind >= 0) {
        return typical;
    }
    if (!json_given(&inside)) {
        return json_double(vehicle, key, param->min, param->max);
    }
    const double of_body = json_double(at, key, param->min, param->max);
    const double value = json_double_or(vehicle, key, param->min, param->max, of_body);
    if (good(vehicle) && value != of_body) {
        json_fail(&inside, "differs from the %s of the vehicle, expected the same or none", key);
    }
    return value;
}

static void numbers_from_json(const json_at* at, verge_body* body)
{
    uint32_t                count = 0;
    const verge_body_param* params = verge_body_params(&count);
    for (uint32_t i = 0; i < count; ++i) {
        double* number = (double*)(void*)((char*)body + params[i].offset);
        *number = json_double_or(at, params[i].name, params[i].min, params[i].max, *number);
    }
}

/// The numbers together: axles within the length, a trailer with all it needs.
static bool body_expect(const json_at* at, const verge_body* body)
{
    verge_body_fault fault;
    if (verge_body_check(body, &fault)) {
        return true;
    }
    const json_at member = json_member(at, fault.field);
    return json_fail(json_given(&member) ? &member : at,
                     "does not make a body: its %s of %g %s lies outside %g to %g %s, expected"
                     " axles within the length and all numbers of a trailer", fault.field,
                     fault.value, fault.unit, fault.min, fault.max, fault.unit);
}
