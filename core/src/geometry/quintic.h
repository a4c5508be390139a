/// The smoothest connection of two states of one axis: of all curves that meet position, velocity
/// and acceleration at both ends, the polynomial of degree five has the least integral of squared
/// jerk (Takahashi et al. 1989; section 3.2.1 of the paper). The argument is time, or distance if
/// lateral motion is planned as d(s). Units below are those of time.
#ifndef VG_QUINTIC_H
#define VG_QUINTIC_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_axis_state {
    double position;     ///< [m]
    double velocity;     ///< [m/s]
    double acceleration; ///< [m/s^2]
} vg_axis_state;

/// c[0] + c[1] t + ... + c[5] t^5.
typedef struct vg_quintic {
    double c[6];
} vg_quintic;

/// Value and derivatives at one instant.
typedef struct vg_axis_sample {
    double position;     ///< [m]
    double velocity;     ///< [m/s]
    double acceleration; ///< [m/s^2]
    double jerk;         ///< [m/s^3]
} vg_axis_sample;

/// The polynomial from start at t = 0 to end at t = duration > 0.
vg_quintic vg_quintic_between(vg_axis_state start, vg_axis_state end, double duration);

static inline vg_axis_sample vg_quintic_at(const vg_quintic* q, double t)
{
    const double* c = q->c;
    vg_axis_sample at;
    at.position = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))));
    at.velocity = c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])));
    at.acceleration = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]));
    at.jerk = 6.0 * c[3] + t * (24.0 * c[4] + t * 60.0 * c[5]);
    return at;
}

#ifdef __cplusplus
}
#endif

#endif
