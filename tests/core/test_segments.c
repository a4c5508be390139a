// Action steps against vehicles moved by hand; segments against the decision they are made of.
#include "decide.h"

#include "motion/job.h"
#include "motion/segments.h"

static stage_decision decision;
static verge_vehicle_plan plan;
static vg_job job;
static vg_expected expected;

/// Expected states and segments of one vehicle, as the trajectory stage makes them.
static void make_segments(const stage* at, uint32_t vehicle)
{
    memset(&job, 0, sizeof job);
    job.def = &at->def;
    job.road = at->road;
    assert_true(vg_expected_from(&expected, &at->given, vehicle, &decision.vehicles[vehicle]));
    vg_segments_from(&expected, &job);
}

static void decide(stage* at, uint64_t seed)
{
    at->def.iterations = 300;
    at->def.nodes_max = 512;
    stage_decide(at, vg_random_from(seed, 0), &decision);
}

/// A vehicle on the stage's straight lanes, as its actions move it: lateral position from lane 0's
/// centre, and the paper's Table 1 by hand.
typedef struct by_hand {
    double s, y, v, distance;
} by_hand;

static by_hand drive_by_hand(const verge_planner_def* def, by_hand from, verge_action action)
{
    const double T = def->step_s, a = def->deceleration;
    by_hand to = from;
    to.distance = from.v * T;
    if (action == VERGE_ACCELERATE) {
        to.v = from.v + def->acceleration * T;
        to.distance = 0.5 * (from.v + to.v) * T;
    } else if (action == VERGE_DECELERATE) {
        to.v = fmax(0.0, from.v - a * T);
        to.distance = (from.v * from.v - to.v * to.v) / (2.0 * a); // it may stop within the step
    }
    to.s = from.s + to.distance;
    return to;
}

/// Distance to the nearest centreline. [m]
static double off_centre(double y)
{
    return fabs(y - STAGE_WIDTH * floor(y / STAGE_WIDTH + 0.5));
}

/// To the named side by half a lane at most; where a lane is kept, towards a centreline.
static void check_side(verge_action action, double y0, double y1)
{
    const double half = 0.5 * STAGE_WIDTH + 1e-4;
    if (action == VERGE_CHANGE_LEFT) {
        CHECK_BETWEEN(y1 - y0, 0.0, half);
    } else if (action == VERGE_CHANGE_RIGHT) {
        CHECK_BETWEEN(y0 - y1, 0.0, half);
    } else {
        CHECK_AT_MOST(off_centre(y1), off_centre(y0) + 1e-4);
    }
}

static double y_of(const verge_action_step* step)
{
    return STAGE_WIDTH * step->lane_id + step->d;
}

/// Nobody in the vehicle's path stands between it and the one named ahead of it.
static void check_ahead(const verge_decision* all, uint32_t slot, uint32_t t)
{
    const verge_action_step* own = &all->vehicles[slot].steps[t];
    const verge_vehicle_decision* named = verge_decision_of(all, own->ahead_id);
    const double reach = named != NULL ? named->steps[t].s : own->s + 100.0;
    assert_true(own->ahead_id == -1 || named->steps[t].s > own->s);
    for (uint32_t j = 0; j < all->vehicle_count; ++j) {
        const verge_action_step* other = &all->vehicles[j].steps[t];
        const bool in_path = fabs(y_of(other) - y_of(own)) < 1.5; // of bodies 2 m wide
        assert_false(j != slot && in_path && other->s > own->s + 0.01 && other->s < reach - 0.01);
    }
}

static void check_steps(const stage* at, const verge_decision* all, uint32_t slot)
{
    const verge_vehicle_decision* vehicle = &all->vehicles[slot];
    const verge_vehicle* start = &at->vehicles[slot]; // lanes lead along x
    by_hand now = { start->x, start->y, start->speed, 0.0 };
    assert_int_equal(vehicle->vehicle_id, at->vehicles[slot].id);
    assert_int_equal(vehicle->step_count, at->def.steps);
    for (uint32_t t = 0; t < vehicle->step_count; ++t) {
        const verge_action_step* step = &vehicle->steps[t];
        now = drive_by_hand(&at->def, now, step->action);
        CHECK_NEAR(step->t0, at->def.step_s * t, 1e-12);
        CHECK_NEAR(step->t1, at->def.step_s * (t + 1), 1e-12);
        CHECK_NEAR(step->v, now.v, 1e-4);
        CHECK_NEAR(step->s, now.s, 5e-3);
        CHECK_NEAR(step->distance, now.distance, 2e-3);
        CHECK_AT_MOST(fabs(step->d), 0.5 * STAGE_WIDTH + 0.1); // in the lane that is named
        check_side(step->action, now.y, y_of(step));
        now.y = y_of(step);
        assert_int_equal(step->turn_signal, (step->action == VERGE_CHANGE_LEFT)
                                                - (step->action == VERGE_CHANGE_RIGHT));
        assert_int_equal(step->brake_light, step->action == VERGE_DECELERATE);
        check_ahead(all, slot, t);
    }
}

/// All vehicles are planned, so that every position after every step is known.
static void action_steps_tell_where_the_actions_lead_and_who_is_ahead(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("action steps");
    stage* at = stage_open(4, 2000.0);
    static verge_vehicle_decision vehicles[VERGE_CONTROLLED_MAX];
    at->def.iterations = 300;
    at->def.nodes_max = 512;
    const size_t size = (verge_decider_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_decider* decider = NULL;
    assert_int_equal(verge_decider_init(&decider, &at->def, memory, size), VERGE_OK);
    for (uint32_t k = 0; k < test_rounds(100); ++k) {
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 8), 0, 100.0, 300.0, 15.0);
        verge_decision steps = { .vehicles_max = VERGE_CONTROLLED_MAX, .vehicles = vehicles };
        verge_commitment commitment = { .decisions = k };
        assert_int_equal(verge_decide(decider, &at->given, &commitment, &steps), VERGE_OK);
        assert_int_equal(steps.vehicle_count, at->count);
        assert_int_equal(commitment.decisions, k + 1);
        for (uint32_t slot = 0; slot < steps.vehicle_count; ++slot) {
            check_steps(at, &steps, slot);
        }
    }
    free(memory);
    stage_close(at);
}

/// Lateral position and station a segment aims at, and those of the flow at the same instant.
static void check_aim(const vg_segment* segment, const vg_flow* end, uint32_t slot)
{
    CHECK_NEAR(segment->v, end->v[slot], 1e-4);
    CHECK_NEAR(segment->s, end->station[slot], 0.02);
    if (segment->action == VERGE_CHANGE_LEFT || segment->action == VERGE_CHANGE_RIGHT) {
        CHECK_NEAR(STAGE_WIDTH * segment->lane + segment->d,
                   STAGE_WIDTH * end->lane[slot] + end->d[slot], 1e-3);
    } else {
        CHECK_NEAR(segment->d, 0.0, 0.0); // keeping a lane is keeping its centre
    }
}

static void segments_are_the_runs_of_equal_actions_and_fill_the_horizon(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("segments");
    stage* at = stage_open(4, 2000.0);
    for (uint32_t k = 0; k < test_rounds(200); ++k) {
        at->def.points = 11 + test_rng_below(&rng, 21);
        at->def.step_s = k % 2 == 0 ? 1.5 : test_rng_between(&rng, 0.5, 2.0);
        const double horizon = (at->def.points - 1) * at->def.point_s;
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 4), test_rng_below(&rng, 4), 100.0, 300.0,
                   20.0);
        decide(at, k);
        for (uint32_t slot = 0; slot < at->scene.controlled_count; ++slot) {
            make_segments(at, slot);
            assert_true(job.segment_count > 0);
            for (uint32_t n = 0; n < job.segment_count; ++n) {
                const vg_segment* segment = &job.segments[n];
                CHECK_NEAR(segment->t0, n == 0 ? 0.0 : job.segments[n - 1].t1, 0.0);
                assert_true(segment->t1 > segment->t0 && segment->v >= 0.0);
                assert_true(n == 0 || segment->action != job.segments[n - 1].action);
                const uint32_t first = (uint32_t)(segment->t0 / at->def.step_s + 0.5);
                const double steps = segment->t1 / at->def.step_s;
                assert_int_equal(segment->action, decision.line.actions[first][slot]);
                if (fabs(steps - floor(steps + 0.5)) < 1e-9) {
                    check_aim(segment, &decision.flows[(uint32_t)(steps + 0.5)], slot);
                }
            }
            CHECK_NEAR(job.segments[job.segment_count - 1].t1, horizon, 1e-12);
        }
    }
    stage_close(at);
}

/// The decision that is made of these actions of one vehicle.
static void decided(stage* at, const uint8_t* actions)
{
    stage_begin(at);
    memset(&decision, 0, sizeof decision);
    decision.line.step_count = at->def.steps;
    for (uint32_t t = 0; t < at->def.steps; ++t) {
        decision.line.actions[t][0] = actions[t];
    }
    stage_drive(at, &decision);
}

static void a_change_cut_by_the_horizon_aims_at_its_part_of_the_way(void** state)
{
    (void)state;
    static const uint8_t actions[VERGE_STEPS_MAX] = { VERGE_CHANGE_LEFT, VERGE_CHANGE_LEFT };
    stage* at = stage_open(2, 2000.0);
    at->def.points = 16; // 1.5 s of trajectory, the whole change takes 3 s
    stage_add(at, true, 0, 100.0, 0.0, 10.0, 1);
    decided(at, actions);
    make_segments(at, 0);
    assert_int_equal(job.segment_count, 1);
    assert_int_equal(job.segments[0].lane, 1); // the lane changed to is the reference
    assert_int_equal(job.change_lane, -1);     // but not reached
    CHECK_NEAR(job.segments[0].d, -2.0, 1e-3);
    CHECK_NEAR(job.segments[0].s, 115.0, 0.02);
    at->def.points = 31;
    make_segments(at, 0);
    assert_int_equal(job.segment_count, 1);
    assert_int_equal(job.segments[0].lane, 1);
    assert_int_equal(job.change_lane, 1);
    CHECK_NEAR(job.segments[0].d, 0.0, 1e-3);
    stage_close(at);
}

static void a_change_under_way_ends_when_it_was_going_to(void** state)
{
    (void)state;
    // One metre on its way: the decision calls the second step already speeding up.
    static const uint8_t actions[VERGE_STEPS_MAX] = { VERGE_CHANGE_LEFT, VERGE_ACCELERATE };
    stage* at = stage_open(3, 2000.0);
    stage_add(at, true, 0, 100.0, 1.0, 10.0, 1);
    decided(at, actions);
    make_segments(at, 0);
    job.lane = 0;
    vg_segments_finish_change(&expected, 1, 1.9, &job);
    assert_int_equal(job.segment_count, 2);
    CHECK_NEAR(job.segments[0].t1, 1.9, 1e-12);
    CHECK_NEAR(job.segments[1].t0, 1.9, 1e-12);
    CHECK_NEAR(job.segments[1].t1, 3.0, 1e-12);
    assert_int_equal(job.segments[0].action, VERGE_CHANGE_LEFT);
    assert_int_equal(job.segments[0].lane, 1);
    CHECK_NEAR(job.segments[0].d, 0.0, 0.0);
    CHECK_NEAR(job.segments[0].rest, 0.0, 0.0);
    const double part = 0.4 / 1.5; // of the second step
    CHECK_NEAR(job.segments[0].v, 10.0 + part * 0.9, 1e-4);
    CHECK_NEAR(job.segments[0].s, 100.0 + decision.way[0][0] + part * decision.way[1][0], 0.02);
    stage_close(at);
}

static void no_segment_after_the_rest_of_a_change_is_too_short_to_move_in(void** state)
{
    (void)state;
    static const uint8_t actions[VERGE_STEPS_MAX] = { VERGE_CHANGE_LEFT, VERGE_ACCELERATE };
    for (int k = 0; k <= 40; ++k) { // left of the change: from 1 s on to more than the horizon
        const double left = 1.0 + 0.06 * k;
        stage* at = stage_open(3, 2000.0);
        stage_add(at, true, 0, 100.0, 1.0, 10.0, 1);
        decided(at, actions);
        make_segments(at, 0);
        job.lane = 0;
        vg_segments_finish_change(&expected, 1, left, &job);
        const vg_segment* last = &job.segments[job.segment_count - 1];
        CHECK_NEAR(last->t1, 3.0, 1e-12);
        CHECK_NEAR(job.segments[0].t1 - job.segments[0].rest, fmin(left, 3.0), 1e-12);
        for (uint32_t i = 1; i < job.segment_count; ++i) {
            CHECK_NEAR(job.segments[i].t0, job.segments[i - 1].t1, 1e-12);
            assert_true(job.segments[i].t1 - job.segments[i].t0 > 1.0 - 1e-6);
        }
        stage_close(at);
    }
}

static void a_change_that_is_given_up_or_goes_on_is_not_finished(void** state)
{
    (void)state;
    static const uint8_t back[VERGE_STEPS_MAX] = { VERGE_KEEP_SPEED };
    static const uint8_t on[VERGE_STEPS_MAX] = { VERGE_CHANGE_LEFT, VERGE_CHANGE_LEFT,
                                                 VERGE_CHANGE_LEFT, VERGE_CHANGE_LEFT };
    for (int k = 0; k < 2; ++k) {
        stage* at = stage_open(3, 2000.0);
        stage_add(at, true, 0, 100.0, k == 0 ? 1.0 : 0.0, 10.0, 2);
        decided(at, k == 0 ? back : on);
        make_segments(at, 0);
        job.lane = 0;
        const vg_job before = job;
        vg_segments_finish_change(&expected, 1, 2.0, &job);
        assert_int_equal(job.segment_count, before.segment_count);
        assert_memory_equal(job.segments, before.segments, sizeof job.segments);
        stage_close(at);
    }
}

static void off_the_road_the_steps_slow_down_to_a_stop(void** state)
{
    (void)state;
    const verge_planner_def def = verge_planner_default_def();
    stage* at = stage_open(1, 500.0);
    stage_add(at, true, 0, 100.0, 0.0, 2.0, -1);
    stage_begin(at);
    at->positions[0].lane_id = VERGE_NO_LANE;
    assert_true(vg_job_begin(&job, &def, &at->given, 0, NULL, NULL, &plan));
    assert_false(job.on_road);
    assert_int_equal(plan.action_count, def.steps);
    for (uint32_t t = 0; t < plan.action_count; ++t) {
        const double expected = fmax(0.0, 2.0 - 0.6 * 1.5 * (t + 1));
        CHECK_NEAR(plan.actions[t].v, expected, 1e-12);
        assert_true(plan.actions[t].brake_light && plan.actions[t].lane_id == VERGE_NO_LANE);
    }
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(action_steps_tell_where_the_actions_lead_and_who_is_ahead),
        cmocka_unit_test(segments_are_the_runs_of_equal_actions_and_fill_the_horizon),
        cmocka_unit_test(a_change_cut_by_the_horizon_aims_at_its_part_of_the_way),
        cmocka_unit_test(a_change_under_way_ends_when_it_was_going_to),
        cmocka_unit_test(no_segment_after_the_rest_of_a_change_is_too_short_to_move_in),
        cmocka_unit_test(a_change_that_is_given_up_or_goes_on_is_not_finished),
        cmocka_unit_test(off_the_road_the_steps_slow_down_to_a_stop),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
