/// Goal: a path is its anchor lane, and beyond it one smooth line, whatever steps the survey leaves
/// between lanes.
/// Method: random chains of three lanes that do not meet exactly; the lanes' own lines as oracle on
/// the anchor and behind the steps; differences of positions for heading and curvature.
#include "base/arena.h"
#include "base/scalar.h"
#include "check.h"
#include "motion/path.h"
#include "rng.h"
#include "room.h"

#include <math.h>
#include <stdlib.h>

enum { LANES_MAX = 6, POINTS = 60 };

typedef struct chain {
    uint32_t count;
    verge_lane_def lanes[LANES_MAX];
    double points[LANES_MAX][POINTS][2];
    double x, y, heading; // where the last lane ended
    struct verge_road* road;
    void* memory[2];
} chain;

static chain c;
TEST_PATH(path);

/// A lane that begins at a point and bends evenly over its length.
static void add_bend(double x, double y, double heading, double length, double curvature)
{
    verge_lane_def* lane = &c.lanes[c.count];
    *lane = (verge_lane_def){ .id = (int32_t)c.count, .points = (const double(*)[2])c.points[c.count],
                              .point_count = POINTS, .width = 3.5, .speed_limit = 20.0,
                              .left = VERGE_NO_LANE, .right = VERGE_NO_LANE };
    for (uint32_t i = 0; i < POINTS; ++i) {
        const double s = length * i / (POINTS - 1), half = 0.5 * curvature * s;
        const double chord = fabs(half) < 1e-9 ? s : s * sin(half) / half;
        c.points[c.count][i][0] = x + chord * cos(heading + half);
        c.points[c.count][i][1] = y + chord * sin(heading + half);
    }
    c.x = c.points[c.count][POINTS - 1][0];
    c.y = c.points[c.count][POINTS - 1][1];
    c.heading = heading + curvature * length;
    ++c.count;
}

static void join(uint32_t lane, uint32_t next)
{
    c.lanes[lane].successors[c.lanes[lane].successor_count++] = (int32_t)next;
}

static void build(void)
{
    const verge_road_def def = { c.lanes, c.count };
    vg_arena measure, arena, scratch;
    vg_arena_init(&measure, NULL, 0);
    vg_road_build(&measure, NULL, &def);
    const size_t scratch_size = (vg_road_scratch_size(&def) + 63) / 64 * 64;
    c.memory[0] = aligned_alloc(64, (measure.used + 63) / 64 * 64);
    c.memory[1] = aligned_alloc(64, scratch_size);
    vg_arena_init(&arena, c.memory[0], (measure.used + 63) / 64 * 64);
    vg_arena_init(&scratch, c.memory[1], scratch_size);
    c.road = vg_road_build(&arena, &scratch, &def);
    assert_non_null(c.road);
}

static void clear(void)
{
    free(c.memory[0]);
    free(c.memory[1]);
    c = (chain){ 0 };
}

/// Three lanes in a row; each begins up to `step` beside the end of the one before, and up to
/// `gap` farther on.
static void random_chain(test_rng* rng, double step, double gap)
{
    c = (chain){ .heading = test_rng_between(rng, -3.0, 3.0) };
    for (uint32_t i = 0; i < 3; ++i) {
        const double beside = i == 0 ? 0.0 : test_rng_between(rng, -step, step);
        const double ahead = i == 0 ? 0.0 : test_rng_between(rng, 0.0, gap);
        const double turn = i == 0 ? 0.0 : test_rng_between(rng, -0.02, 0.02);
        const double length = test_rng_between(rng, 60.0, 120.0);
        const double x = c.x + ahead * cos(c.heading) - beside * sin(c.heading);
        const double y = c.y + ahead * sin(c.heading) + beside * cos(c.heading);
        add_bend(x, y, c.heading + turn, length, test_rng_between(rng, -0.01, 0.01));
        if (i > 0) {
            join(i - 1, i);
        }
    }
    build();
}

static double length_of(uint32_t lane)
{
    return c.road->lanes[lane].length;
}

/// Of the lanes' own lines, which bend towards each other's ends. [1/m]
static double sharpest_bend(void)
{
    double sharpest = 0.0;
    for (uint32_t i = 0; i < c.count; ++i) {
        for (double s = 0.0; s <= length_of(i); s += 0.1) {
            sharpest = fmax(sharpest, fabs(vg_lane_at(&c.road->lanes[i], s).curvature));
        }
    }
    return sharpest;
}

static void test_on_its_anchor_a_path_is_the_lane(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("anchor");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        random_chain(&rng, 0.7, 3.0);
        for (uint32_t anchor = 0; anchor < 3; ++anchor) {
            vg_path_build(&path, c.road, anchor, -1, -100.0, length_of(anchor) + 100.0);
            assert_int_equal(path.anchor, anchor);
            for (double s = 4.0; s < length_of(anchor) - 4.0; s += 0.7) {
                const vg_reference own = vg_lane_at(&c.road->lanes[anchor], s);
                const vg_reference at = vg_path_at(&path, s);
                CHECK_NEAR(at.x, own.x, 3e-4); // both are splines, with knots of their own
                CHECK_NEAR(at.y, own.y, 3e-4);
                CHECK_NEAR(at.cos_heading, own.cos_heading, 1e-3);
                CHECK_NEAR(at.sin_heading, own.sin_heading, 1e-3);
                CHECK_NEAR(at.curvature, own.curvature, 5e-3);
            }
        }
        clear();
    }
}

/// Nothing of the path jumps, and its heading and curvature are those of its positions.
static void check_smooth(double from, double to, double curvature_max)
{
    const double h = 0.01;
    for (double s = from + 2.0 * h; s < to; s += 0.13) {
        const vg_reference p = vg_path_at(&path, s - h), q = vg_path_at(&path, s);
        const vg_reference r = vg_path_at(&path, s + h);
        CHECK_NEAR(hypot(r.x - p.x, r.y - p.y), 2.0 * h, 2.0 * h * 0.02);
        const double heading = atan2(r.y - p.y, r.x - p.x);
        CHECK_NEAR(remainder(heading - atan2(q.sin_heading, q.cos_heading), 2.0 * M_PI), 0.0, 1e-4);
        const double turn = atan2(r.sin_heading * p.cos_heading - r.cos_heading * p.sin_heading,
                                  r.cos_heading * p.cos_heading + r.sin_heading * p.sin_heading);
        CHECK_NEAR(turn / (2.0 * h), q.curvature, 2e-3);
        const double before = vg_path_at(&path, s - 1e-4).curvature;
        CHECK_NEAR(vg_path_at(&path, s + 1e-4).curvature, before, 1e-4);
        CHECK_AT_MOST(fabs(q.curvature), curvature_max);
    }
}

static void test_position_heading_and_curvature_pass_the_joints_without_a_jump(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("joints");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        random_chain(&rng, 0.7, 3.0);
        for (uint32_t anchor = 0; anchor < 3; ++anchor) {
            vg_path_build(&path, c.road, anchor, -1, -220.0, 360.0);
            check_smooth(path.start, path.start + 580.0, 1.2 * sharpest_bend() + 0.015);
        }
        clear();
    }
}

static void test_behind_a_step_a_path_is_the_next_lane(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("steps");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        random_chain(&rng, 0.5, 0.0);
        const double faded = 15.0 + 20.0 * 0.6; // [m] after which a step of 0.5 m is gone
        // Forwards from lane 0, and backwards from lane 2: both are over lane 1.
        for (uint32_t anchor = 0; anchor < 3; anchor += 2) {
            vg_path_build(&path, c.road, anchor, -1, -110.0, length_of(anchor) + 110.0);
            const double start = anchor == 0 ? length_of(0) : -length_of(1);
            const double from = anchor == 0 ? faded : 12.0;
            const double to = length_of(1) - (anchor == 0 ? 12.0 : faded);
            for (double s = from; s < to; s += 0.9) {
                const vg_reference own = vg_lane_at(&c.road->lanes[1], s);
                const double at = vg_path_project(&path, own.x, own.y, start + s);
                const vg_reference on = vg_path_at(&path, at);
                CHECK_NEAR(hypot(on.x - own.x, on.y - own.y), 0.0, 1e-3);
                CHECK_NEAR(at, start + s, 0.5);
            }
        }
        clear();
    }
}

static void test_a_path_covers_what_it_is_asked_for(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("cover");
    random_chain(&rng, 0.2, 1.0);
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        const double from = test_rng_between(&rng, -300.0, 300.0);
        const double length = test_rng_between(&rng, 0.0, 600.0);
        vg_path_build(&path, c.road, test_rng_below(&rng, 3), -1, from, from + length);
        CHECK_SAME_BITS(path.start, from);
        assert_true(path.knot_count >= 4 && path.knot_count <= VG_PATH_KNOTS_MAX);
        CHECK_NEAR(path.knot_spacing * (path.knot_count - 1), fmax(length, 4.0), 1e-9);
        CHECK_AT_MOST(path.knot_spacing, VG_KNOT_SPACING + 1e-12);
    }
    clear();
}

static void test_at_a_fork_a_path_takes_the_branch_to_its_target(void** state)
{
    (void)state;
    c = (chain){ 0 };
    add_bend(0.0, 0.0, 0.0, 100.0, 0.0);
    add_bend(100.0, 0.0, 0.0, 100.0, 0.005);  // 1: to the left
    add_bend(100.0, 0.0, 0.0, 100.0, -0.005); // 2: to the right
    join(0, 1);
    join(0, 2);
    build();
    for (int32_t target = 1; target <= 2; ++target) {
        vg_path_build(&path, c.road, 0, target, 0.0, 190.0);
        const vg_reference at = vg_path_at(&path, 180.0);
        const vg_reference own = vg_lane_at(&c.road->lanes[target], 80.0);
        CHECK_NEAR(at.x, own.x, 0.05);
        CHECK_NEAR(at.y, own.y, 0.05);
    }
    clear();
}

static void test_behind_a_merge_a_path_comes_from_the_straightest_lane(void** state)
{
    (void)state;
    c = (chain){ 0 };
    add_bend(-100.0, 30.0, -0.6, 100.0, 0.006); // 0: comes in from the left
    add_bend(-100.0, 0.0, 0.0, 100.0, 0.0);     // 1: straight
    add_bend(0.0, 0.0, 0.0, 100.0, 0.0);        // 2: continues both
    for (uint32_t i = 0; i < POINTS; ++i) {     // 0 ends at the origin, too
        c.points[0][i][0] += -c.points[0][POINTS - 1][0] * i / (POINTS - 1);
        c.points[0][i][1] += -c.points[0][POINTS - 1][1] * i / (POINTS - 1);
    }
    join(0, 2);
    join(1, 2);
    build();
    vg_path_build(&path, c.road, 2, -1, -90.0, 50.0);
    for (double s = -89.0; s < 49.0; s += 1.0) {
        const vg_reference at = vg_path_at(&path, s);
        CHECK_NEAR(at.x, s, 0.02);
        CHECK_NEAR(at.y, 0.0, 0.02);
    }
    clear();
}

static void test_a_ring_is_walked_as_often_as_the_path_is_long(void** state)
{
    (void)state;
    const double radius = 15.0, half = M_PI * radius;
    c = (chain){ 0 };
    add_bend(radius, 0.0, 0.5 * M_PI, half, 1.0 / radius);
    add_bend(-radius, 0.0, -0.5 * M_PI, half, 1.0 / radius);
    join(0, 1);
    join(1, 0);
    build();
    vg_path_build(&path, c.road, 0, -1, -200.0, 300.0);
    for (double s = -200.0; s <= 300.0; s += 0.5) {
        const vg_reference at = vg_path_at(&path, s);
        CHECK_NEAR(hypot(at.x, at.y), radius, 0.2); // the survey's tolerance
        CHECK_NEAR(at.curvature, 1.0 / radius, 0.03);
    }
    clear();
}

static void test_beyond_the_road_a_path_continues_straight(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("straight on");
    for (uint32_t round = 0; round < test_rounds(50); ++round) {
        random_chain(&rng, 0.2, 1.0);
        const double length = length_of(0);
        vg_path_build(&path, c.road, 2, -1, 0.0, length_of(2) + 100.0);
        const vg_reference end = vg_lane_at(&c.road->lanes[2], length_of(2));
        vg_reference at = vg_path_at(&path, length_of(2) + 90.0);
        CHECK_NEAR(at.x, end.x + 90.0 * end.cos_heading, 0.02);
        CHECK_NEAR(at.y, end.y + 90.0 * end.sin_heading, 0.02);
        vg_path_build(&path, c.road, 0, -1, -100.0, length);
        const vg_reference begin = vg_lane_at(&c.road->lanes[0], 0.0);
        at = vg_path_at(&path, -90.0);
        CHECK_NEAR(at.x, begin.x - 90.0 * begin.cos_heading, 0.02);
        CHECK_NEAR(at.y, begin.y - 90.0 * begin.sin_heading, 0.02);
        clear();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_on_its_anchor_a_path_is_the_lane),
        cmocka_unit_test(test_position_heading_and_curvature_pass_the_joints_without_a_jump),
        cmocka_unit_test(test_behind_a_step_a_path_is_the_next_lane),
        cmocka_unit_test(test_a_path_covers_what_it_is_asked_for),
        cmocka_unit_test(test_at_a_fork_a_path_takes_the_branch_to_its_target),
        cmocka_unit_test(test_behind_a_merge_a_path_comes_from_the_straightest_lane),
        cmocka_unit_test(test_a_ring_is_walked_as_often_as_the_path_is_long),
        cmocka_unit_test(test_beyond_the_road_a_path_continues_straight),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
