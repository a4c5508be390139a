/// From surveyed points to a smooth line: one chain of lanes that follow one another. fit.c takes
/// the steps in this order. All of them work on one vg_fit, in scratch.
#ifndef VG_ROAD_FIT_H
#define VG_ROAD_FIT_H

#include "road/build.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Weight of a sample that is not to move.
#define VG_FIT_PINNED 1e12

/// Position, direction and curvature of all lanes that meet at one place.
typedef struct vg_pose {
    double x, y, cos_heading, sin_heading; ///< [m], [1]
    double curvature;                      ///< [1/m]
} vg_pose;

/// A point of the survey. tangent and length are those of the shape from here to the next one.
typedef struct vg_fit_vertex {
    double  x, y;
    double  tangent_x, tangent_y;
    double  turn;   ///< [rad] from the chord before to the chord behind
    double  chord;  ///< [m] to the next vertex
    double  length; ///< [m] of the shape to the next vertex
    double  cut;    ///< [m] > 0: a corner; the line may pass this far inside
    double  swing;  ///< [m] by which the line swings out before and after it
    int32_t joint;  ///< lane of the chain that begins here; lane_count at the end; -1 none
} vg_fit_vertex;

typedef struct vg_fit_sample {
    double px, py;    ///< [m] shape
    double qx, qy;    ///< [m] fitted less shape; at the end fitted
    double weight;
    double smoothing; ///< [m] L
    double slack;     ///< [m] allowed deviation in excess of the tolerance
    double band[4];   ///< of the normal matrix: the diagonal and three to its right
    bool   shrink;
} vg_fit_sample;

typedef struct vg_fit {
    uint32_t       lane_count;         ///< of the chain
    double         width;              ///< [m] of its narrowest lane
    double         smoothing;          ///< [m] L to begin with
    double         origin_x, origin_y; ///< sums are kept small by working relative to it
    const vg_pose* ends[2];            ///< pose that start and end have to take; null: free
    double         curvature_weight[2]; ///< of that pose's curvature, relative to the penalty
    vg_fit_vertex* vertices;
    vg_fit_vertex* surveyed;           ///< the vertices before chords are split
    uint32_t       vertex_count, vertex_capacity;
    double*        joints;             ///< [lane_count + 1] sample coordinate of each joint
    vg_fit_sample* samples;
    uint32_t       sample_count, sample_capacity;
    double         spacing;            ///< [m] of samples along the shape
    double*        arc;                ///< [m] arc length at each sample
    double        *x, *y, *xss, *yss, *h, *work; ///< by sample first, by knot then
} vg_fit;

/// Bytes of a fit of so many surveyed points and metres.
size_t vg_fit_size(uint32_t lane_count, uint32_t points, double length);
/// An empty fit of that size, relative to `origin`. False: scratch is too small.
bool   vg_fit_begin(vg_fit* self, vg_arena* scratch, uint32_t lane_count, uint32_t points,
                    double length, const double origin[2]);
/// Adds a vertex. One that (nearly) repeats the vertex before only passes on its joint.
void   vg_fit_add(vg_fit* self, double x, double y, int32_t joint);
void   vg_fit_shape(vg_fit* self);  ///< from vertices to samples of a shape (fit_shape.c)
/// Notes on a vertex how the line cuts it where it could not be driven within the tolerance.
/// surveyed: the same vertex among its neighbours.
void   vg_fit_note_corner(const vg_fit* self, const vg_fit_vertex* surveyed, vg_fit_vertex* corner);
void   vg_fit_deviate(vg_fit* self); ///< where samples may leave the shape (fit_corners.c)
void   vg_fit_smooth(vg_fit* self); ///< the smoothest samples near these (fit_smooth.c)
void   vg_fit_spline(vg_fit* self); ///< a spline through the samples (fit_knots.c)
/// Point and direction of the spline at a joint.
vg_pose vg_fit_at_joint(const vg_fit* self, uint32_t joint);
/// Knots at equal distances on each lane of the chain, taken from the spline; the lanes' lines.
void   vg_fit_knots(vg_fit* self, vg_road_draft* draft, const uint16_t* lanes);

/// Which lanes follow one another one to one: these are fitted as one chain.
typedef struct vg_fit_chain {
    uint16_t first, lane_count; ///< a stretch of chains.lanes
} vg_fit_chain;

typedef struct vg_fit_chains {
    uint32_t     count;
    uint16_t     lanes[VERGE_LANES_MAX]; ///< each lane once
    vg_fit_chain of[VERGE_LANES_MAX];
} vg_fit_chains;

void vg_fit_chains_from(vg_fit_chains* all, const verge_road_def* def);

/// A place where chains meet. Its pose is that of the one lane that all others continue or lead
/// to; where there is none, or a very short one, that of two lanes which follow one another best.
typedef struct vg_fit_place {
    int32_t before, behind; ///< lanes that its pose is taken from; -1: not of any on this side
    vg_pose pose;
} vg_fit_place;

typedef struct vg_fit_places {
    uint32_t      count;
    vg_fit_place* of;      ///< [count], at most a place a lane
    int32_t*      of_ends; ///< [2 * lane + (0 start, 1 end)] the place of that end; -1: free
} vg_fit_places;

size_t vg_fit_places_size(const verge_road_def* def);
/// Finds the places, not yet their poses. False: scratch is too small.
bool   vg_fit_places_find(vg_fit_places* places, vg_arena* scratch, const verge_road_def* def,
                          const vg_fit_chains* chains);

#ifdef __cplusplus
}
#endif

#endif
