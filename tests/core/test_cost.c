/// Goal: the cost of a trajectory is that of the paper.
/// Method: the cost of random legs against the equations written out: Eq. 6 with finite differences
/// in time, Eq. 7 to 9 term by term with bodies as corner points.
#include "candidates.h"
#include "check.h"
#include "room.h"

/// Set where a body stands exactly at the edge of the alert zone, where the cost jumps.
static bool at_edge;

/// Eq. 8 for a body at (x, y, heading) and another one, by their corners in the own frame.
static double slow_alert(const verge_planner_def* def, double length, double width, double x,
                         double y, double heading, double v, const verge_track* other, uint32_t k)
{
    double low[2] = { 1e9, 1e9 }, high[2] = { -1e9, -1e9 };
    const double angle = atan2(other->sin_heading[k], other->cos_heading[k]);
    for (int i = 0; i < 4; ++i) {
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
    for (int i = 0; i < 5; ++i) {
        slow_position(leg, offset, t + h * (i - 2), p[i]);
    }
    double v[2], a[2];
    for (int i = 0; i < 2; ++i) {
        v[i] = (p[0][i] - 8 * p[1][i] + 8 * p[3][i] - p[4][i]) / (12 * h);
        a[i] = (p[1][i] - 2 * p[2][i] + p[3][i]) / (h * h);
    }
    const double speed = hypot(v[0], v[1]);
    return (pose){ p[2][0], p[2][1], atan2(v[1], v[0]), speed,
                   (v[0] * a[0] + v[1] * a[1]) / speed,
                   (v[0] * a[1] - v[1] * a[0]) / (speed * speed * speed), 0.0 };
}

static void test_the_cost_of_a_leg_equals_the_direct_form_of_the_paper(void** state)
{
    (void)state;
    TEST_BATCH(batch);
    TEST_PATH(path);
    test_rng rng = test_rng_seeded("cost");
    uint32_t compared = 0;
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        scene* w = candidates_scene(&rng);
        candidates_sample(w, true, w->def.points - 1, &batch, &path);
        const double axle = w->limits.rear_axle;
        const verge_weights weights = { 100.0, 1.0, 5.0, 1.0, 0.0, 4.0 }; // jerk: test_kinematics.c
        for (uint32_t i = 0; i < batch.leg_count * batch.offset_count; i += 5) {
            const vg_leg* leg = &batch.legs[i / batch.offset_count];
            const double offset = batch.offsets[i % batch.offset_count];
            double cost = 0.0;
            at_edge = false;
            for (uint32_t k = 1; k <= batch.last; ++k) {
                const double t = w->def.point_s * k;
                const pose p = slow_pose(leg, offset, fmin(t, 2.995));
                const vg_row row = vg_leg_row(leg, fmin(t, 2.995));
                const double road = atan2(row.line.sin_heading, row.line.cos_heading);
                const double off = remainder(p.heading - road, 2.0 * M_PI);
                cost += weights.curvature * p.k * p.k + weights.heading * off * off
                      + weights.acceleration * p.a * p.a;
                const pose q = slow_pose(leg, offset, k == batch.last ? 2.9999 - 4e-3 : t);
                for (uint32_t j = 1; j < w->tracks.count; ++j) {
                    const vg_row end = vg_leg_row(leg, t);
                    const vg_rear rear = vg_rear_of(&end, offset);
                    const double heading = k == batch.last
                        ? atan2(rear.sin_heading, rear.cos_heading) : q.heading;
                    double xy[2];
                    slow_position(leg, offset, t, xy);
                    cost += weights.obstacle
                          * slow_alert(&w->def, 5.0, 2.0, xy[0] + axle * cos(heading),
                                       xy[1] + axle * sin(heading), heading,
                                       k == batch.last ? rear.speed : q.v, &w->tracks.of[j], k);
                }
            }
            if (!at_edge) {
                const verge_cost paid = vg_leg_cost(leg, offset, 0, batch.last, &w->def, &weights,
                                                    &w->tracks, 0, false, 0.0);
                CHECK_NEAR(paid.total, cost, 2e-3 * cost + 1e-3);
                ++compared;
            }
        }
        scene_free(w);
    }
    printf("             %u costs compared\n", compared);
    assert_true(compared > 0);
}

static void test_the_continuous_alert_zone_has_no_edge(void** state)
{
    (void)state;
    vg_alert_zone zone = { 2.5, 1.0, 1.4, 0.5, 3.0, 1.0, true };
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
        cmocka_unit_test(test_the_cost_of_a_leg_equals_the_direct_form_of_the_paper),
        cmocka_unit_test(test_the_continuous_alert_zone_has_no_edge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
