/// The planning task of one vehicle: converts the arguments of the stage to a job of the sampler,
/// and the result of the sampler to the plan of the vehicle.
#ifndef VG_JOB_H
#define VG_JOB_H

#include "motion/sampler.h"
#include "motion/workspace.h"

#ifdef __cplusplus
extern "C" {
#endif

/// decision: null or any where the vehicle is on no lane. before: the vehicle's last plan, or null.
/// Fills the job, and of the plan the id and the actions. False: the decision cannot be used (see
/// verge_plan_vehicle()); the plan is unchanged.
bool vg_job_begin(vg_job* job, const verge_planner_def* def, const verge_scene* scene,
                  uint32_t vehicle_index, const verge_vehicle_decision* decision,
                  const verge_vehicle_plan* before, verge_vehicle_plan* plan);

/// Completes a plan after its trajectory: the action shown, brake lights, the lane change in
/// progress, the reason, and what is new against `before`. Scene and before as in vg_job_begin().
void vg_job_end(const vg_job* job, const vg_workspace* workspace, const verge_scene* scene,
                const verge_vehicle_plan* before, verge_vehicle_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
