/// Goal: a bus, a rigid and an articulated truck are planned round corners of 12, 15 and 20 m with
/// their own axles, steering and trailer.
/// Method: the closed loop of planner and road; the strict judge with the body's limits; the path
/// of the front wheels integrated to that of the rear wheels, and the hitch's to the trailer's, by
/// formulas of this file; the closed form of steady-state off-tracking. Single cases for a trailer
/// that other vehicles, and its own tractor, have to leave room for.
#include "check.h"
#include "closed_loop.h"
#include "strict.h"

#include "verge/verge.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS_MAX = 400, ROWS_MAX = 1200, PER_PLAN = 5 };
static const double LEAD = 60.0; // [m] straight before the corner

/// One lane: straight on to (LEAD, 0), then to the left round (LEAD, radius), then straight on.
typedef struct corner {
    double points[POINTS_MAX][2];
    uint32_t count;
    double radius; // [m]
    verge_lane_def lane;
    verge_planner_def def;
    verge_planner* planner;
    void* memory;
} corner;

static verge_plan plan;

static void point_add(corner* at, double x, double y)
{
    assert_true(at->count < POINTS_MAX);
    at->points[at->count][0] = x;
    at->points[at->count++][1] = y;
}

static void corner_open(corner* at, double radius, double turn)
{
    *at = (corner){ .radius = radius };
    for (double x = 0.0; x < LEAD - 1e-9; x += 5.0) {
        point_add(at, x, 0.0);
    }
    const uint32_t arc = (uint32_t)(radius * turn);
    for (uint32_t i = 0; i <= arc; ++i) {
        const double angle = turn * i / arc;
        point_add(at, LEAD + radius * sin(angle), radius - radius * cos(angle));
    }
    const double x = at->points[at->count - 1][0], y = at->points[at->count - 1][1];
    for (double s = 5.0; s <= 150.0; s += 5.0) {
        point_add(at, x + s * cos(turn), y + s * sin(turn));
    }
    at->lane = (verge_lane_def){ .id = 0, .points = (const double (*)[2])at->points,
                                 .point_count = at->count, .width = 5.0, .speed_limit = 14.0,
                                 .left = VERGE_NO_LANE, .right = VERGE_NO_LANE };
    at->def = verge_planner_default_def();
    at->def.iterations = 200;
    at->def.nodes_max = 512;
    at->def.road = (verge_road_def){ &at->lane, 1 };
    const size_t size = (verge_planner_memory_size(&at->def) + 63) / 64 * 64;
    at->memory = aligned_alloc(64, size);
    assert_non_null(at->memory);
    assert_int_equal(verge_planner_init(&at->planner, &at->def, at->memory, size), VERGE_OK);
}

/// A vehicle with this body on the straight before the corner, 45 m of it ahead.
static verge_vehicle vehicle_of(verge_body_kind kind)
{
    verge_vehicle vehicle = verge_vehicle_default();
    const verge_body body = verge_body_of(kind);
    verge_vehicle_set_body(&vehicle, &body);
    vehicle.id = 1;
    vehicle.controlled = true;
    vehicle.x = 15.0;
    vehicle.speed = 8.0;
    return vehicle;
}

/// Where a vehicle was, 0.1 s apart.
typedef struct drive {
    uint32_t count;
    uint32_t fallbacks;
    verge_vehicle at[ROWS_MAX];
} drive;

static void take_point_with_trailer(verge_vehicle* vehicle, const verge_point* p)
{
    const verge_vehicle before = *vehicle;
    take_point(vehicle, p);
    vehicle->trailer_heading = verge_vehicle_trailer_heading(&before, vehicle);
}

/// The closed loop with vehicles[0] as the planned one; the others stand. Every plan is judged.
static void corner_drive(corner* at, verge_vehicle* vehicles, uint32_t count, double seconds,
                         drive* out)
{
    const verge_body body = verge_vehicle_body(&vehicles[0]);
    *out = (drive){ .count = 1, .at = { vehicles[0] } };
    for (uint32_t tick = 0; tick < (uint32_t)(seconds * 10.0); tick += PER_PLAN) {
        assert_int_equal(verge_planner_step(at->planner, tick * 100000, vehicles, count, &plan),
                         VERGE_OK);
        char text[160] = "";
        const char* fault = strict_motion_fault(&plan.vehicles[0], &body, at->def.point_s, text);
        if (fault != NULL) {
            fail_msg("radius %g, %.1f s: %s: %s", at->radius, 0.1 * tick, fault, text);
        }
        out->fallbacks += plan.vehicles[0].status != VERGE_PLANNED;
        for (uint32_t k = 1; k <= PER_PLAN; ++k) {
            take_point_with_trailer(&vehicles[0], &plan.vehicles[0].points[k]);
            out->at[out->count++] = vehicles[0];
        }
    }
}

static const verge_body_kind kinds[] = { VERGE_BODY_BUS, VERGE_BODY_TRUCK,
                                         VERGE_BODY_ARTICULATED };
static const double radii[] = { 12.0, 15.0, 20.0 };

/// A point that lies `ahead` of the centre.
static void point_of(const verge_vehicle* v, double ahead, double xy[2])
{
    xy[0] = v->x + ahead * cos(v->heading);
    xy[1] = v->y + ahead * sin(v->heading);
}

/// Heading of a rod of this length whose front end moves straight from one point to the next and
/// whose rear end does not slip sideways: heading' = |velocity| sin(direction - heading) / length,
/// by Heun's method in 100 steps.
static double pulled(double heading, double length, const double from[2], const double to[2])
{
    const double way = hypot(to[0] - from[0], to[1] - from[1]) / 100.0;
    const double direction = atan2(to[1] - from[1], to[0] - from[0]);
    for (int i = 0; i < 100; ++i) {
        const double first = sin(direction - heading) * way / length;
        heading += 0.5 * (first + sin(direction - heading - first) * way / length);
    }
    return heading;
}

static void test_rear_wheels_follow_the_front_wheels_of_the_body(void** state)
{
    (void)state;
    static drive driven;
    for (size_t i = 0; i < 9; ++i) {
        static corner at;
        corner_open(&at, radii[i % 3], 0.5 * M_PI);
        verge_vehicle vehicle = vehicle_of(kinds[i / 3]);
        const verge_body body = vehicle.body;
        corner_drive(&at, &vehicle, 1, 22.0, &driven);
        double heading = 0.0;
        for (uint32_t k = 1; k < driven.count; ++k) {
            double from[2], to[2];
            point_of(&driven.at[k - 1], body.wheelbase - body.rear_axle, from);
            point_of(&driven.at[k], body.wheelbase - body.rear_axle, to);
            heading = pulled(heading, body.wheelbase, from, to);
            CHECK_NEAR(remainder(heading - driven.at[k].heading, 2.0 * M_PI), 0.0, 0.01);
        }
        CHECK_NEAR(driven.at[driven.count - 1].heading, 0.5 * M_PI, 0.02); // it is round
        assert_int_equal(driven.fallbacks, 0);
        free(at.memory);
    }
}

static void test_the_trailer_follows_the_hitch(void** state)
{
    (void)state;
    static drive driven;
    for (size_t i = 0; i < 3; ++i) {
        static corner at;
        corner_open(&at, radii[i], 0.5 * M_PI);
        verge_vehicle vehicle = vehicle_of(VERGE_BODY_ARTICULATED);
        corner_drive(&at, &vehicle, 1, 22.0, &driven);
        double heading = 0.0, most = 0.0;
        for (uint32_t k = 1; k < driven.count; ++k) {
            double from[2], to[2];
            point_of(&driven.at[k - 1], -vehicle.body.hitch, from);
            point_of(&driven.at[k], -vehicle.body.hitch, to);
            heading = pulled(heading, vehicle.body.trailer_axle, from, to);
            CHECK_NEAR(driven.at[k].trailer_heading, heading, 0.005);
            most = fmax(most, driven.at[k].heading - heading);
        }
        assert_true(most > 0.3); // the tractor turns ahead of it
        free(at.memory);
    }
}

/// Distance from the centre of the corner. [m]
static double distance(const corner* at, const double xy[2])
{
    return hypot(xy[0] - LEAD, xy[1] - at->radius);
}

/// Off-tracking of the axle on a rod of this length, and the closed form of it in a steady turn:
/// front and rear end on circles about one centre, the rod a tangent of the inner one.
static void compare_off_tracking(const corner* at, const double front[2], const double rear[2],
                                 double length, double sum[2])
{
    const double r = distance(at, front);
    sum[0] += r - distance(at, rear);
    sum[1] += r - sqrt(r * r - length * length);
}

static void test_off_tracking_in_a_long_corner_is_that_of_the_closed_form(void** state)
{
    (void)state;
    static drive driven;
    for (size_t i = 0; i < 9; ++i) {
        static corner at;
        corner_open(&at, radii[i % 3], 1.5 * M_PI);
        verge_vehicle vehicle = vehicle_of(kinds[i / 3]);
        const verge_body body = vehicle.body;
        corner_drive(&at, &vehicle, 1, 40.0, &driven);
        // The mean from 150 to 250 of the 270 degrees: plans keep the lane within some 10 cm only.
        double turned = 0.0, body_sum[2] = { 0 }, trailer_sum[2] = { 0 };
        uint32_t count = 0;
        for (uint32_t k = 1; k < driven.count && turned < M_PI / 180.0 * 250.0; ++k) {
            const verge_vehicle* v = &driven.at[k];
            turned += remainder(v->heading - driven.at[k - 1].heading, 2.0 * M_PI);
            if (turned < M_PI / 180.0 * 150.0) {
                continue;
            }
            double front[2], rear[2], hitch[2];
            point_of(v, body.wheelbase - body.rear_axle, front);
            point_of(v, -body.rear_axle, rear);
            point_of(v, -body.hitch, hitch);
            const double axle[2] = { hitch[0] - body.trailer_axle * cos(v->trailer_heading),
                                     hitch[1] - body.trailer_axle * sin(v->trailer_heading) };
            compare_off_tracking(&at, front, rear, body.wheelbase, body_sum);
            compare_off_tracking(&at, hitch, axle, body.trailer_axle, trailer_sum);
            ++count;
        }
        assert_true(count > 20);
        CHECK_NEAR(body_sum[0] / count, body_sum[1] / count, 0.05);
        if (body.trailer_length > 0.0) {
            CHECK_NEAR(trailer_sum[0] / count, trailer_sum[1] / count, 0.08);
        }
        free(at.memory);
    }
}

/// Do two rectangles overlap? (x, y, heading, length, width) each.
static bool overlap(const double a[5], const double b[5])
{
    strict_polygon both[2];
    for (int i = 0; i < 2; ++i) {
        const double* q = i == 0 ? a : b;
        static const double sides[4][2] = { { 1, 1 }, { -1, 1 }, { -1, -1 }, { 1, -1 } };
        both[i].count = 4;
        for (int n = 0; n < 4; ++n) {
            const double l = 0.5 * sides[n][0] * q[3], w = 0.5 * sides[n][1] * q[4];
            both[i].p[n][0] = q[0] + l * cos(q[2]) - w * sin(q[2]);
            both[i].p[n][1] = q[1] + l * sin(q[2]) + w * cos(q[2]);
        }
    }
    return strict_shared_area(both[0], &both[1]) > 1e-9;
}

static void trailer_rectangle(const verge_vehicle* v, double out[5])
{
    const verge_body* b = &v->body;
    double hitch[2];
    point_of(v, -b->hitch, hitch);
    const double heading = isnan(v->trailer_heading) ? v->heading : v->trailer_heading;
    const double back = 0.5 * b->trailer_length - b->trailer_front;
    out[0] = hitch[0] - back * cos(heading);
    out[1] = hitch[1] - back * sin(heading);
    out[2] = heading;
    out[3] = b->trailer_length;
    out[4] = b->trailer_width;
}

/// A post inside the corner, beside the lane: the tractor passes it, its trailer cuts the corner.
static verge_vehicle post_inside(const corner* at, double inside)
{
    verge_vehicle post = verge_vehicle_default();
    post.id = 2;
    post.length = post.width = 0.5;
    const double angle = 0.3 * M_PI;
    post.x = LEAD + (at->radius - inside) * sin(angle);
    post.y = at->radius - (at->radius - inside) * cos(angle);
    return post;
}

static void test_a_trailer_does_not_cut_into_what_stands_inside_the_corner(void** state)
{
    (void)state;
    static drive driven;
    for (int with_trailer = 0; with_trailer < 2; ++with_trailer) {
        static corner at;
        corner_open(&at, 12.0, 0.5 * M_PI);
        verge_vehicle vehicles[2] = { vehicle_of(VERGE_BODY_ARTICULATED), post_inside(&at, 2.4) };
        const double post[5] = { vehicles[1].x, vehicles[1].y, 0.0, 0.5, 0.5 };
        vehicles[0].body.trailer_length = with_trailer ? vehicles[0].body.trailer_length : 0.0;
        corner_drive(&at, vehicles, 2, 22.0, &driven);
        bool hit = false;
        for (uint32_t k = 0; k < driven.count; ++k) {
            double trailer[5];
            verge_vehicle seen = driven.at[k];
            seen.body = verge_body_of(VERGE_BODY_ARTICULATED);
            if (!with_trailer) { // where a trailer would be
                seen.trailer_heading = k == 0 ? seen.heading
                                              : verge_vehicle_trailer_heading(&driven.at[k - 1],
                                                                              &seen);
                driven.at[k] = seen;
            }
            trailer_rectangle(&seen, trailer);
            hit = hit || overlap(trailer, post);
            const double tractor[5] = { seen.x, seen.y, seen.heading, seen.length, seen.width };
            assert_false(overlap(tractor, post));
        }
        assert_int_equal(hit, !with_trailer);
        free(at.memory);
    }
}

// ---------------------------------------------------------------------------- others' trailers

/// Two lanes of 600 m, lane 1 to the left of lane 0.
static void straight_open(corner* at)
{
    static const double points[2][2][2] = { { { 0, 0 }, { 600, 0 } }, { { 0, 3.5 }, { 600, 3.5 } } };
    static verge_lane_def lanes[2];
    *at = (corner){ 0 };
    for (int i = 0; i < 2; ++i) {
        lanes[i] = (verge_lane_def){ .id = i, .points = points[i], .point_count = 2, .width = 3.5,
                                     .speed_limit = 14.0, .left = i == 0 ? 1 : VERGE_NO_LANE,
                                     .right = i == 1 ? 0 : VERGE_NO_LANE };
    }
    at->def = verge_planner_default_def();
    at->def.road = (verge_road_def){ lanes, 2 };
    const size_t size = (verge_planner_memory_size(&at->def) + 63) / 64 * 64;
    at->memory = aligned_alloc(64, size);
    assert_non_null(at->memory);
    assert_int_equal(verge_planner_init(&at->planner, &at->def, at->memory, size), VERGE_OK);
}

static void test_a_car_does_not_drive_into_a_trailer(void** state)
{
    (void)state;
    static drive driven;
    // Behind a truck that stands, and beside its trailer with the wish to change to its lane.
    for (int lane = 0; lane < 2; ++lane) {
        static corner at;
        straight_open(&at);
        verge_vehicle vehicles[2] = { verge_vehicle_default(), vehicle_of(VERGE_BODY_ARTICULATED) };
        vehicles[0].controlled = true;
        vehicles[0].x = lane == 0 ? 40.0 : 90.0;
        vehicles[0].y = 3.5 * lane;
        vehicles[0].speed = lane == 0 ? 10.0 : 2.0;
        vehicles[0].target_lane = 0;
        vehicles[1].controlled = false;
        vehicles[1].x = 105.0;
        vehicles[1].speed = 0.0;
        double trailer[5];
        trailer_rectangle(&vehicles[1], trailer);
        corner_drive(&at, vehicles, 2, 15.0, &driven);
        for (uint32_t k = 0; k < driven.count; ++k) {
            const verge_vehicle* v = &driven.at[k];
            const double car[5] = { v->x, v->y, v->heading, v->length, v->width };
            assert_false(overlap(car, trailer));
        }
        // It comes near the trailer's rear and stops, or passes the truck.
        const verge_vehicle* end = &driven.at[driven.count - 1];
        const double rear = trailer[0] - 0.5 * trailer[3];
        const bool stops = end->x + 2.5 < rear && end->x + 2.5 > rear - 8.0;
        assert_true(lane == 1 || stops || end->x > vehicles[1].x + 10.0);
        assert_true(verge_vehicles_distance(end, &vehicles[1]) > 0.0);
        free(at.memory);
    }
}

static void test_distance_and_overlap_count_the_trailer(void** state)
{
    (void)state;
    verge_vehicle truck = vehicle_of(VERGE_BODY_ARTICULATED);
    verge_vehicle car = verge_vehicle_default();
    car.x = truck.x - 10.0; // beneath the trailer
    assert_true(verge_vehicles_overlap(&truck, &car) && verge_vehicles_overlap(&car, &truck));
    CHECK_NEAR(verge_vehicles_distance(&truck, &car), 0.0, 0.0);
    truck.trailer_heading = 0.5 * M_PI; // turned away to the right
    assert_false(verge_vehicles_overlap(&truck, &car));
    truck.trailer_heading = NAN;
    car.x = truck.x - 1.46 - 12.0 - 2.5 - 1.0; // a metre behind
    CHECK_NEAR(verge_vehicles_distance(&truck, &car), 1.0, 1e-9);
}

static void test_a_trailer_counts_as_a_vehicle_of_the_capacity(void** state)
{
    (void)state;
    static corner at;
    straight_open(&at);
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    for (uint32_t i = 0; i < VERGE_VEHICLES_MAX; ++i) {
        vehicles[i] = vehicle_of(VERGE_BODY_ARTICULATED);
        vehicles[i].id = (int32_t)i;
        vehicles[i].controlled = false;
        vehicles[i].x = 20.0 * (i % 28);
        vehicles[i].y = 3.5 * (i % 2);
    }
    const uint32_t most = VERGE_VEHICLES_MAX / 2;
    assert_int_equal(verge_planner_step(at.planner, 0, vehicles, most, &plan), VERGE_OK);
    assert_int_equal(verge_planner_step(at.planner, 0, vehicles, most + 1, &plan),
                     VERGE_ERR_CAPACITY);
    free(at.memory);
}

static void test_a_body_that_is_not_the_vehicles_is_refused(void** state)
{
    (void)state;
    static corner at;
    straight_open(&at);
    const verge_road* road = verge_planner_road(at.planner);
    verge_vehicle vehicle = vehicle_of(VERGE_BODY_TRUCK);
    assert_int_equal(verge_road_check_vehicle(road, &vehicle, NULL), VERGE_OK);
    vehicle.length = 8.0; // the body's is 10.1 m
    assert_int_equal(verge_road_check_vehicle(road, &vehicle, NULL), VERGE_ERR_VEHICLE);
    vehicle = vehicle_of(VERGE_BODY_TRUCK);
    vehicle.body.rear_axle = NAN;
    assert_int_equal(verge_road_check_vehicle(road, &vehicle, NULL), VERGE_ERR_VEHICLE);
    vehicle = vehicle_of(VERGE_BODY_ARTICULATED);
    vehicle.trailer_heading = INFINITY;
    assert_int_equal(verge_road_check_vehicle(road, &vehicle, NULL), VERGE_ERR_VEHICLE);
    free(at.memory);
}

static void test_a_car_without_a_body_is_planned_as_the_reference_car(void** state)
{
    (void)state;
    uint64_t digests[2];
    for (int i = 0; i < 2; ++i) {
        static corner at;
        corner_open(&at, 15.0, 0.5 * M_PI);
        verge_vehicle vehicle = vehicle_of(VERGE_BODY_CAR);
        vehicle.x = 50.0;
        if (i == 1) {
            vehicle.body = (verge_body){ 0 };
        }
        assert_int_equal(verge_planner_step(at.planner, 0, &vehicle, 1, &plan), VERGE_OK);
        digests[i] = plan.digest;
        free(at.memory);
    }
    assert_true(digests[0] == digests[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rear_wheels_follow_the_front_wheels_of_the_body),
        cmocka_unit_test(test_the_trailer_follows_the_hitch),
        cmocka_unit_test(test_off_tracking_in_a_long_corner_is_that_of_the_closed_form),
        cmocka_unit_test(test_a_trailer_does_not_cut_into_what_stands_inside_the_corner),
        cmocka_unit_test(test_a_car_does_not_drive_into_a_trailer),
        cmocka_unit_test(test_distance_and_overlap_count_the_trailer),
        cmocka_unit_test(test_a_trailer_counts_as_a_vehicle_of_the_capacity),
        cmocka_unit_test(test_a_body_that_is_not_the_vehicles_is_refused),
        cmocka_unit_test(test_a_car_without_a_body_is_planned_as_the_reference_car),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
