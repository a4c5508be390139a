/// Scalar mathematics with one result everywhere. libm differs between machines (and, by its
/// run-time dispatch, between CPUs of one machine); the core uses + - * / and sqrt only, and the
/// four functions below, each within 2 ulp or 2e-16 of the true value (findings/reliability.md).
#ifndef VG_SCALAR_H
#define VG_SCALAR_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VG_PI 3.14159265358979323846
#define VG_HUGE 1e30

double vg_sin(double x);   ///< |x| <= 1e6
double vg_cos(double x);   ///< |x| <= 1e6
void   vg_sincos(double x, double* sine, double* cosine);
double vg_atan2(double y, double x); ///< in (-pi, pi]; atan2(0, 0) = 0
double vg_log(double x);   ///< x > 0

static inline double vg_sqrt(double x)
{
    return __builtin_sqrt(x); // one instruction with -fno-math-errno, correctly rounded everywhere
}
static inline double vg_abs(double x) { return x < 0.0 ? -x : x; }
static inline double vg_min(double a, double b) { return a < b ? a : b; }
static inline double vg_max(double a, double b) { return a > b ? a : b; }
static inline double vg_clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}
static inline double vg_square(double x) { return x * x; }
/// Neither NaN nor infinite; survives -ffinite-math because it looks at the bits' effect only.
static inline bool vg_finite(double x) { return x - x == 0.0; }
/// Into (-pi, pi]. |x| <= 1e6.
double vg_wrap_angle(double x);

#ifdef __cplusplus
}
#endif

#endif
