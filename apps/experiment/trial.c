/// See trial.h.
#include "trial.h"

#include "bound.h"
#include "common/run.h"
#include "decided.h"
#include "must.h"

#include <math.h>
#include <string.h>

/// The state of a run.
typedef struct drive {
    const trial* task;
    outcome*     result;
    scenario     scene;
    world        world;
    metrics      metrics;
    verge_plan*  plan;      ///< of the latest cycle
    decided*     decisions; ///< of the methods without planning
    FILE*        run;       ///< null: not recorded
} drive;

static bool drive_through(drive* self);
static bool plan_cycle(drive* self);
static bool decide_once(drive* self);
static void hand_out(drive* self, uint32_t step);
static void first_search(drive* self);
static void sum_up(drive* self);

const char* method_name(method method)
{
    static const char* const names[] = { "verge", "decision-only", "sequential" };
    return names[method];
}

void trial_run(const trial* task, outcome* result)
{
    drive* self = must_calloc(1, sizeof *self);
    *result = (outcome){ .reward = NAN, .bound = NAN };
    self->task = task;
    self->result = result;
    if (!scenario_parse(&self->scene, "experiment", task->text, strlen(task->text), &task->seed)) {
        snprintf(result->error, sizeof result->error, "%.250s", self->scene.file.error);
        free(self);
        return;
    }
    self->plan = must_calloc(1, sizeof *self->plan);
    self->decisions = must_calloc(1, sizeof *self->decisions);
    result->notes = must_calloc(1, task->notes_size);
    if (task->record) {
        self->run = must(open_memstream(&result->run, &result->run_size));
    }
    if (!world_init(&self->world, &self->scene) || !metrics_init(&self->metrics, &self->world)) {
        must(NULL);
    }
    result->done = drive_through(self);
    if (self->run != NULL) {
        fclose(self->run);
    }
    metrics_free(&self->metrics);
    world_free(&self->world);
    scenario_free(&self->scene);
    free(self->decisions);
    free(self->plan);
    free(self);
}

void outcome_free(outcome* self)
{
    free(self->notes);
    free(self->run);
    *self = (outcome){ 0 };
}

static bool drive_through(drive* self)
{
    const bool     plans = self->task->method == METHOD_VERGE;
    const uint32_t end = (uint32_t)lround(self->scene.duration * WORLD_TICKS_PER_SECOND);
    const uint32_t cycle = (uint32_t)lround((plans ? self->scene.replan : self->scene.def.step_s) *
                                            WORLD_TICKS_PER_SECOND);
    if (self->run != NULL) {
        run_write_head(self->run, &self->scene);
    }
    for (;;) {
        const uint32_t tick = self->world.tick;
        const bool     now = tick % cycle == 0 && tick < end;
        if (now && plans && !plan_cycle(self)) {
            return false;
        }
        if (now && !plans && tick == 0 && !decide_once(self)) {
            return false;
        }
        if (now && !plans) {
            hand_out(self, tick / cycle);
        }
        metrics_tick(&self->metrics, &self->world);
        if (self->task->observe != NULL) {
            self->task->observe(&self->world, now && plans ? self->plan : NULL,
                                self->result->notes);
        }
        if (self->run != NULL) {
            run_write_tick(self->run, &self->world);
            if (now && plans) {
                run_write_plan(self->run, &self->world, self->plan);
            }
        }
        if (tick >= end) {
            break;
        }
        world_advance(&self->world);
    }
    sum_up(self);
    return true;
}

/// Plans for the present state of the world and gives each controlled vehicle its plan.
static bool plan_cycle(drive* self)
{
    const verge_status status = world_plan(&self->world, self->plan);
    if (status != VERGE_OK) {
        snprintf(self->result->error, sizeof self->result->error, "%s at %g s: %s",
                 self->scene.name, world_time(&self->world), verge_status_text(status));
        return false;
    }
    if (self->world.tick == 0) {
        first_search(self);
    }
    const verge_counters counters = verge_planner_counters(self->scene.planner);
    metrics_cycle(&self->metrics, self->plan, &counters, -1.0);
    for (uint32_t i = 0; i < self->plan->vehicle_count; ++i) {
        world_follow(&self->world, &self->plan->vehicles[i], world_time(&self->world));
    }
    return true;
}

static bool decide_once(drive* self)
{
    if (self->task->method == METHOD_SEQUENTIAL) {
        if (!decided_from_sequential(self->decisions, &self->world, self->task->seed)) {
            must(NULL);
        }
        self->result->nodes = self->decisions->nodes_first;
        self->result->nodes_total = self->decisions->nodes;
        return true;
    }
    if (world_plan(&self->world, self->plan) != VERGE_OK) {
        snprintf(self->result->error, sizeof self->result->error, "%s is refused by the planner",
                 self->scene.name);
        return false;
    }
    first_search(self);
    decided_from_plan(self->decisions, &self->world, self->plan);
    return true;
}

static void hand_out(drive* self, uint32_t step)
{
    for (uint32_t i = 0; i < self->decisions->vehicle_count; ++i) {
        const decided_vehicle* vehicle = &self->decisions->vehicles[i];
        verge_vehicle_plan     plan;
        if (step < vehicle->step_count) {
            decided_trajectory(self->decisions, self->world.road, vehicle, step, &plan);
            world_follow(&self->world, &plan, world_time(&self->world));
        }
    }
}

static void first_search(drive* self)
{
    self->result->nodes = self->plan->search.nodes_first;
    self->result->nodes_total = self->plan->search.nodes;
    self->result->reward = self->plan->search.reward;
    self->result->conflicts = self->plan->search.conflicts;
    self->result->bound = self->plan->search.bound;
    if (self->task->bound) {
        self->result->bound = bound_of(&self->world);
    }
}

static void sum_up(drive* self)
{
    const metrics* from = &self->metrics;
    outcome*       to = self->result;
    uint64_t       plans = 0;
    to->success = metrics_reached(from); // the paper's; its methods decide once, for a while
    to->collisions = from->collisions;
    to->finish_time = metrics_finish_mean(from);
    to->reached_time = metrics_reached_mean(from);
    to->min_center_gap = from->min_center_gap;
    to->min_distance = from->min_distance;
    to->min_ttc = from->min_ttc;
    to->max_abs_acceleration = from->max_abs_acceleration;
    // Decided motion has jumps of acceleration at every step, so jerk is measured with planning
    // only.
    to->max_abs_jerk = self->task->method == METHOD_VERGE ? from->max_abs_jerk : (double)NAN;
    to->nodes_cycle = from->cycles > 0 ? (double)from->nodes / (double)from->cycles : (double)NAN;
    for (uint32_t i = 0; i < from->vehicle_count; ++i) {
        const metrics_vehicle* vehicle = &from->vehicles[i];
        plans += self->world.vehicles[i].state.controlled ? from->cycles : 0;
        if (vehicle->intends && !vehicle->keeps) {
            const bool finished = !isnan(vehicle->finish_time);
            ++to->intentions;
            to->reached += isnan(vehicle->reached_time) ? 0 : 1;
            to->finish_last = finished ? fmax(to->finish_last, vehicle->finish_time)
                                       : (double)INFINITY;
        }
    }
    to->fallbacks = plans > 0 ? (double)from->fallbacks / (double)plans : (double)NAN;
}
