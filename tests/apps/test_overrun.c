/// Goal: the fallback of a late cycle brakes on any road. Its speed never grows, and the distances
/// between its points agree with its speeds, also beside the centreline of a bend.
/// Method: circles of many radii to both sides, states at many offsets, headings and speeds.
#include "check.h"

#include "rsu/overrun.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { POINTS = 64 };

static const double PI = 3.14159265358979323846;

typedef struct site {
    void*          memory;
    verge_planner* planner;
} site;

/// One lane: three quarters of a circle around the origin. direction 1: to the left, -1: to the
/// right.
static site site_make(double radius, double direction)
{
    static double points[POINTS][2];
    for (int i = 0; i < POINTS; ++i) {
        const double angle = direction * 1.5 * PI * i / (POINTS - 1);
        points[i][0] = radius * cos(angle);
        points[i][1] = radius * sin(angle);
    }
    const verge_lane_def lane = { .id = 0, .points = (const double(*)[2])points,
                                  .point_count = POINTS, .width = 4.0, .speed_limit = 20.0,
                                  .left = VERGE_NO_LANE, .right = VERGE_NO_LANE };
    verge_planner_def def = verge_planner_default_def();
    def.road.lanes = &lane;
    def.road.lane_count = 1;
    def.iterations = 10;
    def.nodes_max = 64;
    def.controlled_max = 1;
    def.vehicles_max = 2;
    site self = { NULL, NULL };
    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    assert_true(size > 0);
    self.memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self.planner, &def, self.memory, size), VERGE_OK);
    return self;
}

static verge_vehicle vehicle_at(double radius, double direction, double offset, double skew,
                                double speed)
{
    const double angle = direction * 0.25;
    verge_vehicle now = verge_vehicle_default();
    now.id = 5;
    now.x = (radius - direction * offset) * cos(angle); // to the left is inwards on a left bend
    now.y = (radius - direction * offset) * sin(angle);
    now.heading = remainder(angle + direction * PI / 2.0 + skew, 2.0 * PI);
    now.speed = speed;
    return now;
}

static void check_plan(const verge_vehicle_plan_t* plan, const char* words)
{
    const char* fault = wire_plan_check(plan);
    if (fault != NULL) {
        fail_msg("%s: %s", words, fault);
    }
    for (int32_t k = 1; k < plan->point_count; ++k) {
        const verge_plan_point_t *a = &plan->points[k - 1], *b = &plan->points[k];
        const double expected = 0.05 * ((double)a->speed + (double)b->speed);
        const double distance = hypot(b->x - a->x, b->y - a->y);
        if (b->speed > a->speed || fabs(distance - expected) > 0.01 + 0.02 * expected) {
            fail_msg("%s, point %d: %.3f m at %.3f and %.3f m/s, expected %.3f m", words, k,
                     distance, (double)a->speed, (double)b->speed, expected);
        }
    }
}

static void test_beside_the_centreline_of_a_bend_points_are_as_far_apart_as_speeds_say(void** state)
{
    (void)state;
    static const double RADII[] = { 8.0, 12.0, 20.0, 50.0, 200.0 };
    for (size_t r = 0; r < sizeof RADII / sizeof RADII[0]; ++r) {
        for (double direction = -1.0; direction <= 1.0; direction += 2.0) {
            site self = site_make(RADII[r], direction);
            const verge_road* road = verge_planner_road(self.planner);
            for (double offset = -1.5; offset <= 1.5; offset += 0.5) {
                for (double skew = -0.1; skew <= 0.1; skew += 0.1) {
                    for (double speed = 0.0; speed <= 20.0; speed += 2.5) {
                        const verge_vehicle now =
                            vehicle_at(RADII[r], direction, offset, skew, speed);
                        const wire_plan_header header = { .utime = 1000000 };
                        const verge_vehicle_plan_t plan = overrun_brake(&header, &now, road);
                        char words[128];
                        snprintf(words, sizeof words, "radius %.0f m to the %s, %.1f m beside, "
                                 "%.1f rad across, %.1f m/s", RADII[r],
                                 direction > 0.0 ? "left" : "right", offset, skew, speed);
                        check_plan(&plan, words);
                    }
                }
            }
            free(self.memory);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(
            test_beside_the_centreline_of_a_bend_points_are_as_far_apart_as_speeds_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
