/// Influence of habits on the flow: the same random scenes with each of the three habits, and the
/// frequency of yielding over the cooperation factor.
#include "experiments.h"

#include "must.h"
#include "base/random.h"
#include "summary.h"
#include "traffic.h"

#include <math.h>
#include <string.h>

enum { samples_max = 512, quantities = 4, sample_every = 5 /* ticks */ };

static const char* const quantity_names[quantities] = {
    "gap to the one ahead [m]",
    "speed [m/s]",
    "magnitude of acceleration [m/s^2]",
    "lane change [s]",
};

/// Samples of every controlled vehicle of one run.
typedef struct flow_notes {
    uint32_t count[quantities];
    double   samples[quantities][samples_max];
    double   leaves[VERGE_VEHICLES_MAX]; ///< [s] when it left its lane's centre; 0: not yet
    bool     arrived[VERGE_VEHICLES_MAX];
} flow_notes;

/// One vehicle that can yield, and one with a target lane beside it.
typedef struct yield_notes {
    bool entered;  ///< the one who changes has been in the other's lane
    bool ahead;    ///< ahead of the other, the first time
    double braked; ///< [m/s] how far the one who could yield went below its first speed
    double first_speed;
} yield_notes;

static trial_observer flow_watch, yield_watch;
static bool flows(lab* self, table* rows);
static bool yields(lab* self, table* rows);

bool diversity(lab* self, table* rows)
{
    return flows(self, rows) && yields(self, rows);
}

// ---------------------------------------------------------------------------- flows

static void note(flow_notes* notes, uint32_t quantity, double value)
{
    if (notes->count[quantity] < samples_max) {
        notes->samples[quantity][notes->count[quantity]++] = value;
    }
}

/// From leaving the centre of the lane it starts in to reaching that of its target lane.
static void watch_change(const world* world, uint32_t index, flow_notes* notes)
{
    const world_vehicle*      at = &world->vehicles[index];
    const verge_lane_position on = verge_road_project_on(world->road, at->state.target_lane,
                                                         at->state.x, at->state.y);
    const double width = verge_road_width(world->road, at->state.target_lane);
    if (notes->arrived[index]) {
        return;
    }
    if (notes->leaves[index] == 0.0 && fabs(on.d) < width - 0.3) {
        notes->leaves[index] = world_time(world);
    }
    if (fabs(on.d) <= 0.3) {
        notes->arrived[index] = true;
        note(notes, 3, world_time(world) - notes->leaves[index]);
    }
}

static void flow_watch(const world* world, const verge_plan* plan, void* notes_given)
{
    flow_notes* notes = notes_given;
    (void)plan;
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* at = &world->vehicles[i];
        if (!at->present || !at->state.controlled) {
            continue;
        }
        watch_change(world, i, notes);
        if (world->tick % sample_every != 0) {
            continue;
        }
        double gap = INFINITY;
        for (uint32_t k = 0; k < world->vehicle_count; ++k) {
            const world_vehicle* other = &world->vehicles[k];
            const double ahead = other->state.x - at->state.x; // the road runs along x
            if (k != i && other->present && other->lane == at->lane && ahead > 0.0) {
                gap = fmin(gap, ahead - 0.5 * (at->state.length + other->state.length));
            }
        }
        if (gap < 50.0) {
            note(notes, 0, gap);
        }
        note(notes, 1, at->state.speed);
        note(notes, 2, fabs(at->state.acceleration));
    }
}

static int by_value(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

static void quantity_row(table* rows, const char* habit, uint32_t quantity, const outcome* results,
                         uint32_t count)
{
    static const struct { const char* key; double share; } marks[] = {
        { "p05", 0.05 }, { "p25", 0.25 }, { "p50", 0.50 }, { "p75", 0.75 }, { "p95", 0.95 },
    };
    double*  all = must_calloc((size_t)count * samples_max, sizeof *all);
    uint32_t total = 0;
    double   sum = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        const flow_notes* notes = results[i].notes;
        for (uint32_t k = 0; k < notes->count[quantity]; ++k) {
            sum += all[total++] = notes->samples[quantity][k];
        }
    }
    qsort(all, total, sizeof *all, by_value);
    table_row(rows);
    table_text(rows, "habit", habit);
    table_text(rows, "quantity", quantity_names[quantity]);
    table_number(rows, "samples", total);
    table_number(rows, "mean", total > 0 ? sum / total : (double)NAN);
    for (uint32_t k = 0; k < sizeof marks / sizeof marks[0]; ++k) {
        table_number(rows, marks[k].key, percentile(all, total, marks[k].share));
    }
    free(all);
}

static bool flows(lab* self, table* rows)
{
    static const char* const habits[] = { "aggressive", "normal", "conservative" };
    enum { habit_count = 3 };
    const uint32_t count = habit_count * self->repeats;
    trial*   tasks = must_calloc(count, sizeof *tasks);
    outcome* results = must_calloc(count, sizeof *results);
    for (uint32_t i = 0; i < count; ++i) {
        const uint64_t seed = self->seed + i % self->repeats;
        const traffic  with = { .controlled = 4, .humans = 4, .density = 25.0, .speed_min = 5.0,
                                .speed_max = 8.0, .seed = seed };
        lab_document* document = traffic_document(&with);
        for (int32_t id = 0; id < 4; ++id) {
            cJSON* vehicle = lab_vehicle(document, id);
            if (vehicle != NULL) {
                lab_set(vehicle, "habit", cJSON_CreateString(habits[i / self->repeats]));
            }
        }
        lab_duration(document, 15.0);
        tasks[i] = (trial){ .text = lab_text(self, document), .seed = seed,
                            .observe = flow_watch, .notes_size = sizeof(flow_notes) };
    }
    const bool good = lab_run(self, tasks, results, count);
    for (uint32_t h = 0; good && h < habit_count; ++h) {
        const summary sums = summary_of(&results[h * self->repeats], self->repeats);
        table_row(rows);
        table_text(rows, "habit", habits[h]);
        summary_table_cells(rows, &sums);
        table_number(rows, "max_abs_acceleration", sums.max_abs_acceleration);
        table_number(rows, "max_abs_jerk", sums.max_abs_jerk);
    }
    for (uint32_t q = 0; good && q < quantities; ++q) {
        for (uint32_t h = 0; h < habit_count; ++h) {
            quantity_row(rows, habits[h], q, &results[h * self->repeats], self->repeats);
        }
    }
    lab_free_results(results, good ? count : 0);
    free(results);
    free(tasks);
    return good;
}

// ---------------------------------------------------------------------------- yielding

/// Vehicle 0 drives in lane 0 and can yield. Vehicle 1 drives beside it in lane 1, a little ahead
/// or behind, with lane 0 as target.
static void yield_watch(const world* world, const verge_plan* plan, void* notes_given)
{
    yield_notes*         notes = notes_given;
    const world_vehicle* host = &world->vehicles[0];
    const world_vehicle* guest = &world->vehicles[1];
    (void)plan;
    if (world->tick == 0) {
        notes->first_speed = host->state.speed;
    }
    notes->braked = fmax(notes->braked, notes->first_speed - host->state.speed);
    if (!notes->entered && guest->lane == 0) {
        notes->entered = true;
        notes->ahead = guest->state.x > host->state.x;
    }
}

static const char* yield_text(lab* self, double cooperation, uint64_t seed)
{
    vg_random     random = vg_random_from(seed, 29);
    const double  lead = -6.0 + 0.1 * vg_random_below(&random, 141); // [m] guest before host
    const double  speeds[2] = { 5.0 + 0.1 * vg_random_below(&random, 31),
                                5.0 + 0.1 * vg_random_below(&random, 31) };
    const traffic base = { .controlled = 2, .density = 10.0, .speed_min = 5.0, .speed_max = 5.0 };
    lab_document* document = traffic_document(&base);
    for (int32_t id = 0; id < 2; ++id) {
        cJSON* vehicle = lab_vehicle(document, id);
        lab_set(vehicle, "x", cJSON_CreateNumber(id == 0 ? 60.0 : 60.0 + lead));
        lab_set(vehicle, "y", cJSON_CreateNumber(4.0 * id));
        lab_set(vehicle, "speed", cJSON_CreateNumber(speeds[id]));
        lab_set(vehicle, "target_lane", cJSON_CreateNumber(0));
    }
    verge_habit normal = verge_habit_of(VERGE_NORMAL);
    cJSON* habit = must(cJSON_CreateObject());
    cJSON* weights = must(cJSON_CreateObject());
    const struct { const char* key; double value; } parts[] = {
        { "curvature", normal.weights.curvature }, { "heading", normal.weights.heading },
        { "offset", normal.weights.offset }, { "acceleration", normal.weights.acceleration },
        { "jerk", normal.weights.jerk }, { "obstacle", normal.weights.obstacle },
    };
    for (uint32_t k = 0; k < sizeof parts / sizeof parts[0]; ++k) {
        lab_set(weights, parts[k].key, cJSON_CreateNumber(parts[k].value));
    }
    lab_set(habit, "cooperation", cJSON_CreateNumber(cooperation));
    lab_set(habit, "weights", weights);
    lab_set(lab_vehicle(document, 0), "habit", habit);
    lab_duration(document, 15.0);
    return lab_text(self, document);
}

static bool yields(lab* self, table* rows)
{
    static const double factors[] = { 0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0 };
    enum { factor_count = sizeof factors / sizeof factors[0] };
    const uint32_t count = factor_count * self->repeats;
    trial*   tasks = must_calloc(count, sizeof *tasks);
    outcome* results = must_calloc(count, sizeof *results);
    for (uint32_t i = 0; i < count; ++i) {
        const uint64_t seed = self->seed + i % self->repeats;
        tasks[i] = (trial){ .text = yield_text(self, factors[i / self->repeats], seed),
                            .seed = seed, .observe = yield_watch,
                            .notes_size = sizeof(yield_notes) };
    }
    const bool good = lab_run(self, tasks, results, count);
    for (uint32_t f = 0; good && f < factor_count; ++f) {
        double yielded = 0.0, entered = 0.0, braked = 0.0, more = 0.0, less = 0.0;
        for (uint32_t i = 0; i < self->repeats; ++i) {
            const yield_notes* notes = results[f * self->repeats + i].notes;
            const yield_notes* egoist = results[i].notes; // the same scene with the first factor
            more += notes->ahead && !egoist->ahead ? 1.0 : 0.0;
            less += !notes->ahead && egoist->ahead ? 1.0 : 0.0;
            entered += notes->entered ? 1.0 : 0.0;
            yielded += notes->entered && notes->ahead ? 1.0 : 0.0;
            braked += notes->braked / self->repeats;
        }
        const summary sums = summary_of(&results[f * self->repeats], self->repeats);
        table_row(rows);
        table_number(rows, "cooperation", factors[f]);
        table_number(rows, "repeats", self->repeats);
        table_number(rows, "yields", entered > 0.0 ? yielded / entered : (double)NAN);
        table_number(rows, "only_now", more);
        table_number(rows, "only_at_0", less);
        table_number(rows, "speed_given_up", braked);
        table_number(rows, "success", sums.success);
        table_number(rows, "finish_time", sums.finish_time);
        table_number(rows, "min_distance", sums.min_distance);
    }
    lab_free_results(results, good ? count : 0);
    free(results);
    free(tasks);
    return good;
}
