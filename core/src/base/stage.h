/// What all stages do alike: a stage is one object in the caller's memory, and the code that takes
/// its memory is the code that sizes it.
#ifndef VG_STAGE_H
#define VG_STAGE_H

#include "base/arena.h"
#include "verge/def.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Takes a stage from the arena; null where it does not fit or the arena is measuring.
typedef void* vg_stage_take(vg_arena* arena, const verge_planner_def* def);

/// Bytes that a stage takes; 0 where the def is not valid.
size_t vg_stage_size(const verge_planner_def* def, vg_stage_take* take);

/// Builds a stage in the caller's memory. *stage is null unless the result is VERGE_OK.
verge_status vg_stage_init(void** stage, const verge_planner_def* def, void* memory, size_t size,
                           vg_stage_take* take);

#ifdef __cplusplus
}
#endif

#endif
