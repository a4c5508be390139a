// The public stages by themselves, as a program uses them that brings its own decision, prediction
// or trajectory planner: public headers only.
#include "check.h"
#include "closed_loop.h"
#include "rng.h"
#include "strict.h"

#include <verge/verge.h>

#include <math.h>
#include <stdalign.h>
#include <stdio.h>

enum { LANES = 2, SCENE_MAX = 80 };
static const double lane_width = 3.5; // [m]
static const double point_s = 0.1;    // [s] the default

typedef struct stages {
    verge_planner_def      def;
    const verge_road*      road;
    verge_decider*         decider;
    verge_predictor*       predictor;
    verge_sampler*         sampler;
    verge_scene            scene;
    verge_decision         decision;
    verge_tracks           tracks;
    verge_vehicle          vehicles[SCENE_MAX];
    verge_lane_position    positions[SCENE_MAX];
    verge_vehicle_decision decisions[VERGE_CONTROLLED_MAX];
    verge_track            bodies[SCENE_MAX];
} stages;

alignas(64) static unsigned char road_memory[1 << 20];
alignas(64) static unsigned char stage_memory[2][3][8 << 20];
alignas(64) static unsigned char planner_memory[8 << 20];
static stages one, two;

static verge_planner_def road_def(void)
{
    static const double centrelines[LANES][2][2] = { { { 0.0, 0.0 }, { 900.0, 0.0 } },
                                                     { { 0.0, 3.5 }, { 900.0, 3.5 } } };
    static verge_lane_def lanes[LANES];
    for (int32_t i = 0; i < LANES; ++i) {
        lanes[i] = (verge_lane_def){ .id = 10 + i, .points = centrelines[i], .point_count = 2,
                                     .width = lane_width, .speed_limit = 20.0,
                                     .left = i == 0 ? 11 : VERGE_NO_LANE,
                                     .right = i == 1 ? 10 : VERGE_NO_LANE };
    }
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, LANES };
    def.iterations = 300;
    return def;
}

static void open_stages(stages* at, unsigned char memory[3][8 << 20], const verge_road* road)
{
    memset(at, 0, sizeof *at);
    at->def = road_def();
    at->road = road;
    const size_t size = sizeof memory[0];
    assert_int_equal(verge_decider_init(&at->decider, &at->def, memory[0], size), VERGE_OK);
    assert_int_equal(verge_predictor_init(&at->predictor, &at->def, memory[1], size), VERGE_OK);
    assert_int_equal(verge_sampler_init(&at->sampler, &at->def, memory[2], size), VERGE_OK);
    at->scene = verge_scene_make(road, at->vehicles, at->positions, SCENE_MAX);
    at->decision = verge_decision_make(at->decisions, VERGE_CONTROLLED_MAX);
    at->tracks = verge_tracks_make(at->bodies, SCENE_MAX);
}

static int open_one(void** state)
{
    (void)state;
    const verge_planner_def def = road_def();
    const verge_road* road = NULL;
    assert_int_equal(verge_road_init(&road, &def.road, road_memory, sizeof road_memory), VERGE_OK);
    open_stages(&one, stage_memory[0], road);
    return 0;
}

static verge_vehicle vehicle_at(int32_t id, bool controlled, double x, double y, double speed)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = id;
    vehicle.controlled = controlled;
    vehicle.x = x;
    vehicle.y = y;
    vehicle.speed = speed;
    return vehicle;
}

// Vehicle 3, which the tests decide for, with a human far ahead in each lane.
static void place_three(stages* at, double speed)
{
    const verge_vehicle heard[3] = { vehicle_at(7, false, 200.0, 0.0, 15.0),
                                     vehicle_at(3, true, 50.0, 0.0, speed),
                                     vehicle_at(5, false, 220.0, lane_width, 15.0) };
    assert_int_equal(verge_scene_place(&at->scene, 1000, heard, 3, NULL), VERGE_OK);
}

// Adds a step of this duration with constant acceleration, that ends in the middle of the lane.
static verge_action_step* add_step(verge_vehicle_decision* to, verge_action action, int32_t lane_id,
                                   double duration, double acceleration, double s0, double v0)
{
    const verge_action_step* last = to->step_count == 0 ? NULL : &to->steps[to->step_count - 1];
    const double s = last == NULL ? s0 : last->s, v = last == NULL ? v0 : last->v;
    verge_action_step* step = &to->steps[to->step_count++];
    const double distance = v * duration + 0.5 * acceleration * duration * duration;
    *step = (verge_action_step){ .action = action, .lane_id = lane_id,
                                 .t0 = last == NULL ? 0.0 : last->t1, .s = s + distance,
                                 .v = v + acceleration * duration, .distance = distance,
                                 .ahead_id = -1, .behind_id = -1 };
    step->t1 = step->t0 + duration;
    return step;
}

// Vehicle 3 keeps lane and speed in three steps of 1.5 s.
static verge_vehicle_decision* keep(stages* at, double speed)
{
    verge_vehicle_decision* own = &at->decisions[0];
    memset(own, 0, sizeof *own);
    own->vehicle_id = 3;
    for (uint32_t k = 0; k < 3; ++k) {
        add_step(own, VERGE_KEEP_SPEED, 10, 1.5, 0.0, 50.0, speed);
    }
    at->decision.vehicle_count = 1;
    return own;
}

static verge_status predict(stages* at)
{
    return verge_predict(at->predictor, &at->scene, &at->decision, &at->tracks);
}

// The plan of the vehicle that is decided first.
static verge_vehicle_plan plan_three(stages* at, const verge_vehicle_plan* before)
{
    static verge_vehicle_plan plan;
    assert_int_equal(predict(at), VERGE_OK);
    assert_int_equal(verge_plan_vehicle(at->sampler, &at->scene, &at->decisions[0], &at->tracks,
                                        before, &plan), VERGE_OK);
    return plan;
}

static void same_plan(const verge_vehicle_plan* a, const verge_vehicle_plan* b)
{
    assert_int_equal(a->vehicle_id, b->vehicle_id);
    assert_int_equal(a->utime, b->utime);
    assert_int_equal(a->status, b->status);
    assert_int_equal(a->reason, b->reason);
    assert_int_equal(a->point_count, b->point_count);
    assert_memory_equal(a->points, b->points, a->point_count * sizeof a->points[0]);
    assert_memory_equal(&a->cost, &b->cost, sizeof a->cost);
    assert_int_equal(a->change_lane_id, b->change_lane_id);
    CHECK_SAME_BITS(a->change_end, b->change_end);
    assert_int_equal(a->action_count, b->action_count);
    for (uint32_t t = 0; t < a->action_count; ++t) {
        assert_int_equal(a->actions[t].action, b->actions[t].action);
        assert_int_equal(a->actions[t].lane_id, b->actions[t].lane_id);
        assert_int_equal(a->actions[t].ahead_id, b->actions[t].ahead_id);
        CHECK_SAME_BITS(a->actions[t].s, b->actions[t].s);
        CHECK_SAME_BITS(a->actions[t].v, b->actions[t].v);
    }
}

// ---------------------------------------------------------------------------- decisions by hand

// The vehicle follows its plans, each cycle is decided from where it is: 3 s for the lane change.
static void a_hand_written_decision_reaches_its_lane_and_its_speed(void** state)
{
    (void)state;
    const double wanted = 12.0, change_s = 3.0;
    verge_vehicle vehicle = vehicle_at(3, true, 50.0, 0.0, 10.0);
    verge_vehicle_plan before = { .vehicle_id = -1 };
    for (uint32_t cycle = 0; cycle < 60; ++cycle) {
        const double t = cycle * point_s;
        assert_int_equal(verge_scene_place(&one.scene, cycle * 100000, &vehicle, 1, NULL), VERGE_OK);
        verge_vehicle_decision* own = &one.decisions[0];
        memset(own, 0, sizeof *own);
        own->vehicle_id = 3;
        const double s = one.positions[0].s, left = change_s - t;
        const double a = fmin(fmax(wanted - vehicle.speed, -1.0), 1.0);
        if (left > 0.05) {
            add_step(own, VERGE_CHANGE_LEFT, 11, left, a / left, s, vehicle.speed);
        }
        add_step(own, VERGE_KEEP_SPEED, 11, 4.0, left > 0.05 ? 0.0 : a / 4.0, s, vehicle.speed);
        one.decision.vehicle_count = 1;
        before = plan_three(&one, cycle == 0 ? NULL : &before);
        assert_int_equal(before.status, VERGE_PLANNED);
        take_point(&vehicle, &before.points[1]);
    }
    CHECK_NEAR(vehicle.y, lane_width, 0.3);
    CHECK_NEAR(vehicle.speed, wanted, 0.5);
}

// Would an observer disagree with what is said, over 0.3 s from this point on?
static bool contradicts(const verge_vehicle_plan* plan, uint32_t k)
{
    const double a = (plan->points[k + 3].speed - plan->points[k].speed) / 0.3;
    const verge_action said = plan->actions[0].action;
    return plan->points[k].speed > 0.5
           && (said == VERGE_ACCELERATE   ? a < -0.3
               : said == VERGE_DECELERATE ? a > 0.3
                                          : fabs(a) > 1.0);
}

// Whatever was decided, with a slower vehicle near or far ahead, above or below the limit: a plan
// says what its trajectory does until the next plan comes.
static void a_plan_says_what_its_trajectory_does(void** state)
{
    (void)state;
    static const verge_action actions[] = { VERGE_KEEP_SPEED, VERGE_ACCELERATE, VERGE_DECELERATE };
    uint32_t windows = 0, wrong = 0, brakes = 0;
    for (uint32_t k = 0; k < 3 * 4 * 6 * 3; ++k) {
        const verge_action action = actions[k % 3];
        const double gap = 15.0 + 15.0 * (k / 3 % 4), speed = 4.0 + 4.0 * (k / 12 % 6);
        const double acceleration = -1.0 + (double)(k / 72 % 3);
        verge_vehicle heard[2] = { vehicle_at(3, true, 50.0, 0.0, speed),
                                   vehicle_at(7, false, 55.0 + gap, 0.0, 0.6 * speed) };
        heard[0].acceleration = acceleration;
        assert_int_equal(verge_scene_place(&one.scene, 1000, heard, 2, NULL), VERGE_OK);
        verge_vehicle_decision* own = &one.decisions[0];
        memset(own, 0, sizeof *own);
        own->vehicle_id = 3;
        const double decided = action == VERGE_ACCELERATE   ? 0.6
                               : action == VERGE_DECELERATE ? -0.6
                                                            : 0.0;
        for (uint32_t t = 0; t < 3; ++t) {
            add_step(own, action, 10, 1.5, decided, 50.0, speed);
            own->steps[t].brake_light = action == VERGE_DECELERATE;
        }
        one.decision.vehicle_count = 1;
        const verge_vehicle_plan plan = plan_three(&one, NULL);
        for (uint32_t i = 0; i < 5; ++i) {
            windows++;
            wrong += contradicts(&plan, i);
        }
        brakes += plan.actions[0].action == VERGE_DECELERATE;
        assert_int_equal(own->steps[0].action, action); // the decision keeps its own
    }
    printf("             %u of %u windows contradict\n", wrong, windows);
    CHECK_AT_MOST(wrong, 0.05 * windows);
    assert_true(brakes > 20);
}

// One motion with constant acceleration, given in steps of several lengths, is one prediction.
static void the_reason_and_the_passes_of_a_decision_go_to_its_plan(void** state)
{
    (void)state;
    place_three(&one, 10.0);
    verge_vehicle_decision* own = keep(&one, 10.0);
    own->why = (verge_cause){ VERGE_WHY_MERGE, 7, 11, 0 };
    own->pass_count = VERGE_PASSES_MAX;
    for (int32_t i = 0; i < VERGE_PASSES_MAX; ++i) {
        own->passes[i] = (verge_pass){ 10, 11, 5 + i };
    }
    const verge_vehicle_plan plan = plan_three(&one, NULL);
    assert_memory_equal(&plan.why, &own->why, sizeof plan.why);
    assert_int_equal(plan.pass_count, VERGE_PASSES_MAX);
    assert_memory_equal(plan.passes, own->passes, sizeof plan.passes);
}

static void a_decision_may_have_steps_of_any_length(void** state)
{
    (void)state;
    static const double lengths[3][6] = { { 1.5, 1.5, 1.5 },
                                          { 0.3, 0.9, 0.1, 1.2, 0.4, 1.6 },
                                          { 4.5 } };
    static const uint32_t counts[3] = { 3, 6, 1 };
    for (uint32_t k = 0; k < 3; ++k) {
        place_three(&one, 10.0);
        verge_vehicle_decision* own = &one.decisions[0];
        memset(own, 0, sizeof *own);
        own->vehicle_id = 3;
        one.decision.vehicle_count = 1;
        for (uint32_t i = 0; i < counts[k]; ++i) {
            add_step(own, VERGE_ACCELERATE, 10, lengths[k][i], 0.5, 50.0, 10.0);
        }
        const verge_vehicle_plan plan = plan_three(&one, NULL);
        assert_int_equal(plan.status, VERGE_PLANNED);
        assert_int_equal(plan.action_count, counts[k]);
        for (uint32_t p = 0; p < one.def.points; ++p) {
            const double t = p * point_s;
            CHECK_NEAR(one.bodies[0].x[p], 50.0 + 10.0 * t + 0.25 * t * t, 1e-3);
            CHECK_NEAR(one.bodies[0].speed[p], 10.0 + 0.5 * t, 1e-5);
        }
        CHECK_NEAR(plan.points[30].speed, 11.5, one.def.keep_region_speed);
    }
}

typedef void spoil(verge_vehicle_decision* own);
static void no_steps(verge_vehicle_decision* own) { own->step_count = 0; }
static void too_many_steps(verge_vehicle_decision* own) { own->step_count = VERGE_STEPS_MAX + 1; }
static void unknown_lane(verge_vehicle_decision* own) { own->steps[1].lane_id = 12; }
static void no_lane(verge_vehicle_decision* own) { own->steps[2].lane_id = VERGE_NO_LANE; }
static void unknown_action(verge_vehicle_decision* own) { own->steps[0].action = (verge_action)5; }
static void a_late_start(verge_vehicle_decision* own) { own->steps[0].t0 = 0.1; }
static void a_gap(verge_vehicle_decision* own) { own->steps[1].t0 = 1.6; }
static void an_overlap(verge_vehicle_decision* own) { own->steps[1].t0 = 1.4; }
static void no_duration(verge_vehicle_decision* own) { own->steps[2].t1 = own->steps[2].t0; }
static void no_end(verge_vehicle_decision* own) { own->steps[2].t1 = (double)INFINITY; }
static void nan_start(verge_vehicle_decision* own) { own->steps[0].t0 = (double)NAN; }
static void nan_end(verge_vehicle_decision* own) { own->steps[2].t1 = (double)NAN; }
static void nan_s(verge_vehicle_decision* own) { own->steps[1].s = (double)NAN; }
static void nan_d(verge_vehicle_decision* own) { own->steps[1].d = (double)NAN; }
static void nan_v(verge_vehicle_decision* own) { own->steps[1].v = (double)NAN; }
static void nan_distance(verge_vehicle_decision* own) { own->steps[1].distance = (double)NAN; }
static void backwards(verge_vehicle_decision* own) { own->steps[1].v = -1.0; }
static void a_negative_distance(verge_vehicle_decision* own) { own->steps[1].distance = -1.0; }

static void a_decision_that_makes_no_sense_is_refused_and_changes_nothing(void** state)
{
    (void)state;
    static spoil* const all[] = { no_steps, too_many_steps, unknown_lane, no_lane, unknown_action,
                                  a_late_start, a_gap, an_overlap, no_duration, no_end, nan_start,
                                  nan_end, nan_s, nan_d, nan_v, nan_distance, backwards,
                                  a_negative_distance };
    static verge_track bodies[3], untouched[3];
    static verge_vehicle_plan plan, same;
    memset(untouched, 0x5a, sizeof untouched);
    memset(&same, 0x5a, sizeof same);
    for (uint32_t k = 0; k < sizeof all / sizeof all[0]; ++k) {
        place_three(&one, 10.0);
        verge_vehicle_decision* own = keep(&one, 10.0);
        (void)plan_three(&one, NULL);
        all[k](own);
        memset(bodies, 0x5a, sizeof bodies);
        memset(&plan, 0x5a, sizeof plan);
        verge_tracks tracks = verge_tracks_make(bodies, 3);
        assert_int_equal(verge_predict(one.predictor, &one.scene, &one.decision, &tracks),
                         VERGE_ERR_DEF);
        assert_int_equal(tracks.count, 0);
        assert_memory_equal(bodies, untouched, sizeof bodies);
        assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                         VERGE_ERR_DEF);
        assert_memory_equal(&plan, &same, sizeof plan);
    }
}

// A prediction goes on beyond the last step; a trajectory is planned within the steps only.
static void a_decision_shorter_than_the_trajectory_is_refused(void** state)
{
    (void)state;
    static verge_vehicle_plan plan, same;
    memset(&plan, 0x5a, sizeof plan);
    memset(&same, 0x5a, sizeof same);
    place_three(&one, 10.0);
    verge_vehicle_decision* own = keep(&one, 10.0);
    (void)plan_three(&one, NULL);
    own->step_count = 2; // 3 s: just enough
    assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                     VERGE_OK);
    memset(&plan, 0x5a, sizeof plan);
    own->step_count = 1;
    assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                     VERGE_ERR_DEF);
    assert_memory_equal(&plan, &same, sizeof plan);
}

static void a_decision_that_claims_more_vehicles_than_its_array_is_refused(void** state)
{
    (void)state;
    place_three(&one, 10.0);
    (void)keep(&one, 10.0);
    one.decision.vehicle_count = one.decision.vehicles_max + 1;
    assert_int_equal(predict(&one), VERGE_ERR_CAPACITY);
    assert_int_equal(one.tracks.count, 0);
}

// ---------------------------------------------------------------------------- scenes

/// A stage's memory follows road.lane_count of its def: another road with more lanes does not fit.
static void a_road_with_more_lanes_than_the_def_says_is_refused(void** state)
{
    (void)state;
    place_three(&one, 10.0);
    stages* at = &two;
    memset(at, 0, sizeof *at);
    at->def = road_def();
    at->def.road.lane_count = 1;
    const size_t size = sizeof stage_memory[1][0];
    verge_humans* humans = NULL;
    verge_commitment commitment = { 0 };
    assert_int_equal(verge_decider_init(&at->decider, &at->def, stage_memory[1][0], size), VERGE_OK);
    assert_int_equal(verge_predictor_init(&at->predictor, &at->def, stage_memory[1][1], size),
                     VERGE_OK);
    assert_int_equal(verge_humans_init(&humans, &at->def, stage_memory[1][2], size), VERGE_OK);
    assert_int_equal(verge_decide(at->decider, &one.scene, &commitment, &one.decision),
                     VERGE_ERR_CAPACITY);
    assert_int_equal(verge_predict(at->predictor, &one.scene, NULL, &one.tracks),
                     VERGE_ERR_CAPACITY);
    assert_int_equal(verge_humans_advance(humans, one.road, NULL, one.vehicles, 1, 0.1),
                     VERGE_ERR_CAPACITY);
}

static void a_body_with_only_some_of_its_numbers_is_refused(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_body_param* params = verge_body_params(&count);
    assert_true(count >= 16);
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t k = 0; k < 2; ++k) {
            verge_vehicle heard = vehicle_at(3, true, 50.0, 0.0, 10.0);
            const double number = k == 0 ? params[i].max : (double)NAN;
            memcpy((char*)&heard.body + params[i].offset, &number, sizeof number);
            assert_int_equal(verge_scene_place(&one.scene, 0, &heard, 1, NULL), VERGE_ERR_VEHICLE);
            assert_int_equal(one.scene.vehicle_count, 0);
        }
    }
}

// ---------------------------------------------------------------------------- prediction

static void a_vehicle_without_a_decision_is_predicted_as_a_human(void** state)
{
    (void)state;
    static verge_track human[3];
    verge_vehicle heard[3] = { vehicle_at(3, false, 50.0, 0.0, 14.0),
                               vehicle_at(5, false, 75.0, 0.0, 8.0),
                               vehicle_at(7, false, 60.0, lane_width, 10.0) };
    assert_int_equal(verge_scene_place(&one.scene, 0, heard, 3, NULL), VERGE_OK);
    assert_int_equal(verge_predict(one.predictor, &one.scene, NULL, &one.tracks), VERGE_OK);
    memcpy(human, one.bodies, sizeof human);
    CHECK_AT_MOST(human[0].speed[30], 13.0); // it brakes behind the slower one
    heard[0].controlled = true;
    assert_int_equal(verge_scene_place(&one.scene, 0, heard, 3, NULL), VERGE_OK);
    (void)keep(&one, 14.0);
    one.decisions[0].vehicle_id = 99; // a vehicle that is not there
    const verge_decision* const nothing[3] = { NULL, &one.decision, &two.decision };
    memset(&two.decision, 0, sizeof two.decision);
    for (uint32_t k = 0; k < 3; ++k) {
        assert_int_equal(verge_predict(one.predictor, &one.scene, nothing[k], &one.tracks), VERGE_OK);
        for (uint32_t i = 0; i < 3; ++i) {
            assert_int_equal(one.bodies[i].vehicle_id, human[i].vehicle_id);
            assert_memory_equal(one.bodies[i].x, human[i].x, sizeof human[i].x);
            assert_memory_equal(one.bodies[i].y, human[i].y, sizeof human[i].y);
            assert_memory_equal(one.bodies[i].speed, human[i].speed, sizeof human[i].speed);
        }
    }
}

// ---------------------------------------------------------------------------- trajectories

static void tracks_of_other_vehicles_or_not_finite_are_refused(void** state)
{
    (void)state;
    static verge_vehicle_plan plan, same;
    memset(&plan, 0x5a, sizeof plan);
    memset(&same, 0x5a, sizeof same);
    for (uint32_t k = 0; k < 8; ++k) {
        place_three(&one, 10.0);
        verge_vehicle_decision* own = keep(&one, 10.0);
        (void)plan_three(&one, NULL);
        verge_track* other = &one.bodies[1];
        const verge_track first = one.bodies[1];
        switch (k) {
        case 0: other->vehicle_id = 6; break;
        case 1: one.bodies[1] = one.bodies[2], one.bodies[2] = first; break; // another order
        case 2: other->x[4] = (double)NAN; break;
        case 3: other->y[30] = (double)INFINITY; break;
        case 4: other->cos_heading[7] = (double)NAN; break;
        case 5: other->sin_heading[7] = (double)NAN; break;
        case 6: other->speed[29] = (double)NAN; break;
        default: other->half_length = (double)NAN; break;
        }
        assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                         VERGE_ERR_VEHICLE);
        assert_memory_equal(&plan, &same, sizeof plan);
    }
}

static void of_the_vehicles_own_track_only_its_size_counts(void** state)
{
    (void)state;
    static verge_vehicle_plan plan;
    verge_track* track = &one.bodies[0];
    place_three(&one, 10.0);
    const verge_vehicle_decision* own = keep(&one, 10.0);
    const verge_vehicle_plan expected = plan_three(&one, NULL);
    memset(track, 0xff, sizeof *track); // NaN
    verge_track_begin(track, &one.scene.vehicles[0]);
    assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                     VERGE_OK);
    same_plan(&plan, &expected);
    track->half_width = 0.0; // as in a track that was not filled in: it would pass through any gap
    assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                     VERGE_ERR_VEHICLE);
}

// The habit of an uncontrolled vehicle is not checked, though it weighs the costs of its
// trajectory.
static void only_a_controlled_vehicle_of_the_scene_is_planned(void** state)
{
    (void)state;
    static verge_vehicle_plan plan;
    place_three(&one, 10.0);
    verge_vehicle_decision* own = keep(&one, 10.0);
    (void)plan_three(&one, NULL);
    static const int32_t others[3] = { 5, 99, -1 };
    for (uint32_t k = 0; k < 3; ++k) {
        own->vehicle_id = others[k];
        assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                         VERGE_ERR_VEHICLE);
    }
}

// Below 2 m/s the curvature is the one that the last trajectory had there.
static void a_last_plan_with_no_usable_curvature_counts_as_none(void** state)
{
    (void)state;
    static verge_vehicle_plan before;
    static const double bad[] = { (double)NAN, (double)INFINITY, -(double)INFINITY, 1e300 };
    place_three(&one, 1.0);
    (void)keep(&one, 1.0);
    const verge_vehicle_plan expected = plan_three(&one, NULL);
    for (uint32_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        before = expected;
        before.points[0].curvature = bad[k];
        const verge_vehicle_plan plan = plan_three(&one, &before);
        same_plan(&plan, &expected);
    }
}

// ---------------------------------------------------------------------------- all stages

static void a_rounded_decision_is_near_the_decision_and_rounded_again_the_same(void** state)
{
    (void)state;
    place_three(&one, 10.0);
    verge_vehicle_decision* own = keep(&one, 10.0);
    own->steps[0].t1 = own->steps[1].t0 = 1.0 / 3.0;
    own->steps[1].t1 = own->steps[2].t0 = 2.0 / 3.0;
    own->steps[1].s = 80.0 + 1.0 / 3.0;
    own->steps[1].d = -1.0 / 3.0;
    own->steps[2].d = 1e9;                // no lane is as wide
    own->steps[2].distance = (double)NAN; // for the check of decisions to refuse
    const verge_vehicle_decision before = *own;
    verge_decision_round(&one.decision);
    for (uint32_t t = 0; t < 3; ++t) {
        const verge_action_step *step = &own->steps[t], *was = &before.steps[t];
        assert_true(step->t1 >= was->t1 - 1e-9 && step->t1 < was->t1 + 1e-3);
        CHECK_NEAR(step->s, was->s, 1e-5);
        CHECK_NEAR(step->v, was->v, 1e-6);
        assert_true(t == 0 || step->t0 == step[-1].t1);
        CHECK_SAME_BITS(step->s, (double)(float)step->s);
    }
    CHECK_NEAR(own->steps[1].d, -0.333, 1e-12);
    assert_true(own->steps[2].d < 33.0 && isnan(own->steps[2].distance));
    const verge_vehicle_decision once = *own;
    verge_decision_round(&one.decision);
    assert_memory_equal(&once, own, sizeof once);
}

// Vehicle 3 has humans around it; vehicle 4 is so far away that the two share nothing.
static void the_stages_alone_plan_what_the_planner_plans(void** state)
{
    (void)state;
    static verge_plan whole;
    static verge_vehicle_plan before[2], now[2];
    static verge_commitment commitment;
    verge_planner* planner = NULL;
    const verge_planner_def def = road_def();
    assert_int_equal(verge_planner_init(&planner, &def, planner_memory, sizeof planner_memory),
                     VERGE_OK);
    memset(&commitment, 0, sizeof commitment);
    verge_vehicle heard[4] = { vehicle_at(3, true, 50.0, 0.0, 12.0),
                               vehicle_at(4, true, 700.0, 0.0, 9.0),
                               vehicle_at(5, false, 80.0, 0.0, 8.0),
                               vehicle_at(7, false, 10.0, lane_width, 10.0) };
    heard[0].target_lane = 11;
    for (uint32_t cycle = 0; cycle < 8; ++cycle) {
        const int64_t utime = cycle * 500000;
        assert_int_equal(verge_planner_step(planner, utime, heard, 4, &whole), VERGE_OK);
        assert_int_equal(verge_scene_place(&one.scene, utime, heard, 4, NULL), VERGE_OK);
        assert_int_equal(verge_decide(one.decider, &one.scene, &commitment, &one.decision),
                         VERGE_OK);
        verge_decision_round(&one.decision);
        assert_int_equal(predict(&one), VERGE_OK);
        assert_int_equal(whole.replanned_count, 0);
        for (uint32_t i = 0; i < 2; ++i) {
            const verge_vehicle_plan* last = cycle == 0 ? NULL : &before[i];
            assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, &one.decisions[i],
                                                &one.tracks, last, &now[i]), VERGE_OK);
            same_plan(&now[i], &whole.vehicles[i]);
            take_point(&heard[i], &now[i].points[5]);
        }
        memcpy(before, now, sizeof before);
        heard[2].x += 4.0;
        heard[3].x += 5.0;
    }
    CHECK_AT_MOST(1.0, heard[0].y); // it has set out for its lane: the cycles were not all alike
}

static void stages_that_share_a_road_do_not_disturb_each_other_or_the_road(void** state)
{
    (void)state;
    static unsigned char copy[sizeof road_memory];
    const verge_planner_def def = road_def();
    size_t road_size = 0;
    assert_true(verge_road_memory_size(&def.road, &road_size) > 0);
    memcpy(copy, road_memory, road_size);
    place_three(&one, 10.0);
    (void)keep(&one, 10.0);
    const verge_vehicle_plan slow = plan_three(&one, NULL);
    open_stages(&two, stage_memory[1], one.road);
    for (uint32_t k = 0; k < 3; ++k) {
        place_three(&two, 17.0);
        (void)keep(&two, 17.0);
        const verge_vehicle_plan fast = plan_three(&two, NULL);
        const verge_vehicle_plan again = plan_three(&one, NULL);
        same_plan(&again, &slow);
        CHECK_NEAR(fast.points[0].speed, 17.0, 0.0);
    }
    assert_memory_equal(copy, road_memory, road_size);
}

// A scene's arrays may be longer than what a stage holds; sets of vehicles have 64 bits.
static void a_scene_larger_than_the_def_is_refused_by_every_stage(void** state)
{
    (void)state;
    static verge_vehicle heard[SCENE_MAX];
    static verge_vehicle_plan plan;
    static verge_commitment commitment;
    for (int32_t i = 0; i < SCENE_MAX; ++i) {
        heard[i] = vehicle_at(i, i == 0 || i == SCENE_MAX - 1, 10.0 + 10.0 * (i / 2),
                              lane_width * (i % 2), 10.0);
    }
    assert_int_equal(verge_scene_place(&one.scene, 0, heard, SCENE_MAX, NULL), VERGE_OK);
    verge_vehicle_decision* own = keep(&one, 10.0);
    own->vehicle_id = SCENE_MAX - 1;
    assert_int_equal(verge_decide(one.decider, &one.scene, &commitment, &one.decision),
                     VERGE_ERR_CAPACITY);
    assert_int_equal(verge_predict(one.predictor, &one.scene, NULL, &one.tracks), VERGE_ERR_CAPACITY);
    assert_int_equal(predict(&one), VERGE_ERR_CAPACITY);
    one.tracks.count = SCENE_MAX;
    assert_int_equal(verge_plan_vehicle(one.sampler, &one.scene, own, &one.tracks, NULL, &plan),
                     VERGE_ERR_CAPACITY);
}

static void humans_refuse_more_controlled_vehicles_than_the_def_holds(void** state)
{
    (void)state;
    static verge_vehicle vehicles[40], same[40];
    verge_humans* humans = NULL;
    assert_int_equal(verge_humans_init(&humans, &one.def, stage_memory[1][0],
                                       sizeof stage_memory[1][0]), VERGE_OK);
    for (int32_t i = 0; i < 40; ++i) {
        vehicles[i] = vehicle_at(i, i <= VERGE_CONTROLLED_MAX, 10.0 + 20.0 * i, 0.0, 10.0);
    }
    memcpy(same, vehicles, sizeof same);
    assert_int_equal(verge_humans_advance(humans, one.road, NULL, vehicles, 40, 0.1), VERGE_ERR_CAPACITY);
    assert_memory_equal(vehicles, same, sizeof same);
    vehicles[0].controlled = false;
    assert_int_equal(verge_humans_advance(humans, one.road, NULL, vehicles, 40, 0.1), VERGE_OK);
    CHECK_NEAR(vehicles[0].x, 11.0, 0.1);
}

// What lies beyond the arrays of a commitment could be anything: here it would name vehicle 3 and
// have it change its lane.
static void a_commitment_with_counts_beyond_the_capacities_is_ignored(void** state)
{
    (void)state;
    static verge_commitment none, garbage;
    static verge_vehicle_decision expected;
    memset(&none, 0, sizeof none);
    place_three(&one, 10.0);
    assert_int_equal(verge_decide(one.decider, &one.scene, &none, &one.decision), VERGE_OK);
    expected = one.decisions[0];
    const verge_search_report report = one.decision.search;
    for (uint32_t k = 0; k < 2; ++k) {
        memset(&garbage, 0, sizeof garbage);
        memset(garbage.actions, VERGE_CHANGE_LEFT, sizeof garbage.actions);
        const int32_t id = 3;
        memcpy(k == 0 ? (void*)garbage.vehicle_ids : garbage.actions, &id, sizeof id);
        garbage.step_count = k == 0 ? VERGE_STEPS_MAX + 1 : VERGE_STEPS_MAX;
        garbage.vehicle_count = k == 0 ? 1 : VERGE_CONTROLLED_MAX + 1;
        assert_int_equal(verge_decide(one.decider, &one.scene, &garbage, &one.decision), VERGE_OK);
        assert_int_equal(one.decision.search.nodes, report.nodes);
        assert_int_equal(one.decision.search.nodes_first, report.nodes_first);
        assert_int_equal(garbage.vehicle_count, 1);
        for (uint32_t t = 0; t < expected.step_count; ++t) {
            assert_int_equal(one.decisions[0].steps[t].action, expected.steps[t].action);
        }
    }
}

// Decisions and tracks of both are the same to the bit, cycle for cycle.
static void check_same_cycle(const stages* a, const stages* b)
{
    assert_int_equal(a->decision.vehicle_count, b->decision.vehicle_count);
    for (uint32_t i = 0; i < a->decision.vehicle_count; ++i) {
        for (uint32_t t = 0; t < a->decisions[i].step_count; ++t) {
            assert_int_equal(a->decisions[i].steps[t].action, b->decisions[i].steps[t].action);
            CHECK_SAME_BITS(a->decisions[i].steps[t].s, b->decisions[i].steps[t].s);
            CHECK_SAME_BITS(a->decisions[i].steps[t].v, b->decisions[i].steps[t].v);
        }
    }
    for (uint32_t i = 0; i < a->tracks.count; ++i) {
        assert_memory_equal(a->bodies[i].x, b->bodies[i].x, a->def.points * sizeof(double));
        assert_memory_equal(a->bodies[i].y, b->bodies[i].y, a->def.points * sizeof(double));
    }
}

static void a_predictor_in_the_memory_of_a_decider_changes_no_decision_and_no_prediction(void** state)
{
    (void)state;
    static verge_commitment last[2];
    memset(last, 0, sizeof last);
    open_stages(&two, stage_memory[1], one.road);
    const size_t size = verge_predictor_shared_memory_size(&two.def);
    assert_true(size > 0 && size < verge_predictor_memory_size(&two.def) / 4);
    assert_int_equal(verge_predictor_init_shared(&two.predictor, two.decider, stage_memory[1][1],
                                                 size - 1), VERGE_ERR_MEMORY);
    assert_null(two.predictor);
    assert_int_equal(verge_predictor_init_shared(&two.predictor, two.decider, stage_memory[1][1],
                                                 size), VERGE_OK);
    for (uint32_t cycle = 0; cycle < 8; ++cycle) {
        for (uint32_t k = 0; k < 2; ++k) {
            stages* at = k == 0 ? &one : &two;
            place_three(at, 8.0 + cycle);
            assert_int_equal(verge_decide(at->decider, &at->scene, &last[k], &at->decision), VERGE_OK);
            assert_int_equal(predict(at), VERGE_OK);
        }
        check_same_cycle(&one, &two);
    }
}

static verge_vehicle_plan stop_three(stages* at, const verge_vehicle_plan* before)
{
    static verge_vehicle_plan plan;
    assert_int_equal(verge_predict(at->predictor, &at->scene, NULL, &at->tracks), VERGE_OK);
    assert_int_equal(verge_plan_stop(at->sampler, &at->scene, 3, &at->tracks, before, &plan), VERGE_OK);
    assert_int_equal(plan.reason, VERGE_REASON_STOP);
    assert_int_equal(plan.status, VERGE_FALLBACK_BRAKE);
    return plan;
}

/// It comes to rest by braking gently, one plan after the other, and stays in its lane.
static void a_stop_ends_at_standstill_in_the_lane_and_is_drivable(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("stop");
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        const double v = test_rng_between(&rng, 0.0, 20.0), d = test_rng_between(&rng, -0.6, 0.6);
        verge_vehicle own = vehicle_at(3, true, 50.0, d, v);
        verge_vehicle_plan plan, before;
        bool stands = false;
        for (uint32_t k = 0; k < 8 && !stands; ++k) {
            assert_int_equal(verge_scene_place(&one.scene, 2000000 * k, &own, 1, NULL), VERGE_OK);
            plan = stop_three(&one, k == 0 ? NULL : &before);
            char text[160] = "";
            const verge_body body = verge_vehicle_body(&own);
            const char* fault = strict_motion_fault(&plan, &body, point_s, text);
            if (fault != NULL) {
                fail_msg("%s: %s", fault, text);
            }
            for (uint32_t i = 1; i < plan.point_count; ++i) {
                CHECK_AT_MOST(plan.points[i].speed, plan.points[i - 1].speed + 1e-9);
                CHECK_AT_MOST(-2.2, plan.points[i].acceleration);
                CHECK_BETWEEN(plan.points[i].y, -0.65, 0.65);
            }
            take_point(&own, &plan.points[20]);
            before = plan;
            stands = plan.points[20].speed == 0.0;
        }
        assert_true(stands);
    }
}

static void a_stop_brakes_as_hard_as_a_body_ahead_needs(void** state)
{
    (void)state;
    const double gaps[] = { 70.0, 45.0, 30.0 };
    double hardest = 0.0;
    for (uint32_t i = 0; i < 3; ++i) {
        const verge_vehicle heard[2] = { vehicle_at(3, true, 50.0, 0.0, 18.0),
                                         vehicle_at(7, false, 55.0 + gaps[i], 0.0, 0.0) };
        assert_int_equal(verge_scene_place(&one.scene, 0, heard, 2, NULL), VERGE_OK);
        const verge_vehicle_plan plan = stop_three(&one, NULL);
        double braking = 0.0;
        for (uint32_t k = 0; k < plan.point_count; ++k) {
            braking = fmax(braking, -plan.points[k].acceleration);
            verge_track_set(&one.tracks.of[0], k, plan.points[k].x, plan.points[k].y,
                            plan.points[k].heading, plan.points[k].speed);
        }
        assert_true(braking >= hardest);
        CHECK_AT_MOST(braking, 8.0 + 1e-6);
        hardest = braking;
        assert_false(verge_tracks_contact(&one.tracks, 0, plan.point_count, 0.0, NULL, NULL));
    }
    CHECK_AT_MOST(5.0, hardest); // 18^2 / 2 / 30
}

/// Two bodies of 5 m on one line approach each other: the first instant follows from their speeds.
static void the_contact_of_tracks_is_the_first_one(void** state)
{
    (void)state;
    const verge_vehicle heard[3] = { vehicle_at(3, true, 50.0, 0.0, 10.0),
                                     vehicle_at(5, false, 90.0, lane_width, 0.0),
                                     vehicle_at(7, false, 70.0, 0.0, 0.0) };
    assert_int_equal(verge_scene_place(&one.scene, 0, heard, 3, NULL), VERGE_OK);
    one.tracks.count = 3;
    for (uint32_t i = 0; i < 3; ++i) {
        verge_track_begin(&one.tracks.of[i], &heard[i]);
        for (uint32_t k = 0; k < VERGE_POINTS_MAX; ++k) {
            verge_track_set(&one.tracks.of[i], k, heard[i].x + heard[i].speed * point_s * k,
                            heard[i].y, 0.0, heard[i].speed);
        }
    }
    uint32_t other = 99, instant = 99;
    assert_true(verge_tracks_contact(&one.tracks, 0, VERGE_POINTS_MAX, 0.0, &other, &instant));
    assert_int_equal(other, 2);
    CHECK_BETWEEN(instant, 14, 16); // 20 m less a length of 5 m, at 10 m/s
    assert_true(verge_tracks_contact(&one.tracks, 0, VERGE_POINTS_MAX, 1.0, &other, &instant));
    CHECK_BETWEEN(instant, 13, 15); // the own body grows by a metre
    assert_false(verge_tracks_contact(&one.tracks, 0, 10, 0.0, &other, &instant)); // too early
    one.tracks.of[2].trailer = 0;
    one.tracks.of[0].trailer = 2; // the own trailer is no other body
    assert_false(verge_tracks_contact(&one.tracks, 0, VERGE_POINTS_MAX, 0.0, &other, &instant));
    one.tracks.of[0].trailer = 0;
    verge_track_set(&one.tracks.of[2], 0, 52.0, 0.0, 0.0, 0.0);
    assert_true(verge_tracks_contact(&one.tracks, 0, VERGE_POINTS_MAX, 0.0, &other, &instant));
    assert_int_equal(instant, 0);
    assert_false(verge_tracks_contact(NULL, 0, 31, 0.0, NULL, NULL));
    assert_false(verge_tracks_contact(&one.tracks, 3, 31, 0.0, NULL, NULL));
    assert_false(verge_tracks_contact(&one.tracks, 0, VERGE_POINTS_MAX + 1, 0.0, NULL, NULL));
}

#define CASE(claim) cmocka_unit_test_setup(claim, open_one)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CASE(a_hand_written_decision_reaches_its_lane_and_its_speed),
        CASE(the_reason_and_the_passes_of_a_decision_go_to_its_plan),
        CASE(a_plan_says_what_its_trajectory_does),
        CASE(a_decision_may_have_steps_of_any_length),
        CASE(a_decision_that_makes_no_sense_is_refused_and_changes_nothing),
        CASE(a_decision_shorter_than_the_trajectory_is_refused),
        CASE(a_decision_that_claims_more_vehicles_than_its_array_is_refused),
        CASE(a_body_with_only_some_of_its_numbers_is_refused),
        CASE(a_road_with_more_lanes_than_the_def_says_is_refused),
        CASE(a_vehicle_without_a_decision_is_predicted_as_a_human),
        CASE(tracks_of_other_vehicles_or_not_finite_are_refused),
        CASE(of_the_vehicles_own_track_only_its_size_counts),
        CASE(only_a_controlled_vehicle_of_the_scene_is_planned),
        CASE(a_last_plan_with_no_usable_curvature_counts_as_none),
        CASE(a_rounded_decision_is_near_the_decision_and_rounded_again_the_same),
        CASE(the_stages_alone_plan_what_the_planner_plans),
        CASE(stages_that_share_a_road_do_not_disturb_each_other_or_the_road),
        CASE(a_scene_larger_than_the_def_is_refused_by_every_stage),
        CASE(humans_refuse_more_controlled_vehicles_than_the_def_holds),
        CASE(a_commitment_with_counts_beyond_the_capacities_is_ignored),
        CASE(a_predictor_in_the_memory_of_a_decider_changes_no_decision_and_no_prediction),
        CASE(a_stop_ends_at_standstill_in_the_lane_and_is_drivable),
        CASE(a_stop_brakes_as_hard_as_a_body_ahead_needs),
        CASE(the_contact_of_tracks_is_the_first_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
