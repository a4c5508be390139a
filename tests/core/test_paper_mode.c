// "search": "paper" is the method of the paper: its decisions never change, whatever the default
// method learns. Frozen digests of the paper's scenes (freeway of Table 3, ramp of Cases 1 to 3).
#include "shipped.h"
#include "check.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DECISIONS = 8 };

static const struct frozen {
    const char* scenario;
    uint64_t    digest;
} frozen[] = {
    { "freeway-2av", 0x161568184e59a9df },
    { "freeway-3av", 0x6e871022c00fdab1 },
    { "freeway-4av", 0xaf1f6f2d5e373575 },
    { "freeway-4av-2hv", 0x1892c16126b31aa6 },
    { "ramp-case1", 0x017ca92b6ef76753 },
    { "ramp-case2", 0x0829169b1e960853 },
    { "ramp-case3", 0x5881e47ec17a5959 },
};

static uint64_t mix(uint64_t digest, const void* value, size_t size)
{
    const unsigned char* bytes = value;
    for (size_t i = 0; i < size; ++i) {
        digest = (digest ^ bytes[i]) * 0x100000001b3u;
    }
    return digest;
}

static uint64_t mix_decision(uint64_t digest, const verge_decision* decision)
{
    for (uint32_t i = 0; i < decision->vehicle_count; ++i) {
        const verge_vehicle_decision* of = &decision->vehicles[i];
        for (uint32_t t = 0; t < of->step_count; ++t) {
            const verge_action_step* step = &of->steps[t];
            const int32_t action = (int32_t)step->action;
            digest = mix(digest, &action, sizeof action);
            digest = mix(digest, &step->lane_id, sizeof step->lane_id);
            digest = mix(digest, &step->s, sizeof step->s);
            digest = mix(digest, &step->d, sizeof step->d);
            digest = mix(digest, &step->v, sizeof step->v);
        }
    }
    return mix(digest, &decision->search.reward, sizeof decision->search.reward);
}

// Every controlled vehicle is moved to where its first step ends, all others at constant speed: no
// trajectory and no simulator is involved.
static void move(const verge_road* road, const verge_decision* decision, verge_vehicle* vehicles,
                 uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle* v = &vehicles[i];
        const verge_vehicle_decision* of = verge_decision_of(decision, v->id);
        if (of == NULL) {
            double sine, cosine;
            verge_sincos(v->heading, &sine, &cosine);
            v->x += v->speed * 1.5 * cosine;
            v->y += v->speed * 1.5 * sine;
        } else {
            const verge_action_step* step = &of->steps[0];
            double heading;
            (void)verge_road_at(road, step->lane_id, step->s, step->d, &v->x, &v->y, &heading);
            v->heading = heading;
            v->acceleration = (step->v - v->speed) / 1.5;
            v->speed = step->v;
        }
    }
}

static void* allocate(size_t size)
{
    void* memory = aligned_alloc(64, (size + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

static uint64_t decide(const scenario* scene)
{
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ scene->lanes, scene->lane_count };
    scene->set(&def);
    def.search = VERGE_SEARCH_PAPER;
    const size_t road_size = verge_road_memory_size(&def.road, NULL);
    const size_t decider_size = verge_decider_memory_size(&def);
    void* road_memory = allocate(road_size);
    void* decider_memory = allocate(decider_size);
    const verge_road* road = NULL;
    verge_decider* decider = NULL;
    assert_int_equal(verge_road_init(&road, &def.road, road_memory, road_size), VERGE_OK);
    assert_int_equal(verge_decider_init(&decider, &def, decider_memory, decider_size), VERGE_OK);

    static verge_vehicle vehicles[VERGE_VEHICLES_MAX], placed[VERGE_VEHICLES_MAX];
    static verge_lane_position positions[VERGE_VEHICLES_MAX];
    static verge_vehicle_decision decided[VERGE_CONTROLLED_MAX];
    static verge_commitment commitment;
    memset(&commitment, 0, sizeof commitment);
    verge_scene at = verge_scene_make(road, placed, positions, VERGE_VEHICLES_MAX);
    verge_decision decision = verge_decision_make(decided, VERGE_CONTROLLED_MAX);
    for (uint32_t v = 0; v < scene->vehicle_count; ++v) {
        vehicles[v] = vehicle_from(&scene->vehicles[v]);
    }
    uint64_t digest = 0xcbf29ce484222325u;
    for (uint32_t k = 0; k < DECISIONS; ++k) {
        assert_int_equal(verge_scene_place(&at, (int64_t)k * 1500000, vehicles,
                                           scene->vehicle_count, NULL), VERGE_OK);
        assert_int_equal(verge_decide(decider, &at, &commitment, &decision), VERGE_OK);
        digest = mix_decision(digest, &decision);
        move(road, &decision, vehicles, scene->vehicle_count);
    }
    free(road_memory);
    free(decider_memory);
    return digest;
}

static void the_decisions_of_the_papers_search_never_change(void** state)
{
    (void)state;
    bool same = true;
    for (size_t i = 0; i < sizeof frozen / sizeof frozen[0]; ++i) {
        const scenario* scene = NULL;
        for (size_t k = 0; k < sizeof scenarios / sizeof scenarios[0]; ++k) {
            scene = strcmp(scenarios[k].name, frozen[i].scenario) == 0 ? &scenarios[k] : scene;
        }
        assert_non_null(scene);
        const uint64_t digest = decide(scene);
        if (digest != frozen[i].digest) {
            print_error("%s: 0x%016" PRIx64 ", expected 0x%016" PRIx64 "\n", scene->name, digest,
                        frozen[i].digest);
            same = false;
        }
    }
    assert_true(same);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_decisions_of_the_papers_search_never_change),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
