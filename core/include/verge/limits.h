/// The ranges of the quantities of a vehicle: one table for messages, files and planner.
///
///     verge_vehicle_fault fault;
///     if (!verge_vehicle_check(&vehicle, &fault)) ... "speed is 71 m/s, expected -15 to 70 m/s"
///
/// A value out of its range is impossible for a road vehicle: a unit is wrong or a message is
/// damaged. Both ends belong to the range. The limits of a single body, such as its largest
/// acceleration, are numbers of that body (body.h).
#ifndef VERGE_LIMITS_H
#define VERGE_LIMITS_H

#include "verge/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VERGE_LIMIT_POSITION 1e7               ///< [m] of x and y, both signs
#define VERGE_LIMIT_HEADING 1.7976931348623157e308 ///< [rad] any finite angle: it is normalised
#define VERGE_LIMIT_SPEED 70.0                 ///< [m/s]
#define VERGE_LIMIT_SPEED_MIN -15.0            ///< [m/s] of a vehicle that moves backwards
#define VERGE_LIMIT_ACCELERATION 30.0          ///< [m/s^2] both signs; only collisions exceed it
#define VERGE_LIMIT_YAW_RATE 5.0               ///< [rad/s] both signs
#define VERGE_LIMIT_LENGTH_MIN 0.5             ///< [m]
#define VERGE_LIMIT_LENGTH_MAX 30.0            ///< [m]
#define VERGE_LIMIT_WIDTH_MIN 0.3              ///< [m]
#define VERGE_LIMIT_WIDTH_MAX 4.0              ///< [m]
#define VERGE_LIMIT_MARGIN 100.0               ///< [m]

/// One quantity of verge_vehicle.
typedef struct verge_vehicle_limit {
    const char* name; ///< as the field
    const char* unit; ///< "m", "rad", ...
    size_t      offset;
    double      min, max;
    bool        or_nan; ///< NaN is allowed as well and means: not known
} verge_vehicle_limit;

/// The table of all quantities, in the order of the struct. Static lifetime.
const verge_vehicle_limit* verge_vehicle_limits(uint32_t* count);

/// The quantity of this name, null if there is none.
const verge_vehicle_limit* verge_vehicle_limit_of(const char* name);

/// The first quantity of a vehicle that is out of its range.
typedef struct verge_vehicle_fault {
    uint32_t    vehicle_index; ///< in the array that was checked
    int32_t     vehicle_id;
    const char* part;  ///< "body" or "habit"; null: the vehicle itself
    const char* field; ///< as in verge_vehicle or its part; null: no fault
    const char* unit;
    double      value, min, max;
    const char* expected; ///< in words, where no range says it; else null
} verge_vehicle_fault;

/// Checks what needs no road: id, the quantities of the table, the body if one is given (it has the
/// vehicle's length and width), the habit of a controlled vehicle. The stages accept every vehicle
/// that passes and whose target lane is on the road (verge_vehicles_check()). vehicle: null is
/// refused. fault may be null.
bool verge_vehicle_check(const verge_vehicle* vehicle, verge_vehicle_fault* fault);

#ifdef __cplusplus
}
#endif

#endif
