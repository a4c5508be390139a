/// The closed-loop cases of the paper's section 4.2, and the roundabout.
///
/// The paper's vehicles 2, 4 and 5 have the ids 3, 0 and 2 in the authors' files and here.
#include "experiments.h"

#include "common/number.h"

#include "must.h"
#include "summary.h"

#include <math.h>
#include <string.h>

enum { paper_2 = 3, paper_4 = 0, paper_5 = 2, target_lane = 1 };

/// The observations of one run.
typedef struct ramp_notes {
    bool   both_seen;          ///< both have been in the target lane at one tick
    double both_time;          ///< [s] first one
    bool   ahead_2, ahead_2_end; ///< the paper's 2 is ahead of its 4: then, and at the end
    double brake_2, brake_4;   ///< [m/s] how far below its first speed each one went
    // Case 3: the human's acceleration, and when each vehicle plans to be in the target lane.
    double visible;            ///< [s] cycle at which it is seen first; 0: not yet
    double entry[2];           ///< [s] planned by the newest plan, of 2 and 4; INFINITY: not at all
    double entry_before[2];    ///< [s] planned by the last plan that had not seen it
    double gave_up[2];         ///< [s] first cycle whose entry lies at least a step later; 0: none
    double first_speed[2];     ///< [m/s]
    double entered[2];         ///< [s] driven; 0: not yet
} ramp_notes;

/// Case 1 and Case 2: the habits of the vehicles.
typedef struct ramp_case {
    const char* name;
    const char* habit_2;
    const char* habit_4;
} ramp_case;

static const ramp_case cases[] = {
    { "case 1", "aggressive", "conservative" },
    { "case 2", "conservative", "aggressive" },
};
enum { case_count = sizeof cases / sizeof cases[0] };

/// Initial states. The authors' states of Case 1 and Case 2 differ in vehicle 2 only (20 m and
/// 7 m/s, 15 m and 6 m/s). The other states are interpolated between these two. From a share of 0.9
/// on the best plan of each case changes, with a difference so small that a search may miss it.
static const struct { double share; double iterations; } states[] = {
    { 0.0, 3000 }, { 0.25, 3000 }, { 0.5, 3000 }, { 0.75, 3000 }, { 0.9, 3000 }, { 0.9, 20000 },
    { 1.0, 3000 },
};
enum { state_count = sizeof states / sizeof states[0] };

/// Case 3: the human as in the authors' files, or on a track that accelerates from an instant [s].
static const struct { const char* name; const char* file; double start; } humans[] = {
    { "case 3, authors' state", "ramp-case-3.jsonl", -1.0 },
    { "case 3, speeds up at 1 s", "ramp-case-3-speeds-up.jsonl", 1.0 },
    { "case 3, keeps 6 m/s", "ramp-case-3-keeps.jsonl", 1000.0 },
};
enum { human_count = sizeof humans / sizeof humans[0] };

static trial_observer ramp_watch;
static const char* case_text(lab* self, const ramp_case* which, double share, double iterations);
static const char* human_text(lab* self, double start);
static bool run_case(lab* self, const char* text, const char* name, outcome* results);
static void order_row(table* rows, const ramp_case* which, double share, double iterations,
                      const outcome* results, uint32_t count);
static void human_row(table* rows, const char* name, const outcome* results, uint32_t count);

bool ramp_cases(lab* self, table* rows)
{
    outcome* results = must_calloc(self->repeats, sizeof *results);
    bool     good = true;
    for (uint32_t k = 0; good && k < state_count * case_count; ++k) {
        const ramp_case* which = &cases[k % case_count];
        const double     share = states[k / case_count].share;
        const double     iterations = states[k / case_count].iterations;
        char             name[96];
        snprintf(name, sizeof name, "ramp-case-%c-state-%.2f-%.0f.jsonl", which->name[5], share,
                 iterations);
        good = run_case(self, case_text(self, which, share, iterations), name, results);
        if (good) {
            order_row(rows, which, share, iterations, results, self->repeats);
            lab_free_results(results, self->repeats);
        }
    }
    for (uint32_t k = 0; good && k < human_count; ++k) {
        good = run_case(self, human_text(self, humans[k].start), humans[k].file, results);
        if (good) {
            human_row(rows, humans[k].name, results, self->repeats);
            lab_free_results(results, self->repeats);
        }
    }
    free(results);
    return good;
}

static double number_of(lab_document* document, int32_t id, const char* key)
{
    const cJSON* member = cJSON_GetObjectItemCaseSensitive(lab_vehicle(document, id), key);
    return member != NULL ? member->valuedouble : (double)NAN;
}

/// share: 0 the authors' state of Case 1, 1 that of Case 2. The lane is nearly straight between the
/// two positions of vehicle 2.
static const char* case_text(lab* self, const ramp_case* which, double share, double iterations)
{
    static const char* const moved[] = { "x", "y", "heading", "speed" };
    lab_document* document = lab_open(self, "ramp-case1");
    lab_document* other = document != NULL ? lab_open(self, "ramp-case2") : NULL;
    if (other == NULL) {
        cJSON_Delete(document);
        return NULL;
    }
    for (uint32_t k = 0; k < sizeof moved / sizeof moved[0]; ++k) {
        const double from = number_of(document, paper_2, moved[k]);
        const double to = number_of(other, paper_2, moved[k]);
        lab_set(lab_vehicle(document, paper_2), moved[k],
                cJSON_CreateNumber(from + share * (to - from)));
    }
    cJSON_Delete(other);
    char name[64];
    snprintf(name, sizeof name, "ramp, %s, state %.2f", which->name, share);
    lab_set(document, "name", cJSON_CreateString(name));
    lab_set(lab_vehicle(document, paper_2), "habit", cJSON_CreateString(which->habit_2));
    lab_set(lab_vehicle(document, paper_4), "habit", cJSON_CreateString(which->habit_4));
    lab_parameter(document, "iterations", iterations);
    return lab_text(self, document);
}

/// A drive of the human along the target lane: 6 m/s, from `start` on 2 m/s^2 up to 10 m/s.
static cJSON* track_of(const scenario* base, int32_t id, double start)
{
    const verge_road* road = verge_planner_road(base->planner);
    cJSON*            track = must(cJSON_CreateArray());
    for (uint32_t i = 0; i < base->vehicle_count; ++i) {
        const verge_vehicle* v = &base->vehicles[i].start;
        const double s0 = verge_road_project_on(road, target_lane, v->x, v->y).s;
        double       s = s0, speed = 6.0;
        for (uint32_t tick = 0; v->id == id && tick <= 200; ++tick) {
            const double t = tick * WORLD_DT;
            double row[5] = { t, 0.0, 0.0, 0.0, speed };
            verge_road_at(road, target_lane, s, 0.0, &row[1], &row[2], &row[3]);
            cJSON_AddItemToArray(track, must(cJSON_CreateDoubleArray(row, 5)));
            const double next = t >= start ? fmin(speed + 2.0 * WORLD_DT, 10.0) : speed;
            s += 0.5 * (speed + next) * WORLD_DT;
            speed = next;
        }
    }
    return track;
}

/// start: when the human accelerates [s]; negative: it follows its model from 8 m/s, as in the
/// authors' state.
static const char* human_text(lab* self, double start)
{
    scenario      base;
    lab_document* document = lab_open(self, "ramp-case3");
    if (document == NULL || start < 0.0) {
        return document != NULL ? lab_text(self, document) : NULL;
    }
    char*      text = must(value_text(document));
    const bool good = scenario_parse(&base, "ramp-case3", text, strlen(text), NULL);
    free(text);
    if (!good) {
        fputs(base.file.error, stderr);
        cJSON_Delete(document);
        return NULL;
    }
    lab_set(document, "name", cJSON_CreateString(start < 100.0 ? "ramp, case 3, speeds up"
                                                               : "ramp, case 3, keeps its speed"));
    lab_set(lab_vehicle(document, paper_5), "track", track_of(&base, paper_5, start));
    scenario_free(&base);
    return lab_text(self, document);
}

static bool run_case(lab* self, const char* text, const char* name, outcome* results)
{
    trial* tasks = must_calloc(self->repeats, sizeof *tasks);
    for (uint32_t i = 0; i < self->repeats; ++i) {
        tasks[i] = (trial){ .text = text, .seed = self->seed + i, .record = i == 0,
                            .observe = ramp_watch, .notes_size = sizeof(ramp_notes) };
    }
    bool good = text != NULL && lab_run(self, tasks, results, self->repeats);
    if (good && !lab_write(self, name, results[0].run, results[0].run_size)) {
        lab_free_results(results, self->repeats);
        good = false;
    }
    free(tasks);
    return good;
}

// ---------------------------------------------------------------------------- watching

static const world_vehicle* find(const world* world, int32_t id)
{
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        if (world->vehicles[i].state.id == id) {
            return &world->vehicles[i];
        }
    }
    return NULL;
}

/// When the vehicle is in its target lane by the plan [s]; INFINITY: not within the horizon.
static double planned_entry(const verge_plan* plan, double now, int32_t id)
{
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        const verge_vehicle_plan* vehicle = &plan->vehicles[i];
        for (uint32_t k = 0; vehicle->vehicle_id == id && k < vehicle->action_count; ++k) {
            if (vehicle->actions[k].lane_id == target_lane) {
                return now + vehicle->actions[k].t1;
            }
        }
    }
    return INFINITY;
}

/// Case 3: from the cycle in which the human accelerates, the vehicles that delay their lane
/// change.
static void watch_human(const world* world, const verge_plan* plan, ramp_notes* notes)
{
    static const int32_t ids[2] = { paper_2, paper_4 };
    const world_vehicle* human = find(world, paper_5);
    const double         now = world_time(world);
    if (plan == NULL || human->state.controlled) {
        return;
    }
    const bool seen = human->present && human->state.acceleration > 0.5;
    if (notes->visible == 0.0 && seen) {
        notes->visible = now > 0.0 ? now : -1.0; // from the start: there is no before
        memcpy(notes->entry_before, notes->entry, sizeof notes->entry);
    }
    for (uint32_t k = 0; k < 2; ++k) {
        notes->entry[k] = planned_entry(plan, now, ids[k]);
        const double later = notes->entry[k] - notes->entry_before[k];
        const bool waits = notes->gave_up[k] == 0.0 && notes->entered[k] == 0.0;
        if (notes->visible > 0.0 && waits && later >= 1.0) {
            notes->gave_up[k] = now;
        }
    }
}

static void ramp_watch(const world* world, const verge_plan* plan, void* notes_given)
{
    ramp_notes*          notes = notes_given;
    const world_vehicle* both[2] = { find(world, paper_2), find(world, paper_4) };
    double               way[2];
    watch_human(world, plan, notes);
    for (uint32_t k = 0; k < 2; ++k) {
        const verge_vehicle* at = &both[k]->state;
        way[k] = verge_road_project_on(world->road, target_lane, at->x, at->y).s;
        notes->first_speed[k] = world->tick == 0 ? at->speed : notes->first_speed[k];
        double* braked = k == 0 ? &notes->brake_2 : &notes->brake_4;
        *braked = fmax(*braked, notes->first_speed[k] - at->speed);
        if (both[k]->lane == target_lane && notes->entered[k] == 0.0) {
            notes->entered[k] = world_time(world);
        }
    }
    if (both[0]->lane == target_lane && both[1]->lane == target_lane) {
        if (!notes->both_seen) {
            notes->both_seen = true;
            notes->both_time = world_time(world);
            notes->ahead_2 = way[0] > way[1];
        }
        notes->ahead_2_end = way[0] > way[1];
    }
}

// ---------------------------------------------------------------------------- rows

static void order_row(table* rows, const ramp_case* which, double share, double iterations,
                      const outcome* results, uint32_t count)
{
    const summary sums = summary_of(results, count);
    double ahead = 0.0, same = 0.0, both = 0.0, brake_2 = 0.0, brake_4 = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        const ramp_notes* notes = results[i].notes;
        both += notes->both_seen ? 1.0 : 0.0;
        ahead += notes->both_seen && notes->ahead_2 ? 1.0 : 0.0;
        same += notes->both_seen && notes->ahead_2 == notes->ahead_2_end ? 1.0 : 0.0;
        brake_2 += notes->brake_2 / count;
        brake_4 += notes->brake_4 / count;
    }
    table_row(rows);
    table_text(rows, "habits", which->name);
    table_number(rows, "state", share);
    table_number(rows, "iterations", iterations);
    table_text(rows, "habit_2", which->habit_2);
    table_text(rows, "habit_4", which->habit_4);
    table_number(rows, "both_in_lane", both / count);
    table_number(rows, "2_ahead_of_4", both > 0.0 ? ahead / both : (double)NAN);
    table_number(rows, "order_kept", both > 0.0 ? same / both : (double)NAN);
    table_number(rows, "speed_given_up_2", brake_2);
    table_number(rows, "speed_given_up_4", brake_4);
    summary_table_cells(rows, &sums);
}

static void human_row(table* rows, const char* name, const outcome* results, uint32_t count)
{
    const summary sums = summary_of(results, count);
    double gave_up[2] = { 0.0, 0.0 }, latest = 0.0, passed[2] = { 0.0, 0.0 }, visible = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        const ramp_notes* notes = results[i].notes;
        visible += notes->visible > 0.0 ? notes->visible / count : 0.0;
        for (uint32_t k = 0; k < 2; ++k) {
            gave_up[k] += notes->gave_up[k] > 0.0 ? 1.0 : 0.0;
            passed[k] += notes->entered[k] / count;
            if (notes->gave_up[k] > 0.0) {
                latest = fmax(latest, notes->gave_up[k] - notes->visible);
            }
        }
    }
    table_row(rows);
    table_text(rows, "case", name);
    table_number(rows, "visible", visible);
    table_number(rows, "2_puts_off", gave_up[0] / count);
    table_number(rows, "4_puts_off", gave_up[1] / count);
    table_number(rows, "latest_after", latest);
    table_number(rows, "2_in_lane", passed[0]);
    table_number(rows, "4_in_lane", passed[1]);
    summary_table_cells(rows, &sums);
    table_number(rows, "collisions", sums.collisions);
}

// ---------------------------------------------------------------------------- roundabout

/// Longest standstill of a controlled vehicle, in ticks.
typedef struct halt_notes {
    uint32_t now[VERGE_VEHICLES_MAX], longest;
} halt_notes;

static void halt_watch(const world* world, const verge_plan* plan, void* notes_given)
{
    halt_notes* notes = notes_given;
    (void)plan;
    for (uint32_t i = 0; i < world->vehicle_count && i < VERGE_VEHICLES_MAX; ++i) {
        const world_vehicle* at = &world->vehicles[i];
        const bool halts = at->present && at->state.controlled && at->state.speed < 0.1;
        notes->now[i] = halts ? notes->now[i] + 1 : 0;
        notes->longest = notes->now[i] > notes->longest ? notes->now[i] : notes->longest;
    }
}

bool roundabout(lab* self, table* rows)
{
    trial*        tasks = must_calloc(self->repeats, sizeof *tasks);
    outcome*      results = must_calloc(self->repeats, sizeof *results);
    lab_document* document = lab_open(self, "roundabout");
    const char*   text = document != NULL ? lab_text(self, document) : NULL;
    for (uint32_t i = 0; i < self->repeats; ++i) {
        tasks[i] = (trial){ .text = text, .seed = self->seed + i, .record = i == 0,
                            .observe = halt_watch, .notes_size = sizeof(halt_notes) };
    }
    bool good = text != NULL && lab_run(self, tasks, results, self->repeats);
    if (good) {
        const summary sums = summary_of(results, self->repeats);
        double longest = 0.0;
        for (uint32_t i = 0; i < self->repeats; ++i) {
            const halt_notes* notes = results[i].notes;
            longest = fmax(longest, notes->longest * WORLD_DT);
        }
        table_row(rows);
        table_text(rows, "scene", "roundabout");
        summary_table_cells(rows, &sums);
        summary_more_cells(rows, &sums);
        table_number(rows, "longest_halt", longest);
        good = lab_write(self, "roundabout.jsonl", results[0].run, results[0].run_size);
        lab_free_results(results, self->repeats);
    }
    free(results);
    free(tasks);
    return good;
}
