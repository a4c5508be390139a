/// The shipped scenarios as C data. tools/scenario_to_c.py writes scenarios.inc.
#ifndef TEST_SHIPPED_H
#define TEST_SHIPPED_H

#include "verge/verge.h"

#include <math.h>

/// A vehicle of a scenario; habit_kind -1: the habit is spelled out.
typedef struct vehicle_row {
    int32_t id;
    bool    controlled;
    double  x, y, heading, speed, acceleration, yaw_rate, length, width;
    int32_t target_lane;
    int     habit_kind;
    double  cooperation;
    double  weights[6];
} vehicle_row;

typedef struct scenario {
    const char*           name;
    const verge_lane_def* lanes;
    uint32_t              lane_count;
    const vehicle_row*    vehicles;
    uint32_t              vehicle_count;
    void (*set)(verge_planner_def* def);
} scenario;

#include "scenarios.inc"

static inline verge_vehicle vehicle_from(const vehicle_row* row)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = row->id;
    vehicle.controlled = row->controlled;
    vehicle.x = row->x;
    vehicle.y = row->y;
    vehicle.heading = row->heading;
    vehicle.speed = row->speed;
    vehicle.acceleration = row->acceleration;
    vehicle.yaw_rate = row->yaw_rate;
    vehicle.length = row->length;
    vehicle.width = row->width;
    vehicle.target_lane = row->target_lane;
    if (row->habit_kind >= 0) {
        vehicle.habit = verge_habit_of((verge_habit_kind)row->habit_kind);
    } else {
        const double* w = row->weights;
        const verge_weights weights = {w[0], w[1], w[2], w[3], w[4], w[5]};
        vehicle.habit.cooperation = row->cooperation;
        vehicle.habit.weights = weights;
    }
    return vehicle;
}

#endif
