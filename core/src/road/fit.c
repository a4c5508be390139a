/// From surveyed polylines to reference lines.
///
/// Lanes joined one to one are fitted as one chain, so that the line is smooth at their joints. Of
/// each chain: (1) its survey, with up to 60 m of the lanes before and after it as context, becomes
/// a list of vertices; (2) a shape through them that is a circle where the survey turns evenly and
/// straight where it is straight; (3) samples of that shape every metre; (4) the smoothest samples
/// near these: least squares with a penalty on third differences, which leaves straight lines and
/// parabolas as they are,
///
///     minimise  sum w_i (q_i - p_i)^2  +  sum (L_i / h)^6 (q_i+3 - 3 q_i+2 + 3 q_i+1 - q_i)^2
///
/// where L, the smoothing length, begins at 12 m and is reduced wherever the result would exceed
/// the tolerances (VG_FIT_TOLERANCE and others); (5) knots at equal arc length and one C2 spline
/// through all of them.
///
/// At a merge or a diverge one chain is fitted first and holds its neighbours' ends in place.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

static const double sample_spacing = 1.0;    // [m]
static const double context_length = 60.0;   // [m] five times the longest smoothing length
static const double smoothing_max = 12.0;    // [m] wavelengths below 2 pi times this are noise
static const double smoothing_min = 1.0;     // [m]
static const double smoothing_shrink = 0.7;
/// Shrinking spreads over this many smoothing lengths to each side: where it changes abruptly the
/// line bends twice as sharply as its survey (measured over random clothoids).
static const double shrink_reach = 3.0;
enum { SMOOTHING_ROUNDS = 24 };              // 7 shrink 12 m to the least; more as it spreads
static const double joint_gap = 0.5;         // [m] ends this close are one point
static const double context_gap = 2.0;       // [m] beyond it a lane is no context
static const double fitted_weight = 1e8;     // a fitted neighbour is not to be moved
static const double bow_max = 0.1;           // [m] by which an uneven corner may swing out
enum { CONTEXT_VERTICES = 64, CONTEXT_KNOTS = 12 };

/// Lanes that follow one another one to one: a stretch of chains.lanes.
typedef struct chain {
    uint16_t first, lane_count;
    uint16_t branches; ///< ends at which the road merges or parts
} chain;

typedef struct chains {
    uint32_t count;
    uint16_t lanes[VERGE_LANES_MAX]; ///< each lane once
    chain    of[VERGE_LANES_MAX];
} chains;

/// What leads to each lane: the index of the only lane that does, or one of these.
enum { LED_BY_NONE = -1, LED_BY_SEVERAL = -2 };

/// The graph as the def has it.
typedef struct graph {
    const verge_road_def* def;
    uint16_t by_id[VERGE_LANES_MAX];
    int32_t  led_by[VERGE_LANES_MAX];
} graph;

/// A point of the survey. tangent and length are those of the shape from here to the next.
typedef struct vertex {
    double  x, y, weight;
    double  tangent_x, tangent_y;
    double  turn;   ///< [rad] (nearly) from the chord before to the chord behind
    double  chord;  ///< [m] to the next vertex
    double  length; ///< [m] of the shape to the next vertex
    int32_t joint;   ///< lane of the chain that begins here; lane_count at the end; -1 none
} vertex;

typedef struct sample {
    double px, py;    ///< [m] shape
    double qx, qy;    ///< [m] fitted less shape; at the end fitted
    double weight;
    double smoothing; ///< [m] L
    double slack;     ///< [m] on top of the tolerance
    double band[4];   ///< of the normal matrix: the diagonal and three to its right
    bool   shrink;
} sample;

/// One chain's work, in scratch.
typedef struct fit {
    vg_road_draft* draft;
    const uint16_t* lanes;      ///< of the chain
    uint32_t       lane_count;
    const bool*    fitted;      ///< [lane] has its line
    double         origin_x, origin_y; ///< sums are kept small by working relative to it
    vertex*  vertices;
    uint32_t vertex_count, vertex_capacity;
    double*  joints;             ///< [1] sample coordinate of each joint
    sample*  samples;
    uint32_t sample_count, sample_capacity;
    double   spacing;           ///< [m] of samples along the shape
    double  *arc;               ///< [m] arc length at each sample
    double  *x, *y, *xss, *yss, *h, *work; ///< by sample first, by knot then
} fit;

static void graph_from(graph* all, const verge_road_def* def);
static void chains_from(chains* all, const graph* graph);
static bool joined(const graph* graph, uint32_t lane, uint32_t* next);
static void fit_chain(fit* self);
static void vertices_collect(fit* self);
static void context_before(fit* self);
static void context_after(fit* self);
static void vertex_add(fit* self, double x, double y, double weight, int32_t joint);
static void vertices_measure(fit* self);
static void vertices_split(fit* self);
static void vertices_shape(fit* self);
static void samples_take(fit* self);
static void samples_slacken(fit* self);
static void samples_smooth(fit* self);
static void samples_solve(fit* self);
static bool samples_check(fit* self);
static void samples_shrink(fit* self, uint32_t i);
static void samples_to_spline(fit* self);
static void knots_place(fit* self);
static uint32_t knots_add(fit* self, uint32_t n, double s, double h, uint32_t count,
                          uint32_t* hint);
static void lanes_store(fit* self, uint32_t knot);
static double deviation_of(const vg_lane* lane, const verge_lane_def* survey);

// ------------------------------------------------------------------------------ the whole

void vg_road_fit(vg_road_draft* draft)
{
    vg_arena* scratch = draft->scratch;
    scratch->used = draft->scratch_start;
    chains* all = vg_arena_take(scratch, sizeof *all);
    graph* links = vg_arena_take(scratch, sizeof *links);
    bool* fitted = vg_arena_take(scratch, draft->def->lane_count * sizeof *fitted);
    if (all == NULL || links == NULL || fitted == NULL) {
        return;
    }
    graph_from(links, draft->def);
    chains_from(all, links);
    const size_t mark = scratch->used;

    // Chains that others branch from come first, so that the branches can be led to them.
    for (uint32_t branches = 3; branches-- > 0;) {
        for (uint32_t i = 0; i < all->count; ++i) {
            const chain* chain = &all->of[i];
            if (chain->branches != branches) {
                continue;
            }
            fit self = { .draft = draft, .lanes = all->lanes + chain->first,
                         .lane_count = chain->lane_count, .fitted = fitted };
            fit_chain(&self);
            scratch->used = mark;
            for (uint32_t k = 0; k < chain->lane_count; ++k) {
                fitted[self.lanes[k]] = true;
            }
        }
    }
}

uint32_t vg_lane_knot_count(const verge_lane_def* lane)
{
    const double intervals = vg_clamp(vg_survey_length(lane) / VG_KNOT_SPACING, 3.0, 1e6);
    const uint32_t whole = (uint32_t)intervals;
    return whole + ((double)whole < intervals ? 2u : 1u);
}

/// Capacities of a chain: by its survey, whose shape is longer by a fifth at most.
static void capacities(const verge_road_def* def, const uint16_t* lanes, uint32_t lane_count,
                       uint32_t* vertices, uint32_t* samples)
{
    double length = 2.0 * (context_length + VG_GAP_MAX);
    uint32_t points = 2 * CONTEXT_VERTICES;
    for (uint32_t k = 0; k < lane_count; ++k) {
        points += vg_survey_count(&def->lanes[lanes[k]]);
        length += vg_survey_length(&def->lanes[lanes[k]]) + 4.0;
    }
    *vertices = 3 * points;
    *samples = (uint32_t)(1.3 * length / sample_spacing) + 64;
}

size_t vg_road_fit_scratch_size(const verge_road_def* def)
{
    graph links;
    chains all;
    graph_from(&links, def);
    chains_from(&all, &links);
    size_t largest = 0;
    for (uint32_t i = 0; i < all.count; ++i) {
        uint32_t vertices, samples;
        capacities(def, all.lanes + all.of[i].first, all.of[i].lane_count, &vertices, &samples);
        const size_t size = 4 * (size_t)vertices / 3 * sizeof(vertex)
                            + (size_t)samples * (sizeof(sample) + 7 * sizeof(double))
                            + (all.of[i].lane_count + 1u) * sizeof(double);
        largest = size > largest ? size : largest;
    }
    return largest + sizeof(chains) + sizeof(graph) + def->lane_count * sizeof(bool)
           + 16 * VG_ARENA_ALIGN;
}

static void fit_chain(fit* self)
{
    vg_arena* scratch = self->draft->scratch;
    capacities(self->draft->def, self->lanes, self->lane_count, &self->vertex_capacity,
               &self->sample_capacity);
    self->vertices = vg_arena_take(scratch, self->vertex_capacity * sizeof *self->vertices);
    self->samples = vg_arena_take(scratch, self->sample_capacity * sizeof *self->samples);
    self->joints = vg_arena_take(scratch, (self->lane_count + 1) * sizeof *self->joints);
    double** arrays[7] = { &self->arc, &self->x, &self->y, &self->xss, &self->yss, &self->h,
                           &self->work };
    for (int i = 0; i < 7; ++i) {
        *arrays[i] = vg_arena_take(scratch, self->sample_capacity * sizeof(double));
    }
    if (scratch->failed) {
        return;
    }
    vertices_collect(self);
    vertices_measure(self);
    vertices_split(self);
    vertices_measure(self);
    vertices_shape(self);
    samples_take(self);
    samples_smooth(self);
    samples_to_spline(self);
    knots_place(self);
}

// ------------------------------------------------------------------------------ chains

static void graph_from(graph* all, const verge_road_def* def)
{
    all->def = def;
    vg_lanes_sort(def, all->by_id);
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        all->led_by[i] = LED_BY_NONE;
    }
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        for (uint32_t k = 0; k < def->lanes[i].successor_count; ++k) {
            const int32_t next = vg_lanes_find(def, all->by_id, def->lanes[i].successors[k]);
            VERGE_ASSERT(next >= 0);
            all->led_by[next] = all->led_by[next] == LED_BY_NONE ? (int32_t)i : LED_BY_SEVERAL;
        }
    }
}

/// Adds the chain that begins with `lane`.
static void chain_add(chains* all, const graph* graph, bool* taken, uint32_t lane)
{
    chain* added = &all->of[all->count];
    added->first = all->count == 0 ? 0 : (uint16_t)(added[-1].first + added[-1].lane_count);
    added->lane_count = 0;
    added->branches = graph->led_by[lane] == LED_BY_SEVERAL ? 1u : 0u;
    ++all->count;
    uint32_t last;
    bool more;
    do {
        last = lane;
        all->lanes[added->first + added->lane_count++] = (uint16_t)lane;
        taken[lane] = true;
        more = joined(graph, last, &lane);
    } while (more && !taken[lane]);
    added->branches = (uint16_t)(added->branches
                                 + (graph->def->lanes[last].successor_count > 1 ? 1u : 0u));
}

static void chains_from(chains* all, const graph* graph)
{
    bool taken[VERGE_LANES_MAX] = { false };
    all->count = 0;
    // First chains that have a first lane; what remains after that are rings, cut anywhere.
    for (int pass = 0; pass < 2; ++pass) {
        for (uint32_t i = 0; i < graph->def->lane_count; ++i) {
            uint32_t next;
            const int32_t before = graph->led_by[i];
            const bool continues = before >= 0 && joined(graph, (uint32_t)before, &next);
            if (!taken[i] && (pass == 1 || !continues)) {
                chain_add(all, graph, taken, i);
            }
        }
    }
}

/// Does `lane` go on into exactly one lane, which nothing else leads to, without a gap?
static bool joined(const graph* graph, uint32_t lane, uint32_t* next)
{
    const verge_road_def* def = graph->def;
    const verge_lane_def* from = &def->lanes[lane];
    if (from->successor_count != 1) {
        return false;
    }
    const int32_t to = vg_lanes_find(def, graph->by_id, from->successors[0]);
    if (to < 0 || graph->led_by[to] != (int32_t)lane || (uint32_t)to == lane) {
        return false;
    }
    *next = (uint32_t)to;
    const double* a = from->points[from->point_count - 1];
    const double* b = def->lanes[to].points[0];
    return vg_square(a[0] - b[0]) + vg_square(a[1] - b[1]) < joint_gap * joint_gap;
}

// ------------------------------------------------------------------------------ (1) vertices

static void vertices_collect(fit* self)
{
    const verge_road_def* def = self->draft->def;
    self->origin_x = def->lanes[self->lanes[0]].points[0][0];
    self->origin_y = def->lanes[self->lanes[0]].points[0][1];

    context_before(self);
    for (uint32_t k = 0; k < self->lane_count; ++k) {
        const verge_lane_def* lane = &def->lanes[self->lanes[k]];
        uint32_t first = 0;
        vertex* last = self->vertex_count > 0 ? &self->vertices[self->vertex_count - 1] : NULL;
        if (k > 0) { // the joint is one point: the middle of the two ends
            last->x = 0.5 * (last->x + lane->points[0][0] - self->origin_x);
            last->y = 0.5 * (last->y + lane->points[0][1] - self->origin_y);
            last->joint = (int32_t)k;
            first = 1;
        } else if (last != NULL && last->joint == 0) {
            first = 1; // the joint is that of the fitted lane before
        }
        double point[2];
        vg_survey survey = vg_survey_from(lane, false);
        for (uint32_t i = 0; vg_survey_next(&survey, point); ++i) {
            const bool is_last = survey.next == lane->point_count;
            const int32_t joint = i == 0 ? (int32_t)k : is_last ? (int32_t)k + 1 : -1;
            if (i >= first) {
                vertex_add(self, point[0], point[1], 1.0, joint);
            }
        }
    }
    context_after(self);
}

/// Adds a vertex; one that (nearly) repeats the one before only passes on its mark.
static void vertex_add(fit* self, double x, double y, double weight, int32_t joint)
{
    VERGE_ASSERT(self->vertex_count < self->vertex_capacity);
    x -= self->origin_x;
    y -= self->origin_y;
    if (self->vertex_count > 0) {
        vertex* last = &self->vertices[self->vertex_count - 1];
        if (vg_square(x - last->x) + vg_square(y - last->y) < 0.01 * 0.01) {
            if (last->joint < 0) {
                last->joint = joint;
            }
            if (last->joint >= 0 && joint > last->joint) { // the lane's end came twice
                last->joint = joint;
            }
            return;
        }
    }
    self->vertices[self->vertex_count++] = (vertex){ .x = x, .y = y, .weight = weight,
                                                     .joint = joint };
}

/// Unit vector along the survey's stretch number `skip` from its end (or start), in travel
/// direction; false where there is none. Stretches below a centimetre are passed over.
static bool end_stretch(const verge_lane_def* lane, bool last, uint32_t skip, double* x, double* y,
                        double* length)
{
    double from[2], to[2];
    vg_survey survey = vg_survey_from(lane, last);
    (void)vg_survey_next(&survey, from);
    while (vg_survey_next(&survey, to)) {
        const double dx = last ? from[0] - to[0] : to[0] - from[0];
        const double dy = last ? from[1] - to[1] : to[1] - from[1];
        *length = vg_sqrt(dx * dx + dy * dy);
        if (*length < 0.01) {
            continue;
        }
        if (skip-- == 0) {
            *x = dx / *length;
            *y = dy / *length;
            return true;
        }
        from[0] = to[0];
        from[1] = to[1];
    }
    return false;
}

/// Direction of a survey at its end or start: of the circle through its last three points where
/// it is one, else of its last stretch.
static void end_direction(const verge_lane_def* lane, bool last, double* x, double* y)
{
    double ax = 1.0, ay = 0.0, al = 1.0, bx, by, bl;
    (void)end_stretch(lane, last, 0, &ax, &ay, &al);
    *x = ax;
    *y = ay;
    if (!end_stretch(lane, last, 1, &bx, &by, &bl) || al > 2.0 * bl
        || ax * bx + ay * by < 0.27) { // turns by more than 1.3 rad
        return;
    }
    double tx = ax / al + bx / bl; // at the inner point; mirrored at the last chord
    double ty = ay / al + by / bl;
    const double norm = vg_sqrt(tx * tx + ty * ty);
    const double along = (tx * ax + ty * ay) / norm;
    *x = 2.0 * along * ax - tx / norm;
    *y = 2.0 * along * ay - ty / norm;
}

/// Of the lanes before (or behind) `lane` the one whose direction at the joint fits best, -1 none;
/// of equal ones the first by index. A fitted lane is preferred, because it does not change any
/// more.
static int32_t best_joint(const fit* self, uint32_t lane, bool before)
{
    const verge_road_def* def = self->draft->def;
    const struct verge_road* road = self->draft->road;
    const uint32_t count = before ? vg_lane_predecessor_count(road, lane)
                                  : road->lanes[lane].successor_count;
    double x, y;
    end_direction(&def->lanes[lane], !before, &x, &y);
    int32_t best = -1;
    double best_fitness = -2.0;
    for (uint32_t k = 0; k < count; ++k) {
        const int32_t i = before ? vg_lane_predecessor(road, lane, k)
                                 : road->lanes[lane].successors[k];
        double ox, oy;
        const verge_lane_def* other = &def->lanes[i];
        const verge_lane_def* first = before ? other : &def->lanes[lane];
        const verge_lane_def* second = before ? &def->lanes[lane] : other;
        const double* a = first->points[first->point_count - 1];
        const double* b = second->points[0];
        const bool near = vg_square(a[0] - b[0]) + vg_square(a[1] - b[1])
                          < context_gap * context_gap;
        end_direction(other, before, &ox, &oy);
        const double cosine = x * ox + y * oy;
        const double fitness = cosine + (self->fitted[i] ? 0.2 : 0.0);
        // More than 60 degrees is a corner, not a context.
        if (near && cosine > 0.5
            && (fitness > best_fitness || (fitness == best_fitness && i < best))) {
            best = i;
            best_fitness = fitness;
        }
    }
    return best;
}

/// Points of a lane from the joint on, away from the chain: its line every two metres where it is
/// fitted, else its survey.
typedef struct context_lane {
    const vg_lane* line; ///< null: survey
    bool      before;
    uint32_t  next, count;
    vg_survey survey;
} context_lane;

static bool context_next(context_lane* self, double point[2])
{
    if (self->line == NULL) {
        return vg_survey_next(&self->survey, point);
    }
    if (self->next == self->count) {
        return false;
    }
    const double length = self->line->length;
    const double s = length * (double)self->next++ / (double)(self->count - 1);
    const vg_reference at = vg_lane_at(self->line, self->before ? length - s : s);
    point[0] = at.x;
    point[1] = at.y;
    return true;
}

/// Adds the points of one lane to the context; false: it is long enough.
static bool context_add(context_lane* lane, double (*points)[3], uint32_t* count, double* distance)
{
    double p[2];
    while (*count < CONTEXT_VERTICES && *distance < context_length && context_next(lane, p)) {
        if (*count > 0) { // cut where the context is long enough
            const double* last = points[*count - 1];
            const double dx = p[0] - last[0], dy = p[1] - last[1];
            const double leg = vg_sqrt(dx * dx + dy * dy);
            if (*distance + leg > context_length) {
                p[0] = last[0] + dx * (context_length - *distance) / leg;
                p[1] = last[1] + dy * (context_length - *distance) / leg;
            }
            *distance += leg;
        }
        points[*count][0] = p[0];
        points[*count][1] = p[1];
        points[(*count)++][2] = lane->line != NULL ? fitted_weight : 1.0;
    }
    return *count < CONTEXT_VERTICES && *distance < context_length;
}

/// The line or survey of the lanes beyond the chain's end, walked away from it: fills points and
/// weights, nearest first, and returns how many. held: the nearest one is a fitted joint.
static uint32_t context_walk(const fit* self, bool before, double (*points)[3], bool* held)
{
    const verge_road_def* def = self->draft->def;
    uint32_t lane = self->lanes[before ? 0 : self->lane_count - 1];
    uint32_t count = 0;
    double distance = 0.0;
    bool more = true;
    *held = false;
    for (uint32_t step = 0; more && step < CONTEXT_VERTICES; ++step) { // small rings more than once
        const int32_t next = best_joint(self, lane, before);
        if (next < 0) {
            break;
        }
        lane = (uint32_t)next;
        const vg_lane* line = self->fitted[lane] ? &self->draft->road->lanes[lane] : NULL;
        *held = *held || (line != NULL && step == 0);
        context_lane from = { .line = line, .before = before,
                              .count = line != NULL ? (uint32_t)(0.5 * line->length) + 2 : 0,
                              .survey = vg_survey_from(&def->lanes[lane], before) };
        more = context_add(&from, points, &count, &distance);
    }
    return count;
}

static void context_before(fit* self)
{
    double points[CONTEXT_VERTICES][3];
    bool held;
    const uint32_t count = context_walk(self, true, points, &held);
    // The nearest point comes last. If it is only surveyed, the first point of the chain is the
    // joint.
    for (uint32_t i = count; i-- > (held ? 0u : 1u);) {
        vertex_add(self, points[i][0], points[i][1], points[i][2], held && i == 0 ? 0 : -1);
    }
}

static void context_after(fit* self)
{
    double points[CONTEXT_VERTICES][3];
    bool held;
    const uint32_t count = context_walk(self, false, points, &held);
    const int32_t end = (int32_t)self->lane_count;
    if (held && self->vertex_count > 1) {
        self->vertex_count--; // the fitted joint replaces the last point of the chain
    }
    for (uint32_t i = held ? 0 : 1; i < count; ++i) {
        vertex_add(self, points[i][0], points[i][1], points[i][2], held && i == 0 ? end : -1);
    }
}

/// Chords and turns of the polygon.
static void vertices_measure(fit* self)
{
    vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    VERGE_ASSERT(n >= 2);
    for (uint32_t i = 0; i + 1 < n; ++i) {
        v[i].chord = vg_sqrt(vg_square(v[i + 1].x - v[i].x) + vg_square(v[i + 1].y - v[i].y));
    }
    v[0].turn = 0.0;
    v[n - 1].turn = 0.0;
    for (uint32_t i = 1; i + 1 < n; ++i) {
        const double ax = v[i].x - v[i - 1].x, ay = v[i].y - v[i - 1].y;
        const double bx = v[i + 1].x - v[i].x, by = v[i + 1].y - v[i].y;
        v[i].turn = vg_atan2(ax * by - ay * bx, ax * bx + ay * by);
    }
}

/// Does the survey turn evenly from vertex i to i + 1, as on a circle?
static bool turns_evenly(const fit* self, uint32_t i)
{
    const vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    double before = v[i].turn;
    double behind = v[i + 1].turn;
    if (i == 0 && n > 2 && v[i].chord < 2.0 * v[i + 1].chord) {
        before = behind; // nothing known before the first: it goes on as it is
    }
    if (i + 2 == n && n > 2 && v[i].chord < 2.0 * v[i - 1].chord) {
        behind = before;
    }
    const double least = vg_min(vg_abs(before), vg_abs(behind));
    const double most = vg_max(vg_abs(before), vg_abs(behind));
    return before * behind > 0.0 && most < 3.0 * least && most < 1.3;
}

/// [m] from a corner at which the shape may leave its chord, so that it swings out by bow_max.
static double corner_reach(double turn)
{
    // A cubic that leaves its chord by half the turn bows out 4/27 of its length times that.
    return vg_clamp(bow_max * 13.5 / vg_max(vg_abs(turn), 1e-3), 0.5, 20.0);
}

/// (2a) Adds vertices on chords that are straight, so that corners stay where they are.
static void vertices_split(fit* self)
{
    const uint32_t n = self->vertex_count;
    vertex* old = vg_arena_take(self->draft->scratch, n * sizeof *old);
    if (old == NULL) {
        return;
    }
    bool even_before = false;
    vertex* source = self->vertices;
    for (uint32_t i = 0; i < n; ++i) {
        old[i] = source[i];
    }
    uint32_t count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        self->vertices = old;
        const bool even = i + 1 < n && turns_evenly(self, i);
        const bool even_behind = i + 2 < n && turns_evenly(self, i + 1);
        self->vertices = source;
        VERGE_ASSERT(count + 2 < self->vertex_capacity);
        source[count++] = old[i];
        if (i + 1 == n || even) {
            even_before = even;
            continue;
        }
        double from = corner_reach(old[i].turn);
        double to = corner_reach(old[i + 1].turn);
        if (even_before) {
            from = vg_min(from, old[i - 1].chord);
        }
        if (even_behind) {
            to = vg_min(to, old[i + 1].chord);
        }
        even_before = false;
        if (from + to >= 0.99 * old[i].chord) {
            continue;
        }
        const double distances[2] = { from, old[i].chord - to };
        for (int k = 0; k < 2; ++k) {
            const double t = distances[k] / old[i].chord;
            source[count++] = (vertex){ .x = old[i].x + t * (old[i + 1].x - old[i].x),
                                        .y = old[i].y + t * (old[i + 1].y - old[i].y),
                                        .weight = vg_min(old[i].weight, old[i + 1].weight),
                                        .joint = -1 };
        }
    }
    self->vertex_count = count;
}

/// (2b) Tangents: of the circle through a vertex and its neighbours.
static void vertices_shape(fit* self)
{
    vertex* v = self->vertices;
    const uint32_t n = self->vertex_count;
    for (uint32_t i = 1; i + 1 < n; ++i) {
        const double before = v[i].chord / v[i - 1].chord; // weights: the shorter chord counts more
        const double behind = v[i - 1].chord / v[i].chord;
        const double x = before * (v[i].x - v[i - 1].x) + behind * (v[i + 1].x - v[i].x);
        const double y = before * (v[i].y - v[i - 1].y) + behind * (v[i + 1].y - v[i].y);
        const double norm = vg_sqrt(x * x + y * y);
        v[i].tangent_x = norm > 0.0 ? x / norm : (v[i + 1].x - v[i].x) / v[i].chord;
        v[i].tangent_y = norm > 0.0 ? y / norm : (v[i + 1].y - v[i].y) / v[i].chord;
    }
    for (int end = 0; end < 2; ++end) { // mirrored at the chord where it turns evenly, else along
        const uint32_t at = end == 0 ? 0 : n - 1;
        const uint32_t inner = end == 0 ? 1 : n - 2;
        const uint32_t first = end == 0 ? 0 : n - 2;
        const double ux = (v[first + 1].x - v[first].x) / v[first].chord;
        const double uy = (v[first + 1].y - v[first].y) / v[first].chord;
        const bool even = n > 2 && turns_evenly(self, first);
        const double along = ux * v[inner].tangent_x + uy * v[inner].tangent_y;
        v[at].tangent_x = even ? 2.0 * along * ux - v[inner].tangent_x : ux;
        v[at].tangent_y = even ? 2.0 * along * uy - v[inner].tangent_y : uy;
    }
    for (uint32_t i = 0; i + 1 < n; ++i) {
        // Arc over chord of a circle that leaves the chord by the angle a: 1 + a^2/6 + ...
        const double cosine = ((v[i + 1].x - v[i].x) * (v[i].tangent_x + v[i + 1].tangent_x)
                               + (v[i + 1].y - v[i].y) * (v[i].tangent_y + v[i + 1].tangent_y))
                              / (2.0 * v[i].chord);
        v[i].length = v[i].chord * (1.0 + (1.0 - vg_clamp(cosine, 0.4, 1.0)) / 3.0);
    }
}

// ------------------------------------------------------------------------------ (3) samples

/// The shape between a and b at t in [0, 1]: the cubic that is nearest to a circle's arc.
static void shape_at(const vertex* a, const vertex* b, double t, double* x, double* y)
{
    const double cx = b->x - a->x;
    const double cy = b->y - a->y;
    const double cos_a = vg_max((cx * a->tangent_x + cy * a->tangent_y) / a->chord, 0.0);
    const double cos_b = vg_max((cx * b->tangent_x + cy * b->tangent_y) / a->chord, 0.0);
    const double out = 2.0 * a->chord / (1.0 + cos_a);
    const double in = 2.0 * a->chord / (1.0 + cos_b);
    const double ease = t * t * (3.0 - 2.0 * t);
    const double lead = t * (1.0 - t) * (1.0 - t) * out;
    const double tail = -t * t * (1.0 - t) * in;
    *x = a->x + ease * cx + lead * a->tangent_x + tail * b->tangent_x;
    *y = a->y + ease * cy + lead * a->tangent_y + tail * b->tangent_y;
}

static void samples_take(fit* self)
{
    const vertex* v = self->vertices;
    double total = 0.0;
    for (uint32_t i = 0; i + 1 < self->vertex_count; ++i) {
        if (v[i].joint >= 0) {
            self->joints[v[i].joint] = total;
        }
        total += v[i].length;
    }
    if (v[self->vertex_count - 1].joint >= 0) {
        self->joints[v[self->vertex_count - 1].joint] = total;
    }
    const double wanted = vg_clamp(total / sample_spacing, 7.0,
                                   (double)(self->sample_capacity - 2));
    self->sample_count = (uint32_t)wanted + 2;
    self->spacing = total / (double)(self->sample_count - 1);
    for (uint32_t k = 0; k <= self->lane_count; ++k) {
        self->joints[k] /= self->spacing;
    }

    uint32_t at = 0;
    double start = 0.0;
    for (uint32_t i = 0; i < self->sample_count; ++i) {
        const double distance = self->spacing * (double)i;
        while (at + 2 < self->vertex_count && start + v[at].length < distance) {
            start += v[at++].length;
        }
        sample* p = &self->samples[i];
        shape_at(&v[at], &v[at + 1], vg_clamp((distance - start) / v[at].length, 0.0, 1.0), &p->px,
                 &p->py);
        p->weight = vg_min(v[at].weight, v[at + 1].weight);
        p->smoothing = smoothing_max;
        p->slack = 0.0;
    }
    samples_slacken(self);
}

/// More slack towards those ends of the chain where a fitted neighbour holds the line.
static void samples_slacken(fit* self)
{
    const double ends[2] = { self->joints[0], self->joints[self->lane_count] };
    const bool held[2] = { self->vertices[0].weight > 1.0,
                           self->vertices[self->vertex_count - 1].weight > 1.0 };
    for (uint32_t i = 0; i < self->sample_count; ++i) {
        for (int end = 0; end < 2; ++end) {
            const double distance = vg_abs((double)i - ends[end]) * self->spacing;
            const double slack = VG_FIT_JOINT_TOLERANCE * (1.0 - distance / VG_FIT_JOINT);
            if (held[end]) {
                self->samples[i].slack = vg_max(self->samples[i].slack, slack);
            }
        }
    }
}

// ------------------------------------------------------------------------------ (4) smoothing

static void samples_smooth(fit* self)
{
    for (int round = 0; round < SMOOTHING_ROUNDS; ++round) {
        samples_solve(self);
        if (round + 1 == SMOOTHING_ROUNDS || samples_check(self)) {
            break;
        }
    }
    for (uint32_t i = 0; i < self->sample_count; ++i) {
        self->samples[i].qx += self->samples[i].px;
        self->samples[i].qy += self->samples[i].py;
    }
}

/// Solves for what the samples have to move: the normal matrix has three diagonals on each side,
/// and the right-hand side is zero where the shape is straight, which stays so exactly.
static void samples_solve(fit* self)
{
    static const double difference[4] = { -1.0, 3.0, -3.0, 1.0 };
    sample* p = self->samples;
    const uint32_t n = self->sample_count;
    for (uint32_t i = 0; i < n; ++i) {
        p[i].qx = 0.0;
        p[i].qy = 0.0;
        p[i].band[0] = p[i].weight;
        p[i].band[1] = p[i].band[2] = p[i].band[3] = 0.0;
    }
    for (uint32_t j = 0; j + 3 < n; ++j) {
        const double ratio = vg_min(p[j + 1].smoothing, p[j + 2].smoothing) / self->spacing;
        const double penalty = ratio * ratio * ratio * ratio * ratio * ratio;
        const double dx = (p[j + 3].px - p[j].px) - 3.0 * (p[j + 2].px - p[j + 1].px);
        const double dy = (p[j + 3].py - p[j].py) - 3.0 * (p[j + 2].py - p[j + 1].py);
        for (uint32_t m = 0; m < 4; ++m) {
            for (uint32_t k = m; k < 4; ++k) {
                p[j + m].band[k - m] += penalty * difference[m] * difference[k];
            }
            p[j + m].qx -= penalty * difference[m] * dx;
            p[j + m].qy -= penalty * difference[m] * dy;
        }
    }

    // L D L^T in place, then both sides at once.
    for (uint32_t i = 0; i < n; ++i) {
        VERGE_ASSERT(p[i].band[0] > 0.0);
        for (uint32_t k = 1; k < 4 && i + k < n; ++k) {
            const double factor = p[i].band[k] / p[i].band[0];
            for (uint32_t m = k; m < 4 && i + m < n; ++m) {
                p[i + k].band[m - k] -= factor * p[i].band[m];
            }
            p[i + k].qx -= factor * p[i].qx;
            p[i + k].qy -= factor * p[i].qy;
        }
    }
    for (uint32_t i = n; i-- > 0;) {
        for (uint32_t k = 1; k < 4 && i + k < n; ++k) {
            p[i].qx -= p[i].band[k] * p[i + k].qx;
            p[i].qy -= p[i].band[k] * p[i + k].qy;
        }
        p[i].qx /= p[i].band[0];
        p[i].qy /= p[i].band[0];
    }
}

/// Is the line within the tolerance? Where it is not, the smoothing length is reduced.
static bool samples_check(fit* self)
{
    sample* p = self->samples;
    const uint32_t n = self->sample_count;
    const uint32_t window = (uint32_t)(VG_FIT_WINDOW / self->spacing) + 1; // some 6 samples
    double* deviation = self->work;
    for (uint32_t i = 0; i < n; ++i) { // to the left of the survey
        const sample* before = &p[i > 0 ? i - 1 : 0];
        const sample* behind = &p[i + 1 < n ? i + 1 : n - 1];
        const double tx = behind->px - before->px;
        const double ty = behind->py - before->py;
        const double norm = vg_max(vg_sqrt(tx * tx + ty * ty), 1e-9);
        deviation[i] = (p[i].qy * tx - p[i].qx * ty) / norm;
    }
    bool good = true;
    for (uint32_t i = 0; i < n; ++i) {
        if (p[i].weight > 1.0 || p[i].smoothing <= smoothing_min) {
            continue;
        }
        double sum = 0.0;
        const uint32_t first = i > window ? i - window : 0;
        const uint32_t last = i + window < n ? i + window : n - 1;
        for (uint32_t k = first; k <= last; ++k) {
            sum += deviation[k];
        }
        const double mean = vg_abs(sum) / (double)(last - first + 1);
        const double off = vg_abs(deviation[i]) - p[i].slack;
        if (off > VG_FIT_OUTLIER || (off > VG_FIT_TOLERANCE && mean > VG_FIT_MEAN)) {
            good = false;
            samples_shrink(self, i);
        }
    }
    for (uint32_t i = 0; i < n; ++i) {
        if (p[i].shrink) {
            p[i].smoothing = vg_max(p[i].smoothing * smoothing_shrink, smoothing_min);
            p[i].shrink = false;
        }
    }
    return good;
}

/// Marks the samples around sample i to be smoothed over less.
static void samples_shrink(fit* self, uint32_t i)
{
    sample* p = self->samples;
    const uint32_t reach = (uint32_t)(shrink_reach * p[i].smoothing / self->spacing) + 1;
    const uint32_t first = i > reach ? i - reach : 0;
    for (uint32_t k = first; k < self->sample_count && k <= i + reach; ++k) {
        p[k].shrink = true;
    }
}

// ------------------------------------------------------------------------------ (5) knots

/// Position on the spline through samples first .. , at u in [0, 1] of the interval.
static void spline_at(const double* value, const double* second, double h, double u, double* at,
                      double* slope)
{
    const double first = (value[1] - value[0]) / h - h * (2.0 * second[0] + second[1]) / 6.0;
    const double third = (second[1] - second[0]) / h;
    const double w = u * h;
    *at = value[0] + w * (first + w * (0.5 * second[0] + w * third / 6.0));
    *slope = first + w * (second[0] + 0.5 * w * third);
}

/// [m] of arc between 0 and u of one interval: Gauss' rule with three points, exact to 1e-9 m on
/// an arc of 2 m radius.
static double spline_arc(const fit* self, uint32_t i, double u)
{
    static const double node[3] = { 0.1127016653792583, 0.5, 0.8872983346207417 };
    static const double weight[3] = { 5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0 };
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        double x, y, xs, ys;
        spline_at(self->x + i, self->xss + i, self->h[i], u * node[k], &x, &xs);
        spline_at(self->y + i, self->yss + i, self->h[i], u * node[k], &y, &ys);
        sum += weight[k] * vg_sqrt(xs * xs + ys * ys);
    }
    return sum * u * self->h[i];
}

/// Spline through the samples by their number, and its arc length at each.
static void samples_to_spline(fit* self)
{
    const uint32_t n = self->sample_count;
    for (uint32_t i = 0; i < n; ++i) {
        self->x[i] = self->samples[i].qx;
        self->y[i] = self->samples[i].qy;
        self->h[i] = 1.0;
    }
    vg_spline_solve(self->x, self->h, n, NULL, self->xss, self->work);
    vg_spline_solve(self->y, self->h, n, NULL, self->yss, self->work);
    self->arc[0] = 0.0;
    for (uint32_t i = 0; i + 1 < n; ++i) {
        self->arc[i + 1] = self->arc[i] + spline_arc(self, i, 1.0);
    }
}

/// [m] arc length at the sample coordinate u.
static double arc_at(const fit* self, double u)
{
    const double inside = vg_clamp(u, 0.0, (double)(self->sample_count - 1));
    uint32_t i = (uint32_t)inside;
    i = i > self->sample_count - 2 ? self->sample_count - 2 : i;
    return self->arc[i] + spline_arc(self, i, inside - (double)i);
}

/// Point and direction at an arc length; *hint is the interval to start looking from, as they
/// come in order.
static void point_at_arc(const fit* self, double s, uint32_t* hint, double point[2],
                         double direction[2])
{
    while (*hint + 2 < self->sample_count && self->arc[*hint + 1] < s) {
        ++*hint;
    }
    const uint32_t i = *hint;
    double u = (s - self->arc[i]) / (self->arc[i + 1] - self->arc[i]);
    for (int round = 0; round < 5; ++round) { // speed along the interval is nearly constant
        spline_at(self->x + i, self->xss + i, self->h[i], u, &point[0], &direction[0]);
        spline_at(self->y + i, self->yss + i, self->h[i], u, &point[1], &direction[1]);
        const double speed = vg_sqrt(vg_square(direction[0]) + vg_square(direction[1]));
        u += (s - self->arc[i] - spline_arc(self, i, u)) / speed;
        direction[0] /= speed;
        direction[1] /= speed;
    }
}

/// Knots: some of the context before, each lane's own at equal distances, some behind. They are
/// collected in the samples (whose job is done), then moved to where the solver wants them.
static void knots_place(fit* self)
{
    const double first = arc_at(self, self->joints[0]);
    const double last = arc_at(self, self->joints[self->lane_count]);
    const double before = vg_clamp(first, 0.0, (double)CONTEXT_KNOTS);
    const double total = self->arc[self->sample_count - 1];
    const double behind = vg_clamp(total - last, 0.0, (double)CONTEXT_KNOTS);
    const uint32_t lead = before < 0.5 ? 0 : (uint32_t)before + 1;
    const uint32_t tail = behind < 0.5 ? 0 : (uint32_t)behind + 1;

    uint32_t hint = 0;
    uint32_t n = 0;
    if (lead > 0) {
        n = knots_add(self, n, first - before, before / (double)lead, lead, &hint);
    }
    for (uint32_t k = 0; k < self->lane_count; ++k) {
        vg_lane* lane = &self->draft->road->lanes[self->lanes[k]];
        const double start = arc_at(self, self->joints[k]);
        lane->length = vg_max(arc_at(self, self->joints[k + 1]) - start, 0.01);
        lane->line.knot_spacing = lane->length / (double)(lane->line.knot_count - 1);
        n = knots_add(self, n, start, lane->line.knot_spacing, lane->line.knot_count - 1, &hint);
    }
    const double rest = tail > 0 ? behind / (double)tail : 0.0;
    n = knots_add(self, n, last, rest, tail + 1, &hint);

    const sample* knots = self->samples;
    const double slopes_x[2] = { knots[0].px, knots[n - 1].px };
    const double slopes_y[2] = { knots[0].py, knots[n - 1].py };
    for (uint32_t i = 0; i < n; ++i) {
        self->x[i] = knots[i].qx;
        self->y[i] = knots[i].qy;
        self->h[i] = knots[i].weight;
    }
    vg_spline_solve(self->x, self->h, n, slopes_x, self->xss, self->work);
    vg_spline_solve(self->y, self->h, n, slopes_y, self->yss, self->work);
    lanes_store(self, lead);
}

/// Puts `count` knots h apart from arc length s on into the samples from n on; returns the next n.
static uint32_t knots_add(fit* self, uint32_t n, double s, double h, uint32_t count, uint32_t* hint)
{
    for (uint32_t i = 0; i < count; ++i) {
        double point[2], direction[2];
        VERGE_ASSERT(n < self->sample_capacity);
        point_at_arc(self, s + h * (double)i, hint, point, direction);
        self->samples[n++] = (sample){ .qx = point[0], .qy = point[1], .px = direction[0],
                                       .py = direction[1], .weight = h };
    }
    return n;
}

static void lanes_store(fit* self, uint32_t knot)
{
    for (uint32_t k = 0; k < self->lane_count; ++k) {
        const uint32_t index = self->lanes[k];
        vg_lane* lane = &self->draft->road->lanes[index];
        const vg_lane_storage* storage = &self->draft->storage[index];
        for (uint32_t i = 0; i < lane->line.knot_count; ++i) {
            storage->x[i] = self->origin_x + self->x[knot + i];
            storage->y[i] = self->origin_y + self->y[knot + i];
            storage->xss[i] = self->xss[knot + i];
            storage->yss[i] = self->yss[knot + i];
        }
        knot += lane->line.knot_count - 1; // the last knot is the next lane's first
        lane->deviation = deviation_of(lane, &self->draft->def->lanes[index]);
    }
}

/// [m] from the line to the surveyed point that is furthest from it. The points come in order, so
/// each is looked for near the one before.
static double deviation_of(const vg_lane* lane, const verge_lane_def* survey)
{
    double furthest = 0.0, s = 0.0;
    for (uint32_t i = 0; i < survey->point_count; ++i) {
        const double* p = survey->points[i];
        s = vg_clamp(vg_lane_project(lane, p[0], p[1], s), 0.0, lane->length);
        const vg_reference at = vg_lane_at(lane, s);
        furthest = vg_max(furthest, vg_square(at.x - p[0]) + vg_square(at.y - p[1]));
    }
    return vg_sqrt(furthest);
}
