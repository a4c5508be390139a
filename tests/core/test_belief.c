/// Goal: what an uncontrolled vehicle is about to do is believed by what it did lately: within a
///       second of a change of mind the right hypothesis is the most likely one.
/// Method: a planner on a major road that a minor one crosses, and on a road of two lanes; the human
///         drives by a given acceleration and lateral speed. The plan states the weights.
#include "check.h"
#include "rng.h"

#include "verge/planner.h"

#include <math.h>
#include <stdlib.h>

enum { PLANNED = 1, HUMAN = 2 };

static const double MAJOR[][2] = { { -200, 0 }, { 200, 0 } };
static const double MINOR[][2] = { { 0, -200 }, { 0, 200 } };
static const verge_lane_def CROSSING[] = {
    { .id = 0, .points = MAJOR, .point_count = 2, .width = 3.5, .speed_limit = 14, .left = -1,
      .right = -1, .priority = VERGE_PRIORITY_MAJOR },
    { .id = 1, .points = MINOR, .point_count = 2, .width = 3.5, .speed_limit = 14, .left = -1,
      .right = -1, .priority = VERGE_PRIORITY_MINOR },
};
static const double RIGHT[][2] = { { 0, 0 }, { 900, 0 } };
static const double LEFT[][2] = { { 0, 3.5 }, { 900, 3.5 } };
static const verge_lane_def STREET[] = {
    { .id = 0, .points = RIGHT, .point_count = 2, .width = 3.5, .speed_limit = 20, .left = 1,
      .right = -1 },
    { .id = 1, .points = LEFT, .point_count = 2, .width = 3.5, .speed_limit = 20, .left = -1,
      .right = 0 },
};

typedef struct rig {
    verge_planner* planner;
    void*          memory;
    verge_plan     plan;
    verge_vehicle  vehicles[2];
    int64_t        utime;
} rig;

static rig* rig_open(const verge_lane_def* lanes, uint32_t lane_count)
{
    rig* self = calloc(1, sizeof *self);
    assert_non_null(self);
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, lane_count };
    def.iterations = 20;
    def.nodes_max = 64;
    def.vehicles_max = 4;
    def.controlled_max = 1;
    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    self->memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self->planner, &def, self->memory, size), VERGE_OK);
    self->vehicles[0] = self->vehicles[1] = verge_vehicle_default();
    self->vehicles[0].id = PLANNED;
    self->vehicles[0].controlled = true;
    self->vehicles[1].id = HUMAN;
    self->utime = 1000000;
    return self;
}

static void rig_close(rig* self)
{
    free(self->memory);
    free(self);
}

/// The human drives for a time [s] with an acceleration and a lateral speed; then a plan is made.
static const float* after(rig* self, double seconds, double acceleration, double lateral)
{
    verge_vehicle* human = &self->vehicles[1];
    const double v = fmax(human->speed + acceleration * seconds, 0.0);
    const double way = 0.5 * (v + human->speed) * seconds;
    const bool north = self->vehicles[1].y < -10.0 && fabs(human->x) < 1e-9;
    const double course = north ? 1.5707963267948966 : 0.0;
    human->x += way * cos(course);
    human->y += way * sin(course) + lateral * seconds;
    human->heading = course + atan2(lateral, fmax(v, 1.0));
    human->speed = v;
    human->acceleration = acceleration;
    self->utime += llround(seconds * 1e6);
    assert_int_equal(verge_planner_step(self->planner, self->utime, self->vehicles, 2, &self->plan),
                     VERGE_OK);
    assert_int_equal(self->plan.prediction_count, 1);
    double sum = 0.0;
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        assert_true(self->plan.predictions[0].hypotheses[k] >= 0.0f);
        sum += (double)self->plan.predictions[0].hypotheses[k];
    }
    CHECK_NEAR(sum, 1.0, 1e-6);
    return self->plan.predictions[0].hypotheses;
}

static verge_hypothesis most_likely(const float* weights)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        best = weights[k] > weights[best] ? k : best;
    }
    return (verge_hypothesis)best;
}

/// On the minor road, 45 m before the crossing, with 12 m/s: it has to brake by 1.7 m/s^2.
static rig* at_the_crossing(void)
{
    rig* self = rig_open(CROSSING, 2);
    self->vehicles[0].x = -60.0;
    self->vehicles[0].speed = 12.0;
    self->vehicles[1].y = -50.0;
    self->vehicles[1].heading = 1.5707963267948966;
    self->vehicles[1].speed = 12.0;
    return self;
}

static void one_that_has_to_yield_is_believed_to_until_it_does_not_brake(void** state)
{
    (void)state;
    rig* self = at_the_crossing();
    assert_int_equal(most_likely(after(self, 0.0, 0.0, 0.0)), VERGE_YIELDS);
    (void)after(self, 0.5, 0.0, 0.0);
    (void)after(self, 0.5, 0.0, 0.0);
    const float* weights = after(self, 0.5, 0.0, 0.0);
    assert_int_equal(most_likely(weights), VERGE_INSISTS);
    rig_close(self);
}

static void one_that_brakes_for_its_line_is_believed_to_yield(void** state)
{
    (void)state;
    rig* self = at_the_crossing();
    (void)after(self, 0.0, 0.0, 0.0);
    for (int i = 0; i < 4; ++i) {
        const float* weights = after(self, 0.5, -2.2, 0.0);
        assert_int_equal(most_likely(weights), VERGE_YIELDS);
        assert_true(weights[VERGE_INSISTS] < 0.1f);
    }
    rig_close(self);
}

static rig* on_the_street(double planned_x)
{
    rig* self = rig_open(STREET, 2);
    self->vehicles[0].x = planned_x;
    self->vehicles[0].speed = 12.0;
    self->vehicles[1].x = 100.0;
    self->vehicles[1].speed = 12.0;
    return self;
}

static void what_a_vehicle_did_in_the_last_second_counts(void** state)
{
    (void)state;
    const struct { double acceleration, lateral; verge_hypothesis is; } done[] = {
        { 0.0, 0.0, VERGE_KEEPS_ON },
        { 1.2, 0.0, VERGE_SPEEDS_UP },
        { 0.0, 0.8, VERGE_CHANGES_LANE },
        { 0.0, 0.0, VERGE_KEEPS_ON },
    };
    rig* self = on_the_street(20.0);
    (void)after(self, 0.0, 0.0, 0.0);
    for (size_t k = 0; k < sizeof done / sizeof done[0]; ++k) {
        self->vehicles[1].y = 0.0;
        (void)after(self, 0.5, done[k].acceleration, done[k].lateral);
        (void)after(self, 0.5, done[k].acceleration, done[k].lateral);
        const float* weights = after(self, 0.5, done[k].acceleration, done[k].lateral);
        if (most_likely(weights) != done[k].is) {
            fail_msg("%s, expected %s", verge_hypothesis_name(most_likely(weights)),
                     verge_hypothesis_name(done[k].is));
        }
    }
    rig_close(self);
}

/// Ten plans a second weigh like two a second.
static void the_rate_of_planning_does_not_matter(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("rate");
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        rig *slow = on_the_street(20.0), *fast = on_the_street(20.0);
        (void)after(slow, 0.0, 0.0, 0.0);
        (void)after(fast, 0.0, 0.0, 0.0);
        for (int i = 0; i < 4; ++i) {
            const double a = test_rng_between(&rng, -1.5, 1.5);
            const float* seldom = after(slow, 0.5, a, 0.0);
            const float* often = NULL;
            for (int k = 0; k < 5; ++k) {
                often = after(fast, 0.1, a, 0.0);
            }
            for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
                CHECK_NEAR((double)often[k], (double)seldom[k], 0.02);
            }
        }
        rig_close(slow);
        rig_close(fast);
    }
}

static void a_vehicle_that_was_away_for_two_seconds_is_a_new_one(void** state)
{
    (void)state;
    rig* self = at_the_crossing();
    (void)after(self, 0.0, 0.0, 0.0);
    (void)after(self, 0.5, 0.0, 0.0);
    (void)after(self, 0.5, 0.0, 0.0);
    self->vehicles[1].y = -95.0;
    const float* weights = after(self, 2.5, 0.0, 0.0);
    assert_int_equal(most_likely(weights), VERGE_YIELDS);
    assert_true(weights[VERGE_INSISTS] < 0.06f);
    rig_close(self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_that_has_to_yield_is_believed_to_until_it_does_not_brake),
        cmocka_unit_test(one_that_brakes_for_its_line_is_believed_to_yield),
        cmocka_unit_test(what_a_vehicle_did_in_the_last_second_counts),
        cmocka_unit_test(the_rate_of_planning_does_not_matter),
        cmocka_unit_test(a_vehicle_that_was_away_for_two_seconds_is_a_new_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
