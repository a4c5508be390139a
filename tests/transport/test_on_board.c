/// Goal: a vehicle that plans from the decision in its message has the trajectory of the roadside
///       unit, to the last bit.
/// Method: a planner drives vehicles that change lanes among others; each plan is encoded, decoded,
///         and planned again by the stages alone.
#include "check.h"
#include "closed_loop.h"

#include "codec.h"
#include "verge/message.h"
#include "verge/verge.h"
#include "verge/wire.h"

#include <math.h>
#include <stdalign.h>
#include <string.h>

enum { LANES = 3, VEHICLES = 6, CONTROLLED = 3, CYCLES = 30 };

alignas(64) static unsigned char planner_memory[8 << 20], predictor_memory[1 << 20],
    sampler_memory[1 << 20];

static verge_planner_def def_of(double step_s, uint32_t steps)
{
    static const double points[LANES][3][2] = { { { 0, 0 }, { 400, 0 }, { 800, 60 } },
                                                { { 0, 3.5 }, { 400, 3.5 }, { 800, 63.5 } },
                                                { { 0, 7 }, { 400, 7 }, { 800, 67 } } };
    static verge_lane_def lanes[LANES];
    for (int32_t i = 0; i < LANES; ++i) {
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = points[i];
        lanes[i].point_count = 3;
        lanes[i].left = i + 1 < LANES ? i + 1 : VERGE_NO_LANE;
        lanes[i].right = i > 0 ? i - 1 : VERGE_NO_LANE;
    }
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, LANES };
    def.iterations = 300;
    def.step_s = step_s;
    def.steps = steps;
    return def;
}

static void place_vehicles(verge_vehicle vehicles[VEHICLES])
{
    for (int32_t i = 0; i < VEHICLES; ++i) {
        vehicles[i] = verge_vehicle_default();
        vehicles[i].id = 20 + i;
        vehicles[i].controlled = i < CONTROLLED;
        vehicles[i].x = 60.0 + 25.0 * (i % CONTROLLED) + 90.0 * (i / CONTROLLED);
        vehicles[i].y = 3.5 * (i % LANES);
        vehicles[i].speed = 9.0 + 0.7 * i;
        vehicles[i].target_lane = i < CONTROLLED ? 2 - i % LANES : VERGE_NO_LANE;
    }
}

/// The vehicles half a second later: controlled ones on their trajectories, others straight ahead.
static void move_vehicles(verge_vehicle vehicles[VEHICLES], const verge_plan* plan)
{
    for (uint32_t i = 0; i < VEHICLES; ++i) {
        verge_vehicle* v = &vehicles[i];
        if (i < CONTROLLED) {
            take_point(v, &plan->vehicles[i].points[5]);
        } else {
            v->x += 0.5 * v->speed;
        }
    }
}

/// Over the wire and back.
static verge_vehicle_plan_t received(const verge_plan* plan, uint32_t index)
{
    const wire_plan_header header = { .utime = plan->utime + 1, .valid_until_utime = plan->utime + 1,
                                      .digest = plan->digest };
    static transport_message sealed, message;
    uint8_t bytes[CODEC_SIZE_MAX];
    const verge_vehicle_plan_t sent = wire_plan_from_vehicle_plan(&header, &plan->vehicles[index]);
    message_seal(TRANSPORT_PLAN, &sent, &sealed.as);
    const size_t size = codec_encode(TRANSPORT_PLAN, &sealed.as, bytes);
    assert_true(codec_decode(TRANSPORT_PLAN, bytes, size, &message));
    assert_null(wire_plan_check(&message.as.plan));
    return message.as.plan;
}

static uint32_t drive(const verge_planner_def* def)
{
    verge_planner* planner = NULL;
    verge_predictor* predictor = NULL;
    verge_sampler* sampler = NULL;
    assert_int_equal(verge_planner_init(&planner, def, planner_memory, sizeof planner_memory),
                     VERGE_OK);
    assert_int_equal(verge_predictor_init(&predictor, def, predictor_memory,
                                          sizeof predictor_memory), VERGE_OK);
    assert_int_equal(verge_sampler_init(&sampler, def, sampler_memory, sizeof sampler_memory),
                     VERGE_OK);
    static verge_plan plan;
    static verge_vehicle_plan last[CONTROLLED], own;
    verge_vehicle vehicles[VEHICLES], placed[VEHICLES];
    verge_lane_position positions[VEHICLES];
    verge_vehicle_decision decided[CONTROLLED];
    verge_track bodies[VEHICLES];
    verge_tracks tracks = verge_tracks_make(bodies, VEHICLES);
    uint32_t changes = 0;
    place_vehicles(vehicles);
    for (uint32_t cycle = 0; cycle < CYCLES; ++cycle) {
        assert_int_equal(verge_planner_step(planner, (int64_t)cycle * 500000, vehicles, VEHICLES,
                                            &plan), VERGE_OK);
        verge_scene scene = verge_scene_make(verge_planner_road(planner), placed, positions,
                                             VEHICLES);
        const verge_scene* whole = verge_planner_scene(planner);
        memcpy(placed, whole->vehicles, sizeof placed);
        memcpy(positions, whole->positions, sizeof positions);
        scene.utime = whole->utime;
        scene.vehicle_count = VEHICLES;
        verge_decision decision = verge_decision_make(decided, CONTROLLED);
        for (uint32_t i = 0; i < CONTROLLED; ++i) {
            const verge_vehicle_plan_t message = received(&plan, i);
            assert_true(wire_decision_from_plan(&message, &decided[decision.vehicle_count++]));
        }
        assert_int_equal(verge_predict(predictor, &scene, &decision, &tracks), VERGE_OK);
        for (uint32_t i = 0; i < CONTROLLED && plan.replanned_count == 0; ++i) {
            const verge_vehicle_plan* unit = &plan.vehicles[i];
            assert_int_equal(verge_plan_vehicle(sampler, &scene, &decided[i], &tracks,
                                                cycle == 0 ? NULL : &last[i], &own), VERGE_OK);
            assert_int_equal(own.status, unit->status);
            assert_memory_equal(own.points, unit->points, unit->point_count * sizeof own.points[0]);
            assert_int_equal(own.change_lane_id, unit->change_lane_id);
            changes += own.change_lane_id != VERGE_NO_LANE ? 1 : 0;
        }
        memcpy(last, plan.vehicles, sizeof last);
        move_vehicles(vehicles, &plan);
    }
    return changes;
}

static void a_plan_from_the_decision_in_the_message_is_that_of_the_roadside_unit(void** state)
{
    (void)state;
    const verge_planner_def usual = def_of(1.5, 7);
    assert_true(drive(&usual) >= 1); // cycles in a lane change
    const verge_planner_def odd = def_of(1.0 / 0.7, 6); // times that are no whole milliseconds
    (void)drive(&odd);
}

/// A message holds seven steps: what comes later decides nothing of a trajectory.
static void steps_that_do_not_fit_the_message_change_no_trajectory(void** state)
{
    (void)state;
    const verge_planner_def longer = def_of(1.0, VERGE_STEPS_MAX < 10 ? VERGE_STEPS_MAX : 10);
    (void)drive(&longer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plan_from_the_decision_in_the_message_is_that_of_the_roadside_unit),
        cmocka_unit_test(steps_that_do_not_fit_the_message_change_no_trajectory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
