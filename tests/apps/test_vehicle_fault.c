/// Goal: a vehicle's fault reads as field, value and range with their unit.
/// Method: one fault of each kind, the words compared.
#include "check.h"

#include "common/vehicle_fault.h"
#include "verge/verge.h"

#include <math.h>

static void says(const verge_vehicle* vehicle, const char* expected)
{
    verge_vehicle_fault fault;
    char words[VEHICLE_FAULT_SIZE];
    assert_false(verge_vehicle_check(vehicle, &fault));
    vehicle_fault_text(&fault, words);
    assert_string_equal(words, expected);
}

static void a_fault_names_field_value_and_range(void** state)
{
    (void)state;
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.speed = 71.5;
    says(&vehicle, "speed is 71.5 m/s, expected -15 to 70 m/s");
    vehicle.speed = NAN;
    says(&vehicle, "speed is not a number, expected -15 to 70 m/s");
    vehicle.speed = INFINITY;
    says(&vehicle, "speed is infinite, expected -15 to 70 m/s");
    vehicle.speed = 0.0;
    vehicle.id = -3;
    says(&vehicle, "id is -3, expected 0 to 2147483647");
    vehicle.id = 3;
    vehicle.controlled = true;
    vehicle.habit.cooperation = 2.0;
    says(&vehicle, "habit.cooperation is 2, expected 0 to 1");
    vehicle.habit.cooperation = 0.5;
    vehicle.habit.weights.jerk = -1.0;
    says(&vehicle, "habit.weights.jerk is -1, expected 0 to 1000000");
}

static void a_fault_of_a_body_names_the_body(void** state)
{
    (void)state;
    verge_vehicle vehicle = verge_vehicle_default();
    verge_body body = verge_body_of(VERGE_BODY_BUS);
    verge_vehicle_set_body(&vehicle, &body);
    vehicle.length = 11.0;
    says(&vehicle, "body.length is 12 m, expected 11 m");
    vehicle.length = 12.0;
    vehicle.body.steer_max = 2.0;
    says(&vehicle, "body.steer_max is 2 rad, expected 0.05 to 1.4 rad");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fault_names_field_value_and_range),
        cmocka_unit_test(a_fault_of_a_body_names_the_body),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
