/// More vehicles than the paper's table: its freeway with 5, 6 and 8 of them controlled, and
/// random dense traffic. All methods, and the paper's search beside the default one.
#include "experiments.h"

#include "common/number.h"

#include "must.h"
#include "summary.h"
#include "traffic.h"

#include <string.h>

/// A compared variant: a method and its search.
typedef struct contender {
    const char* name;
    method      method;
    bool        paper;   ///< "search": "paper"
} contender;

static const contender contenders[] = {
    { "verge", METHOD_VERGE, false },
    { "verge, search: paper", METHOD_VERGE, true },
    { "decision-only", METHOD_DECISION_ONLY, false },
    { "sequential", METHOD_SEQUENTIAL, false },
};
enum { contender_count = sizeof contenders / sizeof contenders[0] };

/// A kind of scene; density 0: the authors' freeway.
typedef struct scenes {
    const char* name;
    uint32_t    controlled, humans;
    double      density;   ///< [1/km] a lane
    double      speed_min, speed_max; ///< [m/s]
} scenes;

static const scenes all_scenes[] = {
    { "freeway", 5, 0, 0.0, 0.0, 0.0 },
    { "freeway", 6, 0, 0.0, 0.0, 0.0 },
    { "freeway", 8, 0, 0.0, 0.0, 0.0 },
    { "random", 5, 3, 30.0, 4.0, 8.0 },
    { "random", 6, 3, 30.0, 4.0, 8.0 },
    { "random", 8, 4, 30.0, 4.0, 8.0 },
    { "random, sparse", 8, 4, 15.0, 4.0, 8.0 },
    { "random, half humans", 8, 8, 30.0, 4.0, 8.0 },
    { "random, even speeds", 8, 4, 30.0, 6.0, 7.0 },
};

/// Vehicles added to the authors' four-vehicle state, on its lanes [id, lane, s, speed, target]:
/// first its human 3 and the human 5 of their figure become controlled, then two more.
static const double added[][5] = {
    { 3, 1, 20, 6, 0 }, { 5, 0, 28, 6, 1 }, { 6, 2, 12, 6, 1 }, { 7, 1, 5, 6, 2 },
};

static lab_document* freeway_document(const lab* self, uint32_t controlled);
static lab_document* document_of(lab* self, const scenes* kind, uint64_t seed);
static bool fill(lab* self, const scenes* kind, trial* tasks);
static void rows_of(table* rows, const scenes* kind, const outcome* results, uint32_t repeats);

bool beyond(lab* self, table* rows)
{
    const uint32_t count = self->repeats * contender_count;
    trial*   tasks = must_calloc(count, sizeof *tasks);
    outcome* results = must_calloc(count, sizeof *results);
    bool     good = true;
    for (uint32_t k = 0; good && k < sizeof all_scenes / sizeof all_scenes[0]; ++k) {
        good = fill(self, &all_scenes[k], tasks) && lab_run(self, tasks, results, count);
        if (good) {
            rows_of(rows, &all_scenes[k], results, self->repeats);
            lab_free_results(results, count);
        }
        lab_clear(self);
    }
    free(results);
    free(tasks);
    return good;
}

static bool fill(lab* self, const scenes* kind, trial* tasks)
{
    for (uint32_t i = 0; i < self->repeats; ++i) {
        const uint64_t seed = self->seed + i;
        for (uint32_t c = 0; c < contender_count; ++c) {
            lab_document* document = document_of(self, kind, seed);
            if (document == NULL) {
                return false;
            }
            if (contenders[c].paper) {
                cJSON* planner = cJSON_GetObjectItemCaseSensitive(document, "planner");
                lab_set(planner, "search", cJSON_CreateString("paper"));
            }
            if (contenders[c].method != METHOD_VERGE) {
                lab_parameter(document, "steps", 13);
            }
            char name[64];
            snprintf(name, sizeof name, "scene-%u-%u-%.0f-%u.json", kind->controlled, kind->humans,
                     kind->density, i);
            const char* text = lab_text(self, document);
            if (self->scenes && c == 0 && !lab_write(self, name, text, strlen(text))) {
                return false;
            }
            tasks[c * self->repeats + i] = (trial){
                .text = text, .seed = seed, .method = contenders[c].method,
                .bound = contenders[c].method == METHOD_VERGE,
            };
        }
    }
    return true;
}

/// Closed loop over 20 s; without planning 13 steps, which last 19.5 s.
static lab_document* document_of(lab* self, const scenes* kind, uint64_t seed)
{
    const traffic with = { .controlled = kind->controlled, .humans = kind->humans,
                           .density = kind->density, .speed_min = kind->speed_min,
                           .speed_max = kind->speed_max, .seed = seed };
    lab_document* document = kind->density > 0.0 ? traffic_document(&with)
                                                 : freeway_document(self, kind->controlled);
    if (document != NULL) {
        lab_parameter(document, "seed", (double)seed);
        lab_duration(document, 19.5);
    }
    return document;
}

static lab_document* freeway_document(const lab* self, uint32_t controlled)
{
    scenario      base;
    lab_document* document = lab_open(self, "freeway-4av");
    char*         text = document != NULL ? must(value_text(document)) : NULL;
    if (document == NULL || !scenario_parse(&base, "freeway-4av", text, strlen(text), NULL)) {
        free(text);
        cJSON_Delete(document);
        return NULL;
    }
    cJSON* vehicles = cJSON_GetObjectItemCaseSensitive(document, "vehicles");
    for (uint32_t k = 0; k < controlled - 4; ++k) {
        const double* from = added[k];
        cJSON*        vehicle = lab_vehicle(document, (int32_t)from[0]);
        if (vehicle == NULL) {
            vehicle = must(cJSON_CreateObject());
            cJSON_AddItemToArray(vehicles, vehicle);
        }
        double x, y, heading;
        verge_road_at(verge_planner_road(base.planner), (int32_t)from[1], from[2] + 20.0, 0.0, &x,
                      &y, &heading);
        lab_set(vehicle, "id", cJSON_CreateNumber(from[0]));
        lab_set(vehicle, "control", cJSON_CreateString("controlled"));
        lab_set(vehicle, "x", cJSON_CreateNumber(x));
        lab_set(vehicle, "y", cJSON_CreateNumber(y));
        lab_set(vehicle, "heading", cJSON_CreateNumber(heading));
        lab_set(vehicle, "speed", cJSON_CreateNumber(from[3]));
        lab_set(vehicle, "acceleration", cJSON_CreateNumber(0.0));
        lab_set(vehicle, "length", cJSON_CreateNumber(5.0));
        lab_set(vehicle, "width", cJSON_CreateNumber(2.0));
        lab_set(vehicle, "target_lane", cJSON_CreateNumber(from[4]));
    }
    scenario_free(&base);
    free(text);
    return document;
}

static void rows_of(table* rows, const scenes* kind, const outcome* results, uint32_t repeats)
{
    for (uint32_t c = 0; c < contender_count; ++c) {
        const summary sums = summary_of(&results[c * repeats], repeats);
        table_row(rows);
        table_text(rows, "scenes", kind->name);
        table_number(rows, "controlled", kind->controlled);
        table_number(rows, "humans", kind->humans);
        table_number(rows, "density", kind->density);
        table_text(rows, "method", contenders[c].name);
        summary_table_cells(rows, &sums);
        summary_more_cells(rows, &sums);
    }
}
