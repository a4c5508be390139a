/// Scalar mathematics with one result everywhere. The functions of libm differ in the last bit
/// between machines, between libraries, and between CPUs of one machine (glibc chooses by CPU at
/// run time). The core uses + - * / and sqrt only, which are the same everywhere, and the functions
/// below, each within 2 ulp or 2e-16 of the true value.
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
/// Neither NaN nor infinite. With -ffinite-math-only this would always be true; the flags of core
/// exclude it.
static inline bool vg_finite(double x) { return x - x == 0.0; }
/// Time from one instant [us] to another [s]; +-VG_HUGE if the difference does not fit 64 bits.
static inline double vg_seconds_between(int64_t from, int64_t to)
{
    int64_t us = 0;
    if (__builtin_sub_overflow(to, from, &us)) {
        return to > from ? VG_HUGE : -VG_HUGE;
    }
    return (double)us * 1e-6;
}
/// Number of elements in a set.
static inline uint32_t vg_bits(uint64_t set)
{
    uint32_t count = 0;
    for (; set != 0; set &= set - 1u) {
        ++count;
    }
    return count;
}
/// The same angle in (-pi, pi]. x: any finite number.
double vg_wrap_angle(double x);

#ifdef __cplusplus
}
#endif

#endif
