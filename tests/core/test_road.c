/// Goal: from any survey a road with smooth lines near it, on which positions, neighbours,
/// followers, routes and conflicts are found.
/// Method: random roads for the properties of every road; small roads drawn by hand for relations;
/// noisy and malformed surveys for robustness.
#include "check.h"
#include "motion/path.h"
#include "rng.h"
#include "room.h"
#include "road/build.h"
#include "road/local.h"
#include "base/scalar.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = 16, POINTS = 1024 };

/// A road under construction, and the road.
typedef struct world {
    uint32_t count;
    verge_lane_def lanes[LANES];
    double points[LANES][POINTS][2];
    void *memory, *scratch_memory, *local_memory;
    struct verge_road* road;
    vg_local* local; ///< all lanes near
} world;

static world* world_new(void)
{
    return calloc(1, sizeof(world));
}

static verge_lane_def* add_lane(world* w, int32_t left, int32_t right)
{
    verge_lane_def* lane = &w->lanes[w->count];
    lane->id = (int32_t)w->count;
    lane->points = (const double(*)[2])w->points[w->count++];
    lane->width = 3.5;
    lane->speed_limit = 20.0;
    lane->left = left;
    lane->right = right;
    return lane;
}

static void add_point(world* w, double x, double y)
{
    verge_lane_def* lane = &w->lanes[w->count - 1];
    w->points[w->count - 1][lane->point_count][0] = x;
    w->points[w->count - 1][lane->point_count++][1] = y;
}

static void add_straight(world* w, double x0, double y0, double x1, double y1)
{
    add_point(w, x0, y0);
    add_point(w, x1, y1);
}

static void add_arc(world* w, double radius, double from, double to, int pieces)
{
    for (int i = 0; i <= pieces; ++i) {
        const double a = from + (to - from) * i / pieces;
        add_point(w, radius * cos(a), radius * sin(a));
    }
}

static void leads_to(world* w, uint32_t lane, int32_t next)
{
    w->lanes[lane].successors[w->lanes[lane].successor_count++] = next;
}

/// Relates the lanes near these vehicles.
static void look_around(world* w, const vg_source* sources, uint32_t count)
{
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)vg_local_take(&arena, w->count, 64, 16);
    vg_local_take_scratch(NULL, &arena, w->count, 64);
    free(w->local_memory);
    w->local_memory = aligned_alloc(64, arena.used);
    vg_arena_init(&arena, w->local_memory, arena.used);
    w->local = vg_local_take(&arena, w->count, 64, 16);
    vg_local_take_scratch(w->local, &arena, w->count, 64);
    vg_local_cover(w->local, w->road, sources, count);
}

static struct verge_road* build(world* w)
{
    const verge_road_def def = { .lanes = w->lanes, .lane_count = w->count };
    verge_road_fault fault;
    if (verge_road_check(&def, &fault) != VERGE_OK) {
        fail_msg("lane %u, %s: %s", fault.lane_index, fault.field, fault.text);
    }
    vg_arena measure, arena, scratch;
    vg_arena_init(&measure, NULL, 0);
    assert_null(vg_road_build(&measure, NULL, &def));
    const size_t scratch_size = vg_road_scratch_size(&def);
    w->memory = aligned_alloc(64, measure.used);
    w->scratch_memory = aligned_alloc(64, (scratch_size + 63) / 64 * 64);
    vg_arena_init(&arena, w->memory, measure.used);
    vg_arena_init(&scratch, w->scratch_memory, scratch_size);
    w->road = vg_road_build(&arena, &scratch, &def);
    assert_non_null(w->road);
    assert_int_equal(arena.used, measure.used); // what was measured is what was used
    assert_true(vg_road_holds(w->road));
    look_around(w, NULL, 0);
    return w->road;
}

static void world_free(world* w)
{
    free(w->memory);
    free(w->scratch_memory);
    free(w->local_memory);
    free(w);
}

static vg_relation relation(const world* w, uint32_t a, uint32_t b)
{
    return vg_local_relation(w->local, a, b);
}

static bool matters(const world* w, uint32_t lane, int32_t target, uint32_t other)
{
    return vg_local_matters(w->local, vg_local_column(w->local, target), lane, other);
}

static uint32_t conflict_count(const world* w)
{
    return w->road->conflicts_from[w->count];
}

/// A winding lane: curvature by a random walk, points 3 to 10 m apart, radius above 25 m.
static void add_random_lane(world* w, test_rng* rng, double length)
{
    double x = test_rng_between(rng, -300.0, 300.0), y = test_rng_between(rng, -300.0, 300.0);
    double heading = test_rng_between(rng, -3.1, 3.1), curvature = 0.0;
    add_lane(w, VERGE_NO_LANE, VERGE_NO_LANE);
    add_point(w, x, y);
    const double spacing = test_rng_between(rng, 3.0, 10.0);
    for (double s = 0.0; s < length; s += spacing) {
        curvature = vg_clamp(curvature + spacing * test_rng_between(rng, -0.0008, 0.0008),
                             -0.04, 0.04); // a clothoid of a road made for cars
        for (int i = 0; i < 20; ++i) {
            heading += curvature * spacing / 20.0;
            x += cos(heading) * spacing / 20.0;
            y += sin(heading) * spacing / 20.0;
        }
        add_point(w, x, y);
    }
}

// ------------------------------------------------------------------------------ lines

static void test_lines_are_smooth_near_their_survey_and_measured_by_arc(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("random lines");
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        world* w = world_new();
        add_random_lane(w, &rng, test_rng_between(&rng, 20.0, 500.0));
        const vg_lane* lane = &build(w)->lanes[0];
        double way = 0.0; // lanes may cross themselves: look near where the point belongs
        for (uint32_t i = 0; i < w->lanes[0].point_count; ++i) {
            const double* p = w->points[0][i];
            way += i > 0 ? hypot(p[0] - p[-2], p[1] - p[-1]) : 0.0;
            const double s = vg_lane_project(lane, p[0], p[1], way);
            const vg_reference at = vg_lane_at(lane, s); // ends may come a little early
            CHECK_AT_MOST(hypot(at.x - p[0], at.y - p[1]), 0.32);
            CHECK_BETWEEN(s, -1.0, lane->length + 1.0);
        }
        const double e = 1e-5;
        for (double s = e; s < lane->length - e; s += 0.37) {
            const vg_reference a = vg_lane_at(lane, s - e), b = vg_lane_at(lane, s + e);
            const vg_reference at = vg_lane_at(lane, s);
            CHECK_NEAR(hypot(b.x - a.x, b.y - a.y) / (2.0 * e), 1.0, 2e-4);
            CHECK_NEAR((b.x - a.x) / (2.0 * e), at.cos_heading, 2e-4);
            CHECK_NEAR((a.cos_heading * b.sin_heading - a.sin_heading * b.cos_heading) / (2.0 * e),
                       at.curvature, 1e-4);
            CHECK_NEAR(b.curvature - a.curvature, 0.0, 1e-5); // C2
            // The survey's own is at most 0.04; an end that nothing continues has no second side.
            const bool inside = s > 12.0 && s < lane->length - 12.0;
            CHECK_AT_MOST(fabs(at.curvature), inside ? 0.06 : 0.1);
        }
        world_free(w);
    }
}

static void test_a_straight_lane_is_exactly_straight(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 3.5, 400.0, 3.5);
    add_lane(w, -1, -1);
    add_straight(w, 10.0, 20.0, 310.0, 420.0); // 3, 4, 5
    build(w);
    for (double s = -20.0; s < 420.0; s += 1.3) {
        double x, y, heading;
        verge_road_at(w->road, 0, s, 1.0, &x, &y, &heading);
        CHECK_SAME_BITS(heading, 0.0);
        CHECK_SAME_BITS(y, 4.5);
        CHECK_NEAR(x, s, 1e-9);
        verge_road_at(w->road, 1, s, 0.0, &x, &y, &heading);
        CHECK_NEAR(heading, atan2(4.0, 3.0), 1e-12);
        CHECK_NEAR(x, 10.0 + 0.6 * s, 1e-9);
    }
    CHECK_NEAR(verge_road_length(w->road, 1), 500.0, 1e-9);
    world_free(w);
}

static void test_a_line_does_not_follow_the_noise_of_its_survey(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("noise");
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        world* w = world_new();
        add_lane(w, -1, -1);
        for (int i = 0; i <= 66; ++i) { // a decimetre to each side, as recorded maps have it
            add_point(w, 6.0 * i, test_rng_between(&rng, -0.1, 0.1));
        }
        const vg_lane* lane = &build(w)->lanes[0];
        for (double s = 0.0; s < lane->length; s += 0.5) {
            CHECK_AT_MOST(fabs(vg_lane_at(lane, s).curvature), 0.002);
        }
        world_free(w);
    }
}

/// Points of a road of `length` every `spacing` metres: straights and bends of 400 m radius in
/// turn, and noise of up to `noise` to each side.
static double (*survey_of(double length, double spacing, double noise, test_rng* rng,
                          uint32_t* count))[2]
{
    *count = (uint32_t)(length / spacing) + 1;
    double (*points)[2] = calloc(*count, sizeof *points);
    double x = 0.0, y = 0.0, heading = 0.3;
    for (uint32_t i = 0; i < *count; ++i) {
        const double part = fmod(spacing * i, 1600.0);
        const double curvature = part < 400.0 ? 0.0 : part < 800.0 ? 1.0 / 400.0
                                 : part < 1200.0 ? 0.0 : -1.0 / 400.0;
        points[i][0] = x + test_rng_between(rng, -noise, noise);
        points[i][1] = y + test_rng_between(rng, -noise, noise);
        heading += curvature * spacing;
        x += spacing * cos(heading);
        y += spacing * sin(heading);
    }
    return points;
}

static void test_a_dense_survey_of_a_long_road_is_fitted_as_a_coarse_one(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("dense surveys");
    static const double spacings[] = { 0.1, 0.2, 0.5, 1.0, 5.0 };
    for (uint32_t i = 0; i < sizeof spacings / sizeof spacings[0]; ++i) {
        uint32_t count;
        const double noise = spacings[i] < 1.0 ? 0.02 : 0.05;
        double (*points)[2] = survey_of(12e3, spacings[i], noise, &rng, &count);
        world* w = world_new();
        add_lane(w, -1, -1);
        w->lanes[0].points = (const double(*)[2])points;
        w->lanes[0].point_count = count;
        const vg_lane* lane = &build(w)->lanes[0];
        CHECK_NEAR(lane->length, 12e3, 12.0);
        CHECK_AT_MOST(verge_road_deviation(w->road, 0), 0.3);
        for (double s = 5.0; s < lane->length - 5.0; s += 0.7) {
            CHECK_AT_MOST(fabs(vg_lane_at(lane, s).curvature), 1.0 / 400.0 + 0.004);
            CHECK_NEAR(vg_lane_s(lane, vg_lane_station(lane, s)), s, 2e-3);
        }
        world_free(w);
        free(points);
    }
}

static void test_the_deviation_is_that_of_the_point_furthest_from_the_line(void** state)
{
    (void)state;
    world* w = world_new(); // a straight lane, and one with a corner that no line can follow
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 0.0, 100.0, 0.0);
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 50.0, 40.0, 50.0);
    add_point(w, 0.0, 80.0);
    build(w);
    CHECK_NEAR(verge_road_deviation(w->road, 0), 0.0, 1e-9);
    double furthest = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double* p = w->points[1][i];
        double nearest = 1e9;
        for (double s = 0.0; s <= w->road->lanes[1].length; s += 0.001) {
            const vg_reference at = vg_lane_at(&w->road->lanes[1], s);
            nearest = fmin(nearest, hypot(at.x - p[0], at.y - p[1]));
        }
        furthest = fmax(furthest, nearest);
    }
    CHECK_NEAR(verge_road_deviation(w->road, 1), furthest, 1e-3);
    CHECK_BETWEEN(furthest, 0.05, 5.0);
    world_free(w);
}

static void test_a_coarse_circle_is_a_circle(void** state)
{
    (void)state;
    for (int pieces = 12; pieces <= 24; pieces += 6) {
        world* w = world_new();
        add_lane(w, -1, -1);
        add_arc(w, 8.0, 0.0, 2.0 * VG_PI, pieces);
        leads_to(w, 0, 0); // a ring of one lane
        const vg_lane* lane = &build(w)->lanes[0];
        // Between 12 points the chords leave the circle by 0.27 m: the line lies between both.
        const double tolerance = pieces == 12 ? 0.21 : 0.08;
        CHECK_NEAR(lane->length, 16.0 * VG_PI, 1.2);
        for (double s = 0.0; s < lane->length; s += 0.5) {
            const vg_reference at = vg_lane_at(lane, s);
            CHECK_NEAR(hypot(at.x, at.y), 8.0, tolerance);
            CHECK_NEAR(at.curvature, 0.125, 0.015);
        }
        CHECK_NEAR(relation(w, 0, 0).period, lane->length, 0.01);
        world_free(w);
    }
}

static void test_lanes_that_continue_one_to_one_join_smoothly(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("seams");
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        world* w = world_new();
        add_random_lane(w, &rng, 300.0);
        const uint32_t n = w->lanes[0].point_count, cut = n / 3 + test_rng_below(&rng, n / 3);
        add_lane(w, -1, -1); // the second lane takes the rest of the first one's points
        for (uint32_t i = cut; i < n; ++i) {
            add_point(w, w->points[0][i][0], w->points[0][i][1]);
        }
        w->lanes[0].point_count = cut + 1;
        leads_to(w, 0, 1);
        build(w);
        const vg_lane *first = &w->road->lanes[0], *second = &w->road->lanes[1];
        const vg_reference a = vg_lane_at(first, first->length), b = vg_lane_at(second, 0.0);
        CHECK_NEAR(a.x, b.x, 1e-9);
        CHECK_NEAR(a.y, b.y, 1e-9);
        CHECK_NEAR(a.sin_heading * b.cos_heading - a.cos_heading * b.sin_heading, 0.0, 1e-9);
        CHECK_NEAR(a.curvature, b.curvature, 1e-9);
        world_free(w);
    }
}

// ------------------------------------------------------------------------------ projection

static void test_projection_undoes_position(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("projection");
    for (uint32_t round = 0; round < test_rounds(30); ++round) {
        world* w = world_new();
        add_random_lane(w, &rng, 150.0);
        const vg_lane* lane = &build(w)->lanes[0];
        double sharpest = 0.01;
        for (double s = 0.0; s < lane->length; s += 0.1) {
            sharpest = fmax(sharpest, fabs(vg_lane_at(lane, s).curvature));
        }
        const double reach = fmin(0.7 / sharpest, 12.0);
        for (int i = 0; i < 200; ++i) {
            const double s = test_rng_between(&rng, -10.0, lane->length + 10.0);
            const double d = test_rng_between(&rng, -reach, reach);
            const vg_reference at = vg_lane_at(lane, s);
            const double x = at.x - d * at.sin_heading, y = at.y + d * at.cos_heading;
            CHECK_NEAR(vg_lane_project(lane, x, y, s + test_rng_between(&rng, -3.0, 3.0)), s, 1e-6);
            const verge_lane_position found = verge_road_project_on(w->road, 0, x, y);
            const vg_reference there = vg_lane_at(lane, found.s); // a loop may pass nearer by
            assert_true(fabs(found.d) <= fabs(d) + 1e-6 || found.s < 0.0
                        || found.s > lane->length);
            CHECK_NEAR(there.x - found.d * there.sin_heading, x, 1e-6);
            CHECK_NEAR(there.y + found.d * there.cos_heading, y, 1e-6);
        }
        world_free(w);
    }
}

static void test_a_body_is_on_the_lane_that_fits_its_heading(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, -100.0, 0.0, 100.0, 0.0);
    add_lane(w, -1, -1);
    add_straight(w, 0.0, -100.0, 0.0, 100.0);
    build(w);
    assert_int_equal(verge_road_project(w->road, 0.5, 0.5, 0.1, VERGE_NO_LANE).lane_id, 0);
    assert_int_equal(verge_road_project(w->road, 0.5, 0.5, 1.4, VERGE_NO_LANE).lane_id, 1);
    assert_int_equal(verge_road_project(w->road, 0.5, 0.5, 1.4, 0).lane_id, 0);
    const verge_lane_position edge = verge_road_project(w->road, 50.0, 3.0, 0.0, VERGE_NO_LANE);
    assert_int_equal(edge.lane_id, 0); // 1.25 m beside the edge
    assert_false(edge.contained);
    assert_int_equal(verge_road_project(w->road, 50.0, 4.0, 0.0, 0).lane_id, VERGE_NO_LANE);
    assert_int_equal(verge_road_project(w->road, NAN, 4.0, 0.0, 0).lane_id, VERGE_NO_LANE);
    world_free(w);
}

// ------------------------------------------------------------------------------ the graph

static void test_neighbours_share_stations_and_know_their_gaps(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, 1, -1);
    add_straight(w, 0.0, 0.0, 400.0, 0.0);
    verge_lane_def* left = add_lane(w, -1, 0); // an acceleration lane, beside from 100 to 300 m
    add_straight(w, 100.0, 3.5, 300.0, 3.5);
    left->change_right_given = true;
    left->change_right_count = 1;
    left->change_right[0] = (verge_stretch){ 50.0, 120.0 };
    build(w);
    const vg_lane *main = &w->road->lanes[0], *side = &w->road->lanes[1];
    assert_int_equal(main->bundle, side->bundle);
    CHECK_NEAR(vg_lane_station(main, 130.0), vg_lane_station(side, 30.0), 1e-3);
    CHECK_NEAR(vg_lane_s(side, vg_lane_station(side, 77.0)), 77.0, 1e-3);
    CHECK_NEAR(side->bins[3].lateral - main->bins[28].lateral, 3.5, 1e-3);
    for (uint32_t i = 0; i < main->bin_count; ++i) {
        const double s = (double)main->bins[i].s;
        const bool beside = s >= 100.0 - 1e-3 && s <= 300.0 + 1e-3;
        CHECK_NEAR(main->bins[i].left_gap, beside ? 3.5 : 0.0, 1e-3);
        CHECK_NEAR(main->bins[i].right_gap, 0.0, 0.0);
    }
    for (uint32_t i = 0; i < side->bin_count; ++i) {
        const double s = (double)side->bins[i].s;
        CHECK_NEAR(side->bins[i].right_gap, s >= 50.0 && s <= 120.0 ? 3.5 : 0.0, 1e-3);
    }
    assert_true(side->dead_end);
    assert_false(main->dead_end);
    assert_int_equal(vg_road_turn(w->road, 1, 0), -1);
    assert_int_equal(vg_road_changes(w->road, 1, 0), 1);
    assert_int_equal(relation(w, 0, 1).kind, VG_SAME_BUNDLE);
    assert_int_equal(conflict_count(w), 0);
    world_free(w);
}

static void test_concentric_lanes_are_side_by_side_at_equal_stations(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, 1, -1);
    add_arc(w, 53.5, 0.0, 3.0, 40);
    add_lane(w, -1, 0);
    add_arc(w, 50.0, 0.0, 3.0, 40);
    build(w);
    const vg_lane *outer = &w->road->lanes[0], *inner = &w->road->lanes[1];
    for (double angle = 0.1; angle < 2.9; angle += 0.1) {
        const double so = vg_lane_project(outer, 53.5 * cos(angle), 53.5 * sin(angle), NAN);
        const double si = vg_lane_project(inner, 50.0 * cos(angle), 50.0 * sin(angle), NAN);
        CHECK_NEAR(vg_lane_station(outer, so), vg_lane_station(inner, si), 0.2);
    }
    world_free(w);
}

/// Bends at 2.5 m/s^2 across, the limit elsewhere, and never a drop that asks for more than
/// 0.5 m/s^2, over the seam into a slower lane neither.
static void test_speeds_fall_before_bends_and_slower_lanes(void** state)
{
    (void)state;
    world* w = world_new();
    verge_lane_def* bend = add_lane(w, VERGE_NO_LANE, VERGE_NO_LANE);
    bend->speed_limit = 20.0;
    add_straight(w, -400.0, -15.0, 0.0, -15.0);
    add_arc(w, 15.0, -0.5 * VG_PI, 0.5 * VG_PI, 60);
    add_straight(w, 0.0, 15.0, -500.0, 15.0);
    leads_to(w, 0, 1);
    verge_lane_def* slow = add_lane(w, VERGE_NO_LANE, VERGE_NO_LANE);
    slow->speed_limit = 6.0;
    add_straight(w, -500.0, 15.0, -700.0, 15.0);
    build(w);
    const vg_lane* lane = &w->road->lanes[0];
    double least = 100.0, most = 0.0;
    for (uint32_t i = 0; i + 1 < lane->bin_count; ++i) {
        const vg_bin *here = &lane->bins[i], *next = here + 1;
        const double curvature = fabs(vg_lane_at(lane, (double)here->s).curvature);
        CHECK_AT_MOST(here->speed, 20.0);
        CHECK_AT_MOST((double)here->speed * here->speed * curvature, 2.5 + 1e-3);
        const double drop = (double)here->speed * here->speed - (double)next->speed * next->speed;
        CHECK_AT_MOST(drop / (2.0 * (next->s - here->s)), 0.5 + 1e-3);
        least = fmin(least, here->speed);
        most = fmax(most, here->speed);
    }
    CHECK_NEAR(most, 20.0, 1e-6);
    CHECK_NEAR(least, sqrt(2.5 * 15.0), 0.4);
    CHECK_AT_MOST(lane->bins[lane->bin_count - 1].speed, 6.0 + 0.5);
    CHECK_NEAR(lane->speed_min, least, 1e-6);
    world_free(w);
}

static void test_a_merge_aligns_both_lanes_at_its_point(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 0.0, 200.0, 0.0);
    add_lane(w, -1, -1);
    add_straight(w, 200.0, 0.0, 500.0, 0.0);
    add_lane(w, -1, -1);
    add_point(w, 0.0, -30.0);
    add_point(w, 100.0, -15.0);
    add_point(w, 150.0, -5.0);
    add_point(w, 175.0, -1.0);
    add_point(w, 200.0, 0.0);
    leads_to(w, 0, 1);
    leads_to(w, 2, 1);
    build(w);
    const vg_lane *main = &w->road->lanes[0], *ramp = &w->road->lanes[2];
    const vg_relation merging = relation(w, 0, 2);
    assert_int_equal(relation(w, 0, 1).kind, VG_DOWNSTREAM);
    assert_int_equal(relation(w, 1, 2).kind, VG_UPSTREAM);
    assert_int_equal(merging.kind, VG_MERGING);
    CHECK_NEAR(ramp->station_end + (double)merging.offset, main->station_end, 0.01);
    CHECK_BETWEEN(merging.touch, 150.0, 180.0); // 2.6 m apart there
    assert_int_equal(conflict_count(w), 0);

    const vg_lane* after = &w->road->lanes[1];
    const vg_reference a = vg_lane_at(ramp, ramp->length), b = vg_lane_at(after, 0.0);
    CHECK_NEAR(hypot(a.x - b.x, a.y - b.y), 0.0, 0.01);
    CHECK_NEAR(a.sin_heading * b.cos_heading - a.cos_heading * b.sin_heading, 0.0, 0.01);
    world_free(w);
}

static void test_after_a_diverge_the_branch_not_taken_is_ignored(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 0.0, 200.0, 0.0);
    add_lane(w, -1, -1);
    add_straight(w, 200.0, 0.0, 500.0, 0.0);
    add_lane(w, -1, -1);
    add_point(w, 200.0, 0.0);
    add_point(w, 250.0, -2.0);
    add_point(w, 300.0, -10.0);
    add_point(w, 400.0, -40.0);
    leads_to(w, 0, 1);
    leads_to(w, 0, 2);
    build(w);
    assert_int_equal(relation(w, 1, 2).kind, VG_UNRELATED);
    assert_int_equal(verge_road_next(w->road, 0, 2), 2);
    assert_int_equal(verge_road_next(w->road, 0, 1), 1);
    assert_int_equal(verge_road_next(w->road, 0, VERGE_NO_LANE), 1);
    assert_int_equal(verge_road_next(w->road, 2, 1), VERGE_NO_LANE);
    assert_true(verge_road_continues(w->road, 0, 2));
    assert_false(verge_road_continues(w->road, 1, 2));
    assert_false(verge_road_continues(w->road, 2, 0));
    assert_int_equal(vg_road_changes(w->road, 1, 2), 255);
    assert_true(matters(w, 0, 2, 0) && matters(w, 0, 2, 2) && !matters(w, 0, 2, 1));
    assert_true(matters(w, 0, 1, 0) && matters(w, 0, 1, 1) && !matters(w, 0, 1, 2));
    world_free(w);
}

static void test_a_crossing_conflicts_where_it_crosses_as_often_as_it_does(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, -100.0, 0.0, 100.0, 0.0);
    add_lane(w, -1, -1); // there, round a half circle, and back
    add_point(w, -30.0, -100.0);
    add_point(w, -30.0, 0.0);
    for (int i = 0; i <= 12; ++i) {
        const double a = VG_PI - VG_PI * i / 12.0;
        add_point(w, 30.0 * cos(a), 20.0 + 30.0 * sin(a));
    }
    add_point(w, 30.0, -100.0);
    build(w);
    assert_int_equal(conflict_count(w), 4); // two, in both orders
    assert_true(vg_road_has_conflicts(w->road, 0) && vg_road_has_conflicts(w->road, 1));
    for (int i = 0; i < 2; ++i) {
        const vg_conflict* c = &w->road->conflicts[i];
        const double middle = vg_lane_s(&w->road->lanes[0], 0.5 * (double)(c->from + c->to));
        assert_int_equal(c->other, 1);
        CHECK_NEAR(middle, i == 0 ? 70.0 : 130.0, 1.5);
        CHECK_BETWEEN(c->to - c->from, 3.0, 9.0);
        CHECK_BETWEEN(c->other_to - c->other_from, 3.0, 9.0);
    }
    CHECK_NEAR(0.5 * (double)(w->road->conflicts[0].other_from + w->road->conflicts[0].other_to),
               100.0, 1.5);
    world_free(w);
}

static void test_a_ring_of_four_arcs_is_closed(void** state)
{
    (void)state;
    world* w = world_new();
    for (int i = 0; i < 4; ++i) {
        add_lane(w, -1, -1);
        add_arc(w, 12.0, 0.5 * VG_PI * i, 0.5 * VG_PI * (i + 1), 4);
        leads_to(w, (uint32_t)i, (i + 1) % 4);
    }
    add_lane(w, -1, -1); // an entry along the tangent of the first arc's start
    add_straight(w, 12.0, -60.0, 12.0, 0.0);
    leads_to(w, 4, 0);
    build(w);
    double round = 0.0;
    for (uint32_t i = 0; i < 4; ++i) {
        round += w->road->lanes[i].length;
    }
    CHECK_NEAR(round, 24.0 * VG_PI, 0.3);
    for (uint32_t i = 0; i < 4; ++i) {
        CHECK_NEAR(relation(w, i, (i + 1) % 4).period, round, 0.01);
        assert_int_equal(relation(w, i, (i + 1) % 4).kind, VG_DOWNSTREAM);
        assert_int_equal(relation(w, i, (i + 3) % 4).kind, VG_UPSTREAM);
        assert_int_equal(w->road->lanes[i].dead_end, false);
    }
    assert_int_equal(relation(w, 4, 0).kind, VG_DOWNSTREAM);
    assert_int_equal(relation(w, 4, 3).kind, VG_MERGING);
    CHECK_NEAR(relation(w, 4, 3).period, 0.0, 0.0);
    CHECK_NEAR(w->road->lanes[3].station_end + (double)relation(w, 4, 3).offset,
               w->road->lanes[4].station_end, 0.01);
    world_free(w);
}

static void test_routes_take_the_fewest_changes_and_go_on_across_sections(void** state)
{
    (void)state;
    world* w = world_new(); // two sections of two lanes; the right one exits at the end
    add_lane(w, 1, -1);
    add_straight(w, 0.0, 0.0, 300.0, 0.0);
    add_lane(w, -1, 0);
    add_straight(w, 0.0, 3.5, 300.0, 3.5);
    add_lane(w, 3, -1);
    add_straight(w, 300.0, 0.0, 600.0, 0.0);
    add_lane(w, -1, 2);
    add_straight(w, 300.0, 3.5, 600.0, 3.5);
    add_lane(w, -1, -1);
    add_straight(w, 600.0, 3.5, 900.0, 3.5);
    leads_to(w, 0, 2);
    leads_to(w, 1, 3);
    leads_to(w, 3, 4);
    build(w);
    assert_int_equal(vg_road_changes(w->road, 0, 4), 1);
    assert_int_equal(vg_road_turn(w->road, 0, 4), 1);
    assert_int_equal(vg_road_changes(w->road, 1, 4), 0);
    assert_int_equal(vg_road_turn(w->road, 1, 4), 0);
    assert_int_equal(vg_road_changes(w->road, 1, 2), 1);
    assert_int_equal(vg_road_turn(w->road, 1, 2), -1);
    assert_true(w->road->lanes[2].dead_end); // its neighbour goes on
    assert_false(w->road->lanes[3].dead_end);
    assert_false(w->road->lanes[4].dead_end); // no lane beside it continues
    assert_int_equal(relation(w, 0, 3).kind, VG_DOWNSTREAM);
    CHECK_NEAR(relation(w, 0, 3).offset, 300.0, 0.01);
    CHECK_NEAR((double)relation(w, 0, 3).lateral + (double)w->road->lanes[3].bins[0].lateral
                   - (double)w->road->lanes[0].bins[0].lateral, 3.5, 0.01);
    world_free(w);
}

// ------------------------------------------------------------------------------ paths

static void test_a_path_is_its_anchor_and_smooth_beyond_it(void** state)
{
    (void)state;
    world* w = world_new(); // a ramp that meets a bend with a step of 0.3 m
    add_lane(w, -1, -1);
    add_straight(w, 0.0, -0.3, 100.0, -0.3);
    add_lane(w, -1, -1);
    for (int i = 0; i <= 20; ++i) {
        const double a = 0.1 * i;
        add_point(w, 100.0 + 60.0 * sin(a), 60.0 - 60.0 * cos(a));
    }
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 8.0, 100.0, 0.0);
    leads_to(w, 0, 1);
    leads_to(w, 2, 1);
    build(w);
    TEST_PATH(path);
    for (uint32_t anchor = 0; anchor < 3; ++anchor) {
        vg_path_build(&path, w->road, anchor, -1, -80.0, 260.0);
        const vg_lane* lane = &w->road->lanes[anchor];
        for (double s = 0.5; s < lane->length - 0.5; s += 0.9) {
            const vg_reference a = vg_lane_at(lane, s), b = vg_path_at(&path, s);
            CHECK_NEAR(a.x, b.x, 2e-3);
            CHECK_NEAR(a.y, b.y, 2e-3);
            CHECK_NEAR(a.curvature, b.curvature, 0.01);
        }
        for (double s = -79.0; s < 259.0; s += 0.3) {
            const vg_reference a = vg_path_at(&path, s - 1e-4), b = vg_path_at(&path, s + 1e-4);
            CHECK_NEAR(hypot(b.x - a.x, b.y - a.y) / 2e-4, 1.0, 1e-4);
            CHECK_AT_MOST(fabs(vg_path_at(&path, s).curvature), 0.09);
            CHECK_NEAR(vg_path_project(&path, b.x, b.y, s), s + 1e-4, 1e-9);
        }
    }
    world_free(w);
}

static double sharpest(const vg_lane* lane)
{
    double found = 0.0;
    for (double s = 0.0; s < lane->length; s += 0.05) {
        found = fmax(found, fabs(vg_lane_at(lane, s).curvature));
    }
    return found;
}

// A straight lane and an arc of a circle meet with a step of the curvature.
static void test_steering_can_follow_a_path_from_a_straight_lane_into_a_bend(void** state)
{
    (void)state;
    for (int k = 0; k < 40; ++k) {
        const double radius = 8.0 + k, side = k % 2 == 0 ? 1.0 : -1.0;
        world* w = world_new();
        add_lane(w, -1, -1);
        add_straight(w, -60.0, 0.0, 0.0, 0.0);
        add_lane(w, -1, -1);
        for (int i = 0; i <= 20; ++i) {
            const double a = 0.08 * i;
            add_point(w, radius * sin(a), side * radius * (1.0 - cos(a)));
        }
        add_lane(w, -1, -1); // the lane that the straight one is fitted with
        add_straight(w, 0.0, 0.0, 60.0, 0.0);
        leads_to(w, 0, 2);
        leads_to(w, 0, 1);
        build(w);
        TEST_PATH(path);
        vg_path_build(&path, w->road, 0, 1, 20.0, 60.0 + radius);
        double fastest = 0.0, peak = 0.0;
        for (double s = 21.0; s < 58.0 + radius; s += 0.1) {
            const vg_reference at = vg_path_at(&path, s), on = vg_path_at(&path, s + 0.1);
            fastest = fmax(fastest, fabs(on.curvature - at.curvature) / 0.1);
            const bool ahead = s > w->road->lanes[0].length;
            const vg_lane* lane = &w->road->lanes[ahead ? 1 : 0];
            const vg_reference there = vg_lane_at(lane, vg_lane_project(lane, at.x, at.y, NAN));
            CHECK_AT_MOST(hypot(at.x - there.x, at.y - there.y), 0.02);
            peak = fmax(peak, fabs(at.curvature));
        }
        CHECK_AT_MOST(peak, 1.02 * sharpest(&w->road->lanes[1]));
        CHECK_AT_MOST(fastest, 0.42 / radius); // [1/m^2], from 0.6 / radius without smoothing
        world_free(w);
    }
}

static void test_a_path_goes_straight_on_where_the_road_ends(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, -1, -1);
    add_straight(w, 0.0, 0.0, 100.0, 0.0);
    build(w);
    TEST_PATH(path);
    vg_path_build(&path, w->road, 0, -1, 50.0, 650.0);
    const vg_reference at = vg_path_at(&path, 600.0);
    CHECK_NEAR(at.x, 600.0, 1e-9);
    CHECK_NEAR(at.y, 0.0, 1e-9);
    CHECK_NEAR(at.curvature, 0.0, 1e-12);
    world_free(w);
}

// ------------------------------------------------------------------------------ refusals

static void refused(world* w, const char* field, const char* word)
{
    const verge_road_def def = { .lanes = w->lanes, .lane_count = w->count };
    verge_road_fault fault;
    assert_int_equal(verge_road_check(&def, &fault), VERGE_ERR_ROAD);
    assert_string_equal(fault.field, field);
    if (strstr(fault.text, word) == NULL) {
        fail_msg("\"%s\" does not speak of \"%s\"", fault.text, word);
    }
}

static world* two_lanes(void)
{
    world* w = world_new();
    add_lane(w, 1, -1);
    add_straight(w, 0.0, 0.0, 100.0, 0.0);
    add_lane(w, -1, 0);
    add_straight(w, 0.0, 3.5, 100.0, 3.5);
    return w;
}

static void test_every_broken_road_is_refused_with_its_reason(void** state)
{
    (void)state;
#define REFUSED(change, field, word)        \
    do {                                    \
        world* w = two_lanes();             \
        verge_lane_def* lane = w->lanes;    \
        change;                             \
        refused(w, field, word);            \
        world_free(w);                      \
        (void)lane;                         \
    } while (0)

    REFUSED(w->count = 0, "lanes", "at least one");
    REFUSED(lane->id = -3, "id", "0 or more");
    REFUSED(w->lanes[1].id = 0, "id", "unique");
    REFUSED(lane->point_count = 1, "centerline", "two points");
    REFUSED(lane->point_count = VERGE_LANE_POINTS_MAX + 1, "centerline", "VERGE_LANE_POINTS_MAX");
    REFUSED(w->points[0][1][1] = NAN, "centerline", "finite");
    REFUSED(w->points[0][1][1] = INFINITY, "centerline", "finite");
    REFUSED(w->points[0][1][0] = 1e9, "centerline", "origin");
    REFUSED(w->points[0][1][0] = 0.0, "centerline", "coincide");
    REFUSED(w->points[0][1][0] = 1e5 + 1.0, "centerline", "100000 m");
    REFUSED(lane->width = 1.0, "width", "1.5 to 20");
    REFUSED(lane->width = NAN, "width", "1.5 to 20");
    REFUSED(lane->speed_limit = 61.0, "speed_limit", "0.5 to 60");
    REFUSED(lane->left = 0, "left", "its own");
    REFUSED(lane->left = 7, "left", "does not exist");
    REFUSED(lane->right = 7, "right", "does not exist");
    REFUSED(lane->right = 1, "right", "left and on the right");
    REFUSED(leads_to(w, 0, 9), "successors", "does not exist");
    REFUSED(lane->successor_count = 9, "successors", "8");
    REFUSED((leads_to(w, 0, 0), w->points[0][1][0] = 15.0, leads_to(w, 0, 0)), "successors",
            "twice");
    REFUSED(leads_to(w, 0, 1), "successors", "within 20 m");
    REFUSED((lane->change_left_given = true, lane->change_left_count = 9), "change_left", "8");
    REFUSED((lane->change_left_given = true, lane->change_left_count = 1,
             lane->change_left[0] = (verge_stretch){ 60.0, 50.0 }), "change_left", "s0 < s1");
    REFUSED((lane->change_left_given = true, lane->change_left_count = 1,
             lane->change_left[0] = (verge_stretch){ 60.0, 60.0 }), "change_left", "s0 < s1");
    REFUSED((lane->change_left_given = true, lane->change_left_count = 1,
             lane->change_left[0] = (verge_stretch){ 101.0, 102.0 }), "change_left", "within");
    REFUSED((lane->change_left_given = true, lane->change_left_count = 2,
             lane->change_left[0] = (verge_stretch){ 40.0, 60.0 },
             lane->change_left[1] = (verge_stretch){ 10.0, 41.0 }), "change_left", "overlap");
    REFUSED((lane = &w->lanes[1], lane->change_right_given = true, lane->change_right_count = 1,
             lane->change_right[0] = (verge_stretch){ 60.0, 150.0 }), "change_right", "within");
    REFUSED((lane = &w->lanes[1], lane->change_right_given = true, lane->change_right_count = 1,
             lane->change_right[0] = (verge_stretch){ NAN, 50.0 }), "change_right", "finite");
    REFUSED((lane->change_right_given = true, lane->change_right_count = 1,
             lane->change_right[0] = (verge_stretch){ 10.0, 50.0 }), "change_right", "neighbour");
    REFUSED((lane = &w->lanes[1], lane->change_left_given = true, lane->change_left_count = 1,
             lane->change_left[0] = (verge_stretch){ 10.0, 50.0 }), "change_left", "neighbour");
#undef REFUSED
    world* w = two_lanes();
    const verge_road_def def = { .lanes = w->lanes, .lane_count = w->count };
    verge_road_fault fault = { .field = "left over" };
    assert_int_equal(verge_road_check(&def, &fault), VERGE_OK);
    assert_null(fault.field);
    world_free(w);
}

static void test_questions_about_no_lane_have_answers(void** state)
{
    (void)state;
    world* w = two_lanes();
    build(w);
    const verge_road* road = w->road;
    static const int32_t unknown[] = { 2, -1, -7, 1 << 30, INT32_MIN };
    for (uint32_t i = 0; i < sizeof unknown / sizeof unknown[0]; ++i) {
        const int32_t id = unknown[i];
        double x = 1.0, y = 2.0, heading = 3.0;
        assert_false(verge_road_at(road, id, 1.0, 0.0, &x, &y, &heading));
        assert_true(x == 1.0 && y == 2.0 && heading == 3.0);
        assert_int_equal(verge_road_project_on(road, id, 1.0, 0.0).lane_id, VERGE_NO_LANE);
        assert_int_equal(verge_road_project(road, 1.0, 0.0, 0.0, id).lane_id, 0);
        assert_true(verge_road_length(road, id) == 0.0 && verge_road_width(road, id) == 0.0);
        assert_true(verge_road_speed_limit(road, id) == 0.0 && verge_road_deviation(road, id) == 0.0);
        assert_int_equal(verge_road_next(road, id, 0), VERGE_NO_LANE);
        assert_int_equal(verge_road_next(road, 0, id), VERGE_NO_LANE);
        assert_false(verge_road_continues(road, id, 0) || verge_road_continues(road, 0, id));
    }
    static const double bad[] = { NAN, INFINITY, -INFINITY };
    for (uint32_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        double x, y, heading;
        assert_false(verge_road_at(road, 0, bad[i], 0.0, &x, &y, &heading));
        assert_false(verge_road_at(road, 0, 0.0, bad[i], &x, &y, &heading));
        assert_int_equal(verge_road_project(road, bad[i], 0.0, 0.0, 0).lane_id, VERGE_NO_LANE);
        assert_int_equal(verge_road_project(road, 0.0, bad[i], 0.0, 0).lane_id, VERGE_NO_LANE);
        assert_int_equal(verge_road_project(road, 0.0, 0.0, bad[i], 0).lane_id, VERGE_NO_LANE);
        assert_int_equal(verge_road_project_on(road, 0, bad[i], 0.0).lane_id, VERGE_NO_LANE);
        assert_int_equal(verge_road_project_on(road, 0, 0.0, bad[i]).lane_id, VERGE_NO_LANE);
    }
    assert_int_equal(verge_road_check(NULL, NULL), VERGE_ERR_ROAD);
    world_free(w);
}

static void test_a_default_lane_needs_points_only_and_zeros_are_refused(void** state)
{
    (void)state;
    static const double points[2][2] = { { 0.0, 0.0 }, { 50.0, 0.0 } };
    for (int32_t id = 0; id < 3; ++id) {
        verge_lane_def lanes[3];
        for (int32_t i = 0; i < 3; ++i) {
            lanes[i] = verge_lane_def_default();
            lanes[i].id = i;
            lanes[i].points = points;
            lanes[i].point_count = 2;
        }
        const verge_road_def def = { lanes, 3 };
        assert_int_equal(verge_road_check(&def, NULL), VERGE_OK);
        lanes[id] = (verge_lane_def){ .id = id, .points = points, .point_count = 2, .width = 3.5,
                                      .speed_limit = 13.9 };
        verge_road_fault fault;
        assert_int_equal(verge_road_check(&def, &fault), VERGE_ERR_ROAD);
        assert_int_equal(fault.lane_index, id);
        assert_non_null(strstr(fault.text, "VERGE_NO_LANE"));
    }
}

static bool accepted(const world* w)
{
    const verge_road_def def = { .lanes = w->lanes, .lane_count = w->count };
    return verge_road_check(&def, NULL) == VERGE_OK;
}

static void test_a_centreline_may_turn_sharply_but_not_double_back(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sharp turns");
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        // One corner between two legs, anywhere, with points nearer than the noise around it.
        const double heading = test_rng_between(&rng, -3.1, 3.1);
        const double turn = test_rng_between(&rng, 0.0, 3.14159) * (round % 2 == 0 ? 1.0 : -1.0);
        const double back = heading + turn;
        const double leg = test_rng_between(&rng, 1.0, 50.0), jitter = round % 3 == 0 ? 0.1 : 0.0;
        world* w = world_new();
        add_lane(w, -1, -1);
        add_point(w, 0.0, 0.0);
        add_point(w, 20.0 * cos(heading), 20.0 * sin(heading));
        add_point(w, (20.0 - jitter) * cos(heading), (20.0 - jitter) * sin(heading));
        add_point(w, 20.0 * cos(heading), 20.0 * sin(heading));
        add_point(w, 20.0 * cos(heading) + leg * cos(back), 20.0 * sin(heading) + leg * sin(back));
        const double degrees = fabs(turn) * 180.0 / 3.14159265358979;
        if (degrees > 150.001) {
            refused(w, "centerline", "doubles back");
        } else if (degrees < 149.999 && !accepted(w)) {
            fail_msg("a turn of %g degrees is refused", degrees);
        }
        world_free(w);
    }
}

static void test_a_successor_goes_on_within_ninety_degrees(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("successors");
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        const double end = test_rng_between(&rng, -3.1, 3.1);
        // Every fourth is a corner of a block, whatever rounding makes of it.
        const double turn = round % 4 == 0 ? 1.5707963267948966
                                           : test_rng_between(&rng, -3.14159, 3.14159);
        const double gap = test_rng_between(&rng, 0.0, 19.0);
        world* w = world_new();
        add_lane(w, -1, -1); // its last step is shorter than what tells a direction, and backwards
        add_straight(w, 0.0, 0.0, 50.0 * cos(end), 50.0 * sin(end));
        add_point(w, 49.9 * cos(end), 49.9 * sin(end));
        leads_to(w, 0, 1);
        add_lane(w, -1, -1);
        const double x = (49.9 + gap) * cos(end), y = (49.9 + gap) * sin(end);
        add_straight(w, x, y, x + 30.0 * cos(end + turn), y + 30.0 * sin(end + turn));
        const double degrees = fabs(turn) * 180.0 / 3.14159265358979;
        if (degrees > 90.001) {
            refused(w, "successors", "within 90 degrees");
        } else if ((degrees < 89.999 || round % 4 == 0) && !accepted(w)) {
            fail_msg("a successor at %g degrees is refused", degrees);
        }
        world_free(w);
    }
}

static void test_stretches_may_touch_and_an_empty_list_needs_no_neighbour(void** state)
{
    (void)state;
    world* w = two_lanes();
    w->lanes[0].change_left_given = true;
    w->lanes[0].change_left_count = 3;
    w->lanes[0].change_left[0] = (verge_stretch){ 50.0, 103.0 }; // "to the end", measured roughly
    w->lanes[0].change_left[1] = (verge_stretch){ 0.0, 20.0 };
    w->lanes[0].change_left[2] = (verge_stretch){ 20.0, 50.0 };
    w->lanes[0].change_right_given = true;
    assert_true(accepted(w));
    world_free(w);
}

/// One number of a built road is changed: it does not hold any more.
#define CHECK_BREAKS(number, wrong)                \
    do {                                           \
        const double kept = (double)(number);      \
        (number) = (wrong);                        \
        assert_false(vg_road_holds(w->road));      \
        (number) = kept;                           \
        assert_true(vg_road_holds(w->road));       \
    } while (0)

static void test_a_road_with_one_wrong_number_does_not_hold(void** state)
{
    (void)state;
    world* w = world_new();
    add_lane(w, 1, -1);
    add_straight(w, 0.0, 0.0, 100.0, 0.0);
    add_lane(w, -1, 0);
    add_straight(w, 0.0, 3.5, 100.0, 3.5);
    add_lane(w, -1, -1); // crosses both
    add_straight(w, 50.0, -40.0, 50.0, 40.0);
    add_lane(w, -1, -1);
    add_straight(w, 100.0, 0.0, 200.0, 0.0);
    leads_to(w, 0, 3);
    struct verge_road* road = build(w);
    vg_lane* lane = &road->lanes[1];
    double* x = (double*)(uintptr_t)lane->line.x;
    vg_bin* bins = (vg_bin*)(uintptr_t)lane->bins;
    CHECK_BREAKS(x[5], NAN);
    CHECK_BREAKS(x[5], x[5] + 1.0);
    CHECK_BREAKS(lane->length, 99.0);
    CHECK_BREAKS(lane->station_end, lane->station_start);
    CHECK_BREAKS(lane->station_start, lane->station_start + 1.0);
    CHECK_BREAKS(lane->bundle, LANES);
    CHECK_BREAKS(lane->left, LANES);
    CHECK_BREAKS(road->lanes[0].successors[0], 2);
    CHECK_BREAKS(road->lanes[2].id, 7);
    assert_int_equal(road->conflicts[0].other, 2);
    CHECK_BREAKS(road->conflicts[0].other, 1);
    const float s = bins[3].s, speed = bins[3].speed;
    bins[3].s = bins[2].s;
    assert_false(vg_road_holds(road));
    bins[3].s = s;
    bins[3].speed = 0.0f;
    assert_false(vg_road_holds(road));
    bins[3].speed = speed;
    assert_true(vg_road_holds(road));
    assert_false(vg_road_holds(NULL));
    world_free(w);
}

/// A random walk with jumps, sharp corners and repeated points that the check lets pass.
static void add_hostile_lane(world* w, test_rng* rng)
{
    const double reach = test_rng_below(rng, 2) == 0 ? 1.0 : 20.0;
    const uint32_t n = 2 + test_rng_below(rng, 30);
    verge_lane_def* lane = add_lane(w, -1, -1);
    do {
        double x = 0.0, y = 0.0, heading = test_rng_between(rng, -3.1, 3.1);
        lane->point_count = 0;
        add_point(w, 0.0, 0.0);
        for (uint32_t k = 1; k < n; ++k) {
            const bool repeat = test_rng_below(rng, 4) == 0;
            const double step = repeat ? 0.0 : test_rng_between(rng, 0.0, reach);
            heading += test_rng_between(rng, -2.6, 2.6);
            x += step * cos(heading);
            y += step * sin(heading);
            add_point(w, x, y);
        }
        add_point(w, 1.0, 0.0); // where the next one starts, nearly
    } while (!accepted(w));
}

static void test_every_road_that_passes_the_check_has_finite_lines(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("hostile surveys");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        world* w = world_new(); // whatever passes the check must build
        const uint32_t lanes = 1 + test_rng_below(&rng, 6);
        for (uint32_t i = 0; i < lanes; ++i) {
            add_hostile_lane(w, &rng);
        }
        for (uint32_t i = 0; i < lanes; ++i) {
            const int32_t left = (int32_t)test_rng_below(&rng, lanes);
            w->lanes[i].left = left == (int32_t)i ? -1 : left;
            leads_to(w, i, (int32_t)((i + 1) % lanes));
            if (!accepted(w)) {
                w->lanes[i].successor_count = 0; // it would turn round
            }
        }
        build(w);
        for (uint32_t i = 0; i < lanes; ++i) {
            const vg_lane* lane = &w->road->lanes[i];
            for (double s = -5.0; s < lane->length + 5.0; s += 0.7) {
                const vg_reference at = vg_lane_at(lane, s);
                assert_true(vg_finite(at.x) && vg_finite(at.y) && vg_finite(at.curvature));
                CHECK_NEAR(at.cos_heading * at.cos_heading + at.sin_heading * at.sin_heading, 1.0,
                           1e-9);
                assert_true(vg_finite(vg_lane_station(lane, s)));
                CHECK_NEAR(vg_lane_s(lane, vg_lane_station(lane, s)), s, 1e-3);
            }
        }
        world_free(w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_are_smooth_near_their_survey_and_measured_by_arc),
        cmocka_unit_test(test_a_straight_lane_is_exactly_straight),
        cmocka_unit_test(test_a_line_does_not_follow_the_noise_of_its_survey),
        cmocka_unit_test(test_a_dense_survey_of_a_long_road_is_fitted_as_a_coarse_one),
        cmocka_unit_test(test_the_deviation_is_that_of_the_point_furthest_from_the_line),
        cmocka_unit_test(test_a_coarse_circle_is_a_circle),
        cmocka_unit_test(test_lanes_that_continue_one_to_one_join_smoothly),
        cmocka_unit_test(test_projection_undoes_position),
        cmocka_unit_test(test_a_body_is_on_the_lane_that_fits_its_heading),
        cmocka_unit_test(test_neighbours_share_stations_and_know_their_gaps),
        cmocka_unit_test(test_concentric_lanes_are_side_by_side_at_equal_stations),
        cmocka_unit_test(test_speeds_fall_before_bends_and_slower_lanes),
        cmocka_unit_test(test_a_merge_aligns_both_lanes_at_its_point),
        cmocka_unit_test(test_after_a_diverge_the_branch_not_taken_is_ignored),
        cmocka_unit_test(test_a_crossing_conflicts_where_it_crosses_as_often_as_it_does),
        cmocka_unit_test(test_a_ring_of_four_arcs_is_closed),
        cmocka_unit_test(test_routes_take_the_fewest_changes_and_go_on_across_sections),
        cmocka_unit_test(test_a_path_is_its_anchor_and_smooth_beyond_it),
        cmocka_unit_test(test_steering_can_follow_a_path_from_a_straight_lane_into_a_bend),
        cmocka_unit_test(test_a_path_goes_straight_on_where_the_road_ends),
        cmocka_unit_test(test_every_broken_road_is_refused_with_its_reason),
        cmocka_unit_test(test_questions_about_no_lane_have_answers),
        cmocka_unit_test(test_a_default_lane_needs_points_only_and_zeros_are_refused),
        cmocka_unit_test(test_a_centreline_may_turn_sharply_but_not_double_back),
        cmocka_unit_test(test_a_successor_goes_on_within_ninety_degrees),
        cmocka_unit_test(test_stretches_may_touch_and_an_empty_list_needs_no_neighbour),
        cmocka_unit_test(test_a_road_with_one_wrong_number_does_not_hold),
        cmocka_unit_test(test_every_road_that_passes_the_check_has_finite_lines),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
