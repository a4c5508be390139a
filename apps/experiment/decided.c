/// See decided.h.
#include "decided.h"

#include "sequential.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// The motion of the humans and of the controlled vehicles that are decided already.
typedef struct scene_ahead {
    const world*        start;
    int32_t             axis;   ///< lane whose reference line is the straight frame
    uint32_t            count;
    sequential_obstacle obstacles[VERGE_VEHICLES_MAX];
} scene_ahead;

static void decided_start(const world* start, int32_t id, decided_state* state);
static void predict_humans(scene_ahead* self, double horizon);
static void problem_fill(const scene_ahead* self, const verge_vehicle* vehicle,
                         sequential_problem* problem);
static void obstacle_add(scene_ahead* self, const sequential_problem* problem,
                         const sequential_plan* plan);
static void sequential_note(decided_vehicle* to, const scene_ahead* ahead, int32_t id,
                            const sequential_problem* problem, const sequential_plan* plan);
static uint32_t order_of(const world* start, int32_t axis, const verge_vehicle** order);

void decided_from_plan(decided* self, const world* start, const verge_plan* plan)
{
    *self = (decided){ .step_s = start->scene->def.step_s, .vehicle_count = plan->vehicle_count,
                       .nodes = plan->search.nodes, .nodes_first = plan->search.nodes_first };
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        const verge_vehicle_plan* from = &plan->vehicles[i];
        decided_vehicle*          to = &self->vehicles[i];
        to->id = from->vehicle_id;
        to->step_count = from->action_count;
        decided_start(start, to->id, &to->states[0]);
        for (uint32_t k = 0; k < from->action_count; ++k) {
            const verge_action_step* step = &from->actions[k];
            to->steps[k] = *step;
            to->states[k + 1] = (decided_state){ step->lane_id, step->s, step->d, step->v };
        }
    }
}

bool decided_from_sequential(decided* self, const world* start, uint64_t seed)
{
    const verge_planner_def* def = &start->scene->def;
    const verge_vehicle*     order[VERGE_VEHICLES_MAX];
    scene_ahead*             ahead = calloc(1, sizeof *ahead);
    if (ahead == NULL) {
        return false;
    }
    ahead->start = start;
    ahead->axis = def->road.lanes[0].id;
    *self = (decided){ .step_s = def->step_s };
    predict_humans(ahead, def->step_s * def->steps);
    const uint32_t count = order_of(start, ahead->axis, order);
    bool           good = true;
    for (uint32_t i = 0; good && i < count; ++i) {
        sequential_problem problem;
        sequential_plan    plan;
        problem_fill(ahead, order[i], &problem);
        problem.iterations = def->iterations / count;
        problem.seed = seed * VERGE_VEHICLES_MAX + i;
        good = sequential_search(&problem, &plan);
        if (good) {
            sequential_note(&self->vehicles[self->vehicle_count++], ahead, order[i]->id, &problem,
                            &plan);
            obstacle_add(ahead, &problem, &plan);
            self->nodes += plan.nodes;
            self->nodes_first += plan.nodes_first;
        }
    }
    free(ahead);
    return good;
}

void decided_trajectory(const decided* self, const verge_road* road, const decided_vehicle* vehicle,
                        uint32_t step, verge_vehicle_plan* plan)
{
    const decided_state* from = &vehicle->states[step];
    const decided_state* to = &vehicle->states[step + 1];
    const double         dt = self->step_s;
    double               x, y, heading;
    // Both ends in one lane's frame.
    verge_road_at(road, to->lane_id, to->s, to->d, &x, &y, &heading);
    const verge_lane_position end = verge_road_project_on(road, from->lane_id, x, y);
    const double way = end.s - from->s;
    const double drift = (end.d - from->d) / dt;
    // s(t) = s0 + v0 t + b t^2 + c t^3 through both ends and speeds.
    const double b = (3.0 * way - (2.0 * from->v + to->v) * dt) / (dt * dt);
    const double c = ((from->v + to->v) * dt - 2.0 * way) / (dt * dt * dt);
    *plan = (verge_vehicle_plan){ .vehicle_id = vehicle->id, .status = VERGE_PLANNED,
                                  .action_count = 1 };
    plan->actions[0] = vehicle->steps[step];
    plan->actions[0].t0 = 0.0;
    plan->actions[0].t1 = dt;
    plan->point_count = (uint32_t)lround(dt * WORLD_TICKS_PER_SECOND) + 1;
    for (uint32_t k = 0; k < plan->point_count; ++k) {
        const double t = (double)k / WORLD_TICKS_PER_SECOND;
        verge_point* point = &plan->points[k];
        const double along = fmax(from->v + 2.0 * b * t + 3.0 * c * t * t, 0.0);
        verge_road_at(road, from->lane_id, from->s + from->v * t + b * t * t + c * t * t * t,
                      from->d + drift * t, &point->x, &point->y, &point->heading);
        point->t = t;
        point->speed = sqrt(along * along + drift * drift);
        point->acceleration = 2.0 * b + 6.0 * c * t;
    }
}

static void decided_start(const world* start, int32_t id, decided_state* state)
{
    for (uint32_t i = 0; i < start->vehicle_count; ++i) {
        const verge_vehicle* vehicle = &start->vehicles[i].state;
        if (vehicle->id == id) {
            const verge_lane_position at = verge_road_project(
                start->road, vehicle->x, vehicle->y, vehicle->heading, VERGE_NO_LANE);
            *state = (decided_state){ at.lane_id, at.s, at.d, vehicle->speed };
        }
    }
}

/// Controlled vehicles as other drivers predict them: at constant speed.
static void predict_humans(scene_ahead* self, double horizon)
{
    verge_vehicle  states[VERGE_VEHICLES_MAX];
    const uint32_t count = world_states(self->start, states);
    const uint32_t ticks = (uint32_t)lround(horizon * WORLD_TICKS_PER_SECOND);
    const uint32_t every = (uint32_t)lround(SEQUENTIAL_SAMPLE_S * WORLD_TICKS_PER_SECOND);
    const verge_road* road = self->start->road;
    for (uint32_t tick = 0; tick <= ticks; ++tick) {
        uint32_t obstacle = 0;
        for (uint32_t i = 0; i < count; ++i) {
            if (tick % every == 0 && !states[i].controlled) {
                const verge_lane_position at =
                    verge_road_project_on(road, self->axis, states[i].x, states[i].y);
                sequential_obstacle* to = &self->obstacles[obstacle++];
                to->half_length = 0.5 * states[i].length;
                to->half_width = 0.5 * states[i].width;
                to->s[tick / every] = at.s;
                to->y[tick / every] = at.d;
                self->count = obstacle;
            }
        }
        (void)verge_humans_advance(self->start->scene->humans, road, NULL, states, count,
                                   WORLD_DT);
        for (uint32_t i = 0; i < count; ++i) {
            if (states[i].controlled) {
                const verge_lane_position at = verge_road_project(
                    road, states[i].x, states[i].y, states[i].heading, VERGE_NO_LANE);
                verge_road_at(road, at.lane_id, at.s + states[i].speed * WORLD_DT, at.d,
                              &states[i].x, &states[i].y, &states[i].heading);
            }
        }
    }
}

static void problem_fill(const scene_ahead* self, const verge_vehicle* vehicle,
                         sequential_problem* problem)
{
    const verge_planner_def*  def = &self->start->scene->def;
    const verge_road*         road = self->start->road;
    const verge_lane_position at =
        verge_road_project_on(road, self->axis, vehicle->x, vehicle->y);
    const verge_lane_position own =
        verge_road_project(road, vehicle->x, vehicle->y, vehicle->heading, VERGE_NO_LANE);
    *problem = (sequential_problem){
        .s = at.s, .y = at.d, .v = vehicle->speed,
        .half_length = 0.5 * vehicle->length, .half_width = 0.5 * vehicle->width,
        .target_y = at.d - own.d, .y_min = at.d, .y_max = at.d,
        .speed_limit = verge_road_speed_limit(road, own.lane_id),
        .step_s = def->step_s, .steps = def->steps, .exploration = def->exploration,
        .reward_target = def->reward_target, .reward_lane = def->reward_lane,
        .reward_consistency = def->reward_consistency, .iterations = def->iterations,
        .obstacles = self->obstacles, .obstacle_count = self->count,
    };
    problem->cruise = def->cruise_share * problem->speed_limit;
    for (uint32_t i = 0; i < def->road.lane_count; ++i) { // beside the vehicle, as lanes run there
        const int32_t lane = def->road.lanes[i].id;
        const double  centre = at.d - verge_road_project_on(road, lane, vehicle->x, vehicle->y).d;
        problem->y_min = fmin(problem->y_min, centre);
        problem->y_max = fmax(problem->y_max, centre);
        if (lane == vehicle->target_lane) {
            problem->target_y = centre;
        }
    }
}

/// Makes the vehicle an obstacle for those decided after it.
static void obstacle_add(scene_ahead* self, const sequential_problem* problem,
                         const sequential_plan* plan)
{
    sequential_obstacle* to = &self->obstacles[self->count++];
    const uint32_t samples = (uint32_t)lround(problem->step_s / SEQUENTIAL_SAMPLE_S);
    to->half_length = problem->half_length;
    to->half_width = problem->half_width;
    for (uint32_t k = 0; k <= problem->steps * samples; ++k) {
        const uint32_t step = k / samples < problem->steps ? k / samples : problem->steps - 1;
        const double   t = SEQUENTIAL_SAMPLE_S * (double)(k - step * samples);
        const sequential_state at =
            sequential_move(problem, &plan->states[step], plan->actions[step], t);
        to->s[k] = at.s;
        to->y[k] = at.y;
    }
}

static void sequential_note(decided_vehicle* to, const scene_ahead* ahead, int32_t id,
                            const sequential_problem* problem, const sequential_plan* plan)
{
    to->id = id;
    to->step_count = problem->steps;
    for (uint32_t k = 0; k <= problem->steps; ++k) {
        const sequential_state* at = &plan->states[k];
        to->states[k] = (decided_state){ ahead->axis, at->s, at->y, at->v };
    }
    for (uint32_t k = 0; k < problem->steps; ++k) {
        const double a = sequential_acceleration(plan->actions[k]);
        const double lateral = sequential_lateral(plan->actions[k]);
        to->steps[k] = (verge_action_step){
            .action = lateral > 0.0   ? VERGE_CHANGE_LEFT
                      : lateral < 0.0 ? VERGE_CHANGE_RIGHT
                      : a > 0.0       ? VERGE_ACCELERATE
                      : a < 0.0       ? VERGE_DECELERATE : VERGE_KEEP_SPEED,
            .brake_light = a < 0.0,
            .turn_signal = lateral > 0.0 ? 1 : lateral < 0.0 ? -1 : 0,
        };
    }
}

/// Controlled vehicles by their position along the axis, farthest first, then by id.
static uint32_t order_of(const world* start, int32_t axis, const verge_vehicle** order)
{
    double   ways[VERGE_VEHICLES_MAX];
    uint32_t count = 0;
    for (uint32_t i = 0; i < start->vehicle_count; ++i) {
        const verge_vehicle* vehicle = &start->vehicles[i].state;
        if (!start->vehicles[i].present || !vehicle->controlled) {
            continue;
        }
        const double way = verge_road_project_on(start->road, axis, vehicle->x, vehicle->y).s;
        uint32_t     at = count++;
        while (at > 0 && (way > ways[at - 1] ||
                          (way == ways[at - 1] && vehicle->id < order[at - 1]->id))) {
            ways[at] = ways[at - 1];
            order[at] = order[at - 1];
            --at;
        }
        ways[at] = way;
        order[at] = vehicle;
    }
    return count;
}
