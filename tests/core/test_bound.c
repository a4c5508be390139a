/// The bound is never below the reward of a plan, and near to it where a vehicle is alone.
#include "decide.h"

#include "decide/bound.h"
#include "decide/search.h"

/// Everything a search may do, on one stage.
typedef struct searched {
    double reward, bound;
} searched;

static searched search(stage* at, uint32_t iterations)
{
    at->def.iterations = iterations;
    at->def.nodes_max = 256;
    stage_decision* decision = aligned_alloc(64, (sizeof *decision / 64 + 1) * 64);
    stage_decide(at, vg_random_from(1, 1), decision);
    const searched found = { decision->report.reward, decision->report.bound };
    free(decision);
    return found;
}

static void no_plan_earns_more_than_the_bound(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("bound");
    stage* at = stage_open(4, 1900.0);
    for (uint32_t k = 0; k < test_rounds(300); ++k) {
        at->def.search = k % 2 == 0 ? VERGE_SEARCH_BEST : VERGE_SEARCH_PAPER;
        at->def.steps = 2 + test_rng_below(&rng, 9);
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 6), test_rng_below(&rng, 6), 100.0, 500.0,
                   12.0);
        for (uint32_t i = 0; i < at->count; ++i) {
            at->positions[i].d = k % 3 == 0 ? test_rng_between(&rng, -1.9, 1.9) : 0.0;
        }
        stage_begin(at);
        const searched found = search(at, 400);
        assert_true(found.bound <= 1.0);
        if (found.reward > found.bound) {
            CHECK_NEAR(found.reward, found.bound, 0.0);
        }
    }
    stage_close(at);
}

/// Alone on the road only what the bound rounds up separates the two: half a change more.
static void a_vehicle_alone_comes_within_seven_percent(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("alone");
    stage* at = stage_open(4, 1900.0);
    at->def.search = VERGE_SEARCH_BEST;
    for (uint32_t k = 0; k < test_rounds(100); ++k) {
        stage_clear(at);
        const uint32_t lane = test_rng_below(&rng, 4);
        stage_add(at, true, lane, 200.0, 0.0, test_rng_between(&rng, 4.0, STAGE_LIMIT),
                  (int32_t)test_rng_below(&rng, 5) - 1);
        stage_begin(at);
        const searched found = search(at, 6000);
        assert_true(found.reward <= found.bound);
        assert_true(found.reward >= 0.93 * found.bound);
    }
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_plan_earns_more_than_the_bound),
        cmocka_unit_test(a_vehicle_alone_comes_within_seven_percent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
