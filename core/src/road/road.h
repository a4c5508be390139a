/// The built road: what the public road.h promises, as core sees it.
///
/// Lanes are addressed by index (their order in the def). Beside its own arc length s each lane
/// has a *station*: lanes that are neighbours of one another, directly or through others, form a
/// bundle, and share one station axis and one lateral axis: two vehicles of a bundle are side by
/// side when their stations are equal, and y = lateral[lane](station) + d compares them laterally
/// whichever lane each is on. That makes leader and follower a subtraction in the search.
/// Bundles that are joined by successors are related by an offset (vg_relation).
#ifndef VG_ROAD_INTERNAL_H
#define VG_ROAD_INTERNAL_H

#include "base/arena.h"
#include "geometry/line.h"
#include "verge/road.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Spacing of a lane's reference knots is close to this; exactly length / (knot_count - 1). [m]
#define VG_KNOT_SPACING 1.0
/// Spacing of the station bins. [m]
#define VG_BIN 4.0

/// What a lane is like around one station, sampled every VG_BIN metres of station from
/// lane->station_start on; between bins linear.
typedef struct vg_bin {
    float s;          ///< [m] arc length of the lane at this station
    float lateral;    ///< [m] y of the lane's centre on the bundle's lateral axis
    float left_gap;   ///< [m] > 0 to the left neighbour's centre; 0: no change to the left here
    float right_gap;  ///< [m] > 0 to the right neighbour's centre; 0: no change to the right here
    float speed;      ///< [m/s] to drive here: the limit, less in bends and before them
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
    bool     dead_end;             ///< nothing continues it though a neighbour goes on for >= 20 m:
                                   ///< whoever is on it must leave it or stop before its end
    uint32_t bundle;
    double   station_start, station_end; ///< [m] station at s = 0 and at s = length
    uint32_t bin_count;            ///< covers station_start .. station_end
    const vg_bin* bins;
} vg_lane;

/// How a vehicle on lane B appears to one on lane A (row A, column B).
/// Its station as A sees it is station_B + offset, its lateral position y_B + lateral.
typedef struct vg_relation {
    float   offset;   ///< [m] add to B's station
    float   lateral;  ///< [m] add to B's y
    float   period;   ///< [m] > 0: A and B lie on one ring of this length; wrap differences into
                      ///< +-period/2
    float   touch;    ///< [m] A's station from which bodies on A and B can touch. -VG_HUGE: anywhere
                      ///< (same bundle, or joined by successors); merging lanes: where they come
                      ///< close for good, +VG_HUGE if not before A's end. Diverged lanes: A's
                      ///< station *until* which they can touch
    uint8_t kind;     ///< vg_relation_kind
} vg_relation;

typedef enum vg_relation_kind {
    VG_UNRELATED = 0,  ///< they never see each other as leader or follower
    VG_SAME_BUNDLE,
    VG_DOWNSTREAM,     ///< B is reached from A's bundle by successors
    VG_UPSTREAM,       ///< the reverse
    VG_MERGING,        ///< both lead to a common lane downstream
    VG_DIVERGED,       ///< both come from a common lane and still run through the same area
} vg_relation_kind;

/// Stretches of two lanes, not related above, where bodies of up to 2.6 m could touch
/// (a crossing, a roundabout entry that no successor describes). Stored for both orders.
typedef struct vg_conflict {
    uint32_t lane, other;          ///< lane indices
    float    from, to;             ///< [m] stretch of `lane`, in its stations
    float    other_from, other_to; ///< [m] stretch of `other`, in its stations
} vg_conflict;

struct verge_road {
    uint32_t lane_count;
    vg_lane* lanes;
    uint16_t* by_id;               ///< [lane_count] lane indices in the order of their ids
    uint32_t* predecessors_from;   ///< [lane_count + 1] a lane's part of predecessors begins here
    uint16_t* predecessors;        ///< lane indices, ascending within each part
    vg_relation* relations;        ///< [lane_count][lane_count]
    uint64_t* on_route;            ///< [lane][target + 1]: lanes (bits) that a vehicle on `lane` that
                                   ///< wants to `target` (index, -1 none) has to look at as leaders
                                   ///< or followers: related lanes less the branches it will not
                                   ///< take and less those that have parted from its lane
    uint8_t* changes;              ///< [lane][target]: lane changes needed to reach target; 255: never
    int8_t*  move;                 ///< [lane][target]: +1 change left is the way, -1 right, 0 drive on
    int32_t* next;                 ///< [lane][target + 1]: lane index that continues lane, -1 none
    uint64_t* continues;           ///< [target]: lanes (bits) that are target or continue it
    uint32_t conflict_count;
    vg_conflict* conflicts;        ///< ordered by lane
    uint64_t conflict_lanes;       ///< lanes (bits) that have any
};

enum { VG_NEVER = 255 };

/// Builds a road in the arena. scratch is used and emptied. The def must have passed
/// verge_road_check(). A measuring arena (see arena.h) gets exactly the size, at no cost: nothing
/// is fitted, scratch is not looked at, the result is null.
/// Null also where memory does not fit, or the road has more than VERGE_CONFLICTS_MAX conflicts.
struct verge_road* vg_road_build(vg_arena* arena, vg_arena* scratch, const verge_road_def* def);
/// Bytes of scratch vg_road_build() needs.
size_t vg_road_scratch_size(const verge_road_def* def);

int32_t vg_road_lane_index(const struct verge_road* road, int32_t lane_id); ///< -1 unknown

static inline uint32_t vg_lane_predecessor_count(const struct verge_road* road, uint32_t lane)
{
    return road->predecessors_from[lane + 1] - road->predecessors_from[lane];
}
/// The k-th lane that `lane` continues.
static inline int32_t vg_lane_predecessor(const struct verge_road* road, uint32_t lane, uint32_t k)
{
    return road->predecessors[road->predecessors_from[lane] + k];
}

/// The lane before `lane` whose end fits its start best, -1 none.
int32_t vg_lane_before(const struct verge_road* road, uint32_t lane);

/// How a vehicle on lane b appears to one on lane a.
static inline const vg_relation* vg_road_relation(const struct verge_road* road, uint32_t a, uint32_t b)
{
    return &road->relations[a * road->lane_count + b];
}
/// Has a vehicle on `lane` with this target (lane index, -1 none) to look at those on `other`?
static inline bool vg_road_matters(const struct verge_road* road, uint32_t lane, int32_t target,
                                   uint32_t other)
{
    return (road->on_route[lane * (road->lane_count + 1u) + (uint32_t)(target + 1)] >> other & 1u) != 0;
}
/// Lane changes needed from `lane` to reach the lane `target`; VG_NEVER: it cannot be reached.
static inline uint32_t vg_road_changes(const struct verge_road* road, uint32_t lane, uint32_t target)
{
    return road->changes[lane * road->lane_count + target];
}
/// Next lane change towards the lane `target`: +1 left, -1 right, 0 none here.
static inline int32_t vg_road_turn(const struct verge_road* road, uint32_t lane, uint32_t target)
{
    return road->move[lane * road->lane_count + target];
}
/// The lane that continues `lane` towards `target` (lane index, -1 none); -1: the lane ends.
static inline int32_t vg_road_next(const struct verge_road* road, uint32_t lane, int32_t target)
{
    return road->next[lane * (road->lane_count + 1u) + (uint32_t)(target + 1)];
}
/// Is `lane` the lane `first`, or one that continues it by successors?
static inline bool vg_road_continues(const struct verge_road* road, uint32_t first, uint32_t lane)
{
    return (road->continues[first] >> lane & 1u) != 0;
}
/// Does the lane run through an area shared with a lane that is not related to it?
static inline bool vg_road_has_conflicts(const struct verge_road* road, uint32_t lane)
{
    return (road->conflict_lanes >> lane & 1u) != 0;
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
    return (vg_walk){ road, target, lane, 0 };
}
/// On to the lane that continues this one. False: none does, or the walk is at its end.
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
static inline uint32_t vg_road_follow(const struct verge_road* road, uint32_t lane, int32_t target, double* s)
{
    vg_walk walk = vg_walk_from(road, lane, target);
    for (double length = road->lanes[lane].length; *s > length && vg_walk_on(&walk);
         length = road->lanes[walk.lane].length) {
        *s -= length;
    }
    return walk.lane;
}

static inline vg_reference vg_lane_at(const vg_lane* lane, double s) ///< straight on beyond the ends
{
    return vg_line_at(&lane->line, s);
}
static inline double vg_lane_project(const vg_lane* lane, double x, double y, double s_guess)
{
    return vg_line_project(&lane->line, x, y, s_guess);
}

/// Over the whole lane, as with s_guess NaN; faster the nearer the hint.
static inline double vg_lane_project_whole(const vg_lane* lane, double x, double y, double s_hint)
{
    return vg_line_project_whole(&lane->line, x, y, s_hint);
}

/// The road at s of `lane`, which may lie on a lane that continues it towards `target`.
static inline vg_reference vg_road_at(const struct verge_road* road, uint32_t lane, int32_t target, double s)
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
