/// Goal: the speed behind other vehicles is the highest one that still keeps the standstill gap.
/// Method: random starts and leaders on straight and bent lanes; the profile to that speed, then
/// the braking after it, add up to the free distance, by the profile's own positions.
#include "check.h"
#include "rng.h"
#include "scene.h"

#include "motion/follow.h"

#define GAP 2.0
#define AXLE 1.4 // [m] from the rear axle to the centre

typedef struct pair {
    scene* w;
    double   room[6][VG_PATH_KNOTS_MAX];
    vg_path path;
    vg_following following;
    vg_state state;
} pair;

static void pair_make(pair* p, double curvature, double speed, double acceleration,
                      double distance, double leader)
{
    scene* w = p->w = scene_make(curvature, 0.0);
    vg_job* job = scene_vehicle(w, 1, 30.0, 0.0, 0.0, speed, acceleration, speed);
    scene_track(w, 30.0 + distance, SCENE_WIDTH, leader, 0.0);
    p->path = (vg_path){ .knots_max = VG_PATH_KNOTS_MAX, .x = p->room[0], .y = p->room[1],
                         .xss = p->room[2], .yss = p->room[3], .h = p->room[4], .work = p->room[5] };
    vg_path_build(&p->path, w->road, 1, -1, job->s - 30.0, job->s + 250.0);
    p->state = (vg_state){ job->s - AXLE, speed, acceleration, 0, 0, 0, true };
    p->following = (vg_following){ &p->path, &w->tracks, 0, AXLE, 0, w->def.points - 1,
                                   w->def.point_s * (w->def.points - 1), GAP, 0.2, 0.0, 0.0 };
}

/// Bumper to bumper at the end of the segment, along the lane. [m]
static double gap_after(const pair* p, double s_rear)
{
    const verge_track* other = &p->w->tracks.of[1];
    const uint32_t last = p->following.last;
    const double s = vg_path_project(&p->path, other->x[last], other->y[last], NAN);
    return s - 2.5 - (s_rear + AXLE + 2.5);
}

static void test_braking_from_the_follow_speed_ends_at_the_gap(void** state)
{
    (void)state;
    static pair p;
    test_rng rng = test_rng_seeded("follow");
    uint32_t drives = 0, stops = 0;
    for (uint32_t round = 0; round < test_rounds(400); ++round) {
        const double speed = test_rng_between(&rng, 0.5, 15.0);
        const double a = test_rng_between(&rng, -1.0, 1.0);
        const double distance = test_rng_between(&rng, 7.5, 40.0);
        const double leader = test_rng_below(&rng, 2) ? 0.0 : test_rng_between(&rng, 0.0, 10.0);
        const double b = test_rng_between(&rng, 1.0, 6.0);
        pair_make(&p, test_rng_below(&rng, 2) ? 0.0 : 1.0 / 125.0, speed, a, distance, leader);
        const double T = p.following.T;
        const double v = vg_follow_speed(&p.following, &p.state, b);
        if (v >= VG_HUGE) { // no vehicle near: enough distance to continue and to stop
            const double rest = gap_after(&p, p.state.s + speed * T) - speed * speed / (2.0 * b);
            CHECK_AT_MOST(GAP, rest);
            scene_free(p.w);
            continue;
        }
        const double stop = v < 0.0 ? T * speed / (speed - v) : T;
        const vg_profile profile = vg_profile_to_speed(&p.state, fmax(v, 0.0), stop);
        const double gap = gap_after(&p, vg_profile_at(&profile, T).s);
        const double braking = (fmax(v, 0.0) * fmax(v, 0.0) - leader * leader) / (2.0 * b);
        if (v >= 0.0) {
            CHECK_NEAR(gap - braking, GAP, 0.02);
            ++drives;
        } else if (stop > 0.011 && stop < T && (a >= 0.0 || stop < 3.0 * speed / -a)) {
            CHECK_NEAR(gap - braking, GAP, 0.02);
            ++stops;
        }
        scene_free(p.w);
    }
    assert_true(drives > 0 && stops > 0);
}

static void test_a_body_beside_behind_or_crossing_is_not_followed(void** state)
{
    (void)state;
    static pair p;
    pair_make(&p, 0.0, 10.0, 0.0, -12.0, 12.0);            // a follower
    scene_track(p.w, 45.0, 2.0 * SCENE_WIDTH, 0.0, 0.0);   // in the next lane
    const uint32_t crossing = scene_track(p.w, 50.0, SCENE_WIDTH, 8.0, 0.0);
    verge_track* track = &p.w->tracks.of[crossing];
    for (uint32_t k = 0; k < p.w->def.points; ++k) {
        track->x[k] = 50.0;
        track->cos_heading[k] = 0.0;
        track->sin_heading[k] = 1.0;
    }
    assert_true(vg_follow_speed(&p.following, &p.state, 2.0) >= VG_HUGE);
    scene_track(p.w, 60.0, SCENE_WIDTH + 1.5, 0.0, 0.0);   // stands halfway in the lane
    assert_true(vg_follow_speed(&p.following, &p.state, 2.0) < 10.0);
    scene_free(p.w);
}

// Comes from the side, and moves along the path at the end.
static void test_a_body_that_enters_behind_the_decided_place_is_not_followed(void** state)
{
    (void)state;
    static pair p;
    pair_make(&p, 0.0, 10.0, 0.0, 10.0, 3.0);
    verge_track* track = &p.w->tracks.of[1];
    p.following.driven = 30.0;
    assert_true(vg_follow_speed(&p.following, &p.state, 2.0) < 10.0); // in the path all the time
    track->y[0] += 8.0;
    assert_true(vg_follow_speed(&p.following, &p.state, 2.0) >= VG_HUGE);
    p.following.driven = 15.0; // decided to arrive behind it
    assert_true(vg_follow_speed(&p.following, &p.state, 2.0) < 10.0);
    scene_free(p.w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_braking_from_the_follow_speed_ends_at_the_gap),
        cmocka_unit_test(test_a_body_beside_behind_or_crossing_is_not_followed),
        cmocka_unit_test(test_a_body_that_enters_behind_the_decided_place_is_not_followed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
