/// The trajectories of all vehicles. First each vehicle is planned independently, in parallel,
/// against the predicted tracks (section 3.2.2: "parallel planners"). Then vehicles whose
/// trajectories touch are planned again, one after the other in the order of ids. The second part
/// is serial and uses only final results of the first, so the executor does not influence the
/// result.
#include "motion/contact.h"
#include "base/contract.h"
#include "motion/trailer.h"
#include "motion/workspace.h"

/// Rounds of the joint check. If a pair still touches after the last one, one of both falls back.
enum { passes_max = 3 };

/// Inputs and outputs of a task of the executor.
typedef struct tasks {
    vg_workspace* const* workspaces;
    const vg_job*        jobs;
    const verge_tracks*     tracks;
    verge_vehicle_plan*  plans;
} tasks;

static void plan_one(void* arg, uint32_t index);
static void replace_prediction(const vg_workspace* ws, const vg_job* job, verge_tracks* tracks);
static void copy_motion(const verge_track* from, verge_track* to, uint32_t points);
static bool touch(const verge_tracks* tracks, const vg_job* a, const vg_job* b);
static bool must_yield(uint32_t i, const vg_job* jobs, uint32_t count, const verge_tracks* tracks,
                       const verge_vehicle_plan* plans, uint32_t pass);
static void force_apart(vg_workspace* const* workspaces, const vg_job* jobs, uint32_t count,
                        verge_tracks* tracks, verge_vehicle_plan* plans);

uint64_t vg_trajectories_run(vg_workspace* const* workspaces, const vg_job* jobs,
                             uint32_t job_count, verge_tracks* tracks, verge_vehicle_plan* plans,
                             uint32_t* replanned_count)
{
    *replanned_count = 0;
    if (job_count == 0) {
        return 0;
    }
    for (uint32_t i = 0; i < job_count; ++i) {
        VERGE_ASSERT(jobs[i].track_index < tracks->count);
        workspaces[i]->evaluated = 0;
    }
    tasks all = { workspaces, jobs, tracks, plans };
    const verge_planner_def* def = jobs[0].def;
    if (def->executor != NULL) {
        def->executor(def->executor_context, plan_one, &all, job_count);
    } else {
        for (uint32_t i = 0; i < job_count; ++i) {
            plan_one(&all, i);
        }
    }
    for (uint32_t i = 0; i < job_count; ++i) {
        replace_prediction(workspaces[i], &jobs[i], tracks);
    }

    bool changed = true;
    for (uint32_t pass = 0; pass < passes_max && changed; ++pass) {
        changed = false;
        for (uint32_t i = 0; i < job_count; ++i) {
            if (must_yield(i, jobs, job_count, tracks, plans, pass)) {
                plan_one(&all, i);
                replace_prediction(workspaces[i], &jobs[i], tracks);
                ++*replanned_count;
                changed = true;
            }
        }
    }
    force_apart(workspaces, jobs, job_count, tracks, plans);

    uint64_t evaluated = 0;
    for (uint32_t i = 0; i < job_count; ++i) {
        evaluated += workspaces[i]->evaluated;
    }
    return evaluated;
}

static void plan_one(void* arg, uint32_t index)
{
    const tasks* all = arg;
    vg_vehicle_plan_trajectory(all->workspaces[index], &all->jobs[index], all->tracks,
                               &all->plans[index]);
}

/// Replaces the prediction of a vehicle by its planned trajectory.
static void replace_prediction(const vg_workspace* ws, const vg_job* job, verge_tracks* tracks)
{
    const uint32_t trailer = vg_trailer_of(tracks, job->track_index);
    copy_motion(&ws->body, &tracks->of[job->track_index], job->def->points);
    if (trailer != job->track_index) {
        copy_motion(&ws->trailer, &tracks->of[trailer], job->def->points);
    }
}

static void copy_motion(const verge_track* from, verge_track* to, uint32_t points)
{
    for (uint32_t k = 0; k < points; ++k) {
        to->x[k] = from->x[k];
        to->y[k] = from->y[k];
        to->cos_heading[k] = from->cos_heading[k];
        to->sin_heading[k] = from->sin_heading[k];
        to->speed[k] = from->speed[k];
    }
}

static bool touch(const verge_tracks* tracks, const vg_job* a, const vg_job* b)
{
    const uint32_t last = a->def->points - 1;
    const uint32_t of_a[2] = { a->track_index, vg_trailer_of(tracks, a->track_index) };
    const uint32_t of_b[2] = { b->track_index, vg_trailer_of(tracks, b->track_index) };
    const uint32_t count_a = of_a[0] == of_a[1] ? 1 : 2, count_b = of_b[0] == of_b[1] ? 1 : 2;
    for (uint32_t i = 0; i < count_a * count_b; ++i) {
        const verge_track* one = &tracks->of[of_a[i / count_b]];
        const verge_track* other = &tracks->of[of_b[i % count_b]];
        if (vg_contact_new(one, other, 0.0, last) <= last) {
            return true;
        }
    }
    return false;
}

/// Must vehicle i be planned again? Of two vehicles whose trajectories touch, the one with the
/// later id yields. If exactly one of them is a fallback, the other one yields. Two fallbacks stay
/// as they are. A fallback because of the prediction of a controlled vehicle is planned once more,
/// against the planned trajectory of that vehicle.
static bool must_yield(uint32_t i, const vg_job* jobs, uint32_t count, const verge_tracks* tracks,
                       const verge_vehicle_plan* plans, uint32_t pass)
{
    if (plans[i].status != VERGE_PLANNED) {
        return pass == 0 && plans[i].reason == VERGE_REASON_JOINT;
    }
    for (uint32_t j = 0; j < count; ++j) {
        if ((j < i || (j > i && plans[j].status != VERGE_PLANNED))
            && touch(tracks, &jobs[i], &jobs[j])) {
            return true;
        }
    }
    return false;
}

/// Vehicles whose trajectories still touch fall back, so that no plan hides a contact.
static void force_apart(vg_workspace* const* workspaces, const vg_job* jobs, uint32_t count,
                        verge_tracks* tracks, verge_vehicle_plan* plans)
{
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t j = 0; j < i; ++j) {
            if (plans[i].status == VERGE_PLANNED && plans[j].status == VERGE_PLANNED
                && touch(tracks, &jobs[i], &jobs[j])) {
                vg_workspace_begin(workspaces[i], &jobs[i], tracks);
                vg_vehicle_fall_back(workspaces[i], &jobs[i], tracks, &plans[i],
                                     VERGE_REASON_JOINT);
                replace_prediction(workspaces[i], &jobs[i], tracks);
            }
        }
    }
}
