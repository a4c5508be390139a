/// See overrun.h. A point mass, moved by the trapezoidal rule, that turns parallel to its lane
/// within one second while it brakes.
#include "overrun.h"

#include <math.h>

/// [m/s^3] comfort_jerk of the planner's defaults.
#define JERK 4.0
/// [s] until the heading is that of the lane.
#define ALIGN_S 1.0

typedef struct motion {
    verge_lane_position on;  // lane_id VERGE_NO_LANE: straight ahead
    double x, y, heading;
    double skew;             // [rad] heading relative to the lane, at the start
    double t, speed, acceleration;
    double driven;           // [m]
} motion;

static double wrap(double angle);
static void advance(motion* self, const verge_road* road, int32_t target_lane);

verge_vehicle_plan_t overrun_brake(const wire_plan_header* header, const verge_vehicle* now,
                                   const verge_road* road)
{
    motion self = {
        .on = verge_road_project(road, now->x, now->y, now->heading, VERGE_NO_LANE),
        .x = now->x,
        .y = now->y,
        .heading = now->heading,
        .speed = now->speed,
        .acceleration = now->acceleration,
    };
    self.skew = self.on.lane_id == VERGE_NO_LANE ? 0.0 : wrap(now->heading - self.on.heading);

    wire_plan_header whole = *header;
    const int32_t duration_ms = (WIRE_POINTS_MAX - 1) * OVERRUN_DT_MS;
    whole.valid_until_utime = header->utime + (int64_t)duration_ms * 1000;
    verge_vehicle_plan_t plan = wire_plan_cancelled(&whole, now->id, VERGE_REASON_OVERRUN);
    plan.status = VERGE_FALLBACK_BRAKE;
    plan.dt_ms = OVERRUN_DT_MS;
    plan.point_count = WIRE_POINTS_MAX;
    for (int32_t i = 0; i < WIRE_POINTS_MAX; i++) {
        verge_plan_point_t* point = &plan.points[i];
        *point = (verge_plan_point_t){
            .x = self.x,
            .y = self.y,
            .heading = (float)self.heading,
            .speed = (float)self.speed,
            .acceleration = (float)self.acceleration,
        };
        const motion before = self;
        advance(&self, road, now->target_lane);
        const double distance = hypot(self.x - before.x, self.y - before.y);
        const bool   rolls = distance > 0.5 * VERGE_SPEED_SLOW * OVERRUN_DT_MS * 1e-3;
        point->curvature = rolls ? (float)(wrap(self.heading - before.heading) / distance) : 0.0f;
    }
    plan.action_count = 1;
    plan.actions[0] = (verge_plan_action_t){
        .action = VERGE_DECELERATE,
        .lane = self.on.lane_id,
        .brake_light = 1,
        .t1_ms = duration_ms,
        .s = (float)self.on.s,
        .d_mm = (int16_t)lround(fmax(fmin(self.on.d, 32.0), -32.0) * 1000.0),
        .speed = plan.points[WIRE_POINTS_MAX - 1].speed,
        .distance = (float)self.driven,
    };
    plan.why = VERGE_WHY_FALLBACK;
    return plan;
}

static double wrap(double angle)
{
    return remainder(angle, 2.0 * 3.14159265358979323846);
}

/// Moves along the lane, and across it, from where `from` is.
static void move_on_lane(motion* self, const verge_lane_position* from, double along, double across,
                         const verge_road* road, int32_t target_lane)
{
    self->on = *from;
    self->on.s += along;
    self->on.d += across;
    const double  length = verge_road_length(road, self->on.lane_id);
    const int32_t next = verge_road_next(road, self->on.lane_id, target_lane);
    if (self->on.s > length && next != VERGE_NO_LANE) {
        self->on.s -= length;
        self->on.lane_id = next;
    }
    verge_road_at(road, self->on.lane_id, self->on.s, self->on.d, &self->x, &self->y,
                  &self->heading);
}

/// Moves to the next point.
static void advance(motion* self, const verge_road* road, int32_t target_lane)
{
    const motion before = *self;
    const double dt = OVERRUN_DT_MS * 1e-3;
    const double braking = fmax(fmin(self->acceleration, 0.0) - JERK * dt, -OVERRUN_BRAKING);
    const double speed = fmax(self->speed + braking * dt, 0.0);
    const double distance = 0.5 * (self->speed + speed) * dt;
    const double skew = self->skew * fmax(1.0 - (self->t + 0.5 * dt) / ALIGN_S, 0.0);
    self->driven += distance;
    self->acceleration = speed > 0.0 ? braking : 0.0;
    self->speed = speed;
    self->t += dt;
    if (self->on.lane_id == VERGE_NO_LANE) {
        self->x += distance * cos(self->heading);
        self->y += distance * sin(self->heading);
        return;
    }
    // Beside the reference line of a bend, s changes by more or less than the distance driven. The
    // first step measures by how much, the second one corrects it.
    const double along = distance * cos(skew), across = distance * sin(skew);
    move_on_lane(self, &before.on, along, across, road, target_lane);
    const double driven = hypot(self->x - before.x, self->y - before.y);
    if (driven > 0.0) {
        move_on_lane(self, &before.on, along * distance / driven, across, road, target_lane);
    }
    self->heading = wrap(self->heading + self->skew * fmax(1.0 - self->t / ALIGN_S, 0.0));
}
