/// See floating.h.
#include "floating.h"

#include <stdint.h>

#if defined(__x86_64__)

#include <xmmintrin.h>

/// MXCSR: all exceptions masked, rounding to nearest, no flush to zero, subnormals are not zeros.
/// Its lower six bits are status flags.
enum { MODE = 0x1f80, MODE_BITS = 0xffc0 };

bool floating_correct(void)
{
    const unsigned now = _mm_getcsr();
    if ((now & MODE_BITS) == MODE) {
        return false;
    }
    _mm_setcsr(MODE);
    return true;
}

#elif defined(__aarch64__)

/// FPCR: rounding mode, flush to zero (also of halves), default NaN, traps and the alternative
/// behaviours: all zero.
bool floating_correct(void)
{
    uint64_t now;
    __asm__ volatile("mrs %0, fpcr" : "=r"(now));
    if (now == 0) {
        return false;
    }
    __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)0));
    return true;
}

#else

#include <fenv.h>

bool floating_correct(void)
{
    if (fegetround() == FE_TONEAREST) {
        return false;
    }
    fesetround(FE_TONEAREST);
    return true;
}

#endif
