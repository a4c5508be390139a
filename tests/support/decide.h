/// The decision of a search on a stage, with the flow at every step and as public action steps, for
/// tests of the stages that read decisions.
#ifndef TEST_DECIDE_H
#define TEST_DECIDE_H

#include "stage.h"

#include "decide/search.h"
#include "verge/trajectory.h"

typedef struct stage_decision {
    vg_joint_actions line;
    verge_search_report report;
    vg_flow flows[VERGE_STEPS_MAX + 1];
    float way[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX]; ///< [m] driven in each step
    verge_vehicle_decision vehicles[VERGE_CONTROLLED_MAX];
    verge_decision steps; ///< the same as plain action steps
} stage_decision;

/// The flows and action steps that follow from decision->line, step by step from the root.
static inline void stage_drive(const stage* at, stage_decision* decision)
{
    decision->steps = (verge_decision){ .vehicle_count = at->scene.controlled_count,
                                        .vehicles_max = VERGE_CONTROLLED_MAX,
                                        .vehicles = decision->vehicles };
    decision->flows[0] = at->root;
    for (uint32_t t = 0; t < decision->line.step_count; ++t) {
        const vg_flow* before = &decision->flows[t];
        vg_flow* after = &decision->flows[t + 1];
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        *after = *before;
        vg_flow_moves(&at->scene, before, &moves);
        vg_flow_advance(&at->scene, before, &moves, decision->line.actions[t], after);
        for (uint32_t slot = 0; slot < at->scene.controlled_count; ++slot) {
            const uint8_t action = decision->line.actions[t][slot];
            const vg_lane* lane = &at->road->lanes[after->lane[slot]];
            const float to = moves.station[vg_actions[action].along][slot];
            decision->way[t][slot] = (to - before->station[slot]) * before->rate[slot];
            decision->vehicles[slot].vehicle_id = at->vehicles[at->scene.input_index[slot]].id;
            decision->vehicles[slot].step_count = decision->line.step_count;
            decision->vehicles[slot].steps[t] = (verge_action_step){
                .action = (verge_action)action,
                .lane_id = lane->id,
                .t0 = t * at->def.step_s,
                .t1 = (t + 1) * at->def.step_s,
                .s = vg_lane_s(lane, after->station[slot]),
                .d = after->d[slot],
                .v = after->v[slot],
                .distance = decision->way[t][slot],
                .ahead_id = -1,
                .behind_id = -1,
            };
        }
    }
}

/// After stage_begin(); at->def.iterations and nodes_max say how much is searched.
static inline void stage_decide(const stage* at, vg_random random, stage_decision* decision)
{
    enum { size = 8 << 20 };
    void* memory = aligned_alloc(64, size);
    assert_non_null(memory);
    vg_arena arena;
    vg_arena_init(&arena, memory, size);
    vg_tree* tree = vg_tree_take(&arena, &at->def);
    assert_non_null(tree);
    vg_flow flows[3] = { at->root };
    vg_search_run(tree, &at->scene, flows, &random, NULL, &decision->line, &decision->report);
    stage_drive(at, decision);
    free(memory);
}

/// The tracks of a scene as begun, by a predictor of its own.
static inline void stage_predict(const stage* at, const verge_decision* decision,
                                 verge_tracks* tracks)
{
    const size_t size = (verge_predictor_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_predictor* predictor = NULL;
    assert_int_equal(verge_predictor_init(&predictor, &at->def, memory, size), VERGE_OK);
    assert_int_equal(verge_predict(predictor, &at->given, decision, tracks), VERGE_OK);
    free(memory);
}

#endif
