/// The built road, for core.
///
/// Lanes are addressed by index (their order in the def). Lanes that are neighbours, directly or
/// through others, form a bundle. Besides its own arc length s, each lane has a *station*: all
/// lanes of a bundle share one station axis and one lateral axis. Two vehicles of a bundle are side
/// by side if their stations are equal, and y = lateral[lane](station) + d compares them laterally,
/// also on different lanes. So the search finds leader and follower by subtraction. Bundles that
/// are joined by successors are related by an offset (vg_relation).
#ifndef VG_ROAD_INTERNAL_H
#define VG_ROAD_INTERNAL_H

#include "base/contract.h"
#include "base/arena.h"
#include "geometry/line.h"
#include "verge/road.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Spacing of a lane's reference knots is close to this; exactly length / (knot_count - 1). [m]
#define VG_KNOT_SPACING 1.0
/// How far along the graph lanes are related. [m]
#define VG_RELATION_REACH 300.0
/// Spacing of the station bins. [m]
#define VG_BIN 4.0

/// The properties of a lane at one station, sampled every VG_BIN metres of station from
/// lane->station_start on; linear between bins.
typedef struct vg_bin {
    float s;          ///< [m] arc length of the lane at this station
    float lateral;    ///< [m] y of the lane's centre on the bundle's lateral axis
    float left_gap;   ///< [m] > 0 to the left neighbour's centre; 0: no change to the left here
    float right_gap;  ///< [m] > 0 to the right neighbour's centre; 0: no change to the right here
    float speed;      ///< [m/s] highest speed here: the limit, or less in and before bends
} vg_bin;             // legal stretches are already applied to the gaps

typedef struct vg_lane {
    int32_t  id;
    double   width, speed_limit;   ///< [m], [m/s]
    double   length;               ///< [m] of the reference line
    double   deviation;            ///< [m] of the surveyed point furthest from the line
    vg_line  line;                 ///< reference line, s = 0 at its first knot
    int32_t  left, right;          ///< lane index, -1 none
    int32_t  successors[VERGE_SUCCESSORS_MAX];
    uint32_t successor_count;
    double   speed_min;            ///< [m/s] least of the bins
    bool     change_left, change_right; ///< some bin has that gap
    verge_priority priority;
    double   stop_line;            ///< [m] s where the front of a body waits; length: not given
    bool     dead_end;             ///< no successor, but a neighbour continues for >= 20 m:
                                   ///< vehicles must leave the lane or stop before its end
    uint32_t bundle;
    double   station_start, station_end; ///< [m] station at s = 0 and at s = length
    uint32_t bin_count;            ///< covers station_start .. station_end
    const vg_bin* bins;
} vg_lane;

/// Converts the position of a vehicle on lane B to the axes of lane A, see local.h: its station is
/// station_B + offset, its lateral position y_B + lateral.
typedef struct vg_relation {
    float   offset;   ///< [m] add to B's station
    float   lateral;  ///< [m] add to B's y
    float   period;   ///< [m] > 0: A and B lie on one ring of this length; wrap differences into
                      ///< +-period/2
    float   touch;    ///< [m] A's station from which bodies on A and B can touch. -VG_HUGE:
                      ///< anywhere (same bundle, or joined by successors); merging lanes: where
                      ///< they stay close to their end, +VG_HUGE if not before A's end
    uint8_t kind;     ///< vg_relation_kind
} vg_relation;

typedef enum vg_relation_kind {
    VG_UNRELATED = 0,  ///< vehicles on them are never leader or follower of each other
    VG_SAME_BUNDLE,
    VG_DOWNSTREAM,     ///< B is reached from A's bundle by successors
    VG_UPSTREAM,       ///< the reverse
    VG_MERGING,        ///< both lead to a common lane downstream
    VG_DIVERGED,       ///< both come from a common lane and still run through the same area; only
                       ///< while a road is built, else such lanes are unrelated
} vg_relation_kind;

/// A lane that leads to the same lane downstream as this one and comes close to it before: the
/// relation of two vehicles on them.
typedef struct vg_merge {
    uint16_t other;                  ///< lane index
    float    cost;                   ///< [m] distance to the common lane, the longer one of both
    float    offset, lateral, touch; ///< [m] see vg_relation
} vg_merge;

/// Stretches of two lanes, not related above, where bodies of up to 2.6 m could touch: a crossing,
/// a roundabout entry that no successor describes, the begin of lanes that part. Stored for both.
typedef struct vg_conflict {
    uint16_t other;                ///< lane index
    float    from, to;             ///< [m] stretch of the lane, in its stations
    float    other_from, other_to; ///< [m] stretch of `other`, in its stations
    bool     parts;                ///< both come from one lane and have not parted yet here: a
                                   ///< vehicle on one follows a vehicle on the other
} vg_conflict;

/// Some metres of one lane, for looking up what is near a point.
typedef struct vg_chunk {
    float    x0, y0, x1, y1;       ///< [m] box around its knots
    uint16_t lane;
    uint16_t index;                ///< within its lane
} vg_chunk;
enum { VG_CHUNK_KNOTS = 24 };      ///< intervals of a chunk

/// Square cells over the road, each with the chunks that bodies in it could be on.
typedef struct vg_grid {
    double    x, y, cell;          ///< [m] corner of the first cell, side of a cell
    uint32_t  columns, rows;
    uint32_t* from;                ///< [columns * rows + 1] a cell's part of `chunk_of` begins here
    uint32_t* chunk_of;            ///< ascending within each part
    vg_chunk* chunks;              ///< ordered by lane
    uint32_t  chunk_count, total;  ///< chunks; how often cells name one
} vg_grid;

/// The route from a lane to a target lane, packed into a byte.
typedef uint8_t vg_way;
enum {
    VG_WAY_CHANGES = 7,      ///< lane changes needed, at most 6 are counted; 7: it cannot get there
    VG_WAY_TURN_SHIFT = 3,   ///< next lane change: 0 none here, 1 left, 2 right
    VG_WAY_NEXT_SHIFT = 5,   ///< which of its successors continues the lane
};
static_assert(VERGE_SUCCESSORS_MAX <= 8, "a route has three bits for the successor");

/// Lists of lanes, all in one array: the part of lane i is of[from[i]] .. of[from[i + 1] - 1].
struct verge_road {
    uint32_t lane_count;
    uint64_t fingerprint;          ///< of what is built: distinguishes roads in the same memory
    vg_lane* lanes;
    uint16_t* by_id;               ///< [lane_count] lane indices in the order of their ids
    uint32_t* predecessors_from;   ///< [lane_count + 1]
    uint16_t* predecessors;        ///< lane indices, ascending within each part
    uint32_t* bundles_from;        ///< [bundles + 1] by bundle
    uint16_t* bundle_lanes;        ///< [lane_count] ascending within each part
    uint32_t* merges_from;         ///< [lane_count + 1]
    vg_merge* merges;              ///< ascending by other within each part
    uint32_t* conflicts_from;      ///< [lane_count + 1]
    vg_conflict* conflicts;        ///< ascending by other within each part
    uint32_t merge_capacity, conflict_capacity;
    bool     has_successors;       ///< some lane has
    vg_way*  ways;                 ///< [target][lane]
    vg_grid  grid;
};

enum { VG_NEVER = 255 };

/// Builds a road in the arena. scratch is used and emptied. The def must have passed
/// verge_road_check(). A measuring arena (see arena.h) gets exactly the size, at no cost: nothing
/// is fitted, scratch is not looked at, the result is null. Null also where memory does not fit.
struct verge_road* vg_road_build(vg_arena* arena, vg_arena* scratch, const verge_road_def* def);
/// Is the road consistent in itself? Every number is finite, stations and bins rise, what refers to
/// lanes refers to lanes that exist, lists are in order, both sides of a relation agree. For tests,
/// and asserted of every road that is built. Linear in the road.
bool vg_road_holds(const struct verge_road* road);
/// Bytes of scratch vg_road_build() needs.
size_t vg_road_scratch_size(const verge_road_def* def);

int32_t vg_road_lane_index(const struct verge_road* road, int32_t lane_id); ///< -1 unknown

/// Is `lane` the lane `first`, or one that continues it by successors?
bool vg_road_continues(const struct verge_road* road, uint32_t first, uint32_t lane);

/// The lanes that a body at (x, y) could be on, one after the other in the order of the lanes:
/// start with vg_road_nearby(), then ask for the next one, -1 no more.
typedef struct vg_nearby {
    const struct verge_road* road;
    double   x, y;
    uint32_t at, end; ///< of grid.chunk_of
    int32_t  lane;    ///< the last one
    double   s;       ///< [m] where on it, roughly
} vg_nearby;
vg_nearby vg_road_nearby(const struct verge_road* road, double x, double y);
int32_t   vg_nearby_next(vg_nearby* nearby);
/// The position of (x, y) on that lane. If the lane comes by twice: where it runs along `heading`.
verge_lane_position vg_nearby_position(const vg_nearby* nearby, double heading);

static inline uint32_t vg_lane_predecessor_count(const struct verge_road* road, uint32_t lane)
{
    VERGE_ASSERT(lane < road->lane_count);
    return road->predecessors_from[lane + 1] - road->predecessors_from[lane];
}
/// The k-th lane that `lane` continues.
static inline int32_t vg_lane_predecessor(const struct verge_road* road, uint32_t lane, uint32_t k)
{
    VERGE_ASSERT(k < vg_lane_predecessor_count(road, lane));
    return road->predecessors[road->predecessors_from[lane] + k];
}

/// The lane before `lane` that leads straightest to its start, -1 none.
int32_t vg_lane_before(const struct verge_road* road, uint32_t lane);

/// Does the lane run through an area shared with a lane that is not related to it?
static inline bool vg_road_has_conflicts(const struct verge_road* road, uint32_t lane)
{
    VERGE_ASSERT(lane < road->lane_count);
    return road->conflicts_from[lane] != road->conflicts_from[lane + 1];
}

static inline vg_way vg_road_way(const struct verge_road* road, uint32_t lane, uint32_t target)
{
    VERGE_ASSERT(lane < road->lane_count && target < road->lane_count);
    return road->ways[target * road->lane_count + lane];
}
/// Lane changes needed from `lane` to reach the lane `target`; VG_NEVER: it cannot be reached.
static inline uint32_t vg_road_changes(const struct verge_road* road, uint32_t lane,
                                       uint32_t target)
{
    const uint32_t changes = vg_road_way(road, lane, target) & VG_WAY_CHANGES;
    return changes == VG_WAY_CHANGES ? VG_NEVER : changes;
}
/// Next lane change towards the lane `target`: +1 left, -1 right, 0 none here.
static inline int32_t vg_road_turn(const struct verge_road* road, uint32_t lane, uint32_t target)
{
    const uint32_t turn = vg_road_way(road, lane, target) >> VG_WAY_TURN_SHIFT & 3u;
    return turn == 2 ? -1 : (int32_t)turn;
}
/// The lane that continues `lane` towards `target` (lane index, -1 none); -1: the lane ends.
static inline int32_t vg_road_next(const struct verge_road* road, uint32_t lane, int32_t target)
{
    VERGE_ASSERT(lane < road->lane_count);
    VERGE_ASSERT(target < (int32_t)road->lane_count);
    const vg_lane* from = &road->lanes[lane];
    if (from->successor_count == 0) {
        return -1;
    }
    return target < 0
               ? from->successors[0]
               : from->successors[vg_road_way(road, lane, (uint32_t)target) >> VG_WAY_NEXT_SHIFT];
}

/// The lanes a vehicle drives over, one after the other: start with its lane and target, then ask
/// for the next one, at most VG_WALK_LANES times.
typedef struct vg_walk {
    const struct verge_road* road;
    int32_t  target; ///< lane index, -1 none
    uint32_t lane;   ///< index
    uint32_t passed; ///< lane ends passed
} vg_walk;
enum { VG_WALK_LANES = 8 };

static inline vg_walk vg_walk_from(const struct verge_road* road, uint32_t lane, int32_t target)
{
    VERGE_ASSERT(lane < road->lane_count);
    return (vg_walk){ road, target, lane, 0 };
}
/// Advances to the lane that continues this one. False: there is none, or the walk is at its end.
static inline bool vg_walk_on(vg_walk* walk)
{
    const int32_t next = vg_road_next(walk->road, walk->lane, walk->target);
    if (next < 0 || walk->passed == VG_WALK_LANES) {
        return false;
    }
    walk->lane = (uint32_t)next;
    walk->passed++;
    return true;
}
/// Moves s [m] from `lane` on to the lane that contains it, where lanes continue; returns the lane.
static inline uint32_t vg_road_follow(const struct verge_road* road, uint32_t lane, int32_t target,
                                      double* s)
{
    vg_walk walk = vg_walk_from(road, lane, target);
    for (double length = road->lanes[lane].length; *s > length && vg_walk_on(&walk);
         length = road->lanes[walk.lane].length) {
        *s -= length;
    }
    return walk.lane;
}

/// The reference line of a lane at s; straight beyond its ends.
static inline vg_reference vg_lane_at(const vg_lane* lane, double s)
{
    return vg_line_at(&lane->line, s);
}
static inline double vg_lane_project(const vg_lane* lane, double x, double y, double s_guess)
{
    return vg_line_project(&lane->line, x, y, s_guess);
}
/// The same, with a search of the whole lane; faster if s_hint is near the result.
static inline double vg_lane_project_whole(const vg_lane* lane, double x, double y, double s_hint)
{
    return vg_line_project_whole(&lane->line, x, y, s_hint);
}

/// The road at s of `lane`, which may lie on a lane that continues it towards `target`.
static inline vg_reference vg_road_at(const struct verge_road* road, uint32_t lane, int32_t target,
                                      double s)
{
    const uint32_t on = vg_road_follow(road, lane, target, &s);
    return vg_lane_at(&road->lanes[on], s);
}

/// Station <-> arc length of one lane; linear beyond the ends.
double vg_lane_station(const vg_lane* lane, double s);
double vg_lane_s(const vg_lane* lane, double station);

#ifdef __cplusplus
}
#endif

#endif
