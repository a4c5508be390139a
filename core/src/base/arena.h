/// An arena gives out parts of one block of memory, from front to back. `arena` lives as long as
/// the planner and is sealed after init; `scratch` is emptied at the start of each step.
///
/// A measuring arena (base null) gives out null and only adds up sizes. So the code that builds a
/// structure also computes its size.
#ifndef VG_ARENA_H
#define VG_ARENA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vg_arena {
    uint8_t* base;   ///< 64-byte aligned; null: measuring
    size_t   size;   ///< [B]
    size_t   used;   ///< [B]
    size_t   peak;   ///< [B]
    bool     sealed; ///< nothing more may be taken
    bool     failed; ///< a request did not fit
} vg_arena;

/// Every allocation starts on its own cache line.
#define VG_ARENA_ALIGN 64u

void  vg_arena_init(vg_arena* arena, void* base, size_t size);
/// The same for memory of a caller. False: it is null or not aligned to VG_ARENA_ALIGN.
bool  vg_arena_begin(vg_arena* arena, void* memory, size_t size);
/// Zeroed memory, or null if it does not fit (arena->failed) or the arena is measuring.
void* vg_arena_take(vg_arena* arena, size_t size);
void  vg_arena_empty(vg_arena* arena);
/// Memory that is used twice: `again` is a copy of the arena from which other things were taken
/// since. The arena goes on behind both.
void  vg_arena_join(vg_arena* arena, const vg_arena* again);

#ifdef __cplusplus
}
#endif

#endif
