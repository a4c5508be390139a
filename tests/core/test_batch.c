/// Goal: the evaluation of eight candidates at a time gives the results of the direct formulas.
/// Method: costs against vg_leg_cost(), which knows no pruning; marks against limits written out
/// again; absent alarms against polygons every 10 ms and against the exact contact test.
#include "candidates.h"
#include "check.h"
#include "room.h"
#include "motion/contact.h"
#include "strict.h"

TEST_BATCH(batch);
TEST_PATH(path);

static const verge_weights plain_weights = { 1.0, 1.0, 1.0, 1.0, 1.0, 1.0 };

static verge_weights random_weights(test_rng* rng)
{
    verge_weights weights;
    weights.curvature = test_rng_between(rng, 0.0, 100.0);
    weights.heading = test_rng_between(rng, 0.0, 10.0);
    weights.offset = test_rng_between(rng, 0.0, 10.0);
    weights.acceleration = test_rng_between(rng, 0.0, 10.0);
    weights.jerk = test_rng_between(rng, 0.0, 10.0);
    weights.obstacle = test_rng_between(rng, 0.0, 10.0);
    return weights;
}

/// A scene with the candidates of a change or of a kept lane, until the horizon or before it.
static scene* random_batch(test_rng* rng)
{
    scene* w = candidates_scene(rng);
    const bool change = test_rng_below(rng, 2) == 0;
    const uint32_t last = test_rng_below(rng, 2) == 0 ? w->def.points - 1 : 15;
    candidates_sample(w, change, last, &batch, &path);
    w->def.alert_continuous = test_rng_below(rng, 2);
    return w;
}

static uint32_t candidate_count(void)
{
    return batch.leg_count * batch.offset_count;
}

static const vg_leg* leg_of(uint32_t candidate)
{
    return &batch.legs[candidate / batch.offset_count];
}

static double offset_of(uint32_t candidate)
{
    return batch.offsets[candidate % batch.offset_count];
}

static void test_every_cost_equals_the_straight_form(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("cost");
    uint32_t near = 0;
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        scene* w = random_batch(&rng);
        const verge_weights weights = random_weights(&rng);
        vg_batch_run(&batch, &w->def, &weights, &w->tracks, 0);
        for (uint32_t i = 0; i < candidate_count(); ++i) {
            const verge_cost straight =
                vg_leg_cost(leg_of(i), offset_of(i), 0, batch.last, &w->def, &weights, &w->tracks,
                            0, batch.in_lane, batch.aim);
            CHECK_NEAR(batch.costs[i], straight.total, 1e-9 * straight.total + 1e-9);
            near += straight.obstacle > 0.0;
        }
        scene_free(w);
    }
    assert_true(!test_rounds_suffice() || near > 0);
}

static void test_a_later_segment_costs_what_the_straight_form_says(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("later");
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        scene* w = random_batch(&rng);
        batch.start = 7; // as if the legs began there, among the tracks of those instants
        batch.last = 7 + test_rng_below(&rng, 15) + 1;
        vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
        for (uint32_t i = 0; i < candidate_count(); ++i) {
            const verge_cost straight =
                vg_leg_cost(leg_of(i), offset_of(i), batch.start, batch.last, &w->def,
                            &plain_weights, &w->tracks, 0, batch.in_lane, batch.aim);
            CHECK_NEAR(batch.costs[i], straight.total, 1e-9 * straight.total + 1e-9);
        }
        scene_free(w);
    }
}

/// The largest ratio of a motion to a limit of the body, at the instants of the batch.
static double worst_hard(const scene* w, uint32_t candidate)
{
    double worst = 0.0;
    for (uint32_t k = batch.start + 1; k <= batch.last; ++k) {
        const vg_row row = vg_leg_row(leg_of(candidate), w->def.point_s * (k - batch.start));
        const vg_rear rear = vg_rear_of(&row, offset_of(candidate));
        worst = fmax(worst, vg_hard_ratio(&w->limits, &rear, row.s_t));
    }
    return worst;
}

/// The largest ratio to a limit of normal driving, from the limits themselves.
static double worst_comfort(const scene* w, uint32_t candidate)
{
    double worst = 0.0;
    for (uint32_t k = batch.start + 1; k <= batch.last; ++k) {
        const vg_row row = vg_leg_row(leg_of(candidate), w->def.point_s * (k - batch.start));
        const vg_rear rear = vg_rear_of(&row, offset_of(candidate));
        const double ratios[] = { rear.acceleration / 4.0, -rear.acceleration / 6.0,
                                  fabs(rear.speed * rear.speed * rear.curvature) / 4.0,
                                  fabs(rear.jerk) / 4.0 };
        for (int i = 0; i < 4; ++i) {
            worst = fmax(worst, ratios[i]);
        }
    }
    return worst;
}

static void check_mark(uint32_t candidate, unsigned mark, double worst, uint32_t met[2])
{
    if (fabs(worst - 1.0) > 1e-9) {
        const bool broken = worst > 1.0;
        assert_int_equal((batch.marks[candidate] & mark) != 0, broken);
        ++met[broken];
    }
}

static void test_marks_say_which_limits_are_broken(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("marks");
    uint32_t hard[2] = { 0 }, comfort[2] = { 0 };
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        scene* w = random_batch(&rng);
        for (uint32_t i = 0; i < batch.offset_count; ++i) {
            batch.offsets[i] *= 3.0; // some farther than any car gets
        }
        vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
        for (uint32_t i = 0; i < candidate_count(); ++i) {
            check_mark(i, VG_INFEASIBLE, worst_hard(w, i), hard);
            check_mark(i, VG_UNCOMFORTABLE, worst_comfort(w, i), comfort);
            assert_int_equal(batch.marks[i] & VG_TRIED, 0);
        }
        scene_free(w);
    }
    assert_true(!test_rounds_suffice()
                || (hard[0] > 0 && hard[1] > 0 && comfort[0] > 0 && comfort[1] > 0));
}

/// The body of a candidate at the batch's instants.
static void drive(const scene* w, uint32_t candidate, verge_track* body)
{
    *body = w->tracks.of[0];
    for (uint32_t k = 0; k <= batch.last; ++k) {
        const vg_row row = vg_leg_row(leg_of(candidate), w->def.point_s * k);
        const vg_rear rear = vg_rear_of(&row, offset_of(candidate));
        body->x[k] = rear.x + w->limits.rear_axle * rear.cos_heading;
        body->y[k] = rear.y + w->limits.rear_axle * rear.sin_heading;
        body->cos_heading[k] = rear.cos_heading;
        body->sin_heading[k] = rear.sin_heading;
    }
}

/// What is seen between the instants only: a small body that shoots across the road, or a long
/// one that spins beside the lane.
static verge_track sudden(const scene* w, test_rng* rng)
{
    const bool spins = test_rng_below(rng, 2) == 0;
    verge_track track = w->tracks.of[1];
    track.half_length = spins ? 4.0 : test_rng_between(rng, 0.2, 1.0);
    track.half_width = 0.2;
    const double x = test_rng_between(rng, 45.0, 70.0);
    const double y = spins ? test_rng_between(rng, -3.0, 9.0) : test_rng_between(rng, -90.0, 90.0);
    const double vy = spins ? 0.0 : -y / test_rng_between(rng, 0.5, 1.5); // over the road then
    const double heading = test_rng_between(rng, -3.1, 3.1);
    const double turn = spins ? test_rng_between(rng, -20.0, 20.0) : 0.0;
    for (uint32_t k = 0; k < w->def.points; ++k) {
        const double t = w->def.point_s * k;
        track.x[k] = x;
        track.y[k] = y + vy * t;
        track.cos_heading[k] = cos(heading + turn * t);
        track.sin_heading[k] = sin(heading + turn * t);
        track.speed[k] = fabs(vy);
    }
    return track;
}

static void test_where_no_contact_is_reported_the_bodies_do_not_touch(void** state)
{
    (void)state;
    static verge_track body, guarded;
    test_rng rng = test_rng_seeded("alarm");
    uint32_t alarms = 0, contacts = 0;
    for (uint32_t round = 0; round < test_rounds(600); ++round) {
        scene* w = random_batch(&rng);
        w->def.clearance = round % 3 ? 0.0 : test_rng_between(&rng, 0.0, 1.0);
        const uint32_t picked = 1 + test_rng_below(&rng, 8); // one other body: alarms do not mix
        w->tracks.of[1] = round % 2 == 0 ? sudden(w, &rng) : w->tracks.of[picked];
        w->tracks.count = 2;
        vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
        for (uint32_t i = test_rng_below(&rng, 7); i < candidate_count(); i += 7) {
            drive(w, i, &body);
            guarded = body;
            guarded.half_length += w->def.clearance;
            guarded.half_width += w->def.clearance;
            const bool contact = strict_contact(&guarded, &w->tracks.of[1], batch.last + 1,
                                                w->def.point_s, 1e-9) < 1e9;
            const bool alarm = (batch.marks[i] & VG_ALARM) != 0;
            assert_true(alarm || !contact);
            alarms += alarm;
            contacts += contact;
            // What the filter lets pass the exact test lets pass, too.
            const uint32_t exact = vg_contact_first(&body, &w->tracks.of[1], w->def.clearance, 0,
                                                    batch.last);
            assert_true(!contact || exact <= batch.last);
        }
        scene_free(w);
    }
    printf("             %u alarms for %u contacts\n", alarms, contacts);
    assert_true(!test_rounds_suffice() || (contacts > 0 && alarms < 3 * contacts));
}

static void test_neighbours_in_the_loop_do_not_change_a_candidate(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("order");
    static double costs[TEST_CANDIDATES];
    static uint8_t marks[TEST_CANDIDATES];
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        scene* w = random_batch(&rng);
        vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
        memcpy(costs, batch.costs, candidate_count() * sizeof costs[0]);
        memcpy(marks, batch.marks, candidate_count() * sizeof marks[0]);
        const uint32_t count = batch.offset_count;
        uint32_t came_from[VERGE_SAMPLE_OFFSETS_MAX];
        for (uint32_t i = 0; i < count; ++i) {
            came_from[i] = i;
        }
        for (uint32_t i = 0; i < count; ++i) { // shuffled: other eights than before
            const uint32_t j = i + test_rng_below(&rng, count - i);
            const double offset = batch.offsets[i];
            const uint32_t from = came_from[i];
            batch.offsets[i] = batch.offsets[j];
            came_from[i] = came_from[j];
            batch.offsets[j] = offset;
            came_from[j] = from;
        }
        vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
        for (uint32_t i = 0; i < candidate_count(); ++i) {
            const uint32_t before = i / count * count + came_from[i % count];
            CHECK_SAME_BITS(batch.costs[i], costs[before]);
            assert_int_equal(batch.marks[i], marks[before]);
        }
        scene_free(w);
    }
}

static void test_the_track_of_the_vehicle_itself_is_no_obstacle(void** state)
{
    (void)state;
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 1, 40.0, 0.0, 0.0, 10.0, 0.0, 10.0);
    candidates_sample(w, false, w->def.points - 1, &batch, &path);
    const verge_weights weights = { .obstacle = 1.0 };
    vg_batch_run(&batch, &w->def, &weights, &w->tracks, 0);
    for (uint32_t i = 0; i < candidate_count(); ++i) {
        CHECK_SAME_BITS(batch.costs[i], 0.0);
        assert_int_equal(batch.marks[i] & VG_ALARM, 0);
    }
    scene_free(w);
}

static void test_a_candidate_with_nan_is_infeasible_and_affects_no_other(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("nan");
    static double costs[TEST_CANDIDATES];
    scene* w = random_batch(&rng);
    vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
    memcpy(costs, batch.costs, candidate_count() * sizeof costs[0]);
    batch.offsets[3] = NAN;
    vg_batch_run(&batch, &w->def, &plain_weights, &w->tracks, 0);
    for (uint32_t i = 0; i < candidate_count(); ++i) {
        if (i % batch.offset_count == 3) {
            assert_true((batch.marks[i] & VG_INFEASIBLE) != 0);
        } else {
            CHECK_SAME_BITS(batch.costs[i], costs[i]);
        }
    }
    scene_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_cost_equals_the_straight_form),
        cmocka_unit_test(test_a_later_segment_costs_what_the_straight_form_says),
        cmocka_unit_test(test_marks_say_which_limits_are_broken),
        cmocka_unit_test(test_where_no_contact_is_reported_the_bodies_do_not_touch),
        cmocka_unit_test(test_neighbours_in_the_loop_do_not_change_a_candidate),
        cmocka_unit_test(test_the_track_of_the_vehicle_itself_is_no_obstacle),
        cmocka_unit_test(test_a_candidate_with_nan_is_infeasible_and_affects_no_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
