/// See road_json.h.
#include "road_json.h"

#include "verge/limits.h"

#include <stdlib.h>

static bool lane_from_json(const json_at* at, verge_lane_def* lane);
static bool centerline_from_json(const json_at* at, verge_lane_def* lane);
static void stretches_from_json(const json_at* lane, const char* key, bool* given,
                                verge_stretch* stretches, uint32_t* count);
static void priority_from_json(const json_at* at, verge_lane_def* lane);
static int32_t lane_id_from_json(const json_at* lane, const char* key);
static void report_fault(const json_at* lanes, const verge_road_fault* fault);

bool road_from_json(const json_at* at, verge_road_def* def)
{
    static const char* const keys[] = { "lanes", NULL };
    *def = (verge_road_def){ 0 };
    if (!json_expect_object(at, keys)) {
        return false;
    }
    const json_at  lanes = json_member(at, "lanes");
    const uint32_t count = json_expect_array(&lanes, 1, VERGE_LANES_MAX);
    if (at->file->error[0] != '\0') {
        return false;
    }
    verge_lane_def* all = calloc(count, sizeof *all);
    if (all == NULL) {
        return json_fail(&lanes, "out of memory");
    }
    *def = (verge_road_def){ .lanes = all, .lane_count = count };
    uint32_t index = 0;
    for (const cJSON* node = lanes.node->child; node != NULL; node = node->next, ++index) {
        const json_at lane = json_element(&lanes, node, index);
        if (!lane_from_json(&lane, &all[index])) {
            return false;
        }
    }
    verge_road_fault fault = { 0 };
    if (verge_road_check(def, &fault) != VERGE_OK) {
        report_fault(&lanes, &fault);
        return false;
    }
    return true;
}

void road_json_free(verge_road_def* def)
{
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        free((void*)(uintptr_t)def->lanes[i].points);
    }
    free((void*)(uintptr_t)def->lanes);
    *def = (verge_road_def){ 0 };
}

bool road_has_lane(const verge_road_def* def, int32_t lane_id)
{
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        if (def->lanes[i].id == lane_id) {
            return true;
        }
    }
    return false;
}

static bool lane_from_json(const json_at* at, verge_lane_def* lane)
{
    static const char* const keys[] = { "id", "centerline", "width", "speed_limit", "left", "right",
                                        "successors", "change_left", "change_right", "priority",
                                        "stop_line", NULL };
    if (!json_expect_object(at, keys)) {
        return false;
    }
    lane->id = (int32_t)json_integer(at, "id", 0, INT32_MAX);
    lane->width = json_double(at, "width", 1.5, 20.0);
    lane->speed_limit = json_double(at, "speed_limit", 0.5, 60.0);
    lane->left = lane_id_from_json(at, "left");
    lane->right = lane_id_from_json(at, "right");

    const json_at successors = json_member(at, "successors");
    if (json_given(&successors)) {
        lane->successor_count = json_expect_array(&successors, 0, VERGE_SUCCESSORS_MAX);
        const cJSON* node = lane->successor_count > 0 ? successors.node->child : NULL;
        for (uint32_t i = 0; i < lane->successor_count; i++, node = node->next) {
            const json_at successor = json_element(&successors, node, i);
            lane->successors[i] = (int32_t)json_as_integer(&successor, 0, INT32_MAX);
        }
    }
    stretches_from_json(at, "change_left", &lane->change_left_given, lane->change_left,
                        &lane->change_left_count);
    stretches_from_json(at, "change_right", &lane->change_right_given, lane->change_right,
                        &lane->change_right_count);
    priority_from_json(at, lane);
    const json_at centerline = json_member(at, "centerline");
    return centerline_from_json(&centerline, lane) && at->file->error[0] == '\0';
}

static bool centerline_from_json(const json_at* at, verge_lane_def* lane)
{
    const uint32_t count = json_expect_array(at, 2, VERGE_LANE_POINTS_MAX);
    if (at->file->error[0] != '\0') {
        return false;
    }
    double(*points)[2] = calloc(count, sizeof *points);
    if (points == NULL) {
        return json_fail(at, "out of memory");
    }
    lane->points = (const double(*)[2])points;
    lane->point_count = count;
    const cJSON* node = at->node->child;
    for (uint32_t i = 0; i < count; i++, node = node->next) {
        const json_at point = json_element(at, node, i);
        json_expect_array(&point, 2, 2);
        if (at->file->error[0] != '\0') {
            return false;
        }
        const json_at x = json_element(&point, node->child, 0);
        const json_at y = json_element(&point, node->child->next, 1);
        points[i][0] = json_as_double(&x, -VERGE_LIMIT_POSITION, VERGE_LIMIT_POSITION);
        points[i][1] = json_as_double(&y, -VERGE_LIMIT_POSITION, VERGE_LIMIT_POSITION);
    }
    return at->file->error[0] == '\0';
}

static void priority_from_json(const json_at* at, verge_lane_def* lane)
{
    const char* names[VERGE_PRIORITY_COUNT + 1] = { NULL };
    for (uint32_t i = 0; i < VERGE_PRIORITY_COUNT; ++i) {
        names[i] = verge_priority_name((verge_priority)i);
    }
    const json_at priority = json_member(at, "priority");
    if (json_given(&priority)) {
        lane->priority = (verge_priority)json_choice(at, "priority", names);
    }
    const json_at stop_line = json_member(at, "stop_line");
    lane->stop_line_given = !json_none(&stop_line);
    if (lane->stop_line_given) {
        lane->stop_line = json_as_double(&stop_line, 0.0, VERGE_LANE_LENGTH_MAX);
    }
}

static void stretches_from_json(const json_at* lane, const char* key, bool* given,
                                verge_stretch* stretches, uint32_t* count)
{
    const json_at at = json_member(lane, key);
    if (!json_given(&at)) {
        return;
    }
    *given = true;
    *count = json_expect_array(&at, 0, VERGE_STRETCHES_MAX);
    const cJSON* node = *count > 0 ? at.node->child : NULL;
    for (uint32_t i = 0; i < *count; i++, node = node->next) {
        const json_at stretch = json_element(&at, node, i);
        json_expect_array(&stretch, 2, 2);
        if (at.file->error[0] != '\0') {
            return;
        }
        const json_at from = json_element(&stretch, node->child, 0);
        const json_at to = json_element(&stretch, node->child->next, 1);
        stretches[i].s0 = json_as_double(&from, 0.0, VERGE_LANE_LENGTH_MAX);
        stretches[i].s1 = json_as_double(&to, 0.0, VERGE_LANE_LENGTH_MAX);
    }
}

static int32_t lane_id_from_json(const json_at* lane, const char* key)
{
    const json_at at = json_member(lane, key);
    return json_none(&at) ? VERGE_NO_LANE : (int32_t)json_as_integer(&at, 0, INT32_MAX);
}

/// The core's fault, at the place of the file it came from.
static void report_fault(const json_at* lanes, const verge_road_fault* fault)
{
    const char*  text = fault->text != NULL ? fault->text : "cannot be built";
    const cJSON* node = lanes->node->child;
    for (uint32_t i = 0; i < fault->lane_index && node != NULL; ++i) {
        node = node->next;
    }
    const json_at lane = json_element(lanes, node, fault->lane_index);
    if (fault->field == NULL) {
        json_fail(&lane, "%s", text);
        return;
    }
    const json_at field = json_member(&lane, fault->field);
    json_fail(&field, "%s", text);
}
