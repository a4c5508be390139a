/// See batch.h. The reference line is looked up once for each profile and instant. The work for
/// each candidate is arithmetic on arrays of eight, without branches.
///
/// A pair (instant, track) is skipped for all eight candidates if a box around the eight bodies,
/// their alert zones and their motion in the last step cannot touch the other body. For a skipped
/// pair cost and alarm are exactly zero, so skipping changes no result.
#include "motion/batch.h"

#include "base/contract.h"
#include "motion/trailer.h"

/// Eight candidates at one instant, and their sums so far.
typedef struct candidates {
    double offset[VG_BATCH_WIDTH];                 // [m] end offset
    double x[VG_BATCH_WIDTH], y[VG_BATCH_WIDTH];   // [m] centre
    double c[VG_BATCH_WIDTH], s[VG_BATCH_WIDTH];   // [1] cosine and sine of the heading
    double x0[VG_BATCH_WIDTH], y0[VG_BATCH_WIDTH]; // [m] centre one instant before
    double speed[VG_BATCH_WIDTH];                  // [m/s]
    double swing[VG_BATCH_WIDTH];                  // [m] distance that a corner turns in the step
    double hard[VG_BATCH_WIDTH], comfort[VG_BATCH_WIDTH], alarm[VG_BATCH_WIDTH];
    double curvature[VG_BATCH_WIDTH], heading[VG_BATCH_WIDTH], offsets[VG_BATCH_WIDTH];
    double acceleration[VG_BATCH_WIDTH], jerk[VG_BATCH_WIDTH], obstacle[VG_BATCH_WIDTH];
} candidates;

/// The box around the eight bodies, in the frame of the line at its point. [m], [m/s]
typedef struct envelope {
    double ahead_min, ahead_max, left_min, left_max; // of the bodies' centres, now and before
    double slant;   // [1] largest |sine| of a heading against the line
    double speed;   // [m/s] largest
    double swing;   // [m] largest
} envelope;

/// The other body at one instant, with its step before.
typedef struct other {
    double x, y, c, s, speed, half_length, half_width;
    double dx, dy, swing;
} other;

typedef struct scene {
    vg_alert_zone zone;
    double clearance;
    const vg_comfort* comfort;
    const vg_limits* limits;
    double aim;
} scene;

static void candidates_begin(candidates* all, const vg_row* row, const double* offsets,
                             double rear_axle);
static envelope candidates_move(candidates* restrict all, const vg_row* row, const scene* scene);
static other other_at(const verge_track* track, uint32_t k);
static bool out_of_reach(const envelope* e, const vg_reference* line, const scene* scene,
                         const other* o);
static void candidates_meet(candidates* restrict all, const scene* scene, const other* o);
static void candidates_end(const candidates* all, const verge_weights* weights, bool in_lane,
                           double* costs, uint8_t* marks);

void vg_batch_take(vg_batch* batch, vg_arena* arena, const verge_planner_def* def)
{
    const size_t legs = def->sample_speeds, offsets = def->sample_offsets;
    batch->offsets = vg_arena_take(arena, offsets * sizeof *batch->offsets);
    batch->legs = vg_arena_take(arena, legs * sizeof *batch->legs);
    batch->leg_penalties = vg_arena_take(arena, legs * sizeof *batch->leg_penalties);
    batch->offset_penalties = vg_arena_take(arena, offsets * sizeof *batch->offset_penalties);
    batch->costs = vg_arena_take(arena, legs * offsets * sizeof *batch->costs);
    batch->marks = vg_arena_take(arena, legs * offsets * sizeof *batch->marks);
}

void vg_batch_run(vg_batch* batch, const verge_planner_def* def, const verge_weights* weights,
                  const verge_tracks* tracks, uint32_t own)
{
    VERGE_ASSERT(batch->offset_count % VG_BATCH_WIDTH == 0);
    VERGE_ASSERT(batch->last < VERGE_POINTS_MAX && batch->start < batch->last);
    const vg_limits* limits = batch->legs[0].limits;
    const scene scene = { vg_alert_zone_of(def, &tracks->of[own], limits->rear_axle),
                          def->clearance, &batch->comfort, limits, batch->aim };
    const uint32_t trailer = vg_trailer_of(tracks, own);
    vg_row rows[VERGE_POINTS_MAX];
    for (uint32_t p = 0; p < batch->leg_count; ++p) {
        for (uint32_t k = batch->start; k <= batch->last; ++k) {
            rows[k] = vg_leg_row(&batch->legs[p], def->point_s * (k - batch->start));
        }
        for (uint32_t i = 0; i < batch->offset_count; i += VG_BATCH_WIDTH) {
            candidates all;
            candidates_begin(&all, &rows[batch->start], batch->offsets + i, limits->rear_axle);
            for (uint32_t k = batch->start + 1; k <= batch->last; ++k) {
                const envelope e = candidates_move(&all, &rows[k], &scene);
                for (uint32_t j = 0; j < tracks->count; ++j) {
                    const other o = other_at(&tracks->of[j], k);
                    if (j != own && j != trailer && !out_of_reach(&e, &rows[k].line, &scene, &o)) {
                        candidates_meet(&all, &scene, &o);
                    }
                }
            }
            const uint32_t at = p * batch->offset_count + i;
            for (uint32_t k = 0; limits->has_trailer && k < VG_BATCH_WIDTH; ++k) {
                all.alarm[k] = 1.0; // only the exact check includes the trailer
            }
            candidates_end(&all, weights, batch->in_lane, batch->costs + at, batch->marks + at);
        }
    }
}

static void candidates_begin(candidates* all, const vg_row* row, const double* offsets,
                             double rear_axle)
{
    *all = (candidates){ 0 };
    for (uint32_t i = 0; i < VG_BATCH_WIDTH; ++i) {
        const vg_rear rear = vg_rear_of(row, offsets[i]);
        all->offset[i] = offsets[i];
        all->c[i] = rear.cos_heading;
        all->s[i] = rear.sin_heading;
        all->x[i] = rear.x + rear_axle * rear.cos_heading;
        all->y[i] = rear.y + rear_axle * rear.sin_heading;
    }
}

/// Moves the candidates to the next instant: motion, limits and all cost terms but obstacles.
static envelope candidates_move(candidates* restrict all, const vg_row* row, const scene* scene)
{
    const vg_row now = *row;
    const vg_comfort comfort = *scene->comfort;
    const vg_limits limits = *scene->limits;
    const double aim = scene->aim;
    const double radius = scene->zone.half_length + scene->zone.half_width;
    double ahead[VG_BATCH_WIDTH], left[VG_BATCH_WIDTH];
    double ahead0[VG_BATCH_WIDTH], left0[VG_BATCH_WIDTH];
    double slant[VG_BATCH_WIDTH];
    for (uint32_t i = 0; i < VG_BATCH_WIDTH; ++i) {
        const vg_rear rear = vg_rear_of(&now, all->offset[i]);
        const double x0 = all->x[i], y0 = all->y[i], c0 = all->c[i], s0 = all->s[i];
        const double c = rear.cos_heading, s = rear.sin_heading;
        all->x0[i] = x0;
        all->y0[i] = y0;
        all->c[i] = c;
        all->s[i] = s;
        all->x[i] = rear.x + limits.rear_axle * c;
        all->y[i] = rear.y + limits.rear_axle * s;
        all->speed[i] = rear.speed;
        all->swing[i] = radius * (vg_abs(c - c0) + vg_abs(s - s0));
        all->hard[i] = vg_max(all->hard[i], vg_hard_ratio(&limits, &rear, now.s_t));
        all->comfort[i] = vg_max(all->comfort[i], vg_comfort_ratio(&comfort, &rear));
        all->curvature[i] += rear.curvature * rear.curvature;
        all->heading[i] += vg_heading_square(rear.cos_off, rear.sin_off);
        all->offsets[i] += (rear.d - aim) * (rear.d - aim);
        all->acceleration[i] += rear.acceleration * rear.acceleration;
        all->jerk[i] += rear.jerk * rear.jerk;
        const double x = x0 - now.line.x, y = y0 - now.line.y;
        ahead[i] = limits.rear_axle * rear.cos_off;
        left[i] = rear.d + limits.rear_axle * rear.sin_off;
        ahead0[i] = x * now.line.cos_heading + y * now.line.sin_heading;
        left0[i] = y * now.line.cos_heading - x * now.line.sin_heading;
        slant[i] = vg_abs(rear.sin_off);
    }
    envelope e = { ahead[0], ahead[0], left[0], left[0], 0.0, 0.0, 0.0 };
    for (uint32_t i = 0; i < VG_BATCH_WIDTH; ++i) {
        e.ahead_min = vg_min(e.ahead_min, vg_min(ahead[i], ahead0[i]));
        e.ahead_max = vg_max(e.ahead_max, vg_max(ahead[i], ahead0[i]));
        e.left_min = vg_min(e.left_min, vg_min(left[i], left0[i]));
        e.left_max = vg_max(e.left_max, vg_max(left[i], left0[i]));
        e.slant = vg_max(e.slant, slant[i]);
        e.speed = vg_max(e.speed, all->speed[i]);
        e.swing = vg_max(e.swing, all->swing[i]);
    }
    return e;
}

static other other_at(const verge_track* track, uint32_t k)
{
    other o = { track->x[k], track->y[k], track->cos_heading[k], track->sin_heading[k],
                track->speed[k], track->half_length, track->half_width,
                track->x[k] - track->x[k - 1], track->y[k] - track->y[k - 1], 0.0 };
    o.swing = (o.half_length + o.half_width)
            * (vg_abs(o.c - track->cos_heading[k - 1]) + vg_abs(o.s - track->sin_heading[k - 1]));
    return o;
}

/// Conservative: every length below bounds what candidates_meet() measures, in the line's frame.
static bool out_of_reach(const envelope* e, const vg_reference* line, const scene* scene,
                         const other* o)
{
    const double c = line->cos_heading, s = line->sin_heading;
    const double x = o->x - line->x, y = o->y - line->y;
    const double ahead = x * c + y * s, left = y * c - x * s;
    const double move_ahead = vg_abs(o->dx * c + o->dy * s);
    const double move_left = vg_abs(o->dy * c - o->dx * s);
    const double along = o->c * c + o->s * s, across = vg_abs(o->s * c - o->c * s);

    // D_s with the lowest speed of the other body along a heading that differs by the slant.
    const double slant = e->slant;
    const vg_alert_zone* zone = &scene->zone;
    const double other_speed = o->speed * (along - 2.0 * slant);
    const double safe = vg_max(VG_ALERT_EDGE_MIN, e->speed * zone->reaction_s
                                           + zone->headway_s * (e->speed - other_speed));
    // The zone around a body that stands at an angle to the line, and the other body likewise.
    const double guard = scene->clearance + e->swing + o->swing + 1e-6;
    const double front = zone->half_length + vg_max(safe, guard);
    const double back = zone->half_length + vg_max(3.0 * zone->half_length, guard);
    const double side = zone->half_width + vg_max(0.5 * zone->half_width, guard);
    const double box = o->half_length + o->half_width; // how far a corner turns with the slant
    const double reach_ahead = o->half_length * vg_abs(along) + o->half_width * across
                             + (side + 2.0 * box) * slant + move_ahead;
    const double reach_left = o->half_length * across + o->half_width * vg_abs(along)
                            + (vg_max(front, back) + 2.0 * box) * slant + move_left;
    return (ahead - reach_ahead > e->ahead_max + front)
         | (ahead + reach_ahead < e->ahead_min - back)
         | (left - reach_left > e->left_max + side)
         | (left + reach_left < e->left_min - side);
}

/// Obstacle cost and collision alarm of one track. The alarm is a swept test on the two axes of the
/// own body: do the projections on both axes overlap during the step?
static inline void meet_track(candidates* restrict all, const scene* scene, const other* track,
                              bool continuous)
{
    const other o = *track;
    vg_alert_zone zone = scene->zone;
    zone.continuous = continuous;
    const double guard = scene->clearance + o.swing;
    for (uint32_t i = 0; i < VG_BATCH_WIDTH; ++i) {
        const double c = all->c[i], s = all->s[i];
        const double x = o.x - all->x[i], y = o.y - all->y[i];
        const double ahead = x * c + y * s, left = y * c - x * s;
        const double along = o.c * c + o.s * s, across = vg_abs(o.s * c - o.c * s);
        const double reach_ahead = o.half_length * vg_abs(along) + o.half_width * across;
        const double reach_left = o.half_length * across + o.half_width * vg_abs(along);
        all->obstacle[i] += vg_alert_term(&zone, ahead, left, reach_ahead, reach_left,
                                          all->speed[i], o.speed * along);

        const double dx = 0.5 * (o.dx - (all->x[i] - all->x0[i]));
        const double dy = 0.5 * (o.dy - (all->y[i] - all->y0[i]));
        const double half_ahead = dx * c + dy * s, half_left = dy * c - dx * s;
        const double free = guard + all->swing[i];
        const double gap_ahead = vg_abs(ahead - half_ahead) - vg_abs(half_ahead) - reach_ahead
                               - zone.half_length - free;
        const double gap_left = vg_abs(left - half_left) - vg_abs(half_left) - reach_left
                              - zone.half_width - free;
        all->alarm[i] = vg_max(gap_ahead, gap_left) <= 0.0 ? 1.0 : all->alarm[i];
    }
}

static void candidates_meet(candidates* restrict all, const scene* scene, const other* o)
{
    if (scene->zone.continuous) {
        meet_track(all, scene, o, true);
    } else {
        meet_track(all, scene, o, false);
    }
}

static void candidates_end(const candidates* all, const verge_weights* weights, bool in_lane,
                           double* costs, uint8_t* marks)
{
    for (uint32_t i = 0; i < VG_BATCH_WIDTH; ++i) {
        costs[i] = weights->curvature * all->curvature[i] + weights->heading * all->heading[i]
                 + weights->offset * (in_lane ? all->offsets[i] : 0.0)
                 + weights->acceleration * all->acceleration[i] + weights->jerk * all->jerk[i]
                 + weights->obstacle * all->obstacle[i];
        // Negated comparisons: NaN is infeasible.
        marks[i] =
            (uint8_t)((all->alarm[i] > 0.0 ? VG_ALARM : 0)
                      | (!(all->comfort[i] <= 1.0) ? VG_UNCOMFORTABLE : 0)
                      | (!(all->hard[i] <= 1.0) || !vg_finite(costs[i]) ? VG_INFEASIBLE : 0));
    }
}
