/// Straight parallel lanes with vehicles on them, below the planner's interface, for the tests of
/// flow and search. Lane i has the id i and lies at y = i * width, lane 0 rightmost.
///
///     stage* at = stage_open(3, 500.0);
///     at->def.steps = 3;                            // before stage_begin()
///     stage_add(at, true, 0, 100.0, 0.0, 8.0, 1);   // planned ones first: slot = order
///     stage_begin(at);
///     ... at->scene, at->root ...
///     stage_close(at);
#ifndef TEST_STAGE_H
#define TEST_STAGE_H

#include "check.h"
#include "rng.h"

#include "traffic/advance.h"
#include "traffic/conflict.h"
#include "traffic/pairs.h"
#include "traffic/reward.h"
#include "traffic/traffic.h"
#include "traffic/value.h"
#include "verge/planner.h"

#include <math.h>
#include <stdlib.h>

#define STAGE_WIDTH 4.0  // [m]
#define STAGE_LIMIT 12.0 // [m/s]
enum { STAGE_LANES_MAX = 6, STAGE_ROAD_SIZE = 4 << 20 };

typedef struct stage {
    verge_planner_def def;
    verge_lane_def lanes[STAGE_LANES_MAX];
    double points[STAGE_LANES_MAX][2][2];
    void* memory;
    verge_road* road;
    uint32_t count;
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    verge_lane_position positions[VERGE_VEHICLES_MAX];
    verge_scene given; ///< the vehicles and positions above
    vg_pairs* pairs;
    vg_value* value;
    vg_model scene;
    vg_flow root;
} stage;

/// Builds def->lanes anew, after they were changed by hand.
static inline void stage_build(stage* at)
{
    const size_t scratch_size = (vg_road_scratch_size(&at->def.road) / 64 + 1) * 64;
    free(at->memory);
    at->memory = aligned_alloc(64, STAGE_ROAD_SIZE);
    void* fit = aligned_alloc(64, scratch_size);
    assert_non_null(at->memory);
    assert_non_null(fit);
    vg_arena arena, scratch;
    vg_arena_init(&arena, at->memory, STAGE_ROAD_SIZE);
    vg_arena_init(&scratch, fit, scratch_size);
    assert_int_equal(verge_road_check(&at->def.road, NULL), VERGE_OK);
    at->road = vg_road_build(&arena, &scratch, &at->def.road);
    assert_non_null(at->road);
    at->pairs = vg_traffic_take(&arena, &at->def).pairs;
    assert_non_null(at->pairs);
    at->value = vg_value_take(&arena, VERGE_CONTROLLED_MAX, at->def.road.lane_count);
    assert_non_null(at->value);
    free(fit);
}

/// length: of every lane [m].
static inline stage* stage_open(uint32_t lane_count, double length)
{
    stage* at = aligned_alloc(64, (sizeof *at / 64 + 1) * 64);
    assert_non_null(at);
    memset(at, 0, sizeof *at);
    at->def = verge_planner_default_def();
    at->def.search = VERGE_SEARCH_PAPER; // the rules of the paper; tests of BEST change it
    for (uint32_t i = 0; i < lane_count; ++i) {
        at->points[i][0][1] = at->points[i][1][1] = STAGE_WIDTH * (double)i;
        at->points[i][1][0] = length;
        at->lanes[i] = (verge_lane_def){
            .id = (int32_t)i,
            .points = (const double (*)[2])at->points[i],
            .point_count = 2,
            .width = STAGE_WIDTH,
            .speed_limit = STAGE_LIMIT,
            .left = i + 1 < lane_count ? (int32_t)i + 1 : VERGE_NO_LANE,
            .right = i > 0 ? (int32_t)i - 1 : VERGE_NO_LANE,
        };
    }
    at->def.road = (verge_road_def){ at->lanes, lane_count };
    stage_build(at);
    return at;
}

/// The same for VERGE_SEARCH_BEST.
static inline stage* stage_open_best(uint32_t lane_count, double length)
{
    stage* at = stage_open(lane_count, length);
    at->def.search = VERGE_SEARCH_BEST;
    return at;
}

static inline void stage_close(stage* at)
{
    free(at->memory);
    free(at);
}

static inline void stage_clear(stage* at)
{
    at->count = 0;
}

/// Returns the vehicle, to change more of it. target: lane id, -1 none.
static inline verge_vehicle* stage_add(stage* at, bool planned, uint32_t lane, double s, double d,
                                       double v, int32_t target)
{
    const uint32_t i = at->count++;
    assert_true(i < VERGE_VEHICLES_MAX);
    at->vehicles[i] = verge_vehicle_default();
    at->vehicles[i].id = (int32_t)i;
    at->vehicles[i].controlled = planned;
    at->vehicles[i].x = s;
    at->vehicles[i].y = STAGE_WIDTH * (double)lane + d;
    at->vehicles[i].speed = v;
    at->vehicles[i].target_lane = target;
    at->positions[i] =
        (verge_lane_position){ .lane_id = (int32_t)lane, .s = s, .d = d, .contained = true };
    return &at->vehicles[i];
}

static inline void stage_begin(stage* at)
{
    at->given = (verge_scene){ .road = at->road, .vehicle_count = at->count,
                               .vehicles_max = VERGE_VEHICLES_MAX, .vehicles = at->vehicles,
                               .positions = at->positions };
    vg_model_from(&at->scene, &at->root, &at->def, at->pairs, &at->given,
                  vg_scene_controlled(&at->given));
    assert_int_equal(at->scene.count, at->count);
    if (at->scene.best) {
        vg_value_fill(at->value, &at->scene, &at->root);
        vg_flow_begin(&at->scene, &at->root, 0);
    }
}

/// Random vehicles, none within `apart` [m] of another in its lane.
static inline void stage_fill(stage* at, test_rng* rng, uint32_t planned, uint32_t humans,
                              double from, double to, double apart)
{
    const uint32_t lanes = at->def.road.lane_count;
    stage_clear(at);
    while (at->count < planned + humans) {
        const uint32_t lane = test_rng_below(rng, lanes);
        const double s = test_rng_between(rng, from, to);
        bool crowded = false;
        for (uint32_t j = 0; j < at->count; ++j) {
            crowded = crowded
                      || (at->positions[j].lane_id == (int32_t)lane
                           && fabs(at->positions[j].s - s) < apart);
        }
        if (!crowded) {
            const double v = test_rng_between(rng, 0.0, STAGE_LIMIT);
            const int32_t target = (int32_t)test_rng_below(rng, lanes + 1u) - 1;
            verge_vehicle* vehicle =
                stage_add(at, at->count < planned, lane, s, 0.0, v, target);
            vehicle->habit.cooperation = test_rng_unit(rng);
        }
    }
    stage_begin(at);
}

/// The whole flow one step on.
static inline void stage_step(const stage* at, vg_flow* flow, const uint8_t* actions)
{
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow next = *flow;
    vg_flow_moves(&at->scene, flow, &moves);
    vg_flow_advance(&at->scene, flow, &moves, actions, &next);
    *flow = next;
}

/// A random member of a set of actions.
static inline uint8_t stage_pick(test_rng* rng, uint8_t legal)
{
    uint8_t members[VERGE_ACTION_COUNT];
    uint32_t count = 0;
    for (uint8_t action = 0; action < VERGE_ACTION_COUNT; ++action) {
        if (((legal >> action) & 1u) != 0) {
            members[count++] = action;
        }
    }
    assert_true(count > 0);
    return members[test_rng_below(rng, count)];
}

#endif
