/// Goal: the trajectories of one plan do not touch each other, in any order of computation.
/// Method: vehicles whose decisions lead to the same place; random groups; executors that run the
/// tasks backwards and on threads.
#include "check.h"
#include "rng.h"
#include "scene.h"
#include "strict.h"

#include <pthread.h>

static double contact_of(const scene* w, uint32_t i, uint32_t j)
{
    return strict_contact(&w->tracks.of[w->jobs[i].track_index],
                          &w->tracks.of[w->jobs[j].track_index], w->def.points, w->def.point_s,
                          0.0);
}

/// Two vehicles side by side in the outer lanes, both sent into the middle one.
static scene* same_gap(double lead)
{
    scene* w = scene_make(0.0, 0.0);
    for (uint32_t i = 0; i < 2; ++i) {
        vg_job* job = scene_vehicle(w, 2 * i, 40.0 + lead * i, 0.0, 0.0, 14.0, 0.0, 14.0);
        job->segments[0].action = i == 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        job->segments[0].lane = 1;
    }
    // The predictions say that each stays where it is: only the joint check can see the clash.
    return w;
}

static void test_two_vehicles_with_one_gap_as_target_do_not_touch(void** state)
{
    (void)state;
    for (double lead = -4.0; lead <= 4.0; lead += 1.0) {
        scene* w = same_gap(lead);
        scene_run(w);
        assert_int_equal(w->plans[0].status, VERGE_PLANNED);
        assert_int_equal(w->plans[1].status, VERGE_PLANNED);
        assert_true(contact_of(w, 0, 1) > 1e9);
        assert_true(w->replanned >= 1);
        // The lower id has the right of way.
        CHECK_NEAR(w->plans[0].points[w->def.points - 1].y, SCENE_WIDTH, 0.5);
        scene_free(w);
    }
}

static scene* flock(test_rng* rng)
{
    scene* w = scene_make(test_rng_below(rng, 2) ? 1.0 / 125.0 : 0.0, 0.0);
    for (uint32_t i = 0; i < SCENE_JOBS; ++i) {
        const uint32_t lane = test_rng_below(rng, 3);
        const double v = test_rng_between(rng, 4.0, 16.0);
        vg_job* job = scene_vehicle(w, lane, 30.0 + 9.0 * i, 0.0, 0.0, v, 0.0, v);
        const bool left = lane == 0 || (lane == 1 && test_rng_below(rng, 2));
        if (test_rng_below(rng, 3) > 0) {
            job->segments[0].action = left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
            job->segments[0].lane = left ? lane + 1 : lane - 1;
        }
    }
    for (uint32_t i = 0; i < 3; ++i) {
        const double s = test_rng_between(rng, 70.0, 100.0);
        const double d = SCENE_WIDTH * test_rng_below(rng, 3);
        scene_track(w, s, d, test_rng_between(rng, 2.0, 12.0), 0.0);
    }
    return w;
}

static void test_planned_trajectories_never_touch_each_other(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("flocks");
    const uint32_t rounds = test_rounds(200);
    uint32_t replanned = 0, fallbacks = 0;
    for (uint32_t round = 0; round < rounds; ++round) {
        scene* w = flock(&rng);
        scene_run(w);
        replanned += w->replanned;
        for (uint32_t i = 0; i < w->job_count; ++i) {
            fallbacks += w->plans[i].status != VERGE_PLANNED;
            for (uint32_t j = 0; j < i; ++j) {
                if (w->plans[i].status == VERGE_PLANNED && w->plans[j].status == VERGE_PLANNED
                    && contact_of(w, i, j) < 1e9) {
                    fail_msg("round %u: %u and %u touch", round, j, i);
                }
            }
            char text[160];
            const verge_body body = verge_vehicle_body(&w->vehicles[i]);
            const char* fault = strict_motion_fault(&w->plans[i], &body, w->def.point_s, text);
            if (fault != NULL) {
                fail_msg("round %u, vehicle %u: %s: %s", round, i, fault, text);
            }
        }
        scene_free(w);
    }
    printf("             %u replanned, %u of %u fell back\n", replanned, fallbacks,
           rounds * SCENE_JOBS);
    assert_true(replanned > 0 && fallbacks * 20 <= rounds * SCENE_JOBS * 3);
}

static void backwards(void* context, void (*task)(void*, uint32_t), void* arg, uint32_t count)
{
    *(uint32_t*)context += count;
    while (count > 0) {
        task(arg, --count);
    }
}

typedef struct worker {
    void (*task)(void*, uint32_t);
    void* arg;
    uint32_t index;
} worker;

static void* work(void* arg)
{
    worker* w = arg;
    w->task(w->arg, w->index);
    return NULL;
}

static void on_threads(void* context, void (*task)(void*, uint32_t), void* arg, uint32_t count)
{
    *(uint32_t*)context += count;
    pthread_t threads[SCENE_JOBS];
    worker workers[SCENE_JOBS];
    for (uint32_t i = 0; i < count; ++i) {
        workers[i] = (worker){ task, arg, i };
        assert_int_equal(pthread_create(&threads[i], NULL, work, &workers[i]), 0);
    }
    for (uint32_t i = 0; i < count; ++i) {
        pthread_join(threads[i], NULL);
    }
}

static void test_the_executor_changes_nothing(void** state)
{
    (void)state;
    verge_executor* const executors[] = { backwards, on_threads };
    for (uint64_t seed = 1; seed <= test_rounds(20); ++seed) {
        test_rng rng = test_rng_from(seed);
        scene* serial = flock(&rng);
        scene_run(serial);
        for (uint32_t e = 0; e < 2; ++e) {
            rng = test_rng_from(seed);
            scene* other = flock(&rng);
            uint32_t tasks = 0;
            other->def.executor = executors[e];
            other->def.executor_context = &tasks;
            scene_run(other);
            assert_int_equal(tasks, other->job_count);
            for (uint32_t i = 0; i < serial->job_count; ++i) {
                const verge_vehicle_plan* a = &serial->plans[i];
                const verge_vehicle_plan* b = &other->plans[i];
                assert_int_equal(a->status, b->status);
                CHECK_SAME_BITS(a->cost.total, b->cost.total);
                assert_memory_equal(a->points, b->points, sizeof a->points);
            }
            scene_free(other);
        }
        scene_free(serial);
    }
}

static void test_the_lower_id_plans_again_where_the_higher_has_a_fallback(void** state)
{
    (void)state;
    // Vehicle 1 is off the road beside lane 0 and can only brake straight ahead, across the lane
    // where vehicle 0 wants to drive on.
    scene* w = scene_make(0.0, 0.0);
    scene_vehicle(w, 0, 30.0, 0.0, 0.0, 10.0, 0.0, 10.0);
    scene_vehicle(w, 0, 48.0, -3.5, 0.5, 5.0, 0.0, 5.0)->on_road = false;

    scene_run(w);

    assert_int_equal(w->plans[1].status, VERGE_FALLBACK_BRAKE);
    assert_int_equal(w->plans[1].reason, VERGE_REASON_OFF_ROAD);
    assert_int_equal(w->plans[0].status, VERGE_PLANNED);
    assert_true(contact_of(w, 0, 1) > 1e9);
    scene_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_two_vehicles_with_one_gap_as_target_do_not_touch),
        cmocka_unit_test(test_planned_trajectories_never_touch_each_other),
        cmocka_unit_test(test_the_executor_changes_nothing),
        cmocka_unit_test(
            test_the_lower_id_plans_again_where_the_higher_has_a_fallback),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
