/// Summarises the outcomes of one setting in one row: means and worst cases.
#ifndef VERGE_EXPERIMENT_SUMMARY_H
#define VERGE_EXPERIMENT_SUMMARY_H

#include "table.h"
#include "trial.h"

typedef struct summary {
    uint32_t count;
    double success;            ///< [1] share of the runs
    double collisions;         ///< [1] in all runs
    double reached;            ///< [1] share of the intentions
    double nodes, nodes_total, nodes_worst, nodes_cycle;
    double finish_time, finish_worst, reached_time; ///< [s] worst: the last vehicle of any run
    double min_center_gap, min_center_gap_worst;    ///< [m] mean of the runs' smallest; smallest
    double min_distance, min_distance_worst;        ///< [m]
    double max_abs_acceleration, max_abs_jerk;      ///< mean of the runs' largest
    double fallbacks;          ///< [1] share of vehicle plans
    double reward, bound, gap; ///< [1] X_flow, its bound, mean of (bound - reward) / bound
} summary;

/// Runs that have not measured a quantity (NaN, infinite) do not count in its mean. If no run has
/// measured it, the mean is NaN.
summary summary_of(const outcome* results, uint32_t count);

/// success, nodes, finish time, gaps: the measures of the paper's table and their worst cases.
void summary_table_cells(table* rows, const summary* self);
/// collisions, intentions, comfort, fallbacks, decision quality.
void summary_more_cells(table* rows, const summary* self);

#endif
