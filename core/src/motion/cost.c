/// See cost.h. This is the simple form. batch.c is the fast form for eight candidates at a time; a
/// test compares both.
#include "motion/cost.h"
#include "base/contract.h"
#include "motion/trailer.h"

vg_alert_zone vg_alert_zone_of(const verge_planner_def* def, const verge_track* own,
                               double rear_axle)
{
    return (vg_alert_zone){ own->half_length, own->half_width, rear_axle, def->reaction_s,
                            def->headway_s, def->alert_cost, def->alert_continuous != 0 };
}

double vg_alert_cost(const vg_alert_zone* zone, const vg_rear* rear, const verge_track* other,
                     uint32_t index)
{
    const double c = rear->cos_heading, s = rear->sin_heading;
    const double x = other->x[index] - (rear->x + zone->rear_axle * c);
    const double y = other->y[index] - (rear->y + zone->rear_axle * s);
    const double other_c = other->cos_heading[index], other_s = other->sin_heading[index];
    const double along = other_c * c + other_s * s, across = other_s * c - other_c * s;
    const double reach_x = other->half_length * vg_abs(along) + other->half_width * vg_abs(across);
    const double reach_y = other->half_length * vg_abs(across) + other->half_width * vg_abs(along);
    return vg_alert_term(zone, x * c + y * s, y * c - x * s, reach_x, reach_y, rear->speed,
                         other->speed[index] * along);
}

/// What the terms of one trajectory need.
typedef struct paying {
    vg_alert_zone       zone;
    const verge_tracks* tracks;
    uint32_t            own, trailer;
    bool                in_lane;
    double              aim;
} paying;

static paying paying_for(const verge_planner_def* def, const verge_tracks* tracks, uint32_t own,
                         double rear_axle, bool in_lane, double aim)
{
    VERGE_ASSERT(own < tracks->count);
    return (paying){ vg_alert_zone_of(def, &tracks->of[own], rear_axle), tracks, own,
                     vg_trailer_of(tracks, own), in_lane, aim };
}

static void add_point(verge_cost* cost, const paying* self, const vg_rear* rear, uint32_t k)
{
    cost->curvature += vg_square(rear->curvature);
    cost->heading += vg_heading_square(rear->cos_off, rear->sin_off);
    cost->offset += self->in_lane ? vg_square(rear->d - self->aim) : 0.0;
    cost->acceleration += vg_square(rear->acceleration);
    cost->jerk += vg_square(rear->jerk);
    for (uint32_t j = 0; j < self->tracks->count; ++j) {
        cost->obstacle += j == self->own || j == self->trailer
                              ? 0.0
                              : vg_alert_cost(&self->zone, rear, &self->tracks->of[j], k);
    }
}

static void weigh(verge_cost* cost, const verge_weights* weights)
{
    cost->curvature *= weights->curvature;
    cost->heading *= weights->heading;
    cost->offset *= weights->offset;
    cost->acceleration *= weights->acceleration;
    cost->jerk *= weights->jerk;
    cost->obstacle *= weights->obstacle;
    cost->total = cost->curvature + cost->heading + cost->offset + cost->acceleration + cost->jerk
                + cost->obstacle;
}

verge_cost vg_leg_cost(const vg_leg* leg, double offset, uint32_t start, uint32_t last,
                       const verge_planner_def* def, const verge_weights* weights,
                       const verge_tracks* tracks, uint32_t own, bool in_lane, double aim)
{
    VERGE_ASSERT(start < last && last < VERGE_POINTS_MAX);
    const paying all = paying_for(def, tracks, own, leg->limits->rear_axle, in_lane, aim);
    verge_cost cost = { 0 };
    for (uint32_t k = start + 1; k <= last; ++k) {
        const vg_row row = vg_leg_row(leg, def->point_s * (k - start));
        const vg_rear rear = vg_rear_of(&row, offset);
        add_point(&cost, &all, &rear, k);
    }
    weigh(&cost, weights);
    return cost;
}

verge_cost vg_motion_cost(const vg_rear* motion, double rear_axle, const verge_planner_def* def,
                          const verge_weights* weights, const verge_tracks* tracks, uint32_t own)
{
    const paying all = paying_for(def, tracks, own, rear_axle, true, 0.0);
    verge_cost cost = { 0 };
    for (uint32_t k = 1; k < def->points; ++k) {
        add_point(&cost, &all, &motion[k], k);
    }
    weigh(&cost, weights);
    return cost;
}
