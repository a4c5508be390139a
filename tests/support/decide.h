/// The decision of a search on a stage, for tests of what is read from decisions.
#ifndef TEST_DECIDE_H
#define TEST_DECIDE_H

#include "stage.h"

#include "decide/mcts.h"

/// After stage_begin(); at->def.iterations and nodes_max say how much is searched.
static inline void stage_decide(const stage* at, vg_random random, vg_decision* decision)
{
    enum { size = 8 << 20 };
    void* memory = aligned_alloc(64, size);
    assert_non_null(memory);
    vg_arena arena;
    vg_arena_init(&arena, memory, size);
    vg_tree* tree = vg_tree_take(&arena, &at->def);
    assert_non_null(tree);
    vg_mcts_run(tree, &at->scene, &at->root, &random, NULL, decision);
    free(memory);
}

#endif
