/// Goal: a fallback is a plan that a vehicle can drive and a message can carry, whatever the road.
/// Method: cars of random speeds, up to twice what the bends allow, on winding roads; speed and
/// acceleration of every point, and the check of the message.
#include "check.h"

#include "rng.h"
#include "verge/planner.h"
#include "verge/wire.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { POINTS = 240 };
static const int64_t NOW = 1700000000000000; // [us]

static double points[POINTS][2]; // of the road's lane, a metre apart

typedef struct site {
    void*             memory;
    verge_planner_def def;
    verge_planner*    planner;
} site;

/// A lane of bends: radii of 6 to 60 m, each 5 to 30 m long, to either side.
static site site_make(test_rng* rng)
{
    double x = 0.0, y = 0.0, heading = 0.0, curvature = 0.0;
    int left = 0;
    for (int i = 0; i < POINTS; ++i) {
        if (left-- == 0) {
            left = 5 + (int)test_rng_below(rng, 26);
            const double side = test_rng_below(rng, 2) == 0 ? 1.0 : -1.0;
            curvature = side / test_rng_between(rng, 6.0, 60.0);
            curvature = fabs(heading) > 1.5 ? copysign(curvature, -heading) : curvature;
        }
        points[i][0] = x;
        points[i][1] = y;
        heading += curvature;
        x += cos(heading);
        y += sin(heading);
    }
    const verge_lane_def lane = { .id = 0, .points = (const double(*)[2])points,
                                  .point_count = POINTS, .width = 4.0, .speed_limit = 8.0,
                                  .left = VERGE_NO_LANE, .right = VERGE_NO_LANE };
    site self = { .def = verge_planner_default_def() };
    self.def.road = (verge_road_def){ &lane, 1 };
    self.def.iterations = 10;
    self.def.nodes_max = 64;
    self.def.controlled_max = 1;
    self.def.vehicles_max = 2;
    const size_t size = (verge_planner_memory_size(&self.def) + 63) / 64 * 64;
    self.memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self.planner, &self.def, self.memory, size), VERGE_OK);
    return self;
}

static verge_vehicle random_car(test_rng* rng, const verge_road* road)
{
    verge_vehicle car = verge_vehicle_default();
    const double s = test_rng_between(rng, 5.0, verge_road_length(road, 0) - 60.0);
    verge_road_at(road, 0, s, test_rng_between(rng, -0.8, 0.8), &car.x, &car.y, &car.heading);
    const verge_lane_position at = verge_road_project_on(road, 0, car.x, car.y);
    car.id = 1;
    car.controlled = true;
    car.heading += test_rng_between(rng, -0.02, 0.02);
    car.speed = test_rng_between(rng, 0.0, 18.0);
    // It follows its bend as far as its tyres allow.
    const double most = 10.0 / fmax(car.speed * car.speed, 1.0);
    const double curvature = fmax(-most, fmin(most, at.curvature / (1.0 - at.curvature * at.d)));
    car.yaw_rate = test_rng_below(rng, 3) == 0 ? NAN : curvature * car.speed;
    return car;
}

static void check_fallback(const verge_vehicle* car, const verge_vehicle_plan* plan)
{
    const verge_body body = verge_vehicle_body(car);
    for (uint32_t k = 0; k < plan->point_count; ++k) {
        const verge_point* p = &plan->points[k];
        CHECK_AT_MOST(p->speed, car->speed + 1e-9);
        CHECK_BETWEEN(p->acceleration, -body.braking_max, 1e-9);
        const double lateral = p->speed * p->speed * p->curvature;
        CHECK_AT_MOST(hypot(p->acceleration, lateral), 1.05 * body.lateral_max);
    }
}

static void a_fallback_never_speeds_up_and_its_message_is_in_range(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("winding");
    static verge_plan plan;
    uint32_t fallbacks = 0, brakes = 0;
    for (uint32_t round = 0; round < test_rounds(80); ++round) {
        site at = site_make(&rng);
        for (uint32_t i = 0; i < 50; ++i) {
            const verge_vehicle car = random_car(&rng, verge_planner_road(at.planner));
            verge_planner_reset(at.planner);
            assert_int_equal(verge_planner_step(at.planner, NOW, &car, 1, &plan), VERGE_OK);
            const verge_vehicle_plan* own = &plan.vehicles[0];
            const wire_plan_header header = { .utime = NOW, .valid_until_utime = NOW + 3000000,
                                              .state_utime = NOW, .plans_in_cycle = 1 };
            const verge_vehicle_plan_t message = wire_plan_from_vehicle_plan(&header, own);
            const char* fault = wire_plan_check(&message);
            if (fault != NULL) {
                fail_msg("the message's %s is out of range", fault);
            }
            if (own->status != VERGE_PLANNED) {
                check_fallback(&car, own);
                ++fallbacks;
                brakes += own->status == VERGE_FALLBACK_BRAKE;
            }
        }
        free(at.memory);
    }
    printf("             %u fallbacks, %u of them brake\n", fallbacks, brakes);
    assert_true(!test_rounds_suffice() || (fallbacks > 100 && brakes > 50));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fallback_never_speeds_up_and_its_message_is_in_range),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
