/// The random generator: PCG-XSH-RR 64/32 (O'Neill 2014), the same on every machine.
#ifndef VG_RANDOM_H
#define VG_RANDOM_H

#include <stdint.h>

typedef struct vg_random {
    uint64_t state;
    uint64_t increment; ///< odd
} vg_random;

static inline uint32_t vg_random_next(vg_random* random)
{
    const uint64_t old = random->state;
    random->state = old * 6364136223846793005u + random->increment;
    const uint32_t shifted = (uint32_t)(((old >> 18) ^ old) >> 27);
    const uint32_t rotation = (uint32_t)(old >> 59);
    return (shifted >> rotation) | (shifted << ((32u - rotation) & 31u));
}

/// Distinct (seed, stream) pairs give independent sequences.
static inline vg_random vg_random_from(uint64_t seed, uint64_t stream)
{
    vg_random random = { .state = 0, .increment = (stream << 1) | 1u };
    (void)vg_random_next(&random);
    random.state += seed;
    (void)vg_random_next(&random);
    return random;
}

/// A number in [0, bound), bound <= 2^16: uniform to 2^-16, one multiplication, no rejection.
static inline uint32_t vg_random_below(vg_random* random, uint32_t bound)
{
    return (uint32_t)(((uint64_t)vg_random_next(random) * bound) >> 32);
}

#endif
