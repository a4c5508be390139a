/// What is odd about the lanes of a road that can be built: verge_road_report().
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

/// A larger radius is a straight line. [m]
static const double radius_max = 1e6;
static const double line_step = 0.5;              // [m] between places where the line is looked at
static const double beside_step = 5.0;            // [m] the same, for its neighbours
static const double angle_max = 0.17453292519943; // [rad] 10 degrees
/// Three turns that are this much alike, and smaller, are those of one bend: a survey that goes on
/// like this is sparse.
static const double alike = 1.3, turn_max = 0.21; // [1], [rad]

/// A lane under report.
typedef struct inspected {
    const verge_road*     road;
    const verge_road_def* def;
    const verge_lane_def* survey;
    const vg_lane*        lane;
    verge_lane_report*    report;
} inspected;

static void warn(inspected* self, const char* field, const char* text, double value,
                 int32_t other_lane)
{
    verge_lane_report* report = self->report;
    if (report->warning_count < VERGE_LANE_WARNINGS_MAX) {
        report->warnings[report->warning_count++] = (verge_lane_warning){
            .field = field, .text = text, .value = value, .other_lane = other_lane };
    }
}

// ------------------------------------------------------------------------------ the lane itself

static void measure_bends(inspected* self)
{
    verge_lane_report* report = self->report;
    report->radius_min = radius_max;
    const uint32_t steps = (uint32_t)(self->lane->length / line_step) + 1;
    for (uint32_t i = 0; i <= steps; ++i) {
        const double s = self->lane->length * (double)i / (double)steps;
        const double radius = 1.0 / vg_max(vg_abs(vg_lane_at(self->lane, s).curvature),
                                           1.0 / radius_max);
        if (radius < report->radius_min) {
            report->radius_min = radius;
            report->radius_s = s;
        }
    }
}

/// [m] by which the arc through three points that turn alike leaves their longer chord.
static double sparsest_arc(const verge_lane_def* survey)
{
    double rise = 0.0, turns[2] = { 0.0, 0.0 }, chord = 0.0, last[2] = { 0.0, 0.0 }, here[2];
    double before[2] = { 0.0, 0.0 };
    vg_survey points = vg_survey_from(survey, false);
    for (uint32_t i = 0; vg_survey_next(&points, here); ++i) {
        const double x = here[0] - last[0], y = here[1] - last[1];
        const double length = vg_sqrt(x * x + y * y);
        const double turn = i < 2 ? 0.0 : vg_atan2(before[0] * y - before[1] * x,
                                                   before[0] * x + before[1] * y);
        const double least = vg_min(vg_abs(turn), vg_min(vg_abs(turns[0]), vg_abs(turns[1])));
        const double most = vg_max(vg_abs(turn), vg_max(vg_abs(turns[0]), vg_abs(turns[1])));
        const bool one_side = turn * turns[0] > 0.0 && turn * turns[1] > 0.0;
        if (one_side && most < alike * least && most < turn_max) {
            rise = vg_max(rise, vg_max(chord, length) * most / 8.0);
        }
        turns[0] = turns[1];
        turns[1] = turn;
        chord = length;
        before[0] = x;
        before[1] = y;
        last[0] = here[0];
        last[1] = here[1];
    }
    return rise;
}

static double side_of(const double a[2], const double b[2], const double p[2])
{
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

/// Does a chord of the survey cross another one that is not next to it?
static bool crosses_itself(const verge_lane_def* survey)
{
    const double(*p)[2] = survey->points;
    for (uint32_t i = 0; i + 1 < survey->point_count; ++i) {
        for (uint32_t k = i + 2; k + 1 < survey->point_count; ++k) {
            if (side_of(p[i], p[i + 1], p[k]) * side_of(p[i], p[i + 1], p[k + 1]) < 0.0
                && side_of(p[k], p[k + 1], p[i]) * side_of(p[k], p[k + 1], p[i + 1]) < 0.0) {
                return true;
            }
        }
    }
    return false;
}

static void inspect_line(inspected* self)
{
    const double rise = sparsest_arc(self->survey);
    if (rise > VG_FIT_RISE) {
        warn(self, "centerline", "is sparse in a bend: an arc through its points leaves the chords "
             "by this [m], the line follows the chords", rise, VERGE_NO_LANE);
    }
    if (self->report->deviation > VG_FIT_OUTLIER) {
        warn(self, "centerline", "has a point this far from the fitted line [m]: noise, or a corner "
             "that is cut because it cannot be driven as surveyed", self->report->deviation,
             VERGE_NO_LANE);
    }
    if (crosses_itself(self->survey)) {
        warn(self, "centerline", "crosses itself: a vehicle on the crossing is on one of both "
             "branches", 0.0, VERGE_NO_LANE);
    }
}

// ------------------------------------------------------------------------------ its neighbours

/// Where a neighbour runs, over all places of the lane that have it beside them.
typedef struct beside {
    uint32_t places, opposed, swapped; ///< counts
    double   nearest;                  ///< [m] between centres
} beside;

static beside run_beside(const inspected* self, const vg_lane* other, bool left)
{
    beside run = { .nearest = VG_HUGE };
    const uint32_t steps = (uint32_t)(self->lane->length / beside_step) + 1;
    for (uint32_t i = 0; i <= steps; ++i) {
        const vg_reference at = vg_lane_at(self->lane, self->lane->length * (double)i
                                                           / (double)steps);
        const double s = vg_lane_project_whole(other, at.x, at.y, 0.0);
        if (s < 0.0 || s > other->length) {
            continue;
        }
        const vg_reference there = vg_lane_at(other, s);
        const double dx = there.x - at.x, dy = there.y - at.y;
        const double aside = dy * at.cos_heading - dx * at.sin_heading;
        const double cosine = at.cos_heading * there.cos_heading
                              + at.sin_heading * there.sin_heading;
        run.places++;
        run.opposed += cosine < 0.0 ? 1u : 0u;
        run.swapped += (left ? aside < 0.0 : aside > 0.0) ? 1u : 0u;
        run.nearest = vg_min(run.nearest, vg_abs(aside));
    }
    return run;
}

static void inspect_neighbour(inspected* self, bool left)
{
    const int32_t index = left ? self->lane->left : self->lane->right;
    if (index < 0) {
        return;
    }
    const char* field = left ? "left" : "right";
    const vg_lane* other = &self->road->lanes[index];
    const int32_t back = left ? other->right : other->left;
    const beside run = run_beside(self, other, left);
    const double widths = 0.5 * (self->lane->width + other->width);
    if (run.places == 0 || run.nearest > VG_BESIDE_WIDTHS_MAX * widths) {
        warn(self, field, "is nowhere beside this lane; the nearest place is this far away [m]",
             run.places == 0 ? 0.0 : run.nearest, other->id);
        return;
    }
    if (2 * run.opposed > run.places) {
        warn(self, field, "runs in the opposite direction; neighbours run in the same one", 0.0,
             other->id);
    } else if (2 * run.swapped > run.places) {
        warn(self, field, left ? "lies on the right" : "lies on the left", 0.0, other->id);
    }
    if (back < 0 || &self->road->lanes[back] != self->lane) {
        warn(self, field, left ? "does not name this lane as its right neighbour"
                               : "does not name this lane as its left neighbour", 0.0, other->id);
    }
}

// ------------------------------------------------------------------------------ what follows

static void inspect_successors(inspected* self)
{
    const double* end = self->survey->points[self->survey->point_count - 1];
    const vg_bearing bearing = vg_survey_bearing(self->survey, true);
    for (uint32_t k = 0; k < self->lane->successor_count; ++k) {
        const int32_t index = self->lane->successors[k];
        const verge_lane_def* next = &self->def->lanes[index];
        const double gap = vg_sqrt(vg_square(next->points[0][0] - end[0])
                                   + vg_square(next->points[0][1] - end[1]));
        const double angle = vg_abs(
            vg_wrap_angle(vg_survey_bearing(next, false).heading - bearing.heading));
        if (gap > VG_JOINT_GAP) {
            warn(self, "successors", "begins this far from the end of the lane [m]", gap, next->id);
        }
        if (angle > angle_max) {
            warn(self, "successors", "begins at this angle to the end of the lane [rad]", angle,
                 next->id);
        }
    }
}

verge_status verge_road_report(const verge_road* road, const verge_road_def* def,
                               uint32_t lane_index, verge_lane_report* report)
{
    if (report == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    *report = (verge_lane_report){ .lane_id = VERGE_NO_LANE };
    if (road == NULL || def == NULL || def->lanes == NULL || def->lane_count != road->lane_count
        || lane_index >= road->lane_count
        || def->lanes[lane_index].id != road->lanes[lane_index].id) {
        return VERGE_ERR_ARGUMENT;
    }
    inspected self = { .road = road, .def = def, .survey = &def->lanes[lane_index],
                       .lane = &road->lanes[lane_index], .report = report };
    report->lane_id = self.lane->id;
    report->deviation = self.lane->deviation;
    report->speed_min = self.lane->speed_min;
    measure_bends(&self);
    inspect_line(&self);
    inspect_neighbour(&self, true);
    inspect_neighbour(&self, false);
    inspect_successors(&self);
    VERGE_ASSERT(report->warning_count <= VERGE_LANE_WARNINGS_MAX);
    return VERGE_OK;
}
