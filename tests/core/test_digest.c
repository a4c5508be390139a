// The digest: each field counts, padding and the sign of zero do not.
#include "stage.h"

#include "digest.h"

static verge_plan plan;

static void fill_plan(uint64_t seed)
{
    test_rng rng = test_rng_from(seed);
    memset(&plan, 0, sizeof plan);
    plan.utime = 1700000000000000;
    plan.vehicle_count = 2;
    for (uint32_t v = 0; v < plan.vehicle_count; ++v) {
        verge_vehicle_plan* of = &plan.vehicles[v];
        of->vehicle_id = 10 + (int32_t)v;
        of->action_count = 3;
        of->point_count = 4;
        for (uint32_t t = 0; t < of->action_count; ++t) {
            of->actions[t] = (verge_action_step){
                .action = VERGE_ACCELERATE, .lane_id = 2, .t0 = 1.5 * t, .t1 = 1.5 * (t + 1),
                .s = test_rng_unit(&rng), .d = test_rng_unit(&rng), .v = test_rng_unit(&rng),
                .ahead_id = 11, .behind_id = -1,
            };
        }
        for (uint32_t k = 0; k < of->point_count; ++k) {
            double* values = &of->points[k].t;
            for (uint32_t i = 0; i < sizeof of->points[k] / sizeof *values; ++i) {
                values[i] = test_rng_between(&rng, -10.0, 10.0);
            }
        }
        of->why = (verge_cause){ .code = VERGE_WHY_AREA, .vehicle_id = 11, .lane_id = 2 };
        of->pass_count = 2;
        of->passes[1] = (verge_pass){ .lane_id = 2, .other_lane_id = 4, .after_id = 11 };
        of->cost = (verge_cost){ .total = 1.0, .curvature = 0.25, .jerk = 0.75 };
    }
    plan.prediction_count = 1;
    plan.predictions[0].vehicle_id = 3;
    plan.predictions[0].point_count = 4;
}

static void counts(const char* what, uint64_t before)
{
    if (vg_digest_plan(&plan) == before) {
        fail_msg("the digest does not know of %s", what);
    }
}

/// Changes a double by its last bit, checks, and changes it back.
static void counts_double(const char* what, double* field, uint64_t before)
{
    const double kept = *field;
    *field = nextafter(kept, INFINITY);
    counts(what, before);
    *field = kept;
}

#define COUNTS_INTEGER(field)                                                                    \
    do {                                                                                         \
        (field) ^= 1;                                                                            \
        counts(#field, before);                                                                  \
        (field) ^= 1;                                                                            \
    } while (0)

static void every_field_of_every_vehicle_plan_counts(void** state)
{
    (void)state;
    fill_plan(1);
    const uint64_t before = vg_digest_plan(&plan);
    COUNTS_INTEGER(plan.utime);
    for (uint32_t v = 0; v < plan.vehicle_count; ++v) {
        verge_vehicle_plan* of = &plan.vehicles[v];
        COUNTS_INTEGER(of->vehicle_id);
        COUNTS_INTEGER(of->status);
        COUNTS_INTEGER(of->reason);
        COUNTS_INTEGER(of->action_count);
        COUNTS_INTEGER(of->decided);
        COUNTS_INTEGER(of->point_count);
        COUNTS_INTEGER(of->why.code);
        COUNTS_INTEGER(of->why.vehicle_id);
        COUNTS_INTEGER(of->why.lane_id);
        COUNTS_INTEGER(of->pass_count);
        for (uint32_t i = 0; i < of->pass_count; ++i) {
            COUNTS_INTEGER(of->passes[i].lane_id);
            COUNTS_INTEGER(of->passes[i].other_lane_id);
            COUNTS_INTEGER(of->passes[i].after_id);
        }
        for (uint32_t t = 0; t < of->action_count; ++t) {
            verge_action_step* step = &of->actions[t];
            COUNTS_INTEGER(step->action);
            COUNTS_INTEGER(step->lane_id);
            COUNTS_INTEGER(step->turn_signal);
            COUNTS_INTEGER(step->ahead_id);
            COUNTS_INTEGER(step->behind_id);
            step->brake_light = !step->brake_light;
            counts("brake_light", before);
            step->brake_light = !step->brake_light;
            counts_double("t0", &step->t0, before);
            counts_double("t1", &step->t1, before);
            counts_double("s", &step->s, before);
            counts_double("d", &step->d, before);
            counts_double("v", &step->v, before);
        }
        for (uint32_t k = 0; k < of->point_count; ++k) {
            double* values = &of->points[k].t;
            for (uint32_t i = 0; i < sizeof of->points[k] / sizeof *values; ++i) {
                counts_double("a value of a point", &values[i], before);
            }
        }
        double* costs = &of->cost.total;
        for (uint32_t i = 0; i < sizeof of->cost / sizeof *costs; ++i) {
            counts_double("a cost", &costs[i], before);
        }
    }
    COUNTS_INTEGER(plan.predictions[0].vehicle_id);
    counts_double("a prediction's x", &plan.predictions[0].points[3].x, before);
    counts_double("a prediction's y", &plan.predictions[0].points[3].y, before);
    counts_double("a prediction's heading", &plan.predictions[0].points[3].heading, before);
    assert_true(vg_digest_plan(&plan) == before);
}

static void the_search_report_and_what_lies_beyond_the_counts_do_not_count(void** state)
{
    (void)state;
    fill_plan(2);
    const uint64_t before = vg_digest_plan(&plan);
    memset(&plan.search, 0x5a, sizeof plan.search);
    memset(&plan.vehicles[plan.vehicle_count], 0x5a, sizeof plan.vehicles[0]);
    memset(&plan.vehicles[0].points[plan.vehicles[0].point_count], 0x5a, sizeof(verge_point));
    memset(&plan.predictions[plan.prediction_count], 0x5a, sizeof plan.predictions[0]);
    assert_true(vg_digest_plan(&plan) == before);
}

static void equal_numbers_have_equal_digests(void** state)
{
    (void)state;
    fill_plan(3);
    plan.vehicles[0].points[0].jerk = 0.0;
    const uint64_t before = vg_digest_plan(&plan);
    plan.vehicles[0].points[0].jerk = -0.0;
    assert_true(vg_digest_plan(&plan) == before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_of_every_vehicle_plan_counts),
        cmocka_unit_test(the_search_report_and_what_lies_beyond_the_counts_do_not_count),
        cmocka_unit_test(equal_numbers_have_equal_digests),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
