/// The cost of a trajectory (section 3.2.3, Eq. 7 to 9): sums over its points, without the point at
/// t = 0, which is the same for all candidates. Curvature, acceleration and jerk are those of the
/// rear axle; the alert zone lies around the body.
#ifndef VG_COST_H
#define VG_COST_H

#include "motion/kinematics.h"
#include "verge/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The alert zone of one body (Fig. 6): D_s ahead of it, 1.5 body lengths behind, 1.5 body
/// widths wide.
typedef struct vg_alert_zone {
    double half_length, half_width;  ///< [m] of the body
    double rear_axle;                ///< [m] behind the body's centre
    double reaction_s, headway_s;    ///< [s] tau and MTH of Eq. 2
    double cost;                     ///< C_z
    bool   continuous;               ///< the variant that is 0 at the zone's edge
} vg_alert_zone;

/// Smallest distance of the edge of the zone in the continuous variant. [m]
#define VG_ALERT_EDGE_MIN 0.5

/// J_obs(t, j) of one other body at one instant. (ahead, left) is its centre in the frame of the
/// own body, (reach_ahead, reach_left) the half sides of the box in that frame that holds it,
/// other_speed its speed along the own heading. A body that touches costs as much as one at
/// distance 0; the collision check rejects it.
static inline double vg_alert_term(const vg_alert_zone* zone, double ahead, double left,
                                   double reach_ahead, double reach_left, double speed,
                                   double other_speed)
{
    const double length = 2.0 * zone->half_length, width = 2.0 * zone->half_width;
    const double safe = vg_max(0.0, speed * zone->reaction_s
                                        + zone->headway_s * (speed - other_speed)); // Eq. 2
    const double dx = vg_max(0.0, vg_abs(ahead) - zone->half_length - reach_ahead);
    const double dy = vg_max(0.0, vg_abs(left) - zone->half_width - reach_left);
    const double edge_x = ahead > 0.0 ? safe : 1.5 * length;
    const double edge_y = 0.25 * width;
    if (zone->continuous) {
        const double near_x = vg_max(0.0, 1.0 - dx / vg_max(edge_x, VG_ALERT_EDGE_MIN));
        const double near_y = vg_max(0.0, 1.0 - dy / edge_y);
        return 2.0 * zone->cost * near_x * near_y;
    }
    const double near = 2.0 - dx / (safe + 1.5 * length) - dy / (1.5 * width);
    const double inside_x = dx <= edge_x ? zone->cost : 0.0;
    const double inside_y = dy <= edge_y ? 1.0 : 0.0;
    return inside_x * inside_y * near;
}

/// Square of the heading difference [rad^2] whose cosine and sine these are. Four terms of the
/// arc tangent of the half angle: within 1e-6 up to 1 rad.
static inline double vg_heading_square(double cosine, double sine)
{
    const double h = sine / (1.0 + cosine);
    const double u = h * h;
    const double atan = 1.0 - u * (1.0 / 3.0 - u * (1.0 / 5.0 - u * (1.0 / 7.0
                        - u * (1.0 / 9.0 - u * (1.0 / 11.0 - u * (1.0 / 13.0))))));
    return 4.0 * u * atan * atan;
}

/// J_obs(t, j) for the motion of a body and a track at instant `index`, in the simple form.
double vg_alert_cost(const vg_alert_zone* zone, const vg_rear* rear, const verge_track* other,
                     uint32_t index);

vg_alert_zone vg_alert_zone_of(const verge_planner_def* def, const verge_track* own,
                               double rear_axle);

/// Weighted cost of one leg at instants first .. last (indices of the trajectory, leg time 0 at
/// `start`), one point and one track after the other. in_lane: the offset term is active,
/// and measured from `aim` [m].
verge_cost vg_leg_cost(const vg_leg* leg, double offset, uint32_t start, uint32_t last,
                       const verge_planner_def* def, const verge_weights* weights,
                       const verge_tracks* tracks, uint32_t own, bool in_lane, double aim);

/// The same of a whole trajectory that is given as the motion of its rear axle at each point.
verge_cost vg_motion_cost(const vg_rear* motion, double rear_axle, const verge_planner_def* def,
                          const verge_weights* weights, const verge_tracks* tracks, uint32_t own);

#ifdef __cplusplus
}
#endif

#endif
