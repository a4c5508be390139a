/// Memory handed out front to back. Two lives: `arena` as long as the planner, sealed after
/// init; `scratch` emptied at the top of each step.
///
/// A measuring arena (base null) hands out nothing but counts, so the code that builds a
/// structure and the code that sizes it are the same code.
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
    bool     sealed; ///< no more after this
    bool     failed; ///< something did not fit
} vg_arena;

/// Every allocation starts on its own cache line.
#define VG_ARENA_ALIGN 64u

void  vg_arena_init(vg_arena* arena, void* base, size_t size);
/// The same for memory from outside; false where it is null or not aligned to VG_ARENA_ALIGN.
bool  vg_arena_begin(vg_arena* arena, void* memory, size_t size);
/// Zeroed memory, or null where it does not fit (arena->failed) or the arena is measuring.
void* vg_arena_take(vg_arena* arena, size_t size);
void  vg_arena_empty(vg_arena* arena);

#ifdef __cplusplus
}
#endif

#endif
