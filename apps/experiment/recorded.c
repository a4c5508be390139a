/// Recorded US-101 traffic. The humans follow their recordings and do not react; the vehicles that
/// changed lanes are controlled.
///
/// Cause      A contact is caused by the controlled vehicle, unless a recorded human drove into
///            it from behind while it had been in its lane for LANE_HELD_S.
/// Recorded drivers  All changed lanes within the ten seconds of their scene, because the scenes
///            were selected so. Their own tracks are not in the files. If a later scene of the same
///            recording begins with the same vehicle, its position at that time is known.
#include "experiments.h"

#include "must.h"
#include "summary.h"

#include <dirent.h>
#include <math.h>
#include <string.h>

enum { scenes_max = 64 };
static const double LANE_HELD_S = 2.0;

typedef struct blame_notes {
    int32_t  lane[VERGE_VEHICLES_MAX];
    uint32_t held[VERGE_VEHICLES_MAX];  ///< [ticks] in that lane
    bool     touched[VERGE_VEHICLES_MAX][VERGE_VEHICLES_MAX];
    uint32_t contacts, caused;
} blame_notes;

/// True: this human drives into the controlled vehicle from behind.
static bool runs_into(const world_vehicle* human, const world_vehicle* controlled)
{
    const verge_vehicle* at = &controlled->state;
    const double x = human->state.x - at->x, y = human->state.y - at->y;
    const double along = x * cos(at->heading) + y * sin(at->heading);
    const double across = fabs(y * cos(at->heading) - x * sin(at->heading));
    return along < 0.0 && across < 0.5 * (at->width + human->state.width)
           && human->state.speed > at->speed;
}

static void blame_watch(const world* world, const verge_plan* plan, void* notes_given)
{
    blame_notes* notes = notes_given;
    (void)plan;
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* at = &world->vehicles[i];
        notes->held[i] = at->lane == notes->lane[i] ? notes->held[i] + 1 : 0;
        notes->lane[i] = at->lane;
    }
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* one = &world->vehicles[i];
        for (uint32_t k = 0; k < world->vehicle_count; ++k) {
            const world_vehicle* other = &world->vehicles[k];
            const bool counts = i != k && one->present && other->present && one->state.controlled
                                && (!other->state.controlled || i < k);
            if (!counts || notes->touched[i][k]
                || !verge_vehicles_overlap(&one->state, &other->state)) {
                continue;
            }
            notes->touched[i][k] = true;
            ++notes->contacts;
            const bool held = notes->held[i] * WORLD_DT >= LANE_HELD_S;
            notes->caused += !other->state.controlled && held && runs_into(other, one) ? 0 : 1;
        }
    }
}

static int by_name(const void* a, const void* b)
{
    return strcmp((const char*)a, (const char*)b);
}

/// Paths of the scenes in the folder, in the order of their names.
static uint32_t list_scenes(const lab* self, char paths[scenes_max][512])
{
    DIR*     folder = opendir(self->recordings);
    uint32_t count = 0;
    for (struct dirent* entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
        const size_t length = strlen(entry->d_name);
        if (length > 5 && strcmp(entry->d_name + length - 5, ".json") == 0 && count < scenes_max) {
            snprintf(paths[count++], 512, "%.250s/%.250s", self->recordings, entry->d_name);
        }
    }
    if (folder != NULL) {
        closedir(folder);
    }
    qsort(paths, count, sizeof paths[0], by_name);
    return count;
}

static void scene_row(table* rows, const char* path, const outcome* results, uint32_t count)
{
    const summary sums = summary_of(results, count);
    const char*   name = strrchr(path, '/') + 1;
    double        contacts = 0.0, caused = 0.0;
    char          scene[64];
    for (uint32_t i = 0; i < count; ++i) {
        const blame_notes* notes = results[i].notes;
        contacts += notes->contacts;
        caused += notes->caused;
    }
    snprintf(scene, sizeof scene, "%.*s", (int)(strlen(name) - 5), name);
    table_row(rows);
    table_text(rows, "scene", scene);
    table_number(rows, "repeats", count);
    table_number(rows, "intentions", results[0].intentions);
    table_number(rows, "intentions_reached", sums.reached);
    table_number(rows, "contacts", contacts);
    table_number(rows, "contacts_caused", caused);
    table_number(rows, "finish_time", sums.finish_time);
    table_number(rows, "reached_time", sums.reached_time);
    table_number(rows, "recorded_within", 10.0);
    table_number(rows, "min_distance", sums.min_distance);
    table_number(rows, "min_distance_worst", sums.min_distance_worst);
    table_number(rows, "fallbacks", sums.fallbacks);
    table_number(rows, "max_abs_acceleration", sums.max_abs_acceleration);
    table_number(rows, "max_abs_jerk", sums.max_abs_jerk);
}

bool recorded(lab* self, table* rows)
{
    static char    paths[scenes_max][512];
    const uint32_t count = list_scenes(self, paths);
    trial*   tasks = must_calloc(self->repeats, sizeof *tasks);
    outcome* results = must_calloc(self->repeats, sizeof *results);
    bool     good = true;
    if (count == 0) {
        fputs("\nNo recorded scenes in the folder of recordings.\n", self->notes);
    }
    for (uint32_t k = 0; good && k < count; ++k) {
        lab_document* document = lab_open(self, paths[k]);
        const char*   text = document != NULL ? lab_text(self, document) : NULL;
        for (uint32_t i = 0; i < self->repeats; ++i) {
            tasks[i] = (trial){ .text = text, .seed = self->seed + i, .record = i == 0,
                                .observe = blame_watch, .notes_size = sizeof(blame_notes) };
        }
        good = text != NULL && lab_run(self, tasks, results, self->repeats);
        if (good) {
            char name[300];
            scene_row(rows, paths[k], results, self->repeats);
            snprintf(name, sizeof name, "recorded-%.200sl", strrchr(paths[k], '/') + 1);
            good = lab_write(self, name, results[0].run, results[0].run_size);
            lab_free_results(results, self->repeats);
        }
    }
    free(results);
    free(tasks);
    return good;
}
