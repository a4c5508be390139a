/// Allocation that ends the program if memory runs out, because partial results are not usable.
#ifndef VERGE_EXPERIMENT_MUST_H
#define VERGE_EXPERIMENT_MUST_H

#include <stdio.h>
#include <stdlib.h>

static inline void* must(void* memory)
{
    if (memory == NULL) {
        fputs("verge-experiment:memory: there is not enough of it\n", stderr);
        exit(1);
    }
    return memory;
}

/// Zeroed.
static inline void* must_calloc(size_t count, size_t size)
{
    return must(calloc(count + 1, size)); // one more: never zero bytes
}

static inline void* must_realloc(void* memory, size_t size)
{
    return must(realloc(memory, size + 1));
}

#endif
