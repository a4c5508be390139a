/// See scenario.h.
#include "scenario.h"

#include "body_json.h"
#include "number.h"
#include "planner_json.h"
#include "road_json.h"
#include "vehicle_fault.h"

#include "verge/limits.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool scenario_build(scenario* scene, const uint64_t* seed);
static void simulation_from_json(const json_at* root, scenario* scene);
static bool vehicles_from_json(const json_at* at, scenario* scene);
static void vehicle_from_json(const json_at* at, scenario* scene, scenario_vehicle* vehicle);
static bool human_flag(const json_at* at, const char* key, bool otherwise,
                       const scenario_vehicle* vehicle);
static void parked_from_json(const json_at* at, scenario_vehicle* vehicle);
static void track_from_json(const json_at* at, scenario_vehicle* vehicle);
static void row_from_json(const json_at* at, scenario_row* row);
static bool planner_build(const json_at* root, scenario* scene);
static bool vehicles_check(const json_at* at, const scenario* scene);
static bool vehicle_check(const json_at* at, const scenario* scene, uint32_t index);
static double wrap_angle(double angle);

static const double PI = 3.14159265358979323846;
/// Instants closer than this are the same. [s]
static const double INSTANT = 1e-6;
/// A larger acceleration between two recorded speeds is measurement noise. [m/s^2]
static const double RECORDED_ACCELERATION_MAX = 15.0;

bool scenario_load(scenario* scene, const char* path, const uint64_t* seed)
{
    *scene = (scenario){ 0 };
    return json_file_load(&scene->file, path) && scenario_build(scene, seed);
}

bool scenario_parse(scenario* scene, const char* name, const char* text, size_t size,
                    const uint64_t* seed)
{
    *scene = (scenario){ 0 };
    return json_file_parse(&scene->file, name, text, size) && scenario_build(scene, seed);
}

void scenario_free(scenario* scene)
{
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        free(scene->vehicles[i].track);
    }
    free(scene->vehicles);
    free(scene->signals);
    free(scene->arena);
    road_json_free(&scene->def.road);
    json_file_free(&scene->file);
    *scene = (scenario){ .file = scene->file };
}

bool scenario_track_at(const scenario_vehicle* vehicle, double t, verge_vehicle* state)
{
    const uint32_t count = vehicle->track_count;
    if (count == 0 || t < vehicle->track[0].t - INSTANT ||
        t > vehicle->track[count - 1].t + INSTANT) {
        return false;
    }
    uint32_t after = count > 1 ? 1 : 0;
    while (after + 1 < count && vehicle->track[after].t <= t) {
        ++after;
    }
    const scenario_row* to = &vehicle->track[after];
    const scenario_row* from = &vehicle->track[after > 0 ? after - 1 : 0];
    const double        step = to->t - from->t;
    const double        share = step > 0.0 ? fmin(fmax((t - from->t) / step, 0.0), 1.0) : 0.0;
    const double        turn = wrap_angle(to->heading - from->heading);
    *state = vehicle->start;
    state->x = from->x + share * (to->x - from->x);
    state->y = from->y + share * (to->y - from->y);
    state->heading = wrap_angle(from->heading + share * turn);
    state->speed = from->speed + share * (to->speed - from->speed);
    if (step > 0.0) {
        state->acceleration = fmin(fmax((to->speed - from->speed) / step,
                                        -RECORDED_ACCELERATION_MAX), RECORDED_ACCELERATION_MAX);
        // A faster change of heading is a step between two rows, not a turn.
        if (fabs(turn) <= VERGE_LIMIT_YAW_RATE * step) {
            state->yaw_rate = turn / step;
        }
    }
    return true;
}

void scenario_write(FILE* out, const scenario* scene)
{
    fputc('{', out);
    for (const cJSON* node = scene->file.document->child; node != NULL; node = node->next) {
        if (strcmp(node->string, "planner") != 0 && strcmp(node->string, "simulation") != 0) {
            string_write(out, node->string);
            fputc(':', out);
            value_write(out, node);
            fputc(',', out);
        }
    }
    fputs("\"planner\":", out);
    planner_def_write(out, &scene->def);
    fputs(",\"simulation\":{\"duration\":", out);
    number_write(out, scene->duration);
    fputs(",\"replan\":", out);
    number_write(out, scene->replan);
    fputs("}}", out);
}

/// Builds the scenario from the parsed document. After a failure only the error line remains.
static bool scenario_build(scenario* scene, const uint64_t* seed)
{
    static const char* const keys[] = { "format", "name", "source", "road", "signals", "vehicles",
                                        "planner", "simulation", NULL };
    static const char* const formats[] = { "verge-scenario/1", NULL };
    const json_at root = json_root(&scene->file);
    const json_at road = json_member(&root, "road");
    const json_at planner = json_member(&root, "planner");
    const json_at signals = json_member(&root, "signals");
    const json_at vehicles = json_member(&root, "vehicles");

    scene->def = verge_planner_default_def();
    bool good = json_expect_object(&root, keys);
    if (good) {
        json_choice(&root, "format", formats);
        json_string_or(&root, "source", "");
        scene->name = json_string(&root, "name");
        good = scene->file.error[0] == '\0';
    }
    good = good && planner_def_from_json(&planner, &scene->def);
    if (good && seed != NULL) {
        scene->def.seed = *seed;
    }
    simulation_from_json(&root, scene);
    good = good && road_from_json(&road, &scene->def.road);
    good = good && signals_from_json(&signals, &scene->def.road, &scene->signals,
                                     &scene->signal_count);
    good = good && vehicles_from_json(&vehicles, scene);
    good = good && planner_build(&root, scene);
    good = good && vehicles_check(&vehicles, scene) && scene->file.error[0] == '\0';
    if (!good) {
        scenario_free(scene);
    }
    return good;
}

static void simulation_from_json(const json_at* root, scenario* scene)
{
    static const char* const keys[] = { "duration", "replan", NULL };
    const json_at at = json_member(root, "simulation");
    scene->duration = 20.0;
    scene->replan = 0.5;
    if (at.node == NULL || !json_expect_object(&at, keys)) {
        return;
    }
    scene->duration = json_double_or(&at, "duration", 0.1, 3600.0, scene->duration);
    scene->replan = json_double_or(&at, "replan", 0.1, 5.0, scene->replan);
    if (fabs(scene->duration * 10.0 - round(scene->duration * 10.0)) > INSTANT) {
        const json_at duration = json_member(&at, "duration");
        json_fail(&duration, "is %g s, expected a multiple of 0.1 s", scene->duration);
    }
    if (fabs(scene->replan * 10.0 - round(scene->replan * 10.0)) > INSTANT) {
        const json_at replan = json_member(&at, "replan");
        json_fail(&replan, "is %g s, expected a multiple of 0.1 s", scene->replan);
    }
}

static bool vehicles_from_json(const json_at* at, scenario* scene)
{
    const uint32_t count = json_expect_array(at, 0, scene->def.vehicles_max);
    if (at->file->error[0] != '\0') {
        return false;
    }
    scene->vehicles = calloc(count + 1, sizeof *scene->vehicles); // one more: never zero bytes
    if (scene->vehicles == NULL) {
        return json_fail(at, "out of memory");
    }
    scene->vehicle_count = count;
    uint32_t index = 0, controlled = 0, trailers = 0;
    for (const cJSON* node = at->node->child; node != NULL; node = node->next, ++index) {
        const json_at vehicle = json_element(at, node, index);
        vehicle_from_json(&vehicle, scene, &scene->vehicles[index]);
        controlled += scene->vehicles[index].start.controlled;
        trailers += scene->vehicles[index].start.body.trailer_length > 0.0;
        if (count + trailers > scene->def.vehicles_max) {
            json_fail(&vehicle, "has trailer number %u, expected at most %u vehicles and trailers"
                      " (planner.vehicles_max)", trailers, scene->def.vehicles_max);
        }
        if (controlled > scene->def.controlled_max) {
            json_fail(&vehicle, "is controlled vehicle number %u, expected at most %u"
                      " (planner.controlled_max)", controlled, scene->def.controlled_max);
        }
        if (at->file->error[0] != '\0') {
            return false;
        }
    }
    return true;
}

/// A member in the range that every vehicle has to keep.
static double quantity_from_json(const json_at* at, const char* name)
{
    const verge_vehicle_limit* limit = verge_vehicle_limit_of(name);
    return json_double(at, name, limit->min, limit->max);
}

static void vehicle_from_json(const json_at* at, scenario* scene, scenario_vehicle* vehicle)
{
    static const char* const keys[] = { "id", "control", "x", "y", "heading", "speed",
                                        "acceleration", "length", "width", "body", "target_lane",
                                        "habit", "track", "yields", "parked", NULL };
    static const char* const controls[] = { "human", "controlled", NULL };
    if (!json_expect_object(at, keys)) {
        return;
    }
    verge_vehicle* start = &vehicle->start;
    *start = verge_vehicle_default();
    start->id = (int32_t)json_integer(at, "id", 0, INT32_MAX);
    start->controlled = json_choice(at, "control", controls) == 1;
    start->x = quantity_from_json(at, "x");
    start->y = quantity_from_json(at, "y");
    start->heading = wrap_angle(quantity_from_json(at, "heading"));
    start->speed = quantity_from_json(at, "speed");
    start->acceleration = quantity_from_json(at, "acceleration");
    body_from_json(at, start);

    const json_at target = json_member(at, "target_lane");
    if (!json_none(&target)) {
        start->target_lane = (int32_t)json_as_integer(&target, 0, INT32_MAX);
        if (at->file->error[0] == '\0' && !road_has_lane(&scene->def.road, start->target_lane)) {
            json_fail(&target, "is lane %d, which the road does not have, expected a lane id",
                      start->target_lane);
        }
    }
    const json_at habit = json_member(at, "habit");
    habit_from_json(&habit, &start->habit);
    const json_at track = json_member(at, "track");
    if (json_given(&track) && start->controlled) {
        json_fail(&track, "is given for a controlled vehicle, expected on human vehicles only");
    } else if (json_given(&track)) {
        track_from_json(&track, vehicle);
    }
    vehicle->lawless = !human_flag(at, "yields", true, vehicle);
    parked_from_json(at, vehicle);
}

/// A flag of humans without a track, whose `control` and `track` have been read.
static bool human_flag(const json_at* at, const char* key, bool otherwise,
                       const scenario_vehicle* vehicle)
{
    const json_at flag = json_member(at, key);
    const bool    value = json_bool_or(at, key, otherwise);
    if (json_given(&flag) && (vehicle->start.controlled || vehicle->track_count > 0)) {
        json_fail(&flag, "is given for a vehicle that is controlled or follows a track, expected"
                         " on humans without a track only");
    }
    return value;
}

static void parked_from_json(const json_at* at, scenario_vehicle* vehicle)
{
    const json_at        parked = json_member(at, "parked");
    const verge_vehicle* start = &vehicle->start;
    vehicle->parked = human_flag(at, "parked", false, vehicle);
    if (vehicle->parked && (start->speed != 0.0 || start->acceleration != 0.0)) {
        json_fail(&parked, "is given for a vehicle at %g m/s and %g m/s^2, expected 0 and 0",
                  start->speed, start->acceleration);
    }
}

static void track_from_json(const json_at* at, scenario_vehicle* vehicle)
{
    const uint32_t count = json_expect_array(at, 1, 1000000);
    if (at->file->error[0] != '\0') {
        return;
    }
    vehicle->track = calloc(count, sizeof *vehicle->track);
    if (vehicle->track == NULL) {
        json_fail(at, "out of memory");
        return;
    }
    vehicle->track_count = count;
    const cJSON* node = at->node->child;
    for (uint32_t i = 0; i < count; i++, node = node->next) {
        const json_at row = json_element(at, node, i);
        row_from_json(&row, &vehicle->track[i]);
        if (i > 0 && at->file->error[0] == '\0' &&
            !(vehicle->track[i].t > vehicle->track[i - 1].t)) {
            json_fail(&row, "is at %g s after a row at %g s, expected growing instants",
                      vehicle->track[i].t, vehicle->track[i - 1].t);
        }
        if (at->file->error[0] != '\0') {
            return;
        }
    }
    verge_vehicle first;
    if (scenario_track_at(vehicle, fmax(vehicle->track[0].t, 0.0), &first)) {
        vehicle->start = first;
    }
}

static void row_from_json(const json_at* at, scenario_row* row)
{
    json_expect_array(at, 5, 5);
    if (at->file->error[0] != '\0') {
        return;
    }
    const double limits[5] = { 1e6, VERGE_LIMIT_POSITION, VERGE_LIMIT_POSITION, VERGE_LIMIT_HEADING,
                               VERGE_LIMIT_SPEED };
    double       values[5];
    const cJSON* node = at->node->child;
    for (uint32_t i = 0; i < 5; i++, node = node->next) {
        const json_at value = json_element(at, node, i);
        values[i] = json_as_double(&value, i == 4 ? VERGE_LIMIT_SPEED_MIN : -limits[i], limits[i]);
    }
    *row = (scenario_row){ .t = values[0], .x = values[1], .y = values[2],
                           .heading = wrap_angle(values[3]), .speed = values[4] };
}

static bool planner_build(const json_at* root, scenario* scene)
{
    const json_at planner = json_member(root, "planner");
    const size_t  size = verge_planner_memory_size(&scene->def);
    if (size == 0) {
        return json_fail(&planner, "parameters and road do not fit, expected a planner that can be"
                                   " built");
    }
    const size_t humans_size = verge_humans_memory_size(&scene->def);
    scene->arena_size = (size + 63) / 64 * 64;
    scene->arena = aligned_alloc(64, scene->arena_size + (humans_size + 63) / 64 * 64);
    if (scene->arena == NULL) {
        return json_fail(&planner, "needs %zu bytes, more than there is", scene->arena_size);
    }
    verge_status status =
        verge_planner_init(&scene->planner, &scene->def, scene->arena, scene->arena_size);
    if (status == VERGE_OK) {
        status = verge_humans_init(&scene->humans, &scene->def,
                                   (char*)scene->arena + scene->arena_size,
                                   humans_size);
    }
    return status == VERGE_OK || json_fail(&planner, "%s", verge_status_text(status));
}

static bool vehicles_check(const json_at* at, const scenario* scene)
{
    const cJSON* node = at->node->child;
    for (uint32_t i = 0; i < scene->vehicle_count; i++, node = node->next) {
        const json_at vehicle = json_element(at, node, i);
        if (!vehicle_check(&vehicle, scene, i)) {
            return false;
        }
    }
    return true;
}

/// Checks a vehicle against the road and against the vehicles before it.
static bool vehicle_check(const json_at* at, const scenario* scene, uint32_t index)
{
    const scenario_vehicle* vehicle = &scene->vehicles[index];
    const verge_vehicle*    start = &vehicle->start;
    verge_vehicle_fault     fault;
    const verge_status      status =
        verge_road_check_vehicle(verge_planner_road(scene->planner), start, &fault);
    if (status == VERGE_ERR_OFF_ROAD) {
        return json_fail(at, "vehicle %d is off every lane, expected its centre on a lane",
                         start->id);
    }
    if (status != VERGE_OK) {
        char words[VEHICLE_FAULT_SIZE];
        vehicle_fault_text(&fault, words);
        return json_fail(at, "vehicle %d is refused: %s", start->id, words);
    }
    for (uint32_t i = 0; i < index; ++i) {
        const scenario_vehicle* other = &scene->vehicles[i];
        if (other->start.id == start->id) {
            return json_fail(at, "has the id %d of another vehicle, expected its own", start->id);
        }
        const bool both_at_start =
            (vehicle->track_count == 0 || vehicle->track[0].t <= INSTANT) &&
            (other->track_count == 0 || other->track[0].t <= INSTANT);
        if (both_at_start && verge_vehicles_overlap(start, &other->start)) {
            return json_fail(at, "vehicle %d overlaps vehicle %d at the start, expected free space"
                             " between them", start->id, other->start.id);
        }
    }
    return true;
}

/// Maps to (-pi, pi]. An angle inside is returned unchanged.
static double wrap_angle(double angle)
{
    const double turn = remainder(angle, 2.0 * PI);
    return turn <= -PI ? PI : turn;
}
