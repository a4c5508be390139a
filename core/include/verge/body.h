/// The body of a vehicle: its dimensions, where its axles are, and the limits of its motion.
///
///     vehicle.length = 12.0;                        // body derived from length and width, or
///     verge_vehicle_set_body(&vehicle, &body);      // body given, with its length and width
///
/// The reference point of a vehicle is the centre of its rectangle, everywhere. The rear axle lies
/// rear_axle behind the centre and moves along the heading (kinematic single-track model).
///
///       rear overhang   rear_axle    front overhang
///     |<------------->|<------>.         |<----->|
///     +---------------o--------x---------o-------+  --> heading
///               rear axle   centre   front axle
///                     |<--- wheelbase -->|
///
/// A body with trailer_length > 0 is a tractor with a semitrailer. Position, length and width of
/// the vehicle are the tractor's. The trailer turns about the hitch, and its axle does not slip.
///
///              |<---------- trailer_axle ------->|<- trailer_front ->|
///     +--------o---------------------------------o-------------------+
///         trailer's axle                       hitch, `hitch` behind the tractor's centre
///     |<----------------------- trailer_length --------------------->|
#ifndef VERGE_BODY_H
#define VERGE_BODY_H

#include "verge/config.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// All fields zero: not given; the body is derived from length and width of the vehicle. A body
/// with only some of its numbers is refused.
typedef struct verge_body {
    double length, width;     ///< [m] 0.5 .. 30, 0.3 .. 4: the rectangle (of the tractor)
    double rear_axle;         ///< [m] 0 .. 0.5 * length, behind the centre; of an axle group: its
                              ///< middle
    double wheelbase;         ///< [m] 0.2 .. 25, front axle at most 0.5 * length before the centre
    double steer_max;         ///< [rad] 0.05 .. 1.4, of the one front wheel of the model
    double steer_rate_max;    ///< [rad/s] 0.02 .. 10
    double acceleration_max;  ///< [m/s^2] 0.05 .. 20, up to speed_switch
    double speed_switch;      ///< [m/s] 0.1 .. 100; above it acceleration_max falls with 1 / speed
    double braking_max;       ///< [m/s^2] 1 .. 20, also along the ellipse of both accelerations
    double lateral_max;       ///< [m/s^2] 0.5 .. 20, of the tyres or of rolling over
    double speed_max;         ///< [m/s] 1 .. 100
    double hitch;             ///< [m] -15 .. 15, behind the centre
    double trailer_length;    ///< [m] 0 .. 25, 0: no trailer
    double trailer_width;     ///< [m] 0.3 .. 4
    double trailer_axle;      ///< [m] 0.5 .. 25, of the trailer behind the hitch
    double trailer_front;     ///< [m] 0 .. 5, reach of the trailer ahead of the hitch
} verge_body;

/// Kinds of vehicles with a preset body.
typedef enum verge_body_kind {
    VERGE_BODY_CAR = 0,
    VERGE_BODY_VAN = 1,
    VERGE_BODY_BUS = 2,         ///< a solo bus of two axles
    VERGE_BODY_TRUCK = 3,       ///< a rigid truck
    VERGE_BODY_ARTICULATED = 4, ///< a tractor with a semitrailer
    VERGE_BODY_MOTORCYCLE = 5,
    VERGE_BODY_BICYCLE = 6,
} verge_body_kind;
enum { VERGE_BODY_KIND_COUNT = 7 };

/// "car", "van", "bus", "truck", "articulated", "motorcycle" or "bicycle"; "??" for other values.
const char* verge_body_name(verge_body_kind kind);

/// A typical body of this kind. kind: one of the seven, else the car's.
verge_body verge_body_of(verge_body_kind kind);

/// A body of this kind and size [m]: axles and hitch lie where they do in the typical one, in
/// proportion to the length. The axles of a car of 3.5 to 5.5 m are those of the reference car.
/// A trailer keeps its size.
verge_body verge_body_of_size(verge_body_kind kind, double length, double width);

/// The body of a vehicle of which only length and width [m] are known: up to 3.5 m a bicycle or
/// motorcycle (not wider than 1.2 m) or a small car, up to 5.5 m a car, up to 7.5 m a van, up to
/// 12 m a truck (Directive 96/53/EC: no rigid truck is longer), above a bus.
verge_body verge_body_by_size(double length, double width);

/// [m] radius of the tightest turn of its rear axle: wheelbase / tan(steer_max). 0: null, or a body
/// without these numbers.
double verge_body_radius_min(const verge_body* body);

/// One number of a body, for programs that read bodies by name (JSON, manuals).
typedef struct verge_body_param {
    const char* name; ///< as the field
    const char* unit; ///< "m", "rad", ...
    size_t      offset;
    double      min, max;
    const char* text; ///< one sentence
} verge_body_param;

/// The table of all numbers of a body, in the order of the struct.
const verge_body_param* verge_body_params(uint32_t* count);

/// The first number of a body that is out of its range.
typedef struct verge_body_fault {
    const char* field;      ///< as in verge_body; null: no fault
    const char* unit;
    double value, min, max; ///< the range of an axle is that of this length
} verge_body_fault;

/// True if every number is finite and in its range and both axles lie within the length. The
/// numbers of a trailer are checked if trailer_length is not 0. fault may be null.
bool verge_body_check(const verge_body* body, verge_body_fault* fault);

#ifdef __cplusplus
}
#endif

#endif
