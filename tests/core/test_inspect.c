/// Goal: what is odd about a road that can be built is told, lane and field by name; what is not
/// odd is not.
/// Method: small roads with one oddity each; their numbers from the drawing.
#include "check.h"
#include "drawn.h"
#include "verge/body.h"

#include <math.h>

static verge_lane_def* add_lane(void)
{
    return draw_lane(10 + (int32_t)c.count);
}

static verge_lane_def* add_straight(double x0, double y0, double x1, double y1)
{
    verge_lane_def* lane = add_lane();
    add_point(x0, y0);
    add_point(x1, y1);
    return lane;
}

static verge_lane_report report_of(uint32_t lane)
{
    const verge_road_def def = { .lanes = c.lanes, .lane_count = c.count };
    verge_lane_report report;
    assert_int_equal(verge_road_report(c.road, &def, lane, &report), VERGE_OK);
    return report;
}

/// The one warning of a lane is about this field, and its text has this word.
static verge_lane_warning only_warning(uint32_t lane, const char* field, const char* word)
{
    const verge_lane_report report = report_of(lane);
    assert_int_equal(report.warning_count, 1);
    assert_string_equal(report.warnings[0].field, field);
    if (strstr(report.warnings[0].text, word) == NULL) {
        fail_msg("%s: %s", field, report.warnings[0].text);
    }
    return report.warnings[0];
}

static void test_an_ordinary_road_has_no_warning(void** state)
{
    (void)state;
    add_straight(0.0, 0.0, 100.0, 0.0)->left = 11;
    add_straight(0.0, 3.5, 100.0, 3.5)->right = 10;
    leads_to(0, 12);
    add_lane();
    for (int i = 0; i <= 30; ++i) {
        add_point(100.0 + 20.0 * sin(i * 0.05), 20.0 * (1.0 - cos(i * 0.05)));
    }
    build();
    for (uint32_t i = 0; i < 3; ++i) {
        assert_int_equal(report_of(i).warning_count, 0);
    }
    assert_int_equal(report_of(2).lane_id, 12);
    CHECK_NEAR(report_of(2).radius_min, 20.0, 2.0);
    CHECK_NEAR(report_of(2).speed_min, sqrt(2.5 * 20.0), 0.5);
    assert_true(report_of(1).radius_min > 1e5);
}

static void test_a_corner_is_told_with_its_radius_and_its_cut(void** state)
{
    (void)state;
    add_straight(0.0, 0.0, 60.0, 0.0);
    add_point(60.0, 80.0);
    build();
    const verge_lane_warning warning = only_warning(0, "centerline", "corner");
    CHECK_BETWEEN(warning.value, 0.9, 1.3);
    const verge_body truck = verge_body_of(VERGE_BODY_TRUCK), car = verge_body_of(VERGE_BODY_CAR);
    const double radius = report_of(0).radius_min;
    CHECK_BETWEEN(radius, verge_body_radius_min(&car), verge_body_radius_min(&truck));
    CHECK_NEAR(report_of(0).radius_s, 59.5, 2.0);
}

static void test_a_sparse_bend_is_told(void** state)
{
    (void)state;
    add_lane();
    for (int i = 0; i < 8; ++i) { // chords of 60 m on a circle of 344 m: 1.3 m
        add_point(344.0 * sin(i * 0.1745), 344.0 * (1.0 - cos(i * 0.1745)));
    }
    build();
    CHECK_NEAR(only_warning(0, "centerline", "sparse").value, 1.3, 0.05);
}

static void test_a_lane_that_crosses_itself_is_told(void** state)
{
    (void)state;
    add_lane();
    add_point(-60.0, 0.0);
    for (int i = 0; i <= 40; ++i) { // a loop of 270 degrees
        const double a = i * 1.5 * 3.14159265 / 40.0;
        add_point(20.0 * sin(a), 20.0 * (1.0 - cos(a)));
    }
    add_point(-20.0, -40.0);
    build();
    (void)only_warning(0, "centerline", "crosses itself");
}

static void test_neighbours_are_checked_from_both_sides(void** state)
{
    (void)state;
    add_straight(0.0, 0.0, 100.0, 0.0)->left = 11; // one-sided
    add_straight(0.0, 3.5, 100.0, 3.5);
    build();
    assert_int_equal(only_warning(0, "left", "does not name").other_lane, 11);
    assert_int_equal(report_of(1).warning_count, 0);
    clear();

    add_straight(0.0, 0.0, 100.0, 0.0)->left = 11; // opposed
    add_straight(100.0, 3.5, 0.0, 3.5)->right = 10;
    build();
    (void)only_warning(0, "left", "opposite");
    (void)only_warning(1, "right", "opposite");
    clear();

    add_straight(0.0, 0.0, 100.0, 0.0)->right = 11; // left and right exchanged
    add_straight(0.0, 3.5, 100.0, 3.5)->left = 10;
    build();
    (void)only_warning(0, "right", "on the left");
    (void)only_warning(1, "left", "on the right");
    clear();

    add_straight(0.0, 0.0, 100.0, 0.0)->left = 11; // far away
    add_straight(0.0, 30.0, 100.0, 30.0)->right = 10;
    build();
    CHECK_NEAR(only_warning(0, "left", "nowhere").value, 30.0, 0.1);
}

static void test_seams_with_a_kink_or_a_gap_are_told(void** state)
{
    (void)state;
    add_straight(0.0, 0.0, 100.0, 0.0);
    add_straight(100.0, 0.0, 200.0, 36.397);
    add_straight(103.0, 0.0, 200.0, 0.0);
    c.lanes[0].successor_count = 2;
    c.lanes[0].successors[0] = 11;
    c.lanes[0].successors[1] = 12;
    build();
    const verge_lane_report report = report_of(0);
    assert_int_equal(report.warning_count, 2);
    CHECK_NEAR(report.warnings[0].value, 0.34907, 1e-4); // 20 degrees
    assert_int_equal(report.warnings[0].other_lane, 11);
    CHECK_NEAR(report.warnings[1].value, 3.0, 1e-9);
    assert_int_equal(report.warnings[1].other_lane, 12);
}

static void test_a_report_is_of_a_lane_of_its_own_road(void** state)
{
    (void)state;
    add_straight(0.0, 0.0, 100.0, 0.0);
    verge_road_def def = build();
    verge_lane_report report;
    assert_int_equal(verge_road_report(c.road, &def, 1, &report), VERGE_ERR_ARGUMENT);
    assert_int_equal(report.lane_id, VERGE_NO_LANE);
    c.lanes[0].id = 11;
    assert_int_equal(verge_road_report(c.road, &def, 0, &report), VERGE_ERR_ARGUMENT);
}

#define CLAIM(test) cmocka_unit_test_setup_teardown(test, NULL, clear_after)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CLAIM(test_an_ordinary_road_has_no_warning),
        CLAIM(test_a_corner_is_told_with_its_radius_and_its_cut),
        CLAIM(test_a_sparse_bend_is_told),
        CLAIM(test_a_lane_that_crosses_itself_is_told),
        CLAIM(test_neighbours_are_checked_from_both_sides),
        CLAIM(test_seams_with_a_kink_or_a_gap_are_told),
        CLAIM(test_a_report_is_of_a_lane_of_its_own_road),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
