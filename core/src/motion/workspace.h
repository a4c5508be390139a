/// The working memory for the trajectory of one vehicle: about 43 KiB with the default parameters,
/// most of it two paths. Each job has its own, so jobs may run on any threads.
#ifndef VG_WORKSPACE_H
#define VG_WORKSPACE_H

#include "motion/batch.h"
#include "motion/contact.h"
#include "motion/sampler.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Why candidates were rejected, in all attempts to plan a vehicle.
typedef struct vg_refusals {
    bool uncontrolled; ///< some touched an uncontrolled vehicle
    bool controlled;   ///< some touched a controlled vehicle
    bool overlap;      ///< the body overlaps another one at t = 0
} vg_refusals;

struct vg_workspace {
    vg_path  paths[2];
    int32_t  path_lanes[2];   ///< lane index of each path; -1 none
    vg_batch first, later;    ///< candidates of the first segment, and of the present later one
    verge_track body;         ///< centre, of the trajectory so far
    verge_track trailer;      ///< the same of the trailer, if there is one
    verge_body shape;         ///< of the vehicle
    vg_rear  motion[VERGE_POINTS_MAX]; ///< rear axle, of the trajectory so far; not at t = 0
    vg_motion start;          ///< rear axle at t = 0
    vg_limits limits;         ///< of the vehicle's body
    uint32_t lane;            ///< reference lane at the end of the trajectory so far
    double   s;               ///< [m] coordinate of the rear axle there, on the path of this lane
    bool     keeps_lane;      ///< the decided segments were given up for the present lane
    bool     resumes;         ///< a fallback that goes on with the last plan
    double   lateral_end;     ///< [s] end of the lateral motion of the first segment
    verge_cost cost;          ///< of the trajectory so far
    vg_refusals refusals;
    uint64_t near_start[2];   ///< tracks (bits) nearer than the clearance at t = 0 to the vehicle,
                              ///< to its trailer
    uint64_t ignored;         ///< tracks (bits) of vehicles that yield to this one
    uint64_t blocking;        ///< tracks (bits) the body overlaps at t = 0 that are in front of it
    uint64_t evaluated;       ///< candidates
};

static_assert(VERGE_VEHICLES_MAX <= 64, "tracks near the start are a 64-bit set");

/// Braking that may be needed after the horizon before the end of a lane, without the limits of
/// normal driving, on a dry road. [m/s^2]
#define VG_DEAD_END_BRAKING 8.0

/// Number of bodies of the vehicle, and body i: 0 is the vehicle, 1 its trailer.
static inline uint32_t vg_workspace_bodies(const vg_workspace* workspace)
{
    return workspace->shape.trailer_length > 0.0 ? 2 : 1;
}
static inline const verge_track* vg_workspace_body(const vg_workspace* workspace, uint32_t i)
{
    return i == 0 ? &workspace->body : &workspace->trailer;
}

/// Path along a lane from the position of the vehicle: from the cache, or built in the slot that
/// `keep` (may be null) does not occupy.
const vg_path* vg_workspace_path(vg_workspace* ws, const vg_job* job, uint32_t lane,
                                 const vg_path* keep);

/// Number of equal steps of at most `step` [s] from one point of a trajectory to the next.
static inline uint32_t vg_parts_of_point(const verge_planner_def* def, double step)
{
    return (uint32_t)(def->point_s / step + 1.0 - 1e-9);
}

/// Writes the motion of the rear axle at instant k to body and motion.
void vg_workspace_place(vg_workspace* ws, uint32_t k, const vg_rear* rear);
/// Moves the trailer, if there is one, behind the body from instant `start` to `last`.
void vg_workspace_pull_trailer(vg_workspace* ws, uint32_t start, uint32_t last);

/// Writes the points start + 1 .. last of a leg to body and motion.
void vg_workspace_drive(vg_workspace* ws, const verge_planner_def* def, const vg_leg* leg,
                        double offset, uint32_t start, uint32_t last);

/// Does the trajectory so far, up to instant `last`, drive over the end of a lane without
/// successor, or towards it at a speed from which braking [m/s^2] after the horizon does not
/// suffice? A vehicle that is already beyond the end may leave the lane, or stop in it with this
/// braking. swings_out: it slowly changes lane; its nose may reach a few metres beyond the end.
bool vg_workspace_runs_out(const vg_workspace* ws, const vg_job* job, const vg_lane* lane,
                           uint32_t last, double braking, bool swings_out);

void vg_cost_add(verge_cost* sum, const verge_cost* cost);

/// Plans one vehicle against the tracks: points, cost, status and reason of the plan; the
/// trajectory of the body is left in ws->body.
void vg_vehicle_plan_trajectory(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                                verge_vehicle_plan* plan);

/// Plans the fallback (fallback.c): the gentlest of a ladder of stopping continuations.
void vg_vehicle_fall_back(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                          verge_vehicle_plan* plan, verge_reason reason);

/// Stops a vehicle that moves backwards (reverse.c).
void vg_vehicle_stop_reversing(vg_workspace* ws, const vg_job* job, verge_vehicle_plan* plan);

/// Prepares the state at t = 0, before the first attempt to plan the vehicle.
void vg_workspace_begin(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);
/// Writes the points of the plan from body and motion.
void vg_workspace_emit(const vg_workspace* ws, const vg_job* job, verge_vehicle_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
