// A caller compiled with other capacities than the library: every call that depends on them says so
// and writes nothing. This file is such a caller.
#undef VERGE_USER_CONFIG
#define VERGE_VEHICLES_MAX 9
#define VERGE_CONTROLLED_MAX 3
#define VERGE_STEPS_MAX 5
#define VERGE_POINTS_MAX 12

#include "check.h"

#include "verge/verge.h"

#include <stdlib.h>

enum { canary = 0x5a, canary_size = 200000 }; // more than the library's structures are larger

static const double centreline[][2] = { { 0.0, 0.0 }, { 400.0, 0.0 } };
static const verge_lane_def lanes[] = {
    { .points = centreline, .point_count = 2, .width = 4.0, .speed_limit = 15.0,
      .left = VERGE_NO_LANE, .right = VERGE_NO_LANE },
};

// A def as another file of this program would make it, compiled like the library.
static verge_planner_def def_of_the_library(void)
{
    verge_planner_def def = verge_planner_default_def_for(verge_library_config());
    def.road = (verge_road_def){ lanes, 1 };
    def.iterations = 50;
    return def;
}

static void* take(size_t size)
{
    assert_true(size > 0);
    void* memory = aligned_alloc(64, (size + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

static void every_init_refuses_the_def_of_a_caller_with_other_capacities(void** state)
{
    (void)state;
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, 1 };
    const char* fault = NULL;
    assert_int_equal(verge_planner_check(&def, &fault), VERGE_ERR_CONFIG);
    assert_string_equal(fault, "config");
    assert_int_equal(verge_planner_memory_size(&def), 0);

    static _Alignas(64) uint8_t memory[1 << 20];
    memset(memory, canary, sizeof memory);
    verge_planner* planner = NULL;
    verge_decider* decider = NULL;
    verge_predictor* predictor = NULL;
    verge_sampler* sampler = NULL;
    verge_humans* humans = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, sizeof memory), VERGE_ERR_CONFIG);
    assert_int_equal(verge_decider_init(&decider, &def, memory, sizeof memory), VERGE_ERR_CONFIG);
    assert_int_equal(verge_predictor_init(&predictor, &def, memory, sizeof memory), VERGE_ERR_CONFIG);
    assert_int_equal(verge_sampler_init(&sampler, &def, memory, sizeof memory), VERGE_ERR_CONFIG);
    assert_int_equal(verge_humans_init(&humans, &def, memory, sizeof memory), VERGE_ERR_CONFIG);
    assert_true(planner == NULL && decider == NULL && predictor == NULL && sampler == NULL
                && humans == NULL);
    for (size_t i = 0; i < sizeof memory; ++i) {
        assert_int_equal(memory[i], canary);
    }
}

static void one_differing_capacity_is_enough(void** state)
{
    (void)state;
    for (unsigned capacity = 0; capacity < 6; ++capacity) {
        const uint64_t other = verge_library_config() ^ (uint64_t)1 << (8 * capacity);
        const verge_planner_def def = verge_planner_default_def_for(other);
        assert_int_equal(verge_planner_check(&def, NULL), VERGE_ERR_CONFIG);
    }
    const verge_planner_def same = def_of_the_library();
    assert_int_equal(verge_planner_check(&same, NULL), VERGE_OK);
    assert_string_not_equal(verge_status_text(VERGE_ERR_CONFIG), verge_status_text((verge_status)-1000));
}

static void a_step_into_the_plan_of_a_caller_with_smaller_capacities_writes_nothing(void** state)
{
    (void)state;
    const verge_planner_def def = def_of_the_library();
    const size_t size = verge_planner_memory_size(&def);
    void* memory = take(size);
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, size), VERGE_OK);
    static struct {
        verge_plan plan;
        uint8_t behind[canary_size];
    } mine;
    memset(&mine, canary, sizeof mine);
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.controlled = true;
    vehicle.x = 50.0;
    vehicle.speed = 10.0;
    assert_int_equal(verge_planner_step(planner, 0, &vehicle, 1, &mine.plan), VERGE_ERR_CONFIG);
    for (size_t i = 0; i < sizeof mine; ++i) {
        assert_int_equal(((uint8_t*)&mine)[i], canary);
    }
    assert_int_equal(verge_planner_counters(planner).steps, 0);
    free(memory);
}

static void every_stage_refuses_the_structures_of_a_caller_with_other_capacities(void** state)
{
    (void)state;
    const verge_planner_def def = def_of_the_library();
    const size_t decider_size = verge_decider_memory_size(&def);
    const size_t predictor_size = verge_predictor_memory_size(&def);
    const size_t sampler_size = verge_sampler_memory_size(&def);
    void *a = take(decider_size), *b = take(predictor_size), *c = take(sampler_size);
    verge_decider* decider = NULL;
    verge_predictor* predictor = NULL;
    verge_sampler* sampler = NULL;
    assert_int_equal(verge_decider_init(&decider, &def, a, decider_size), VERGE_OK);
    assert_int_equal(verge_predictor_init(&predictor, &def, b, predictor_size), VERGE_OK);
    assert_int_equal(verge_sampler_init(&sampler, &def, c, sampler_size), VERGE_OK);

    verge_vehicle vehicle = verge_vehicle_default();
    verge_lane_position position = { .lane_id = VERGE_NO_LANE };
    const verge_scene scene = { .vehicle_count = 1, .vehicles_max = 1, .vehicles = &vehicle,
                                .positions = &position };
    verge_vehicle_decision decided = { .vehicle_id = vehicle.id };
    verge_decision decision = { .vehicle_count = 1, .vehicles_max = 1, .vehicles = &decided };
    assert_ptr_equal(verge_decision_of(&decision, vehicle.id), &decided);
    verge_track track;
    verge_track_begin(&track, &vehicle);
    verge_track_set(&track, VERGE_POINTS_MAX - 1, 1.0, 2.0, 0.0, 3.0);
    assert_true(track.cos_heading[VERGE_POINTS_MAX - 1] == 1.0 && track.speed[VERGE_POINTS_MAX - 1] == 3.0);
    verge_tracks tracks = { .count = 1, .tracks_max = 1, .of = &track };
    verge_commitment commitment = { 0 };
    verge_vehicle_plan plan;
    assert_int_equal(verge_decide(decider, &scene, &commitment, &decision), VERGE_ERR_CONFIG);
    assert_int_equal(verge_predict(predictor, &scene, &decision, &tracks), VERGE_ERR_CONFIG);
    assert_int_equal(verge_plan_vehicle(sampler, &scene, &decided, &tracks, NULL, &plan), VERGE_ERR_CONFIG);
    free(a);
    free(b);
    free(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_init_refuses_the_def_of_a_caller_with_other_capacities),
        cmocka_unit_test(one_differing_capacity_is_enough),
        cmocka_unit_test(a_step_into_the_plan_of_a_caller_with_smaller_capacities_writes_nothing),
        cmocka_unit_test(every_stage_refuses_the_structures_of_a_caller_with_other_capacities),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
