/// Goal: each vehicle by itself drives as traffic does: it reaches the limit and holds it, keeps
///       its time gap, survives a leader that brakes as hard as it can, and never drives into the
///       end of a lane; a lane change that is legal costs the one behind no hard braking.
/// Method: the policy of every planned vehicle, step by step in the model, without a search.
#include "stage.h"

#include "traffic/drive.h"
#include "traffic/humans.h"

static void drive_steps(stage* at, uint32_t steps)
{
    for (uint32_t t = 0; t < steps; ++t) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves_unchecked(&at->scene, &at->root, &moves);
        for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
            assert_true((moves.legal[i] & 7u) != 0); // KS, AC or DC
            actions[i] = vg_drive_policy(&at->scene, &at->root, &moves, i);
            assert_true((moves.legal[i] >> actions[i] & 1u) != 0);
        }
        vg_flow next = at->root;
        vg_flow_advance(&at->scene, &at->root, &moves, actions, &next);
        at->root = next;
        assert_true(vg_flow_holds(&at->scene, &at->root));
    }
}

static void alone_a_vehicle_reaches_the_limit_and_holds_it(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("limit");
    for (uint32_t k = 0; k < test_rounds(60); ++k) {
        stage* at = stage_open_best(1 + k % 2, 1900.0);
        const double limit = test_rng_between(&rng, 8.0, 33.0);
        at->lanes[0].speed_limit = at->lanes[1].speed_limit = limit;
        stage_build(at);
        const double v = test_rng_between(&rng, 0.0, limit);
        stage_add(at, true, 0, 20.0, 0.0, v, -1);
        stage_begin(at);
        drive_steps(at, (uint32_t)((limit - v) / 1.4 / 1.5) + 3u);
        for (uint32_t t = 0; t < 5; ++t) {
            CHECK_BETWEEN(at->root.v[0], limit - 0.1, limit + 1e-3);
            drive_steps(at, 1);
        }
        stage_close(at);
    }
}

static void the_settled_gap_is_the_time_gap_of_the_habit(void** state)
{
    (void)state;
    static const double wanted[] = { 1.0, 1.5, 2.0 }; // [s] aggressive, normal, conservative
    for (int kind = 0; kind < 3; ++kind) {
        for (double v = 9.0; v <= 24.0; v += 5.0) {
            stage* at = stage_open_best(1, 1900.0);
            at->lanes[0].speed_limit = 30.0;
            stage_build(at);
            stage_add(at, true, 0, 20.0, 0.0, v, -1)->habit = verge_habit_of((verge_habit_kind)kind);
            stage_add(at, false, 0, 70.0, 0.0, v, -1);
            stage_begin(at);
            drive_steps(at, 40);
            const double gap = (double)(at->root.station[1] - at->root.station[0]) - 5.0;
            CHECK_BETWEEN(gap / v, wanted[kind], wanted[kind] + 2.0 / v + 0.35);
            stage_close(at);
        }
    }
}

static void planned_vehicles_follow_closer_but_not_below_their_gap(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 1900.0);
    stage_add(at, true, 0, 20.0, 0.0, 11.0, -1);
    stage_add(at, true, 0, 60.0, 0.0, 8.0, -1)->body = verge_body_of(VERGE_BODY_CAR);
    stage_begin(at);
    at->scene.speed_max[1] = 8.0f; // the one ahead cannot drive faster
    drive_steps(at, 40);
    const double gap = (double)(at->root.station[1] - at->root.station[0]) - 5.0;
    CHECK_BETWEEN(gap / 8.0, 0.6, 1.3);
    stage_close(at);
}

// From a settled gap. The one ahead stops with all that its body can.
static void nobody_runs_into_a_vehicle_that_brakes_as_hard_as_it_can(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("hard braking");
    static const verge_body_kind kinds[] = { VERGE_BODY_CAR, VERGE_BODY_BUS, VERGE_BODY_TRUCK,
                                             VERGE_BODY_BICYCLE };
    for (uint32_t k = 0; k < test_rounds(80); ++k) {
        stage* at = stage_open_best(1, 1900.0);
        at->lanes[0].speed_limit = 30.0;
        stage_build(at);
        const verge_body body = verge_body_of(kinds[k % 4]);
        const double v = test_rng_between(&rng, 4.0, fmin(body.speed_max, 24.0));
        verge_vehicle* own = stage_add(at, true, 0, 20.0, 0.0, v, -1);
        verge_vehicle_set_body(own, &body);
        own->habit = verge_habit_of(VERGE_AGGRESSIVE);
        stage_add(at, false, 0, 90.0, 0.0, v, -1);
        stage_begin(at);
        drive_steps(at, 30);
        at->scene.braking[1] = 8.0f; // the IDM brakes as hard as that for a cruise of almost 0
        at->scene.cruise[1] = 0.05f;
        for (uint32_t t = 0; t < 12; ++t) {
            drive_steps(at, 1);
            const double gap = (double)(at->root.station[1] - at->root.station[0])
                               - 0.5 * (body.length + 5.0);
            assert_true(gap > 0.0);
        }
        CHECK_AT_MOST(at->root.v[0], 0.1);
        stage_close(at);
    }
}

// Beside an endless column without a gap.
static void before_the_end_of_a_lane_a_vehicle_stops_with_room_to_leave_it(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lane end");
    for (uint32_t k = 0; k < test_rounds(40); ++k) {
        stage* at = stage_open_best(2, 900.0);
        at->points[0][1][0] = 300.0;
        stage_build(at);
        stage_add(at, true, 0, test_rng_between(&rng, 40.0, 200.0), 0.0, 10.0, k % 2 == 0 ? 1 : -1);
        for (int i = 0; i < 40; ++i) {
            stage_add(at, false, 1, 20.0 + 8.0 * i, 0.0, 0.0, -1);
        }
        stage_begin(at);
        drive_steps(at, 30);
        CHECK_BETWEEN(at->root.station[0], 270.0, 300.0 - 2.5 - 2.5);
        CHECK_AT_MOST(at->root.v[0], 0.1);
        stage_close(at);
    }
}

static void a_legal_change_costs_the_one_behind_no_hard_braking(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("change");
    uint32_t legal = 0;
    for (uint32_t k = 0; k < test_rounds(400); ++k) {
        stage* at = stage_open_best(2, 900.0);
        stage_add(at, true, 0, 300.0, 0.0, test_rng_between(&rng, 2.0, STAGE_LIMIT), 1);
        stage_add(at, false, 1, test_rng_between(&rng, 230.0, 370.0), 0.0,
                  test_rng_between(&rng, 0.0, STAGE_LIMIT), -1);
        stage_begin(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        if ((moves.legal[0] >> VERGE_CHANGE_LEFT & 1u) != 0) {
            ++legal;
            const double gap = fabs((double)(moves.station[0][1] - moves.station[0][0])) - 5.0;
            assert_true(gap >= 2.0);
            if (moves.station[0][1] < moves.station[0][0]) {
                const float a = vg_human_acceleration(&at->scene, 1, moves.v[0][1], (float)gap,
                                                      at->root.v[0]);
                assert_true(a >= -2.01f);
            }
        }
        stage_close(at);
    }
    assert_true(legal > test_rounds(400) / 4);
}

// Nobody beside: no time. One beside: time, also for a while before and behind.
static void one_beside_blocks_a_change_until_there_is_a_gap(void** state)
{
    (void)state;
    for (double v = 5.0; v <= 30.0; v += 5.0) {
        for (int away = -120; away <= 120; away += 5) {
            stage* at = stage_open_best(2, 1900.0);
            at->lanes[0].speed_limit = at->lanes[1].speed_limit = 30.0;
            stage_build(at);
            stage_add(at, true, 0, 200.0, 0.0, v, -1);
            stage_add(at, false, 1, 200.0 + away, 0.0, v, -1);
            stage_begin(at);
            const float time = vg_drive_blocked(&at->scene, &at->root, 0, true);
            if (away <= -60 || away >= 60) {
                CHECK_NEAR(time, 0.0, 1e-6);
            } else if (away >= -5 && away <= 5) {
                CHECK_BETWEEN(time, 0.1, 8.0);
            }
            CHECK_BETWEEN(time, 0.0, 8.0);
            stage_close(at);
        }
    }
}

// In a bend vehicles leave the centre. Where there is one lane only, a vehicle completes a change
// if it is farther away: the lane that it comes from has ended.
static void a_vehicle_off_the_centre_of_the_only_lane_does_not_change_lane(void** state)
{
    (void)state;
    for (uint32_t lanes = 1; lanes <= 2; ++lanes) {
        for (double d = -1.55; d <= 1.6; d += 0.2) {
            stage* at = stage_open_best(lanes, 900.0);
            stage_add(at, true, 0, 300.0, d, 6.0, -1);
            stage_begin(at);
            vg_moves moves;
            memset(&moves, 0, sizeof moves);
            vg_flow_moves(&at->scene, &at->root, &moves);
            const bool left = (moves.legal[0] >> VERGE_CHANGE_LEFT & 1u) != 0;
            const bool right = (moves.legal[0] >> VERGE_CHANGE_RIGHT & 1u) != 0;
            assert_int_equal(left, lanes == 2 || d < -1.2);
            assert_int_equal(right, d > (lanes == 2 ? 0.3 : 1.2));
            stage_close(at);
        }
    }
}

// What the first of three vehicles loses, by the speed of the second. The third drives at 12 m/s.
static double loss_behind(double v, bool third)
{
    stage* at = stage_open_best(1, 1900.0);
    at->lanes[0].speed_limit = 20.0;
    stage_build(at);
    stage_add(at, true, 0, 100.0, 0.0, 12.0, -1);
    stage_add(at, true, 0, 150.0, 0.0, v, -1);
    if (third) {
        stage_add(at, false, 0, 210.0, 0.0, 12.0, -1);
    }
    stage_begin(at);
    const double loss = (double)vg_flow_loss(&at->scene, &at->root, 0, 0.0f);
    stage_close(at);
    return loss;
}

static void a_planned_vehicle_ahead_is_soon_as_slow_as_the_one_before_it(void** state)
{
    (void)state;
    for (double v = 12.0; v <= 20.0; v += 2.0) {
        CHECK_BETWEEN(loss_behind(v, true) - loss_behind(12.0, true), -1.0, 1.0);
        CHECK_AT_MOST(loss_behind(v, false), loss_behind(12.0, false) - 1.2 * (v - 12.0));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(alone_a_vehicle_reaches_the_limit_and_holds_it),
        cmocka_unit_test(the_settled_gap_is_the_time_gap_of_the_habit),
        cmocka_unit_test(planned_vehicles_follow_closer_but_not_below_their_gap),
        cmocka_unit_test(nobody_runs_into_a_vehicle_that_brakes_as_hard_as_it_can),
        cmocka_unit_test(before_the_end_of_a_lane_a_vehicle_stops_with_room_to_leave_it),
        cmocka_unit_test(a_legal_change_costs_the_one_behind_no_hard_braking),
        cmocka_unit_test(one_beside_blocks_a_change_until_there_is_a_gap),
        cmocka_unit_test(a_vehicle_off_the_centre_of_the_only_lane_does_not_change_lane),
        cmocka_unit_test(a_planned_vehicle_ahead_is_soon_as_slow_as_the_one_before_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
