/// The start fixes the three lower coefficients, a parabola. The three upper coefficients make up
/// the difference at the end: three equations for three unknowns, with the duration as unit of
/// time.
#include "geometry/quintic.h"

#include "geometry/linear.hpp"

vg_quintic vg_quintic_between(vg_axis_state start, vg_axis_state end, double duration)
{
    VERGE_ASSERT(duration > 0.0);
    const double t = duration;
    const double position = end.position - start.position
                            - (start.velocity + 0.5 * start.acceleration * t) * t;
    const double velocity = (end.velocity - start.velocity - start.acceleration * t) * t;
    const double acceleration = (end.acceleration - start.acceleration) * t * t;

    Matrix3d at_end; // of u^3, u^4, u^5 and their derivatives, at u = 1
    at_end << 1.0, 1.0, 1.0,
              3.0, 4.0, 5.0,
              6.0, 12.0, 20.0;
    const Matrix3d solution = at_end.inverse(); // exact: integers over a determinant of 2
    const Vector3d upper = solution.col(0) * position + solution.col(1) * velocity
                           + solution.col(2) * acceleration;

    const double t3 = t * t * t;
    return vg_quintic{{start.position, start.velocity, 0.5 * start.acceleration,
                       upper[0] / t3, upper[1] / (t3 * t), upper[2] / (t3 * t * t)}};
}
