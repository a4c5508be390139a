/// What the generated test of bad arguments (bad_arguments.py) calls every public function with:
/// one valid value of each type. fresh() makes all of them anew before each call.
#ifndef TEST_BAD_ARGUMENTS_H
#define TEST_BAD_ARGUMENTS_H

#include "check.h"

#include "verge/verge.h"

#include <math.h>

enum { ROOM = 8 << 20 };

static _Alignas(64) uint8_t road_room[1 << 20], room[ROOM], decider_room[ROOM], predictor_room[ROOM],
    sampler_room[ROOM], humans_room[ROOM], planner_room[ROOM];

static const double lines[2][2][2] = { { { 0, 0 }, { 300, 0 } }, { { 0, 4 }, { 300, 4 } } };
static verge_lane_def lanes[2];
static verge_road_def road_def;
static verge_planner_def def;
static const verge_road* road;
static verge_planner* planner;
static verge_decider* decider;
static verge_predictor* predictor;
static verge_sampler* sampler;
static verge_humans* humans;
static verge_vehicle vehicles[2];
static verge_vehicle placed[4], placed_before[4];
static verge_lane_position positions[4], positions_before[4];
static verge_scene scene, scene_before;
static verge_commitment commitment;
static verge_vehicle_decision decided[2];
static verge_decision decision;
static verge_track track, track_room[8];
static verge_tracks tracks;
static verge_plan plan;
static verge_vehicle_plan vehicle_plan, vehicle_plan_before;
static verge_body body;
static verge_body_fault body_fault;
static verge_vehicle_fault vehicle_fault;
static verge_road_fault road_fault;
static verge_lane_report lane_report;
static verge_action_step action_step;
static verge_signal_fault signal_fault;
static verge_signal traffic_signals[2];
static const int32_t lawless_ids[1] = { 2 };
static verge_human_rules human_rules;
static verge_memory_term terms[VERGE_MEMORY_TERMS];
static const char* words;
static char text[80];
static verge_vehicle_plan last_plans[2];
static verge_scene scene_of_planner;
static verge_vehicle placed_of_planner[4];
static verge_lane_position positions_of_planner[4];
static uint32_t count32;
static size_t a_size;
static double out_x, out_y, out_heading;
// Written by the functions that initialise.
static const verge_road* made_road;
static verge_planner* made_planner;
static verge_decider* made_decider;
static verge_predictor* made_predictor;
static verge_sampler* made_sampler;
static verge_humans* made_humans;

static const char* under_way = "nothing"; // read it in a debugger where a call crashes

static void fresh_road(void)
{
    memset(lanes, 0, sizeof lanes);
    for (int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i + 1;
        lanes[i].points = lines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 4.0;
        lanes[i].speed_limit = 15.0;
        lanes[i].left = i == 0 ? 2 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 1 : VERGE_NO_LANE;
    }
    road_def = (verge_road_def){ lanes, 2 };
    assert_int_equal(verge_road_init(&road, &road_def, road_room, sizeof road_room), VERGE_OK);
}

static void fresh_vehicles(void)
{
    for (int32_t i = 0; i < 2; ++i) {
        vehicles[i] = verge_vehicle_default();
        vehicles[i].id = i + 1;
        vehicles[i].controlled = i == 0;
        vehicles[i].x = 50.0 + 40.0 * i;
        vehicles[i].speed = 10.0;
    }
    vehicles[0].target_lane = 2;
}

static void fresh_stages(void)
{
    assert_int_equal(verge_planner_init(&planner, &def, planner_room, sizeof planner_room), VERGE_OK);
    assert_int_equal(verge_decider_init(&decider, &def, decider_room, sizeof decider_room), VERGE_OK);
    assert_int_equal(verge_predictor_init(&predictor, &def, predictor_room, sizeof predictor_room), VERGE_OK);
    assert_int_equal(verge_sampler_init(&sampler, &def, sampler_room, sizeof sampler_room), VERGE_OK);
    assert_int_equal(verge_humans_init(&humans, &def, humans_room, sizeof humans_room), VERGE_OK);
}

static void fresh(void)
{
    fresh_road();
    fresh_vehicles();
    def = verge_planner_default_def();
    def.road = road_def;
    def.iterations = 20;
    def.nodes_max = 50;
    def.vehicles_max = 4;
    def.controlled_max = 2;
    fresh_stages();
    scene_before = verge_scene_make(road, placed_before, positions_before, 4);
    scene = verge_scene_make(road, placed, positions, 4);
    assert_int_equal(verge_scene_place(&scene_before, 0, vehicles, 2, NULL), VERGE_OK);
    assert_int_equal(verge_scene_place(&scene, 100000, vehicles, 2, &scene_before), VERGE_OK);
    memset(&commitment, 0, sizeof commitment);
    decision = verge_decision_make(decided, 2);
    tracks = verge_tracks_make(track_room, 8);
    assert_int_equal(verge_decide(decider, &scene, &commitment, &decision), VERGE_OK);
    assert_int_equal(verge_predict(predictor, &scene, &decision, &tracks), VERGE_OK);
    assert_int_equal(verge_plan_vehicle(sampler, &scene, decided, &tracks, NULL, &vehicle_plan_before),
                     VERGE_OK);
    last_plans[0] = last_plans[1] = vehicle_plan_before;
    scene_of_planner = verge_scene_make(verge_planner_road(planner), placed_of_planner,
                                        positions_of_planner, 4);
    assert_int_equal(verge_scene_place(&scene_of_planner, 100000, vehicles, 2, NULL), VERGE_OK);
    body = verge_body_of(VERGE_BODY_CAR);
    action_step = decided[0].steps[0];
    traffic_signals[0] = (verge_signal){ 1, VERGE_SIGNAL_RED, 3.0 };
    traffic_signals[1] = (verge_signal){ 2, VERGE_SIGNAL_GREEN, -1.0 };
    human_rules = (verge_human_rules){ traffic_signals, 2, lawless_ids, 1 };
    verge_track_begin(&track, &vehicles[0]);
}

// ---------------------------------------------------------------------------- inside structures

static void a_scene_that_does_not_hold_is_refused_by_every_stage(void** state)
{
    (void)state;
    enum { faults = 9 };
    for (int k = 0; k < faults; ++k) {
        fresh();
        positions[0].lane_id = k == 0 ? 99 : positions[0].lane_id;
        positions[0].s = k == 1 ? NAN : positions[0].s;
        positions[1].d = k == 2 ? INFINITY : positions[1].d;
        placed[1].speed = k == 3 ? NAN : placed[1].speed;
        placed[1].id = k == 4 ? placed[0].id : placed[1].id;
        scene.road = k == 5 ? NULL : scene.road;
        scene.vehicles = k == 6 ? NULL : scene.vehicles;
        scene.positions = k == 7 ? NULL : scene.positions;
        scene.vehicle_count = k == 8 ? scene.vehicles_max + 1 : scene.vehicle_count;
        const verge_status decide = verge_decide(decider, &scene, &commitment, &decision);
        const verge_status predict = verge_predict(predictor, &scene, NULL, &tracks);
        const verge_status planned =
            verge_plan_vehicle(sampler, &scene, decided, &tracks, NULL, &vehicle_plan);
        if (decide != VERGE_ERR_ARGUMENT || predict != VERGE_ERR_ARGUMENT
            || planned != VERGE_ERR_ARGUMENT) {
            fail_msg("fault %d: decide %d, predict %d, plan %d", k, decide, predict, planned);
        }
    }
}

static void a_decision_that_is_not_finite_or_names_what_is_unknown_is_refused(void** state)
{
    (void)state;
    enum { faults = 15 };
    for (int k = 0; k < faults; ++k) {
        fresh();
        verge_action_step* at = &decided[0].steps[0];
        double* const fields[] = { &at->t0, &at->t1, &at->s, &at->d, &at->v, &at->distance };
        if (k < 6) {
            *fields[k] = k % 2 == 0 ? NAN : INFINITY;
        }
        at->lane_id = k == 6 ? 99 : k == 7 ? VERGE_NO_LANE : at->lane_id;
        at->action = k == 8 ? (verge_action)7 : k == 9 ? (verge_action)-1 : at->action;
        decided[0].step_count = k == 10 ? 0 : k == 11 ? UINT32_MAX : decided[0].step_count;
        decided[0].pass_count = k == 12 ? VERGE_PASSES_MAX + 1 : 0;
        decided[0].why.code = k == 13 ? (verge_why)-1 : k == 14 ? VERGE_WHY_COUNT : VERGE_WHY_NONE;
        const verge_status predict = verge_predict(predictor, &scene, &decision, &tracks);
        const verge_status planned =
            verge_plan_vehicle(sampler, &scene, decided, &tracks, NULL, &vehicle_plan);
        if (predict != VERGE_ERR_DEF || planned != VERGE_ERR_DEF) {
            fail_msg("fault %d: predict %d, plan %d", k, predict, planned);
        }
    }
}

static void tracks_that_are_not_finite_are_refused(void** state)
{
    (void)state;
    static const double values[] = { NAN, INFINITY, -INFINITY, 1e300, -1e300 };
    for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
        double* const numbers[] = { &track_room[1].half_length, &track_room[1].x[3],
                                    &track_room[1].cos_heading[0], &track_room[1].speed[5] };
        for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; ++k) {
            fresh();
            *numbers[k] = values[i];
            assert_int_equal(verge_plan_vehicle(sampler, &scene, decided, &tracks, NULL,
                                                &vehicle_plan), VERGE_ERR_VEHICLE);
        }
    }
}

static void whatever_stands_in_the_last_plan_a_plan_is_made(void** state)
{
    (void)state;
    static const double values[] = { NAN, INFINITY, -INFINITY, 1e300, -1e300, 0.0 };
    for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
        fresh();
        for (uint32_t k = 0; k < VERGE_POINTS_MAX; ++k) {
            vehicle_plan_before.points[k].curvature = values[i];
            vehicle_plan_before.points[k].x = i % 2 == 0 ? values[i] : 50.0;
        }
        vehicle_plan_before.change_end = values[i];
        vehicle_plan_before.change_lane_id = 99;
        vehicle_plan_before.point_count = UINT32_MAX;
        vehicle_plan_before.utime = INT64_MIN;
        assert_int_equal(verge_plan_vehicle(sampler, &scene, decided, &tracks, &vehicle_plan_before,
                                            &vehicle_plan), VERGE_OK);
        vehicle_plan_before.utime = scene.utime;
        assert_int_equal(verge_plan_vehicle(sampler, &scene, decided, &tracks, &vehicle_plan_before,
                                            &vehicle_plan), VERGE_OK);
    }
}

static void the_clock_may_jump_by_any_amount(void** state)
{
    (void)state;
    static const int64_t instants[] = { INT64_MIN, INT64_MAX, 0, INT64_MIN, -1, INT64_MAX, INT64_MIN };
    fresh();
    for (size_t i = 0; i < sizeof instants / sizeof instants[0]; ++i) {
        assert_int_equal(verge_planner_step(planner, instants[i], vehicles, 2, &plan), VERGE_OK);
        assert_true(plan.utime == instants[i]);
        assert_int_equal(plan.vehicles[0].status, VERGE_PLANNED);
    }
}

#endif
