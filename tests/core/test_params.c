// The def: every parameter's range is checked and named, the defaults are the paper's.
#include "check.h"

#include "verge/planner.h"

#include <math.h>
#include <string.h>

static double read_field(const verge_planner_def* def, const verge_param* param)
{
    const char* field = (const char*)def + param->offset;
    double real = 0.0;
    uint64_t wide = 0;
    uint32_t narrow = 0;
    switch (param->kind) {
    case VERGE_PARAM_DOUBLE: memcpy(&real, field, sizeof real); return real;
    case VERGE_PARAM_U64: memcpy(&wide, field, sizeof wide); return (double)wide;
    default: memcpy(&narrow, field, sizeof narrow); return (double)narrow;
    }
}

static void write_field(verge_planner_def* def, const verge_param* param, double value)
{
    char* field = (char*)def + param->offset;
    const uint64_t wide = (uint64_t)value;
    const uint32_t narrow = (uint32_t)value;
    switch (param->kind) {
    case VERGE_PARAM_DOUBLE: memcpy(field, &value, sizeof value); break;
    case VERGE_PARAM_U64: memcpy(field, &wide, sizeof wide); break;
    default: memcpy(field, &narrow, sizeof narrow); break;
    }
}

static void refuses(const verge_planner_def* def, const char* name)
{
    const char* fault = NULL;
    assert_int_equal(verge_planner_check(def, &fault), VERGE_ERR_DEF);
    assert_non_null(fault);
    assert_string_equal(fault, name);
    assert_int_equal(verge_planner_check(def, NULL), VERGE_ERR_DEF);
}

static void the_defaults_are_accepted_and_are_the_papers(void** state)
{
    (void)state;
    const verge_planner_def def = verge_planner_default_def();
    const char* fault = "something";
    assert_int_equal(verge_planner_check(&def, &fault), VERGE_OK);
    assert_null(fault);
    assert_int_equal(def.iterations, 3000); // paper, section 4.1
    CHECK_NEAR(def.step_s, 1.5, 0.0);       // section 4
    CHECK_NEAR(def.exploration, 1.0 / sqrt(2.0), 1e-15);
    CHECK_NEAR(def.reward_target + def.reward_lane + def.reward_consistency, 1.0, 1e-12);
    assert_true(def.steps * def.step_s >= (def.points - 1) * def.point_s);
}

static void every_parameter_out_of_its_range_is_named(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_param* params = verge_planner_params(&count);
    assert_true(count > 30);
    for (uint32_t i = 0; i < count; ++i) {
        const verge_param* param = &params[i];
        if (param->kind == VERGE_PARAM_U64) {
            continue; // every value is allowed
        }
        const bool real = param->kind == VERGE_PARAM_DOUBLE;
        const double slack = real ? 1e-9 + 1e-9 * fabs(param->max) : 1.0;
        verge_planner_def def = verge_planner_default_def();
        write_field(&def, param, param->max + slack);
        refuses(&def, param->name);
        if (real || param->min >= 1.0) {
            write_field(&def, param, param->min - slack);
            refuses(&def, param->name);
        }
        if (real) {
            write_field(&def, param, NAN);
            refuses(&def, param->name);
            write_field(&def, param, INFINITY);
            refuses(&def, param->name);
            write_field(&def, param, -INFINITY);
            refuses(&def, param->name);
        }
    }
}

static bool is(const verge_param* param, const char* name)
{
    return strcmp(param->name, name) == 0;
}

/// Gives the other fields of the relations `param` takes part in values that its own one allows.
static void make_room(verge_planner_def* def, const verge_param* param, double value)
{
    double* const rewards[] = { &def->reward_target, &def->reward_lane,
                                &def->reward_consistency };
    const char* const reward_names[] = { "reward_target", "reward_lane", "reward_consistency" };
    for (int i = 0; i < 3; ++i) {
        if (is(param, reward_names[i])) { // the three sum to 1
            *rewards[(i + 1) % 3] = *rewards[(i + 2) % 3] = 0.5 * (1.0 - value);
        }
    }
    if (is(param, "vehicles_max")) {
        def->controlled_max = 1;
    } else if (is(param, "controlled_max")) {
        def->vehicles_max = VERGE_VEHICLES_MAX;
    } else if (is(param, "steps") || is(param, "step_s")) { // decisions cover the trajectory
        def->points = 11;
        def->point_s = 0.05;
    } else if (is(param, "points") || is(param, "point_s")) {
        def->steps = VERGE_STEPS_MAX;
        def->step_s = 5.0;
    }
}

static void the_ends_of_a_range_belong_to_it(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_param* params = verge_planner_params(&count);
    for (uint32_t i = 0; i < 2 * count; ++i) {
        const verge_param* param = &params[i / 2];
        if (param->kind == VERGE_PARAM_U64) {
            continue; // every value is allowed
        }
        const double end = i % 2 == 0 ? param->min : param->max;
        verge_planner_def def = verge_planner_default_def();
        make_room(&def, param, end);
        write_field(&def, param, end);
        const char* fault = NULL;
        if (verge_planner_check(&def, &fault) != VERGE_OK) {
            fail_msg("%s = %g: %s is refused", param->name, end, fault);
        }
    }
}

static void relations_between_parameters_are_checked(void** state)
{
    (void)state;
    verge_planner_def def = verge_planner_default_def();
    def.sample_offsets = 12;
    refuses(&def, "sample_offsets");
    def = verge_planner_default_def();
    def.vehicles_max = 4;
    def.controlled_max = 5;
    refuses(&def, "controlled_max");
    def = verge_planner_default_def();
    def.reward_lane = 0.4;
    refuses(&def, "reward_target");
    def = verge_planner_default_def();
    def.steps = 2;
    def.step_s = 1.0; // 2 s of decisions for 3 s of trajectory
    refuses(&def, "steps");
}

static void a_def_that_was_not_defaulted_is_refused(void** state)
{
    (void)state;
    verge_planner_def def;
    memset(&def, 0, sizeof def);
    refuses(&def, "cookie");
    def = verge_planner_default_def();
    def.cookie ^= 1u;
    refuses(&def, "cookie");
}

static void the_table_lists_each_field_once_in_order(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_param* params = verge_planner_params(&count);
    const verge_planner_def def = verge_planner_default_def();
    for (uint32_t i = 0; i < count; ++i) {
        assert_true(strlen(params[i].name) > 0 && strlen(params[i].unit) > 0);
        assert_true(strlen(params[i].text) > 0);
        assert_true(params[i].min < params[i].max);
        CHECK_BETWEEN(read_field(&def, &params[i]), params[i].min, params[i].max);
        for (uint32_t j = 0; j < i; ++j) {
            assert_true(strcmp(params[i].name, params[j].name) != 0);
            assert_true(params[j].offset < params[i].offset);
        }
    }
    // No scalar is missing: the table covers the def between road and executor without holes
    // but for alignment.
    size_t covered = offsetof(verge_planner_def, seed);
    for (uint32_t i = 0; i < count; ++i) {
        const bool wide = params[i].kind == VERGE_PARAM_DOUBLE || params[i].kind == VERGE_PARAM_U64;
        assert_true(params[i].offset >= covered && params[i].offset - covered < 8);
        covered = params[i].offset + (wide ? 8 : 4);
    }
    assert_true(offsetof(verge_planner_def, executor) - covered < 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_defaults_are_accepted_and_are_the_papers),
        cmocka_unit_test(every_parameter_out_of_its_range_is_named),
        cmocka_unit_test(the_ends_of_a_range_belong_to_it),
        cmocka_unit_test(relations_between_parameters_are_checked),
        cmocka_unit_test(a_def_that_was_not_defaulted_is_refused),
        cmocka_unit_test(the_table_lists_each_field_once_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
