/// Goal: the motion of a leg is that of a car: the formulas agree with the positions.
/// Method: profiles by their own derivatives, their limits and disturbed ones; the rear axle by
/// differences of its positions in time, and by a bicycle that is integrated with the leg's
/// curvature and speed; limits by single motions that break one of them.
#include "check.h"
#include "motion/kinematics.h"
#include "rng.h"
#include "room.h"
#include "scene.h"

TEST_PATH(path); // 600 m long

/// Roads of each curvature, built once.
static scene* roads[8];

/// Lays the path along the middle lane of a circle or of a straight road.
static void road_take(double curvature)
{
    uint32_t i = 0;
    while (roads[i] != NULL && roads[i]->curvature != curvature) {
        ++i;
    }
    if (roads[i] == NULL) {
        roads[i] = scene_make(curvature, 0.0);
    }
    const verge_road* road = roads[i]->road;
    vg_path_build(&path, road, 1, -1, -30.0, fmin(road->lanes[1].length + 30.0, 300.0));
}

static int free_roads(void** state)
{
    (void)state;
    for (uint32_t i = 0; roads[i] != NULL; ++i) {
        scene_free(roads[i]);
    }
    return 0;
}

static vg_state random_start(test_rng* rng, double speed_min, double speed_max)
{
    const double v = test_rng_between(rng, speed_min, speed_max);
    const double a = test_rng_between(rng, -3.0, 3.0);
    const double d = test_rng_between(rng, -1.5, 1.5);
    const double d1 = test_rng_between(rng, -0.1, 0.1);
    const double d2 = test_rng_between(rng, -0.02, 0.02);
    return (vg_state){ 20.0, v, a, d, d1, d2, true };
}

// ---------------------------------------------------------------------------- profiles

/// Position, speed and acceleration are integrals of the next one, and position and speed have no
/// jump. Acceleration may jump where a stop ends.
static void check_derivatives(const vg_profile* profile, double T)
{
    const double e = 1e-5;
    for (double t = 0.013; t < T; t += 0.017) {
        const vg_piece before = vg_profile_at(profile, t - e), at = vg_profile_at(profile, t);
        const vg_piece after = vg_profile_at(profile, t + e);
        CHECK_NEAR((after.s - before.s) / (2.0 * e), at.v, 1e-4);
        CHECK_NEAR(after.v, before.v, 2.0 * e * 1e3);
        bool joint = false;
        for (uint32_t i = 0; i < profile->count; ++i) {
            joint |= fabs(profile->pieces[i].t - t) <= e;
        }
        if (!joint) {
            CHECK_NEAR((after.v - before.v) / (2.0 * e), at.a, 1e-4 + 1e-3 * fabs(at.a));
            CHECK_NEAR((after.a - before.a) / (2.0 * e), at.j, 1e-3 + 1e-3 * fabs(at.j));
        }
    }
}

static void test_a_profile_meets_its_end_speed_without_acceleration(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("to speed");
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        const vg_state start = random_start(&rng, 0.0, 30.0);
        const double v1 = test_rng_between(&rng, 0.1, 30.0);
        const double T = test_rng_between(&rng, 0.5, 5.0);
        const vg_profile profile = vg_profile_to_speed(&start, v1, T);
        const vg_piece first = vg_profile_at(&profile, 0.0), last = vg_profile_at(&profile, T);
        CHECK_SAME_BITS(first.s, start.s);
        CHECK_SAME_BITS(first.v, start.s_t);
        CHECK_SAME_BITS(first.a, start.s_tt);
        CHECK_NEAR(last.v, v1, 1e-9);
        CHECK_NEAR(last.a, 0.0, 1e-9);
        check_derivatives(&profile, T);
    }
}

/// Integral of the squared jerk with a disturbance of the speed that leaves speed and acceleration
/// as they are at both ends: bump t^2 (T - t)^2.
static double squared_jerk(const vg_profile* profile, double T, double bump)
{
    double sum = 0.0;
    for (int i = 0; i < 2000; ++i) {
        const double t = T * (i + 0.5) / 2000.0;
        const double extra = 2.0 * T * T - 12.0 * T * t + 12.0 * t * t;
        sum += vg_square(vg_profile_at(profile, t).j + bump * extra) * T / 2000.0;
    }
    return sum;
}

static void test_no_profile_to_the_same_speed_has_less_jerk(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("jerk");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        const vg_state start = random_start(&rng, 5.0, 30.0);
        const double T = test_rng_between(&rng, 0.5, 5.0);
        const vg_profile profile = vg_profile_to_speed(&start, 10.0, T);
        const double bump = test_rng_between(&rng, 0.1, 2.0);
        assert_true(squared_jerk(&profile, T, bump) > squared_jerk(&profile, T, 0.0));
        assert_true(squared_jerk(&profile, T, -bump) > squared_jerk(&profile, T, 0.0));
    }
}

static void test_after_a_stop_a_vehicle_does_not_move_back(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("stop");
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        vg_state start = random_start(&rng, 0.0, 15.0);
        start.s_tt = test_rng_between(&rng, -8.0, 3.0);
        const double T = test_rng_between(&rng, 0.05, 5.0);
        const vg_profile profile = vg_profile_to_speed(&start, 0.0, T);
        const double rest = vg_profile_at(&profile, T).s;
        double s = start.s;
        for (double t = 0.0; t <= T + 2.0; t += 0.01) {
            const vg_piece at = vg_profile_at(&profile, t);
            CHECK_AT_MOST(-at.v, 1e-12);
            CHECK_AT_MOST(s, at.s + 1e-12);
            s = at.s;
            if (t >= T) {
                CHECK_SAME_BITS(at.v, 0.0);
                CHECK_SAME_BITS(at.a, 0.0);
                CHECK_SAME_BITS(at.s, rest);
            }
        }
        check_derivatives(&profile, T);
    }
}

// ---------------------------------------------------------------------------- lateral links

static vg_leg leg_make(const vg_state* start, double v1, double T, double offset)
{
    vg_leg leg = { .path = &path, .limits = scene_car(),
                   .profile = vg_profile_to_speed(start, v1, T) };
    vg_leg_link(&leg, start, T, offset);
    return leg;
}

static void test_a_link_begins_at_the_state_and_ends_at_its_offset(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("link");
    road_take(1.0 / 125.0);
    uint32_t in_way = 0, in_time = 0;
    for (uint32_t round = 0; round < test_rounds(500); ++round) {
        vg_state start = random_start(&rng, 0.5, 12.0);
        start.s_tt = 0.0;
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const vg_leg leg = leg_make(&start, start.s_t, 3.0, offset); // at constant speed for ever
        const vg_row first = vg_leg_row(&leg, 0.0);
        CHECK_NEAR(first.base[0] + offset * first.shape[0], start.d, 1e-9);
        CHECK_NEAR(first.base[1] + offset * first.shape[1], start.d1, 1e-9);
        CHECK_NEAR(first.base[2] + offset * first.shape[2], start.d2, 1e-9);
        const vg_row last =
            vg_leg_row(&leg, leg.by_distance ? leg.span / start.s_t + 0.01 : leg.span);
        CHECK_SAME_BITS(last.base[0], 0.0);
        CHECK_SAME_BITS(last.shape[0], 1.0);
        for (int i = 1; i < 4; ++i) {
            CHECK_SAME_BITS(last.base[i], 0.0);
            CHECK_SAME_BITS(last.shape[i], 0.0);
        }
        in_way += leg.by_distance;
        in_time += !leg.by_distance;
    }
    assert_true(!test_rounds_suffice() || (in_way > 0 && in_time > 0));
}

static void test_a_link_has_no_joint_at_its_end(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("link end");
    road_take(0.0);
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        vg_state start = random_start(&rng, 0.5, 12.0);
        start.s_tt = 0.0;
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const vg_leg leg = leg_make(&start, start.s_t, 3.0, offset);
        const double end = leg.by_distance ? leg.span / start.s_t : leg.span;
        const vg_row before = vg_leg_row(&leg, end - 1e-3), after = vg_leg_row(&leg, end + 1e-3);
        const vg_rear r0 = vg_rear_of(&before, offset), r1 = vg_rear_of(&after, offset);
        CHECK_NEAR(r0.d, r1.d, 1e-6);
        CHECK_NEAR(r0.d1, r1.d1, 1e-4);
        CHECK_NEAR(r0.curvature, r1.curvature, 1e-3);
    }
}

// ---------------------------------------------------------------------------- the rear axle

/// Position of the rear axle alone: the only thing the derivatives below are made of.
static void position_at(const vg_leg* leg, double offset, double t, double xy[2])
{
    const vg_row row = vg_leg_row(leg, t);
    const double d = row.base[0] + offset * row.shape[0];
    xy[0] = row.line.x - d * row.line.sin_heading;
    xy[1] = row.line.y + d * row.line.cos_heading;
}

/// Speed, acceleration, curvature and heading from positions at five instants.
static vg_motion motion_by_differences(const vg_leg* leg, double offset, double t, double h)
{
    double p[5][2], v[2], a[2];
    for (int i = 0; i < 5; ++i) {
        position_at(leg, offset, t + h * (i - 2), p[i]);
    }
    for (int i = 0; i < 2; ++i) {
        v[i] = (p[0][i] - 8.0 * p[1][i] + 8.0 * p[3][i] - p[4][i]) / (12.0 * h);
        a[i] = (-p[0][i] + 16.0 * p[1][i] - 30.0 * p[2][i] + 16.0 * p[3][i] - p[4][i])
             / (12.0 * h * h);
    }
    const double speed = hypot(v[0], v[1]);
    return (vg_motion){ p[2][0], p[2][1], atan2(v[1], v[0]), speed,
                        (v[0] * a[0] + v[1] * a[1]) / speed,
                        (v[0] * a[1] - v[1] * a[0]) / (speed * speed * speed) };
}

/// Are all five instants on one piece of line and profile? A link ends with its leg or later.
static bool smooth_around(const vg_leg* leg, double t, double h)
{
    const double from = vg_profile_at(&leg->profile, t - 2.0 * h).s;
    const double to = vg_profile_at(&leg->profile, t + 2.0 * h).s;
    bool smooth = floor((from - path.start) / path.knot_spacing)
               == floor((to - path.start) / path.knot_spacing);
    for (uint32_t i = 1; i < leg->profile.count; ++i) {
        smooth &= fabs(leg->profile.pieces[i].t - t) > 3.0 * h;
    }
    return smooth;
}

static void test_motion_is_the_derivative_of_the_positions(void** state)
{
    (void)state;
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 40.0 };
    test_rng rng = test_rng_seeded("rear axle");
    const double h = 2e-3;
    uint32_t compared = 0;
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        road_take(curvatures[round % 3]);
        const vg_state start = random_start(&rng, 1.0, 15.0);
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const vg_leg leg = leg_make(&start, test_rng_between(&rng, 1.0, 15.0), 3.0, offset);
        for (double t = 0.1; t < 3.0; t += 0.07) {
            const vg_row row = vg_leg_row(&leg, t);
            const vg_rear rear = vg_rear_of(&row, offset);
            if (!smooth_around(&leg, t, h) || rear.speed < 0.8) {
                continue;
            }
            const vg_motion by = motion_by_differences(&leg, offset, t, h);
            CHECK_SAME_BITS(rear.x, by.x);
            CHECK_SAME_BITS(rear.y, by.y);
            CHECK_NEAR(rear.speed, by.speed, 1e-5);
            const double heading = atan2(rear.sin_heading, rear.cos_heading);
            CHECK_NEAR(remainder(heading - by.heading, 2.0 * M_PI), 0.0, 1e-5);
            CHECK_NEAR(rear.acceleration, by.acceleration, 5e-4);
            CHECK_NEAR(rear.curvature, by.curvature, 1e-4 / fmin(1.0, by.speed * by.speed));
            CHECK_NEAR(vg_square(rear.cos_heading) + vg_square(rear.sin_heading), 1.0, 1e-12);
            ++compared;
        }
    }
    assert_true(compared > test_rounds(60) * 5);
}

static void test_jerk_and_curvature_rate_are_derivatives_in_time(void** state)
{
    (void)state;
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 80.0 };
    test_rng rng = test_rng_seeded("rates");
    const double h = 1e-3;
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        road_take(curvatures[round % 3]);
        const vg_state start = random_start(&rng, 2.0, 20.0);
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const vg_leg leg = leg_make(&start, test_rng_between(&rng, 2.0, 20.0), 3.0, offset);
        for (double t = 0.1; t < 2.9; t += 0.11) {
            if (!smooth_around(&leg, t, h)) {
                continue;
            }
            const vg_row rows[3] = { vg_leg_row(&leg, t - h), vg_leg_row(&leg, t),
                                     vg_leg_row(&leg, t + h) };
            const vg_rear before = vg_rear_of(&rows[0], offset);
            const vg_rear at = vg_rear_of(&rows[1], offset);
            const vg_rear after = vg_rear_of(&rows[2], offset);
            CHECK_NEAR((after.speed - before.speed) / (2.0 * h), at.acceleration, 1e-3);
            CHECK_NEAR((after.curvature - before.curvature) / (2.0 * h), at.curvature_t,
                       1e-4 + 2e-3 * fabs(at.curvature_t));
            // The formulas take the line's second curvature rate as zero: seen by differences.
            const double bend = (rows[2].line.curvature_rate - rows[0].line.curvature_rate)
                              / (rows[2].s - rows[0].s);
            const double left_out = at.speed * at.speed * at.speed * fabs(bend * at.d);
            CHECK_NEAR((after.acceleration - before.acceleration) / (2.0 * h), at.jerk,
                       1e-3 + 1.2 * left_out + 1e-2 * fabs(at.jerk));
        }
    }
}

/// One step of the middle rule for x' = v cos h, y' = v sin h, h' = v k.
static void bicycle_step(vg_motion* bicycle, const vg_leg* leg, double offset, double t, double dt)
{
    const vg_row row = vg_leg_row(leg, t + 0.5 * dt);
    const vg_rear rear = vg_rear_of(&row, offset);
    const double turn = rear.speed * rear.curvature * dt;
    bicycle->x += rear.speed * cos(bicycle->heading + 0.5 * turn) * dt;
    bicycle->y += rear.speed * sin(bicycle->heading + 0.5 * turn) * dt;
    bicycle->heading += turn;
}

static void test_a_bicycle_that_steers_and_drives_like_the_leg_arrives_with_it(void** state)
{
    (void)state;
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 40.0 };
    test_rng rng = test_rng_seeded("bicycle");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        road_take(curvatures[round % 3]);
        const vg_state start = random_start(&rng, 0.0, 15.0);
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const double v1 = round % 4 == 0 ? 0.0 : test_rng_between(&rng, 0.5, 15.0);
        const vg_leg leg = leg_make(&start, v1, 3.0, offset);
        const vg_row first = vg_leg_row(&leg, 0.0), last = vg_leg_row(&leg, 3.0);
        const vg_rear begin = vg_rear_of(&first, offset), end = vg_rear_of(&last, offset);
        vg_motion bicycle = { begin.x, begin.y, atan2(begin.sin_heading, begin.cos_heading),
                              0.0, 0.0, 0.0 };
        for (int i = 0; i < 3000; ++i) {
            bicycle_step(&bicycle, &leg, offset, 1e-3 * i, 1e-3);
        }
        CHECK_NEAR(bicycle.x, end.x, 1e-3);
        CHECK_NEAR(bicycle.y, end.y, 1e-3);
        const double heading = atan2(end.sin_heading, end.cos_heading);
        CHECK_NEAR(remainder(bicycle.heading - heading, 2.0 * M_PI), 0.0, 1e-3);
    }
}

// ---------------------------------------------------------------------------- in and out

static void test_a_state_on_the_path_is_the_same_after_conversion_there_and_back(void** state)
{
    (void)state;
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 40.0 };
    test_rng rng = test_rng_seeded("state");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        road_take(curvatures[round % 3]);
        const vg_state start = random_start(&rng, 0.5, 15.0);
        const double offset = test_rng_between(&rng, -3.5, 3.5);
        const vg_leg leg = leg_make(&start, test_rng_between(&rng, 0.5, 15.0), 3.0, offset);
        vg_row row = vg_leg_row(&leg, test_rng_between(&rng, 0.0, 3.0));
        row.s_t = fmax(row.s_t, 0.0); // a profile may pass below zero, which its limits refuse
        const vg_rear rear = vg_rear_of(&row, offset);
        const vg_motion motion = vg_motion_of(&rear);
        const vg_state back = vg_state_of(&path, &motion, row.s);
        assert_true(back.valid);
        CHECK_NEAR(back.s, row.s, 1e-8);
        CHECK_NEAR(back.s_t, row.s_t, 1e-8);
        CHECK_NEAR(back.s_tt, row.s_tt, 1e-6);
        CHECK_NEAR(back.d, rear.d, 1e-8);
        CHECK_NEAR(back.d1, rear.d1, 1e-8);
        CHECK_NEAR(back.d2, rear.d2, 1e-7);
    }
}

static void test_a_vehicle_across_or_beyond_the_centre_of_the_bend_has_no_state(void** state)
{
    (void)state;
    road_take(1.0 / 30.0); // the middle lane's radius is 26.5 m
    const vg_reference at = vg_path_at(&path, 20.0);
    const double heading = atan2(at.sin_heading, at.cos_heading);
    for (double turn = -3.0; turn <= 3.0; turn += 0.1) {
        const vg_motion rear = { at.x, at.y, vg_wrap_angle(heading + turn), 5.0, 0.0, 0.0 };
        assert_int_equal(vg_state_of(&path, &rear, 20.0).valid, cos(turn) >= 0.2);
    }
    for (double d = -30.0; d <= 25.0; d += 1.0) {
        const vg_motion rear = { at.x - d * at.sin_heading, at.y + d * at.cos_heading, heading,
                                 5.0, 0.0, 0.0 };
        assert_int_equal(vg_state_of(&path, &rear, 20.0).valid, 1.0 - d / 26.5 >= VG_FRAME_MIN);
    }
}

// ---------------------------------------------------------------------------- limits

static double hard_ratio(double speed, double acceleration, double curvature, double rate)
{
    const vg_rear rear = { .speed = speed, .acceleration = acceleration, .curvature = curvature,
                           .curvature_t = rate, .frame = 1.0 };
    return vg_hard_ratio(scene_car(), &rear, speed);
}

static void test_each_limit_of_the_car_alone_refuses_a_motion(void** state)
{
    (void)state;
    static const double below = 0.999, above = 1.001;
    for (int i = 0; i < 2; ++i) {
        const double by = i == 0 ? below : above;
        const double steer = VERGE_STEER_RATE_MAX / VERGE_WHEELBASE; // of a straight wheel
        const double results[] = {
            hard_ratio(1.0, 0.0, by * VERGE_CURVATURE_MAX, 0.0),
            hard_ratio(1.0, 0.0, 0.0, by * steer),
            hard_ratio(1.0, by * VERGE_ACCELERATION_MAX, 0.0, 0.0),
            hard_ratio(20.0, by * VERGE_ACCELERATION_MAX * VERGE_SPEED_SWITCH / 20.0, 0.0, 0.0),
            hard_ratio(20.0, -by * VERGE_ACCELERATION_MAX, 0.0, 0.0),
            hard_ratio(20.0, 0.0, by * VERGE_ACCELERATION_MAX / 400.0, 0.0),
            hard_ratio(20.0, -by * 0.6 * VERGE_ACCELERATION_MAX,
                       by * 0.8 * VERGE_ACCELERATION_MAX / 400.0, 0.0),
            hard_ratio(by * VERGE_SPEED_MAX, 0.0, 0.0, 0.0),
        };
        for (size_t k = 0; k < sizeof results / sizeof *results; ++k) {
            assert_int_equal(results[k] > 1.0, by > 1.0);
        }
    }
    const vg_rear folded = { .speed = 1.0, .frame = 0.5 * VG_FRAME_MIN };
    assert_true(vg_hard_ratio(scene_car(), &folded, 1.0) > 1.0);
    const vg_rear backwards = { .speed = 1.0, .frame = 1.0 };
    assert_true(vg_hard_ratio(scene_car(), &backwards, -0.01) > 1.0);
}

static void test_a_turned_wheel_steers_more_slowly_in_curvature(void** state)
{
    (void)state;
    // The limit is one of the wheel's angle: curvature = tan(angle) / wheelbase.
    for (double angle = 0.0; angle <= 1.0; angle += 0.1) {
        const double e = 1e-6, rate = VERGE_STEER_RATE_MAX;
        const double k0 = tan(angle - e * rate) / VERGE_WHEELBASE;
        const double k1 = tan(angle + e * rate) / VERGE_WHEELBASE;
        const double k = tan(angle) / VERGE_WHEELBASE, k_t = (k1 - k0) / (2.0 * e);
        CHECK_NEAR(fmax(hard_ratio(1.0, 0.0, k, 0.999 * k_t), 1.0), 1.0, 0.0);
        assert_true(hard_ratio(1.0, 0.0, k, 1.001 * k_t) > 1.0);
    }
}

static void test_comfort_is_four_limits(void** state)
{
    (void)state;
    const vg_comfort limit = { 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0 };
    const vg_rear motions[] = { { .acceleration = 2.0 }, { .acceleration = -3.0 },
                                { .speed = 2.0, .curvature = 1.0 }, { .jerk = 5.0 },
                                { .jerk = -5.0 }, { .speed = 2.0, .curvature = -1.0 } };
    for (size_t i = 0; i < sizeof motions / sizeof *motions; ++i) {
        CHECK_NEAR(vg_comfort_ratio(&limit, &motions[i]), 1.0, 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_profile_meets_its_end_speed_without_acceleration),
        cmocka_unit_test(test_no_profile_to_the_same_speed_has_less_jerk),
        cmocka_unit_test(test_after_a_stop_a_vehicle_does_not_move_back),
        cmocka_unit_test(test_a_link_begins_at_the_state_and_ends_at_its_offset),
        cmocka_unit_test(test_a_link_has_no_joint_at_its_end),
        cmocka_unit_test(test_motion_is_the_derivative_of_the_positions),
        cmocka_unit_test(test_jerk_and_curvature_rate_are_derivatives_in_time),
        cmocka_unit_test(test_a_bicycle_that_steers_and_drives_like_the_leg_arrives_with_it),
        cmocka_unit_test(test_a_state_on_the_path_is_the_same_after_conversion_there_and_back),
        cmocka_unit_test(test_a_vehicle_across_or_beyond_the_centre_of_the_bend_has_no_state),
        cmocka_unit_test(test_each_limit_of_the_car_alone_refuses_a_motion),
        cmocka_unit_test(test_a_turned_wheel_steers_more_slowly_in_curvature),
        cmocka_unit_test(test_comfort_is_four_limits),
    };
    return cmocka_run_group_tests(tests, NULL, free_roads);
}
