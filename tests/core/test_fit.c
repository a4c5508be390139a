/// Goal: the fitted line is the surveyed road: near it, no sharper than it, drivable at corners,
/// and without a kink where lanes meet.
/// Method: surveys of known geometry, measured here by dense sampling of the public functions
/// alone: distances from line to chords and back, curvature as change of heading over distance.
#include "check.h"
#include "drawn.h"
#include "rng.h"
#include "shipped.h"
#include "verge/road.h"

#include <math.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846
#endif

enum { SAMPLES = 10001 };
static const double tolerance = 0.15, at_vertices = 0.30; // [m] as road.h has it

/// The line of a lane, densely.
typedef struct sample {
    double x, y, heading;
} sample;
static sample   line[SAMPLES];
static uint32_t line_count;

static void add_lane(double width)
{
    draw_lane((int32_t)c.count)->width = width;
}

/// Samples a lane every 0.2 m.
static void take_line(int32_t lane)
{
    const double length = verge_road_length(c.road, lane);
    line_count = (uint32_t)fmin(length / 0.2, SAMPLES - 2) + 2;
    for (uint32_t i = 0; i < line_count; ++i) {
        const double s = length * i / (line_count - 1);
        assert_true(verge_road_at(c.road, lane, s, 0.0, &line[i].x, &line[i].y, &line[i].heading));
    }
}

static double to_segment(double x, double y, double ax, double ay, double bx, double by)
{
    const double dx = bx - ax, dy = by - ay, square = dx * dx + dy * dy;
    double t = square > 0.0 ? ((x - ax) * dx + (y - ay) * dy) / square : 0.0;
    t = fmin(fmax(t, 0.0), 1.0);
    return hypot(x - ax - t * dx, y - ay - t * dy);
}

static double to_chords(uint32_t lane, double x, double y)
{
    double nearest = HUGE_VAL;
    for (uint32_t i = 0; i + 1 < c.lanes[lane].point_count; ++i) {
        const double *a = c.points[lane][i], *b = c.points[lane][i + 1];
        nearest = fmin(nearest, to_segment(x, y, a[0], a[1], b[0], b[1]));
    }
    return nearest;
}

static double to_line(double x, double y)
{
    double nearest = HUGE_VAL;
    for (uint32_t i = 0; i + 1 < line_count; ++i) {
        nearest = fmin(nearest, to_segment(x, y, line[i].x, line[i].y, line[i + 1].x,
                                           line[i + 1].y));
    }
    return nearest;
}

/// The larger one of: furthest point of the line from the chords, of the chords from the line. At
/// an end that nothing continues the line may go on by half a metre.
static double hausdorff(uint32_t lane)
{
    double furthest = 0.0;
    for (uint32_t i = 3; i + 3 < line_count; ++i) {
        furthest = fmax(furthest, to_chords(lane, line[i].x, line[i].y));
    }
    for (uint32_t i = 0; i + 1 < c.lanes[lane].point_count; ++i) {
        const double *a = c.points[lane][i], *b = c.points[lane][i + 1];
        const int pieces = (int)hypot(b[0] - a[0], b[1] - a[1]) + 2;
        for (int k = 0; k <= pieces; ++k) {
            const double t = (double)k / pieces;
            furthest = fmax(furthest, to_line(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])));
        }
    }
    return furthest;
}

static double between(double from, double to)
{
    return remainder(to - from, 2.0 * M_PI);
}

/// [1/m] over 0.8 m around sample i
static double curvature_at(uint32_t i)
{
    const sample *a = &line[i - 2], *b = &line[i + 2];
    return fabs(between(a->heading, b->heading)) / hypot(b->x - a->x, b->y - a->y);
}

static double sharpest(void)
{
    double most = 0.0;
    for (uint32_t i = 2; i + 2 < line_count; ++i) {
        most = fmax(most, curvature_at(i));
    }
    return most;
}

/// [1/m] of an arc that is tangent to both chords half way, or that passes a vertex within the
/// tolerance, whichever is sharper: of all vertices within 20 m of the point.
static double supported(uint32_t lane, double x, double y)
{
    double most = 0.0;
    for (uint32_t i = 1; i + 1 < c.lanes[lane].point_count; ++i) {
        const double *a = c.points[lane][i - 1], *b = c.points[lane][i], *d = c.points[lane][i + 1];
        const double before = hypot(b[0] - a[0], b[1] - a[1]);
        const double behind = hypot(d[0] - b[0], d[1] - b[1]);
        if (hypot(b[0] - x, b[1] - y) > 20.0) {
            continue;
        }
        const double half = 0.5 * fabs(between(atan2(b[1] - a[1], b[0] - a[0]),
                                               atan2(d[1] - b[1], d[0] - b[0])));
        most = fmax(most, fmax(2.0 * tan(half) / fmin(before, behind),
                               (1.0 / cos(half) - 1.0) / at_vertices));
    }
    return most;
}

static void check_bends(uint32_t lane)
{
    for (uint32_t i = 2; i + 2 < line_count; ++i) {
        const double most = 1.25 * supported(lane, line[i].x, line[i].y) + 0.01;
        if (curvature_at(i) > most) {
            fail_msg("lane %u at %.2f, %.2f: curvature %.4f, supported %.4f", lane, line[i].x,
                     line[i].y, curvature_at(i), most);
        }
    }
}

/// Straight, arc of `radius` by `angle` to the left, straight, all by chords of this length; noise
/// [m] of every point.
static void add_bend(double radius, double angle, double chord, double lead, double noise,
                     test_rng* rng)
{
    const int straight = (int)fmax(1.0, round(lead / chord));
    const int arc = (int)fmax(2.0, round(radius * angle / chord));
    const double ex = radius * sin(angle), ey = radius * (1.0 - cos(angle));
    add_lane(3.5);
    for (int i = 0; i <= 2 * straight + arc; ++i) {
        const double ahead = fmin(i - straight, 0) * lead / straight;
        const double beyond = fmax(i - straight - arc, 0) * lead / straight;
        const double a = angle * fmin(fmax(i - straight, 0), arc) / arc;
        double x = i > straight + arc ? ex + beyond * cos(angle) : radius * sin(a);
        double y = i > straight + arc ? ey + beyond * sin(angle) : radius * (1.0 - cos(a));
        x += ahead;
        if (noise > 0.0) {
            x += test_rng_between(rng, -noise, noise);
            y += test_rng_between(rng, -noise, noise);
        }
        add_point(x, y);
    }
}

static void add_corner(double degrees, double before, double behind, double width)
{
    const double turn = degrees * M_PI / 180.0;
    add_lane(width);
    add_point(-before, 0.0);
    add_point(0.0, 0.0);
    add_point(behind * cos(turn), behind * sin(turn));
}

// ------------------------------------------------------------------------------ the claims

static void test_a_coarse_survey_is_followed_chord_by_chord(void** state)
{
    (void)state;
    static const double bends[][3] = { // radius, chord [m], angle
        { 1500.0, 60.0, 0.5 }, { 700.0, 60.0, 1.0 }, { 344.0, 60.0, 1.5 }, { 172.0, 15.0, 1.5 },
        { 100.0, 30.0, 1.5 },  { 50.0, 15.0, 1.5 },  { 50.0, 8.0, 1.5 },   { 20.0, 5.0, 1.5 },
        { 10.0, 3.0, 1.5 },    { 12.0, 6.0, 1.5 },
    };
    for (size_t i = 0; i < sizeof bends / sizeof bends[0]; ++i) {
        add_bend(bends[i][0], bends[i][2], bends[i][1], 100.0, 0.0, NULL);
        build();
        take_line(0);
        CHECK_AT_MOST(hausdorff(0), at_vertices);
        check_bends(0);
        clear();
    }
}

static void test_a_survey_every_metre_is_followed_and_driven_at_its_radius(void** state)
{
    (void)state;
    static const double radii[] = { 5, 6, 8, 10, 12, 15, 20, 30, 50, 100, 400 };
    for (size_t i = 0; i < sizeof radii / sizeof radii[0]; ++i) {
        add_bend(radii[i], 0.5 * M_PI, 1.0, 60.0, 0.0, NULL);
        build();
        take_line(0);
        CHECK_AT_MOST(hausdorff(0), tolerance + 0.02);
        check_bends(0);
        CHECK_AT_MOST(sharpest(), 1.15 / radii[i] + 0.001);
        clear();
    }
}

static void test_noise_of_a_decimetre_is_not_followed(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("noise");
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        const double radius = test_rng_between(&rng, 12.0, 200.0);
        add_bend(radius, 1.5, test_rng_between(&rng, 0.8, 6.0), 60.0, 0.1, &rng);
        build();
        take_line(0);
        CHECK_AT_MOST(hausdorff(0), at_vertices + 0.05);
        CHECK_AT_MOST(sharpest(), 1.25 / radius + 0.03);
        clear();
    }
}

/// A gentle corner is passed within the tolerance; a sharp one is driven inside the lane.
static void test_a_corner_of_three_points_can_be_driven_inside_the_lane(void** state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        for (int degrees = 10; degrees <= 120; degrees += 10) {
            for (double width = 3.0; width <= 4.5; width += 0.5) {
                add_corner(side * degrees, 70.0, 80.0, width);
                build();
                take_line(0);
                const double radius = 1.0 / sharpest();
                if (degrees <= 30) {
                    CHECK_AT_MOST(hausdorff(0), at_vertices + 0.02);
                }
                if (width == 3.5) {
                    CHECK_AT_MOST(degrees <= 50 ? 6.0 : degrees <= 90 ? 3.0 : 1.8, radius);
                }
                check_bends(0);
                for (uint32_t i = 0; i < line_count; ++i) { // sides of a body of 2 m
                    for (double d = -1.0; d <= 1.0; d += 2.0) {
                        const double x = line[i].x - d * sin(line[i].heading);
                        const double y = line[i].y + d * cos(line[i].heading);
                        CHECK_AT_MOST(to_chords(0, x, y), 0.5 * width + 0.1);
                    }
                }
                clear();
            }
        }
    }
}

/// Lanes that meet: one position, one direction, and none of them sharper than its survey.
static void check_seams(void)
{
    for (uint32_t i = 0; i < c.count; ++i) {
        for (uint32_t k = 0; k < c.lanes[i].successor_count; ++k) {
            double ax, ay, a, bx, by, b;
            const int32_t next = c.lanes[i].successors[k];
            assert_true(verge_road_at(c.road, (int32_t)i, verge_road_length(c.road, (int32_t)i),
                                      0.0, &ax, &ay, &a));
            assert_true(verge_road_at(c.road, next, 0.0, 0.0, &bx, &by, &b));
            CHECK_NEAR(hypot(ax - bx, ay - by), 0.0, 1e-6);
            CHECK_NEAR(between(a, b), 0.0, 0.5 * M_PI / 180.0);
        }
    }
}

/// A turn of `radius` from one street into another, points a metre apart.
static void add_turn(double x, double y, double heading, double turn, double radius)
{
    const int n = (int)(radius * fabs(turn)) + 1;
    const double side = turn > 0.0 ? 1.0 : -1.0;
    add_lane(3.5);
    for (int i = 0; i <= n; ++i) {
        const double a = turn * i / n;
        add_point(x + side * radius * (sin(heading + a) - sin(heading)),
                  y - side * radius * (cos(heading + a) - cos(heading)));
    }
}

static void add_straight(double x, double y, double heading, double length)
{
    add_lane(3.5);
    add_point(x, y);
    add_point(x + length * cos(heading), y + length * sin(heading));
}

static void test_the_branches_of_a_junction_begin_as_the_road_before_them(void** state)
{
    (void)state;
    for (double radius = 6.0; radius <= 12.0; radius += 2.0) {
        add_straight(-80.0, 0.0, 0.0, 80.0);
        add_turn(0.0, 0.0, 0.0, 0.5 * M_PI, radius);
        add_turn(0.0, 0.0, 0.0, -0.5 * M_PI, radius);
        add_straight(0.0, 0.0, 0.0, 2.0 * radius);
        add_straight(radius, radius, 0.5 * M_PI, 60.0);
        add_straight(radius, -radius, -0.5 * M_PI, 60.0);
        leads_to(0, 1);
        leads_to(0, 2);
        leads_to(0, 3);
        leads_to(1, 4);
        leads_to(2, 5);
        build();
        check_seams();
        for (int32_t lane = 0; lane < 6; ++lane) {
            take_line(lane);
            CHECK_AT_MOST(hausdorff((uint32_t)lane), at_vertices);
            const bool street = lane == 0 || lane == 3;
            const double half = 0.25 * M_PI / ((int)(0.5 * M_PI * radius) + 1); // of a vertex
            CHECK_AT_MOST(sharpest(), street ? 0.001 : 1.25 / (radius * cos(half)) + 0.01);
        }
        clear();
    }
}

/// Where a turn begins its curvature grows within metres, as a wheel turns, and where one bend goes
/// on from lane to lane its curvature does, too.
static void test_curvature_goes_on_where_lanes_meet(void** state)
{
    (void)state;
    add_straight(-80.0, 0.0, 0.0, 80.0);
    add_turn(0.0, 0.0, 0.0, 0.5 * M_PI, 8.0);
    add_straight(0.0, 0.0, 0.0, 60.0);
    leads_to(0, 1);
    leads_to(0, 2);
    build();
    take_line(1);
    CHECK_AT_MOST(curvature_at(2), 0.75 / 8.0);
    clear();

    add_turn(0.0, 0.0, 0.0, 0.5 * M_PI, 20.0);
    add_turn(20.0, 20.0, 0.5 * M_PI, 0.5 * M_PI, 20.0);
    add_turn(20.0, 20.0, 0.5 * M_PI, -0.5 * M_PI, 20.0);
    leads_to(0, 1);
    leads_to(0, 2);
    build();
    take_line(0);
    const double before = curvature_at(line_count - 3);
    take_line(1);
    CHECK_NEAR(curvature_at(2), before, 0.003);
}

static void test_roundabouts_meet_their_entries_without_a_spike(void** state)
{
    (void)state;
    for (double radius = 12.0; radius <= 24.0; radius += 4.0) {
        for (int k = 0; k < 4; ++k) { // ring 0 .. 3, entries 4 .. 7, exits 8 .. 11
            add_turn(radius * cos(k * 0.5 * M_PI), radius * sin(k * 0.5 * M_PI),
                     (k + 1) * 0.5 * M_PI, 0.5 * M_PI, radius);
        }
        for (int out = 0; out < 2; ++out) {
            for (int k = 0; k < 4; ++k) {
                const double a = k * 0.5 * M_PI, h = a + 0.5 * M_PI;
                add_lane(3.5);
                for (int i = 0; i <= 20; ++i) { // an arc that touches the ring from outside
                    const double b = 1.2 * (out ? i : 20 - i) / 20.0;
                    const double ahead = (out ? 12.0 : -12.0) * sin(b);
                    const double outward = radius + 12.0 * (1.0 - cos(b));
                    add_point(outward * cos(a) + ahead * cos(h), outward * sin(a) + ahead * sin(h));
                }
            }
        }
        for (int32_t k = 0; k < 4; ++k) {
            leads_to((uint32_t)k, (k + 1) % 4);
            leads_to((uint32_t)k, 8 + (k + 1) % 4);
            leads_to((uint32_t)(4 + k), k);
        }
        build();
        check_seams();
        for (int32_t lane = 0; lane < 12; ++lane) {
            take_line(lane);
            CHECK_AT_MOST(hausdorff((uint32_t)lane), at_vertices);
            CHECK_AT_MOST(sharpest(), 1.25 / (lane < 4 ? radius : 12.0) + 0.01);
        }
        clear();
    }
}

/// A link that meets the main lane at an angle turns into its direction.
static void test_a_merge_at_an_angle_is_joined_in_direction(void** state)
{
    (void)state;
    for (int degrees = 2; degrees <= 20; degrees += 3) {
        const double a = degrees * M_PI / 180.0;
        add_straight(-100.0, 0.0, 0.0, 100.0);
        add_straight(-100.0 * cos(a), -100.0 * sin(a), a, 100.0);
        add_straight(0.0, 0.0, 0.0, 100.0);
        leads_to(0, 2);
        leads_to(1, 2);
        build();
        check_seams();
        for (int32_t lane = 0; lane < 3; ++lane) {
            take_line(lane);
            CHECK_AT_MOST(hausdorff((uint32_t)lane), lane == 1 ? 0.75 : 0.001);
        }
        take_line(1);
        CHECK_AT_MOST(sharpest(), 0.02 + 0.008 * degrees);
        clear();
    }
}

static void test_the_shipped_roads_are_as_surveyed(void** state)
{
    (void)state;
    for (size_t k = 0; k < sizeof scenarios / sizeof scenarios[0]; ++k) {
        for (uint32_t i = 0; i < scenarios[k].lane_count; ++i) {
            const verge_lane_def* lane = &scenarios[k].lanes[i];
            c.lanes[c.count] = *lane;
            memcpy(c.points[c.count++], lane->points, lane->point_count * sizeof lane->points[0]);
        }
        build();
        for (uint32_t i = 0; i < c.count; ++i) {
            take_line(c.lanes[i].id);
            CHECK_AT_MOST(hausdorff(i), at_vertices);
        }
        clear();
    }
}

#define CLAIM(test) cmocka_unit_test_setup_teardown(test, NULL, clear_after)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CLAIM(test_a_coarse_survey_is_followed_chord_by_chord),
        CLAIM(test_a_survey_every_metre_is_followed_and_driven_at_its_radius),
        CLAIM(test_noise_of_a_decimetre_is_not_followed),
        CLAIM(test_a_corner_of_three_points_can_be_driven_inside_the_lane),
        CLAIM(test_the_branches_of_a_junction_begin_as_the_road_before_them),
        CLAIM(test_curvature_goes_on_where_lanes_meet),
        CLAIM(test_roundabouts_meet_their_entries_without_a_spike),
        CLAIM(test_a_merge_at_an_angle_is_joined_in_direction),
        CLAIM(test_the_shipped_roads_are_as_surveyed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
