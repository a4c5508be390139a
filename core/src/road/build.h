/// The stages of vg_road_build(), in their order. Each reads the results of the stages before it.
#ifndef VG_ROAD_BUILD_H
#define VG_ROAD_BUILD_H

#include "road/road.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Largest lateral deviation of a fitted line from its survey. A polyline with points 8 m apart has
/// this deviation from a curve of 50 m radius; recorded maps are accurate to a few decimetres. [m]
#define VG_FIT_TOLERANCE 0.15
/// Single points of a noisy survey are not followed: up to VG_FIT_OUTLIER the tolerance counts only
/// where the line is off by VG_FIT_MEAN on the mean of VG_FIT_WINDOW metres to each side. [m]
#define VG_FIT_OUTLIER 0.30
#define VG_FIT_MEAN 0.11
#define VG_FIT_WINDOW 6.0
/// An arc through surveyed points leaves their chord by less than this, or it is not believed. [m]
#define VG_FIT_RISE 0.15
/// An end and a start that are nearer than this are one point, where one lane continues the other.
/// [m]
#define VG_JOINT_GAP 0.5
/// Lanes whose centres are more than this many mean widths apart are not beside each other. [1]
#define VG_BESIDE_WIDTHS_MAX 1.6
/// Surveyed points nearer to one another than this are averaged: the fit takes a sample a metre,
/// and the mean of several points has less noise than each. [m]
#define VG_SURVEY_SPACING 0.5
/// Lanes further apart than this are no continuation of one another. [m]
#define VG_GAP_MAX 20.0
/// A body whose centre is further than this from every lane's edge is off the road. [m]
#define VG_EDGE_REACH 2.0
/// Width of the widest body that conflicts are found for. [m]
#define VG_BODY_WIDTH_MAX 2.6

/// The writable side of a lane's arrays while the road is built.
typedef struct vg_lane_storage {
    double *x, *y, *xss, *yss; ///< knot_count each
    vg_bin* bins;
    uint32_t bin_capacity;
} vg_lane_storage;

/// Two lanes whose surveys come near one another without being neighbours or successors, a < b.
typedef struct vg_meeting {
    uint16_t a, b;
    uint16_t areas_max; ///< capacity for areas
} vg_meeting;

typedef struct vg_meetings {
    uint32_t pairs, areas; ///< how many, and the sum of areas_max
    int32_t  crowded;      ///< a lane with more than VERGE_CONFLICTS_MAX, where counting ends; -1
} vg_meetings;

/// Counts the meetings of a road, and lists them, ordered by a and b, where list is not null.
vg_meetings vg_road_meetings(const verge_road_def* def, vg_meeting* list);

typedef struct vg_road_draft {
    struct verge_road*    road;
    const verge_road_def* def;
    vg_arena*             scratch;
    size_t                scratch_start; ///< [B] what a stage takes of scratch begins here
    vg_lane_storage*      storage; ///< [lane_count]
    vg_meetings           meetings;
} vg_road_draft;

/// Lane indices in the order of their ids; equal ids in the order of their indices.
void    vg_lanes_sort(const verge_road_def* def, uint16_t* order);
/// Index of the first lane with this id, -1 none.
int32_t vg_lanes_find(const verge_road_def* def, const uint16_t* order, int32_t id);

/// The points of a survey one after the other, from its start or from its end. The first and the
/// last point come as surveyed; points nearer than VG_SURVEY_SPACING to one of these are left out;
/// between them runs of points within VG_SURVEY_SPACING of the run's first one come as their mean.
typedef struct vg_survey {
    const verge_lane_def* lane;
    bool     backwards;
    uint32_t next; ///< point that the next run begins with
    uint32_t tail; ///< first point that the last one stands for
} vg_survey;

vg_survey vg_survey_from(const verge_lane_def* lane, bool backwards);
bool      vg_survey_next(vg_survey* survey, double point[2]); ///< false: there are no more
double    vg_survey_length(const verge_lane_def* lane);       ///< [m] of the polyline so reduced
uint32_t  vg_survey_count(const verge_lane_def* lane);        ///< points so reduced

/// Direction and curvature of a survey at its start or its end: of the circle through that point
/// and two more, 3 m apart or more.
typedef struct vg_bearing {
    double heading, curvature; ///< [rad], [1/m]
} vg_bearing;
vg_bearing vg_survey_bearing(const verge_lane_def* lane, bool end);

/// Knots of a lane's line: follows from the survey's length alone, so that memory can be sized
/// without fitting.
uint32_t vg_lane_knot_count(const verge_lane_def* lane);
/// Stations advance by 0.5 to 2 m a metre of lane (bundle.c), which bounds the bins.
uint32_t vg_lane_bin_capacity(const verge_lane_def* lane);

void   vg_road_fit(vg_road_draft* draft);           ///< reference lines (fit.c, fit_*.c)
size_t vg_road_fit_scratch_size(const verge_road_def* def);
void   vg_road_bundle(vg_road_draft* draft);        ///< stations, bins (bundle.c)
size_t vg_road_bundle_scratch_size(const verge_road_def* def);
void   vg_road_grid_take(vg_grid* grid, vg_arena* arena, const verge_road_def* def);
void   vg_road_grid(vg_road_draft* draft);          ///< what is near a point (grid.c)
void   vg_road_route(vg_road_draft* draft);         ///< routes to all targets (route.c)
size_t vg_road_route_scratch_size(const verge_road_def* def);
void   vg_road_relate(vg_road_draft* draft);        ///< merges and conflicts (relate.c)
size_t vg_road_relate_scratch_size(const verge_road_def* def, const vg_meetings* meetings);

/// Lane `other` runs within `limit` metres of `lane` here, as seen along `lane`.
typedef struct vg_run {
    double from, to;             ///< [m] stretch of lane, s
    double other_from, other_to; ///< [m] stretch of other that this part of lane is nearest to, s
} vg_run;
enum { VG_RUNS_MAX = 16 };

/// All stretches of `lane` within `limit` of `other`, in order; found in steps of 2 m. opposite:
/// whether lanes of opposite direction count.
uint32_t vg_lane_runs(const vg_lane* lane, const vg_lane* other, double limit, bool opposite,
                      vg_run runs[VG_RUNS_MAX]);

#ifdef __cplusplus
}
#endif

#endif
