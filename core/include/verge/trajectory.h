/// The second stage: one vehicle's trajectory from its decision and what the others will do.
///
///     verge_predict(predictor, &scene, &decision, &tracks);
///     verge_plan_vehicle(sampler, &scene, &decision.vehicles[0], &tracks, before, &plan);
///
/// Neither needs the decision stage: an on-vehicle unit gets its decision in a message, another
/// decision maker writes its own (apps/examples/own_decision.c). The tracks may come from
/// verge_predict() or from a prediction of one's own.
///
/// Memory      The caller owns it; nothing is allocated. Predictor, sampler, scene and tracks of one
///             vehicle with 8 neighbours: the example prints the sum.
/// Threads     One predictor and one sampler serve one thread at a time.
#ifndef VERGE_TRAJECTORY_H
#define VERGE_TRAJECTORY_H

#include "verge/decision.h"

#ifdef __cplusplus
extern "C" {
#endif

/// How one body is expected to move: its pose at each instant k * point_s of a trajectory.
typedef struct verge_track {
    int32_t  vehicle_id;
    bool     controlled;
    uint32_t trailer;                 ///< index of the track of its trailer; 0: none
    double   half_length, half_width; ///< [m] of the body, grown by the vehicle's margin
    double   x[VERGE_POINTS_MAX], y[VERGE_POINTS_MAX];                     ///< [m] centre
    double   cos_heading[VERGE_POINTS_MAX], sin_heading[VERGE_POINTS_MAX]; ///< [1]
    double   speed[VERGE_POINTS_MAX];                                      ///< [m/s]
} verge_track;

/// One track for each vehicle of a scene, in its order, then one for each trailer. The array is the
/// caller's.
typedef struct verge_tracks {
    uint32_t     count;
    uint32_t     tracks_max; ///< length of `of`
    verge_track* of;
} verge_tracks;

/// No tracks yet, in an array of tracks_max elements that outlives them.
static inline verge_tracks verge_tracks_make(verge_track* of, uint32_t tracks_max)
{
    verge_tracks tracks;
    tracks.count = 0;
    tracks.tracks_max = tracks_max;
    tracks.of = of;
    return tracks;
}

/// Id and body of a vehicle, without its trailer, and its state at instant 0.
void verge_track_begin(verge_track* track, const verge_vehicle* vehicle);
/// Pose and speed at instant k < VERGE_POINTS_MAX. heading [rad] within +-1e6.
void verge_track_set(verge_track* track, uint32_t k, double x, double y, double heading, double speed);

typedef struct verge_predictor verge_predictor;

/// Bytes verge_predictor_init() needs; 0 where the def is not valid. Grows with vehicles_max.
size_t verge_predictor_memory_size(const verge_planner_def* def);
/// memory: aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_MEMORY  *predictor is null
verge_status verge_predictor_init(verge_predictor** predictor, const verge_planner_def* def, void* memory,
                                  size_t size);
/// Fills one track for each vehicle of the scene (section 3.2.2). Vehicles with a decision move as
/// decided; all others keep their lane behind the vehicle ahead (IDM), and go on across their lane
/// as measured until the next centre. Trailers follow their vehicles. decision: null where nothing
/// is decided; decisions of vehicles that are not in the scene or not on its road are ignored.
/// @retval VERGE_ERR_CAPACITY  more vehicles, or vehicles and trailers, than the def or the tracks
///                             hold; or more decisions than vehicles_max of the decision
/// @retval VERGE_ERR_DEF       the decision of a vehicle has no steps, steps that do not follow one
///                             another, an unknown lane or action, or a number out of range; in both
///                             the tracks are unchanged
verge_status verge_predict(verge_predictor* predictor, const verge_scene* scene,
                           const verge_decision* decision, verge_tracks* tracks);

/// Values are those of the wire.
typedef enum verge_plan_status {
    VERGE_PLANNED = 0,
    VERGE_FALLBACK_KEEP_LANE = 1, ///< no sampled trajectory was acceptable: keeps its lane
    VERGE_FALLBACK_BRAKE = 2,     ///< no sampled trajectory was acceptable: brakes in its lane
    VERGE_CANCELLED = 3,          ///< never made by the planner; sent by the daemon
} verge_plan_status;

/// Why a plan is a fallback. Values are those of the wire.
typedef enum verge_reason {
    VERGE_REASON_NONE = 0,
    VERGE_REASON_NO_FEASIBLE = 1,   ///< every candidate broke a kinematic limit
    VERGE_REASON_COLLISION = 2,     ///< every feasible candidate met a predicted body
    VERGE_REASON_JOINT = 3,         ///< every candidate met the trajectory of another planned vehicle
    VERGE_REASON_OVERLAP_NOW = 4,   ///< the body overlaps another one already
    VERGE_REASON_OFF_ROAD = 5,      ///< not on a lane: brakes straight ahead
    VERGE_REASON_OVERRUN = 6,       ///< set by the daemon: the cycle ran out of time
    VERGE_REASON_STALE = 7,         ///< set by the daemon: the vehicle's state is too old
} verge_reason;

/// A sentence for a reason, never null.
const char* verge_reason_text(verge_reason reason);

/// One point of a trajectory: the motion of the body's centre and the direction of the body.
/// The rear axle, rear_axle of the vehicle's body behind the centre, moves along the heading; so the
/// same trajectory is drivable for the centre stated here and not for another point of the vehicle.
typedef struct verge_point {
    double t;            ///< [s] from the plan's utime
    double x, y;         ///< [m] centre
    double heading;      ///< [rad] of the body
    double speed;        ///< [m/s] of the centre
    double acceleration; ///< [m/s^2] of the centre along its path
    double curvature;    ///< [1/m] yaw rate over speed
    double jerk;         ///< [m/s^3] rate of the acceleration
} verge_point;

/// The six cost terms of the chosen trajectory, weighted, and their sum (Eq. 8).
typedef struct verge_cost {
    double total, curvature, heading, offset, acceleration, jerk, obstacle;
} verge_cost;

/// The plan of one vehicle: its actions and its trajectory.
typedef struct verge_vehicle_plan {
    int32_t           vehicle_id;
    int64_t           utime;         ///< [us] t = 0 of the plan
    verge_plan_status status;
    verge_reason      reason;
    uint32_t          action_count;  ///< covers the decision horizon
    verge_action_step actions[VERGE_STEPS_MAX];
    uint32_t          point_count;   ///< covers the planning horizon, point 0 at t = 0
    verge_point       points[VERGE_POINTS_MAX];
    verge_cost        cost;
    int32_t           change_lane_id; ///< lane that the trajectory changes to, VERGE_NO_LANE none
    double            change_end;     ///< [s] when that lane change ends
} verge_vehicle_plan;

typedef struct verge_sampler verge_sampler;

/// Bytes verge_sampler_init() needs; 0 where the def is not valid. Grows with points and samples.
size_t verge_sampler_memory_size(const verge_planner_def* def);
/// memory: aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_MEMORY  *sampler is null
verge_status verge_sampler_init(verge_sampler** sampler, const verge_planner_def* def, void* memory,
                                size_t size);

/// Plans the trajectory of the vehicle that `decision` names. It is always filled: where no sampled
/// trajectory is acceptable, with a fallback that says why.
/// tracks: one for each vehicle of the scene, in its order, then those of trailers; with the points
/// and point_s of this sampler's def. Of the vehicle's own track only what verge_track_begin() sets
/// counts, and `trailer`; of its trailer's track nothing does.
/// before: the vehicle's last plan, so that a lane change under way goes on, or null; not `plan`.
/// @retval VERGE_ERR_VEHICLE   the scene does not hold the vehicle as a controlled one; or a track is
///                             not that of the scene's vehicle, or is not finite, or the vehicle's
///                             own has another size
/// @retval VERGE_ERR_CAPACITY  the tracks do not fit the scene
/// @retval VERGE_ERR_DEF       the decision is one that verge_predict() refuses, or is shorter than
///                             the planning horizon; in all three the plan is unchanged
verge_status verge_plan_vehicle(verge_sampler* sampler, const verge_scene* scene,
                                const verge_vehicle_decision* decision, const verge_tracks* tracks,
                                const verge_vehicle_plan* before, verge_vehicle_plan* plan);

/// Candidate trajectories evaluated so far.
uint64_t verge_sampler_candidates(const verge_sampler* sampler);

#ifdef __cplusplus
}
#endif

#endif
