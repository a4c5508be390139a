/// Access to the survey: lanes by id, points in the spacing that the fit needs.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

/// Distance of the points that tell the direction of a survey: over it noise is small. [m]
static const double bearing_length = 3.0;

static double distance(const double a[2], const double b[2])
{
    return vg_sqrt(vg_square(a[0] - b[0]) + vg_square(a[1] - b[1]));
}

// ------------------------------------------------------------------------------ lanes by id

static bool comes_before(const verge_lane_def* lanes, uint16_t a, uint16_t b)
{
    return lanes[a].id < lanes[b].id || (lanes[a].id == lanes[b].id && a < b);
}

/// Moves the lane at `root` down to its place in the heap order[0 .. count).
static void sift(uint16_t* order, const verge_lane_def* lanes, uint32_t root, uint32_t count)
{
    const uint16_t lane = order[root];
    for (uint32_t child = 2 * root + 1; child < count; child = 2 * root + 1) {
        if (child + 1 < count && comes_before(lanes, order[child], order[child + 1])) {
            ++child;
        }
        if (!comes_before(lanes, lane, order[child])) {
            break;
        }
        order[root] = order[child];
        root = child;
    }
    order[root] = lane;
}

void vg_lanes_sort(const verge_road_def* def, uint16_t* order)
{
    VERGE_ASSERT(def->lane_count <= VERGE_LANES_MAX);
    const uint32_t count = def->lane_count;
    for (uint32_t i = 0; i < count; ++i) {
        order[i] = (uint16_t)i;
    }
    for (uint32_t i = count / 2; i-- > 0;) {
        sift(order, def->lanes, i, count);
    }
    for (uint32_t end = count; end-- > 1;) {
        const uint16_t last = order[0];
        order[0] = order[end];
        order[end] = last;
        sift(order, def->lanes, 0, end);
    }
}

int32_t vg_lanes_find(const verge_road_def* def, const uint16_t* order, int32_t id)
{
    uint32_t low = 0, high = def->lane_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (def->lanes[order[middle]].id < id) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < def->lane_count && def->lanes[order[low]].id == id ? (int32_t)order[low] : -1;
}

// ------------------------------------------------------------------------------ points

static const double* point_at(const vg_survey* self, uint32_t index)
{
    const uint32_t last = self->lane->point_count - 1;
    return self->lane->points[self->backwards ? last - index : index];
}

vg_survey vg_survey_from(const verge_lane_def* lane, bool backwards)
{
    VERGE_ASSERT(lane->point_count >= 2);
    vg_survey self = { .lane = lane, .backwards = backwards, .tail = lane->point_count - 1 };
    const double* end = point_at(&self, self.tail);
    while (self.tail > 1 && distance(point_at(&self, self.tail - 1), end) < VG_SURVEY_SPACING) {
        --self.tail; // represented by the last point
    }
    return self;
}

bool vg_survey_next(vg_survey* self, double point[2])
{
    const uint32_t count = self->lane->point_count;
    if (self->next == count) {
        return false;
    }
    const uint32_t first = self->next < self->tail ? self->next : count - 1;
    const double* start = point_at(self, first);
    double x = 0.0, y = 0.0; // of the mean, relative to the first: exact for a group of one
    uint32_t end = first;
    for (; end < self->tail && distance(point_at(self, end), start) < VG_SURVEY_SPACING; ++end) {
        x += point_at(self, end)[0] - start[0];
        y += point_at(self, end)[1] - start[1];
    }
    const bool is_end = first == 0 || first == count - 1;
    const double size = (double)(end - first);
    point[0] = is_end ? start[0] : start[0] + x / size;
    point[1] = is_end ? start[1] : start[1] + y / size;
    self->next = first == count - 1 ? count : end;
    return true;
}

double vg_survey_length(const verge_lane_def* lane)
{
    double length = 0.0, here[2], before[2] = { 0.0, 0.0 };
    vg_survey survey = vg_survey_from(lane, false);
    for (bool first = true; vg_survey_next(&survey, here); first = false) {
        length += first ? 0.0 : distance(here, before);
        before[0] = here[0];
        before[1] = here[1];
    }
    return length;
}

uint32_t vg_survey_count(const verge_lane_def* lane)
{
    double point[2];
    uint32_t count = 0;
    vg_survey survey = vg_survey_from(lane, false);
    while (vg_survey_next(&survey, point)) {
        ++count;
    }
    return count;
}

/// The next point of a survey at least `bearing_length` from `from`; false: there is none.
static bool next_point(vg_survey* survey, const double from[2], double point[2])
{
    while (vg_survey_next(survey, point)) {
        if (vg_square(point[0] - from[0]) + vg_square(point[1] - from[1])
            >= vg_square(bearing_length)) {
            return true;
        }
    }
    return false;
}

vg_bearing vg_survey_bearing(const verge_lane_def* lane, bool last)
{
    double p[3][2];
    vg_survey survey = vg_survey_from(lane, last);
    const double away = last ? -1.0 : 1.0; // the survey is read away from this end
    (void)vg_survey_next(&survey, p[0]);
    const bool has_next = next_point(&survey, p[0], p[1]);
    const double ax = away * (p[1][0] - p[0][0]), ay = away * (p[1][1] - p[0][1]);
    vg_bearing at = { .heading = vg_atan2(ay, ax) };
    if (has_next && next_point(&survey, p[1], p[2])) {
        const double bx = away * (p[2][0] - p[1][0]), by = away * (p[2][1] - p[1][1]);
        const double first = vg_sqrt(ax * ax + ay * ay);
        const double turn = vg_atan2(ax * by - ay * bx, ax * bx + ay * by);
        at.curvature = away * turn / (0.5 * (first + vg_sqrt(bx * bx + by * by)));
        at.heading -= away * 0.5 * first * at.curvature;
    }
    return at;
}
