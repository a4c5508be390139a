/// Goal: overlap and distance of bodies are those of geometry.
/// Method: a slow oracle that knows nothing of axes: all pairs of sides as line segments.
#include "check.h"
#include "geometry/rectangle.h"
#include "rng.h"

#include <math.h>

static void corners_of(const vg_rectangle* r, double c[5][2])
{
    static const double sign[5][2] = { { 1, 1 }, { -1, 1 }, { -1, -1 }, { 1, -1 }, { 1, 1 } };
    for (int i = 0; i < 5; ++i) {
        const double l = sign[i][0] * r->half_length, w = sign[i][1] * r->half_width;
        c[i][0] = r->x + l * r->cos_heading - w * r->sin_heading;
        c[i][1] = r->y + l * r->sin_heading + w * r->cos_heading;
    }
}

static double point_to_segment(const double p[2], const double a[2], const double b[2])
{
    const double dx = b[0] - a[0], dy = b[1] - a[1];
    double t = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy);
    t = fmin(fmax(t, 0.0), 1.0);
    return hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}

static double side(const double a[2], const double b[2], const double p[2])
{
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

static bool inside(const vg_rectangle* r, const double p[2])
{
    double c[5][2];
    corners_of(r, c);
    bool in = true;
    for (int i = 0; i < 4; ++i) {
        in = in && side(c[i], c[i + 1], p) >= 0.0;
    }
    return in;
}

static double slow_distance(const vg_rectangle* a, const vg_rectangle* b)
{
    double ca[5][2], cb[5][2];
    corners_of(a, ca);
    corners_of(b, cb);
    double nearest = 1e30;
    if (inside(a, cb[0]) || inside(b, ca[0])) {
        return 0.0;
    }
    for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < 4; ++k) {
            const double b0 = side(ca[i], ca[i + 1], cb[k]);
            const double b1 = side(ca[i], ca[i + 1], cb[k + 1]);
            const double a0 = side(cb[k], cb[k + 1], ca[i]);
            const double a1 = side(cb[k], cb[k + 1], ca[i + 1]);
            const bool cross = b0 * b1 < 0.0 && a0 * a1 < 0.0;
            if (cross) {
                return 0.0;
            }
            nearest = fmin(nearest, point_to_segment(ca[i], cb[k], cb[k + 1]));
            nearest = fmin(nearest, point_to_segment(cb[k], ca[i], ca[i + 1]));
        }
    }
    return nearest;
}

static vg_rectangle random_body(test_rng* rng)
{
    const double heading = test_rng_between(rng, -3.2, 3.2);
    return (vg_rectangle){ .x = test_rng_between(rng, -8.0, 8.0),
                           .y = test_rng_between(rng, -8.0, 8.0),
                           .cos_heading = cos(heading), .sin_heading = sin(heading),
                           .half_length = test_rng_between(rng, 0.3, 6.0),
                           .half_width = test_rng_between(rng, 0.2, 1.5) };
}

static void test_distance_and_overlap_equal_those_computed_from_the_sides(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("rectangle");
    uint32_t overlaps = 0;
    const uint32_t rounds = test_rounds(100000);
    for (uint32_t i = 0; i < rounds; ++i) {
        const vg_rectangle a = random_body(&rng), b = random_body(&rng);
        const double expected = slow_distance(&a, &b);
        const bool touch = vg_rectangle_overlap(&a, &b);
        if (expected > 1e-9) {
            assert_false(touch);
        } else if (expected == 0.0) {
            assert_true(touch);
        }
        CHECK_NEAR(vg_rectangle_distance(&a, &b), expected, 1e-9);
        CHECK_SAME_BITS(vg_rectangle_distance(&a, &b), vg_rectangle_distance(&b, &a));
        overlaps += touch ? 1 : 0;
    }
    assert_true(overlaps > rounds / 20 && overlaps < rounds / 2); // both answers were asked for
}

static void test_touching_is_overlap_and_any_distance_is_not(void** state)
{
    (void)state;
    const vg_rectangle a = { .cos_heading = 1.0, .half_length = 2.5, .half_width = 1.0 };
    vg_rectangle b = a;
    b.x = 5.0;
    assert_true(vg_rectangle_overlap(&a, &b));
    b.x = 5.0 + 1e-12;
    assert_false(vg_rectangle_overlap(&a, &b));
    b.x = 8.0;
    b.y = 6.0;
    CHECK_NEAR(vg_rectangle_distance(&a, &b), 5.0, 1e-12); // 3, 4, 5
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distance_and_overlap_equal_those_computed_from_the_sides),
        cmocka_unit_test(test_touching_is_overlap_and_any_distance_is_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
