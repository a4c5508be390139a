/// A closed loop of planner and vehicle: the vehicle drives exactly as planned.
#ifndef TEST_CLOSED_LOOP_H
#define TEST_CLOSED_LOOP_H

#include "verge/plan.h"

/// The vehicle reaches a point of its plan.
static inline void take_point(verge_vehicle* vehicle, const verge_point* point)
{
    vehicle->x = point->x;
    vehicle->y = point->y;
    vehicle->heading = point->heading;
    vehicle->speed = point->speed;
    vehicle->acceleration = point->acceleration;
    vehicle->yaw_rate = point->curvature * point->speed;
}

#endif
