/// The candidates of one segment in random traffic, for the tests of cost and evaluation.
#ifndef CANDIDATES_H
#define CANDIDATES_H

#include "motion/target.h"
#include "rng.h"
#include "scene.h"

/// A vehicle of any body on the middle lane of a straight or bent road, eight others around it.
static inline scene* candidates_scene(test_rng* rng)
{
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 80.0 };
    scene* w = scene_make(curvatures[test_rng_below(rng, 3)], 0.0);
    const double v = test_rng_between(rng, 5.0, 20.0);
    const double off = test_rng_between(rng, -0.5, 0.5);
    const double slant = test_rng_between(rng, -0.02, 0.02);
    scene_vehicle(w, 1, 40.0, off, slant, v, 0.3, v);
    const uint32_t kind = test_rng_below(rng, VERGE_BODY_KIND_COUNT);
    const verge_body body = verge_body_of((verge_body_kind)kind);
    w->limits = vg_limits_of(&body);
    for (int i = 0; i < 8; ++i) {
        const double s = test_rng_between(rng, 10.0, 90.0), d = test_rng_between(rng, -1.0, 8.0);
        const double speed = test_rng_between(rng, 0.0, 20.0);
        scene_track(w, s, d, speed, test_rng_between(rng, -1.0, 1.0));
    }
    return w;
}

/// The candidates of its first segment from now on until instant `last`: a change to the left, or
/// the lane kept.
static inline void candidates_sample(scene* w, bool change, uint32_t last, vg_batch* batch,
                                     vg_path* path)
{
    vg_job* job = &w->jobs[0];
    const uint32_t lane = change ? 2 : 1;
    job->segments[0].action = change ? VERGE_CHANGE_LEFT : VERGE_KEEP_SPEED;
    job->segments[0].lane = lane;
    vg_path_build(path, w->road, lane, -1, job->s - 30.0, job->s + 170.0);
    const verge_vehicle* car = job->vehicle;
    const vg_motion centre = { car->x, car->y, car->heading, car->speed, car->acceleration,
                               car->yaw_rate / car->speed };
    const vg_motion rear = vg_motion_of_rear(&centre, w->limits.rear_axle);
    const vg_state start = vg_state_of(path, &rear, job->s);
    batch->start = 0;
    batch->last = last;
    batch->in_lane = !change;
    batch->aim = change ? 0.0 : 0.3;
    batch->comfort = (vg_comfort){ 1.0 / 4.0, 1.0 / 6.0, 1.0 / 4.0, 1.0 / 4.0 };
    vg_target_sample(batch, job, &w->limits, &job->segments[0], path, lane, &start,
                     w->def.point_s * last, &w->tracks, false);
}

#endif
