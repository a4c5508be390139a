/// The floating-point mode that plans require: rounding to nearest, subnormal numbers kept.
///
/// A shared library built with -Ofast or -ffast-math changes this mode for the thread that loads it
/// and for all threads started from it. Plans would then differ in single bits from those of other
/// machines.
#ifndef VERGE_APPS_FLOATING_H
#define VERGE_APPS_FLOATING_H

#include <stdbool.h>

/// Sets the mode of the calling thread. True: the mode was wrong. Takes a few nanoseconds.
bool floating_correct(void);

#endif
