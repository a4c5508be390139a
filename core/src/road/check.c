/// Checks the definition of a road, before anything is built from it.
#include "road/build.h"

#include "base/scalar.h"
#include "verge/limits.h"

/// A road under check.
typedef struct checked {
    const verge_road_def* def;
    uint16_t by_id[VERGE_LANES_MAX];
} checked;

static const char* check_names(const checked* road, uint32_t* index);
static const char* check_lane(const checked* road, uint32_t index, const char** field);
static const char* check_centerline(const verge_lane_def* lane);
static bool doubles_back(const verge_lane_def* lane);
static const char* check_neighbour(const checked* road, uint32_t index, int32_t id);
static bool turns_round(const verge_lane_def* lane, const verge_lane_def* next);
static const char* check_successors(const checked* road, const verge_lane_def* lane);
static const char* check_changes(const verge_lane_def* lane, int32_t neighbour,
                                 const verge_stretch* stretches, uint32_t count);
static const char* check_stretches(const verge_lane_def* lane, const verge_stretch* stretches,
                                   uint32_t count);
static const char* check_priority(const verge_lane_def* lane, const char** field);
static const verge_lane_def* find(const checked* road, int32_t id);

#define TEXT_OF(number) TEXT_OF_EXPANDED(number)
#define TEXT_OF_EXPANDED(number) #number
/// Beyond this the precision of squared coordinates is worse than millimetres. [m]
static const double coordinate_max = VERGE_LIMIT_POSITION;
/// Smallest distance of the points between which a direction is measured. The noise of a survey,
/// one or two decimetres, would dominate over shorter distances. [m]
static const double direction_length = 0.5;
/// Cosine of the sharpest turn of a centreline at a point, 150 degrees. Coarse surveys have corners
/// of 90 degrees and more; beyond 150 degrees the lane leads back over itself.
static const double turn_cosine_min = -0.86602540378443865;
/// Cosine of the sharpest turn into a successor, 90 degrees and a tolerance for rounding. A larger
/// turn means that one of the lanes is drawn in reverse.
static const double successor_cosine_min = -1e-6;

static verge_status refuse(verge_road_fault* fault, uint32_t lane_index, const char* field,
                           const char* text)
{
    *fault = (verge_road_fault){ .lane_index = lane_index, .field = field, .text = text };
    return VERGE_ERR_ROAD;
}

verge_status verge_road_check(const verge_road_def* def, verge_road_fault* fault)
{
    verge_road_fault ignored;
    fault = fault != NULL ? fault : &ignored;
    *fault = (verge_road_fault){ .lane_index = 0 };
    if (def == NULL || def->lanes == NULL || def->lane_count == 0) {
        return refuse(fault, 0, "lanes", "a road has at least one lane");
    }
    if (def->lane_count > VERGE_LANES_MAX) {
        return refuse(fault, VERGE_LANES_MAX, "lanes", "more lanes than the capacity of "
                      TEXT_OF(VERGE_LANES_MAX) " (VERGE_LANES_MAX)");
    }
    checked road = { .def = def };
    vg_lanes_sort(def, road.by_id);
    uint32_t index = 0;
    const char* field = "id";
    const char* text = check_names(&road, &index); // first: references need valid ids
    for (uint32_t i = 0; text == NULL && i < def->lane_count; ++i) {
        index = i;
        text = check_lane(&road, i, &field);
    }
    if (text != NULL) {
        return refuse(fault, index, field, text);
    }
    const vg_meetings meetings = vg_road_meetings(def, NULL);
    return meetings.crowded < 0 ? VERGE_OK
                                : refuse(fault, (uint32_t)meetings.crowded, "centerline",
                                         "meets other lanes at more places than the capacity of "
                                         TEXT_OF(VERGE_CONFLICTS_MAX)
                                         " a lane (VERGE_CONFLICTS_MAX)");
}

static const char* check_names(const checked* road, uint32_t* index)
{
    for (*index = 0; *index < road->def->lane_count; ++*index) {
        const verge_lane_def* lane = &road->def->lanes[*index];
        if (lane->id < 0) {
            return "a lane id is 0 or more";
        }
        if (find(road, lane->id) != lane) {
            return "an earlier lane has the same id; ids are unique";
        }
    }
    return NULL;
}

static const char* check_lane(const checked* road, uint32_t index, const char** field)
{
    const verge_lane_def* lane = &road->def->lanes[index];
    *field = "centerline";
    const char* text = check_centerline(lane);
    if (text != NULL) {
        return text;
    }
    *field = "width";
    if (!(lane->width >= 1.5 && lane->width <= 20.0)) {
        return "a lane is 1.5 to 20 m wide";
    }
    *field = "speed_limit";
    if (!(lane->speed_limit >= 0.5 && lane->speed_limit <= 60.0)) {
        return "a speed limit is 0.5 to 60 m/s";
    }
    *field = "left";
    text = check_neighbour(road, index, lane->left);
    if (text != NULL) {
        return text;
    }
    *field = "right";
    text = check_neighbour(road, index, lane->right);
    if (text == NULL && lane->right != VERGE_NO_LANE && lane->right == lane->left) {
        text = "one lane cannot be on the left and on the right; VERGE_NO_LANE (-1) where there is "
               "none";
    }
    if (text != NULL) {
        return text;
    }
    *field = "successors";
    text = check_successors(road, lane);
    if (text == NULL && lane->change_left_given) {
        *field = "change_left";
        text = check_changes(lane, lane->left, lane->change_left, lane->change_left_count);
    }
    if (text == NULL && lane->change_right_given) {
        *field = "change_right";
        text = check_changes(lane, lane->right, lane->change_right, lane->change_right_count);
    }
    return text != NULL ? text : check_priority(lane, field);
}

static const char* check_priority(const verge_lane_def* lane, const char** field)
{
    *field = "priority";
    if ((unsigned)lane->priority >= VERGE_PRIORITY_COUNT) {
        return "a priority is none, major, minor, stop or right-before-left";
    }
    *field = "stop_line";
    if (lane->stop_line_given
        && !(lane->stop_line >= 0.0 && lane->stop_line <= vg_survey_length(lane) + 1e-3)) {
        return "a stop line lies on the lane, 0 to its length [m]";
    }
    return NULL;
}

static const char* check_centerline(const verge_lane_def* lane)
{
    if (lane->points == NULL || lane->point_count < 2) {
        return "a centreline has two points or more";
    }
    if (lane->point_count > VERGE_LANE_POINTS_MAX) {
        return "more points than the capacity of " TEXT_OF(VERGE_LANE_POINTS_MAX)
               " a lane (VERGE_LANE_POINTS_MAX)";
    }
    for (uint32_t i = 0; i < lane->point_count; ++i) {
        for (int axis = 0; axis < 2; ++axis) {
            const double value = lane->points[i][axis];
            if (!vg_finite(value)) {
                return "every coordinate is a finite number";
            }
            if (vg_abs(value) > coordinate_max) {
                return "coordinates lie within 10,000 km of the origin";
            }
        }
    }
    const double length = vg_survey_length(lane);
    if (!(length >= 0.5)) {
        return "a lane is at least 0.5 m long; these points (nearly) coincide";
    }
    if (length > VERGE_LANE_LENGTH_MAX) {
        return "longer than the capacity of " TEXT_OF(VERGE_LANE_LENGTH_MAX)
               " m a lane (VERGE_LANE_LENGTH_MAX)";
    }
    if (doubles_back(lane)) {
        return "doubles back by more than 150 degrees; points are in travel direction";
    }
    return NULL;
}

typedef struct direction {
    double x, y, length; ///< [m]
} direction;

static direction direction_between(const double from[2], const double to[2])
{
    const double x = to[0] - from[0], y = to[1] - from[1];
    return (direction){ x, y, vg_sqrt(x * x + y * y) };
}

static bool turns_beyond(direction before, direction after, double cosine_min)
{
    return before.x * after.x + before.y * after.y < cosine_min * before.length * after.length;
}

static bool doubles_back(const verge_lane_def* lane)
{
    direction before = { 0.0, 0.0, 0.0 };
    uint32_t  from = 0;
    for (uint32_t i = 1; i < lane->point_count; ++i) {
        const direction here = direction_between(lane->points[from], lane->points[i]);
        if (here.length < direction_length) {
            continue;
        }
        if (turns_beyond(before, here, turn_cosine_min)) {
            return true;
        }
        before = here;
        from = i;
    }
    return false;
}

/// The direction a lane begins with.
static direction direction_at_start(const verge_lane_def* lane)
{
    direction here = { 0.0, 0.0, 0.0 };
    for (uint32_t i = 1; i < lane->point_count && here.length < direction_length; ++i) {
        here = direction_between(lane->points[0], lane->points[i]);
    }
    return here;
}

/// The direction a lane ends with.
static direction direction_at_end(const verge_lane_def* lane)
{
    const double* end = lane->points[lane->point_count - 1];
    direction     here = { 0.0, 0.0, 0.0 };
    for (uint32_t i = lane->point_count - 1; i > 0 && here.length < direction_length; --i) {
        here = direction_between(lane->points[i - 1], end);
    }
    return here;
}

static const char* check_neighbour(const checked* road, uint32_t index, int32_t id)
{
    if (id == VERGE_NO_LANE) {
        return NULL;
    }
    if (id == road->def->lanes[index].id) {
        return "a lane is not its own neighbour; VERGE_NO_LANE (-1) where there is none";
    }
    return find(road, id) == NULL ? "names a lane that does not exist" : NULL;
}

/// Does the road turn by more than 90 degrees from lane to next?
static bool turns_round(const verge_lane_def* lane, const verge_lane_def* next)
{
    return turns_beyond(direction_at_end(lane), direction_at_start(next), successor_cosine_min);
}

static const char* check_successors(const checked* road, const verge_lane_def* lane)
{
    if (lane->successor_count > VERGE_SUCCESSORS_MAX) {
        return "more successors than the capacity of " TEXT_OF(VERGE_SUCCESSORS_MAX)
               " (VERGE_SUCCESSORS_MAX)";
    }
    const double* end = lane->points[lane->point_count - 1];
    for (uint32_t i = 0; i < lane->successor_count; ++i) {
        const verge_lane_def* next = find(road, lane->successors[i]);
        if (next == NULL) {
            return "names a lane that does not exist";
        }
        for (uint32_t k = 0; k < i; ++k) {
            if (lane->successors[k] == lane->successors[i]) {
                return "names a lane twice";
            }
        }
        if (next->points == NULL || next->point_count < 1) {
            continue; // reported by the check of that lane
        }
        const double dx = next->points[0][0] - end[0];
        const double dy = next->points[0][1] - end[1];
        if (dx * dx + dy * dy > VG_GAP_MAX * VG_GAP_MAX) {
            return "a successor starts within 20 m of this lane's end";
        }
        if (check_centerline(next) == NULL && turns_round(lane, next)) {
            return "a successor starts within 90 degrees of the direction this lane ends in";
        }
    }
    return NULL;
}

/// Without a neighbour there must be no stretch.
static const char* check_changes(const verge_lane_def* lane, int32_t neighbour,
                                 const verge_stretch* stretches, uint32_t count)
{
    if (neighbour == VERGE_NO_LANE && count > 0) {
        return "stretches are for a side with a neighbour; this lane has none there";
    }
    return check_stretches(lane, stretches, count);
}

static const char* check_stretches(const verge_lane_def* lane, const verge_stretch* stretches,
                                   uint32_t count)
{
    if (count > VERGE_STRETCHES_MAX) {
        return "more stretches than the capacity of " TEXT_OF(VERGE_STRETCHES_MAX)
               " (VERGE_STRETCHES_MAX)";
    }
    // Survey and line differ in length by decimetres; a stretch to the end of either is valid.
    const double length = vg_survey_length(lane), end = length + 5.0;
    for (uint32_t i = 0; i < count; ++i) {
        if (!vg_finite(stretches[i].s0) || !vg_finite(stretches[i].s1)) {
            return "every stretch is a pair of finite numbers";
        }
        if (!(stretches[i].s0 < stretches[i].s1)) {
            return "a stretch [s0, s1] has s0 < s1";
        }
        if (stretches[i].s0 < 0.0 || stretches[i].s0 >= length || stretches[i].s1 > end) {
            return "a stretch lies within the lane, 0 to its length";
        }
        for (uint32_t k = 0; k < i; ++k) {
            if (stretches[k].s0 < stretches[i].s1 && stretches[i].s0 < stretches[k].s1) {
                return "stretches of one side do not overlap";
            }
        }
    }
    return NULL;
}

static const verge_lane_def* find(const checked* road, int32_t id)
{
    const int32_t index = vg_lanes_find(road->def, road->by_id, id);
    return index < 0 ? NULL : &road->def->lanes[index];
}
