/// LD_PRELOAD this to change the floating-point mode of a program as a badly built library would:
/// at its start or, with ROUNDING_LATE set, in any thread each time it has waited for a semaphore.
/// Rounding goes up and subnormal numbers are lost.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <semaphore.h>
#include <stdlib.h>

static void spoil(void)
{
    fesetround(FE_UPWARD);
#if defined(__x86_64__)
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040u);
#endif
}

__attribute__((constructor)) static void at_start(void)
{
    if (getenv("ROUNDING_LATE") == NULL) {
        spoil();
    }
}

int sem_wait(sem_t* semaphore)
{
    int (*real)(sem_t*) = (int (*)(sem_t*))dlsym(RTLD_NEXT, "sem_wait");
    const int result = real(semaphore);
    if (getenv("ROUNDING_LATE") != NULL) {
        spoil();
    }
    return result;
}
