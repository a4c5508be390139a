/// Ranges of vehicles. See limits.h.

#include "verge/limits.h"

#define ROW(field, unit, min, max, or_nan) \
    { #field, unit, offsetof(verge_vehicle, field), min, max, or_nan }
#define BOTH_SIGNS(field, unit, max, or_nan) ROW(field, unit, -(max), max, or_nan)

static const verge_vehicle_limit limits[] = {
    BOTH_SIGNS(x, "m", VERGE_LIMIT_POSITION, false),
    BOTH_SIGNS(y, "m", VERGE_LIMIT_POSITION, false),
    BOTH_SIGNS(heading, "rad", VERGE_LIMIT_HEADING, false),
    ROW(speed, "m/s", VERGE_LIMIT_SPEED_MIN, VERGE_LIMIT_SPEED, false),
    BOTH_SIGNS(acceleration, "m/s^2", VERGE_LIMIT_ACCELERATION, false),
    BOTH_SIGNS(yaw_rate, "rad/s", VERGE_LIMIT_YAW_RATE, true),
    ROW(length, "m", VERGE_LIMIT_LENGTH_MIN, VERGE_LIMIT_LENGTH_MAX, false),
    ROW(width, "m", VERGE_LIMIT_WIDTH_MIN, VERGE_LIMIT_WIDTH_MAX, false),
    BOTH_SIGNS(trailer_heading, "rad", VERGE_LIMIT_HEADING, true),
    ROW(margin, "m", 0.0, VERGE_LIMIT_MARGIN, false),
};
enum { LIMIT_COUNT = sizeof limits / sizeof limits[0] };

#define WEIGHT(name) \
    { "weights." #name, "1", offsetof(verge_vehicle, habit.weights.name), 0.0, 1e6, false }

// Of the part "habit".
static const verge_vehicle_limit habit_limits[] = {
    { "cooperation", "1", offsetof(verge_vehicle, habit.cooperation), 0.0, 1.0, false },
    WEIGHT(curvature), WEIGHT(heading), WEIGHT(offset), WEIGHT(acceleration), WEIGHT(jerk),
    WEIGHT(obstacle),
};
enum { HABIT_LIMIT_COUNT = sizeof habit_limits / sizeof habit_limits[0] };

static bool is_within(const verge_vehicle_limit* limit, double value)
{
    return value != value ? limit->or_nan : value >= limit->min && value <= limit->max;
}

static bool is_same(const char* a, const char* b)
{
    while (*a != '\0' && *a == *b) {
        ++a;
        ++b;
    }
    return *a == *b;
}

const verge_vehicle_limit* verge_vehicle_limits(uint32_t* count)
{
    if (count != NULL) {
        *count = LIMIT_COUNT;
    }
    return limits;
}

const verge_vehicle_limit* verge_vehicle_limit_of(const char* name)
{
    for (uint32_t i = 0; i < LIMIT_COUNT && name != NULL; ++i) {
        if (is_same(limits[i].name, name)) {
            return &limits[i];
        }
    }
    return NULL;
}

static double quantity(const verge_vehicle* vehicle, const verge_vehicle_limit* limit)
{
    return *(const double*)(const void*)((const char*)vehicle + limit->offset);
}

static bool rows_hold(const verge_vehicle* vehicle, const verge_vehicle_limit* rows, uint32_t count,
                      verge_vehicle_fault* fault)
{
    for (uint32_t i = 0; i < count; ++i) {
        const double value = quantity(vehicle, &rows[i]);
        if (!is_within(&rows[i], value)) {
            fault->field = rows[i].name;
            fault->unit = rows[i].unit;
            fault->value = value;
            fault->min = rows[i].min;
            fault->max = rows[i].max;
            return false;
        }
    }
    return true;
}

// A single number that is not zero counts: a trailer alone would be one without width and axle.
static bool body_is_given(const verge_body* body)
{
    uint32_t count = 0;
    const verge_body_param* params = verge_body_params(&count);
    bool given = false;
    for (uint32_t i = 0; i < count; ++i) {
        const char* at = (const char*)body + params[i].offset;
        given = given || *(const double*)(const void*)at != 0.0;
    }
    return given;
}

// A body is valid if it is not given, or if its numbers are in range and it has the vehicle's size.
static bool body_holds(const verge_vehicle* vehicle, verge_vehicle_fault* fault)
{
    const verge_body* body = &vehicle->body;
    if (!body_is_given(body)) {
        return true;
    }
    fault->part = "body";
    verge_body_fault of;
    if (!verge_body_check(body, &of)) {
        fault->field = of.field;
        fault->unit = of.unit;
        fault->value = of.value;
        fault->min = of.min;
        fault->max = of.max;
        return false;
    }
    const bool long_enough = body->length == vehicle->length;
    fault->field = long_enough ? "width" : "length";
    fault->unit = "m";
    fault->value = long_enough ? body->width : body->length;
    fault->min = fault->max = long_enough ? vehicle->width : vehicle->length;
    return long_enough && body->width == vehicle->width;
}

static bool find_fault(const verge_vehicle* vehicle, verge_vehicle_fault* fault)
{
    *fault = (verge_vehicle_fault){ .vehicle_id = vehicle->id };
    if (vehicle->id < 0) {
        fault->field = "id";
        fault->unit = "1";
        fault->value = (double)vehicle->id;
        fault->max = (double)INT32_MAX;
        return true;
    }
    if (!rows_hold(vehicle, limits, LIMIT_COUNT, fault) || !body_holds(vehicle, fault)) {
        return true;
    }
    *fault = (verge_vehicle_fault){ .vehicle_id = vehicle->id, .part = "habit" };
    return vehicle->controlled && !rows_hold(vehicle, habit_limits, HABIT_LIMIT_COUNT, fault);
}

bool verge_vehicle_check(const verge_vehicle* vehicle, verge_vehicle_fault* fault)
{
    verge_vehicle_fault found = { .field = "vehicle", .expected = "a vehicle, not a null pointer" };
    const bool bad = vehicle == NULL || find_fault(vehicle, &found);
    if (fault != NULL) {
        *fault = bad ? found : (verge_vehicle_fault){ .vehicle_id = vehicle->id };
    }
    return !bad;
}
