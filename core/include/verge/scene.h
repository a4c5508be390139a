/// The input of all stages: a road and the vehicles on it at one instant.
///
///     verge_vehicle vehicles[9];
///     verge_lane_position positions[9];
///     verge_scene scene = verge_scene_make(road, vehicles, positions, 9);
///     verge_scene_place(&scene, utime, received, received_count, NULL);
#ifndef VERGE_SCENE_H
#define VERGE_SCENE_H

#include "verge/def.h"
#include "verge/limits.h"

#ifdef __cplusplus
extern "C" {
#endif

/// What a traffic signal shows. Messages use the same values.
typedef enum verge_signal_state {
    VERGE_SIGNAL_OFF = 0,    ///< the rules of the lane hold, as without a signal
    VERGE_SIGNAL_RED = 1,    ///< nobody passes the stop line
    VERGE_SIGNAL_YELLOW = 2, ///< who can stop at the line stops
    VERGE_SIGNAL_GREEN = 3,
} verge_signal_state;
enum { VERGE_SIGNAL_STATE_COUNT = 4 };

/// "off", "red", "yellow" or "green"; "??" for another value.
const char* verge_signal_state_name(verge_signal_state state);

/// The traffic signal of a lane. It stands at the stop line of the lane.
typedef struct verge_signal {
    int32_t            lane_id;
    verge_signal_state state;
    double             change_s; ///< [s] until the next change, from the utime; negative: unknown
} verge_signal;

/// Road and vehicles. The caller owns the arrays.
typedef struct verge_scene {
    const verge_road*    road;
    int64_t              utime;         ///< [us] instant of all states
    uint32_t             vehicle_count;
    uint32_t             vehicles_max;  ///< length of both arrays
    verge_vehicle*       vehicles;      ///< ascending ids
    /// Position of vehicles[i]. lane_id VERGE_NO_LANE: the vehicle is on no lane. Such a vehicle
    /// takes no part in the decision and is predicted straight ahead. A vehicle that faces against
    /// its lane or moves backwards is an obstacle for others, with its motion along the lane; if it
    /// is controlled, it gets no decision and brakes.
    verge_lane_position* positions;
    uint32_t             signal_count;  ///< lanes with a signal, usually 0
    const verge_signal*  signals;       ///< ascending lane ids, one a lane; null where there is
                                        ///< none
} verge_scene;

/// A scene without vehicles, in arrays of vehicles_max elements that outlive it.
static inline verge_scene verge_scene_make(const verge_road* road, verge_vehicle* vehicles,
                                           verge_lane_position* positions, uint32_t vehicles_max)
{
    verge_scene scene;
    scene.road = road;
    scene.utime = 0;
    scene.vehicle_count = 0;
    scene.vehicles_max = vehicles_max;
    scene.vehicles = vehicles;
    scene.positions = positions;
    scene.signal_count = 0;
    scene.signals = NULL;
    return scene;
}

/// Fills utime, vehicles and positions; signals stay as they are. Checks the vehicles, orders them
/// by id and finds the lane of each. Where lanes overlap (merges, diverges), the lane is the one
/// along which the vehicle drives: the lane that it had in `before`, else the successor of that
/// lane towards the target lane, if the vehicle heads along it within 60 degrees; else the lane
/// that fits heading and place best. Among lanes that fit as well, within 0.5 m, it is one from
/// which the target lane can be reached. Between the lanes of a junction a vehicle keeps the lane
/// that it had.
/// before: the scene of the last step, or null. It must have other arrays than `scene`.
/// vehicles: in any order; not the array of `scene`.
/// @retval VERGE_ERR_CAPACITY, VERGE_ERR_VEHICLE, VERGE_ERR_DUPLICATE  vehicle_count is 0
verge_status verge_scene_place(verge_scene* scene, int64_t utime, const verge_vehicle* vehicles,
                               uint32_t vehicle_count, const verge_scene* before);

/// The signal of a lane, null if it has none.
const verge_signal* verge_scene_signal(const verge_scene* scene, int32_t lane_id);

/// The first signal that is refused.
typedef struct verge_signal_fault {
    uint32_t    signal_index;
    const char* field;    ///< "lane", "state" or "change_s"; null: no fault
    const char* expected; ///< in words
} verge_signal_fault;

/// Checks signals as verge_planner_set_signals() does; their order does not matter. fault may be
/// null.
/// @retval VERGE_ERR_SIGNAL    fault states the first defect
/// @retval VERGE_ERR_ARGUMENT  a null pointer
verge_status verge_signals_check(const verge_road* road, const verge_signal* signals,
                                 uint32_t signal_count, verge_signal_fault* fault);

/// Index of a vehicle in the scene, -1 if the scene does not contain it.
int32_t verge_scene_find(const verge_scene* scene, int32_t vehicle_id);

/// Checks vehicles as verge_scene_place() and verge_planner_step() do. fault may be null; it
/// names the first vehicle that is refused, the field, its value and range.
/// @retval VERGE_ERR_VEHICLE    a value out of range, or a target lane that the road does not have
/// @retval VERGE_ERR_DUPLICATE  a vehicle with the id of one before it
verge_status verge_vehicles_check(const verge_road* road, const verge_vehicle* vehicles,
                                  uint32_t vehicle_count, verge_vehicle_fault* fault);

/// The same for one vehicle on its own.
/// @retval VERGE_ERR_VEHICLE   a value out of range
/// @retval VERGE_ERR_OFF_ROAD  its centre lies on no lane: not an error for verge_scene_place()
verge_status verge_road_check_vehicle(const verge_road* road, const verge_vehicle* vehicle,
                                      verge_vehicle_fault* fault);

/// True if the bodies of two vehicles touch. Bodies are oriented rectangles grown by the margin of
/// the vehicle; trailers are included.
bool verge_vehicles_overlap(const verge_vehicle* a, const verge_vehicle* b);
/// Smallest distance between the bodies of two vehicles [m]; 0 if they touch.
double verge_vehicles_distance(const verge_vehicle* a, const verge_vehicle* b);

#ifdef __cplusplus
}
#endif

#endif
