// Predicted bodies against the decision they come from and against plain physics.
#include "decide.h"

static stage_decision decision;
static verge_track bodies[VERGE_VEHICLES_MAX];
static verge_tracks tracks = { .tracks_max = VERGE_VEHICLES_MAX, .of = bodies };

static void decide(stage* at, uint64_t seed)
{
    at->def.iterations = 200;
    at->def.nodes_max = 512;
    stage_decide(at, vg_random_from(seed, 0), &decision);
}

static void predict(stage* at)
{
    memset(bodies, 0x5a, sizeof bodies);
    stage_predict(at, at->scene.controlled_count > 0 ? &decision.steps : NULL, &tracks);
    assert_int_equal(tracks.count, at->count);
}

static void planned_bodies_meet_the_decision_at_every_step(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("decided tracks");
    stage* at = stage_open(4, 2000.0);
    for (uint32_t k = 0; k < test_rounds(200); ++k) {
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 5), test_rng_below(&rng, 4), 100.0, 300.0,
                   20.0);
        decide(at, k);
        predict(at);
        for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
            const verge_track* track = &tracks.of[i];
            assert_true(track->controlled && track->vehicle_id == at->vehicles[i].id);
            for (uint32_t t = 0; t <= 2; ++t) { // 3 s of trajectory, steps of 1.5 s
                const vg_flow* flow = &decision.flows[t];
                const uint32_t point = 15 * t;
                CHECK_NEAR(track->x[point], flow->station[i], 0.01);
                CHECK_NEAR(track->y[point], STAGE_WIDTH * flow->lane[i] + flow->d[i], 0.01);
                CHECK_NEAR(track->speed[point], flow->v[i], 1e-4);
            }
        }
    }
    stage_close(at);
}

static void everyone_starts_where_it_is_with_the_body_it_has(void** state)
{
    (void)state;
    stage* at = stage_open(2, 500.0);
    stage_add(at, true, 0, 100.0, 0.4, 8.0, -1)->heading = 0.05;
    verge_vehicle* human = stage_add(at, false, 1, 80.0, -0.3, 7.0, -1);
    human->length = 8.0;
    human->width = 2.4;
    human->margin = 0.5;
    stage_begin(at);
    decide(at, 1);
    predict(at);
    CHECK_NEAR(tracks.of[0].x[0], 100.0, 0.0);
    CHECK_NEAR(tracks.of[0].y[0], 0.4, 0.0);
    CHECK_NEAR(tracks.of[0].sin_heading[0], sin(0.05), 1e-15);
    CHECK_NEAR(tracks.of[1].half_length, 4.5, 1e-12);
    CHECK_NEAR(tracks.of[1].half_width, 1.7, 1e-12);
    assert_false(tracks.of[1].controlled);
    stage_close(at);
}

static void a_human_that_crosses_goes_on_to_the_next_centre_and_stays_there(void** state)
{
    (void)state;
    stage* at = stage_open(3, 500.0);
    stage_add(at, false, 1, 100.0, 0.2, 10.0, -1)->heading = 0.2;  // towards lane 2
    stage_add(at, false, 1, 200.0, -0.5, 10.0, -1)->heading = 0.1; // back to the centre
    stage_add(at, false, 0, 100.0, 0.3, 10.0, -1)->heading = 0.03; // within a lane: keeps its place
    stage_add(at, false, 0, 200.0, 0.0, 10.0, -1)->heading = -0.3; // off the road: not far
    stage_begin(at);
    predict(at);
    const verge_track* of = tracks.of;
    CHECK_NEAR(of[0].y[5], STAGE_WIDTH + 0.2 + 0.5 * 10.0 * sin(0.2), 0.01);
    CHECK_NEAR(of[0].y[30], 2.0 * STAGE_WIDTH, 0.01);
    CHECK_NEAR(of[1].y[30], STAGE_WIDTH, 0.01);
    CHECK_NEAR(of[2].y[30], 0.3, 0.01);
    CHECK_NEAR(of[3].y[30], -0.5, 0.01);
    assert_true(of[0].sin_heading[5] > 0.15 && of[0].sin_heading[30] < 0.01);
    stage_close(at);
}

static void bodies_move_as_fast_as_they_say_and_where_they_point(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("smooth tracks");
    stage* at = stage_open(4, 2000.0);
    for (uint32_t k = 0; k < test_rounds(200); ++k) {
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 4), 1 + test_rng_below(&rng, 4), 100.0, 300.0,
                   20.0);
        decide(at, k);
        predict(at);
        for (uint32_t i = 0; i < at->count; ++i) {
            const verge_track* track = &tracks.of[i];
            for (uint32_t p = 1; p < at->def.points; ++p) {
                const double dx = track->x[p] - track->x[p - 1], dy = track->y[p] - track->y[p - 1];
                const double mean = 0.5 * (track->speed[p] + track->speed[p - 1]);
                CHECK_NEAR(dx, mean * at->def.point_s, 0.03); // speed is that along the lane
                CHECK_NEAR(hypot(track->cos_heading[p], track->sin_heading[p]), 1.0, 1e-12);
                if (p > 1 && track->speed[p] > 1.0) {
                    const double c = 0.5 * (track->cos_heading[p] + track->cos_heading[p - 1]);
                    const double s = 0.5 * (track->sin_heading[p] + track->sin_heading[p - 1]);
                    CHECK_NEAR(dy * c - dx * s, 0.0, 0.03);
                }
                CHECK_AT_MOST(fabs(track->speed[p] - track->speed[p - 1]), 0.46); // 4.5 m/s^2
            }
        }
    }
    stage_close(at);
}

static void a_human_at_the_limit_on_a_free_road_keeps_its_speed_and_lane(void** state)
{
    (void)state;
    stage* at = stage_open(3, 2000.0);
    stage_add(at, false, 1, 100.0, 0.7, STAGE_LIMIT, -1);
    stage_begin(at);
    predict(at);
    for (uint32_t p = 0; p < at->def.points; ++p) {
        CHECK_NEAR(tracks.of[0].x[p], 100.0 + STAGE_LIMIT * at->def.point_s * p, 1e-3);
        CHECK_NEAR(tracks.of[0].y[p], STAGE_WIDTH + 0.7, 1e-4);
    }
    stage_close(at);
}

static void a_human_makes_way_for_who_is_decided_to_come_in_front(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    stage_add(at, true, 0, 108.0, 0.0, 8.0, 1);
    stage_add(at, false, 1, 90.0, 0.0, STAGE_LIMIT, -1);
    stage_begin(at);
    decide(at, 1);
    memset(decision.line.actions, VERGE_KEEP_SPEED, sizeof decision.line.actions);
    decision.line.actions[0][0] = decision.line.actions[1][0] = VERGE_CHANGE_LEFT; // by hand
    stage_drive(at, &decision);
    predict(at);
    const uint32_t last = at->def.points - 1;
    CHECK_AT_MOST(tracks.of[1].speed[last], STAGE_LIMIT - 1.0);
    for (uint32_t p = 0; p <= last; ++p) {
        assert_true(tracks.of[0].x[p] - tracks.of[1].x[p] > 5.0
                    || tracks.of[0].y[p] < STAGE_WIDTH - 2.0);
    }
    stage_close(at);
}

static void off_the_road_a_body_goes_straight_on(void** state)
{
    (void)state;
    stage* at = stage_open(1, 500.0);
    stage_add(at, true, 0, 100.0, 0.0, 8.0, -1);
    verge_vehicle* off = stage_add(at, false, 0, 100.0, 90.0, 6.0, -1);
    off->heading = 2.0;
    at->positions[1].lane_id = VERGE_NO_LANE;
    at->given = (verge_scene){ .road = at->road, .vehicle_count = at->count,
                               .vehicles_max = VERGE_VEHICLES_MAX, .vehicles = at->vehicles,
                               .positions = at->positions };
    vg_model_from(&at->scene, &at->root, &at->def, at->pairs, &at->given, vg_scene_controlled(&at->given));
    assert_int_equal(at->scene.count, 1);
    decide(at, 1);
    predict(at);
    for (uint32_t p = 0; p < at->def.points; ++p) {
        const double way = 6.0 * at->def.point_s * p;
        CHECK_NEAR(tracks.of[1].x[p], 100.0 + way * cos(2.0), 1e-9);
        CHECK_NEAR(tracks.of[1].y[p], 90.0 + way * sin(2.0), 1e-9);
        CHECK_NEAR(tracks.of[1].speed[p], 6.0, 0.0);
    }
    stage_close(at);
}

static void pose_at(const verge_road* road, double s, double* x, double* y, double* c, double* n)
{
    const vg_reference at = vg_road_at(road, 0, -1, s);
    *x = at.x - 0.5 * at.sin_heading;
    *y = at.y + 0.5 * at.cos_heading;
    *c = at.cos_heading;
    *n = at.sin_heading;
}

static void poses_go_over_seams_without_a_jump(void** state)
{
    (void)state;
    stage* at = stage_open(3, 100.0);
    static const double bend[3][3][2] = { { { 0, 0 }, { 15, 0 }, { 30, 0 } },
                                          { { 30, 0 }, { 45, 1 }, { 60, 4 } },
                                          { { 60, 4 }, { 75, 9 }, { 90, 16 } } };
    for (uint32_t i = 0; i < 3; ++i) {
        at->lanes[i].points = bend[i];
        at->lanes[i].point_count = 3;
        at->lanes[i].left = at->lanes[i].right = VERGE_NO_LANE;
        at->lanes[i].successor_count = i < 2;
        at->lanes[i].successors[0] = (int32_t)i + 1;
    }
    stage_build(at);
    double x0 = 0.0, y0 = 0.0, c = 0.0, n = 0.0, c0 = 0.0, n0 = 0.0;
    pose_at(at->road, 0.0, &x0, &y0, &c0, &n0);
    for (double s = 0.25; s < 110.0; s += 0.25) { // 20 m beyond the last lane's end
        double x = 0.0, y = 0.0;
        pose_at(at->road, s, &x, &y, &c, &n);
        CHECK_NEAR(hypot(x - x0, y - y0), 0.25, 0.02);
        CHECK_NEAR(c * n0 - n * c0, 0.0, 0.05);
        x0 = x;
        y0 = y;
        c0 = c;
        n0 = n;
    }
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planned_bodies_meet_the_decision_at_every_step),
        cmocka_unit_test(everyone_starts_where_it_is_with_the_body_it_has),
        cmocka_unit_test(a_human_that_crosses_goes_on_to_the_next_centre_and_stays_there),
        cmocka_unit_test(bodies_move_as_fast_as_they_say_and_where_they_point),
        cmocka_unit_test(a_human_at_the_limit_on_a_free_road_keeps_its_speed_and_lane),
        cmocka_unit_test(a_human_makes_way_for_who_is_decided_to_come_in_front),
        cmocka_unit_test(off_the_road_a_body_goes_straight_on),
        cmocka_unit_test(poses_go_over_seams_without_a_jump),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
