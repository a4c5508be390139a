/// (s, d) to (x, y, heading, ...) and back: Eq. 6 and its derivatives, Werling et al. 2010 in
/// closed form up to curvature and acceleration. Exact for the point whose motion is described
/// (the rear axle in the sampler). Needs 1 - curvature_r * d > 0.
#ifndef VG_FRENET_H
#define VG_FRENET_H

#include "road.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The reference line at one coordinate.
typedef struct vg_reference {
    double x, y;                     ///< [m]
    double cos_heading, sin_heading; ///< [1]
    double curvature;                ///< [1/m]
    double curvature_rate;           ///< [1/m^2] d curvature / ds
} vg_reference;

/// Motion along the line, derivatives in time.
typedef struct vg_frenet {
    double s, s_t, s_tt;
    double d, d_t, d_tt;
} vg_frenet;

/// Motion in the plane.
typedef struct vg_motion {
    double x, y, heading;  ///< [m], [m], [rad]
    double speed;          ///< [m/s] >= 0
    double acceleration;   ///< [m/s^2] along the path
    double curvature;      ///< [1/m]
} vg_motion;

vg_reference vg_path_at(const vg_path* path, double s);
vg_reference vg_lane_at(const vg_lane* lane, double s); ///< straight on beyond the ends

/// Coordinate of the point of the line nearest to (x, y), searched around s_guess (global coarse
/// search where s_guess is NaN), then refined to 1e-12. Linear beyond the ends.
double vg_path_project(const vg_path* path, double x, double y, double s_guess);
double vg_lane_project(const vg_lane* lane, double x, double y, double s_guess);

/// At standstill (speed < 1e-9) s_t = d_t = 0; s_tt and d_tt are the acceleration along
/// the heading.
vg_frenet vg_frenet_from_motion(const vg_reference* at, double s, const vg_motion* motion);
/// Where speed < 1e-6 heading and curvature come from heading_slow and are 0.
vg_motion vg_motion_from_frenet(const vg_reference* at, const vg_frenet* frenet,
                                double heading_slow);

/// The centre's motion from the rear axle's and back; see VERGE_REAR_AXLE. curvature is yaw rate
/// over speed of the point in question. The centre's acceleration needs the curvature's rate in
/// time [1/(m s)] of the rear axle, to be exact. The way back takes that rate as 0, and limits
/// the curvature to what a car can turn. heading is that of the body in both.
vg_motion vg_motion_of_centre(const vg_motion* rear, double curvature_t);
vg_motion vg_motion_of_rear(const vg_motion* centre);

#ifdef __cplusplus
}
#endif

#endif
