/// The floating-point mode that plans depend on: rounding to nearest, subnormal numbers kept.
///
/// Any shared library built with -Ofast or -ffast-math switches it off for the thread that loads
/// it, and every thread started from there inherits that. Plans would then differ in a bit here and
/// there from every other machine's.
#ifndef VERGE_APPS_FLOATING_H
#define VERGE_APPS_FLOATING_H

#include <stdbool.h>

/// Is the calling thread in that mode? If not, it is from here on. True: it had to be corrected.
/// Costs a few nanoseconds.
bool floating_correct(void);

#endif
