/// "search": "policy": a vehicle that decides for itself, without a tree. Below the planner's
/// interface on random scenes, and in a closed loop.
#include "closed_loop.h"
#include "decide.h"
#include "traffic/moves.h"

enum { lane_count = 3 };

static stage* open_alone(void)
{
    stage* at = stage_open(lane_count, 2000.0);
    at->def.search = VERGE_SEARCH_POLICY;
    return at;
}

/// The moves of the first step of a scene.
static vg_moves first_moves(const stage* at)
{
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow_moves(&at->scene, &at->root, &moves);
    return moves;
}

static bool meets(const stage* at, const vg_moves* moves, uint8_t action)
{
    return vg_flow_conflicts(&at->scene, &at->root, moves, &action) != 0;
}

// ---------------------------------------------------------------------------- what it takes

static void a_decider_takes_no_memory_for_a_tree(void** state)
{
    (void)state;
    verge_planner_def def = verge_planner_default_def();
    def.search = VERGE_SEARCH_BEST;
    def.nodes_max = 2;
    const size_t smallest_tree = verge_decider_memory_size(&def);
    def.search = VERGE_SEARCH_POLICY;
    const size_t without = verge_decider_memory_size(&def);
    def.nodes_max = 100000;
    assert_int_equal(verge_decider_memory_size(&def), without);
    assert_true(without + 60 * 1000 < smallest_tree); // its tables of logarithms and roots alone
}

static void few_plans_are_simulated_whatever_the_budget_and_the_seed(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("no budget");
    stage* at = open_alone();
    static stage_decision small, large; // too large for the stack
    for (uint32_t k = 0; k < test_rounds(60); ++k) {
        stage_fill(at, &rng, 1 + k % 4u, test_rng_below(&rng, 7), 100.0, 300.0, 12.0);
        at->def.iterations = 1;
        at->def.nodes_max = 2;
        stage_decide(at, vg_random_from(k, 0), &small);
        at->def.iterations = 1000;
        at->def.nodes_max = 1000;
        stage_decide(at, vg_random_from(k + 1000, 0), &large);
        assert_memory_equal(&small.line, &large.line, sizeof small.line);
        assert_memory_equal(&small.report, &large.report, sizeof small.report);
        CHECK_BETWEEN(small.report.iterations, 1, 1 + 25 * at->scene.controlled_count);
        CHECK_BETWEEN(small.report.reward, 0.0, small.report.bound);
        assert_int_equal(small.report.nodes, 0);
        assert_int_equal(small.report.nodes_first, 0);
    }
    stage_close(at);
}

// ---------------------------------------------------------------------------- how it drives

/// Scenes so dense that often there is no room ahead, or behind.
static void it_comes_near_a_body_only_where_it_does_so_in_its_lane_as_well(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("contact");
    stage* at = open_alone();
    static stage_decision decision;
    uint32_t left = 0, avoided = 0;
    for (uint32_t k = 0; k < test_rounds(2000); ++k) {
        stage_fill(at, &rng, 1, 9, 100.0, 145.0, 5.5);
        stage_decide(at, vg_random_from(k, 0), &decision);
        const vg_moves moves = first_moves(at);
        const uint8_t legal = moves.legal[0], first = decision.line.actions[0][0];
        assert_true((legal >> first & 1u) != 0);
        if (!meets(at, &moves, first)) {
            for (uint8_t action = 0; action < VERGE_ACTION_COUNT; ++action) {
                avoided += (legal >> action & 1u) != 0 && meets(at, &moves, action);
            }
            continue;
        }
        ++left;
        assert_true((legal >> VERGE_DECELERATE & 1u) == 0 || meets(at, &moves, VERGE_DECELERATE));
        assert_true((legal >> VERGE_KEEP_SPEED & 1u) == 0 || meets(at, &moves, VERGE_KEEP_SPEED));
    }
    assert_true(left > 0 && avoided > 0); // the scenes hold both
    stage_close(at);
}

/// The lane changes of a plan stay although they would not be chosen anew, if the gain is small.
static void a_plan_stays_that_is_nearly_as_good(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("kept");
    stage* at = open_alone();
    uint32_t kept = 0, replaced = 0;
    for (uint32_t k = 0; k < test_rounds(200); ++k) {
        stage_fill(at, &rng, 1, 3, 100.0, 300.0, 20.0);
        vg_joint_actions warm = { .step_count = at->def.steps }, chosen[2];
        warm.actions[0][0] = warm.actions[1][0] =
            test_rng_below(&rng, 2) == 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        for (uint32_t m = 0; m < 2; ++m) {
            at->def.switch_margin = m == 0 ? 0.0 : 1.0;
            vg_flow flows[3] = { at->root };
            verge_search_report report;
            vg_search_run(NULL, &at->scene, flows, NULL, &warm, &chosen[m], &report);
            assert_true(report.iterations >= 2);
        }
        const bool changes = chosen[1].actions[0][0] == warm.actions[0][0];
        kept += changes && chosen[0].actions[0][0] != warm.actions[0][0];
        replaced += !changes;
    }
    assert_true(kept > 0);
    assert_true(replaced > 0); // the change of the warm start was not legal
    stage_close(at);
}

/// One planned vehicle on the right of three lanes among others at constant speeds.
typedef struct loop {
    stage* at;
    verge_planner* planner;
    void* memory;
    verge_vehicle vehicles[5];
    verge_plan plan;
} loop;

static loop* open_loop(test_rng* rng)
{
    loop* self = calloc(1, sizeof *self);
    assert_non_null(self);
    self->at = open_alone();
    self->at->def.vehicles_max = 5;
    self->at->def.controlled_max = 1;
    const size_t size = (verge_planner_memory_size(&self->at->def) + 63) / 64 * 64;
    self->memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self->planner, &self->at->def, self->memory, size),
                     VERGE_OK);
    for (uint32_t i = 0; i < 5; ++i) {
        verge_vehicle* vehicle = &self->vehicles[i];
        *vehicle = verge_vehicle_default();
        vehicle->id = (int32_t)i;
        vehicle->controlled = i == 0;
        vehicle->x = i == 0 ? 100.0 : test_rng_between(rng, 30.0, 50.0) + 25.0 * i;
        vehicle->y = i == 0 ? 0.0 : STAGE_WIDTH * (1 + i % 2u);
        vehicle->speed = i == 0 ? 10.0 : test_rng_between(rng, 8.5, 9.5);
    }
    self->vehicles[0].target_lane = lane_count - 1;
    return self;
}

static void close_loop(loop* self)
{
    stage_close(self->at);
    free(self->memory);
    free(self);
}

static void alone_it_reaches_its_lane_in_seven_of_eight_dense_streams(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("alone");
    // Where it has to fall back into a gap two lanes away, its few codes may never agree from cycle
    // to cycle: 5 to 10 of 100 when measured. A search with a budget gets there.
    uint32_t turned_count = 0, missed = 0;
    for (uint32_t k = 0; k < test_rounds(10); ++k) {
        loop* self = open_loop(&rng);
        const double target = STAGE_WIDTH * (lane_count - 1);
        double leftmost = 0.0;
        bool turned = false;
        for (uint32_t cycle = 0; cycle < 80; ++cycle) {
            assert_int_equal(verge_planner_step(self->planner, (int64_t)cycle * 500000,
                                                self->vehicles, 5, &self->plan), VERGE_OK);
            assert_int_equal(self->plan.vehicles[0].status, VERGE_PLANNED);
            take_point(&self->vehicles[0], &self->plan.vehicles[0].points[5]);
            for (uint32_t i = 1; i < 5; ++i) {
                self->vehicles[i].x += 0.5 * self->vehicles[i].speed;
            }
            const double y = self->vehicles[0].y;
            turned = turned || (leftmost < target - 0.5 && leftmost - y > 0.3);
            leftmost = fmax(leftmost, y);
        }
        missed += fabs(self->vehicles[0].y - target) > 0.5 ? 1u : 0u;
        turned_count += turned ? 1u : 0u;
        assert_int_equal(verge_planner_counters(self->planner).nodes_max, 0);
        assert_int_equal(verge_planner_counters(self->planner).nodes_peak, 0);
        close_loop(self);
    }
    printf("             of %u: turned back %u, not there in 40 s %u\n", test_rounds(10),
           turned_count, missed);
    assert_true(turned_count * 8 <= test_rounds(10));
    assert_true(missed * 8 <= test_rounds(10));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_decider_takes_no_memory_for_a_tree),
        cmocka_unit_test(few_plans_are_simulated_whatever_the_budget_and_the_seed),
        cmocka_unit_test(it_comes_near_a_body_only_where_it_does_so_in_its_lane_as_well),
        cmocka_unit_test(a_plan_stays_that_is_nearly_as_good),
        cmocka_unit_test(alone_it_reaches_its_lane_in_seven_of_eight_dense_streams),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
