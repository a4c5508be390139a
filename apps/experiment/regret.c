/// How good the first decision is, in random dense traffic: the distance of X_flow to the best plan
/// that is known, over the budget and the number of planned vehicles; and that of the bound.
///
/// Best known   The largest X_flow of all searches of a scene: each budget with two seeds. It is no
///              proof, so the regret may be larger; where the bound equals it, it is the optimum.
/// Seconds      X_flow loses reward_target + reward_lane of 30 s at first for each second that a
///              vehicle loses, so a regret is this many seconds a vehicle.
#include "experiments.h"

#include "must.h"
#include "traffic.h"

#include <math.h>

typedef struct size {
    uint32_t controlled, humans;
    uint32_t budget_max; ///< the largest budget that is tried
} size;

static const size sizes[] = {
    { 2, 4, 100000 }, { 3, 4, 100000 }, { 4, 4, 100000 }, { 6, 4, 100000 }, { 8, 4, 100000 },
    { 8, 24, 10000 }, { 16, 16, 10000 }, { 16, 48, 10000 },
};
static const uint32_t budgets[] = { 300, 1000, 3000, 10000, 100000 };
enum { budget_count = sizeof budgets / sizeof budgets[0], seed_count = 2 };

static const double density = 30.0; // [1/km] a lane
static const double seconds_per_reward = 30.0 / 0.8;

/// The tasks of one scene: [budget][seed].
static uint32_t fill_scene(lab* self, const size* of, uint64_t scene, trial* tasks)
{
    uint32_t count = 0;
    for (uint32_t b = 0; b < budget_count && budgets[b] <= of->budget_max; ++b) {
        for (uint32_t s = 0; s < seed_count; ++s) {
            const traffic with = { .controlled = of->controlled, .humans = of->humans,
                                   .density = density, .speed_min = 4.0, .speed_max = 8.0,
                                   .seed = scene };
            lab_document* document = traffic_document(&with);
            const uint64_t seed = scene + 1000u * s;
            lab_parameter(document, "seed", (double)seed);
            lab_parameter(document, "iterations", budgets[b]);
            lab_duration(document, 0.1); // one cycle
            tasks[count++] = (trial){ .text = lab_text(self, document), .seed = seed,
                                      .method = METHOD_VERGE };
        }
    }
    return count;
}

typedef struct sums {
    double   regret, regret_max, gap;
    uint32_t count, conflicts;
} sums;

static void add_scene(const outcome* results, uint32_t count, sums by_budget[budget_count])
{
    double best = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        best = fmax(best, results[i].reward);
    }
    for (uint32_t i = 0; i < count; ++i) {
        sums* of = &by_budget[i / seed_count];
        const double regret = best - results[i].reward;
        of->regret += regret;
        of->regret_max = fmax(of->regret_max, regret);
        of->gap += results[i].bound - best;
        of->conflicts += results[i].conflicts > 0 ? 1u : 0u;
        ++of->count;
    }
}

static void add_rows(table* rows, const size* of, const sums by_budget[budget_count])
{
    for (uint32_t b = 0; b < budget_count; ++b) {
        const sums* sum = &by_budget[b];
        if (sum->count == 0) {
            continue;
        }
        const double count = sum->count, regret = sum->regret / count;
        table_row(rows);
        table_number(rows, "controlled", of->controlled);
        table_number(rows, "humans", of->humans);
        table_number(rows, "iterations", budgets[b]);
        table_number(rows, "decisions", count);
        table_number(rows, "regret", regret);
        table_number(rows, "regret_worst", sum->regret_max);
        table_number(rows, "seconds_a_vehicle", regret * seconds_per_reward);
        table_number(rows, "bound_above_best", sum->gap / count);
        table_number(rows, "with_a_conflict", sum->conflicts);
    }
}

bool regret(lab* self, table* rows)
{
    trial*   tasks = must_calloc(self->repeats * budget_count * seed_count, sizeof *tasks);
    outcome* results = must_calloc(self->repeats * budget_count * seed_count, sizeof *results);
    bool     good = true;
    for (uint32_t k = 0; good && k < sizeof sizes / sizeof sizes[0]; ++k) {
        sums     by_budget[budget_count] = { { 0 } };
        uint32_t count = 0, each = 0;
        for (uint32_t i = 0; i < self->repeats; ++i) {
            each = fill_scene(self, &sizes[k], self->seed + i, &tasks[count]);
            count += each;
        }
        good = lab_run(self, tasks, results, count);
        for (uint32_t i = 0; good && i < self->repeats; ++i) {
            add_scene(&results[i * each], each, by_budget);
        }
        if (good) {
            add_rows(rows, &sizes[k], by_budget);
            lab_free_results(results, count);
        }
        lab_clear(self);
    }
    free(results);
    free(tasks);
    return good;
}
