/// See batch.h. One profile, eight end offsets, all instants: the line is looked up once for
/// the profile, everything per candidate is arithmetic on arrays of eight without branches.
///
/// A pair (instant, track) is skipped for all eight where a box that holds everything the eight
/// bodies, their alert zones and their motion of the last step can reach cannot meet the other
/// body: for a skipped pair cost and alarm are exactly zero, so pruning changes no result.
#include "motion/batch.h"

#include "base/contract.h"
#include "motion/trailer.h"

typedef struct lanes {
    double offset[VG_LANES];
    double x[VG_LANES], y[VG_LANES], c[VG_LANES], s[VG_LANES];         // centre, heading
    double x0[VG_LANES], y0[VG_LANES];  // one instant before
    double speed[VG_LANES], swing[VG_LANES];                           // swing: of a corner, [m]
    double hard[VG_LANES], comfort[VG_LANES], alarm[VG_LANES];
    double curvature[VG_LANES], heading[VG_LANES], offsets[VG_LANES];
    double acceleration[VG_LANES], jerk[VG_LANES], obstacle[VG_LANES];
} lanes;

/// What all eight can reach, in the line's frame at its point. [m], [m/s]
typedef struct envelope {
    double ahead_min, ahead_max, left_min, left_max; // of the bodies' centres, now and before
    double slant;   // [1] largest |sine| of a heading against the line
    double speed;   // largest
    double swing;
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
} scene;

static void lanes_begin(lanes* l, const vg_row* row, const double* offsets, double rear_axle);
static envelope lanes_move(lanes* restrict l, const vg_row* row, const scene* scene);
static other other_at(const verge_track* track, uint32_t k);
static bool out_of_reach(const envelope* e, const vg_reference* line, const scene* scene,
                         const other* o);
static void lanes_meet(lanes* restrict l, const scene* scene, const other* o);
static void lanes_end(const lanes* l, const verge_weights* weights, bool in_lane, double* costs,
                      uint8_t* marks);

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
    VERGE_ASSERT(batch->offset_count % VG_LANES == 0);
    VERGE_ASSERT(batch->last < VERGE_POINTS_MAX && batch->start < batch->last);
    const vg_limits* limits = batch->legs[0].limits;
    const scene scene = { vg_alert_zone_of(def, &tracks->of[own], limits->rear_axle),
                          def->clearance, &batch->comfort, limits };
    const uint32_t trailer = vg_trailer_of(tracks, own);
    vg_row rows[VERGE_POINTS_MAX];
    for (uint32_t p = 0; p < batch->leg_count; p += 1) {
        for (uint32_t k = batch->start; k <= batch->last; k += 1) {
            rows[k] = vg_leg_row(&batch->legs[p], def->point_s * (k - batch->start));
        }
        for (uint32_t i = 0; i < batch->offset_count; i += VG_LANES) {
            lanes l;
            lanes_begin(&l, &rows[batch->start], batch->offsets + i, limits->rear_axle);
            for (uint32_t k = batch->start + 1; k <= batch->last; k += 1) {
                const envelope e = lanes_move(&l, &rows[k], &scene);
                for (uint32_t j = 0; j < tracks->count; j += 1) {
                    const other o = other_at(&tracks->of[j], k);
                    if (j != own && j != trailer && !out_of_reach(&e, &rows[k].line, &scene, &o)) {
                        lanes_meet(&l, &scene, &o);
                    }
                }
            }
            const uint32_t at = p * batch->offset_count + i;
            for (uint32_t k = 0; limits->has_trailer && k < VG_LANES; k += 1) {
                l.alarm[k] = 1.0; // where the trailer goes, only the exact check knows
            }
            lanes_end(&l, weights, batch->in_lane, batch->costs + at, batch->marks + at);
        }
    }
}

static void lanes_begin(lanes* l, const vg_row* row, const double* offsets, double rear_axle)
{
    *l = (lanes){ 0 };
    for (uint32_t i = 0; i < VG_LANES; i += 1) {
        const vg_rear rear = vg_rear_of(row, offsets[i]);
        l->offset[i] = offsets[i];
        l->c[i] = rear.cos_heading;
        l->s[i] = rear.sin_heading;
        l->x[i] = rear.x + rear_axle * rear.cos_heading;
        l->y[i] = rear.y + rear_axle * rear.sin_heading;
    }
}

/// On to the next instant: motion, limits and all cost terms but that of the obstacles.
static envelope lanes_move(lanes* restrict l, const vg_row* row, const scene* scene)
{
    const vg_row now = *row;
    const vg_comfort comfort = *scene->comfort;
    const vg_limits limits = *scene->limits;
    const double radius = scene->zone.half_length + scene->zone.half_width;
    double ahead[VG_LANES], left[VG_LANES], ahead0[VG_LANES], left0[VG_LANES], slant[VG_LANES];
    for (uint32_t i = 0; i < VG_LANES; i += 1) {
        const vg_rear rear = vg_rear_of(&now, l->offset[i]);
        const double x0 = l->x[i], y0 = l->y[i], c0 = l->c[i], s0 = l->s[i];
        const double c = rear.cos_heading, s = rear.sin_heading;
        l->x0[i] = x0;
        l->y0[i] = y0;
        l->c[i] = c;
        l->s[i] = s;
        l->x[i] = rear.x + limits.rear_axle * c;
        l->y[i] = rear.y + limits.rear_axle * s;
        l->speed[i] = rear.speed;
        l->swing[i] = radius * (vg_abs(c - c0) + vg_abs(s - s0));
        l->hard[i] = vg_max(l->hard[i], vg_hard_ratio(&limits, &rear, now.s_t));
        l->comfort[i] = vg_max(l->comfort[i], vg_comfort_ratio(&comfort, &rear));
        l->curvature[i] += rear.curvature * rear.curvature;
        l->heading[i] += vg_heading_square(rear.cos_off, rear.sin_off);
        l->offsets[i] += rear.d * rear.d;
        l->acceleration[i] += rear.acceleration * rear.acceleration;
        l->jerk[i] += rear.jerk * rear.jerk;
        const double x = x0 - now.line.x, y = y0 - now.line.y;
        ahead[i] = limits.rear_axle * rear.cos_off;
        left[i] = rear.d + limits.rear_axle * rear.sin_off;
        ahead0[i] = x * now.line.cos_heading + y * now.line.sin_heading;
        left0[i] = y * now.line.cos_heading - x * now.line.sin_heading;
        slant[i] = vg_abs(rear.sin_off);
    }
    envelope e = { ahead[0], ahead[0], left[0], left[0], 0.0, 0.0, 0.0 };
    for (uint32_t i = 0; i < VG_LANES; i += 1) {
        e.ahead_min = vg_min(e.ahead_min, vg_min(ahead[i], ahead0[i]));
        e.ahead_max = vg_max(e.ahead_max, vg_max(ahead[i], ahead0[i]));
        e.left_min = vg_min(e.left_min, vg_min(left[i], left0[i]));
        e.left_max = vg_max(e.left_max, vg_max(left[i], left0[i]));
        e.slant = vg_max(e.slant, slant[i]);
        e.speed = vg_max(e.speed, l->speed[i]);
        e.swing = vg_max(e.swing, l->swing[i]);
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

/// Conservative: every length below bounds what lanes_meet() measures, in the line's frame.
static bool out_of_reach(const envelope* e, const vg_reference* line, const scene* scene,
                         const other* o)
{
    const double c = line->cos_heading, s = line->sin_heading;
    const double x = o->x - line->x, y = o->y - line->y;
    const double ahead = x * c + y * s, left = y * c - x * s;
    const double move_ahead = vg_abs(o->dx * c + o->dy * s);
    const double move_left = vg_abs(o->dy * c - o->dx * s);
    const double along = o->c * c + o->s * s, across = vg_abs(o->s * c - o->c * s);

    // D_s with the least speed the other can have along a heading that is off by the slant.
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

/// Obstacle cost and collision alarm of one track. The alarm is a swept test on the two axes of
/// the own body: on the way from the instant before, do the shadows on both axes meet?
static inline void meet(lanes* restrict l, const scene* scene, const other* track,
                        bool continuous)
{
    const other o = *track;
    vg_alert_zone zone = scene->zone;
    zone.continuous = continuous;
    const double guard = scene->clearance + o.swing;
    for (uint32_t i = 0; i < VG_LANES; i += 1) {
        const double c = l->c[i], s = l->s[i];
        const double x = o.x - l->x[i], y = o.y - l->y[i];
        const double ahead = x * c + y * s, left = y * c - x * s;
        const double along = o.c * c + o.s * s, across = vg_abs(o.s * c - o.c * s);
        const double reach_ahead = o.half_length * vg_abs(along) + o.half_width * across;
        const double reach_left = o.half_length * across + o.half_width * vg_abs(along);
        l->obstacle[i] += vg_alert_term(&zone, ahead, left, reach_ahead, reach_left, l->speed[i],
                                        o.speed * along);

        const double dx = 0.5 * (o.dx - (l->x[i] - l->x0[i]));
        const double dy = 0.5 * (o.dy - (l->y[i] - l->y0[i]));
        const double half_ahead = dx * c + dy * s, half_left = dy * c - dx * s;
        const double free = guard + l->swing[i];
        const double gap_ahead = vg_abs(ahead - half_ahead) - vg_abs(half_ahead) - reach_ahead
                               - zone.half_length - free;
        const double gap_left = vg_abs(left - half_left) - vg_abs(half_left) - reach_left
                              - zone.half_width - free;
        l->alarm[i] = vg_max(gap_ahead, gap_left) <= 0.0 ? 1.0 : l->alarm[i];
    }
}

static void lanes_meet(lanes* restrict l, const scene* scene, const other* o)
{
    if (scene->zone.continuous) {
        meet(l, scene, o, true);
    } else {
        meet(l, scene, o, false);
    }
}

static void lanes_end(const lanes* l, const verge_weights* weights, bool in_lane, double* costs,
                      uint8_t* marks)
{
    for (uint32_t i = 0; i < VG_LANES; i += 1) {
        costs[i] = weights->curvature * l->curvature[i] + weights->heading * l->heading[i]
                 + weights->offset * (in_lane ? l->offsets[i] : 0.0)
                 + weights->acceleration * l->acceleration[i] + weights->jerk * l->jerk[i]
                 + weights->obstacle * l->obstacle[i];
        // Negated comparisons: what is not a number is infeasible.
        marks[i] = (uint8_t)((l->alarm[i] > 0.0 ? VG_ALARM : 0)
                             | (!(l->comfort[i] <= 1.0) ? VG_UNCOMFORTABLE : 0)
                             | (!(l->hard[i] <= 1.0) || !vg_finite(costs[i]) ? VG_INFEASIBLE : 0));
    }
}
