// The joint search: against the enumeration of every plan and of every tree on small scenes, and by
// what it draws where no plan is better than another.
#include "decide.h"

#include "base/random.h"
#include "decide/search.h"

enum { arena_size = 24 << 20, many_nodes = 60000 };

typedef struct played {
    stage* at;
    void* memory;
    vg_tree* tree;
    stage_decision decision;
} played;

static played* open_search(uint32_t lanes, double length)
{
    played* self = aligned_alloc(64, (sizeof *self / 64 + 1) * 64);
    assert_non_null(self);
    memset(self, 0, sizeof *self);
    self->at = stage_open(lanes, length);
    self->at->def.search = VERGE_SEARCH_BEST;
    self->memory = aligned_alloc(64, arena_size);
    assert_non_null(self->memory);
    return self;
}

static void close_search(played* self)
{
    stage_close(self->at);
    free(self->memory);
    free(self);
}

static double run(played* self, uint64_t seed, const vg_joint_actions* warm)
{
    vg_arena arena;
    vg_arena_init(&arena, self->memory, arena_size);
    self->tree = vg_tree_take(&arena, &self->at->def);
    assert_non_null(self->tree);
    vg_random random = vg_random_from(seed, 0);
    vg_flow flows[3] = { self->at->root };
    vg_search_run(self->tree, &self->at->scene, flows, &random, warm, &self->decision.line,
                  &self->decision.report);
    stage_drive(self->at, &self->decision);
    return self->decision.report.reward;
}

// ---------------------------------------------------------------------------- every plan there is

/// The joint action of this number in base VERGE_ACTION_COUNT. False: not legal.
static bool legal_joint_action(const stage* at, const vg_moves* moves, uint32_t number,
                               uint8_t* actions)
{
    bool legal = true;
    for (uint32_t i = 0; i < at->scene.controlled_count; ++i, number /= VERGE_ACTION_COUNT) {
        actions[i] = (uint8_t)(number % VERGE_ACTION_COUNT);
        legal = legal && ((moves->legal[i] >> actions[i]) & 1u) != 0;
    }
    return legal;
}

/// The best reward of all plans without conflict from here on; -1 if there is none.
static double best_of_all(const stage* at, const vg_flow* flow, uint32_t step_index)
{
    if (step_index == at->def.steps || vg_flow_terminal(&at->scene, flow)) {
        return vg_flow_reward(&at->scene, flow, step_index, true);
    }
    const uint32_t count = at->scene.controlled_count;
    double best = -1.0;
    uint32_t combinations = 1;
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow_moves(&at->scene, flow, &moves);
    for (uint32_t i = 0; i < count; ++i) {
        combinations *= VERGE_ACTION_COUNT;
    }
    for (uint32_t number = 0; number < combinations; ++number) {
        uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
        if (legal_joint_action(at, &moves, number, actions)
            && vg_flow_conflicts(&at->scene, flow, &moves, actions) == 0) {
            vg_flow next = *flow;
            vg_flow_advance(&at->scene, flow, &moves, actions, &next);
            best = fmax(best, best_of_all(at, &next, step_index + 1));
        }
    }
    return best;
}

static void small_scene(stage* at, test_rng* rng)
{
    at->def.steps = 3;
    at->def.points = 31;
    stage_fill(at, rng, 2, test_rng_below(rng, 3), 100.0, 140.0, 7.0);
}

static void the_best_plan_seen_is_the_best_of_all_plans(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("optimum");
    played* self = open_search(3, 2000.0);
    uint32_t solved = 0;
    for (uint32_t k = 0; k < test_rounds(60); ++k) {
        small_scene(self->at, &rng);
        self->at->def.iterations = 60000; // more than there are plans
        self->at->def.nodes_max = many_nodes;
        self->at->def.vehicles_max = 8;
        self->at->def.controlled_max = 2;
        self->at->def.search = VERGE_SEARCH_BEST;
        const double optimum = best_of_all(self->at, &self->at->root, 0);
        const double found = run(self, k, NULL);
        if (optimum >= 0.0) {
            CHECK_NEAR(found, optimum, 1e-12);
            ++solved;
        }
    }
    assert_true(solved > test_rounds(60) / 2);
    close_search(self);
}

static void the_papers_plan_comes_near_the_best_of_all_plans_and_never_above(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("paper");
    played* self = open_search(3, 2000.0);
    double loss = 0.0;
    const uint32_t rounds = test_rounds(60);
    for (uint32_t k = 0; k < rounds; ++k) {
        small_scene(self->at, &rng);
        self->at->def.iterations = 3000;
        self->at->def.search = VERGE_SEARCH_PAPER;
        const double optimum = best_of_all(self->at, &self->at->root, 0);
        const double found = run(self, k, NULL);
        if (optimum >= 0.0) {
            CHECK_BETWEEN(found, 0.0, optimum + 1e-12);
            loss += optimum - found;
        }
    }
    CHECK_AT_MOST(loss / rounds, 0.05);
    close_search(self);
}

// ---------------------------------------------------------------------------- what a plan is

/// The line's steps are legal, and free of conflicts until the flow is terminal where they can be.
static void check_plan(const stage* at, const stage_decision* decision, bool free_of_conflicts)
{
    const uint32_t count = at->scene.controlled_count;
    vg_flow flow = at->root;
    bool over_already = false;
    assert_int_equal(decision->line.step_count, at->def.steps);
    for (uint32_t t = 0; t < at->def.steps; ++t) {
        const uint8_t* actions = decision->line.actions[t];
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &flow, &moves);
        over_already = over_already || vg_flow_terminal(&at->scene, &flow);
        for (uint32_t i = 0; i < count; ++i) {
            assert_true(((moves.legal[i] >> actions[i]) & 1u) != 0);
        }
        if (!over_already && free_of_conflicts) {
            assert_int_equal(vg_flow_conflicts(&at->scene, &flow, &moves, actions), 0);
        }
        vg_flow next = flow;
        vg_flow_advance(&at->scene, &flow, &moves, actions, &next);
        flow = next;
    }
}

static void plans_are_legal_and_free_of_conflicts(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("legal plans");
    played* self = open_search(4, 2000.0);
    for (uint32_t k = 0; k < test_rounds(60); ++k) {
        self->at->def.iterations = 400;
        self->at->def.search = VERGE_SEARCH_BEST;
        // Gaps from which everybody can still brake.
        stage_fill(self->at, &rng, 1 + test_rng_below(&rng, 8), test_rng_below(&rng, 6), 100.0,
                   400.0, 30.0);
        (void)run(self, k, NULL);
        if (self->decision.report.nodes_first > 0) { // a complete plan was seen
            check_plan(self->at, &self->decision, true);
        }
    }
    close_search(self);
}

/// A dense scene in which no vehicle can reach its target lane.
static void a_warm_line_that_fails_does_not_become_the_plan(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("failing warm line");
    played* self = open_search(3, 2000.0);
    stage* at = self->at;
    at->def.switch_margin = 1.0; // whatever the last plan was, it stays
    at->def.iterations = 200;
    for (uint32_t k = 0; k < test_rounds(300); ++k) {
        stage_fill(at, &rng, 6, 8, 100.0, 160.0, 6.5);
        vg_joint_actions warm = { .step_count = at->def.steps };
        for (uint32_t t = 0; t < at->def.steps; ++t) {
            for (uint32_t i = 0; i < 6; ++i) {
                warm.actions[t][i] = (uint8_t)test_rng_below(&rng, 5);
            }
        }
        (void)run(self, k, &warm);
        if (self->decision.report.nodes_first > 0) {
            check_plan(at, &self->decision, false); // so dense that some body is too close to others
        }
    }
    close_search(self);
}

static uint8_t change_of(uint8_t action)
{
    return action == VERGE_CHANGE_LEFT || action == VERGE_CHANGE_RIGHT ? action : 0;
}

// Sides in their order, each once: an earlier begin and a longer change are no other changes.
static void append_change(char* list, int side, uint32_t step, uint32_t* first)
{
    const size_t length = strlen(list);
    const char letter = side == VERGE_CHANGE_LEFT ? 'l' : 'r';
    if (side != 0 && (length == 0 || list[length - 1] != letter)) {
        *first = length == 0 ? step : *first;
        list[length] = letter;
        list[length + 1] = '\0';
    }
}

/// Share of X_flow of the vehicles that two lines send across later or to other sides.
static double share_switched(const stage* at, const vg_joint_actions* a, const vg_joint_actions* b)
{
    double share = 0.0;
    for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
        char before[VERGE_STEPS_MAX + 1] = "", now[VERGE_STEPS_MAX + 1] = "";
        uint32_t first[2] = { at->def.steps, at->def.steps };
        for (uint32_t t = 0; t < at->def.steps; ++t) {
            append_change(before, change_of(a->actions[t][i]), t, &first[0]);
            append_change(now, change_of(b->actions[t][i]), t, &first[1]);
        }
        const bool same = strcmp(before, now) == 0 && first[1] <= first[0];
        share += same ? 0.0 : (double)at->scene.weight[i];
    }
    return share;
}

static void a_plan_must_beat_the_warm_line_by_the_margin_of_those_it_changes(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("switch margin");
    played* self = open_search(3, 2000.0);
    stage* at = self->at;
    at->def.iterations = 600;
    uint32_t kept = 0, rounds = test_rounds(40);
    for (uint32_t k = 0; k < rounds; ++k) {
        stage_fill(at, &rng, 3, 2, 100.0, 250.0, 20.0);
        const double first = run(self, k, NULL);
        const vg_joint_actions line = self->decision.line;
        if (self->decision.report.nodes_first == 0) {
            continue; // no plan without conflict was found: nothing to keep to
        }
        const double again = run(self, k + 1000, &line);
        CHECK_BETWEEN(again, first - 1e-12, 1.0); // never worse than the line it starts from
        const bool same = memcmp(&line, &self->decision.line, sizeof line) == 0;
        const double share = share_switched(at, &line, &self->decision.line);
        assert_true(same || again >= first + at->def.switch_margin * share - 1e-9);
        kept += same;
    }
    assert_true(kept > 0);
    close_search(self);
}

/// Two bodies that overlap: every plan begins with a conflict, and all rewards are below zero.
static void a_scene_without_any_plan_free_of_conflicts_has_a_plan(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("overlap");
    played* self = open_search(2, 2000.0);
    for (uint32_t k = 0; k < test_rounds(20); ++k) {
        stage_clear(self->at);
        self->at->def.iterations = 3000;
        stage_add(self->at, true, 0, 100.0, 0.0, test_rng_between(&rng, 0.0, 10.0), 1);
        stage_add(self->at, k % 2 == 0, 0, 101.0, 0.5, test_rng_between(&rng, 0.0, 10.0), -1);
        stage_add(self->at, false, 1, 100.0, 0.0, test_rng_between(&rng, 0.0, 10.0), -1);
        stage_begin(self->at);
        CHECK_BETWEEN(run(self, k, NULL), 0.0, 1.0);
        check_plan(self->at, &self->decision, false);
    }
    close_search(self);
}

// ---------------------------------------------------------------------------- budget and pool

static void the_budget_is_spent_to_the_last_iteration(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("budget");
    played* self = open_search(3, 2000.0);
    stage* at = self->at;
    static const uint32_t budgets[] = { 1, 2, 3, 4, 7, 100, 1001 };
    for (uint32_t k = 0; k < sizeof budgets / sizeof budgets[0] * 4; ++k) {
        at->def.iterations = budgets[k / 4];
        at->def.search = k % 2 == 0 ? VERGE_SEARCH_BEST : VERGE_SEARCH_PAPER;
        stage_fill(at, &rng, 3, 3, 100.0, 250.0, 12.0);
        vg_joint_actions warm = { .step_count = at->def.steps };
        (void)run(self, k, k % 4 < 2 ? NULL : &warm);
        const verge_search_report* report = &self->decision.report;
        assert_int_equal(report->iterations, budgets[k / 4]);
        CHECK_BETWEEN(report->nodes, 1, budgets[k / 4] + 1);
        assert_true(report->depth <= at->def.steps && report->nodes_first <= report->nodes);
        CHECK_BETWEEN(report->reward, 0.0, 1.0);
        assert_int_equal(report->unexpanded, 0);
    }
    close_search(self);
}

static void a_full_pool_is_counted_and_does_not_end_the_search(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("full pool");
    played* self = open_search(3, 2000.0);
    stage* at = self->at;
    at->def.nodes_max = 8;
    uint32_t full = 0;
    at->def.iterations = 800;
    for (uint32_t k = 0; k < 8; ++k) {
        at->def.search = k % 2 == 0 ? VERGE_SEARCH_BEST : VERGE_SEARCH_PAPER;
        stage_fill(at, &rng, 4, 2, 100.0, 500.0, 30.0);
        const double reward = run(self, k, NULL);
        assert_true(self->decision.report.nodes <= 8);
        full += self->decision.report.nodes == 8;
        assert_int_equal(self->decision.report.iterations, 800);
        assert_true(self->decision.report.nodes < 8 || self->decision.report.unexpanded > 0);
        assert_int_equal(self->decision.line.step_count, at->def.steps);
        assert_true(reward > 0.0);
    }
    assert_true(full > 4);
    close_search(self);
}

static void one_seed_one_plan_and_other_seeds_other_searches(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("seeds");
    played* self = open_search(4, 2000.0);
    stage* at = self->at;
    at->def.iterations = 300;
    uint32_t different = 0;
    for (uint32_t k = 0; k < 20; ++k) {
        stage_fill(at, &rng, 6, 4, 100.0, 250.0, 10.0);
        (void)run(self, 5, NULL);
        const stage_decision once = self->decision;
        (void)run(self, 5, NULL);
        assert_memory_equal(&once.report, &self->decision.report, sizeof once.report);
        assert_memory_equal(&once.line, &self->decision.line, sizeof once.line);
        (void)run(self, 6, NULL);
        different += memcmp(&once.report, &self->decision.report, sizeof once.report) != 0;
    }
    assert_true(different > 10);
    close_search(self);
}

// ---------------------------------------------------------------------------- the tree

/// What a complete tree of a scene holds: nodes, and joint actions that were pruned.
typedef struct tree_size {
    uint32_t nodes, pruned;
} tree_size;

/// Adds all nodes below a flow.
static void add_below(const stage* at, const vg_flow* flow, uint32_t step_index, tree_size* size)
{
    if (step_index == at->def.steps || vg_flow_terminal(&at->scene, flow)) {
        return;
    }
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow_moves(&at->scene, flow, &moves);
    uint32_t combinations = 1;
    for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
        combinations *= VERGE_ACTION_COUNT;
    }
    for (uint32_t number = 0; number < combinations; ++number) {
        uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
        if (!legal_joint_action(at, &moves, number, actions)) {
            continue;
        }
        if (vg_flow_conflicts(&at->scene, flow, &moves, actions) != 0) {
            ++size->pruned;
            continue;
        }
        vg_flow next = *flow;
        vg_flow_advance(&at->scene, flow, &moves, actions, &next);
        ++size->nodes;
        add_below(at, &next, step_index + 1, size);
    }
}

static void a_search_with_time_enough_meets_each_joint_action_of_each_node_once(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("complete tree");
    played* self = open_search(3, 2000.0);
    stage* at = self->at;
    uint32_t conflicts = 0;
    for (uint32_t k = 0; k < test_rounds(30); ++k) {
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 2), test_rng_below(&rng, 4), 100.0, 140.0,
                   7.0);
        at->def.steps = 2;
        at->def.search = VERGE_SEARCH_PAPER;
        at->def.iterations = 60000;
        at->def.nodes_max = many_nodes;
        at->def.vehicles_max = 8;
        at->def.controlled_max = 2;
        (void)run(self, k, NULL);
        tree_size all = { .nodes = 1 }; // the root
        add_below(at, &at->root, 0, &all);
        assert_int_equal(self->decision.report.nodes, all.nodes);
        assert_int_equal(self->decision.report.pruned, all.pruned);
        conflicts += all.pruned;
    }
    assert_true(!test_rounds_suffice() || conflicts > 0);
    close_search(self);
}

/// How often an action was drawn, less how often it was expected, in standard deviations.
typedef struct tally {
    double excess, variance;
} tally;

static void count(tally* to, bool drawn, double chance)
{
    to->excess += (drawn ? 1.0 : 0.0) - chance;
    to->variance += chance * (1.0 - chance);
}

static double deviations(const tally* of)
{
    return of->variance > 1e-9 ? fabs(of->excess) / sqrt(of->variance) : 0.0;
}

/// Where every plan earns the same the first one stays: one random simulation. Its first step is a
/// node's first joint action, the others are drawn by the simulation.
static void without_preference_actions_are_uniform_and_independent(void** state)
{
    (void)state;
    enum { planned = 4, draws = 4000 };
    static tally alone[2][planned][VERGE_ACTION_COUNT];
    static tally pairs[planned][planned][VERGE_ACTION_COUNT][VERGE_ACTION_COUNT];
    memset(alone, 0, sizeof alone);
    memset(pairs, 0, sizeof pairs);
    played* self = open_search(3, 4000.0);
    stage* at = self->at;
    at->def.reward_target = at->def.reward_lane = at->def.reward_consistency = 0.0;
    at->def.reward_room = 0.0;
    at->def.iterations = 5; // one of them is the tree's
    for (uint32_t i = 0; i < planned; ++i) { // far apart: no vehicle is in the path of another one
        (void)stage_add(at, true, 1, 100.0 + 500.0 * i, 0.0, 8.0, i % 2 == 0 ? 0 : 2);
    }
    stage_begin(at);
    for (uint32_t n = 0; n < draws; ++n) {
        (void)run(self, n, NULL);
        for (uint32_t t = 0; t < 2; ++t) {
            const uint8_t* actions = self->decision.line.actions[t];
            vg_moves moves;
            memset(&moves, 0, sizeof moves);
            vg_flow_moves(&at->scene, &self->decision.flows[t], &moves);
            for (uint32_t i = 0; i < planned; ++i) {
                const double size = __builtin_popcount(moves.legal[i]);
                for (uint8_t a = 0; a < VERGE_ACTION_COUNT; ++a) {
                    const bool legal = (moves.legal[i] >> a & 1) != 0;
                    assert_true(legal || actions[i] != a);
                    count(&alone[t][i][a], actions[i] == a, legal ? 1.0 / size : 0.0);
                    const uint32_t j = (i + 1) % planned;
                    const double other = __builtin_popcount(moves.legal[j]);
                    for (uint8_t b = 0; b < VERGE_ACTION_COUNT && t == 1; ++b) {
                        const bool both = legal && (moves.legal[j] >> b & 1) != 0;
                        count(&pairs[i][j][a][b], actions[i] == a && actions[j] == b,
                              both ? 1.0 / (size * other) : 0.0);
                    }
                }
            }
        }
    }
    for (uint32_t i = 0; i < planned; ++i) {
        for (uint8_t a = 0; a < VERGE_ACTION_COUNT; ++a) {
            CHECK_AT_MOST(deviations(&alone[0][i][a]), 4.5);
            CHECK_AT_MOST(deviations(&alone[1][i][a]), 4.5);
            for (uint8_t b = 0; b < VERGE_ACTION_COUNT; ++b) {
                CHECK_AT_MOST(deviations(&pairs[i][(i + 1) % planned][a][b]), 4.5);
            }
        }
    }
    close_search(self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_best_plan_seen_is_the_best_of_all_plans),
        cmocka_unit_test(the_papers_plan_comes_near_the_best_of_all_plans_and_never_above),
        cmocka_unit_test(plans_are_legal_and_free_of_conflicts),
        cmocka_unit_test(a_warm_line_that_fails_does_not_become_the_plan),
        cmocka_unit_test(a_scene_without_any_plan_free_of_conflicts_has_a_plan),
        cmocka_unit_test(a_plan_must_beat_the_warm_line_by_the_margin_of_those_it_changes),
        cmocka_unit_test(the_budget_is_spent_to_the_last_iteration),
        cmocka_unit_test(a_full_pool_is_counted_and_does_not_end_the_search),
        cmocka_unit_test(one_seed_one_plan_and_other_seeds_other_searches),
        cmocka_unit_test(a_search_with_time_enough_meets_each_joint_action_of_each_node_once),
        cmocka_unit_test(without_preference_actions_are_uniform_and_independent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
