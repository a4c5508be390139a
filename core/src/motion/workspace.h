/// What planning one vehicle's trajectory needs besides its job: about 46 KiB with the default
/// parameters, most of it two paths. One per job, so jobs may run on any threads.
#ifndef VG_WORKSPACE_H
#define VG_WORKSPACE_H

#include "motion/batch.h"
#include "motion/contact.h"
#include "motion/sampler.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Why candidates were refused, over a whole planning attempt.
typedef struct vg_refusals {
    bool human;   ///< some met a vehicle that is not planned
    bool planned; ///< some met a planned vehicle
    bool overlap; ///< the body overlaps another one at t = 0
} vg_refusals;

struct vg_workspace {
    vg_path  paths[2];
    int32_t  path_lanes[2];   ///< lane index of each path; -1 none
    vg_batch first, later;    ///< candidates of the first segment, and of the present later one
    verge_track body;            ///< centre, of the trajectory so far
    verge_track trailer;         ///< the same of the trailer, where there is one
    verge_body shape;         ///< of the vehicle
    vg_rear  motion[VERGE_POINTS_MAX]; ///< rear axle, of the trajectory so far; not at t = 0
    vg_motion start;          ///< rear axle at t = 0
    vg_limits limits;         ///< of the vehicle's body
    uint32_t lane;            ///< where the trajectory so far ends: reference lane
    double   s;               ///< [m] and the rear axle's coordinate on its path
    double   settled;         ///< [s] end of the first segment's lateral motion
    verge_cost cost;          ///< of the trajectory so far
    vg_refusals refusals;
    uint64_t near_start[2];   ///< tracks (bits) nearer than the clearance at t = 0 to the vehicle,
                              ///< to its trailer
    uint64_t blocking;        ///< tracks (bits) the body overlaps at t = 0 that are in front of it
    uint64_t evaluated;       ///< candidates
};

_Static_assert(VERGE_VEHICLES_MAX <= 64, "tracks near the start are a 64-bit set");

/// How many bodies the vehicle has, and each: the vehicle is body 0, its trailer body 1.
static inline uint32_t vg_workspace_bodies(const vg_workspace* workspace)
{
    return workspace->shape.trailer_length > 0.0 ? 2 : 1;
}
static inline const verge_track* vg_workspace_body(const vg_workspace* workspace, uint32_t i)
{
    return i == 0 ? &workspace->body : &workspace->trailer;
}

/// Path along a lane from where the vehicle is, from the cache or built into the slot that
/// `keep` (may be null) does not occupy.
const vg_path* vg_workspace_path(vg_workspace* ws, const vg_job* job, uint32_t lane,
                                 const vg_path* keep);

/// Puts points start + 1 .. last of a leg into body and motion.
void vg_workspace_drive(vg_workspace* ws, const verge_planner_def* def, const vg_leg* leg,
                        double offset, uint32_t start, uint32_t last);

/// Does the trajectory so far, up to instant last, run over the end of a dead-end lane, or so
/// fast towards it at the horizon that braking [m/s^2] would not do? Who is over it already may
/// leave the lane, but go on in it no farther than such a braking takes.
bool vg_workspace_runs_out(const vg_workspace* ws, const vg_job* job, const vg_lane* lane,
                           uint32_t last, double braking);

void vg_cost_add(verge_cost* sum, const verge_cost* cost);

/// Plans one vehicle against the tracks: points, cost, status and reason of the plan; the
/// trajectory of the body is left in ws->body.
void vg_vehicle_plan_trajectory(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                                verge_vehicle_plan* plan);

/// The fallback (fallback.c): keeps its lane slowing down gently, else brakes in it.
void vg_vehicle_fall_back(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks,
                          verge_vehicle_plan* plan, verge_reason reason);

/// Everything that is the same however the vehicle is planned: the state at t = 0.
void vg_workspace_begin(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);
/// body and motion to the points of the plan.
void vg_workspace_emit(const vg_workspace* ws, const vg_job* job, verge_vehicle_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
