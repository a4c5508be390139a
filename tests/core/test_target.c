/// Goal: the candidates of a segment lie around the decided state and reach down to the hardest
/// braking.
/// Method: end speed, end offset and first jerk of each candidate are read from its profile and its
/// link; leaders, limits and bends by single scenes.
#include "check.h"
#include "motion/follow.h"
#include "motion/target.h"
#include "rng.h"
#include "room.h"
#include "scene.h"

TEST_BATCH(batch);
TEST_PATH(path);
static vg_state start;

/// The candidates of the first segment of the scene's vehicle: T [s] from its state on.
static void sample(scene* w, double T, bool emergency)
{
    const vg_job* job = &w->jobs[0];
    const vg_segment* segment = &job->segments[0];
    const verge_vehicle* v = job->vehicle;
    const double curvature = v->speed > 0.0 ? v->yaw_rate / v->speed : 0.0;
    const vg_motion centre = { v->x, v->y, v->heading, v->speed, v->acceleration, curvature };
    const vg_motion rear = vg_motion_of_rear(&centre, scene_car()->rear_axle);
    vg_path_build(&path, w->road, segment->lane, -1, job->s - 30.0, job->s + 300.0);
    start = vg_state_of(&path, &rear, job->s);
    assert_true(start.valid);
    batch.start = 0;
    batch.last = (uint32_t)(T / w->def.point_s + 0.5);
    vg_target_sample(&batch, job, scene_car(), segment, &path, segment->lane, &start, T,
                     &w->tracks, emergency);
}

/// Along the line.
static double end_speed(uint32_t leg, double T)
{
    return vg_profile_at(&batch.legs[leg].profile, T).v;
}

/// Speed of a vehicle at the offset d of a segment, per speed along the line. The road is a circle.
static double frame_of(const vg_segment* segment)
{
    return 1.0 - vg_path_at(&path, start.s).curvature * segment->d;
}

/// Change of the jerk's sign apart, the hardest a profile builds up: at its start. [m/s^3]
static double first_jerk(uint32_t leg)
{
    return vg_profile_at(&batch.legs[leg].profile, 0.0).j;
}

/// Index of the cheapest entry; `count` > 0.
static uint32_t cheapest(const double* penalties, uint32_t count)
{
    uint32_t best = 0;
    for (uint32_t i = 1; i < count; ++i) {
        best = penalties[i] < penalties[best] ? i : best;
    }
    return best;
}

static scene* random_scene(test_rng* rng, bool change)
{
    scene* w = scene_make(test_rng_below(rng, 2) ? 0.0 : 1.0 / 125.0, 0.0);
    const double v = test_rng_between(rng, 6.0, 15.0); // less than the bend allows
    const double off = test_rng_between(rng, -0.5, 0.5), a = test_rng_between(rng, -1.0, 1.0);
    const double goal = v + test_rng_between(rng, -0.9, 0.9);
    vg_job* job = scene_vehicle(w, 1, 30.0, off, 0.0, v, a, goal);
    if (change) {
        job->segments[0].action = VERGE_CHANGE_LEFT;
        job->segments[0].lane = 2;
        job->segments[0].d = test_rng_between(rng, -1.0, 0.0);
    }
    return w;
}

static void test_the_decided_state_is_a_candidate_and_the_cheapest(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("centre");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        const bool change = round % 2 == 0;
        scene* w = random_scene(&rng, change);
        const vg_segment* segment = &w->jobs[0].segments[0];
        sample(w, 3.0, false);
        const uint32_t leg = cheapest(batch.leg_penalties, batch.leg_count);
        CHECK_NEAR(end_speed(leg, 3.0) * frame_of(segment), segment->v, 1e-3);
        CHECK_NEAR(vg_profile_at(&batch.legs[leg].profile, 3.0).a, 0.0, 1e-9);
        CHECK_SAME_BITS(batch.leg_penalties[leg], 0.0);
        uint32_t centres = 0;
        for (uint32_t i = 0; i < batch.offset_count; ++i) {
            if (batch.offsets[i] == segment->d) {
                CHECK_SAME_BITS(batch.offset_penalties[i], 0.0);
                ++centres;
            }
        }
        assert_int_equal(centres, 1);
        scene_free(w);
    }
}

static void test_offsets_spread_evenly_over_their_region(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("offsets");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        const bool change = round % 2 == 0;
        scene* w = random_scene(&rng, change);
        const double d = w->jobs[0].segments[0].d;
        const double half = change ? w->def.region_offset : w->def.keep_region_offset;
        sample(w, 3.0, false);
        assert_int_equal(batch.offset_count, w->def.sample_offsets);
        CHECK_NEAR(batch.offsets[0], d - half, 1e-12);
        CHECK_NEAR(batch.offsets[batch.offset_count - 1], d + half, 1e-12);
        const double spacing = 2.0 * half / (batch.offset_count - 1);
        for (uint32_t i = 1; i < batch.offset_count; ++i) {
            // The sample nearest to the centre has moved into it, by half a spacing at most.
            CHECK_BETWEEN(batch.offsets[i] - batch.offsets[i - 1], 0.49 * spacing, 1.51 * spacing);
        }
        scene_free(w);
    }
}

static void test_penalties_grow_with_the_distance_from_the_decision(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("penalties");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        const bool change = round % 2 == 0;
        scene* w = random_scene(&rng, change);
        const vg_segment* segment = &w->jobs[0].segments[0];
        sample(w, 3.0, false);
        for (uint32_t i = 0; i < batch.offset_count; ++i) {
            const double miss = batch.offsets[i] - segment->d;
            const double expected = change ? VG_DECISION_PULL_OFFSET * 30.0 * miss * miss : 0.0;
            CHECK_NEAR(batch.offset_penalties[i], expected, 1e-9);
        }
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            const double v = end_speed(i, 3.0), miss = v - segment->v / frame_of(segment);
            if (v > 0.0) {
                CHECK_NEAR(batch.leg_penalties[i], VG_DECISION_PULL * 30.0 * miss * miss, 0.3);
            } else { // stops, and the earlier it does the farther it is from the decision
                CHECK_AT_MOST(VG_DECISION_PULL * 30.0 * miss * miss,
                              batch.leg_penalties[i] + 0.3);
            }
        }
        scene_free(w);
    }
}

static void test_a_kept_lane_reaches_down_to_the_hardest_braking_the_jerk_limit_allows(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("braking");
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        scene* w = random_scene(&rng, false);
        const bool emergency = round % 2 == 0;
        const double jerk = emergency ? VG_JERK_MAX : w->def.comfort_jerk;
        sample(w, 3.0, emergency);
        double hardest = 0.0;
        bool stops = false;
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            stops |= end_speed(i, 3.0) <= 0.0;
            if (end_speed(i, 3.0) > 0.0) { // a stop before the end begins harder
                CHECK_AT_MOST(-first_jerk(i), jerk);
                hardest = fmax(hardest, -first_jerk(i));
            }
        }
        assert_true(stops || hardest > 0.97 * jerk);
        scene_free(w);
    }
}

static void test_a_slow_vehicle_can_stop_in_its_lane(void** state)
{
    (void)state;
    for (double v = 0.1; v < 5.5; v += 0.1) {
        scene* w = scene_make(0.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        sample(w, 3.0, false);
        double nearest = INFINITY;
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            if (end_speed(i, 3.0) == 0.0) {
                nearest = fmin(nearest, vg_profile_at(&batch.legs[i].profile, 3.0).s - start.s);
            }
        }
        CHECK_AT_MOST(nearest, 0.5 * v * 3.0 + 1e-9); // as if braking evenly for the whole leg
        scene_free(w);
    }
}

static void test_a_change_keeps_to_its_region_of_speeds(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("change");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        scene* w = random_scene(&rng, true);
        const double v = w->jobs[0].segments[0].v, half = w->def.region_speed;
        sample(w, 3.0, false);
        const double decided = v / frame_of(&w->jobs[0].segments[0]);
        assert_int_equal(batch.leg_count, w->def.sample_speeds);
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            CHECK_BETWEEN(end_speed(i, 3.0), decided - half - 1e-3, decided + half + 1e-3);
        }
        scene_free(w);
    }
}

static void test_no_candidate_ends_above_the_speed_limit(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("limit");
    for (uint32_t round = 0; round < test_rounds(100); ++round) {
        scene* w = scene_make(0.0, 0.0); // limit 25
        const double v = test_rng_between(&rng, 23.0, 25.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v + 1.0);
        sample(w, 3.0, false);
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            CHECK_AT_MOST(end_speed(i, 3.0), 25.0 + 1e-6);
        }
        scene_free(w);
    }
}

static void test_above_the_speed_limit_every_candidate_slows_down_but_none_has_to_brake(void** state)
{
    (void)state;
    for (double v = 26.0; v <= 40.0; v += 1.0) {
        scene* w = scene_make(0.0, 0.0); // limit 25
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        sample(w, 3.0, false);
        double highest = 0.0;
        for (uint32_t i = 0; i < batch.leg_count; ++i) {
            highest = fmax(highest, end_speed(i, 3.0));
        }
        CHECK_NEAR(highest, fmax(25.0, v - 3.0 * VG_LIMIT_BRAKING), 1e-6);
        scene_free(w);
    }
}

/// Bumper to bumper behind the standing body at the end of the leg, less the way a braking of
/// VG_FOLLOW_BRAKING takes. [m]
static double gap_left(const scene* w, uint32_t leg)
{
    const vg_piece end = vg_profile_at(&batch.legs[leg].profile, 3.0);
    const verge_track* other = &w->tracks.of[1];
    const double s = vg_path_project(&path, other->x[0], other->y[0], NAN);
    return s - 2.5 - (end.s + scene_car()->rear_axle + 2.5) - end.v * end.v / (2.0 * VG_FOLLOW_BRAKING);
}

static void test_the_cheapest_candidate_can_stop_behind_a_standing_body(void** state)
{
    (void)state;
    for (double v = 2.0; v <= 16.0; v += 1.0) {
        scene* w = scene_make(1.0 / 125.0, 0.0);
        scene_vehicle(w, 1, 30.0, 0.0, 0.0, v, 0.0, v);
        scene_track(w, 30.0 + 8.0 + v * v / 3.0, SCENE_WIDTH, 0.0, 0.0);
        sample(w, 3.0, false);
        const uint32_t leg = cheapest(batch.leg_penalties, batch.leg_count);
        CHECK_AT_MOST(w->def.idm_gap - 0.05, gap_left(w, leg));
        scene_free(w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_decided_state_is_a_candidate_and_the_cheapest),
        cmocka_unit_test(test_offsets_spread_evenly_over_their_region),
        cmocka_unit_test(test_penalties_grow_with_the_distance_from_the_decision),
        cmocka_unit_test(
            test_a_kept_lane_reaches_down_to_the_hardest_braking_the_jerk_limit_allows),
        cmocka_unit_test(test_a_slow_vehicle_can_stop_in_its_lane),
        cmocka_unit_test(test_a_change_keeps_to_its_region_of_speeds),
        cmocka_unit_test(test_no_candidate_ends_above_the_speed_limit),
        cmocka_unit_test(
            test_above_the_speed_limit_every_candidate_slows_down_but_none_has_to_brake),
        cmocka_unit_test(test_the_cheapest_candidate_can_stop_behind_a_standing_body),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
