/// Goal: no decision exceeds the limits of a body, and the length of a trailer counts behind its
/// vehicle.
/// Method: moves of single vehicles on straight lanes; changes beside a trailer.
#include "stage.h"

#include "traffic/moves.h"

static verge_vehicle* add_body(stage* at, verge_body_kind kind, bool planned, uint32_t lane,
                               double s, double v)
{
    verge_vehicle* vehicle = stage_add(at, planned, lane, s, 0.0, v, -1);
    const verge_body body = verge_body_of(kind);
    verge_vehicle_set_body(vehicle, &body);
    return vehicle;
}

/// Speeds after AC and DC, and where DC ends.
static void moves_of(verge_body_kind kind, double v, double step[2], uint8_t* legal)
{
    stage* at = stage_open(1, 1000.0);
    at->lanes[0].speed_limit = 50.0;
    stage_build(at);
    at->def.acceleration = 3.0;
    at->def.deceleration = 8.0;
    add_body(at, kind, true, 0, 200.0, v);
    stage_begin(at);
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow_moves(&at->scene, &at->root, &moves);
    step[0] = (double)moves.v[1][0] - v;
    step[1] = v - (double)moves.v[2][0];
    *legal = moves.legal[0];
    stage_close(at);
}

static void test_no_decision_exceeds_the_limits_of_a_body(void** state)
{
    (void)state;
    for (int i = 0; i < VERGE_BODY_KIND_COUNT; ++i) {
        const verge_body_kind kind = (verge_body_kind)i;
        const verge_body body = verge_body_of(kind);
        for (double v = 1.0; v < 0.9 * body.speed_max; v += 3.0) {
            double step[2];
            uint8_t legal;
            moves_of(kind, v, step, &legal);
            const double most = body.acceleration_max * fmin(1.0, body.speed_switch / v);
            CHECK_NEAR(step[0], 1.5 * fmin(3.0, most), 1e-5);
            CHECK_NEAR(step[1], fmin(v, 1.5 * fmin(8.0, body.braking_max)), 1e-5);
        }
    }
}

static void test_no_body_accelerates_beyond_its_speed(void** state)
{
    (void)state;
    double step[2];
    uint8_t legal;
    moves_of(VERGE_BODY_TRUCK, 20.0, step, &legal);
    assert_true((legal >> VERGE_ACCELERATE & 1) != 0);
    moves_of(VERGE_BODY_TRUCK, 24.9, step, &legal);
    assert_true((legal >> VERGE_ACCELERATE & 1) == 0);
    moves_of(VERGE_BODY_CAR, 24.9, step, &legal);
    assert_true((legal >> VERGE_ACCELERATE & 1) != 0);
}

static void test_the_scene_includes_both_bodies_of_an_articulated_truck(void** state)
{
    (void)state;
    stage* at = stage_open(1, 500.0);
    const verge_vehicle* truck = add_body(at, VERGE_BODY_ARTICULATED, false, 0, 200.0, 8.0);
    const verge_body* body = &truck->body;
    stage_begin(at);
    const double middle = vg_lane_s(&at->road->lanes[0], (double)at->root.station[0]);
    const double half = (double)at->scene.half_length[0];
    CHECK_NEAR(middle + half, 200.0 + 0.5 * body->length, 1e-4);
    CHECK_NEAR(middle - half, 200.0 - body->hitch - body->trailer_length + body->trailer_front,
               1e-4);
    CHECK_NEAR(vg_flow_s(&at->scene, &at->root, 0), 200.0, 1e-4);
    stage_close(at);
}

static void test_no_vehicle_changes_into_the_place_of_a_trailer(void** state)
{
    (void)state;
    for (int i = 0; i < 2; ++i) {
        stage* at = stage_open(2, 500.0);
        stage_add(at, true, 0, 187.0, 0.0, 8.0, 1); // beside the trailer, behind the tractor
        verge_vehicle* truck = add_body(at, VERGE_BODY_ARTICULATED, false, 1, 200.0, 8.0);
        truck->body.trailer_length = i == 0 ? 0.0 : truck->body.trailer_length;
        stage_begin(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        assert_int_equal(moves.legal[0] >> VERGE_CHANGE_LEFT & 1, i == 0);
        stage_close(at);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_decision_exceeds_the_limits_of_a_body),
        cmocka_unit_test(test_no_body_accelerates_beyond_its_speed),
        cmocka_unit_test(test_the_scene_includes_both_bodies_of_an_articulated_truck),
        cmocka_unit_test(test_no_vehicle_changes_into_the_place_of_a_trailer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
