/// Goal: vehicles with on-vehicle units drive a scenario to its end without a contact, whatever the
///       bus does to the plans; a human who does what was not predicted is met by the units between
///       two cycles of the roadside unit.
/// Method: shipped scenarios in the closed loop of verge-sim --units, on a virtual clock; a human
///         with a recorded track that swerves or brakes; the same run with and without units.
#include "check.h"
#include "rng.h"

#include "fleet/fleet.h"

#include "common/metrics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// The result of one run.
typedef struct outcome {
    bool     reached;      ///< every intention, without a contact
    uint32_t collisions;
    double   min_distance; ///< [m]
    uint32_t changes;
    double   departed;     ///< [s] first departure because of a contact; NaN: none
    uint64_t by_mode[WIRE_UNIT_MODES];
    uint64_t trajectories;
    uint64_t repeated, same; ///< plans of the roadside unit planned again; equal bit for bit
} outcome;

static const fleet_options none = { .delay_s = 0.0 };

static void load(scenario* scene, const char* name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/apps/scenarios/%s.json", VERGE_SOURCE_DIR, name);
    if (!scenario_load(scene, path, NULL)) {
        fail_msg("%s", scene->file.error);
    }
}

static outcome drive(const scenario* scene, const fleet_options* faults)
{
    static world   world;
    static metrics metrics;
    char error[256] = "";
    assert_true(world_init(&world, scene) && metrics_init(&metrics, &world));
    fleet* fleet = fleet_open(&world, faults, error, sizeof error);
    assert_non_null(fleet);
    const uint32_t end = (uint32_t)lround(scene->duration * WORLD_TICKS_PER_SECOND);
    for (;;) {
        if (world.tick < end) {
            fleet_tick(fleet);
        }
        metrics_tick(&metrics, &world);
        if (world.tick >= end) {
            break;
        }
        world_advance(&world);
    }
    outcome out = { .reached = metrics_reached(&metrics), .collisions = metrics.collisions,
                    .min_distance = metrics.min_distance, .departed = NAN };
    const fleet_change* changes = fleet_changes(fleet, &out.changes);
    for (uint32_t i = out.changes; i-- > 0;) {
        if (changes[i].mode == WIRE_DEPARTING && changes[i].reason == WIRE_UNIT_CONTACT) {
            out.departed = changes[i].t;
        }
    }
    for (uint32_t i = 0; i < world.vehicle_count; ++i) {
        const unit_counters counters = fleet_count(fleet, world.vehicles[i].state.id);
        out.repeated += counters.repeated;
        out.same += counters.repeated_same;
        for (int k = 0; k < WIRE_UNIT_MODES; ++k) {
            out.by_mode[k] += counters.by_mode[k];
            out.trajectories += counters.by_mode[k];
        }
    }
    fleet_close(fleet);
    metrics_free(&metrics);
    world_free(&world);
    return out;
}

static outcome drive_shipped(const char* name, const fleet_options* faults)
{
    static scenario scene;
    load(&scene, name);
    scene.duration = fmin(scene.duration, test_rounds_suffice() ? 1e9 : 9.0);
    const outcome out = drive(&scene, faults);
    scenario_free(&scene);
    return out;
}

static const char* const SCENES[] = { "ramp-case1", "roundabout", "crossing", "freeway-4av-2hv" };

/// Of a slow build, the first scene alone, without its calm end.
static uint32_t scene_count(void)
{
    return test_rounds(4) < 4 ? 1 : 4;
}

static void on_a_good_bus_plans_are_followed(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < scene_count(); ++i) {
        const outcome out = drive_shipped(SCENES[i], &none);
        assert_true(out.reached);
        assert_true(out.by_mode[WIRE_FOLLOWING] * 100 >= out.trajectories * 95);
    }
}

static void on_a_good_bus_units_repeat_each_plan_bit_for_bit(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < scene_count(); ++i) {
        const fleet_options repeats = { .repeats = true };
        const outcome out = drive_shipped(SCENES[i], &repeats);
        printf("             %s: %d of %d\n", SCENES[i], (int)out.same, (int)out.repeated);
        assert_true(out.repeated > 10);
        assert_int_equal(out.same, out.repeated);
    }
}

static void late_and_lost_plans_cause_no_contact(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < scene_count(); ++i) {
        for (uint64_t seed = 1; seed <= (test_rounds_suffice() ? 3 : 1); ++seed) {
            const fleet_options faults = { .delay_s = 0.3, .loss = 0.2, .seed = seed };
            const outcome out = drive_shipped(SCENES[i], &faults);
            if (!out.reached) {
                fail_msg("%s, losses of seed %d: %u contacts", SCENES[i], (int)seed,
                         out.collisions);
            }
        }
    }
}

/// Two planned vehicles that are beside their late plans do not stop in one another's way: the one
/// that passes second by the plan is expected to brake.
static void late_and_lost_plans_bring_no_contact_at_a_crossing(void** state)
{
    (void)state;
    for (uint64_t seed = 80; test_rounds_suffice() && seed < 80u + test_rounds(4); ++seed) {
        const fleet_options faults = { .delay_s = 0.3, .loss = 0.2, .seed = seed };
        const outcome out = drive_shipped("crossing", &faults);
        if (out.collisions > 0) {
            fail_msg("losses of seed %d", (int)seed);
        }
    }
}

/// Absent from 2 to 7 s, then started again without a memory.
static void without_a_roadside_unit_for_a_while_the_vehicles_drive_on(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < scene_count(); ++i) {
        const fleet_options faults = { .off_from = 2.0, .off_to = 7.0 };
        const outcome out = drive_shipped(SCENES[i], &faults);
        assert_true(out.reached);
        assert_true(out.by_mode[WIRE_ALONE] > 0);
    }
}

static void without_a_roadside_unit_at_all_there_is_no_contact(void** state)
{
    (void)state;
    for (uint32_t i = 0; i < scene_count(); ++i) {
        const fleet_options faults = { .off_to = 1e9 };
        const outcome out = drive_shipped(SCENES[i], &faults);
        assert_int_equal(out.collisions, 0);
        assert_int_equal(out.by_mode[WIRE_FOLLOWING], 0);
    }
}

static void the_same_faults_give_the_same_run(void** state)
{
    (void)state;
    const fleet_options faults = { .delay_s = 0.2, .loss = 0.3, .seed = 5 };
    const outcome a = drive_shipped("ramp-case1", &faults);
    const outcome b = drive_shipped("ramp-case1", &faults);
    assert_memory_equal(&a.min_distance, &b.min_distance, sizeof a.min_distance);
    assert_int_equal(a.changes, b.changes);
}

// ---- a human who does what was not predicted -----------------------------------------------

enum { SWERVE_TICK = 22 }; // between the cycles at 2.0 and 2.5 s

/// A controlled vehicle on the right lane of two, at 15 m/s, and a human on the left one ahead of
/// it who drives straight, and at 2.2 s swerves into the right lane within 1.5 s (or brakes, if it is
/// ahead in the same lane).
static void write_deviation(char* text, size_t size, bool swerves, double gap)
{
    const double speed = swerves ? 11.0 : 15.0;
    int at = snprintf(text, size,
        "{ \"format\": \"verge-scenario/1\", \"name\": \"deviation\", \"road\": { \"lanes\": ["
        "{ \"id\": 0, \"centerline\": [[0, 0], [600, 0]], \"width\": 3.75, \"speed_limit\": 15, "
        "\"left\": 1, \"right\": null, \"successors\": [] },"
        "{ \"id\": 1, \"centerline\": [[0, 3.75], [600, 3.75]], \"width\": 3.75, "
        "\"speed_limit\": 15, \"left\": null, \"right\": 0, \"successors\": [] } ] },"
        "\"vehicles\": [ { \"id\": 1, \"control\": \"controlled\", \"x\": 30, \"y\": 0, "
        "\"heading\": 0, \"speed\": 15, \"acceleration\": 0, \"length\": 5, \"width\": 2, "
        "\"target_lane\": 0 }, { \"id\": 2, \"control\": \"human\", \"x\": %g, \"y\": %g, "
        "\"heading\": 0, \"speed\": %g, \"acceleration\": 0, \"length\": 5, \"width\": 2, "
        "\"track\": [", 30.0 + gap + 2.2 * (15.0 - speed), swerves ? 3.75 : 0.0, speed);
    double x = 30.0 + gap + 2.2 * (15.0 - speed), v = speed;
    for (int i = 0; i <= 100; ++i) {
        const double t = 0.1 * i, into = fmin(fmax(t - 0.1 * SWERVE_TICK, 0.0) / 1.5, 1.0);
        const double y = swerves ? 3.75 * (1.0 - into * into * (3.0 - 2.0 * into)) : 0.0;
        const double slope = swerves ? -3.75 * 6.0 * into * (1.0 - into) / 1.5 : 0.0;
        at += snprintf(text + at, size - (size_t)at, "%s[%g, %g, %g, %g, %g]", i > 0 ? ", " : "",
                       t, x, y, atan2(slope, fmax(v, 0.1)), v);
        v = !swerves && i >= SWERVE_TICK ? fmax(v - 0.7, 0.0) : v;
        x += 0.1 * v;
    }
    snprintf(text + at, size - (size_t)at,
             "] } ], \"planner\": { \"seed\": 1 }, \"simulation\": { \"duration\": 9.5 } }");
}

/// Without on-vehicle units: the vehicles drive the plans of the roadside unit.
static double distance_without_units(const scenario* scene, uint32_t* collisions)
{
    static world      world;
    static metrics    metrics;
    static verge_plan plan;
    assert_true(world_init(&world, scene) && metrics_init(&metrics, &world));
    const uint32_t end = (uint32_t)lround(scene->duration * WORLD_TICKS_PER_SECOND);
    for (;;) {
        if (world.tick % 5 == 0 && world.tick < end) {
            assert_int_equal(world_plan(&world, &plan), VERGE_OK);
            for (uint32_t i = 0; i < plan.vehicle_count; ++i) {
                world_follow(&world, &plan.vehicles[i], world_time(&world));
            }
        }
        metrics_tick(&metrics, &world);
        if (world.tick >= end) {
            break;
        }
        world_advance(&world);
    }
    const double distance = metrics.min_distance;
    *collisions = metrics.collisions;
    metrics_free(&metrics);
    world_free(&world);
    return distance;
}

static void check_deviation(bool swerves, double gap, double* with, double* without)
{
    static char text[1 << 14];
    static scenario scene;
    write_deviation(text, sizeof text, swerves, gap);
    if (!scenario_parse(&scene, "deviation", text, strlen(text), NULL)) {
        fail_msg("%s", scene.file.error);
    }
    const outcome out = drive(&scene, &none);
    verge_planner_reset(scene.planner);
    uint32_t collisions = 0;
    *without = distance_without_units(&scene, &collisions);
    *with = out.min_distance;
    assert_int_equal(out.collisions, 0);
    // The first state that shows it is that of the next tick.
    CHECK_BETWEEN(out.departed, 0.1 * SWERVE_TICK, 0.1 * SWERVE_TICK + 0.41);
    scenario_free(&scene);
}

static void a_human_who_swerves_is_answered_before_the_next_plan(void** state)
{
    (void)state;
    double with = 0.0, without = 0.0;
    check_deviation(true, 14.0, &with, &without);
    printf("             distance %.2f m with units, %.2f m without\n", with, without);
    assert_true(with >= fmin(without, 1.5)); // both stop at a good distance, or it is larger
}

static void a_human_who_brakes_hard_is_answered_before_the_next_plan(void** state)
{
    (void)state;
    double with = 0.0, without = 0.0;
    check_deviation(false, 24.0, &with, &without);
    printf("             distance %.2f m with units, %.2f m without\n", with, without);
    assert_true(with >= fmin(without, 1.5)); // both stop at a good distance, or it is larger
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_a_good_bus_plans_are_followed),
        cmocka_unit_test(on_a_good_bus_units_repeat_each_plan_bit_for_bit),
        cmocka_unit_test(late_and_lost_plans_cause_no_contact),
        cmocka_unit_test(late_and_lost_plans_bring_no_contact_at_a_crossing),
        cmocka_unit_test(without_a_roadside_unit_for_a_while_the_vehicles_drive_on),
        cmocka_unit_test(without_a_roadside_unit_at_all_there_is_no_contact),
        cmocka_unit_test(the_same_faults_give_the_same_run),
        cmocka_unit_test(a_human_who_swerves_is_answered_before_the_next_plan),
        cmocka_unit_test(a_human_who_brakes_hard_is_answered_before_the_next_plan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
