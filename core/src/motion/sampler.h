/// From decided actions to drivable trajectories (section 3.2 of the paper).
#ifndef VG_SAMPLER_H
#define VG_SAMPLER_H

#include "road/road.h"
#include "traffic/actions.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A run of equal actions within the planning horizon, and the state that the decision expects at
/// its end (of the centre, on `lane`).
typedef struct vg_segment {
    double   t0, t1;       ///< [s] t0 of the first is 0, t1 of the last is the planning horizon
    verge_action action;
    uint32_t lane;         ///< index of the reference lane: the lane changed to, or the lane kept
    double   s, d, v;      ///< [m], [m], [m/s] expected at t1, in `lane`
    double   rest;         ///< [s] at the end, without lateral motion
} vg_segment;

/// One vehicle's planning task. Reads only; several jobs may share road, def and tracks.
typedef struct vg_job {
    const verge_planner_def* def;
    const verge_road*    road;
    const verge_vehicle* vehicle;
    bool       on_road;     ///< false: brakes straight ahead (VERGE_REASON_OFF_ROAD)
    bool       stops;       ///< brakes to standstill, whatever is decided (VERGE_REASON_STOP)
    uint32_t   lane;        ///< index of the lane the centre is on
    double     s, d;        ///< [m] of the centre on that lane
    int32_t    target;      ///< lane index, -1 none
    double     curvature;   ///< [1/m] of the centre's path at t = 0, measured or estimated
    uint32_t   track_index; ///< of the vehicle itself in the tracks
    uint64_t   followers;   ///< tracks (bits) of controlled vehicles behind it in its lane
    int32_t    change_lane; ///< index of the lane that the first segment changes to, -1 none
    const verge_vehicle_plan* before; ///< the vehicle's last plan, or null
    double     before_age;  ///< [s] time since then
    uint32_t   segment_count;
    vg_segment segments[VERGE_STEPS_MAX + 1]; ///< a change under way may end inside a step
} vg_job;

typedef struct vg_workspace vg_workspace; ///< one per job, in the planner's arena

/// Takes a workspace for the points and samples of the def. Null: it does not fit, or the arena is
/// measuring.
vg_workspace* vg_workspace_take(vg_arena* arena, const verge_planner_def* def);
/// Plans all jobs, ordered by vehicle id. First each job is planned by the executor against the
/// predicted tracks. Then the joint check: if two trajectories overlap, one of both is planned
/// again against the final trajectory of the other one, until only fallbacks overlap. In a lane the
/// vehicle behind yields, else the one with the later id. Fills points, point_count, cost, status
/// and reason of plans[job]. The tracks of the controlled vehicles are overwritten with their final
/// trajectories. Returns the number of candidate trajectories evaluated.
uint64_t vg_trajectories_run(vg_workspace* const* workspaces, const vg_job* jobs,
                             uint32_t job_count, verge_tracks* tracks, verge_vehicle_plan* plans,
                             uint32_t* replanned_count);

#ifdef __cplusplus
}
#endif

#endif
