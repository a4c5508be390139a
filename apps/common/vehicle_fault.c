#include "common/vehicle_fault.h"

#include "common/text.h"

#include <math.h>
#include <string.h>

// A value with its unit; JSON has no word for what is not a number.
static void add_value(text* out, double value, const char* unit)
{
    if (isfinite(value)) {
        text_add_double(out, value);
    } else {
        text_add(out, "%s", isnan(value) ? "not a number" : "infinite");
        return;
    }
    if (unit != NULL && strcmp(unit, "1") != 0) {
        text_add(out, " %s", unit);
    }
}

void vehicle_fault_text(const verge_vehicle_fault* fault, char words[VEHICLE_FAULT_SIZE])
{
    text out = text_in(words, VEHICLE_FAULT_SIZE);
    if (fault->part != NULL) {
        text_add(&out, "%s.", fault->part);
    }
    text_add(&out, "%s is ", fault->field);
    add_value(&out, fault->value, fault->unit);
    text_add(&out, ", expected ");
    if (fault->expected != NULL) {
        text_add(&out, "%s", fault->expected);
        return;
    }
    if (fault->min < fault->max) {
        add_value(&out, fault->min, NULL);
        text_add(&out, " to ");
    }
    add_value(&out, fault->max, fault->unit);
}
