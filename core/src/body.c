/// Bodies: presets, sizes and ranges. See body.h.
///
/// What is stated as sourced: the reference car is vehicle 2 of the CommonRoad vehicle models; the
/// greatest dimensions, and the ring that buses and trucks must turn in (12.5 m outside, 5.3 m
/// inside, which a test drives), are those of Directive 96/53/EC; the speeds of bus and trucks are
/// those of the limiter (Directive 92/6/EEC); braking is at least what UN R13 asks for (5 m/s^2).
///
/// The rest is estimated, typical of a vehicle of its kind and of no make: lengths, axles and
/// turning circles, engines by power and mass, steering rates, and the lateral acceleration at
/// which a loaded truck begins to roll over (0.35 to 0.4 g) or tyres end. State a body of your own
/// where it matters.

#include "base/scalar.h"
#include "verge/limits.h"

#include <assert.h>

#define D(field, unit, min, max, text) { #field, unit, offsetof(verge_body, field), min, max, text }

static const verge_body_param params[] = {
    D(length, "m", VERGE_LIMIT_LENGTH_MIN, VERGE_LIMIT_LENGTH_MAX,
      "length of the rectangle, of an articulated truck that of its tractor"),
    D(width, "m", VERGE_LIMIT_WIDTH_MIN, VERGE_LIMIT_WIDTH_MAX, "width of the rectangle"),
    D(rear_axle, "m", 0.0, 15.0, "from the centre back to the rear axle, or its group's middle"),
    D(wheelbase, "m", 0.2, 25.0, "from the rear axle to the front axle"),
    D(steer_max, "rad", 0.05, 1.4, "steering angle of the single-track model's front wheel"),
    D(steer_rate_max, "rad/s", 0.02, 10.0, "rate of that angle"),
    D(acceleration_max, "m/s^2", 0.05, 20.0, "most acceleration, up to speed_switch"),
    D(speed_switch, "m/s", 0.1, 100.0, "above it acceleration_max falls with 1 / speed"),
    D(braking_max, "m/s^2", 1.0, 20.0, "most braking"),
    D(lateral_max, "m/s^2", 0.5, 20.0, "most lateral acceleration: tyres or rolling over"),
    D(speed_max, "m/s", 1.0, 100.0, "most speed"),
    D(hitch, "m", -15.0, 15.0, "from the centre back to the trailer's hitch"),
    D(trailer_length, "m", 0.0, 25.0, "length of the trailer; 0: none"),
    D(trailer_width, "m", VERGE_LIMIT_WIDTH_MIN, VERGE_LIMIT_WIDTH_MAX, "width of the trailer"),
    D(trailer_axle, "m", 0.5, 25.0,
      "from the hitch back to the trailer's axle, or its group's middle"),
    D(trailer_front, "m", 0.0, 5.0, "from the hitch ahead to the trailer's front"),
};
enum { PARAM_COUNT = sizeof params / sizeof params[0] };

static_assert(PARAM_COUNT * sizeof(double) == sizeof(verge_body), "every number has its line");

typedef struct preset {
    const char* name;
    verge_body  body;
} preset;

static const preset presets[VERGE_BODY_KIND_COUNT] = {
    // BMW 320i, vehicle 2 of the CommonRoad vehicle models (version 3.0.2), on the rectangle of the
    // paper's experiments (section 4).
    [VERGE_BODY_CAR] = { "car", { .length = 5.0, .width = 2.0, .wheelbase = VERGE_WHEELBASE,
        .rear_axle = VERGE_REAR_AXLE, .steer_max = VERGE_STEER_MAX,
        .steer_rate_max = VERGE_STEER_RATE_MAX, .acceleration_max = VERGE_ACCELERATION_MAX,
        .speed_switch = VERGE_SPEED_SWITCH, .braking_max = VERGE_ACCELERATION_MAX,
        .lateral_max = VERGE_ACCELERATION_MAX, .speed_max = VERGE_SPEED_MAX } },
    // Overhangs 0.96 and 1.98 m, turning circle 14.7 m. 30 W/kg.
    [VERGE_BODY_VAN] = { "van", { .length = 6.89, .width = 2.17, .wheelbase = 3.95,
        .rear_axle = 1.465, .steer_max = 0.73, .steer_rate_max = 0.4, .acceleration_max = 3.5,
        .speed_switch = 8.0, .braking_max = 8.0, .lateral_max = 6.0, .speed_max = 44.0 } },
    // Overhangs 2.85 and 3.35 m, turning circle 21 m. 12 W/kg.
    [VERGE_BODY_BUS] = { "bus", { .length = 12.0, .width = 2.55, .wheelbase = 5.8,
        .rear_axle = 2.65, .steer_max = 0.89, .steer_rate_max = 0.4, .acceleration_max = 1.5,
        .speed_switch = 8.0, .braking_max = 7.0, .lateral_max = 4.5, .speed_max = 27.8 } },
    // Three axles, overhangs 1.48 and 3.32 m, turning circle 20.1 m. 12 W/kg.
    [VERGE_BODY_TRUCK] = { "truck", { .length = 10.1, .width = 2.55, .wheelbase = 5.3,
        .rear_axle = 1.73, .steer_max = 0.71, .steer_rate_max = 0.4, .acceleration_max = 1.5,
        .speed_switch = 8.0, .braking_max = 7.0, .lateral_max = 4.0, .speed_max = 25.0 } },
    // Tractor: overhangs 1.43 and 0.85 m, turning circle 15.8 m. Together 16.5 m long, the
    // trailer's rear 12 m behind the hitch: both the most of 96/53/EC. 40 t, 8 W/kg.
    [VERGE_BODY_ARTICULATED] = { "articulated", { .length = 6.08, .width = 2.55, .wheelbase = 3.8,
        .rear_axle = 2.19, .steer_max = 0.68, .steer_rate_max = 0.4, .acceleration_max = 1.0,
        .speed_switch = 8.0, .braking_max = 6.5, .lateral_max = 3.5, .speed_max = 25.0,
        .hitch = 1.46, .trailer_length = 13.6, .trailer_width = 2.55, .trailer_axle = 7.65,
        .trailer_front = 1.6 } },
    // Wheels of 0.62 m, a steering head that turns by 35 degrees. It leans in bends, by at most 40
    // degrees.
    [VERGE_BODY_MOTORCYCLE] = { "motorcycle", { .length = 2.2, .width = 0.8, .wheelbase = 1.45,
        .rear_axle = 0.78, .steer_max = 0.6, .steer_rate_max = 0.8, .acceleration_max = 6.0,
        .speed_switch = 15.0, .braking_max = 8.0, .lateral_max = 8.0, .speed_max = 50.0 } },
    // Wheels of 0.7 m. Harder braking lifts the rear wheel (about 5 m/s^2).
    [VERGE_BODY_BICYCLE] = { "bicycle", { .length = 1.8, .width = 0.65, .wheelbase = 1.07,
        .rear_axle = 0.55, .steer_max = 0.8, .steer_rate_max = 1.0, .acceleration_max = 1.0,
        .speed_switch = 4.0, .braking_max = 4.5, .lateral_max = 4.0, .speed_max = 12.0 } },
};

/// The reference car's axles are taken for lengths in this range. [m]
static const double car_shortest = 3.5, car_longest = 5.5;

static double number_of(const verge_body* body, const verge_body_param* param)
{
    return *(const double*)(const void*)((const char*)body + param->offset);
}

const char* verge_body_name(verge_body_kind kind)
{
    return (unsigned)kind < VERGE_BODY_KIND_COUNT ? presets[kind].name : "??";
}

verge_body verge_body_of(verge_body_kind kind)
{
    return presets[(unsigned)kind < VERGE_BODY_KIND_COUNT ? kind : VERGE_BODY_CAR].body;
}

verge_body verge_body_of_size(verge_body_kind kind, double length, double width)
{
    verge_body body = verge_body_of(kind);
    double typical = body.length;
    if (kind == VERGE_BODY_CAR) {
        typical = vg_clamp(length, car_shortest, car_longest);
    }
    if (length != typical) {
        const double share = length / typical;
        body.wheelbase *= share;
        body.rear_axle *= share;
        body.hitch *= share;
    }
    body.length = length;
    body.width = width;
    return body;
}

verge_body verge_body_by_size(double length, double width)
{
    static const double two_wheeler_width = 1.2, bicycle_length = 2.0; // [m]
    static const double van_longest = 7.5, truck_longest = 12.0;       // [m]
    verge_body_kind kind = VERGE_BODY_BUS;
    if (length < car_shortest && width <= two_wheeler_width) {
        kind = length <= bicycle_length ? VERGE_BODY_BICYCLE : VERGE_BODY_MOTORCYCLE;
    } else if (length <= car_longest) {
        kind = VERGE_BODY_CAR;
    } else if (length <= van_longest) {
        kind = VERGE_BODY_VAN;
    } else if (length <= truck_longest) {
        kind = VERGE_BODY_TRUCK;
    }
    return verge_body_of_size(kind, length, width);
}

double verge_body_radius_min(const verge_body* body)
{
    if (body == NULL || !(body->steer_max > 0.0 && body->steer_max < 1.5)) {
        return 0.0;
    }
    double sine, cosine;
    vg_sincos(body->steer_max, &sine, &cosine);
    return body->wheelbase * cosine / sine;
}

const verge_body_param* verge_body_params(uint32_t* count)
{
    if (count != NULL) {
        *count = PARAM_COUNT;
    }
    return params;
}

/// The upper limit of a number in this body: both axles lie within the length.
static double most_of(const verge_body* body, const verge_body_param* param)
{
    if (param->offset == offsetof(verge_body, rear_axle)) {
        return vg_min(param->max, 0.5 * body->length);
    }
    if (param->offset == offsetof(verge_body, wheelbase)) {
        return vg_min(param->max, 0.5 * body->length + vg_max(body->rear_axle, 0.0));
    }
    return param->max;
}

bool verge_body_check(const verge_body* body, verge_body_fault* fault)
{
    const verge_body_param* bad = NULL;
    if (body == NULL) {
        if (fault != NULL) {
            *fault = (verge_body_fault){ .field = "body", .unit = "1" };
        }
        return false;
    }
    for (uint32_t i = 0; i < PARAM_COUNT && bad == NULL; ++i) {
        const verge_body_param* param = &params[i];
        const bool of_trailer = param->offset >= offsetof(verge_body, hitch)
                             && param->offset != offsetof(verge_body, trailer_length);
        const double value = number_of(body, param);
        const bool holds = value >= param->min && value <= most_of(body, param);
        if (!holds && !(of_trailer && body->trailer_length == 0.0)) {
            bad = param;
        }
    }
    if (fault != NULL) {
        *fault = (verge_body_fault){ 0 };
        if (bad != NULL) {
            *fault = (verge_body_fault){ bad->name, bad->unit, number_of(body, bad), bad->min,
                                         most_of(body, bad) };
        }
    }
    return bad == NULL;
}
