/// Goal: the sizes that headers and pages state are the sizes of the structures.
/// Method: the sentences are read from the files and compared with sizeof and with the functions
///         that size memory, with the default capacities and parameters.
#include "check.h"
#include "decide/search.h"
#include "traffic/value.h"
#include "verge/verge.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// The sentences are about these; tests also run with smaller ones.
static const bool default_capacities = VERGE_VEHICLES_MAX == 64 && VERGE_CONTROLLED_MAX == 16
                                       && VERGE_STEPS_MAX == 16 && VERGE_POINTS_MAX == 31;

/// The number that follows `words` in a file of the tree.
static double stated(const char* path, const char* words)
{
    static char text[1 << 16]; // the headers and pages are smaller
    char name[4096];
    snprintf(name, sizeof name, "%s/%s", VERGE_SOURCE_DIR, path);
    FILE* file = fopen(name, "r");
    assert_non_null(file);
    const size_t size = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[size] = '\0';
    const char* at = strstr(text, words);
    if (at == NULL) {
        fail_msg("%s does not say \"%s\"", path, words);
        return 0.0;
    }
    return strtod(at + strlen(words), NULL);
}

static void test_the_size_of_a_plan_is_the_stated_one(void** state)
{
    (void)state;
    if (!default_capacities) {
        skip();
    }
    const double kilobytes = 1e-3 * (double)sizeof(verge_plan);
    CHECK_NEAR(stated("core/include/verge/plan.h", "Large ("), kilobytes, 0.5);
    CHECK_NEAR(stated("core/README.md", "`verge_plan` has "), kilobytes, 0.5);
    CHECK_NEAR(stated("apps/examples/first_plan.c", "plan;                           // "),
               kilobytes, 0.5);
}

static void test_the_cost_of_a_capacity_is_the_stated_one(void** state)
{
    (void)state;
    if (!default_capacities) {
        skip();
    }
    const char* config = "core/include/verge/config.h";
    const verge_planner_def def = verge_planner_default_def();
    CHECK_NEAR(stated(config, "a sampler each ("), 1e-3 * (double)verge_sampler_memory_size(&def),
               0.5);
    CHECK_NEAR(stated(config, "default parameters), and "), 1e-3 * (double)sizeof(verge_vehicle_plan),
               0.05);
    CHECK_NEAR(stated(config, "if it is controlled; "), 1e-3 * (double)sizeof(verge_prediction), 0.05);
}

static void test_the_size_of_a_node_is_the_stated_one(void** state)
{
    (void)state;
    const char* config = "core/include/verge/config.h";
    const double empty = stated(config, "which sizes the arena).\n/// Cost: ");
    const double vehicle = stated(config, " B each, and ");
    const double controlled = stated(config, " B each, and 14 B a vehicle, ");
    assert_int_equal(vg_node_size(0, 0), (uint32_t)empty);
    // Nodes have whole numbers of 8 bytes: with 64 and 16 vehicles nothing is rounded up.
    assert_int_equal(vg_node_size(64, 0), (uint32_t)(empty + 64.0 * vehicle));
    assert_int_equal(vg_node_size(64, 16), (uint32_t)(empty + 64.0 * vehicle + 16.0 * controlled));
}

/// One vehicle and 8 neighbours.
static verge_planner_def on_vehicle_def(void)
{
    verge_planner_def def = verge_planner_default_def();
    def.search = VERGE_SEARCH_POLICY;
    def.vehicles_max = 9;
    def.controlled_max = 1;
    return def;
}

/// The table of the value-to-go, which belongs to the road.
static size_t value_size(const verge_planner_def* def)
{
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)vg_value_take(&arena, def->controlled_max, def->road.lane_count);
    return arena.used;
}

/// The memory of decisions, compiled for 9 vehicles as the firmware is (apps/embedded/config.h).
static size_t commitment_of_9(void)
{
    const size_t one = sizeof(verge_turn) + sizeof(verge_belief);
    return sizeof(verge_commitment) - (VERGE_VEHICLES_MAX - 9) * one;
}

/// All that an on-vehicle unit holds, besides the road and its value-to-go.
static size_t on_vehicle_size(const verge_planner_def* def)
{
    const size_t decider = verge_decider_memory_size(def);
    const size_t predictor = verge_predictor_shared_memory_size(def);
    const size_t sampler = verge_sampler_memory_size(def);
    assert_true(decider > 0 && predictor > 0 && sampler > 0);
    const size_t scene = 9 * (sizeof(verge_vehicle) + sizeof(verge_lane_position));
    const size_t plans = sizeof(verge_vehicle_decision) + commitment_of_9()
                         + 2 * sizeof(verge_vehicle_plan);
    return decider - value_size(def) + predictor + sampler + scene + 9 * sizeof(verge_track) + plans;
}

static void test_one_vehicle_with_8_neighbours_takes_96_kibibytes_at_most(void** state)
{
    (void)state;
    static const uint32_t lane_counts[] = { 0, 1, 8, 68, 512, VERGE_LANES_MAX };
    verge_planner_def def = on_vehicle_def();
    for (size_t k = 0; k < sizeof lane_counts / sizeof lane_counts[0]; ++k) {
        def.road.lane_count = lane_counts[k];
        const size_t size = on_vehicle_size(&def);
        printf("             %u lanes: %zu bytes, value-to-go %zu\n", lane_counts[k], size,
               value_size(&def));
        assert_true(size <= 96 * 1024);
    }
}

/// Straight lanes of 500 m, side by side, as the road of a unit.
static verge_road_def four_lanes(void)
{
    static double points[4][2][2];
    static verge_lane_def lanes[4];
    for (int32_t i = 0; i < 4; ++i) {
        points[i][0][1] = points[i][1][1] = 3.5 * i;
        points[i][1][0] = 500.0;
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = (const double (*)[2])points[i];
        lanes[i].point_count = 2;
        lanes[i].left = i < 3 ? i + 1 : VERGE_NO_LANE;
        lanes[i].right = i > 0 ? i - 1 : VERGE_NO_LANE;
    }
    return (verge_road_def){ lanes, 4 };
}

/// The memory in which a road is built is used again for the rest.
static void test_500_metres_of_four_lanes_fit_512_kibibytes_with_the_on_vehicle_unit(void** state)
{
    (void)state;
    verge_planner_def def = on_vehicle_def();
    def.road = four_lanes();
    size_t road = 0;
    const size_t built = verge_road_memory_size(&def.road, &road);
    const size_t value = value_size(&def), unit = on_vehicle_size(&def);
    printf("             road %zu (%zu while it is built), value-to-go %zu, unit %zu bytes\n", road,
           built, value, unit);
    assert_true(road > 0 && built > road);
    assert_true(road + value + unit <= 512 * 1024);
    assert_true(built <= 512 * 1024);
    const double metre = (double)(road + value) / 2000.0;
    CHECK_NEAR(stated("core/README.md", "value-to-go included, a metre of lane takes "), metre, 0.5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_size_of_a_plan_is_the_stated_one),
        cmocka_unit_test(test_the_cost_of_a_capacity_is_the_stated_one),
        cmocka_unit_test(test_the_size_of_a_node_is_the_stated_one),
        cmocka_unit_test(test_one_vehicle_with_8_neighbours_takes_96_kibibytes_at_most),
        cmocka_unit_test(test_500_metres_of_four_lanes_fit_512_kibibytes_with_the_on_vehicle_unit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
