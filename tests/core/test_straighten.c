/// Goal: a vehicle that stands turned against its lane straightens out and drives on.
/// Method: cycles of 0.5 s on straight and bent roads of one or two lanes, turned by up to 60
/// degrees to both sides; the strict judge's limits of the body; the place of the body's axis.
#include "check.h"
#include "closed_loop.h"

#include "rng.h"
#include "strict.h"
#include "verge/verge.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS = 161 };
static const double WIDTH = 3.5; // [m]

typedef struct site {
    void*             memory;
    verge_planner_def def;
    verge_planner*    planner;
} site;

static site site_on(const verge_lane_def* lanes, uint32_t lane_count)
{
    site at = { .def = verge_planner_default_def() };
    at.def.road = (verge_road_def){ lanes, lane_count };
    at.def.iterations = 100;
    at.def.controlled_max = 1;
    at.def.vehicles_max = 2;
    const size_t size = (verge_planner_memory_size(&at.def) + 63) / 64 * 64;
    at.memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&at.planner, &at.def, at.memory, size), VERGE_OK);
    return at;
}

/// `lanes` lanes side by side, the rightmost through the origin, with this curvature.
static site site_make(uint32_t lanes, double curvature)
{
    static double points[2][POINTS][2];
    verge_lane_def defs[2];
    memset(defs, 0, sizeof defs);
    for (uint32_t l = 0; l < lanes; ++l) {
        for (int i = 0; i < POINTS; ++i) {
            const double s = i * 1.5, k = curvature;
            const double x = k == 0.0 ? s : sin(k * s) / k;
            const double y = k == 0.0 ? 0.0 : (1.0 - cos(k * s)) / k;
            points[l][i][0] = x - WIDTH * l * sin(k * s);
            points[l][i][1] = y + WIDTH * l * cos(k * s);
        }
        defs[l] = (verge_lane_def){ .id = (int32_t)l, .points = (const double (*)[2])points[l],
                                    .point_count = POINTS, .width = WIDTH, .speed_limit = 13.9,
                                    .left = l + 1 < lanes ? 1 : VERGE_NO_LANE,
                                    .right = l == 1 ? 0 : VERGE_NO_LANE };
    }
    return site_on(defs, lanes);
}

static verge_vehicle standing(const site* at, double s, double d, double turned)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = 1;
    vehicle.length = 4.8;
    vehicle.width = 1.9;
    verge_road_at(verge_planner_road(at->planner), 0, s, d, &vehicle.x, &vehicle.y,
                  &vehicle.heading);
    vehicle.heading += turned;
    return vehicle;
}

static void drive_on(const verge_vehicle_plan* plan, verge_vehicle* vehicle)
{
    take_point(vehicle, &plan->points[5]);
}

/// How far the ends of the body's axis lie beside the lanes. [m]
static double beside(const site* at, const verge_vehicle* vehicle, uint32_t lanes)
{
    const verge_road* road = verge_planner_road(at->planner);
    double most = 0.0;
    for (int end = -1; end <= 1; end += 2) {
        const double x = vehicle->x + 0.5 * end * vehicle->length * cos(vehicle->heading);
        const double y = vehicle->y + 0.5 * end * vehicle->length * sin(vehicle->heading);
        const double d = verge_road_project_on(road, 0, x, y).d;
        most = fmax(most, fmax(-0.5 * WIDTH - d, d - (lanes - 0.5) * WIDTH));
    }
    return most;
}

static void turned_against_its_lane_it_comes_back_and_drives_on(void** state)
{
    (void)state;
    static verge_plan plan;
    test_rng rng = test_rng_seeded("turned");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        const uint32_t lanes = 1 + round % 2;
        const double curvature = round % 3 == 0 ? 0.0 : round % 3 == 1 ? 0.01 : -0.01;
        const site at = site_make(lanes, curvature);
        const double most = lanes == 2 ? M_PI / 3.0 : M_PI / 5.0; // beside the road there is none
        const double low = lanes == 2 ? 0.0 : -most;
        const double turned = test_rng_between(&rng, low, most);
        verge_vehicle vehicle = standing(&at, 40.0, test_rng_between(&rng, -0.1, 0.3), turned);
        vehicle.controlled = true;
        const double start = fmax(beside(&at, &vehicle, lanes), 0.0);
        const double x = vehicle.x, y = vehicle.y;
        for (int64_t cycle = 0; cycle < 60 && hypot(vehicle.x - x, vehicle.y - y) < 45.0; ++cycle) {
            assert_int_equal(verge_planner_step(at.planner, 500000 * cycle, &vehicle, 1, &plan),
                             VERGE_OK);
            assert_int_equal(plan.vehicles[0].status, VERGE_PLANNED);
            char text[160];
            const verge_body body = verge_vehicle_body(&vehicle);
            const char* fault = strict_motion_fault(&plan.vehicles[0], &body, 0.1, text);
            // Where two plans join, the wheel changes its rate: positions overstate it there.
            if (fault != NULL && strncmp(text, "t=0.00", 6) != 0) {
                fail_msg("round %u, cycle %d: %s: %s", round, (int)cycle, fault, text);
            }
            drive_on(&plan.vehicles[0], &vehicle);
            CHECK_AT_MOST(beside(&at, &vehicle, lanes), start + 0.4);
        }
        if (hypot(vehicle.x - x, vehicle.y - y) < 45.0) {
            fail_msg("round %u, turned by %.2f: at %.1f, %.1f, heading %.2f, %.1f m/s", round,
                     turned, vehicle.x, vehicle.y, vehicle.heading, vehicle.speed);
        }
        const verge_lane_position on =
            verge_road_project_on(verge_planner_road(at.planner), 0, vehicle.x, vehicle.y);
        CHECK_NEAR(on.d, 0.0, 0.8);
        CHECK_NEAR(remainder(vehicle.heading - on.heading, 2.0 * M_PI), 0.0, 0.1);
        free(at.memory);
    }
}

static void while_it_stands_it_keeps_its_heading(void** state)
{
    (void)state;
    static verge_plan plan;
    const site at = site_make(1, 0.0);
    for (int degrees = -80; degrees <= 80; degrees += 10) {
        const double turned = degrees * M_PI / 180.0;
        verge_vehicle vehicles[2] = { standing(&at, 40.0, 0.0, turned),
                                      standing(&at, 46.0, 0.0, M_PI / 2.0) };
        vehicles[0].controlled = true;
        vehicles[1].id = 2;
        verge_planner_reset(at.planner);
        assert_int_equal(verge_planner_step(at.planner, 0, vehicles, 2, &plan), VERGE_OK);
        const verge_vehicle_plan* own = &plan.vehicles[0];
        for (uint32_t k = 1; k < own->point_count && own->points[k].speed == 0.0; ++k) {
            CHECK_NEAR(own->points[k].heading, turned, 1e-6);
            CHECK_NEAR(own->points[k].x, vehicles[0].x, 1e-6);
            CHECK_NEAR(own->points[k].y, vehicles[0].y, 1e-6);
        }
    }
    free(at.memory);
}

/// A corner that was surveyed by three points.
static void a_corner_sharper_than_its_steering_is_driven_at_walking_speed(void** state)
{
    (void)state;
    static verge_plan plan;
    for (int k = test_rounds_suffice() ? 0 : 5; k < 8; ++k) {
        const double turned = (k % 2 == 0 ? 1.0 : -1.0) * (80.0 + 3.0 * k) * M_PI / 180.0;
        const double points[3][2] = { { 0.0, 0.0 }, { 70.0, 0.0 },
                                      { 70.0 + 80.0 * cos(turned), 80.0 * sin(turned) } };
        const verge_lane_def lane = { .id = 0, .points = points, .point_count = 3, .width = WIDTH,
                                      .speed_limit = 13.9, .left = VERGE_NO_LANE,
                                      .right = VERGE_NO_LANE };
        const site at = site_on(&lane, 1);
        verge_vehicle vehicle = standing(&at, 50.0, 0.0, 0.0);
        vehicle.controlled = true;
        vehicle.speed = 3.0;
        double stood = 0.0;
        for (int64_t cycle = 0; cycle < 100 && fabs(vehicle.y) < 15.0; ++cycle) {
            assert_int_equal(verge_planner_step(at.planner, 500000 * cycle, &vehicle, 1, &plan),
                             VERGE_OK);
            drive_on(&plan.vehicles[0], &vehicle);
            stood += vehicle.speed < 0.1 ? 0.5 : 0.0;
        }
        if (fabs(vehicle.y) < 15.0 || stood > 2.0) {
            fail_msg("%.0f degrees: at %.1f, %.1f, stood %.1f s", turned * 180.0 / M_PI, vehicle.x,
                     vehicle.y, stood);
        }
        free(at.memory);
    }
}

/// A decision that changes to the left lane at walking speed, one half of the lane a step.
static void decide_change(const verge_scene* scene, uint32_t index, verge_vehicle_decision* to)
{
    const verge_lane_position* at = &scene->positions[index];
    double v = scene->vehicles[index].speed, s = at->s, y = WIDTH * at->lane_id + at->d;
    memset(to, 0, sizeof *to);
    to->vehicle_id = scene->vehicles[index].id;
    for (uint32_t t = 0; t < 4; ++t) {
        const bool there = y > WIDTH - 0.1;
        const double v1 = fmin(v + 1.5, 2.5), way = 0.75 * (v + v1);
        y = there ? WIDTH : fmin(y + fmin(1.75, 0.7 * way), WIDTH);
        s += way;
        v = v1;
        to->steps[to->step_count++] = (verge_action_step){
            .action = there ? VERGE_KEEP_SPEED : VERGE_CHANGE_LEFT, .lane_id = y > 0.5 * WIDTH,
            .t0 = 1.5 * t, .t1 = 1.5 * (t + 1), .s = s, .d = y > 0.5 * WIDTH ? y - WIDTH : y,
            .v = v, .distance = way, .ahead_id = -1, .behind_id = -1 };
    }
}

/// The stages of a trajectory, for decisions by hand.
typedef struct by_hand {
    verge_scene         scene;
    verge_vehicle       vehicles[2];
    verge_lane_position positions[2];
    verge_tracks        tracks;
    verge_track         of[2];
    verge_predictor*    predictor;
    verge_sampler*      sampler;
    void*               memory[2];
} by_hand;

static void by_hand_open(by_hand* self, const site* at)
{
    memset(self, 0, sizeof *self);
    self->scene = verge_scene_make(verge_planner_road(at->planner), self->vehicles,
                                   self->positions, 2);
    self->tracks = verge_tracks_make(self->of, 2);
    const size_t sizes[2] = { verge_predictor_memory_size(&at->def),
                              verge_sampler_memory_size(&at->def) };
    for (int i = 0; i < 2; ++i) {
        self->memory[i] = aligned_alloc(64, (sizes[i] + 63) / 64 * 64);
    }
    assert_int_equal(verge_predictor_init(&self->predictor, &at->def, self->memory[0], sizes[0]),
                     VERGE_OK);
    assert_int_equal(verge_sampler_init(&self->sampler, &at->def, self->memory[1], sizes[1]),
                     VERGE_OK);
}

/// From 3.7 m behind a standing vehicle on, a change that is decided comes out beside it.
static void close_behind_a_standing_body_it_comes_out_beside_it(void** state)
{
    (void)state;
    const site at = site_make(2, 0.0);
    by_hand stages;
    by_hand_open(&stages, &at);
    for (double gap = 3.7; gap < 15.0; gap += test_rounds_suffice() ? 0.7 : 8.0) {
        verge_vehicle vehicles[2] = { standing(&at, 40.0, 0.0, 0.0),
                                      standing(&at, 44.8 + gap, 0.0, 0.0) };
        vehicles[0].controlled = true;
        vehicles[1].id = 2;
        static verge_vehicle_plan plan, before;
        before = (verge_vehicle_plan){ .vehicle_id = -1 };
        for (int64_t cycle = 0; cycle < 30; ++cycle) {
            verge_vehicle_decision own;
            assert_int_equal(verge_scene_place(&stages.scene, 500000 * cycle, vehicles, 2, NULL),
                             VERGE_OK);
            decide_change(&stages.scene, 0, &own);
            verge_decision decision = verge_decision_make(&own, 1);
            decision.vehicle_count = 1;
            assert_int_equal(verge_predict(stages.predictor, &stages.scene, &decision,
                                           &stages.tracks), VERGE_OK);
            assert_int_equal(verge_plan_vehicle(stages.sampler, &stages.scene, &own,
                                                &stages.tracks, &before, &plan), VERGE_OK);
            assert_int_equal(plan.status, VERGE_PLANNED);
            before = plan;
            drive_on(&plan, &vehicles[0]);
            assert_false(verge_vehicles_overlap(&vehicles[0], &vehicles[1]));
        }
        if (vehicles[0].x < vehicles[1].x + 4.8) {
            fail_msg("gap %.1f: at %.1f, %.1f, turned by %.2f", gap, vehicles[0].x, vehicles[0].y,
                     vehicles[0].heading);
        }
    }
    free(stages.memory[0]);
    free(stages.memory[1]);
    free(at.memory);
}

/// The planner as a whole: a change that it decides at standstill is driven before it is too late.
static void from_standstill_behind_a_standing_body_it_drives_past(void** state)
{
    (void)state;
    static verge_plan plan;
    site at = site_make(2, 0.0);
    for (double gap = 6.0; gap < 20.0; gap += test_rounds_suffice() ? 1.3 : 8.0) {
        verge_vehicle vehicles[2] = { standing(&at, 40.0, 0.0, 0.0),
                                      standing(&at, 44.8 + gap, 0.0, 0.0) };
        vehicles[0].controlled = true;
        vehicles[1].id = 2;
        verge_planner_reset(at.planner);
        for (int64_t cycle = 0; cycle < 60; ++cycle) {
            assert_int_equal(verge_planner_step(at.planner, 500000 * cycle, vehicles, 2, &plan),
                             VERGE_OK);
            drive_on(&plan.vehicles[0], &vehicles[0]);
            assert_false(verge_vehicles_overlap(&vehicles[0], &vehicles[1]));
        }
        if (vehicles[0].x < vehicles[1].x + 4.8) {
            fail_msg("gap %.1f: at %.1f, %.1f, turned by %.2f", gap, vehicles[0].x, vehicles[0].y,
                     vehicles[0].heading);
        }
    }
    free(at.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(turned_against_its_lane_it_comes_back_and_drives_on),
        cmocka_unit_test(close_behind_a_standing_body_it_comes_out_beside_it),
        cmocka_unit_test(from_standstill_behind_a_standing_body_it_drives_past),
        cmocka_unit_test(a_corner_sharper_than_its_steering_is_driven_at_walking_speed),
        cmocka_unit_test(while_it_stands_it_keeps_its_heading),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
