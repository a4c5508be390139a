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

/// Completes a plan after its trajectory: brake lights, and the lane change in progress.
void vg_job_end(const vg_job* job, const vg_workspace* workspace, verge_vehicle_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
