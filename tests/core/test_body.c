/// Goal: every vehicle has the axles and limits of its kind and size. An impossible body is refused
/// and its field named.
/// Method: the table of ranges against each body; the turning ring of Directive 96/53/EC by the
/// formulas of steady-state turning, written again here.
#include "check.h"
#include "rng.h"
#include "verge/planner.h"

#include <math.h>
#include <string.h>

static void test_every_preset_is_a_good_body(void** state)
{
    (void)state;
    for (int kind = 0; kind < VERGE_BODY_KIND_COUNT; ++kind) {
        const verge_body body = verge_body_of((verge_body_kind)kind);
        verge_body_fault fault;
        if (!verge_body_check(&body, &fault)) {
            fail_msg("%s: %s is %g, expected %g to %g", verge_body_name((verge_body_kind)kind),
                     fault.field, fault.value, fault.min, fault.max);
        }
        assert_null(fault.field);
        assert_int_equal(body.trailer_length > 0.0, kind == VERGE_BODY_ARTICULATED);
    }
}

static void test_every_size_has_a_good_body_of_that_size(void** state)
{
    (void)state;
    for (double length = 0.5; length <= 30.0; length += 0.05) {
        for (double width = 0.3; width <= 4.0; width += 0.1) {
            const verge_body body = verge_body_by_size(length, width);
            verge_body_fault fault;
            if (!verge_body_check(&body, &fault)) {
                fail_msg("%g x %g m: %s is %g, expected %g to %g", length, width, fault.field,
                         fault.value, fault.min, fault.max);
            }
            assert_true(body.length == length && body.width == width);
            assert_true(body.trailer_length == 0.0);
        }
    }
}

static void test_a_car_of_any_length_has_the_axles_of_the_reference_car(void** state)
{
    (void)state;
    for (double length = 3.5; length <= 5.5; length += 0.01) {
        const verge_body body = verge_body_by_size(length, 1.8);
        const verge_body car = verge_body_of(VERGE_BODY_CAR);
        verge_body same = body;
        same.length = car.length;
        same.width = car.width;
        assert_memory_equal(&same, &car, sizeof car); // to the last bit
    }
    const verge_body car = verge_body_of(VERGE_BODY_CAR);
    assert_true(car.rear_axle == 1.4227 && car.wheelbase == 2.5789 && car.steer_rate_max == 0.4);
    CHECK_NEAR(tan(car.steer_max) / car.wheelbase, 0.702, 1e-12);
}

static void test_a_longer_body_has_its_axles_farther_apart(void** state)
{
    (void)state;
    double before = 0.0; // [m]
    for (double length = 5.6; length <= 30.0; length += 0.1) {
        const verge_body body = verge_body_by_size(length, 2.5);
        assert_true(body.wheelbase > verge_body_of(VERGE_BODY_CAR).wheelbase);
        // From one kind to the next, with longer overhangs, is a step of half a metre at most.
        assert_true(body.wheelbase > before - 0.5);
        before = body.wheelbase;
    }
}

static void test_each_number_out_of_its_range_is_named(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_body_param* params = verge_body_params(&count);
    assert_int_equal(count * sizeof(double), sizeof(verge_body));
    for (uint32_t i = 0; i < count; ++i) {
        const double bad[] = { params[i].min - 0.01, params[i].max + 0.01, NAN, INFINITY };
        for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) {
            verge_body body = verge_body_of(VERGE_BODY_ARTICULATED);
            memcpy((char*)&body + params[i].offset, &bad[k], sizeof bad[k]);
            verge_body_fault fault;
            assert_false(verge_body_check(&body, &fault));
            // A length that is wrong is found at the length; every other field by itself.
            assert_string_equal(fault.field, params[i].name);
            assert_true(isnan(bad[k]) ? isnan(fault.value) : fault.value == bad[k]);
            assert_true(fault.max > fault.min);
        }
    }
}

static void test_axles_outside_the_body_are_named(void** state)
{
    (void)state;
    verge_body_fault fault;
    verge_body body = verge_body_of(VERGE_BODY_TRUCK);
    body.rear_axle = 0.5 * body.length + 0.1;
    assert_false(verge_body_check(&body, &fault));
    assert_string_equal(fault.field, "rear_axle");
    CHECK_NEAR(fault.max, 0.5 * body.length, 1e-12);
    body = verge_body_of(VERGE_BODY_TRUCK);
    body.wheelbase = 0.5 * body.length + body.rear_axle + 0.1;
    assert_false(verge_body_check(&body, &fault));
    assert_string_equal(fault.field, "wheelbase");
    assert_true(fault.value > fault.max);
}

static void test_numbers_of_no_trailer_do_not_matter(void** state)
{
    (void)state;
    verge_body body = verge_body_of(VERGE_BODY_TRUCK);
    body.hitch = 1e9;
    body.trailer_axle = NAN;
    assert_true(verge_body_check(&body, NULL));
}

/// Inner and outer radius of the ring that a vehicle sweeps in a steady turn whose rear axle's
/// middle drives a circle of this radius. [m]
static void ring(const verge_body* body, double radius, double* inner, double* outer)
{
    const double front = 0.5 * body->length + body->rear_axle;
    *outer = hypot(radius + 0.5 * body->width, front);
    *inner = radius - 0.5 * body->width;
    if (body->trailer_length > 0.0) {
        const double hitch = hypot(radius, body->rear_axle - body->hitch);
        const double axle = sqrt(hitch * hitch - body->trailer_axle * body->trailer_axle);
        *inner = fmin(*inner, axle - 0.5 * body->trailer_width);
        *outer = fmax(*outer, hypot(axle + 0.5 * body->trailer_width,
                                    body->trailer_axle + body->trailer_front));
    }
}

static void test_bus_and_trucks_turn_in_the_ring_of_the_directive(void** state)
{
    (void)state;
    static const verge_body_kind kinds[] = { VERGE_BODY_VAN, VERGE_BODY_BUS, VERGE_BODY_TRUCK,
                                             VERGE_BODY_ARTICULATED };
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; ++i) {
        const verge_body body = verge_body_of(kinds[i]);
        const double tightest = body.wheelbase / tan(body.steer_max);
        double inner = 0.0, outer = 0.0, radius = tightest;
        for (; outer < 12.5; radius += 0.01) {
            ring(&body, radius, &inner, &outer);
        }
        assert_true(radius > tightest + 0.1); // the steering has something left
        if (inner < 5.3) {
            fail_msg("%s: %g m inside the ring", verge_body_name(kinds[i]), inner);
        }
    }
    // Directive 96/53/EC: whole length, and from the hitch to the trailer's rear.
    const verge_body body = verge_body_of(VERGE_BODY_ARTICULATED);
    const double rear = body.trailer_length - body.trailer_front;
    assert_true(0.5 * body.length + body.hitch + rear <= 16.5 + 1e-9 && rear <= 12.0 + 1e-9);
    assert_true(verge_body_of(VERGE_BODY_TRUCK).length <= 12.0);
    assert_true(verge_body_of(VERGE_BODY_BUS).length <= 13.5);
}

static void test_a_vehicle_without_a_body_has_the_one_of_its_size(void** state)
{
    (void)state;
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.length = 11.0;
    vehicle.width = 2.5;
    const verge_body by_size = verge_body_by_size(11.0, 2.5);
    verge_body body = verge_vehicle_body(&vehicle);
    assert_memory_equal(&body, &by_size, sizeof body);

    const verge_body bus = verge_body_of_size(VERGE_BODY_BUS, 11.0, 2.5);
    verge_vehicle_set_body(&vehicle, &bus);
    body = verge_vehicle_body(&vehicle);
    assert_memory_equal(&body, &bus, sizeof body);
    assert_true(vehicle.length == 11.0 && vehicle.width == 2.5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_preset_is_a_good_body),
        cmocka_unit_test(test_every_size_has_a_good_body_of_that_size),
        cmocka_unit_test(test_a_car_of_any_length_has_the_axles_of_the_reference_car),
        cmocka_unit_test(test_a_longer_body_has_its_axles_farther_apart),
        cmocka_unit_test(test_each_number_out_of_its_range_is_named),
        cmocka_unit_test(test_axles_outside_the_body_are_named),
        cmocka_unit_test(test_numbers_of_no_trailer_do_not_matter),
        cmocka_unit_test(test_bus_and_trucks_turn_in_the_ring_of_the_directive),
        cmocka_unit_test(test_a_vehicle_without_a_body_has_the_one_of_its_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
