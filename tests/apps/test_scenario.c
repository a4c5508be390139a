/// Goal: a valid scenario is read unchanged, and a wrong one is refused with one line that names
/// the place.
/// Method: one good document, changed in one place for each refusal; thousands of damaged
/// documents; the document written and read again.
#include "check.h"
#include "rng.h"

#include "common/number.h"
#include "common/scenario.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char GOOD[] =
    "{ \"format\": \"verge-scenario/1\", \"name\": \"test\", \"source\": \"none\",\n"
    "  \"road\": { \"lanes\": [\n"
    "    { \"id\": 0, \"centerline\": [[0.0, 0.0], [400.0, 0.0]], \"width\": 3.75,\n"
    "      \"speed_limit\": 33.0, \"left\": 1, \"right\": null, \"successors\": [] },\n"
    "    { \"id\": 1, \"centerline\": [[0.0, 3.75], [400.0, 3.75]], \"width\": 3.75,\n"
    "      \"speed_limit\": 33.0, \"left\": null, \"right\": 0, \"successors\": [] } ] },\n"
    "  \"vehicles\": [\n"
    "    { \"id\": 2, \"control\": \"controlled\", \"x\": 20.0, \"y\": 3.75, \"heading\": 0.0,\n"
    "      \"speed\": 15.0, \"acceleration\": 0.5, \"length\": 5.0, \"width\": 2.0,\n"
    "      \"target_lane\": 0, \"habit\": \"aggressive\" },\n"
    "    { \"id\": 3, \"control\": \"human\", \"x\": 60.0, \"y\": 0.0, \"heading\": 0.0,\n"
    "      \"speed\": 14.0, \"acceleration\": 0.0, \"length\": 5.0, \"width\": 2.0,\n"
    "      \"track\": [[0.0, 60.0, 0.0, 0.0, 14.0], [20.0, 340.0, 0.0, 0.0, 14.0]] } ],\n"
    "  \"planner\": { \"seed\": 7 }, \"simulation\": { \"duration\": 12.5 } }\n";

/// GOOD with the first `from` replaced.
static char* changed(const char* from, const char* to)
{
    const char* at = strstr(GOOD, from);
    assert_non_null(at);
    const size_t size = sizeof GOOD + strlen(to);
    char*        text = malloc(size);
    snprintf(text, size, "%.*s%s%s", (int)(at - GOOD), GOOD, to, at + strlen(from));
    return text;
}

static bool parse(scenario* scene, const char* text)
{
    return scenario_parse(scene, "a.json", text, strlen(text), NULL);
}

static void check_one_line(const char* error)
{
    const char* end = strchr(error, '\n');
    if (strncmp(error, "a.json:", 7) != 0 || end == NULL || end[1] != '\0' ||
        strchr(error + 7, ':') == NULL) {
        fail_msg("not one line of file:field: text: \"%s\"", error);
    }
}

static void refused(const char* from, const char* to, const char* expected)
{
    scenario scene;
    char*    text = changed(from, to);
    if (parse(&scene, text)) {
        fail_msg("accepted with %s instead of %s", to, from);
    }
    check_one_line(scene.file.error);
    if (strstr(scene.file.error, expected) == NULL) {
        fail_msg("for %s the line is \"%s\", expected \"%s\" in it", to, scene.file.error,
                 expected);
    }
    free(text);
}

static void test_a_scenario_is_read_as_it_stands(void** state)
{
    (void)state;
    scenario scene;
    const bool good = parse(&scene, GOOD);
    assert_string_equal(scene.file.error, "");
    assert_true(good);

    assert_string_equal(scene.name, "test");
    assert_int_equal(scene.def.seed, 7);
    assert_int_equal(scene.def.road.lane_count, 2);
    assert_int_equal(scene.def.road.lanes[0].left, 1);
    assert_int_equal(scene.def.road.lanes[0].right, VERGE_NO_LANE);
    assert_int_equal(scene.vehicle_count, 2);
    CHECK_SAME_BITS(scene.duration, 12.5);
    CHECK_SAME_BITS(scene.replan, 0.5);

    const verge_vehicle* first = &scene.vehicles[0].start;
    const verge_habit    aggressive = verge_habit_of(VERGE_AGGRESSIVE);
    assert_true(first->controlled);
    assert_int_equal(first->target_lane, 0);
    CHECK_SAME_BITS(first->acceleration, 0.5);
    assert_memory_equal(&first->habit, &aggressive, sizeof aggressive);
    assert_false(scene.vehicles[1].start.controlled);
    assert_int_equal(scene.vehicles[1].start.target_lane, VERGE_NO_LANE);
    assert_int_equal(scene.vehicles[1].track_count, 2);
    scenario_free(&scene);
}

static void test_json_that_is_broken_is_refused_with_its_line(void** state)
{
    (void)state;
    refused("\"left\": 1,", "\"left\": 1,,", "a.json:4: ");
    refused("20.0, \"y\"", "NaN, \"y\"", "a.json:8: ");
    refused("12.5 } }\n", "12.5 }", "ends too early");
    refused("12.5 } }\n", "12.5 } } x", "a.json:14: ");
    refused("20.0, \"y\"", "1e999, \"y\"", "vehicles[0].x: ");
    refused("\"speed\": 15.0", "\"speed\": 15.0, \"speed\": 1.0",
            "vehicles[0].speed: appears twice");
    refused("{ \"format\"", "[{ \"format\"", "a.json:");
    refused("\"none\"", "\"n\xffne\"", "a.json:1: not text");
}

static void test_numbers_are_spelled_as_json_spells_them(void** state)
{
    (void)state;
    static const char* const wrong[] = { "15.",   "015",   "+15",  ".15",  "0x1f", "-.5", "-",
                                         "1.e1",  "1e",    "1e+",  "00",   "-01",  "1.5.2",
                                         "1-2",   "1e1.5", "0e-",  "15f",  "1_5",  "Infinity" };
    for (uint32_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        refused("15.0", wrong[i], "a.json:9: ");
    }
    static const char* const right[] = { "15", "0", "-0", "0.5", "1e1", "1E+1", "1.5e-0", "0e7",
                                         "-0.0e-1" };
    for (uint32_t i = 0; i < sizeof right / sizeof right[0]; ++i) {
        scenario scene;
        char*    text = changed("15.0", right[i]);
        const bool good = parse(&scene, text);
        assert_string_equal(scene.file.error, "");
        assert_true(good);
        CHECK_SAME_BITS(scene.vehicles[0].start.speed, strtod(right[i], NULL) + 0.0); // -0 is 0
        scenario_free(&scene);
        free(text);
    }
    scenario scene; // what stands in a string is no number, whatever it escapes
    char* text = changed("\"none\"", "\"015 \\\" 15. \\\\\"");
    assert_true(parse(&scene, text));
    scenario_free(&scene);
    free(text);
}

static void test_null_means_no_lane_and_is_no_other_value(void** state)
{
    (void)state;
    scenario scene;
    char* text = changed("\"target_lane\": 0", "\"target_lane\": null");
    assert_true(parse(&scene, text));
    assert_int_equal(scene.vehicles[0].start.target_lane, VERGE_NO_LANE);
    scenario_free(&scene);
    free(text);
    refused("\"successors\": []", "\"successors\": null", "successors: is null, expected");
    refused("\"successors\": []", "\"change_left\": null", "change_left: is null, expected");
    refused("\"aggressive\"", "null", "vehicles[0].habit: ");
    refused("[[0.0, 60.0, 0.0, 0.0, 14.0], [20.0, 340.0, 0.0, 0.0, 14.0]]", "null",
            "vehicles[1].track: is null, expected");
    refused("{ \"seed\": 7 }", "null", "planner: ");
    refused("\"seed\": 7", "\"seed\": null", "planner.seed: is null, expected");
    refused("{ \"duration\": 12.5 }", "null", "simulation: is null, expected");
    refused("12.5", "null", "simulation.duration: is null, expected");
    refused("\"none\"", "null", "source: is null, expected");
}

static void test_an_object_has_a_bounded_number_of_keys(void** state)
{
    (void)state;
    enum { KEYS = 60000, ROOM = 16 };
    char*  text = malloc(KEYS * ROOM + 64);
    size_t used = (size_t)sprintf(text, "{ \"planner\": {");
    for (uint32_t i = 0; i < KEYS; ++i) {
        used += (size_t)sprintf(text + used, "%s\"k%u\": 1", i == 0 ? "" : ",", i);
        if (i + 1 == JSON_KEYS_MAX || i == JSON_KEYS_MAX || i + 1 == KEYS) {
            char end[4] = "} }";
            memcpy(text + used, end, sizeof end);
            json_file file;
            const bool good = json_file_parse(&file, "a.json", text, used + 3);
            assert_int_equal(good, i + 1 <= JSON_KEYS_MAX);
            if (good) {
                json_file_free(&file);
            } else {
                check_one_line(file.error);
                assert_non_null(strstr(file.error, "planner: has "));
            }
        }
    }
    free(text);
}

static void test_keys_are_exact(void** state)
{
    (void)state;
    refused("verge-scenario/1", "verge-scenario/2", "format: ");
    refused("\"name\": \"test\", ", "", "name: is missing");
    refused("\"source\"", "\"sauce\"", "sauce: unknown key");
    refused("\"width\": 3.75", "\"widht\": 3.75", "road.lanes[0].widht: unknown key");
    refused("\"seed\": 7", "\"sead\": 7", "planner.sead: unknown key");
    refused("\"duration\"", "\"length\"", "simulation.length: unknown key");
    refused("\"speed\": 14.0, ", "", "vehicles[1].speed: is missing");
    refused("\"target_lane\": 0", "\"target\": 0", "vehicles[0].target: unknown key");
    refused("\"lanes\"", "\"lines\"", "road.lines: unknown key");
}

static void test_a_body_is_a_kind_or_an_object_of_its_numbers(void** state)
{
    (void)state;
    static const struct { const char* to; double length, rear_axle, wheelbase, trailer; } good[] = {
        { "\"length\": 5.0, \"width\": 2.0, \"body\": \"car\"", 5.0, 1.4227, 2.5789, 0.0 },
        { "\"body\": \"bus\"", 12.0, 2.65, 5.8, 0.0 },
        { "\"length\": 6.0, \"width\": 2.5, \"body\": \"bus\"", 6.0, 1.325, 2.9, 0.0 },
        { "\"body\": \"articulated\"", 6.08, 2.19, 3.8, 13.6 },
        { "\"body\": { \"kind\": \"truck\", \"rear_axle\": 2.0 }", 10.1, 2.0, 5.3, 0.0 },
        { "\"length\": 5.0, \"width\": 2.0, \"body\": { \"rear_axle\": 1.2 }", 5.0, 1.2, 2.5789,
          0.0 },
        { "\"body\": { \"length\": 4.0, \"width\": 1.8 }", 4.0, 1.4227, 2.5789, 0.0 },
        { "\"length\": 5.0, \"width\": 2.0, \"body\": { \"hitch\": 3, \"trailer_length\": 4,"
          " \"trailer_width\": 2, \"trailer_axle\": 3 }", 5.0, 1.4227, 2.5789, 4.0 },
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
        scenario scene;
        char*    text = changed("\"length\": 5.0, \"width\": 2.0", good[i].to);
        if (!parse(&scene, text)) {
            fail_msg("%s: %s", good[i].to, scene.file.error);
        }
        const verge_vehicle* start = &scene.vehicles[0].start;
        CHECK_NEAR(start->length, good[i].length, 1e-12);
        CHECK_NEAR(start->body.length, good[i].length, 1e-12);
        CHECK_NEAR(start->body.rear_axle, good[i].rear_axle, 1e-12);
        CHECK_NEAR(start->body.wheelbase, good[i].wheelbase, 1e-12);
        CHECK_NEAR(start->body.trailer_length, good[i].trailer, 1e-12);
        scenario_free(&scene);
        free(text);
    }
}

static void test_a_body_that_cannot_be_is_refused_by_its_field(void** state)
{
    (void)state;
    static const char* const wrong[][2] = {
        { "\"body\": \"tank\"", "vehicles[0].body: is \"tank\", expected" },
        { "\"body\": 3", "vehicles[0].body: is not a body, expected" },
        { "\"body\": { \"kind\": \"tank\" }", "vehicles[0].body.kind: is \"tank\", expected" },
        { "\"body\": { \"axle\": 2 }", "vehicles[0].body.axle: unknown key" },
        { "\"body\": { \"rear_axle\": 2 }", "vehicles[0].length: is missing" },
        { "\"body\": { \"kind\": \"bus\", \"rear_axle\": 7 }",
          "body.rear_axle: does not make a body: its rear_axle of 7 m lies outside 0 to 6" },
        { "\"body\": { \"kind\": \"bus\", \"steer_max\": 2 }",
          "vehicles[0].body.steer_max: is 2, expected 0.05 to 1.4" },
        { "\"body\": { \"kind\": \"bus\", \"trailer_length\": 6 }", "trailer_width of 0 m" },
        { "\"length\": 12, \"width\": 2.5, \"body\": { \"length\": 11 }",
          "vehicles[0].body.length: differs from the length of the vehicle" },
        { "\"length\": 16.5, \"width\": 2.5, \"body\": \"articulated\"",
          "vehicles[0].length: makes a tractor of 16.5 m" },
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
        refused("\"length\": 5.0, \"width\": 2.0", wrong[i][0], wrong[i][1]);
    }
    refused("\"length\": 5.0, ", "", "vehicles[0].length: is missing");
}

static void test_values_are_checked(void** state)
{
    (void)state;
    refused("\"width\": 3.75", "\"width\": 0.5", "road.lanes[0].width: is 0.5, expected");
    refused("[400.0, 0.0]", "[400.0]", "road.lanes[0].centerline[1]: has 1 element, expected 2");
    refused("[[0.0, 0.0], [400.0, 0.0]]", "[[0.0, 0.0]]", "road.lanes[0].centerline: ");
    refused("[[0.0, 0.0], [400.0, 0.0]]", "[[0.0, 0.0], [0.0, 0.0]]", "road.lanes[0].centerline");
    refused("[400.0, 0.0]", "[240000.0, 0.0]", "road.lanes[0].centerline");
    refused("\"left\": 1", "\"left\": 9", "road.lanes[0].left: ");
    refused("\"left\": 1", "\"left\": 0", "road.lanes[0].left: ");
    refused("\"successors\": []", "\"successors\": [44]", "road.lanes[0].successors");
    refused("\"successors\": [] }", "\"successors\": [], \"change_left\": [[9, 3]] }",
            "change_left");
    refused("1, \"right\": null, \"successors\": [] },\n    { \"id\": 1",
            "null },\n    { \"id\": 0", ".id: ");
    refused("\"controlled\"", "\"robot\"", "vehicles[0].control: is \"robot\", expected");
    refused("\"speed\": 15.0", "\"speed\": -15.5", "vehicles[0].speed: is -15.5, expected");
    refused("\"speed\": 15.0", "\"speed\": \"15\"", "vehicles[0].speed: is a string, expected");
    refused("\"target_lane\": 0", "\"target_lane\": 5", "vehicles[0].target_lane: is lane 5");
    refused("\"aggressive\"", "\"calm\"", "vehicles[0].habit: is \"calm\", expected");
    refused("\"aggressive\"", "{\"cooperation\": 0.5}", "vehicles[0].habit.weights: is missing");
    refused("\"id\": 2,", "\"id\": 2.5,", "vehicles[0].id: is 2.5, expected a whole number");
    refused("\"seed\": 7", "\"seed\": -1", "planner.seed: ");
    refused("\"seed\": 7", "\"iterations\": 0", "planner.iterations: ");
    refused("12.5", "12.55", "simulation.duration: ");
    refused("\"duration\": 12.5", "\"replan\": 0.25", "simulation.replan: ");
}

static void test_priorities_and_signals_are_read_and_refused_by_their_field(void** state)
{
    (void)state;
    const char* lane = "\"successors\": [] },";
    char* text = changed(lane, "\"priority\": \"stop\", \"stop_line\": 390 },");
    scenario scene;
    assert_true(parse(&scene, text));
    assert_int_equal(scene.def.road.lanes[0].priority, VERGE_PRIORITY_STOP);
    assert_true(scene.def.road.lanes[0].stop_line_given);
    assert_true(scene.def.road.lanes[0].stop_line == 390.0);
    assert_int_equal(scene.def.road.lanes[1].priority, VERGE_PRIORITY_NONE);
    assert_false(scene.def.road.lanes[1].stop_line_given);
    scenario_free(&scene);
    free(text);
    refused(lane, "\"priority\": \"first\" },", "road.lanes[0].priority: is \"first\", expected");
    refused(lane, "\"stop_line\": -1 },", "road.lanes[0].stop_line: is -1, expected");
    refused(lane, "\"stop_line\": 401 },", "road.lanes[0].stop_line: a stop line lies on the lane");
#define PHASE "{ \"state\": \"red\", \"seconds\": 5 }"
    const struct { const char* signals; const char* expected; } bad[] = {
        { "{ \"lane\": 7, \"phases\": [ " PHASE " ] }", "signals[0].lane: is lane 7" },
        { "{ \"lane\": 0, \"phases\": [] }", "signals[0].phases: has 0 elements" },
        { "{ \"lane\": 0, \"phases\": [ " PHASE " ] }, { \"lane\": 0, \"phases\": [ " PHASE " ] }",
          "signals[1].lane: is lane 0, which has a signal already" },
        { "{ \"lane\": 0, \"phases\": [ { \"state\": \"blue\", \"seconds\": 5 } ] }",
          "signals[0].phases[0].state: is \"blue\", expected" },
        { "{ \"lane\": 0, \"phases\": [ { \"state\": \"red\", \"seconds\": 0 } ] }",
          "signals[0].phases[0].seconds: is 0, expected" },
        { "{ \"lane\": 0, \"phases\": [ " PHASE " ], \"offset\": 3 }", "signals[0].offset: " },
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        char members[256];
        snprintf(members, sizeof members, "\"signals\": [ %s ], \"vehicles\"", bad[i].signals);
        refused("\"vehicles\"", members, bad[i].expected);
    }
    refused("\"habit\": \"aggressive\"", "\"yields\": false", "vehicles[0].yields: is given for a");
    refused("\"track\": [", "\"yields\": false, \"track\": [", "vehicles[1].yields: is given for a");
    refused("\"habit\": \"aggressive\"", "\"parked\": true", "vehicles[0].parked: is given for a");
    refused("\"track\": [", "\"parked\": true, \"track\": [", "vehicles[1].parked: is given for a");
}

static void test_a_signal_shows_its_phases_one_after_the_other_for_ever(void** state)
{
    (void)state;
    const signal_program three = {
        .lane_id = 4, .start = 2.0, .phase_count = 3, .seconds = { 20.0, 3.0, 17.0 },
        .states = { VERGE_SIGNAL_GREEN, VERGE_SIGNAL_YELLOW, VERGE_SIGNAL_RED },
    };
    const struct { double t; verge_signal_state state; double change; } at[] = {
        { 2.0, VERGE_SIGNAL_GREEN, 20.0 }, { 0.0, VERGE_SIGNAL_RED, 2.0 },
        { 21.9, VERGE_SIGNAL_GREEN, 0.1 }, { 22.0, VERGE_SIGNAL_YELLOW, 3.0 },
        { 25.0, VERGE_SIGNAL_RED, 17.0 },  { 42.0, VERGE_SIGNAL_GREEN, 20.0 },
        { 4022.0, VERGE_SIGNAL_YELLOW, 3.0 },
    };
    for (size_t i = 0; i < sizeof at / sizeof at[0]; ++i) {
        const verge_signal shown = signal_at(&three, at[i].t);
        assert_int_equal(shown.lane_id, 4);
        assert_int_equal(shown.state, at[i].state);
        CHECK_NEAR(shown.change_s, at[i].change, 1e-9);
    }
    const signal_program one = { .phase_count = 1, .seconds = { 5.0 },
                                 .states = { VERGE_SIGNAL_RED } };
    assert_int_equal(signal_at(&one, 7.0).state, VERGE_SIGNAL_RED);
    assert_true(signal_at(&one, 7.0).change_s < 0.0);
}

static void test_vehicles_must_fit_the_road_and_each_other(void** state)
{
    (void)state;
    refused("\"y\": 3.75", "\"y\": 30.0", "vehicles[0]: vehicle 2 is off every lane");
    refused("\"x\": 20.0, \"y\": 3.75", "\"x\": 57.0, \"y\": 0.0", "overlaps vehicle 2");
    refused("\"id\": 3", "\"id\": 2", "vehicles[1]: has the id 2");
    refused("\"control\": \"human\"", "\"control\": \"controlled\"", "vehicles[1].track: ");
    refused("[20.0, 340.0", "[0.0, 340.0", "vehicles[1].track[1]: ");
    refused("[20.0, 340.0, 0.0,", "[20.0, 340.0,", "vehicles[1].track[1]: has 4 elements");
    refused("\"seed\": 7", "\"controlled_max\": 1, \"vehicles_max\": 1",
            "vehicles: has 2 elements");
}

static void test_a_vehicle_that_enters_later_may_start_where_another_one_is(void** state)
{
    (void)state;
    scenario scene;
    char*    text = changed("[[0.0, 60.0, 0.0", "[[1.0, 20.0, 3.75");
    const bool good = parse(&scene, text);
    assert_string_equal(scene.file.error, "");
    assert_true(good);
    CHECK_SAME_BITS(scene.vehicles[1].start.x, 20.0); // its first row's, not the field's
    scenario_free(&scene);
    free(text);
}

static void test_a_missing_file_is_named(void** state)
{
    (void)state;
    scenario scene;
    assert_false(scenario_load(&scene, "/nonexistent/a.json", NULL));
    assert_true(scene.file.missing);
    assert_non_null(strstr(scene.file.error, "/nonexistent/a.json:file: "));
}

static void test_every_damaged_document_is_refused_in_one_line(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("damage");
    uint32_t refusals = 0;
    for (uint32_t round = 0; round < test_rounds(3000); ++round) {
        char   text[sizeof GOOD];
        size_t size = sizeof GOOD - 1;
        memcpy(text, GOOD, size + 1);
        const uint32_t kind = test_rng_below(&rng, 3);
        const uint32_t at = test_rng_below(&rng, (uint32_t)size);
        if (kind == 0) {
            size = at;
        } else if (kind == 1) {
            text[at] = (char)test_rng_below(&rng, 256);
        } else {
            memmove(text + at, text + at + 1, size - at);
            --size;
        }
        scenario scene;
        if (scenario_parse(&scene, "a.json", text, size, NULL)) {
            scenario_free(&scene); // the damage hit a name or a digit
        } else {
            check_one_line(scene.file.error);
            ++refusals;
        }
    }
    assert_true(refusals > 0);
}

/// The scenario written on one line; the caller frees it.
static char* written(const scenario* scene)
{
    char*  text = NULL;
    size_t size = 0;
    FILE*  out = open_memstream(&text, &size);
    scenario_write(out, scene);
    fclose(out);
    return text;
}

static void test_a_written_scenario_reads_back_the_same(void** state)
{
    (void)state;
    const uint64_t seeds[] = { 0, 7, UINT64_C(1) << 53, (UINT64_C(1) << 53) + 1, UINT64_MAX };
    for (uint32_t i = 0; i < sizeof seeds / sizeof seeds[0]; ++i) {
        scenario first, second;
        assert_true(scenario_parse(&first, "a.json", GOOD, sizeof GOOD - 1, &seeds[i]));
        char* once = written(&first);
        assert_null(strchr(once, '\n'));
        if (!parse(&second, once)) {
            fail_msg("refused: %s", second.file.error);
        }
        char* twice = written(&second);
        assert_string_equal(once, twice);
        assert_true(second.def.seed == seeds[i]);
        free(once);
        free(twice);
        scenario_free(&first);
        scenario_free(&second);
    }
}

static void test_numbers_read_back_bit_for_bit(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("numbers");
    for (uint32_t round = 0; round < test_rounds(20000); ++round) {
        const uint64_t bits = test_rng_next(&rng);
        double         value;
        memcpy(&value, &bits, sizeof value);
        char  text[64] = "";
        FILE* out = fmemopen(text, sizeof text, "w");
        number_write(out, value);
        fclose(out);
        if (isfinite(value)) {
            CHECK_SAME_BITS(strtod(text, NULL), value);
        } else {
            assert_string_equal(text, "null");
        }
    }
}

static void test_a_track_is_exact_at_its_rows_and_ends_with_them(void** state)
{
    (void)state;
    scenario_row rows[] = {
        { .t = 1.0, .x = 0.0, .y = 0.0, .heading = 3.1, .speed = 10.0 },
        { .t = 2.0, .x = 10.0, .y = 2.0, .heading = -3.1, .speed = 12.0 }, // across +-pi
        { .t = 4.0, .x = 30.0, .y = 2.0, .heading = -3.0, .speed = 8.0 },
    };
    const scenario_vehicle vehicle = { .start = verge_vehicle_default(), .track_count = 3,
                                       .track = rows };
    verge_vehicle at;
    assert_false(scenario_track_at(&vehicle, 0.9, &at));
    assert_false(scenario_track_at(&vehicle, 4.1, &at));
    for (uint32_t i = 0; i < 3; ++i) {
        assert_true(scenario_track_at(&vehicle, rows[i].t, &at));
        CHECK_NEAR(at.x, rows[i].x, 1e-12);
        CHECK_NEAR(at.heading, rows[i].heading, 1e-12);
        CHECK_NEAR(at.speed, rows[i].speed, 1e-12);
    }
    assert_true(scenario_track_at(&vehicle, 1.5, &at));
    CHECK_NEAR(fabs(at.heading), 3.14159265358979, 1e-9);
    CHECK_NEAR(at.acceleration, 2.0, 1e-12);
    assert_true(scenario_track_at(&vehicle, 3.0, &at));
    CHECK_NEAR(at.x, 20.0, 1e-12);
    CHECK_NEAR(at.acceleration, -2.0, 1e-12);
    CHECK_NEAR(at.yaw_rate, 0.05, 1e-12);
}

static void test_a_heading_that_steps_between_two_rows_has_no_yaw_rate(void** state)
{
    (void)state;
    scenario_row rows[] = {
        { .t = 0.0, .x = 0.0, .heading = 0.0, .speed = 10.0 },
        { .t = 1.0, .x = 10.0, .heading = 0.2, .speed = 10.0 },
        { .t = 1.01, .x = 10.1, .heading = 0.0, .speed = 10.0 }, // 20 rad/s
    };
    const scenario_vehicle vehicle = { .start = verge_vehicle_default(), .track_count = 3,
                                       .track = rows };
    verge_vehicle at;
    assert_true(scenario_track_at(&vehicle, 0.5, &at));
    CHECK_NEAR(at.yaw_rate, 0.2, 1e-12);
    assert_true(scenario_track_at(&vehicle, 1.005, &at));
    assert_true(isnan(at.yaw_rate));
    CHECK_NEAR(at.heading, 0.1, 1e-12);
}

static void test_every_scenario_of_the_project_loads(void** state)
{
    (void)state;
    const char* const names[] = { "crossing", "freeway-2av", "freeway-3av", "freeway-4av",
                                  "freeway-4av-2hv", "overtaking", "ramp-case1", "ramp-case2",
                                  "ramp-case3", "roundabout", "zipper" };
    for (uint32_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
        char path[512];
        snprintf(path, sizeof path, "%s/apps/scenarios/%s.json", VERGE_SOURCE_DIR, names[i]);
        scenario scene;
        if (!scenario_load(&scene, path, NULL)) {
            fail_msg("%s", scene.file.error);
        }
        assert_string_equal(scene.name, names[i]);
        scenario_free(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_scenario_is_read_as_it_stands),
        cmocka_unit_test(test_json_that_is_broken_is_refused_with_its_line),
        cmocka_unit_test(test_numbers_are_spelled_as_json_spells_them),
        cmocka_unit_test(test_null_means_no_lane_and_is_no_other_value),
        cmocka_unit_test(test_an_object_has_a_bounded_number_of_keys),
        cmocka_unit_test(test_keys_are_exact),
        cmocka_unit_test(test_a_body_is_a_kind_or_an_object_of_its_numbers),
        cmocka_unit_test(test_a_body_that_cannot_be_is_refused_by_its_field),
        cmocka_unit_test(test_values_are_checked),
        cmocka_unit_test(test_priorities_and_signals_are_read_and_refused_by_their_field),
        cmocka_unit_test(test_a_signal_shows_its_phases_one_after_the_other_for_ever),
        cmocka_unit_test(test_vehicles_must_fit_the_road_and_each_other),
        cmocka_unit_test(test_a_vehicle_that_enters_later_may_start_where_another_one_is),
        cmocka_unit_test(test_a_missing_file_is_named),
        cmocka_unit_test(test_every_damaged_document_is_refused_in_one_line),
        cmocka_unit_test(test_a_written_scenario_reads_back_the_same),
        cmocka_unit_test(test_numbers_read_back_bit_for_bit),
        cmocka_unit_test(test_a_track_is_exact_at_its_rows_and_ends_with_them),
        cmocka_unit_test(test_a_heading_that_steps_between_two_rows_has_no_yaw_rate),
        cmocka_unit_test(test_every_scenario_of_the_project_loads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
