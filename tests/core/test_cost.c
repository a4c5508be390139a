/// Goal: the fast evaluation says what the paper says.
/// Method: every cost and mark of a batch against a slow reading: Eq. 6 with finite differences
/// in time, Eq. 7 to 9 term by term with bodies as corner points; the collision filter against
/// exact contacts.
#include "check.h"
#include "rng.h"
#include "scene.h"
#include "strict.h"

#include "motion/contact.h"
#include "motion/target.h"

/// Set where a body stands exactly at the edge of the alert zone, where the cost jumps.
static bool at_edge;

/// Eq. 8 for a body at (x, y, heading) and another one, by their corners in the own frame.
static double slow_alert(const verge_planner_def* def, double length, double width, double x,
                         double y, double heading, double v, const vg_track* other, uint32_t k)
{
    double low[2] = { 1e9, 1e9 }, high[2] = { -1e9, -1e9 };
    const double angle = atan2(other->sin_heading[k], other->cos_heading[k]);
    for (int i = 0; i < 4; i += 1) {
        const double l = (i & 1 ? 1 : -1) * other->half_length;
        const double w = (i & 2 ? 1 : -1) * other->half_width;
        const double px = other->x[k] + l * cos(angle) - w * sin(angle) - x;
        const double py = other->y[k] + l * sin(angle) + w * cos(angle) - y;
        const double ahead = px * cos(heading) + py * sin(heading);
        const double left = py * cos(heading) - px * sin(heading);
        low[0] = fmin(low[0], ahead);
        high[0] = fmax(high[0], ahead);
        low[1] = fmin(low[1], left);
        high[1] = fmax(high[1], left);
    }
    const double dv = v - other->speed[k] * cos(angle - heading);
    const double safe = fmax(0.0, v * def->reaction_s + def->headway_s * dv);
    const double dx = fmax(0.0, fmax(low[0] - length / 2, -length / 2 - high[0]));
    const double dy = fmax(0.0, fmax(low[1] - width / 2, -width / 2 - high[1]));
    const double reach = low[0] + high[0] > 0.0 ? safe : 1.5 * length;
    at_edge |= fabs(dx - reach) < 1e-3 || fabs(dy - 0.25 * width) < 1e-3
            || (fabs(low[0] + high[0]) < 1e-2 && dy <= 0.25 * width);
    if (dx > reach || dy > 0.25 * width) {
        return 0.0;
    }
    return def->alert_cost * (2.0 - dx / (safe + 1.5 * length) - dy / (1.5 * width));
}

typedef struct pose {
    double x, y, heading, v, a, k, j;
} pose;

/// Position by Eq. 6 alone; everything else by differences in time.
static void slow_position(const vg_leg* leg, double offset, double t, double xy[2])
{
    const vg_row row = vg_leg_row(leg, t);
    const double d = row.base[0] + offset * row.shape[0];
    xy[0] = row.line.x - d * row.line.sin_heading;
    xy[1] = row.line.y + d * row.line.cos_heading;
}

static pose slow_pose(const vg_leg* leg, double offset, double t)
{
    const double h = 2e-3;
    double p[5][2];
    for (int i = 0; i < 5; i += 1) {
        slow_position(leg, offset, t + h * (i - 2), p[i]);
    }
    double v[2], a[2];
    for (int i = 0; i < 2; i += 1) {
        v[i] = (p[0][i] - 8 * p[1][i] + 8 * p[3][i] - p[4][i]) / (12 * h);
        a[i] = (p[1][i] - 2 * p[2][i] + p[3][i]) / (h * h);
    }
    const double speed = hypot(v[0], v[1]);
    return (pose){ p[2][0], p[2][1], atan2(v[1], v[0]), speed,
                   (v[0] * a[0] + v[1] * a[1]) / speed,
                   (v[0] * a[1] - v[1] * a[0]) / (speed * speed * speed), 0.0 };
}

/// A batch of one changing segment in traffic, on a road with bends.
static void random_batch(test_rng* rng, scene** out, vg_batch* batch, vg_path* path)
{
    static const double curvatures[] = { 0.0, 1.0 / 125.0, -1.0 / 80.0 };
    scene* w = *out = scene_make(curvatures[test_rng_below(rng, 3)], 0.0);
    const double v = test_rng_between(rng, 5.0, 20.0);
    const double off = test_rng_between(rng, -0.5, 0.5);
    const double slant = test_rng_between(rng, -0.02, 0.02);
    vg_job* job = scene_vehicle(w, 1, 40.0, off, slant, v, 0.3, v);
    job->segments[0].action = VERGE_CHANGE_LEFT;
    job->segments[0].lane = 2;
    for (int i = 0; i < 8; i += 1) {
        const double s = test_rng_between(rng, 10.0, 90.0), d = test_rng_between(rng, -1.0, 8.0);
        const double speed = test_rng_between(rng, 0.0, 20.0);
        scene_track(w, s, d, speed, test_rng_between(rng, -1.0, 1.0));
    }
    vg_path_build(path, w->road, 2, -1, job->s - 30.0, job->s + 170.0);
    const verge_vehicle* car = job->vehicle;
    const vg_motion centre = { car->x, car->y, car->heading, car->speed, car->acceleration,
                               car->yaw_rate / car->speed };
    const vg_motion rear = vg_motion_of_rear(&centre);
    const vg_state start = vg_state_of(path, &rear, job->s);
    assert_true(start.valid);
    batch->start = 0;
    batch->last = w->def.points - 1;
    batch->in_lane = false;
    batch->comfort = (vg_comfort){ 1.0 / 4.0, 1.0 / 6.0, 1.0 / 4.0, 1.0 / 4.0 };
    vg_target_sample(batch, job, &job->segments[0], path, 2, &start, 3.0, &w->tracks,
                     false);
}

static void test_fast_cost_equals_the_slow_reading_of_the_paper(void** state)
{
    (void)state;
    static vg_batch batch;
    static vg_path path;
    test_rng rng = test_rng_seeded("cost");
    uint32_t compared = 0;
    for (uint32_t round = 0; round < test_rounds(20); round += 1) {
        scene* w;
        random_batch(&rng, &w, &batch, &path);
        const verge_weights weights = { 100.0, 1.0, 5.0, 1.0, 0.0, 4.0 }; // jerk: test_kinematics.c
        vg_batch_run(&batch, &w->def, &weights, &w->tracks, 0);
        for (uint32_t i = 0; i < batch.leg_count * batch.offset_count; i += 5) {
            const vg_leg* leg = &batch.legs[i / batch.offset_count];
            const double offset = batch.offsets[i % batch.offset_count];
            double cost = 0.0;
            at_edge = false;
            for (uint32_t k = 1; k <= batch.last; k += 1) {
                const double t = w->def.point_s * k;
                const pose p = slow_pose(leg, offset, fmin(t, 2.995));
                const vg_row row = vg_leg_row(leg, fmin(t, 2.995));
                const double road = atan2(row.line.sin_heading, row.line.cos_heading);
                const double off = remainder(p.heading - road, 2.0 * M_PI);
                cost += weights.curvature * p.k * p.k + weights.heading * off * off
                      + weights.acceleration * p.a * p.a;
                const pose q = slow_pose(leg, offset, k == batch.last ? 2.9999 - 4e-3 : t);
                for (uint32_t j = 1; j < w->tracks.count; j += 1) {
                    const vg_row end = vg_leg_row(leg, t);
                    const vg_rear rear = vg_rear_of(&end, offset);
                    const double heading = k == batch.last
                        ? atan2(rear.sin_heading, rear.cos_heading) : q.heading;
                    double xy[2];
                    slow_position(leg, offset, t, xy);
                    cost += weights.obstacle
                          * slow_alert(&w->def, 5.0, 2.0, xy[0] + 1.4227 * cos(heading),
                                       xy[1] + 1.4227 * sin(heading), heading,
                                       k == batch.last ? rear.speed : q.v, &w->tracks.of[j], k);
                }
            }
            if (!at_edge) {
                CHECK_NEAR(batch.costs[i], cost, 2e-3 * cost + 1e-3);
                compared += 1;
            }
            const verge_cost straight = vg_leg_cost(leg, offset, 0, batch.last, &w->def, &weights,
                                                    &w->tracks, 0, false);
            CHECK_NEAR(batch.costs[i], straight.total, 1e-9 * straight.total + 1e-9);
        }
        scene_free(w);
    }
    printf("             %u costs compared\n", compared);
    assert_true(compared > 0);
}

static void test_what_raises_no_alarm_touches_nobody(void** state)
{
    (void)state;
    static vg_batch batch;
    static vg_path path;
    static vg_track body;
    test_rng rng = test_rng_seeded("alarm");
    const verge_weights weights = { 1, 1, 1, 1, 1, 1 };
    uint32_t alarms = 0, contacts = 0;
    for (uint32_t round = 0; round < test_rounds(100); round += 1) {
        scene* w;
        random_batch(&rng, &w, &batch, &path);
        w->def.clearance = 0.0;
        vg_batch_run(&batch, &w->def, &weights, &w->tracks, 0);
        for (uint32_t i = 0; i < batch.leg_count * batch.offset_count; i += 3) {
            body = w->tracks.of[0];
            for (uint32_t k = 0; k <= batch.last; k += 1) {
                const vg_row row = vg_leg_row(&batch.legs[i / batch.offset_count],
                                              w->def.point_s * k);
                const vg_rear rear = vg_rear_of(&row, batch.offsets[i % batch.offset_count]);
                body.x[k] = rear.x + VERGE_REAR_AXLE * rear.cos_heading;
                body.y[k] = rear.y + VERGE_REAR_AXLE * rear.sin_heading;
                body.cos_heading[k] = rear.cos_heading;
                body.sin_heading[k] = rear.sin_heading;
            }
            bool contact = false;
            for (uint32_t j = 1; j < w->tracks.count; j += 1) {
                const double t = strict_contact(&body, &w->tracks.of[j], w->def.points,
                                                w->def.point_s, 1e-9);
                contact |= t < 1e9;
                // And the exact check misses none.
                const uint32_t k = vg_contact_first(&body, &w->tracks.of[j], 0.0, 0, batch.last);
                assert_true(t > 1e9 || w->def.point_s * (k - 1) <= t + 1e-9);
            }
            const bool alarm = (batch.marks[i] & VG_ALARM) != 0;
            assert_true(alarm || !contact);
            alarms += alarm;
            contacts += contact;
        }
        scene_free(w);
    }
    printf("             %u alarms for %u contacts\n", alarms, contacts);
    assert_true(contacts > 0 && alarms < 3 * contacts);
}

static void test_the_continuous_alert_zone_has_no_edge(void** state)
{
    (void)state;
    vg_alert_zone zone = { 2.5, 1.0, 0.5, 3.0, 1.0, true };
    for (double left = -3.0; left <= 3.0; left += 0.25) {
        double before = vg_alert_term(&zone, -20.0, left, 2.5, 1.0, 12.0, 10.0);
        for (double ahead = -20.0; ahead <= 30.0; ahead += 1e-3) {
            const double now = vg_alert_term(&zone, ahead, left, 2.5, 1.0, 12.0, 10.0);
            CHECK_NEAR(now, before, 1e-3);
            assert_true(now >= 0.0 && now <= 2.0 * zone.cost);
            before = now;
        }
    }
    // The paper's form has one: just inside it costs a lot, just outside nothing.
    zone.continuous = false;
    assert_true(vg_alert_term(&zone, 16.99, 0.0, 2.5, 1.0, 12.0, 10.0) > 0.9);
    CHECK_NEAR(vg_alert_term(&zone, 17.01, 0.0, 2.5, 1.0, 12.0, 10.0), 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fast_cost_equals_the_slow_reading_of_the_paper),
        cmocka_unit_test(test_what_raises_no_alarm_touches_nobody),
        cmocka_unit_test(test_the_continuous_alert_zone_has_no_edge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
