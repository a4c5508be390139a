#include "base/arena.h"

#include "base/contract.h"

#include <string.h>

void vg_arena_init(vg_arena* arena, void* base, size_t size)
{
    VERGE_ASSERT(arena != NULL);
    VERGE_ASSERT((uintptr_t)base % VG_ARENA_ALIGN == 0);

    *arena = (vg_arena){ .base = base, .size = base == NULL ? 0 : size };
}

bool vg_arena_begin(vg_arena* arena, void* memory, size_t size)
{
    if (memory == NULL || (uintptr_t)memory % VG_ARENA_ALIGN != 0) {
        return false;
    }
    vg_arena_init(arena, memory, size);
    return true;
}

void* vg_arena_take(vg_arena* arena, size_t size)
{
    VERGE_ASSERT(arena != NULL);
    VERGE_ASSERT(!arena->sealed);

    // Rounded up so that the next one starts on a cache line; size 0 takes nothing.
    const size_t limit = arena->base == NULL ? SIZE_MAX : arena->size;
    const size_t padded = (size + (VG_ARENA_ALIGN - 1)) & ~(size_t)(VG_ARENA_ALIGN - 1);
    if (padded < size || padded > limit - arena->used) {
        arena->failed = true;
        return NULL;
    }
    const size_t at = arena->used;
    arena->used += padded;
    if (arena->used > arena->peak) {
        arena->peak = arena->used;
    }
    if (arena->base == NULL) {
        return NULL;
    }
    return memset(arena->base + at, 0, padded);
}

void vg_arena_join(vg_arena* arena, const vg_arena* again)
{
    VERGE_ASSERT(arena != NULL && !arena->sealed);
    VERGE_ASSERT(again->base == arena->base);
    arena->used = again->used > arena->used ? again->used : arena->used;
    arena->peak = again->peak > arena->peak ? again->peak : arena->peak;
    arena->failed = arena->failed || again->failed;
}

void vg_arena_empty(vg_arena* arena)
{
    VERGE_ASSERT(arena != NULL);
    VERGE_ASSERT(!arena->sealed);
    arena->used = 0;
}
