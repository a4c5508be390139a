/// Types shared by the whole interface: status codes, actions, vehicles and their habits.
///
/// Units are SI throughout: [m], [s], [rad], [m/s], [m/s^2]. Angles grow counter-clockwise from
/// the x axis and lie in (-pi, pi]; the lateral offset d grows to the left of the direction of
/// travel. A position (x, y) is the centre of the body rectangle, everywhere. Instants (utime)
/// are integer microseconds since the Unix epoch.
#ifndef VERGE_TYPES_H
#define VERGE_TYPES_H

#include "verge/body.h"
#include "verge/config.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Result of a call. Negative: the input was rejected and nothing was changed.
///
/// No function of the interface fails on a null pointer, a value that is not finite or an id that
/// does not exist: a call with a status returns VERGE_ERR_ARGUMENT or what it states, all others do
/// nothing and return zero, null or VERGE_NO_LANE. Two things the library cannot check: that an
/// array is as long as the caller says, and that a handle is one that was initialised.
typedef enum verge_status {
    VERGE_OK = 0,
    VERGE_ERR_DEF = -1,         ///< a parameter of the def is out of its range, or the def was not
                                ///< made by verge_planner_default_def()
    VERGE_ERR_MEMORY = -2,      ///< the memory given is too small or not 64-byte aligned
    VERGE_ERR_ROAD = -3,        ///< the road cannot be built; see verge_road_check()
    VERGE_ERR_CAPACITY = -4,    ///< more vehicles or controlled vehicles than the capacities; a
                                ///< trailer counts as a vehicle
    VERGE_ERR_VEHICLE = -5,     ///< a vehicle with a value that is not finite or out of range
    VERGE_ERR_DUPLICATE = -6,   ///< two vehicles with one id
    VERGE_ERR_OFF_ROAD = -7,    ///< a vehicle whose centre lies on no lane
    VERGE_ERR_CONFIG = -8,      ///< caller and library were compiled with different capacities
    VERGE_ERR_ARGUMENT = -9,    ///< a null pointer that the call needs, or a scene that is not as
                                ///< scene.h says
    VERGE_ERR_SIGNAL = -10,     ///< a signal of an unknown lane, a second one of a lane, or one
                                ///< with a state or a time out of range
} verge_status;

/// A status in words. Never null; static lifetime.
const char* verge_status_text(verge_status status);

#define VERGE_NO_LANE (-1)

/// The actions of Table 1. Messages use the same values.
typedef enum verge_action {
    VERGE_KEEP_SPEED = 0,
    VERGE_ACCELERATE = 1,
    VERGE_DECELERATE = 2,
    VERGE_CHANGE_LEFT = 3,
    VERGE_CHANGE_RIGHT = 4,
} verge_action;
enum { VERGE_ACTION_COUNT = 5 };

/// "KS", "AC", "DC", "LCL" or "LCR".
const char* verge_action_name(verge_action action);

/// Weights of the six cost terms (section 3.2.3). All >= 0. [1]
typedef struct verge_weights {
    double curvature, heading, offset, acceleration, jerk, obstacle;
} verge_weights;

/// How a vehicle drives: its cooperation factor (Eq. 4) and its trajectory weights (Eq. 9).
typedef struct verge_habit {
    double cooperation; ///< [1] gamma in [0, 1]; 0: only the own reward counts, 1: the rewards of
                        ///< all vehicles count equally
    verge_weights weights;
} verge_habit;

typedef enum verge_habit_kind {
    VERGE_AGGRESSIVE = 0,
    VERGE_NORMAL = 1,
    VERGE_CONSERVATIVE = 2,
} verge_habit_kind;

/// The three habits of Table 2.
verge_habit verge_habit_of(verge_habit_kind kind);

/// The state of one vehicle: the input of a planning step. Ranges: verge_vehicle_limits().
typedef struct verge_vehicle {
    int32_t id;             ///< >= 0, unique in a step
    bool    controlled;     ///< true: verge plans it (the paper's AV); false: verge predicts it
    double  x, y;           ///< [m] centre of the body
    double  heading;        ///< [rad] any finite angle
    double  speed;          ///< [m/s] of the centre along the heading; below 0: it moves backwards
    double  acceleration;   ///< [m/s^2] along the path
    double  yaw_rate;       ///< [rad/s] NaN: unknown, taken as 0; also taken as 0 below 2 m/s
    double  length, width;  ///< [m] 0.5 .. 30, 0.3 .. 4
    verge_body body;        ///< axles and limits; its length and width are those above. All zero:
                            ///< derived from length and width
    double  trailer_heading; ///< [rad] of an articulated body; NaN: straight behind the tractor
    double  margin;         ///< [m] >= 0, added to every side of the body, for old data
    int32_t target_lane;    ///< lane id, or VERGE_NO_LANE: no target lane
    verge_habit habit;      ///< of controlled vehicles; ignored otherwise
} verge_vehicle;

/// A vehicle of 5 m x 2 m, normal habit, no target, yaw rate unknown.
verge_vehicle verge_vehicle_default(void);

/// Sets body, length and width of a vehicle.
void verge_vehicle_set_body(verge_vehicle* vehicle, const verge_body* body);

/// The body of a vehicle: its `body` if it is given, else verge_body_by_size() of its length and
/// width.
verge_body verge_vehicle_body(const verge_vehicle* vehicle);

/// A point on a road: lane, distance along its reference line and offset from it.
typedef struct verge_lane_position {
    int32_t lane_id;    ///< VERGE_NO_LANE: on no lane
    double  s;          ///< [m] along the lane; beyond its end possible if it has no successor
    double  d;          ///< [m] to the left
    double  heading;    ///< [rad] of the lane there
    double  curvature;  ///< [1/m] of the lane there
    bool    contained;  ///< |d| <= half the lane's width and s within the lane
} verge_lane_position;

#ifdef __cplusplus
}
#endif

#endif
