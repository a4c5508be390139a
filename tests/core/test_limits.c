/// Goal: a vehicle is accepted exactly where each of its quantities is in its range, and the fault
///       names the quantity, its value and the range.
/// Method: every row of the table is pushed to both of its ends, and over them.
#include "check.h"
#include "verge/verge.h"

#include <math.h>

static verge_vehicle good(void)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = 7;
    return vehicle;
}

static bool accepts(const verge_vehicle_limit* limit, double value, verge_vehicle_fault* fault)
{
    verge_vehicle vehicle = good();
    *(double*)(void*)((char*)&vehicle + limit->offset) = value;
    return verge_vehicle_check(&vehicle, fault);
}

static void the_ends_of_each_range_belong_to_it_and_what_is_beyond_is_named(void** state)
{
    (void)state;
    uint32_t count = 0;
    const verge_vehicle_limit* limits = verge_vehicle_limits(&count);
    assert_true(count >= 10);
    for (uint32_t i = 0; i < count; ++i) {
        const verge_vehicle_limit* limit = &limits[i];
        const double beyond[] = { nextafter(limit->min, -INFINITY), nextafter(limit->max, INFINITY),
                                  -INFINITY, INFINITY };
        verge_vehicle_fault fault;
        assert_true(accepts(limit, limit->min, &fault));
        assert_null(fault.field);
        assert_true(accepts(limit, limit->max, NULL));
        for (size_t k = 0; k < sizeof beyond / sizeof beyond[0]; ++k) {
            assert_false(accepts(limit, beyond[k], NULL));
            assert_false(accepts(limit, beyond[k], &fault));
            assert_string_equal(fault.field, limit->name);
            assert_string_equal(fault.unit, limit->unit);
            assert_int_equal(fault.vehicle_id, 7);
            assert_true(fault.value == beyond[k]);
            assert_true(fault.min == limit->min && fault.max == limit->max);
        }
        assert_int_equal(accepts(limit, NAN, &fault), limit->or_nan);
    }
}

static void a_limit_is_found_by_the_name_of_its_field(void** state)
{
    (void)state;
    const verge_vehicle_limit* speed = verge_vehicle_limit_of("speed");
    assert_non_null(speed);
    assert_int_equal(speed->offset, offsetof(verge_vehicle, speed));
    assert_true(speed->max == VERGE_LIMIT_SPEED);
    assert_null(verge_vehicle_limit_of("spee"));
    assert_null(verge_vehicle_limit_of("speeds"));
    assert_null(verge_vehicle_limit_of(""));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_ends_of_each_range_belong_to_it_and_what_is_beyond_is_named),
        cmocka_unit_test(a_limit_is_found_by_the_name_of_its_field),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
