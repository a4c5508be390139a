/// A road with planned vehicles and others, for the tests of the sampler.
/// Roads are three concentric lanes (index 0 the rightmost) of any radius, or straight ones.
#ifndef SCENE_H
#define SCENE_H

#include "base/arena.h"
#include "motion/kinematics.h"
#include "motion/sampler.h"
#include "base/scalar.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { SCENE_LANES = 3, SCENE_POINTS = 81, SCENE_JOBS = 4, SCENE_WORKSPACE = 1 << 18 };
#define SCENE_WIDTH 3.5
#define SCENE_LENGTH 400.0

/// Limits of the reference car.
static inline const vg_limits* scene_car(void)
{
    static vg_limits limits;
    const verge_body car = verge_body_of(VERGE_BODY_CAR);
    limits = vg_limits_of(&car);
    return &limits;
}

typedef struct scene {
    double curvature;  ///< [1/m] of lane 0; > 0 bends to the left
    verge_planner_def def;
    verge_road* road;
    vg_limits limits;  ///< of the planned vehicle's body
    verge_track bodies[VERGE_VEHICLES_MAX];
    verge_tracks tracks;
    uint32_t job_count;
    verge_vehicle vehicles[SCENE_JOBS];
    vg_job jobs[SCENE_JOBS];
    vg_workspace* workspaces[SCENE_JOBS];
    verge_vehicle_plan plans[SCENE_JOBS];
    uint32_t replanned;
    void* memory[2 + SCENE_JOBS];
} scene;

/// Position and heading at (s, d) of lane 0, by the circle itself.
static inline void scene_at(const scene* w, double s, double d, double* x, double* y,
                            double* heading)
{
    const double k = w->curvature;
    *heading = k * s;
    const double cx = fabs(k) < 1e-9 ? s : sin(k * s) / k;
    const double cy = fabs(k) < 1e-9 ? 0.0 : (1.0 - cos(k * s)) / k;
    *x = cx - d * sin(*heading);
    *y = cy + d * cos(*heading);
}

static inline void* scene_memory(size_t size)
{
    void* memory = aligned_alloc(64, (size + 63) / 64 * 64);
    memset(memory, 0, size);
    return memory;
}

/// short_lane: lane 0 ends after this length [m] while its neighbours go on (0: all equal).
static inline scene* scene_make(double curvature, double short_lane)
{
    scene* w = calloc(1, sizeof *w);
    w->curvature = curvature;
    static double points[SCENE_LANES][SCENE_POINTS][2];
    verge_lane_def lanes[SCENE_LANES];
    memset(lanes, 0, sizeof lanes);
    for (int l = 0; l < SCENE_LANES; ++l) {
        // At most three quarters of a circle: a lane never meets itself.
        const double whole = fmin(SCENE_LENGTH, 4.5 / fmax(fabs(curvature), 1e-9));
        const double length = l == 0 && short_lane > 0.0 ? short_lane : whole;
        for (int i = 0; i < SCENE_POINTS; ++i) {
            double heading;
            scene_at(w, length * i / (SCENE_POINTS - 1), SCENE_WIDTH * l, &points[l][i][0],
                     &points[l][i][1], &heading);
        }
        lanes[l].id = l;
        lanes[l].points = (const double (*)[2])points[l];
        lanes[l].point_count = SCENE_POINTS;
        lanes[l].width = SCENE_WIDTH;
        lanes[l].speed_limit = 25.0;
        lanes[l].left = l + 1 < SCENE_LANES ? l + 1 : VERGE_NO_LANE;
        lanes[l].right = l - 1; // -1 is VERGE_NO_LANE
    }
    w->tracks = (verge_tracks){ .tracks_max = VERGE_VEHICLES_MAX, .of = w->bodies };
    w->def = verge_planner_default_def();
    w->def.road = (verge_road_def){ lanes, SCENE_LANES };
    const size_t scratch_size = vg_road_scratch_size(&w->def.road);
    vg_arena arena, scratch;
    w->memory[0] = scene_memory(4u << 20);
    w->memory[1] = scene_memory(scratch_size);
    vg_arena_init(&arena, w->memory[0], 4u << 20);
    vg_arena_init(&scratch, w->memory[1], scratch_size);
    w->road = vg_road_build(&arena, &scratch, &w->def.road);
    for (int i = 0; i < SCENE_JOBS; ++i) {
        // Room for the most points and samples that a test may ask for.
        verge_planner_def most = w->def;
        most.points = VERGE_POINTS_MAX;
        most.point_s = 0.5;
        most.sample_speeds = VERGE_SAMPLE_SPEEDS_MAX;
        most.sample_offsets = VERGE_SAMPLE_OFFSETS_MAX;
        vg_arena own;
        w->memory[2 + i] = scene_memory(SCENE_WORKSPACE);
        vg_arena_init(&own, w->memory[2 + i], SCENE_WORKSPACE);
        w->workspaces[i] = vg_workspace_take(&own, &most);
    }
    return w;
}

static inline void scene_free(scene* w)
{
    for (size_t i = 0; i < sizeof w->memory / sizeof *w->memory; ++i) {
        free(w->memory[i]);
    }
    free(w);
}

/// A body that goes on at constant speed, at offset d of lane 0's coordinates, drifting sideways.
static inline uint32_t scene_track(scene* w, double s, double d, double speed, double drift)
{
    const uint32_t index = w->tracks.count++;
    verge_track* track = &w->tracks.of[index];
    track->vehicle_id = (int32_t)index;
    track->controlled = false;
    track->half_length = 2.5;
    track->half_width = 1.0;
    for (uint32_t k = 0; k < w->def.points; ++k) {
        const double t = w->def.point_s * k;
        const double at = d + drift * t, scale = 1.0 - w->curvature * at;
        double heading;
        scene_at(w, s + speed * t / scale, at, &track->x[k], &track->y[k], &heading);
        heading += speed > 0.1 ? atan2(drift, speed) : 0.0;
        track->cos_heading[k] = cos(heading);
        track->sin_heading[k] = sin(heading);
        track->speed[k] = hypot(speed, drift);
    }
    return index;
}

/// A planned vehicle on `lane` at s of lane 0, d off its lane's centre, keeping its lane at
/// `goal` [m/s] as one segment. Returns its job.
static inline vg_job* scene_vehicle(scene* w, uint32_t lane, double s, double d, double slant,
                                    double speed, double acceleration, double goal)
{
    const uint32_t i = w->job_count++;
    verge_vehicle* v = &w->vehicles[i];
    const double at = SCENE_WIDTH * lane + d;
    *v = verge_vehicle_default();
    v->controlled = true;
    scene_at(w, s, at, &v->x, &v->y, &v->heading);
    v->heading = vg_wrap_angle(v->heading + slant);
    v->speed = speed;
    v->acceleration = acceleration;
    v->yaw_rate = speed * w->curvature / (1.0 - w->curvature * at);
    vg_job* job = &w->jobs[i];
    *job = (vg_job){ .def = &w->def, .road = w->road, .vehicle = v, .on_road = true,
                     .lane = lane, .d = d, .target = -1,
                     .curvature = speed >= VERGE_SPEED_SLOW ? v->yaw_rate / speed : 0.0 };
    job->s = vg_lane_project(&w->road->lanes[lane], v->x, v->y, NAN);
    job->track_index = scene_track(w, s, at, speed, 0.0);
    w->tracks.of[job->track_index].controlled = true;
    v->id = (int32_t)job->track_index;
    job->segment_count = 1;
    job->segments[0] = (vg_segment){ .t1 = w->def.point_s * (w->def.points - 1),
                                     .action = VERGE_KEEP_SPEED, .lane = lane, .v = goal };
    return job;
}

static inline uint64_t scene_run(scene* w)
{
    return vg_trajectories_run(w->workspaces, w->jobs, w->job_count, &w->tracks, w->plans,
                               &w->replanned);
}

#endif
