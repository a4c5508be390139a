/// See summary.h.
#include "summary.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static double value_at(const outcome* result, size_t offset)
{
    double value;
    memcpy(&value, (const char*)result + offset, sizeof value);
    return value;
}

/// The mean over the runs that measured the quantity.
static double mean_of(const outcome* results, uint32_t count, size_t offset)
{
    double   sum = 0.0;
    uint32_t measured = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const double value = value_at(&results[i], offset);
        if (isfinite(value)) {
            sum += value;
            ++measured;
        }
    }
    return measured > 0 ? sum / measured : (double)NAN;
}

static double least_of(const outcome* results, uint32_t count, size_t offset)
{
    double least = INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
        least = fmin(least, value_at(&results[i], offset));
    }
    return least;
}

summary summary_of(const outcome* results, uint32_t count)
{
    summary  self = { .count = count };
    double   success = 0.0, nodes = 0.0, total = 0.0, gap = 0.0;
    uint32_t intentions = 0, reached = 0, bounded = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const outcome* one = &results[i];
        success += one->success ? 1.0 : 0.0;
        self.collisions += one->collisions;
        nodes += one->nodes;
        total += one->nodes_total;
        self.nodes_worst = fmax(self.nodes_worst, one->nodes);
        self.finish_worst = fmax(self.finish_worst, one->finish_last);
        intentions += one->intentions;
        reached += one->reached;
        if (isfinite(one->bound) && one->bound > 0.0) {
            gap += (one->bound - one->reward) / one->bound;
            ++bounded;
        }
    }
    self.success = success / count;
    self.reached = intentions > 0 ? (double)reached / intentions : (double)NAN;
    self.nodes = nodes / count;
    self.nodes_total = total / count;
    self.gap = bounded > 0 ? gap / bounded : (double)NAN;
    self.nodes_cycle = mean_of(results, count, offsetof(outcome, nodes_cycle));
    self.finish_time = mean_of(results, count, offsetof(outcome, finish_time));
    self.reached_time = mean_of(results, count, offsetof(outcome, reached_time));
    self.min_center_gap = mean_of(results, count, offsetof(outcome, min_center_gap));
    self.min_center_gap_worst = least_of(results, count, offsetof(outcome, min_center_gap));
    self.min_distance = mean_of(results, count, offsetof(outcome, min_distance));
    self.min_distance_worst = least_of(results, count, offsetof(outcome, min_distance));
    self.max_abs_acceleration = mean_of(results, count, offsetof(outcome, max_abs_acceleration));
    self.max_abs_jerk = mean_of(results, count, offsetof(outcome, max_abs_jerk));
    self.fallbacks = mean_of(results, count, offsetof(outcome, fallbacks));
    self.reward = mean_of(results, count, offsetof(outcome, reward));
    self.bound = mean_of(results, count, offsetof(outcome, bound));
    return self;
}

void summary_table_cells(table* rows, const summary* self)
{
    table_number(rows, "repeats", self->count);
    table_number(rows, "success", self->success);
    table_number(rows, "nodes", self->nodes);
    table_number(rows, "finish_time", self->finish_time);
    table_number(rows, "min_center_gap", self->min_center_gap);
    table_number(rows, "min_distance", self->min_distance);
    table_number(rows, "nodes_total", self->nodes_total);
    table_number(rows, "nodes_worst", self->nodes_worst);
    table_number(rows, "finish_worst", self->finish_worst);
    table_number(rows, "reached_time", self->reached_time);
    table_number(rows, "min_center_gap_worst", self->min_center_gap_worst);
    table_number(rows, "min_distance_worst", self->min_distance_worst);
}

void summary_more_cells(table* rows, const summary* self)
{
    table_number(rows, "collisions", self->collisions);
    table_number(rows, "intentions_reached", self->reached);
    table_number(rows, "fallbacks", self->fallbacks);
    table_number(rows, "max_abs_acceleration", self->max_abs_acceleration);
    table_number(rows, "max_abs_jerk", self->max_abs_jerk);
    table_number(rows, "reward", self->reward);
    table_number(rows, "bound", self->bound);
    table_number(rows, "below_bound", self->gap);
}
