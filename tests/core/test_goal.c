/// Goal: a vehicle passes a body that stands partly in its lane where the room suffices, on the
///       free side, with distance to it and within the lane; elsewhere it keeps to the centre.
/// Method: bodies at all places across a lane against plain arithmetic, and a closed loop.
#include "closed_loop.h"
#include "stage.h"

#include "traffic/goal.h"

static float goal_beside(stage* at, double d, double width, double turn, double* limit)
{
    stage_clear(at);
    stage_add(at, true, 0, 100.0, 0.0, 10.0, -1)->width = 1.8;
    verge_vehicle* body = stage_add(at, false, 0, 130.0, d, 0.0, -1);
    body->width = width;
    body->heading = turn;
    stage_begin(at);
    *limit = (double)at->root.limit[0];
    return vg_lane_goal(&at->scene, &at->root, 0, 115.0f);
}

static void room_beside_a_body_is_used_on_the_side_where_it_is(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0); // 4 m wide
    for (double d = -4.0; d <= 4.0; d += 0.0625) {
        double limit = 0.0;
        const double goal = (double)goal_beside(at, d, 1.8, 0.0, &limit);
        const bool in_lane = fabs(d) - 0.9 < 2.0;
        const double room = 2.0 + fabs(d) - 0.9 - 1.8; // besides the own width
        if (fabs(room - 0.6) < 1e-3) {
            continue;
        }
        if (!in_lane || room < 0.6) {
            CHECK_NEAR(goal, 0.0, 0.0);
            CHECK_NEAR(limit, STAGE_LIMIT, 1e-4);
            continue;
        }
        const double away = fmax(0.0, 0.5 - (fabs(d) - 1.8)); // half a metre between both
        CHECK_NEAR(goal, d > 0.0 ? -away : away, 1e-4);
        CHECK_AT_MOST(fabs(goal) + 0.9, 2.0 - 0.09); // within the lane
        CHECK_NEAR(limit, away > 0.0 ? fmin(STAGE_LIMIT, sqrt(64.0 + 3.0 * 25.0)) : STAGE_LIMIT,
                   1e-3);
    }
    stage_close(at);
}

static void narrow_bodies_get_more_room(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    double limit = 0.0;
    CHECK_NEAR((double)goal_beside(at, -1.6, 0.6, 0.0, &limit), 0.6, 1e-4); // -1.3 + 1.0 + 0.9
    CHECK_NEAR((double)goal_beside(at, 0.3, 0.6, 0.0, &limit), 0.0, 0.0); // 0.2 m of room
    stage_close(at);
}

static void a_turned_body_is_as_wide_as_its_corners(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    double limit = 0.0;
    CHECK_NEAR((double)goal_beside(at, -2.0, 1.8, 0.0, &limit), 0.3, 1e-4);
    const double reach = 2.5 * sin(0.2) + 0.9 * cos(0.2);
    CHECK_NEAR((double)goal_beside(at, -2.0, 1.8, 0.2, &limit), reach - 2.0 + 0.5 + 0.9, 1e-3);
    CHECK_NEAR((double)goal_beside(at, -2.0, 1.8, 1.0, &limit), 0.0, 0.0); // blocks the lane
    stage_close(at);
}

static void bodies_on_both_sides_are_passed_in_their_middle(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    stage_add(at, true, 0, 100.0, 0.0, 5.0, -1)->width = 1.8;
    stage_add(at, false, 0, 130.0, -2.3, 0.0, -1)->width = 1.8; // free from -1.4
    stage_add(at, false, 0, 131.0, 2.2, 0.0, -1)->width = 1.8;  // to 1.3
    stage_begin(at);
    CHECK_NEAR((double)vg_lane_goal(&at->scene, &at->root, 0, 115.0f), -0.05, 1e-4);
    CHECK_AT_MOST((double)at->root.limit[0], sqrt(25.0 + 3.0 * 25.0) + 1e-3); // 0.45 m: 5 m/s there
    at->vehicles[2].y = 1.7;
    at->positions[2].d = 1.7;
    stage_begin(at);
    CHECK_NEAR((double)vg_lane_goal(&at->scene, &at->root, 0, 115.0f), 0.0, 0.0); // too narrow
    stage_close(at);
}

static void a_body_matters_from_the_approach_until_it_is_passed(void** state)
{
    (void)state;
    stage* at = stage_open_best(1, 500.0);
    for (double s = 20.0; s < 300.0; s += 2.0) {
        stage_clear(at);
        stage_add(at, true, 0, s, 0.3, 6.0, -1)->width = 1.8;
        stage_add(at, false, 0, 200.0, -1.9, 0.0, -1)->width = 1.8;
        stage_begin(at);
        const float goal = vg_lane_goal(&at->scene, &at->root, 0, (float)(s + 9.0));
        const bool near = s + 9.0 + 2.5 + 18.0 >= 197.5 && s - 2.5 - 1.0 <= 202.5;
        assert_int_equal(goal != 0.0f, near);
    }
    stage_close(at);
}

static void a_body_that_reaches_in_from_the_lane_beside_counts_and_the_paper_knows_none(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 500.0);
    stage_add(at, true, 0, 100.0, 0.0, 10.0, -1)->width = 1.8;
    stage_add(at, false, 1, 130.0, -1.5, 0.0, -1)->width = 1.8; // over the line, at 2.5 of lane 0
    stage_begin(at);
    CHECK_NEAR((double)vg_lane_goal(&at->scene, &at->root, 0, 115.0f), 0.0, 0.0); // far enough
    at->vehicles[1].y = STAGE_WIDTH - 2.0;
    at->positions[1].d = -2.0;
    stage_begin(at);
    CHECK_NEAR((double)vg_lane_goal(&at->scene, &at->root, 0, 115.0f), 1.1 - 0.5 - 0.9, 1e-4);
    at->def.search = VERGE_SEARCH_PAPER;
    stage_begin(at);
    CHECK_NEAR((double)vg_lane_goal(&at->scene, &at->root, 0, 115.0f), 0.0, 0.0);
    stage_close(at);
}

static void a_change_ends_where_there_is_room_beside_a_body(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 500.0);
    for (double turn = 0.0; turn < 3.0; turn += 0.3) { // across lane 0, into lane 1
        stage_clear(at);
        stage_add(at, true, 0, 100.0, 0.0, 12.0, -1)->width = 1.8;
        stage_add(at, false, 0, 150.0, 0.4, 0.0, -1)->heading = turn;
        stage_begin(at);
        const double low = 0.4 + (double)at->scene.half_width[1] - STAGE_WIDTH;
        const double room = 2.0 - low - 1.8;
        const double goal = room < 0.6 || low < -2.0 ? 0.0 : fmax(low + 0.9 + 0.5, 0.0);
        CHECK_NEAR((double)vg_goal_in(&at->scene, &at->root, 0, 1, 118.0f), goal, 1e-4);
        vg_flow flow = at->root;
        for (int k = 0; k < 3; ++k) {
            vg_moves moves;
            memset(&moves, 0, sizeof moves);
            vg_flow_moves(&at->scene, &flow, &moves);
            const bool legal = (moves.legal[0] & 1u << VERGE_CHANGE_LEFT) != 0;
            const uint8_t action = legal ? VERGE_CHANGE_LEFT : VERGE_KEEP_SPEED;
            vg_flow next = flow;
            vg_flow_advance(&at->scene, &flow, &moves, &action, &next);
            flow = next;
        }
        if (room >= 0.8) { // else it is as wide as the road
            assert_int_equal(flow.lane[0], 1);
            CHECK_NEAR((double)flow.d[0], goal, 0.1);
        }
    }
    stage_close(at);
}

/// Drives vehicle 0 in closed loop until it is past x, with vehicle 1 at rest. Returns the smallest
/// distance of both.
static double drive(stage* at, verge_vehicle both[2], double x, bool planned)
{
    const size_t size = (verge_planner_memory_size(&at->def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &at->def, memory, size), VERGE_OK);
    static verge_plan plan;
    double least = 100.0;
    for (int64_t cycle = 0; cycle < 60 && both[0].x < x; ++cycle) {
        assert_int_equal(verge_planner_step(planner, 500000 * cycle, both, 2, &plan), VERGE_OK);
        if (planned) { // and on a single lane: no change of lane leads to the goal or back
            assert_int_equal(plan.vehicles[0].status, VERGE_PLANNED);
            for (uint32_t t = 0; t < plan.vehicles[0].action_count; ++t) {
                assert_true(plan.vehicles[0].actions[t].action < VERGE_CHANGE_LEFT);
            }
        }
        for (uint32_t k = 1; k <= 5; ++k) {
            take_point(&both[0], &plan.vehicles[0].points[k]);
            least = fmin(least, verge_vehicles_distance(&both[0], &both[1]));
        }
    }
    free(memory);
    return least;
}

static void a_vehicle_gets_out_from_behind_a_body_that_stands(void** state)
{
    (void)state;
    stage* at = stage_open_best(2, 500.0);
    for (double gap = 4.5; gap < 30.0; gap += 2.5) {
        verge_vehicle both[2] = { verge_vehicle_default(), verge_vehicle_default() };
        both[0].controlled = true;
        both[0].x = 100.0;
        both[1].id = 1;
        both[1].x = 105.0 + gap;
        CHECK_BETWEEN(drive(at, both, both[1].x + 10.0, false), 0.1, 10.0);
        if (both[0].x <= both[1].x + 10.0) {
            fail_msg("stands at %.1f, %.1f m behind the body", both[0].x, gap);
        }
    }
    stage_close(at);
}

/// Distance kept from a body at d in closed loop, on the way from 60 m before it to 20 m past it.
static double pass(double d, double* beyond)
{
    stage* at = stage_open_best(1, 500.0);
    verge_vehicle both[2] = { verge_vehicle_default(), verge_vehicle_default() };
    both[0].controlled = true;
    both[0].x = 40.0;
    both[0].speed = 9.0;
    both[0].width = both[1].width = 1.8;
    both[1].id = 1;
    both[1].x = 100.0;
    both[1].y = d;
    const double least = drive(at, both, 125.0, true);
    *beyond = both[0].x;
    stage_close(at);
    return least;
}

static void a_vehicle_drives_past_whatever_leaves_it_room(void** state)
{
    (void)state;
    for (double d = 1.35; d <= 2.6; d += 0.25) {
        for (int side = -1; side <= 1; side += 2) {
            double beyond = 0.0;
            CHECK_BETWEEN(pass(side * d, &beyond), 0.2, 2.0);
            CHECK_BETWEEN(beyond, 125.0, 200.0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(room_beside_a_body_is_used_on_the_side_where_it_is),
        cmocka_unit_test(narrow_bodies_get_more_room),
        cmocka_unit_test(a_turned_body_is_as_wide_as_its_corners),
        cmocka_unit_test(bodies_on_both_sides_are_passed_in_their_middle),
        cmocka_unit_test(a_body_matters_from_the_approach_until_it_is_passed),
        cmocka_unit_test(
            a_body_that_reaches_in_from_the_lane_beside_counts_and_the_paper_knows_none),
        cmocka_unit_test(a_change_ends_where_there_is_room_beside_a_body),
        cmocka_unit_test(a_vehicle_gets_out_from_behind_a_body_that_stands),
        cmocka_unit_test(a_vehicle_drives_past_whatever_leaves_it_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
