/// Ranges of vehicles. See limits.h.

#include "base/contract.h"
#include "verge/limits.h"

#define ROW(field, unit, min, max, or_nan) \
    { #field, unit, offsetof(verge_vehicle, field), min, max, or_nan }
#define BOTH_SIGNS(field, unit, max, or_nan) ROW(field, unit, -(max), max, or_nan)

static const verge_vehicle_limit limits[] = {
    BOTH_SIGNS(x, "m", VERGE_LIMIT_POSITION, false),
    BOTH_SIGNS(y, "m", VERGE_LIMIT_POSITION, false),
    BOTH_SIGNS(heading, "rad", VERGE_LIMIT_HEADING, false),
    ROW(speed, "m/s", 0.0, VERGE_LIMIT_SPEED, false),
    BOTH_SIGNS(acceleration, "m/s^2", VERGE_LIMIT_ACCELERATION, false),
    BOTH_SIGNS(yaw_rate, "rad/s", VERGE_LIMIT_YAW_RATE, true),
    ROW(length, "m", VERGE_LIMIT_LENGTH_MIN, VERGE_LIMIT_LENGTH_MAX, false),
    ROW(width, "m", VERGE_LIMIT_WIDTH_MIN, VERGE_LIMIT_WIDTH_MAX, false),
    BOTH_SIGNS(trailer_heading, "rad", VERGE_LIMIT_HEADING, true),
    ROW(margin, "m", 0.0, VERGE_LIMIT_MARGIN, false),
};
enum { LIMIT_COUNT = sizeof limits / sizeof limits[0] };

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
    VERGE_ASSERT(count != NULL);
    *count = LIMIT_COUNT;
    return limits;
}

const verge_vehicle_limit* verge_vehicle_limit_of(const char* name)
{
    VERGE_ASSERT(name != NULL);
    for (uint32_t i = 0; i < LIMIT_COUNT; ++i) {
        if (is_same(limits[i].name, name)) {
            return &limits[i];
        }
    }
    return NULL;
}

bool verge_vehicle_check(const verge_vehicle* vehicle, verge_vehicle_fault* fault)
{
    VERGE_ASSERT(vehicle != NULL);
    for (uint32_t i = 0; i < LIMIT_COUNT; ++i) {
        const verge_vehicle_limit* limit = &limits[i];
        const double value = *(const double*)(const void*)((const char*)vehicle + limit->offset);
        if (!is_within(limit, value)) {
            if (fault != NULL) {
                *fault = (verge_vehicle_fault){ vehicle->id, limit->name, limit->unit, value,
                                                limit->min, limit->max };
            }
            return false;
        }
    }
    if (fault != NULL) {
        *fault = (verge_vehicle_fault){ .vehicle_id = vehicle->id };
    }
    return true;
}
