/// Goal: the value-to-go is the least time to the target and on, by keeping lanes and changing
///       them.
/// Method: parallel lanes of random lengths against a program over every metre, in double
///         precision, that shares nothing with the tables but the costs of a change.
#include "stage.h"

#include "traffic/value.h"

enum { METRES = 1600, LANES = 4 };
static const double never = 1e9;

typedef struct oracle {
    double time[LANES][METRES + 200]; ///< [s] from every metre
    int    length[LANES];             ///< [m]
    double limit;                     ///< [m/s]
    int    target;                    ///< lane, -1 none
    int    count;
} oracle;

// Time at the end of a lane: the road goes on to the reach at the limit, or it does not.
static double end_time(const oracle* o, int lane, int from)
{
    const double beyond = fmax(VG_VALUE_REACH - (o->length[lane] - from), 0.0) / o->limit;
    bool others_go_on = false;
    for (int i = 0; i < o->count; ++i) {
        others_go_on = others_go_on || o->length[i] >= o->length[lane] + 20;
    }
    const bool wrong = o->target >= 0 && lane != o->target;
    return beyond + (wrong || others_go_on ? (double)VG_VALUE_DEAD_END : 0.0);
}

// A change takes 3 s and 12 m at least, costs 1 s, and up to 15 s more where less than 10 s and 15 m
// are left for it; one of 10 m at walking speed costs 21 s.
static double change_time(const oracle* o, int lane, int beside, int s)
{
    const int both = o->length[lane] < o->length[beside] ? o->length[lane] : o->length[beside];
    const double length = fmax(3.0 * o->limit, 12.0), left = both - s - length;
    double best = never;
    if (left >= 0.0) {
        const double share = fmax(1.0 - left / (10.0 * o->limit + 15.0), 0.0);
        best = length / o->limit + 1.0 + 15.0 * share * share + o->time[beside][s + (int)length];
    }
    return both - s >= 4 ? fmin(best, 21.0 + o->time[beside][s + 10]) : best;
}

static void solve(oracle* o, int from)
{
    for (int lane = 0; lane < o->count; ++lane) {
        for (int s = 0; s < METRES + 200; ++s) {
            o->time[lane][s] = s >= o->length[lane] ? end_time(o, lane, from) : never;
        }
    }
    for (int pass = 0; pass < LANES; ++pass) {
        for (int s = METRES - 1; s >= 0; --s) {
            for (int lane = 0; lane < o->count; ++lane) {
                if (s >= o->length[lane]) {
                    continue;
                }
                double best = fmin(o->time[lane][s], 1.0 / o->limit + o->time[lane][s + 1]);
                if (lane > 0) {
                    best = fmin(best, change_time(o, lane, lane - 1, s));
                }
                if (lane + 1 < o->count) {
                    best = fmin(best, change_time(o, lane, lane + 1, s));
                }
                o->time[lane][s] = best;
            }
        }
    }
}

static void the_table_holds_the_least_time_of_every_place(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("value");
    static oracle o;
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        o.count = 1 + (int)test_rng_below(&rng, LANES);
        o.target = (int)test_rng_below(&rng, (uint32_t)o.count + 1u) - 1;
        o.limit = STAGE_LIMIT;
        stage* at = stage_open_best((uint32_t)o.count, 400.0);
        for (int i = 0; i < o.count; ++i) {
            o.length[i] = 400 + 50 * (int)test_rng_below(&rng, (METRES - 400) / 50);
            at->points[i][1][0] = o.length[i];
        }
        stage_build(at);
        const int lane = (int)test_rng_below(&rng, (uint32_t)o.count), from = 60;
        stage_add(at, true, (uint32_t)lane, from, 0.0, 8.0, o.target);
        stage_begin(at);
        solve(&o, from);
        for (int i = 0; i < o.count; ++i) {
            for (int s = from; s < o.length[i] - 60; s += 7) {
                const double time = (double)vg_value_at(at->value, 0, (uint32_t)i, (float)s);
                double least = never, most = 0.0;
                for (int near = s - 12; near <= s + 12; ++near) { // nodes of 8 m, bins of 4 m
                    least = fmin(least, o.time[i][near]);
                    most = fmax(most, o.time[i][near]);
                }
                if (most < 0.5 * never) {
                    // The room left for a change is known to 8 m: up to 2.7 s where it is urgent.
                    const double slack = 0.8 + 2.7 * (o.count - 1);
                    CHECK_BETWEEN(time, least - slack, most + slack);
                }
            }
        }
        stage_close(at);
    }
}

static void a_lane_that_ends_costs_more_the_nearer_its_end_is(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 1500.0);
    at->points[0][1][0] = 400.0;
    stage_build(at);
    stage_add(at, true, 0, 60.0, 0.0, 8.0, -1);
    stage_begin(at);
    double before = 0.0;
    for (float s = 60.0f; s < 396.0f; s += 4.0f) {
        const double lost = (double)(vg_value_at(at->value, 0, 0, s) - vg_value_at(at->value, 0, 1, s));
        assert_true(lost >= before - 0.05);
        before = lost;
    }
    CHECK_BETWEEN(before, 20.0, 61.0);
    stage_close(at);
}

static void a_target_out_of_reach_is_known_and_costs_nothing(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 1000.0);
    at->lanes[0].left = at->lanes[1].right = VERGE_NO_LANE;
    stage_build(at);
    stage_add(at, true, 0, 60.0, 0.0, 8.0, 1);
    stage_begin(at);
    assert_true(vg_value_unreachable(at->value, 0));
    CHECK_NEAR(vg_value_at(at->value, 0, 0, 60.0f), VG_VALUE_REACH / STAGE_LIMIT, 1.0);
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_table_holds_the_least_time_of_every_place),
        cmocka_unit_test(a_lane_that_ends_costs_more_the_nearer_its_end_is),
        cmocka_unit_test(a_target_out_of_reach_is_known_and_costs_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
