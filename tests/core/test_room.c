/// A plan depends on the vehicles of a scene, not on the room for more of them.
/// Method: digests of some cycles, with room for exactly the vehicles of the scene and for more.
#include "check.h"
#include "closed_loop.h"
#include "rng.h"
#include "shipped.h"
#include "town.h"

#include <stdlib.h>

enum { CYCLES = 6, CYCLE_POINTS = 5 };

static verge_plan plan; // large: not on the stack

/// Where the vehicles begin, and on which road.
typedef struct start {
    const char*       name;
    verge_planner_def def;
    uint32_t          count;
    verge_vehicle     begin[VERGE_VEHICLES_MAX];
} start;

/// Controlled vehicles are moved to where their plan puts them, the others at constant speed.
static void drive(verge_vehicle* vehicles, uint32_t count, double dt)
{
    for (uint32_t v = 0; v < count; ++v) {
        vehicles[v].x += dt * vehicles[v].speed * cos(vehicles[v].heading);
        vehicles[v].y += dt * vehicles[v].speed * sin(vehicles[v].heading);
        for (uint32_t p = 0; p < plan.vehicle_count; ++p) {
            if (plan.vehicles[p].vehicle_id == vehicles[v].id) {
                take_point(&vehicles[v], &plan.vehicles[p].points[CYCLE_POINTS]);
            }
        }
    }
}

static void run(const start* scene, uint32_t vehicles_max, uint64_t digests[CYCLES])
{
    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    verge_planner_def def = scene->def;
    def.vehicles_max = vehicles_max;
    def.controlled_max = vehicles_max < VERGE_CONTROLLED_MAX ? vehicles_max : VERGE_CONTROLLED_MAX;
    def.iterations = 200;
    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_planner* planner = NULL;
    assert_int_equal(verge_planner_init(&planner, &def, memory, size), VERGE_OK);
    memcpy(vehicles, scene->begin, sizeof vehicles);
    const double dt = CYCLE_POINTS * def.point_s;
    for (uint32_t cycle = 0; cycle < CYCLES; ++cycle) {
        assert_int_equal(verge_planner_step(planner, (int64_t)(cycle * dt * 1e6), vehicles,
                                            scene->count, &plan), VERGE_OK);
        digests[cycle] = plan.digest;
        drive(vehicles, scene->count, dt);
    }
    free(memory);
}

static void check_rooms(const start* scene)
{
    static const uint32_t rooms[] = { 10, 16, 32, 64 };
    uint64_t exact[CYCLES], more[CYCLES];
    run(scene, scene->count, exact);
    for (size_t k = 0; k < sizeof rooms / sizeof rooms[0]; ++k) {
        if (rooms[k] < scene->count || rooms[k] > VERGE_VEHICLES_MAX) {
            continue;
        }
        run(scene, rooms[k], more);
        for (uint32_t cycle = 0; cycle < CYCLES; ++cycle) {
            if (more[cycle] != exact[cycle]) {
                fail_msg("%s: cycle %u differs with room for %u vehicles instead of %u",
                         scene->name, cycle, rooms[k], scene->count);
            }
        }
    }
}

static void plans_of_every_scenario_are_the_same_with_room_for_more_vehicles(void** state)
{
    (void)state;
    static start scene;
    for (size_t i = 0; i < sizeof scenarios / sizeof scenarios[0]; ++i) {
        const scenario* from = &scenarios[i];
        scene.name = from->name;
        scene.def = verge_planner_default_def();
        scene.def.road = (verge_road_def){ from->lanes, from->lane_count };
        from->set(&scene.def);
        scene.count = from->vehicle_count;
        for (uint32_t v = 0; v < from->vehicle_count; ++v) {
            scene.begin[v] = vehicle_from(&from->vehicles[v]);
        }
        check_rooms(&scene);
    }
}

/// On arm `side` of the junction, this far from its middle. Its lanes have two points.
static verge_vehicle before_junction(const town* on, uint32_t side, double distance)
{
    const double (*line)[2] = on->lanes[2 * side].points;
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.x = line[1][0] + (distance - 15.5) * town_x[side];
    vehicle.y = line[1][1] + (distance - 15.5) * town_y[side];
    vehicle.heading = atan2(-town_y[side], -town_x[side]);
    return vehicle;
}

/// So close together that everybody shares areas with everybody.
static void plans_at_a_busy_crossing_are_the_same_with_room_for_more_vehicles(void** state)
{
    (void)state;
    static start scene;
    static town t;
    test_rng rng = test_rng_seeded("busy crossing");
    town_junction(&t, 1);
    scene.name = "busy crossing";
    scene.def = verge_planner_default_def();
    scene.def.road = (verge_road_def){ t.lanes, t.count };
    for (uint32_t k = 0; k < test_rounds(42); ++k) {
        scene.count = 3u + k % 7u;
        for (uint32_t v = 0; v < scene.count; ++v) {
            const uint32_t side = v % 4u, exit = (side + 1u + test_rng_below(&rng, 3)) % 4u;
            scene.begin[v] = before_junction(&t, side, test_rng_between(&rng, 18.0, 20.0)
                                                           + 9.0 * (double)(v / 4u));
            scene.begin[v].id = (int32_t)v;
            scene.begin[v].controlled = test_rng_below(&rng, 2) == 0;
            scene.begin[v].speed = test_rng_between(&rng, 2.0, 6.0);
            scene.begin[v].target_lane = scene.begin[v].controlled ? (int32_t)(2u * exit + 1u)
                                                                   : VERGE_NO_LANE;
        }
        check_rooms(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plans_of_every_scenario_are_the_same_with_room_for_more_vehicles),
        cmocka_unit_test(plans_at_a_busy_crossing_are_the_same_with_room_for_more_vehicles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
