// A vehicle at traffic signals that change at known times, and at a stop sign: the planner drives
// it along its trajectories, cycle by cycle.
#include "check.h"
#include "rng.h"

#include <verge/verge.h>

#include <math.h>
#include <stdalign.h>

#define CYCLE 0.5  // [s]
#define LINE 120.0 // [m] stop line, on a lane that goes on behind it
#define LIMIT 13.9 // [m/s]
#define NOSE 0.5   // [m] over the line is still a stop
enum { LINK = 1, ROAD = 2 };

alignas(64) static unsigned char memory[8 << 20];
static verge_plan plan;

typedef struct drive {
    verge_planner* planner;
    verge_vehicle  vehicle;
    double         t, front; // [s], [m] along the road
} drive;

static drive begin(verge_priority priority, double gap, double speed)
{
    static const double before[][2] = { { 0, 0 }, { LINE, 0 } };
    static const double after[][2] = { { LINE, 0 }, { 400, 0 } };
    verge_lane_def lanes[2] = { verge_lane_def_default(), verge_lane_def_default() };
    lanes[0].id = LINK;
    lanes[0].points = before;
    lanes[0].point_count = lanes[1].point_count = 2;
    lanes[0].successors[lanes[0].successor_count++] = ROAD;
    lanes[0].priority = priority;
    lanes[1].id = ROAD;
    lanes[1].points = after;
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ lanes, 2 };
    def.iterations = 200;
    drive d = { .vehicle = verge_vehicle_default() };
    assert_int_equal(verge_planner_init(&d.planner, &def, memory, sizeof memory), VERGE_OK);
    d.vehicle.controlled = true;
    d.vehicle.speed = speed;
    d.front = LINE - gap;
    d.vehicle.x = d.front - 0.5 * d.vehicle.length;
    return d;
}

static void plan_now(drive* d, const verge_signal* signal)
{
    const int64_t utime = (int64_t)(d->t * 1e6 + 0.5);
    assert_int_equal(verge_planner_set_signals(d->planner, utime, signal, signal != NULL ? 1 : 0),
                     VERGE_OK);
    assert_int_equal(verge_planner_step(d->planner, utime, &d->vehicle, 1, &plan), VERGE_OK);
}

// Point k of the plan, k tenths of a second after it.
static double front_at(const drive* d, uint32_t k)
{
    return plan.vehicles[0].points[k].x + 0.5 * d->vehicle.length;
}

static void drive_on(drive* d)
{
    const verge_point* at = &plan.vehicles[0].points[5];
    d->front = front_at(d, 5);
    d->vehicle.x = at->x;
    d->vehicle.y = at->y;
    d->vehicle.heading = at->heading;
    d->vehicle.speed = at->speed;
    d->vehicle.acceleration = at->acceleration;
    d->t += CYCLE;
}

// ---------------------------------------------------------------------------- signals

typedef struct program {
    double start, green, yellow, red; // [s]
} program;

static verge_signal shown(const program* p, double t)
{
    double at = fmod(t - p->start, p->green + p->yellow + p->red);
    at += at < 0.0 ? p->green + p->yellow + p->red : 0.0;
    verge_signal signal = { LINK, VERGE_SIGNAL_GREEN, p->green - at };
    if (at >= p->green) {
        signal = (verge_signal){ LINK, VERGE_SIGNAL_YELLOW, p->green + p->yellow - at };
    }
    if (at >= p->green + p->yellow) {
        signal = (verge_signal){ LINK, VERGE_SIGNAL_RED, p->green + p->yellow + p->red - at };
    }
    return signal;
}

static void no_vehicle_that_can_stop_crosses_the_line_at_red_and_all_get_across(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("red");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        const double speed = test_rng_between(&rng, 0.0, LIMIT);
        const double gap = test_rng_between(&rng, speed * speed / 5.0 + 2.0, 100.0);
        const program p = { test_rng_between(&rng, 0.0, 30.0), test_rng_between(&rng, 6.0, 20.0),
                            test_rng_below(&rng, 2) == 0 ? 0.0 : 3.0,
                            test_rng_between(&rng, 3.0, 20.0) };
        drive d = begin(VERGE_PRIORITY_NONE, gap, speed);
        const double last = 2.0 * (p.green + p.yellow + p.red) + 15.0;
        while (d.front < LINE && d.t < last) {
            const verge_signal signal = shown(&p, d.t);
            plan_now(&d, &signal);
            for (uint32_t k = 0; k < 5; ++k) {
                const bool red = shown(&p, d.t + 0.1 * k).state == VERGE_SIGNAL_RED
                                 && shown(&p, d.t + 0.1 * (k + 1)).state == VERGE_SIGNAL_RED;
                assert_false(red && front_at(&d, k) <= LINE + NOSE
                             && front_at(&d, k + 1u) > LINE + NOSE);
            }
            drive_on(&d);
        }
        assert_true(d.front >= LINE);
    }
}

// The times are such that the vehicle, braking by 2 m/s^2, need not be slower than 2 m/s.
static void a_red_signal_that_opens_in_time_is_approached_without_a_stop(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("opens");
    const uint32_t rounds = test_rounds(100);
    uint32_t rolled = 0;
    for (uint32_t round = 0; round < rounds; ++round) {
        const double speed = test_rng_between(&rng, 7.0, LIMIT);
        const double gap = test_rng_between(&rng, speed * speed / 4.0 + 5.0, 70.0);
        const double slow = 0.5 * (speed - 2.0);
        const double rest = 0.5 * (gap - 1.0 - 0.5 * slow * (speed + 2.0));
        const double opens = test_rng_between(&rng, 1.0, fmin(slow + rest - 1.0, 10.0));
        drive d = begin(VERGE_PRIORITY_NONE, gap, speed);
        double slowest = speed;
        while (d.front < LINE && d.t < 60.0) {
            const double left = opens - d.t;
            const verge_signal signal = { LINK, left > 0.0 ? VERGE_SIGNAL_RED : VERGE_SIGNAL_GREEN,
                                          left > 0.0 ? left : -1.0 };
            plan_now(&d, &signal);
            drive_on(&d);
            slowest = fmin(slowest, d.vehicle.speed);
        }
        assert_true(d.t >= opens);
        rolled += slowest > 0.5 ? 1 : 0;
        CHECK_AT_MOST(d.t, opens + 5.0);
    }
    CHECK_AT_MOST(0.9 * rounds, rolled);
}

// Green is left for less than the way to the line takes.
static void a_green_signal_that_closes_before_the_vehicle_is_there_is_not_driven_up_to(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("closes");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        const double speed = test_rng_between(&rng, 8.0, LIMIT);
        const double gap = test_rng_between(&rng, speed * speed / 4.0 + 5.0, 80.0);
        const double closes = test_rng_between(&rng, 0.5, 0.8 * gap / LIMIT);
        drive d = begin(VERGE_PRIORITY_NONE, gap, speed);
        double hardest = 0.0;
        for (uint32_t cycle = 0; cycle < 30; ++cycle) {
            const double left = closes - d.t;
            const verge_signal signal = { LINK, left > 0.0 ? VERGE_SIGNAL_GREEN : VERGE_SIGNAL_RED,
                                          left > 0.0 ? left : -1.0 };
            plan_now(&d, &signal);
            drive_on(&d);
            hardest = fmin(hardest, d.vehicle.acceleration);
        }
        CHECK_AT_MOST(d.front, LINE);
        CHECK_AT_MOST(d.vehicle.speed, 0.2);
        CHECK_AT_MOST(-hardest, 3.5);
    }
}

// ---------------------------------------------------------------------------- stop signs

static void a_vehicle_stops_once_at_a_stop_sign_says_so_and_goes_on(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sign");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        const double speed = test_rng_between(&rng, 0.0, LIMIT);
        const double gap = test_rng_between(&rng, speed * speed / 5.0 + 5.0, 100.0);
        drive d = begin(VERGE_PRIORITY_STOP, gap, speed);
        uint32_t stops = speed < 0.3 ? 1 : 0;
        double stood = 0.0;
        bool told = false, stands = speed < 0.3;
        while (d.front < LINE + 5.0 && d.t < 60.0) {
            plan_now(&d, NULL);
            told = told || plan.vehicles[0].why.code == VERGE_WHY_STOP_LINE;
            drive_on(&d);
            const bool now = d.vehicle.speed < 0.3 && d.front > LINE - 4.5 && d.front < LINE + 0.2;
            stops += now && !stands ? 1 : 0;
            stood += now ? CYCLE : 0.0;
            stands = now;
        }
        assert_true(d.front >= LINE + 5.0);
        assert_true(told);
        assert_int_equal(stops - (speed < 0.3 ? 1u : 0u), 1);
        CHECK_BETWEEN(stood, CYCLE, 4.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_vehicle_that_can_stop_crosses_the_line_at_red_and_all_get_across),
        cmocka_unit_test(a_red_signal_that_opens_in_time_is_approached_without_a_stop),
        cmocka_unit_test(
            a_green_signal_that_closes_before_the_vehicle_is_there_is_not_driven_up_to),
        cmocka_unit_test(a_vehicle_stops_once_at_a_stop_sign_says_so_and_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
