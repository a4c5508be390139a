/// The second stage: the trajectory of one vehicle, from its decision and the predicted motion of
/// the other vehicles.
///
///     verge_predict(predictor, &scene, &decision, &tracks);
///     verge_plan_vehicle(sampler, &scene, &decision.vehicles[0], &tracks, before, &plan);
///
/// Both functions work without the decision stage: an on-vehicle unit receives its decision in a
/// message, and a decision may be written by hand (apps/examples/own_decision.c). The tracks may
/// come from verge_predict() or from another prediction.
///
/// Memory      The caller owns it; nothing is allocated. The example prints the size of predictor,
///             sampler, scene and tracks for one vehicle with 8 neighbours.
/// Threads     One predictor and one sampler serve one thread at a time.
#ifndef VERGE_TRAJECTORY_H
#define VERGE_TRAJECTORY_H

#include "verge/decision.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The predicted motion of one body: its pose at each instant k * point_s of a trajectory.
typedef struct verge_track {
    int32_t  vehicle_id;
    bool     controlled;
    uint32_t trailer;                 ///< index of the track of its trailer; 0: no trailer
    double   half_length, half_width; ///< [m] of the body, grown by the vehicle's margin
    double   x[VERGE_POINTS_MAX], y[VERGE_POINTS_MAX];                     ///< [m] centre
    double   cos_heading[VERGE_POINTS_MAX], sin_heading[VERGE_POINTS_MAX]; ///< [1]
    double   speed[VERGE_POINTS_MAX]; ///< [m/s] along the heading, below 0: backwards
} verge_track;

/// One track for each vehicle of a scene, in the order of the scene, then one for each trailer. The
/// caller owns the array.
typedef struct verge_tracks {
    uint32_t     count;
    uint32_t     tracks_max; ///< length of `of`
    verge_track* of;
} verge_tracks;

/// An empty set of tracks. of: tracks_max elements, which must outlive the set.
static inline verge_tracks verge_tracks_make(verge_track* of, uint32_t tracks_max)
{
    verge_tracks tracks;
    tracks.count = 0;
    tracks.tracks_max = tracks_max;
    tracks.of = of;
    return tracks;
}

/// Sets id and body of a track from a vehicle, without its trailer, and its pose at instant 0.
static inline void verge_track_begin(verge_track* track, const verge_vehicle* vehicle);
/// Sets pose and speed at instant k < VERGE_POINTS_MAX. heading [rad] within +-1e6.
static inline void verge_track_set(verge_track* track, uint32_t k, double x, double y,
                                   double heading, double speed);
/// Sine and cosine of an angle [rad] within +-1e6, with the same bits on every machine; NaN
/// beyond. Both may be null.
void verge_sincos(double angle, double* sine, double* cosine);

typedef struct verge_predictor verge_predictor;

/// Size of the memory for verge_predictor_init() [B]; 0 if the def is not valid. It grows with
/// vehicles_max and road.lane_count (def.h).
size_t verge_predictor_memory_size(const verge_planner_def* def);
/// Builds a predictor in the caller's memory, which must be aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_CONFIG, VERGE_ERR_MEMORY  *predictor is null
verge_status verge_predictor_init(verge_predictor** predictor, const verge_planner_def* def,
                                  void* memory, size_t size);
/// Size of the memory for verge_predictor_init_shared() [B]; 0 if the def is not valid.
size_t verge_predictor_shared_memory_size(const verge_planner_def* def);
/// Builds a predictor with the def of a decider. It computes in the memory of the decider, where
/// nothing is kept from call to call, and takes little of its own, which must be aligned to 64
/// bytes. Valid as long as the decider; one thread serves both.
/// @retval VERGE_ERR_MEMORY    *predictor is null
/// @retval VERGE_ERR_ARGUMENT  a null pointer; *predictor is null
verge_status verge_predictor_init_shared(verge_predictor** predictor, const verge_decider* decider,
                                         void* memory, size_t size);
/// Fills one track for each vehicle of the scene (section 3.2.2). Vehicles with a decision move as
/// decided. All other vehicles follow the vehicle ahead in their lane (IDM). Their measured lateral
/// motion continues to the next lane centre. Trailers follow their vehicles. decision: may be null;
/// decisions of vehicles that are not in the scene or not on its road are ignored.
/// @retval VERGE_ERR_CAPACITY  more vehicles, or vehicles and trailers, than the def or the tracks
///                             hold; or more decisions than vehicles_max of the decision
/// @retval VERGE_ERR_DEF       the decision of a vehicle has no steps, steps that do not follow one
///                             another, too many passes, an unknown lane, action or reason, or a
///                             number out of range; in both the tracks are unchanged
/// @retval VERGE_ERR_CONFIG    the caller was compiled with other capacities; nothing is changed
/// @retval VERGE_ERR_ARGUMENT  a null pointer, or the scene is not as scene.h says
static inline verge_status verge_predict(verge_predictor* predictor, const verge_scene* scene,
                                         const verge_decision* decision, verge_tracks* tracks);
verge_status verge_predict_for(uint64_t config, verge_predictor* predictor,
                               const verge_scene* scene, const verge_decision* decision,
                               verge_tracks* tracks);

/// Kind of a plan. Messages use the same values.
typedef enum verge_plan_status {
    VERGE_PLANNED = 0,            ///< a sampled trajectory
    VERGE_FALLBACK_KEEP_LANE = 1, ///< no sampled trajectory was acceptable: keeps its lane, or goes
                                  ///< on with its last plan
    VERGE_FALLBACK_BRAKE = 2,     ///< no sampled trajectory was acceptable: brakes in its lane
    VERGE_CANCELLED = 3,          ///< set by the daemon only: earlier plans of the vehicle are void
} verge_plan_status;

/// Why a plan is a fallback. Messages use the same values.
typedef enum verge_reason {
    VERGE_REASON_NONE = 0,          ///< the plan is no fallback
    VERGE_REASON_NO_FEASIBLE = 1,   ///< every candidate exceeds a limit of the vehicle
    VERGE_REASON_COLLISION = 2,     ///< every feasible candidate collides with a predicted body
    VERGE_REASON_JOINT = 3,         ///< every candidate collides with a controlled vehicle's plan
    VERGE_REASON_OVERLAP_NOW = 4,   ///< the body overlaps another one at t = 0
    VERGE_REASON_OFF_ROAD = 5,      ///< the vehicle is on no lane: brakes straight ahead
    VERGE_REASON_OVERRUN = 6,       ///< set by the daemon: the cycle ran out of time
    VERGE_REASON_STALE = 7,         ///< set by the daemon: the vehicle's state is too old
    VERGE_REASON_STOP = 8,          ///< a stop was asked for: verge_plan_stop()
} verge_reason;

/// A sentence for a reason, never null.
const char* verge_reason_text(verge_reason reason);

/// One point of a trajectory: the motion of the centre of the body, and the heading of the body.
/// The point verge_body.rear_axle behind the centre moves along the heading. The trajectory is
/// therefore valid for the centre and not for other points of the vehicle.
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

/// What differs from the vehicle's last plan (bits).
enum {
    VERGE_CHANGED_FIRST = 1u << 0,  ///< there is no last plan
    VERGE_CHANGED_STATUS = 1u << 1,
    VERGE_CHANGED_ACTION = 1u << 2, ///< the present action
    VERGE_CHANGED_WHY = 1u << 3,    ///< reason, vehicle or lane
    VERGE_CHANGED_ORDER = 1u << 4,  ///< after whom it passes the areas ahead
};

/// The plan of one vehicle: its actions and its trajectory.
typedef struct verge_vehicle_plan {
    int32_t           vehicle_id;
    int64_t           utime;         ///< [us] t = 0 of the plan
    verge_plan_status status;
    verge_reason      reason;
    uint32_t          action_count;  ///< covers the decision horizon
    verge_action_step actions[VERGE_STEPS_MAX];
    verge_action      decided;       ///< action of the first step in the decision, see
                                     ///< verge_action_step; VERGE_KEEP_SPEED: there is none
    verge_cause       why;           ///< of waiting now, or of a change not made
    uint32_t          changed;       ///< VERGE_CHANGED_FIRST and its like
    uint32_t          pass_count;    ///< conflict areas ahead whose order was decided
    verge_pass        passes[VERGE_PASSES_MAX];
    uint32_t          point_count;   ///< covers the planning horizon, point 0 at t = 0
    verge_point       points[VERGE_POINTS_MAX];
    verge_cost        cost;
    int32_t           change_lane_id; ///< lane that the trajectory changes to, or VERGE_NO_LANE
    double            change_end;     ///< [s] end of that lane change, from utime
} verge_vehicle_plan;

/// Rounds what the next plan of the vehicle makes use of to the numbers that a plan message can
/// hold: x and y stay; heading, speed, acceleration and curvature of the points go to single
/// precision, change_end to whole milliseconds, upwards, and to 0 where the change is over.
/// verge_planner_step() remembers its plans so; the plan that it returns is not rounded.
void verge_vehicle_plan_round(verge_vehicle_plan* plan);

/// Writes what the vehicle does now and what it waits for ("keeping speed behind vehicle 4; left
/// lane: no room behind vehicle 7"): at most size bytes, always null-terminated. Returns the length
/// without the terminator.
size_t verge_plan_say(const verge_vehicle_plan* plan, char* text, size_t size);

typedef struct verge_sampler verge_sampler;

/// Size of the memory for verge_sampler_init() [B]; 0 if the def is not valid. It grows with the
/// numbers of points and samples.
size_t verge_sampler_memory_size(const verge_planner_def* def);
/// Builds a sampler in the caller's memory, which must be aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_CONFIG, VERGE_ERR_MEMORY  *sampler is null
verge_status verge_sampler_init(verge_sampler** sampler, const verge_planner_def* def, void* memory,
                                size_t size);

/// Plans the trajectory of the vehicle of this decision. If no sampled trajectory is acceptable,
/// the plan is a fallback with its reason.
/// tracks: one for each vehicle of the scene, in the order of the scene, then those of trailers;
/// with the points and point_s of this sampler's def. Of the track of the vehicle itself only the
/// fields that verge_track_begin() sets and `trailer` are used. The track of its trailer is
/// ignored. before: the last plan of the vehicle, for a lane change in progress, or null; not
/// `plan`.
/// @retval VERGE_ERR_VEHICLE   the scene does not contain the vehicle as a controlled one; or a
///                             track has another id than the vehicle of the scene or is not finite;
///                             or the vehicle's own track has another size
/// @retval VERGE_ERR_CAPACITY  the tracks do not fit the scene
/// @retval VERGE_ERR_DEF       the decision is one that verge_predict() rejects, or is shorter than
///                             the planning horizon; in all three the plan is unchanged
/// @retval VERGE_ERR_CONFIG    the caller was compiled with other capacities; nothing is changed
/// @retval VERGE_ERR_ARGUMENT  a null pointer, the scene is not as scene.h says, or before is plan
static inline verge_status verge_plan_vehicle(verge_sampler* sampler, const verge_scene* scene,
                                              const verge_vehicle_decision* decision,
                                              const verge_tracks* tracks,
                                              const verge_vehicle_plan* before,
                                              verge_vehicle_plan* plan);
verge_status verge_plan_vehicle_for(uint64_t config, verge_sampler* sampler,
                                    const verge_scene* scene,
                                    const verge_vehicle_decision* decision,
                                    const verge_tracks* tracks, const verge_vehicle_plan* before,
                                    verge_vehicle_plan* plan);

/// Plans a stop of one vehicle, without a decision: it brakes to standstill in its lane, or straight
/// ahead where it is on none, within the limits of its body and with limited jerk. The gentlest
/// deceleration, from 2 m/s^2 to 8 m/s^2, that meets no body is taken; if each of them meets one,
/// that with the softest contact. The plan is a fallback with VERGE_REASON_STOP. The horizon may end
/// before the vehicle stands; the next call goes on.
/// tracks, before: as for verge_plan_vehicle().
/// @retval  as verge_plan_vehicle()
static inline verge_status verge_plan_stop(verge_sampler* sampler, const verge_scene* scene,
                                           int32_t vehicle_id, const verge_tracks* tracks,
                                           const verge_vehicle_plan* before,
                                           verge_vehicle_plan* plan);
verge_status verge_plan_stop_for(uint64_t config, verge_sampler* sampler, const verge_scene* scene,
                                 int32_t vehicle_id, const verge_tracks* tracks,
                                 const verge_vehicle_plan* before, verge_vehicle_plan* plan);

/// Does the body of one track meet another one in its first `points` instants, at them or between
/// them? A contact that exists at instant 0 counts from there. own: index in the tracks; its own
/// trailer does not count. clearance: [m] free space that is kept on every side, >= 0. The index of
/// the first body met, and of the instant at or before which that happens, in *other and *instant
/// (both may be null).
/// @return  false: no contact, or tracks is null, own is no index, or points is not in
///          1..VERGE_POINTS_MAX; *other and *instant are unchanged
bool verge_tracks_contact(const verge_tracks* tracks, uint32_t own, uint32_t points,
                          double clearance, uint32_t* other, uint32_t* instant);

/// Candidate trajectories evaluated so far.
uint64_t verge_sampler_candidates(const verge_sampler* sampler);

// Compiled by the caller, with the sizes that the caller sees.

static inline verge_status verge_predict(verge_predictor* predictor, const verge_scene* scene,
                                         const verge_decision* decision, verge_tracks* tracks)
{
    return verge_predict_for(VERGE_CONFIG, predictor, scene, decision, tracks);
}

static inline verge_status verge_plan_vehicle(verge_sampler* sampler, const verge_scene* scene,
                                              const verge_vehicle_decision* decision,
                                              const verge_tracks* tracks,
                                              const verge_vehicle_plan* before,
                                              verge_vehicle_plan* plan)
{
    return verge_plan_vehicle_for(VERGE_CONFIG, sampler, scene, decision, tracks, before, plan);
}

static inline verge_status verge_plan_stop(verge_sampler* sampler, const verge_scene* scene,
                                           int32_t vehicle_id, const verge_tracks* tracks,
                                           const verge_vehicle_plan* before,
                                           verge_vehicle_plan* plan)
{
    return verge_plan_stop_for(VERGE_CONFIG, sampler, scene, vehicle_id, tracks, before, plan);
}

static inline void verge_track_set(verge_track* track, uint32_t k, double x, double y,
                                   double heading, double speed)
{
    if (track == NULL || k >= VERGE_POINTS_MAX) {
        return;
    }
    track->x[k] = x;
    track->y[k] = y;
    track->speed[k] = speed;
    verge_sincos(heading, &track->sin_heading[k], &track->cos_heading[k]);
}

static inline void verge_track_begin(verge_track* track, const verge_vehicle* vehicle)
{
    if (track == NULL || vehicle == NULL) {
        return;
    }
    track->vehicle_id = vehicle->id;
    track->controlled = vehicle->controlled;
    track->trailer = 0;
    track->half_length = 0.5 * vehicle->length + vehicle->margin;
    track->half_width = 0.5 * vehicle->width + vehicle->margin;
    verge_track_set(track, 0, vehicle->x, vehicle->y, vehicle->heading, vehicle->speed);
}

#ifdef __cplusplus
}
#endif

#endif
