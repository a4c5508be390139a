/// A road: any graph of lanes, as surveyed.
///
/// The caller describes lanes by polylines. The planner fits a smooth reference line to each, with
/// continuous heading and curvature:
///
/// - Within 0.15 m of the chords between the surveyed points, or 0.3 m at single points. Points
///   that evidently lie on a circle are joined by its arc, where it leaves the chord by less.
/// - Its curvature is at most 1.25 / R + 0.01 1/m. R is what the survey supports at a point: the
///   smaller one of (c/2) / tan(a/2) for a turn of a between chords of length c, and of the radius
///   0.3 / (1/cos(a/2) - 1) that passes the point within the tolerance.
/// - A sharper corner, which that radius would make a crawl, is cut inside the lane: so far that a
///   body 2 m wide keeps 0.3 m from the edges, up to a radius of 8 m.
/// - Lanes that follow one another meet in position and direction. A lane that meets others at an
///   angle turns into their direction near its end.
///
/// verge_road_deviation() returns the deviation. The planner also finds where neighbours run side
/// by side, which lanes meet downstream, and where lanes that are not neighbours run through the
/// same area.
///
/// Lifetime    A call that takes a def reads it, and all that it points to, only until it returns.
#ifndef VERGE_ROAD_H
#define VERGE_ROAD_H

#include "verge/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A stretch [s0, s1] of a lane. [m]
typedef struct verge_stretch {
    double s0, s1;
} verge_stretch;

/// Who goes first where a lane conflicts with others: in crossings, and where lanes merge.
typedef enum verge_priority {
    VERGE_PRIORITY_NONE = 0,              ///< no rule: who comes first goes first
    VERGE_PRIORITY_MAJOR = 1,             ///< goes first
    VERGE_PRIORITY_MINOR = 2,             ///< yields to the major lane
    VERGE_PRIORITY_STOP = 3,              ///< stops at the stop line, then yields to the major lane
    VERGE_PRIORITY_RIGHT_BEFORE_LEFT = 4, ///< yields to who comes from the right
} verge_priority;
enum { VERGE_PRIORITY_COUNT = 5 };

/// "none", "major", "minor", "stop" or "right-before-left"; "??" for another value.
const char* verge_priority_name(verge_priority priority);

/// One lane. Start from verge_lane_def_default(): in a struct filled with zeros `left` and `right`
/// name lane 0, which verge_road_check() refuses.
typedef struct verge_lane_def {
    int32_t id;                     ///< >= 0, unique
    const double (*points)[2];      ///< [m] x, y in travel direction; no turn beyond 150 degrees
    uint32_t point_count;           ///< 2 .. VERGE_LANE_POINTS_MAX
    double   width;                 ///< [m] 1.5 .. 20
    double   speed_limit;           ///< [m/s] 0.5 .. 60
    int32_t  left, right;           ///< lane id of the same-direction neighbour, or VERGE_NO_LANE
    int32_t  successors[VERGE_SUCCESSORS_MAX]; ///< start within 20 m and 90 degrees of this end
    uint32_t successor_count;
    bool     change_left_given, change_right_given; ///< false: allowed all along the neighbour
    /// Not empty, apart from one another; none where there is no neighbour.
    verge_stretch change_left[VERGE_STRETCHES_MAX], change_right[VERGE_STRETCHES_MAX];
    uint32_t change_left_count, change_right_count;
    verge_priority priority;        ///< holds from this lane into the conflicts at and beyond its
                                    ///< end
    bool     stop_line_given;       ///< false: the stop line is the end of the lane
    double   stop_line;             ///< [m] along the lane, where the front of a body waits
} verge_lane_def;

/// A lane of 3.5 m and 13.9 m/s without points, neighbours and successors.
verge_lane_def verge_lane_def_default(void);

typedef struct verge_road_def {
    const verge_lane_def* lanes;
    uint32_t lane_count;            ///< 1 .. VERGE_LANES_MAX
} verge_road_def;

/// What is wrong with a road: which lane (index), which field, in words.
typedef struct verge_road_fault {
    uint32_t    lane_index;
    const char* field;  ///< "centerline", "width", "left", "successors", ...; null: no fault
    const char* text;   ///< what is wrong and what was expected
} verge_road_fault;

/// Checks everything verge_planner_init() would refuse a road for. fault may be null.
/// @retval VERGE_OK        the road can be built; fault->field is null
/// @retval VERGE_ERR_ROAD  fault states the first defect, in lane order
verge_status verge_road_check(const verge_road_def* def, verge_road_fault* fault);

/// A built road. It lives in the memory it was built in: that of its planner
/// (verge_planner_road()), or the caller's (verge_road_init()).
typedef struct verge_road verge_road;

/// Bytes verge_road_init() needs; 0 if the road is refused. The road keeps *road_size (may be null)
/// of them; the rest is free again after verge_road_init(). Cheap: nothing is fitted.
size_t verge_road_memory_size(const verge_road_def* def, size_t* road_size);
/// Builds a road in the caller's memory, aligned to 64 bytes. Any number of stages and threads may
/// read it.
/// @retval VERGE_ERR_ROAD, VERGE_ERR_MEMORY  *road is null
verge_status verge_road_init(const verge_road** road, const verge_road_def* def, void* memory,
                             size_t size);

/// Which lane a body is on: the lane that contains (x, y) and whose direction fits the heading
/// best; outside all lanes the nearest within 2 m of an edge, else lane_id = VERGE_NO_LANE.
/// prefer_lane: a lane id to take when several contain the point (or VERGE_NO_LANE).
/// VERGE_NO_LANE also where x, y or heading is not finite.
verge_lane_position verge_road_project(const verge_road* road, double x, double y, double heading,
                                       int32_t prefer_lane);

/// The same on one given lane, wherever the point is (s may be < 0 or beyond the lane's length).
/// lane_id is VERGE_NO_LANE where the lane is unknown or x or y is not finite.
verge_lane_position verge_road_project_on(const verge_road* road, int32_t lane_id, double x,
                                          double y);

/// Position and direction of (s, d) on a lane: Eq. 6 for a body that moves along the lane.
/// x, y and heading may be null. False: no such lane, or s or d is not finite; nothing is written.
bool verge_road_at(const verge_road* road, int32_t lane_id, double s, double d,
                   double* x, double* y, double* heading);

/// What is odd about a lane that can be built.
typedef struct verge_lane_warning {
    const char* field;      ///< "centerline", "left", "right" or "successors"
    const char* text;       ///< what is odd; where it has a number, the text names its unit
    double      value;      ///< that number, else 0
    int32_t     other_lane; ///< id of the other lane that it is about, or VERGE_NO_LANE
} verge_lane_warning;
enum { VERGE_LANE_WARNINGS_MAX = 8 };

/// What a lane is like to drive, and what is odd about its survey.
typedef struct verge_lane_report {
    int32_t  lane_id;
    double   deviation;     ///< [m] as verge_road_deviation()
    double   radius_min;    ///< [m] of the sharpest bend of the line; at most 1e6, a straight line
    double   radius_s;      ///< [m] where along the line that is
    double   speed_min;     ///< [m/s] lowest speed that speed limits and bends allow on the lane
    verge_lane_warning warnings[VERGE_LANE_WARNINGS_MAX]; ///< the first ones, by field
    uint32_t warning_count; ///< of them
} verge_lane_report;

/// Reports one lane of a built road; def is what it was built from. Warns of: a survey too sparse
/// for its bend, a corner cut inside the lane, a lane that crosses itself; a neighbour that does
/// not name this lane, runs in the other direction, lies on the other side, or is nowhere beside
/// it; a successor that begins at an angle above 10 degrees or more than 0.5 m away. Whether a
/// body can drive the sharpest bend: compare radius_min with verge_body_radius_min(). Takes time
/// proportional to the square of the lane's points.
/// @retval VERGE_ERR_ARGUMENT  null pointer, no such lane, or not the def of this road
verge_status verge_road_report(const verge_road* road, const verge_road_def* def,
                               uint32_t lane_index, verge_lane_report* report);

// Of an unknown lane these are 0, VERGE_NO_LANE or false. In all functions `road` is not null.
double  verge_road_length(const verge_road* road, int32_t lane_id);      ///< [m] reference line
double  verge_road_width(const verge_road* road, int32_t lane_id);       ///< [m]
double  verge_road_speed_limit(const verge_road* road, int32_t lane_id); ///< [m/s]
verge_priority verge_road_priority(const verge_road* road, int32_t lane_id);
double  verge_road_stop_line(const verge_road* road, int32_t lane_id);   ///< [m] along the line
/// [m] distance of the surveyed point that lies furthest from the lane's reference line. Surveys
/// that no vehicle can follow, or that are noisy, deviate more than the tolerances above.
double  verge_road_deviation(const verge_road* road, int32_t lane_id);
/// The lane that continues lane_id towards target_lane (first successor if there is none
/// better), or VERGE_NO_LANE where nothing continues it.
int32_t verge_road_next(const verge_road* road, int32_t lane_id, int32_t target_lane);
/// The lane beside lane_id to the left or right to which vehicles may change, or VERGE_NO_LANE.
int32_t verge_road_left(const verge_road* road, int32_t lane_id);
int32_t verge_road_right(const verge_road* road, int32_t lane_id);
/// Is lane_id the target lane, or a lane that continues it (by successors only)?
bool    verge_road_continues(const verge_road* road, int32_t target_lane, int32_t lane_id);

#ifdef __cplusplus
}
#endif

#endif
