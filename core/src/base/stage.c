/// See stage.h.
#include "base/stage.h"

size_t vg_stage_size(const verge_planner_def* def, vg_stage_take* take)
{
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    if (verge_planner_check(def, NULL) != VERGE_OK) {
        return 0;
    }
    (void)take(&arena, def);
    return arena.used;
}

verge_status vg_stage_init(void** stage, const verge_planner_def* def, void* memory, size_t size,
                           vg_stage_take* take)
{
    *stage = NULL;
    const verge_status valid = verge_planner_check(def, NULL);
    if (valid != VERGE_OK) {
        return valid;
    }
    vg_arena arena;
    if (!vg_arena_begin(&arena, memory, size)) {
        return VERGE_ERR_MEMORY;
    }
    void* taken = take(&arena, def);
    *stage = arena.failed ? NULL : taken;
    return *stage == NULL ? VERGE_ERR_MEMORY : VERGE_OK;
}
