/// From surveyed polylines to reference lines.
///
/// Lanes that follow one another one to one are fitted as one chain, so that the line is smooth at
/// their joints. Where chains meet, a place has one pose, position and direction, that the lines of
/// all its lanes take: the pose of the lane that all others continue, fitted alone. Each chain is
/// then fitted for itself, in these steps:
///
///     survey  -> shape      chords, and arcs where the survey turns evenly     fit_shape.c
///     shape   -> tolerance  more at sharp corners and where lanes meet         fit_corners.c
///     shape   -> samples    the smoothest ones within the tolerance            fit_smooth.c
///     samples -> lines      a C2 spline with knots at equal arc length         fit_knots.c
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

/// Wavelengths below 2 pi times this are noise of the survey. [m]
static const double smoothing_max = 12.0;
/// At its end a line that is smoothed over more leaves a bend. [m]
static const double pose_smoothing = 2.0;
static const double pose_length = 40.0; // [m] ten times that
enum { POSE_POINTS = 128 };
/// A pose further from a chain's surveyed end than this share of the chain is not for it.
static const double pose_share = 0.25;

static uint32_t points_of(const verge_road_def* def, const uint16_t* lanes, uint32_t count,
                          double* length);
static void find_pose(vg_fit_place* place, const verge_road_def* def, vg_arena* scratch);
static void fit_chain(vg_road_draft* draft, const vg_fit_places* places, const uint16_t* lanes,
                      uint32_t lane_count);

void vg_road_fit(vg_road_draft* draft)
{
    vg_arena* scratch = draft->scratch;
    scratch->used = draft->scratch_start;
    vg_fit_chains* chains = vg_arena_take(scratch, sizeof *chains);
    if (chains == NULL) {
        return;
    }
    vg_fit_chains_from(chains, draft->def);
    vg_fit_places places;
    if (!vg_fit_places_find(&places, scratch, draft->def, chains)) {
        return;
    }
    const size_t mark = scratch->used;
    for (uint32_t i = 0; i < places.count; ++i) {
        find_pose(&places.of[i], draft->def, scratch);
        scratch->used = mark;
    }
    for (uint32_t i = 0; i < chains->count; ++i) {
        const vg_fit_chain* chain = &chains->of[i];
        fit_chain(draft, &places, chains->lanes + chain->first, chain->lane_count);
        scratch->used = mark;
    }
}

size_t vg_road_fit_scratch_size(const verge_road_def* def)
{
    vg_fit_chains chains;
    vg_fit_chains_from(&chains, def);
    size_t largest = vg_fit_size(2, 2 * POSE_POINTS, 2.0 * pose_length);
    for (uint32_t i = 0; i < chains.count; ++i) {
        double length;
        const vg_fit_chain* chain = &chains.of[i];
        const uint32_t points = points_of(def, chains.lanes + chain->first, chain->lane_count,
                                          &length);
        const size_t size = vg_fit_size(chain->lane_count, points, length);
        largest = size > largest ? size : largest;
    }
    return largest + sizeof(vg_fit_chains) + vg_fit_places_size(def) + VG_ARENA_ALIGN;
}

uint32_t vg_lane_knot_count(const verge_lane_def* lane)
{
    const double intervals = vg_clamp(vg_survey_length(lane) / VG_KNOT_SPACING, 3.0, 1e6);
    const uint32_t whole = (uint32_t)intervals;
    return whole + ((double)whole < intervals ? 2u : 1u);
}

// ------------------------------------------------------------------------------ memory

/// Points and metres of the surveys of a chain.
static uint32_t points_of(const verge_road_def* def, const uint16_t* lanes, uint32_t count,
                          double* length)
{
    uint32_t points = 0;
    *length = 0.0;
    for (uint32_t k = 0; k < count; ++k) {
        points += vg_survey_count(&def->lanes[lanes[k]]);
        *length += vg_survey_length(&def->lanes[lanes[k]]) + 4.0;
    }
    return points;
}

/// A chord is split into three at most; the shape is longer than its survey by a fifth at most.
static void capacities(uint32_t points, double length, uint32_t* vertices, uint32_t* samples)
{
    *vertices = 3 * points + 8;
    *samples = (uint32_t)(1.3 * length) + 64;
}

size_t vg_fit_size(uint32_t lane_count, uint32_t points, double length)
{
    uint32_t vertices, samples;
    capacities(points, length, &vertices, &samples);
    return ((size_t)vertices + points) * sizeof(vg_fit_vertex)
           + (size_t)samples * (sizeof(vg_fit_sample) + 7 * sizeof(double))
           + (lane_count + 1u) * sizeof(double) + 11 * VG_ARENA_ALIGN;
}

bool vg_fit_begin(vg_fit* self, vg_arena* scratch, uint32_t lane_count, uint32_t points,
                  double length, const double origin[2])
{
    *self = (vg_fit){ .lane_count = lane_count, .origin_x = origin[0], .origin_y = origin[1] };
    capacities(points, length, &self->vertex_capacity, &self->sample_capacity);
    self->vertices = vg_arena_take(scratch, self->vertex_capacity * sizeof *self->vertices);
    self->surveyed = vg_arena_take(scratch, points * sizeof *self->surveyed);
    self->samples = vg_arena_take(scratch, self->sample_capacity * sizeof *self->samples);
    self->joints = vg_arena_take(scratch, (lane_count + 1) * sizeof *self->joints);
    double** arrays[7] = { &self->arc, &self->x, &self->y, &self->xss, &self->yss, &self->h,
                           &self->work };
    for (int i = 0; i < 7; ++i) {
        *arrays[i] = vg_arena_take(scratch, self->sample_capacity * sizeof(double));
    }
    return !scratch->failed;
}

// ------------------------------------------------------------------------------ places

/// The points of a lane that are nearest to its end or start, nearest first; returns their number.
static uint32_t points_near(const verge_lane_def* lane, bool end, double (*points)[2])
{
    vg_survey survey = vg_survey_from(lane, end);
    uint32_t count = 0;
    double along = 0.0;
    while (count < POSE_POINTS && along < pose_length && vg_survey_next(&survey, points[count])) {
        double* here = points[count];
        if (count > 0) { // cut where it is long enough
            const double* last = points[count - 1];
            const double dx = here[0] - last[0], dy = here[1] - last[1];
            const double leg = vg_sqrt(dx * dx + dy * dy);
            if (along + leg > pose_length) {
                here[0] = last[0] + dx * (pose_length - along) / leg;
                here[1] = last[1] + dy * (pose_length - along) / leg;
            }
            along += leg;
        }
        ++count;
    }
    return count;
}

/// The chain goes on with a lane that begins here: the joint is the middle of both ends.
static void continue_from(vg_fit* self, const double start[2], int32_t joint)
{
    vg_fit_vertex* last = &self->vertices[self->vertex_count - 1];
    last->x = 0.5 * (last->x + start[0] - self->origin_x);
    last->y = 0.5 * (last->y + start[1] - self->origin_y);
    last->joint = joint;
}

/// Fits the lane that leads to the place, the lane behind it, or both, and looks where the line is.
static void find_pose(vg_fit_place* place, const verge_road_def* def, vg_arena* scratch)
{
    double points[POSE_POINTS][2];
    const bool has_before = place->before >= 0, has_behind = place->behind >= 0;
    VERGE_ASSERT(has_before || has_behind);
    const verge_lane_def* lane = &def->lanes[has_before ? place->before : place->behind];
    const double* origin = lane->points[has_before ? lane->point_count - 1 : 0];
    vg_fit self;
    if (!vg_fit_begin(&self, scratch, (has_before ? 1u : 0u) + (has_behind ? 1u : 0u),
                      2 * POSE_POINTS, 2.0 * pose_length, origin)) {
        return;
    }
    self.width = lane->width;
    self.smoothing = pose_smoothing;
    const int32_t joint = has_before ? 1 : 0;
    if (has_before) {
        const uint32_t count = points_near(lane, true, points);
        for (uint32_t i = count; i-- > 0;) {
            vg_fit_add(&self, points[i][0], points[i][1],
                       i + 1 == count ? 0 : i == 0 ? joint : -1);
        }
    }
    if (has_behind) {
        const uint32_t count = points_near(&def->lanes[place->behind], false, points);
        if (has_before) {
            continue_from(&self, points[0], joint);
        }
        for (uint32_t i = has_before ? 1 : 0; i < count; ++i) {
            vg_fit_add(&self, points[i][0], points[i][1],
                       i == 0 ? joint : i + 1 == count ? joint + 1 : -1);
        }
    }
    vg_fit_shape(&self);
    vg_fit_smooth(&self);
    vg_fit_spline(&self);
    place->pose = vg_fit_at_joint(&self, (uint32_t)joint);
}

// ------------------------------------------------------------------------------ chains

/// The pose that an end of the chain takes, null: none.
static const vg_pose* pose_of(const vg_fit_places* places, int32_t place, const double end[2],
                              double length)
{
    if (place < 0) {
        return NULL;
    }
    const vg_pose* pose = &places->of[place].pose;
    const double distance = vg_sqrt(vg_square(pose->x - end[0]) + vg_square(pose->y - end[1]));
    return distance < pose_share * length ? pose : NULL;
}

/// Adds the survey of lane number k of the chain. An end with a pose begins or ends there.
static void add_survey(vg_fit* self, const verge_lane_def* lane, uint32_t k)
{
    const vg_pose* start = k == 0 ? self->ends[0] : NULL;
    const vg_pose* end = k + 1 == self->lane_count ? self->ends[1] : NULL;
    double point[2];
    vg_survey survey = vg_survey_from(lane, false);
    for (uint32_t i = 0; vg_survey_next(&survey, point); ++i) {
        const bool is_last = survey.next == lane->point_count;
        if (i == 0 && k > 0) {
            continue_from(self, point, (int32_t)k);
            continue;
        }
        const vg_pose* pose = i == 0 ? start : is_last ? end : NULL;
        vg_fit_add(self, pose != NULL ? pose->x : point[0], pose != NULL ? pose->y : point[1],
                   i == 0 ? (int32_t)k : is_last ? (int32_t)k + 1 : -1);
    }
}

static void fit_chain(vg_road_draft* draft, const vg_fit_places* places, const uint16_t* lanes,
                      uint32_t lane_count)
{
    const verge_road_def* def = draft->def;
    const verge_lane_def* first = &def->lanes[lanes[0]];
    const verge_lane_def* last = &def->lanes[lanes[lane_count - 1]];
    double length;
    const uint32_t points = points_of(def, lanes, lane_count, &length);
    vg_fit self;
    if (!vg_fit_begin(&self, draft->scratch, lane_count, points, length, first->points[0])) {
        return;
    }
    const double metres = length - 4.0 * (double)lane_count;
    self.ends[0] = pose_of(places, places->of_ends[2 * lanes[0]], first->points[0], metres);
    self.ends[1] = pose_of(places, places->of_ends[2 * lanes[lane_count - 1] + 1],
                           last->points[last->point_count - 1], metres);
    self.width = first->width;
    self.smoothing = smoothing_max;
    for (uint32_t k = 0; k < lane_count; ++k) {
        self.width = vg_min(self.width, def->lanes[lanes[k]].width);
        add_survey(&self, &def->lanes[lanes[k]], k);
    }
    vg_fit_shape(&self);
    vg_fit_smooth(&self);
    vg_fit_spline(&self);
    vg_fit_knots(&self, draft, lanes);
}
