/// Goal: no contact of two moving bodies is missed, and each reported one is at least nearly one.
/// Method: random pairs of tracks against polygons clipped at 60 instants of each step
/// (strict.h); single cases for the rules about contacts that exist at the start.
#include "check.h"
#include "motion/contact.h"
#include "rng.h"
#include "strict.h"

enum { LAST = 12, DENSE = 60 };
static const double step_s = 0.1;

static verge_track a, b;

/// A body that drives and turns at constant rates, or spins in its place, near the origin.
static verge_track random_track(test_rng* rng)
{
    verge_track track = { .half_length = test_rng_between(rng, 0.3, 6.0),
                       .half_width = test_rng_between(rng, 0.2, 1.3) };
    double heading = test_rng_between(rng, -3.1, 3.1);
    double x = test_rng_between(rng, -12.0, 12.0), y = test_rng_between(rng, -12.0, 12.0);
    const bool spins = test_rng_below(rng, 2) == 0;
    const double speed = test_rng_between(rng, 0.0, spins ? 1.0 : 30.0);
    const double turn = test_rng_between(rng, spins ? -6.0 : -1.0, spins ? 6.0 : 1.0);
    for (uint32_t k = 0; k <= LAST; ++k) {
        track.x[k] = x;
        track.y[k] = y;
        track.cos_heading[k] = cos(heading);
        track.sin_heading[k] = sin(heading);
        x += speed * cos(heading) * step_s;
        y += speed * sin(heading) * step_s;
        heading += turn * step_s;
    }
    return track;
}

/// A body that stays aligned with x and moves at constant velocity.
static verge_track straight_track(double x, double y, double vx, double vy)
{
    verge_track track = { .half_length = 2.5, .half_width = 1.0 };
    for (uint32_t k = 0; k <= LAST; ++k) {
        track.x[k] = x + vx * step_s * k;
        track.y[k] = y + vy * step_s * k;
        track.cos_heading[k] = 1.0;
    }
    return track;
}

static verge_track grown(verge_track track, double by)
{
    track.half_length += by;
    track.half_width += by;
    return track;
}

/// Do the bodies overlap at one of the dense instants of step k, from sample k - 1 to k?
static bool overlap_in_step(const verge_track* p, const verge_track* q, uint32_t k)
{
    for (int i = 0; i <= DENSE; ++i) {
        const double share = (double)i / DENSE;
        const strict_polygon one = strict_body(p, k - 1, share);
        const strict_polygon two = strict_body(q, k - 1, share);
        if (strict_shared_area(one, &two) > 1e-9) {
            return true;
        }
    }
    return false;
}

/// Upper bound of the path of any point of one body relative to the other one in step k. [m]
static double motion_in_step(const verge_track* p, const verge_track* q, uint32_t k)
{
    double motion = hypot(q->x[k] - q->x[k - 1] - p->x[k] + p->x[k - 1],
                          q->y[k] - q->y[k - 1] - p->y[k] + p->y[k - 1]);
    for (int i = 0; i < 2; ++i) {
        const verge_track* t = i == 0 ? p : q;
        const double angle = atan2(t->sin_heading[k], t->cos_heading[k])
                           - atan2(t->sin_heading[k - 1], t->cos_heading[k - 1]);
        motion += 2.0 * (t->half_length + t->half_width) * fabs(remainder(angle, 2.0 * M_PI));
    }
    return motion;
}

static void test_no_contact_between_samples_is_missed(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("contact");
    uint32_t contacts = 0, passes = 0;
    for (uint32_t round = 0; round < test_rounds(4000); ++round) {
        a = random_track(&rng);
        b = random_track(&rng);
        const double clearance = round % 2 ? 0.0 : test_rng_between(&rng, 0.0, 1.0);
        const uint32_t found = vg_contact_first(&a, &b, clearance, 0, LAST);
        const verge_track body = grown(a, clearance);
        for (uint32_t k = 1; k <= LAST && k < found; ++k) {
            assert_false(overlap_in_step(&body, &b, k));
        }
        contacts += found <= LAST;
        passes += found > LAST;
    }
    assert_true(!test_rounds_suffice() || (contacts > 0 && passes > 0));
}

static void test_a_reported_contact_is_one_within_a_fifth_of_the_step(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("false contact");
    for (uint32_t round = 0; round < test_rounds(4000); ++round) {
        a = random_track(&rng);
        b = random_track(&rng);
        const double clearance = round % 2 ? 0.0 : test_rng_between(&rng, 0.0, 1.0);
        const uint32_t k = vg_contact_first(&a, &b, clearance, 0, LAST);
        if (k <= LAST) {
            const double slack = motion_in_step(&a, &b, k) / VG_CONTACT_PARTS;
            const verge_track body = grown(a, clearance + slack + 1e-3);
            assert_true(overlap_in_step(&body, &b, k));
        }
    }
}

static void test_at_a_sample_the_bodies_touch_where_their_polygons_do(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sample");
    for (uint32_t round = 0; round < test_rounds(4000); ++round) {
        a = random_track(&rng);
        b = random_track(&rng);
        const double clearance = test_rng_between(&rng, 0.0, 1.0);
        const verge_track inner = grown(a, clearance - 1e-6), outer = grown(a, clearance + 1e-6);
        for (uint32_t k = 1; k <= LAST; ++k) {
            const strict_polygon other = strict_body(&b, k - 1, 1.0);
            const bool touches = vg_contact_at(&a, &b, clearance, k);
            if (touches) {
                assert_true(strict_shared_area(strict_body(&outer, k - 1, 1.0), &other) > 0.0);
            } else {
                assert_true(strict_shared_area(strict_body(&inner, k - 1, 1.0), &other) < 1e-9);
            }
        }
    }
}

static void test_a_body_that_passes_between_two_samples_is_seen(void** state)
{
    (void)state;
    a = straight_track(0.0, 0.0, 0.0, 0.0);
    for (double start = -9.0; start < -4.0; start += 0.25) {
        b = straight_track(0.0, start, 0.0, 120.0); // 12 m a step: over the body within one
        b.half_length = 0.3;
        b.half_width = 0.1;
        assert_int_equal(vg_contact_first(&a, &b, 0.0, 0, LAST), 1);
    }
}

static void test_only_the_steps_asked_for_count(void** state)
{
    (void)state;
    a = straight_track(0.0, 0.0, 0.0, 0.0);
    b = straight_track(-10.0, 0.0, 20.0, 0.0); // 2 m a step: overlap from 2.5 to 7.5 steps
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 0, LAST), 3);
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 0, 2), 3);  // none up to 2
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 4, LAST), 5);
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 9, LAST), LAST + 1);
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 5, 5), 6);  // no step at all
}

static void test_an_overlap_at_the_start_may_last_but_not_come_back(void** state)
{
    (void)state;
    a = straight_track(0.0, 0.0, 0.0, 0.0);
    b = straight_track(4.0, 0.0, 10.0, 0.0); // one metre deep, leaves by one a step
    assert_int_equal(vg_contact_new(&a, &b, 0.0, LAST), LAST + 1);
    assert_int_equal(vg_contact_first(&a, &b, 0.0, 0, LAST), 1);
    for (uint32_t k = 7; k <= LAST; ++k) {
        b.x[k] = b.x[6] - 1.5 * (k - 6); // from 10 m back: 5 m and less from k = 10 on
    }
    assert_int_equal(vg_contact_new(&a, &b, 0.0, LAST), 10);
    b = straight_track(4.0, 0.0, 0.0, 0.0); // for ever: no new contact
    assert_int_equal(vg_contact_new(&a, &b, 0.0, LAST), LAST + 1);
}

static void test_a_vehicle_that_starts_within_the_clearance_need_only_not_touch(void** state)
{
    (void)state;
    a = straight_track(0.0, 0.0, 0.0, 0.0);
    b = straight_track(5.4, 0.0, -0.2, 0.0); // 0.4 m away, comes 0.24 m nearer
    assert_true(vg_contact_at(&a, &b, 0.5, 0));
    assert_int_equal(vg_contact_new(&a, &b, 0.5, LAST), LAST + 1);
    b = straight_track(5.4, 0.0, -0.5, 0.0); // 0.05 m a step: touches after eight
    assert_int_equal(vg_contact_new(&a, &b, 0.5, LAST), 8);
    b = straight_track(5.6, 0.0, -0.5, 0.0); // begins beyond: the clearance holds
    assert_int_equal(vg_contact_new(&a, &b, 0.5, LAST), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_contact_between_samples_is_missed),
        cmocka_unit_test(test_a_reported_contact_is_one_within_a_fifth_of_the_step),
        cmocka_unit_test(test_at_a_sample_the_bodies_touch_where_their_polygons_do),
        cmocka_unit_test(test_a_body_that_passes_between_two_samples_is_seen),
        cmocka_unit_test(test_only_the_steps_asked_for_count),
        cmocka_unit_test(test_an_overlap_at_the_start_may_last_but_not_come_back),
        cmocka_unit_test(test_a_vehicle_that_starts_within_the_clearance_need_only_not_touch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
