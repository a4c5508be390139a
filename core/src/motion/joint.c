/// The trajectories of all vehicles. First each vehicle is planned independently, in parallel,
/// against the predicted tracks (section 3.2.2: "parallel planners"). Then vehicles whose
/// trajectories touch are planned again, one after the other, leaders before followers. The second
/// part is serial and uses only final results of the first, so the executor does not influence the
/// result.
#include "motion/contact.h"
#include "base/contract.h"
#include "base/scalar.h"
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
static void front_first(const vg_job* jobs, uint32_t count, uint32_t* order);
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
        workspaces[i]->ignored = jobs[i].followers;
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

    uint32_t order[VERGE_CONTROLLED_MAX + 1]; // without the 1, gcc 12 warns where the capacity is 1
    front_first(jobs, job_count, order);
    bool changed = true;
    for (uint32_t pass = 0; pass < passes_max && changed; ++pass) {
        changed = false;
        for (uint32_t n = 0; n < job_count; ++n) {
            const uint32_t i = order[n];
            if (must_yield(i, jobs, job_count, tracks, plans, pass)) {
                // Last of all a vehicle takes account of those behind that cannot do it.
                workspaces[i]->ignored = pass < passes_max - 1 ? jobs[i].followers : 0;
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

/// The order of the joint check: in a lane from the front to the rear, so that one pass is enough
/// for a whole convoy. The vehicle ahead has more followers than the one behind.
static void front_first(const vg_job* jobs, uint32_t count, uint32_t* order)
{
    VERGE_ASSERT(count <= VERGE_CONTROLLED_MAX);
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t followers = vg_bits(jobs[i].followers);
        uint32_t at = i;
        for (; at > 0 && vg_bits(jobs[order[at - 1]].followers) < followers; --at) {
            order[at] = order[at - 1];
        }
        order[at] = i;
    }
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

/// Does vehicle i yield to vehicle j where their trajectories touch? In a lane the one behind does,
/// whatever the kinds of their plans: the vehicle ahead has to brake for what is ahead of it.
/// Elsewhere a planned trajectory yields to a fallback, and the later id to the earlier one. Two
/// fallbacks that touch are both planned anew: each was made against the prediction of the other
/// one, which brakes less.
static bool yields_to(const vg_job* i, const vg_job* j, const verge_vehicle_plan* plan,
                      const verge_vehicle_plan* other, uint32_t pass)
{
    const bool falls_back = plan->status != VERGE_PLANNED;
    const bool other_falls_back = other->status != VERGE_PLANNED;
    if ((j->followers >> i->track_index & 1) != 0) {
        return true;
    }
    if ((i->followers >> j->track_index & 1) != 0) {
        return pass == passes_max - 1 && other_falls_back && !falls_back;
    }
    if (falls_back || other_falls_back) {
        return other_falls_back;
    }
    return j->track_index < i->track_index;
}

/// Must vehicle i be planned again? A fallback because of the prediction of a controlled vehicle is
/// planned once more, against the planned trajectory of that vehicle.
static bool must_yield(uint32_t i, const vg_job* jobs, uint32_t count, const verge_tracks* tracks,
                       const verge_vehicle_plan* plans, uint32_t pass)
{
    if (plans[i].status != VERGE_PLANNED && pass == 0 && plans[i].reason == VERGE_REASON_JOINT) {
        return true;
    }
    for (uint32_t j = 0; j < count; ++j) {
        if (j != i && yields_to(&jobs[i], &jobs[j], &plans[i], &plans[j], pass)
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
