// The joint search: against the enumeration of every plan on small scenes, and its parts (Eq. 1,
// walk over joint actions, draws, budget) one by one. Includes the source to reach them.
#include "decide.h"

#include "decide/mcts.c"

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
    vg_search_run(self->tree, &self->at->scene, &self->at->root, &random, warm, &self->decision.line,
                  &self->decision.report);
    stage_drive(self->at, &self->decision);
    return self->decision.report.reward;
}

// ---------------------------------------------------------------------------- every plan there is

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
        bool legal = true;
        for (uint32_t i = 0, rest = number; i < count; ++i, rest /= VERGE_ACTION_COUNT) {
            actions[i] = (uint8_t)(rest % VERGE_ACTION_COUNT);
            legal = legal && ((moves.legal[i] >> actions[i]) & 1u) != 0;
        }
        if (legal && vg_flow_conflicts(&at->scene, flow, &moves, actions) == 0) {
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
            solved++;
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

/// The line's steps are legal, and free of conflicts until the flow is terminal.
static void check_plan(const stage* at, const stage_decision* decision)
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
        if (!over_already) {
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
        stage_fill(self->at, &rng, 1 + test_rng_below(&rng, 8), test_rng_below(&rng, 6), 100.0,
                   300.0, 12.0);
        (void)run(self, k, NULL);
        if (self->decision.report.nodes_first > 0) { // a complete plan was seen
            check_plan(self->at, &self->decision);
        }
    }
    close_search(self);
}

/// A dense scene and a wish nobody may fulfil.
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
            check_plan(at, &self->decision);
        }
    }
    close_search(self);
}

static uint8_t change_of(uint8_t action)
{
    return action == VERGE_CHANGE_LEFT || action == VERGE_CHANGE_RIGHT ? action : 0;
}

/// Share of X_flow of the vehicles that two lines send across at other times or to other sides.
static double share_switched(const stage* at, const vg_joint_actions* a, const vg_joint_actions* b)
{
    double share = 0.0;
    for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
        bool same = true;
        for (uint32_t t = 0; t < at->def.steps; ++t) {
            same = same && change_of(a->actions[t][i]) == change_of(b->actions[t][i]);
        }
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

static void shares_fall_as_one_over_half_the_step_plus_one(void** state)
{
    (void)state;
    for (uint32_t steps = 2; steps <= VERGE_STEPS_MAX; ++steps) {
        uint32_t sum = 0;
        for (uint32_t t = 0; t < steps; ++t) {
            const double ratio = (double)share_of(1000000, t, steps) / share_of(1000000, 0, steps);
            CHECK_NEAR(ratio, 1.0 / (t / 2.0 + 1.0), 1e-4);
            sum += share_of(3000, t, steps);
        }
        CHECK_BETWEEN(sum, 3000.0 - steps, 3000.0);
    }
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

// ---------------------------------------------------------------------------- parts

/// A search whose vehicles are far from one another; legal sets are set by hand.
static void set_apart(search* to, played* self, uint32_t planned, vg_random* random)
{
    stage_clear(self->at);
    for (uint32_t i = 0; i < planned; ++i) {
        (void)stage_add(self->at, true, 1, 100.0 + 80.0 * i, 0.0, 10.0, -1);
    }
    stage_begin(self->at);
    memset(&self->decision.report, 0, sizeof self->decision.report);
    memset(to, 0, sizeof *to);
    to->tree = self->tree;
    to->scene = &self->at->scene;
    to->random = random;
    to->report = &self->decision.report;
    to->flow = &to->buffer[0];
    to->next = &to->buffer[1];
    *to->flow = self->at->root;
    vg_flow_moves(&self->at->scene, to->flow, &to->moves);
}

static uint64_t key_of(const uint8_t* actions, uint32_t count)
{
    uint64_t key = 0;
    for (uint32_t i = 0; i < count; ++i) {
        key = key * VERGE_ACTION_COUNT + actions[i];
    }
    return key;
}

static void a_node_meets_each_of_its_joint_actions_once(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("walk");
    played* self = open_search(3, 2000.0);
    for (uint32_t k = 0; k < test_rounds(100); ++k) {
        vg_random random = vg_random_from(k, 1);
        const uint32_t planned = 1 + test_rng_below(&rng, 5);
        search with;
        set_apart(&with, self, planned, &random);
        uint32_t product = 1;
        for (uint32_t i = 0; i < planned; ++i) {
            with.moves.legal[i] = (uint8_t)(1 + test_rng_below(&rng, 31));
            product *= (uint32_t)__builtin_popcount(with.moves.legal[i]);
        }
        static uint8_t met[3125];
        memset(met, 0, sizeof met);
        vg_metanode node = { .opened = 0 };
        open_node(&with, &node);
        uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
        uint32_t count = 0;
        while (next_joint_action(&with, &node, actions)) {
            for (uint32_t i = 0; i < planned; ++i) {
                assert_true(((with.moves.legal[i] >> actions[i]) & 1u) != 0);
            }
            assert_int_equal(met[key_of(actions, planned)]++, 0);
            count++;
        }
        assert_int_equal(count, product);
        assert_true(node.joint_left == 0);
    }
    close_search(self);
}

static void the_first_children_of_a_large_node_differ_in_every_vehicle(void** state)
{
    (void)state;
    played* self = open_search(3, 2000.0);
    uint32_t whole = 0;
    enum { nodes = 60, children = 500 };
    for (uint32_t k = 0; k < nodes; ++k) {
        vg_random random = vg_random_from(k, 1);
        search with;
        set_apart(&with, self, VERGE_CONTROLLED_MAX, &random);
        memset(with.moves.legal, 31, sizeof with.moves.legal); // 5^16 joint actions
        uint32_t seen[VERGE_CONTROLLED_MAX] = { 0 };
        vg_metanode node = { .opened = 0 };
        open_node(&with, &node);
        for (uint32_t n = 0; n < children; ++n) {
            uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
            assert_true(next_joint_action(&with, &node, actions));
            for (uint32_t i = 0; i < VERGE_CONTROLLED_MAX; ++i) {
                seen[i] |= 1u << actions[i];
            }
        }
        for (uint32_t i = 0; i < VERGE_CONTROLLED_MAX; ++i) {
            whole += seen[i] == 31u;
        }
    }
    // A stride may be in step with one vehicle's digit, seldom.
    CHECK_BETWEEN(whole, 0.95 * nodes * VERGE_CONTROLLED_MAX, nodes * VERGE_CONTROLLED_MAX);
    close_search(self);
}

/// Chi-square of counts against equal shares.
static double chi_square(const uint32_t* counts, uint32_t cells, double expected)
{
    double sum = 0.0;
    for (uint32_t c = 0; c < cells; ++c) {
        sum += (counts[c] - expected) * (counts[c] - expected) / expected;
    }
    return sum;
}

static void simulated_actions_are_uniform_and_independent_of_one_another(void** state)
{
    (void)state;
    enum { planned = 6, draws = 20000 };
    static const uint8_t legal[planned] = { 31, 7, 3, 15, 9, 31 };
    static uint32_t alone[planned][5], pairs[planned][planned][25], next[planned][25];
    memset(alone, 0, sizeof alone);
    memset(pairs, 0, sizeof pairs);
    memset(next, 0, sizeof next);
    played* self = open_search(3, 2000.0);
    vg_random random = vg_random_from(3, 0);
    search with;
    set_apart(&with, self, planned, &random);
    memcpy(with.moves.legal, legal, sizeof legal);
    uint8_t before[VERGE_CONTROLLED_MAX] = { 0 };
    for (uint32_t n = 0; n < draws; ++n) {
        uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
        draw(&with, actions, ~0u);
        for (uint32_t i = 0; i < planned; ++i) {
            alone[i][actions[i]]++;
            next[i][5 * before[i] + actions[i]] += n > 0;
            for (uint32_t j = 0; j < planned; ++j) {
                pairs[i][j][5 * actions[i] + actions[j]]++;
            }
        }
        memcpy(before, actions, sizeof before);
    }
    for (uint32_t i = 0; i < planned; ++i) {
        const uint32_t size = (uint32_t)__builtin_popcount(legal[i]);
        uint32_t packed[25], cells = 0;
        for (uint32_t a = 0; a < 5; ++a) {
            if (((legal[i] >> a) & 1u) != 0) {
                packed[cells++] = alone[i][a];
            } else {
                assert_int_equal(alone[i][a], 0);
            }
        }
        CHECK_AT_MOST(chi_square(packed, cells, (double)draws / size), 25.0); // p < 1e-4, 4 free
        for (uint32_t j = 0; j < planned; ++j) {
            const uint32_t* table = j == i ? next[i] : pairs[i][j]; // with itself: one draw later
            const uint32_t both = size * (uint32_t)__builtin_popcount(legal[j]);
            cells = 0;
            for (uint32_t a = 0; a < 25; ++a) {
                if (((legal[i] >> (a / 5)) & (legal[j] >> (a % 5)) & 1u) != 0) {
                    packed[cells++] = table[a];
                }
            }
            assert_int_equal(cells, both);
            CHECK_AT_MOST(chi_square(packed, cells, (double)draws / both), 60.0); // 24 free
        }
    }
    close_search(self);
}

static void selection_is_the_uct_of_equation_1(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("uct");
    played* self = open_search(3, 2000.0);
    stage_fill(self->at, &rng, 2, 0, 100.0, 250.0, 12.0);
    (void)run(self, 1, NULL);
    for (uint32_t k = 0; k < test_rounds(3000); ++k) {
        vg_random random = vg_random_from(k, 1);
        search with;
        set_apart(&with, self, 2, &random);
        const uint32_t children = 2 + test_rng_below(&rng, 20);
        vg_metanode* nodes = self->tree->nodes;
        uint32_t total = 1;
        for (uint32_t c = 1; c <= children; ++c) {
            const uint32_t visits = 1 + test_rng_below(&rng, k % 2 == 0 ? 50 : 9000);
            nodes[c] = (vg_metanode){ .parent = 0, .first_child = none, .visits = visits,
                                      .next_sibling = c < children ? (int32_t)c + 1 : none };
            nodes[c].mean = test_rng_unit(&rng);
            total += visits;
        }
        nodes[0] = (vg_metanode){ .parent = none, .first_child = 1, .visits = total };
        const double exploration = self->at->def.exploration;
        double values[32], best = -1.0;
        for (uint32_t c = 1; c <= children; ++c) {
            const double n = nodes[c].visits;
            values[c] = nodes[c].mean + 2.0 * exploration * sqrt(2.0 * log(total) / n);
            best = fmax(best, values[c]);
        }
        CHECK_NEAR(values[uct_child(&with, &nodes[0])], best, 1e-12);
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
        cmocka_unit_test(a_plan_must_beat_the_warm_line_by_the_margin_of_those_it_changes),
        cmocka_unit_test(the_budget_is_spent_to_the_last_iteration),
        cmocka_unit_test(shares_fall_as_one_over_half_the_step_plus_one),
        cmocka_unit_test(a_full_pool_is_counted_and_does_not_end_the_search),
        cmocka_unit_test(one_seed_one_plan_and_other_seeds_other_searches),
        cmocka_unit_test(a_node_meets_each_of_its_joint_actions_once),
        cmocka_unit_test(the_first_children_of_a_large_node_differ_in_every_vehicle),
        cmocka_unit_test(simulated_actions_are_uniform_and_independent_of_one_another),
        cmocka_unit_test(selection_is_the_uct_of_equation_1),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
