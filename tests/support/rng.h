/// Random inputs for tests: a seed a failure can be repeated from, and how many rounds to run.
///
///     test_rng rng = test_rng_seeded("quintic");   // prints the seed it took
///     for (uint32_t i = 0; i < test_rounds(1000); ++i) {
///         const double d = test_rng_between(&rng, -5.0, 5.0); ...
///
/// The seed is 1 unless the environment's VERGE_TEST_SEED names another one.
/// The rounds are the usual number times VERGE_TEST_SCALE: tools/check uses less under valgrind
/// and more with --long.
#ifndef TEST_RNG_H
#define TEST_RNG_H

#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct test_rng {
    uint64_t state;
} test_rng;

/// Any seed. For tests that loop over seeds and print the one that fails.
static inline test_rng test_rng_from(uint64_t seed)
{
    const test_rng rng = {seed};
    return rng;
}

/// The seed of this run, printed with the name of what it is for.
static inline test_rng test_rng_seeded(const char* name)
{
    const char* text = getenv("VERGE_TEST_SEED");
    const uint64_t seed = text != NULL ? strtoull(text, NULL, 0) : 1;
    printf("             %s: VERGE_TEST_SEED=%" PRIu64 "\n", name, seed);
    return test_rng_from(seed);
}

/// splitmix64 (Steele, Lea, Flood 2014): every seed is good, every stream is 2^64 long.
static inline uint64_t test_rng_next(test_rng* rng)
{
    uint64_t z = (rng->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/// [0, 1)
static inline double test_rng_unit(test_rng* rng)
{
    return (double)(test_rng_next(rng) >> 11) * 0x1p-53;
}

/// [low, high)
static inline double test_rng_between(test_rng* rng, double low, double high)
{
    return low + (high - low) * test_rng_unit(rng);
}

/// 0 .. count - 1. The bias of the remainder does not matter to a test.
static inline uint32_t test_rng_below(test_rng* rng, uint32_t count)
{
    return (uint32_t)(test_rng_next(rng) % count);
}

/// How many rounds to run where usual is right for an everyday build. At least 1.
static inline uint32_t test_rounds(uint32_t usual)
{
    const char* text = getenv("VERGE_TEST_SCALE");
    const double scale = text != NULL ? strtod(text, NULL) : 1.0;
    const double rounds = (double)usual * scale;
    return rounds >= 1.0 && rounds <= 4e9 ? (uint32_t)rounds : 1;
}

/// Are the rounds the usual number at least? Then every kind of case must have been met.
static inline bool test_rounds_suffice(void)
{
    return test_rounds(1000) >= 1000;
}

#endif
