/// Numbers that a message can hold.
#ifndef VG_SINGLE_H
#define VG_SINGLE_H

#include "base/scalar.h"

/// Beyond it a time is no time of a plan, and its milliseconds need not fit an integer. [s]
#define VG_TIME_MAX 1e4

/// To single precision. A number too large for it stays: the message would hold none at all.
static inline double vg_single(double x)
{
    return vg_abs(x) <= 1e30 ? (double)(float)x : x;
}

/// A time within 0 .. VG_TIME_MAX [s] to whole milliseconds, upwards: a decision as long as a
/// trajectory stays as long. One that is a whole number but for the last bits stays this number.
static inline double vg_whole_milliseconds(double t)
{
    if (!(t >= 0.0 && t <= VG_TIME_MAX)) {
        return t;
    }
    const double ms = t * 1000.0 - 1e-7;
    int32_t whole = (int32_t)ms;
    whole += (double)whole < ms ? 1 : 0;
    return (double)whole / 1000.0;
}

#endif
