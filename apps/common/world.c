/// See world.h.
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void signals_show(world* self);
static void vehicle_move(world* self, world_vehicle* vehicle, const verge_vehicle* as_human);
static void controlled_move(const world* self, world_vehicle* vehicle);
static bool plan_drive(world_vehicle* vehicle, double time);
static void offset_begin(world_vehicle* vehicle, double time);
static void offset_apply(world_vehicle* vehicle, double time);
static void path_brake(const world* self, world_vehicle* vehicle);
static void point_drive(world_vehicle* vehicle, const verge_point* point);
static verge_point point_between(const verge_point* a, const verge_point* b, double share);
static void lane_keep(const world* self, world_vehicle* vehicle, double acceleration);
static void vehicle_locate(const world* self, world_vehicle* vehicle);

/// Instants closer than this are the same. [s]
static const double INSTANT = 1e-6;
/// A lane change from the end of a lane may use the road this far beyond the end. [m]
static const double SWING_OUT = 10.0;
/// Acceleration of a controlled vehicle after the end of its plan. [m/s^2]
static const double GENTLE_BRAKING = -2.0;
/// The same after the last valid trajectory of its on-vehicle unit. [m/s^2]
static const double UNIT_LOST_BRAKING = -3.0;
/// A vehicle takes up its difference from a new plan within this time. [s]
static const double TAKE_UP = 1.0;
/// A smaller difference is none: numbers in messages are rounded. [m], [m/s]
static const double SAME_PLACE = 0.05, SAME_SPEED = 0.1;
/// A vehicle waits so long for the first trajectory of its unit. [s]
static const double UNIT_START = 1.0;

bool world_init(world* self, const scenario* scene)
{
    *self = (world){ .scene = scene, .road = verge_planner_road(scene->planner),
                     .vehicle_count = scene->vehicle_count };
    self->vehicles = calloc(scene->vehicle_count + 1, sizeof *self->vehicles);
    self->signals = calloc(scene->signal_count + 1, sizeof *self->signals);
    self->lawless = calloc(scene->vehicle_count + 1, sizeof *self->lawless);
    if (self->vehicles == NULL || self->signals == NULL || self->lawless == NULL) {
        world_free(self);
        return false;
    }
    self->signal_count = scene->signal_count;
    signals_show(self);
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        world_vehicle* vehicle = &self->vehicles[i];
        if (scene->vehicles[i].lawless) {
            self->lawless[self->lawless_count++] = scene->vehicles[i].start.id;
        }
        vehicle->origin = &scene->vehicles[i];
        vehicle->state = vehicle->origin->start;
        vehicle->lane = vehicle->lane_last = VERGE_NO_LANE;
        vehicle->present = vehicle->origin->track_count == 0 ||
                           scenario_track_at(vehicle->origin, 0.0, &vehicle->state);
        vehicle_locate(self, vehicle);
    }
    return true;
}

void world_free(world* self)
{
    free(self->vehicles);
    free(self->signals);
    free(self->lawless);
    *self = (world){ 0 };
}

double world_time(const world* self)
{
    return (double)self->tick / WORLD_TICKS_PER_SECOND;
}

int64_t world_utime(const world* self)
{
    return (int64_t)self->tick * (1000000 / WORLD_TICKS_PER_SECOND);
}

uint32_t world_states(const world* self, verge_vehicle states[VERGE_VEHICLES_MAX])
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < self->vehicle_count && count < VERGE_VEHICLES_MAX; ++i) {
        if (self->vehicles[i].present) {
            states[count++] = self->vehicles[i].state;
        }
    }
    return count;
}

verge_status world_plan(const world* self, verge_plan* plan)
{
    verge_planner*     planner = self->scene->planner;
    const int64_t      utime = world_utime(self);
    verge_vehicle      states[VERGE_VEHICLES_MAX];
    const uint32_t     count = world_states(self, states);
    const verge_status status =
        verge_planner_set_signals(planner, utime, self->signals, self->signal_count);
    return status == VERGE_OK ? verge_planner_step(planner, utime, states, count, plan) : status;
}

/// The vehicle in the scene that a plan or trajectory is for; null: none.
static world_vehicle* vehicle_for(const world* self, const verge_vehicle_plan* plan)
{
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        world_vehicle* vehicle = &self->vehicles[i];
        if (vehicle->state.id == plan->vehicle_id && vehicle->state.controlled &&
            vehicle->present) {
            return vehicle;
        }
    }
    return NULL;
}

static bool unit_valid(const world_vehicle* vehicle, double time)
{
    return vehicle->unit && time <= vehicle->valid_until + INSTANT;
}

void world_follow(world* self, const verge_vehicle_plan* plan, double plan_time)
{
    world_vehicle* vehicle = vehicle_for(self, plan);
    if (vehicle == NULL || self->units_only || unit_valid(vehicle, world_time(self))) {
        return;
    }
    vehicle->plan = *plan;
    vehicle->plan_time = plan_time;
    vehicle->planned = true;
    vehicle->unit = false;
    vehicle->followed_from = -TAKE_UP;
    if (self->takes_up) {
        offset_begin(vehicle, world_time(self));
    }
    vehicle->mode = vehicle->mode != NULL ? WORLD_MODE_NONE : NULL;
}

void world_expect_units(world* self)
{
    self->units_only = true;
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        self->vehicles[i].unit = self->vehicles[i].state.controlled;
        self->vehicles[i].valid_until = UNIT_START;
    }
}

void world_drive(world* self, const verge_vehicle_plan* trajectory, double time, double until,
                 const char* mode)
{
    world_vehicle* vehicle = vehicle_for(self, trajectory);
    if (vehicle != NULL) {
        vehicle->plan = *trajectory;
        vehicle->plan_time = time;
        vehicle->planned = true;
        vehicle->unit = true;
        vehicle->followed_from = -TAKE_UP;
        vehicle->valid_until = until;
        vehicle->along = fmax(world_time(self) - time, 0.0);
        vehicle->mode = mode;
    }
}

void world_advance(world* self)
{
    verge_vehicle  states[VERGE_VEHICLES_MAX];
    const uint32_t count = world_states(self, states);
    const verge_human_rules rules = { self->signals, self->signal_count, self->lawless,
                                      self->lawless_count };
    (void)verge_humans_advance(self->scene->humans, self->road, &rules, states, count, WORLD_DT);
    ++self->tick;
    signals_show(self);

    uint32_t next = 0;
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        world_vehicle* vehicle = &self->vehicles[i];
        if (vehicle->present) {
            const verge_vehicle before = vehicle->state;
            vehicle_move(self, vehicle, &states[next++]);
            vehicle->state.trailer_heading =
                verge_vehicle_trailer_heading(&before, &vehicle->state);
        } else if (!vehicle->left && vehicle->origin->track_count > 0) {
            vehicle->present =
                scenario_track_at(vehicle->origin, world_time(self), &vehicle->state);
        }
        vehicle_locate(self, vehicle);
    }
}

/// Does the lane go on past this point?
static bool goes_on(const world* self, int32_t lane, double x, double y)
{
    static const double least = 20.0; // [m] a shorter rest is the end of the road
    if (lane == VERGE_NO_LANE) {
        return false;
    }
    const double s = verge_road_project_on(self->road, lane, x, y).s;
    return verge_road_next(self->road, lane, VERGE_NO_LANE) != VERGE_NO_LANE ||
           verge_road_length(self->road, lane) - s >= least;
}

bool world_dead_end(const world* self, int32_t lane)
{
    double x = 0.0, y = 0.0;
    if (verge_road_next(self->road, lane, VERGE_NO_LANE) != VERGE_NO_LANE ||
        !verge_road_at(self->road, lane, verge_road_length(self->road, lane), 0.0, &x, &y, NULL)) {
        return false;
    }
    return goes_on(self, verge_road_left(self->road, lane), x, y) ||
           goes_on(self, verge_road_right(self->road, lane), x, y);
}

const verge_action_step* world_action(const world* self, const world_vehicle* vehicle)
{
    const double t = world_time(self) - vehicle->plan_time;
    if (!vehicle->planned || vehicle->plan.status == VERGE_CANCELLED) {
        return NULL;
    }
    for (uint32_t i = 0; i < vehicle->plan.action_count; ++i) {
        if (t < vehicle->plan.actions[i].t1 - INSTANT) {
            return &vehicle->plan.actions[i];
        }
    }
    return NULL;
}

static void signals_show(world* self)
{
    for (uint32_t i = 0; i < self->signal_count; ++i) {
        self->signals[i] = signal_at(&self->scene->signals[i], world_time(self));
    }
}

/// as_human: the next state by the car-following model.
static void vehicle_move(world* self, world_vehicle* vehicle, const verge_vehicle* as_human)
{
    vehicle->curvature = vehicle->jerk = 0.0;
    if (vehicle->origin->track_count > 0) {
        vehicle->present =
            scenario_track_at(vehicle->origin, world_time(self), &vehicle->state);
        vehicle->left = !vehicle->present;
    } else if (vehicle->origin->parked) {
        return;
    } else if (vehicle->state.controlled) {
        controlled_move(self, vehicle);
    } else {
        vehicle->state = *as_human;
    }
}

static void controlled_move(const world* self, world_vehicle* vehicle)
{
    const double now = world_time(self);
    if (vehicle->unit && !unit_valid(vehicle, now)) {
        path_brake(self, vehicle);
    } else if (!vehicle->planned) {
        lane_keep(self, vehicle, 0.0);
    } else if (vehicle->plan.status == VERGE_CANCELLED || !plan_drive(vehicle, now)) {
        lane_keep(self, vehicle, GENTLE_BRAKING);
    }
}

/// False: the plan has ended.
static bool plan_drive(world_vehicle* vehicle, double time)
{
    verge_point point;
    if (!world_point_at(&vehicle->plan, time - vehicle->plan_time, &point)) {
        return false;
    }
    vehicle->along = point.t;
    const verge_vehicle before = vehicle->state;
    point_drive(vehicle, &point);
    offset_apply(vehicle, time);
    if (vehicle->state.speed < 0.0) { // would move back to the plan
        vehicle->state.x = before.x;
        vehicle->state.y = before.y;
        vehicle->state.heading = before.heading;
        vehicle->state.speed = vehicle->state.acceleration = vehicle->state.yaw_rate = 0.0;
    }
    return true;
}

/// The offset at `t` seconds after its beginning: a quintic that ends at 0 after TAKE_UP, with no
/// speed and no acceleration.
static double offset_at(const world_offset* offset, double t)
{
    const double share = fmin(fmax(t / TAKE_UP, 0.0), 1.0), left = 1.0 - share;
    const double p = offset->position, v = offset->speed * TAKE_UP,
                 a = offset->acceleration * TAKE_UP * TAKE_UP;
    return left * left * left
           * (p + share * (3.0 * p + v + share * (6.0 * p + 3.0 * v + 0.5 * a)));
}

/// Measures where the vehicle is, seen from the plan that it begins to follow.
static void offset_begin(world_vehicle* vehicle, double time)
{
    const verge_vehicle* state = &vehicle->state;
    verge_point          at;
    if (!world_point_at(&vehicle->plan, time - vehicle->plan_time, &at)) {
        return;
    }
    const double x = state->x - at.x, y = state->y - at.y;
    const double ahead = x * cos(at.heading) + y * sin(at.heading);
    const double beside = y * cos(at.heading) - x * sin(at.heading);
    if (hypot(x, y) < SAME_PLACE && fabs(state->speed - at.speed) < SAME_SPEED) {
        return;
    }
    vehicle->followed_from = time;
    vehicle->ahead = (world_offset){ ahead, state->speed - at.speed,
                                     state->acceleration - at.acceleration };
    const double turn = isnan(state->yaw_rate) ? at.speed * at.curvature : state->yaw_rate;
    vehicle->left_of = (world_offset){ beside, state->speed * sin(state->heading - at.heading),
                                       state->speed * turn - at.speed * at.speed * at.curvature };
}

/// Moves a vehicle that was put on its plan to where it is while it takes up its difference.
static void offset_apply(world_vehicle* vehicle, double time)
{
    static const double h = 1e-3; // [s] for the slopes
    const double t = time - vehicle->followed_from;
    if (vehicle->followed_from < 0.0 || t >= TAKE_UP) {
        return;
    }
    verge_vehicle* state = &vehicle->state;
    const double c = cos(state->heading), s = sin(state->heading);
    const double ahead = offset_at(&vehicle->ahead, t), beside = offset_at(&vehicle->left_of, t);
    const double next = offset_at(&vehicle->ahead, t + h), last = offset_at(&vehicle->ahead, t - h);
    const double drift = offset_at(&vehicle->left_of, t + h) - offset_at(&vehicle->left_of, t - h);
    state->x += ahead * c - beside * s;
    state->y += ahead * s + beside * c;
    state->speed += (next - last) / (2.0 * h);
    state->acceleration += (next - 2.0 * ahead + last) / (h * h);
    state->heading += atan2(drift / (2.0 * h), fmax(state->speed, 1.0));
}

bool world_point_at(const verge_vehicle_plan* trajectory, double t, verge_point* point)
{
    const uint32_t count = trajectory->point_count;
    const double   elapsed = fmax(t, 0.0);
    if (count == 0 || elapsed > trajectory->points[count - 1].t + INSTANT) {
        return false;
    }
    uint32_t index = 0;
    while (index + 1 < count && trajectory->points[index + 1].t <= elapsed + INSTANT) {
        ++index;
    }
    const verge_point* at = &trajectory->points[index];
    *point = elapsed - at->t <= INSTANT || index + 1 == count
                 ? *at
                 : point_between(at, &at[1], (elapsed - at->t) / (at[1].t - at->t));
    return true;
}

/// The point of the vehicle's trajectory that is a distance [m] ahead of the vehicle along it.
/// False: the trajectory ends before.
static bool path_ahead(const world_vehicle* vehicle, double distance, verge_point* point)
{
    verge_point here;
    if (!world_point_at(&vehicle->plan, vehicle->along, &here)) {
        return false;
    }
    for (uint32_t i = 0; i < vehicle->plan.point_count; ++i) {
        const verge_point* next = &vehicle->plan.points[i];
        if (next->t <= here.t + INSTANT) {
            continue;
        }
        const double x = next->x - here.x, y = next->y - here.y;
        const double length = sqrt(x * x + y * y);
        if (length > distance) {
            *point = point_between(&here, next, distance / length);
            return true;
        }
        distance -= length;
        here = *next;
    }
    return false;
}

/// The unit has sent no trajectory in time: brakes along the rest of the last one.
static void path_brake(const world* self, world_vehicle* vehicle)
{
    const double speed = fmax(vehicle->state.speed + UNIT_LOST_BRAKING * WORLD_DT, 0.0);
    const double distance = 0.5 * (fmax(vehicle->state.speed, 0.0) + speed) * WORLD_DT;
    verge_point  point;
    vehicle->mode = vehicle->mode != NULL ? WORLD_MODE_NONE : NULL;
    vehicle->plan.action_count = 0; // no action is known
    if (distance <= 0.0) {
        vehicle->state.speed = vehicle->state.acceleration = vehicle->state.yaw_rate = 0.0;
    } else if (path_ahead(vehicle, distance, &point)) {
        vehicle->along = point.t;
        point.speed = speed;
        point.acceleration = UNIT_LOST_BRAKING;
        point.jerk = 0.0;
        point_drive(vehicle, &point);
    } else {
        vehicle->along = INFINITY; // beyond the trajectory
        lane_keep(self, vehicle, UNIT_LOST_BRAKING);
    }
}

static void point_drive(world_vehicle* vehicle, const verge_point* point)
{
    vehicle->state.x = point->x;
    vehicle->state.y = point->y;
    vehicle->state.heading = point->heading;
    vehicle->state.speed = point->speed;
    vehicle->state.acceleration = point->acceleration;
    vehicle->state.yaw_rate = point->curvature * point->speed;
    vehicle->curvature = point->curvature;
    vehicle->jerk = point->jerk;
}

static verge_point point_between(const verge_point* a, const verge_point* b, double share)
{
    static const double pi = 3.14159265358979323846;
    double turn = b->heading - a->heading;
    turn += turn > pi ? -2.0 * pi : turn <= -pi ? 2.0 * pi : 0.0;
    double heading = a->heading + share * turn;
    heading += heading > pi ? -2.0 * pi : heading <= -pi ? 2.0 * pi : 0.0;
    return (verge_point){
        .t = a->t + share * (b->t - a->t),
        .x = a->x + share * (b->x - a->x),
        .y = a->y + share * (b->y - a->y),
        .heading = heading,
        .speed = a->speed + share * (b->speed - a->speed),
        .acceleration = a->acceleration + share * (b->acceleration - a->acceleration),
        .curvature = a->curvature + share * (b->curvature - a->curvature),
        .jerk = a->jerk,
    };
}

/// Moves a vehicle without a plan along its lane at constant offset, or straight ahead on no lane.
static void lane_keep(const world* self, world_vehicle* vehicle, double acceleration)
{
    verge_vehicle* state = &vehicle->state;
    const double   speed = fmax(state->speed + acceleration * WORLD_DT, 0.0);
    const double   distance = 0.5 * (state->speed + speed) * WORLD_DT;
    const verge_lane_position at =
        verge_road_project(self->road, state->x, state->y, state->heading, vehicle->lane_last);
    state->acceleration = speed > 0.0 ? acceleration : 0.0;
    state->speed = speed;
    state->yaw_rate = at.lane_id == VERGE_NO_LANE ? 0.0 : at.curvature * speed;
    if (at.lane_id == VERGE_NO_LANE) {
        state->x += distance * cos(state->heading);
        state->y += distance * sin(state->heading);
        return;
    }
    double        s = at.s + distance;
    int32_t       lane = at.lane_id;
    const double  length = verge_road_length(self->road, lane);
    const int32_t next = verge_road_next(self->road, lane, state->target_lane);
    if (s > length && next != VERGE_NO_LANE) {
        s -= length;
        lane = next;
    }
    verge_road_at(self->road, lane, s, at.d, &state->x, &state->y, &state->heading);
}

/// Does the body overlap the lane beside its own? A vehicle that changes lane at the end of its
/// lane swings out over the end.
static bool beside_lane(const world* self, const verge_vehicle* state, int32_t lane)
{
    const int32_t sides[] = { verge_road_left(self->road, lane),
                              verge_road_right(self->road, lane) };
    for (size_t i = 0; i < sizeof sides / sizeof sides[0]; ++i) {
        if (sides[i] == VERGE_NO_LANE) {
            continue;
        }
        const verge_lane_position at =
            verge_road_project_on(self->road, sides[i], state->x, state->y);
        const double turned = state->heading - at.heading;
        const double reach =
            0.5 * (verge_road_width(self->road, sides[i]) + state->length * fabs(sin(turned))
                   + state->width * fabs(cos(turned)));
        if (at.s <= verge_road_length(self->road, sides[i]) && fabs(at.d) <= reach) {
            return true;
        }
    }
    return false;
}

/// Finds the lane of a vehicle and detects that it has left the road at its end.
static void vehicle_locate(const world* self, world_vehicle* vehicle)
{
    const verge_vehicle* state = &vehicle->state;
    vehicle->lane = VERGE_NO_LANE;
    if (!vehicle->present) {
        return;
    }
    // Lanes overlap at a merge or a diverge. The lane of the last tick is preferred, then its
    // successor towards the target lane; at the first tick the target lane.
    const int32_t lane = vehicle->lane_last;
    const int32_t prefer = lane != VERGE_NO_LANE ? lane : state->target_lane;
    verge_lane_position at =
        verge_road_project(self->road, state->x, state->y, state->heading, prefer);
    if (lane != VERGE_NO_LANE && at.lane_id != lane) {
        const int32_t next = verge_road_next(self->road, lane, state->target_lane);
        at = verge_road_project(self->road, state->x, state->y, state->heading, next);
    }
    const bool was_off_road = vehicle->off_road;
    vehicle->off_road = at.lane_id == VERGE_NO_LANE || !at.contained;
    if (!vehicle->off_road) {
        vehicle->lane = vehicle->lane_last = at.lane_id;
        return;
    }
    if (lane == VERGE_NO_LANE) {
        return;
    }
    const double  s = verge_road_project_on(self->road, lane, state->x, state->y).s;
    const double  beyond = s - verge_road_length(self->road, lane);
    if (beyond >= -INSTANT &&
        verge_road_next(self->road, lane, state->target_lane) == VERGE_NO_LANE) {
        const verge_action_step* action = world_action(self, vehicle);
        const bool changing = action != NULL && action->turn_signal != 0;
        if (beyond <= SWING_OUT && (changing || beside_lane(self, state, lane))) {
            vehicle->off_road = was_off_road;
            return;
        }
        vehicle->present = false;
        vehicle->left = true;
        // Leaving at the end of the road does not count.
        vehicle->off_road = was_off_road || (state->controlled && world_dead_end(self, lane));
    }
}
