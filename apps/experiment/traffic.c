/// See traffic.h.
#include "traffic.h"

#include "must.h"
#include "base/random.h"

#include <math.h>

enum { lane_count = 4, places_max = 1000 };

static const double lane_width = 4.0;     // [m]
static const double road_length = 1000.0; // [m]
static const double first_s = 50.0;       // [m] where the traffic begins

typedef struct place {
    uint32_t lane;
    double   s;
} place;

static void roads_add(cJSON* document);
static bool place_find(const traffic* self, vg_random* random, place* places, uint32_t index);
static void vehicle_add(cJSON* vehicles, const traffic* self, vg_random* random, place at,
                        uint32_t index);

lab_document* traffic_document(const traffic* self)
{
    vg_random random = vg_random_from(self->seed, 23);
    place     places[VERGE_VEHICLES_MAX];
    cJSON*    document = must(cJSON_CreateObject());
    char      name[64];
    snprintf(name, sizeof name, "traffic-%u-%u-%.0f-%llu", self->controlled, self->humans,
             self->density, (unsigned long long)self->seed);
    must(cJSON_AddStringToObject(document, "format", "verge-scenario/1"));
    must(cJSON_AddStringToObject(document, "name", name));
    must(cJSON_AddStringToObject(document, "source", "random traffic of verge-experiment"));
    roads_add(document);
    cJSON* vehicles = must(cJSON_AddArrayToObject(document, "vehicles"));
    for (uint32_t i = 0; i < self->controlled + self->humans; ++i) {
        // If no place is left, the scene has fewer vehicles. This is rare at 60 vehicles a km.
        if (place_find(self, &random, places, i)) {
            vehicle_add(vehicles, self, &random, places[i], i);
        } else {
            break;
        }
    }
    return document;
}

static void roads_add(cJSON* document)
{
    cJSON* road = must(cJSON_AddObjectToObject(document, "road"));
    cJSON* lanes = must(cJSON_AddArrayToObject(road, "lanes"));
    for (int i = 0; i < lane_count; ++i) {
        cJSON* lane = must(cJSON_CreateObject());
        cJSON* line = must(cJSON_CreateArray());
        const double ends[2] = { 0.0, road_length };
        for (int k = 0; k < 2; ++k) {
            const double point[2] = { ends[k], lane_width * i };
            cJSON_AddItemToArray(line, must(cJSON_CreateDoubleArray(point, 2)));
        }
        lab_set(lane, "id", cJSON_CreateNumber(i));
        lab_set(lane, "centerline", line);
        lab_set(lane, "width", cJSON_CreateNumber(lane_width));
        lab_set(lane, "speed_limit", cJSON_CreateNumber(TRAFFIC_SPEED_LIMIT));
        lab_set(lane, "left", i + 1 < lane_count ? cJSON_CreateNumber(i + 1) : cJSON_CreateNull());
        lab_set(lane, "right", i > 0 ? cJSON_CreateNumber(i - 1) : cJSON_CreateNull());
        cJSON_AddItemToArray(lanes, lane);
    }
}

/// Draws positions until one is free.
static bool place_find(const traffic* self, vg_random* random, place* places, uint32_t index)
{
    const uint32_t count = self->controlled + self->humans;
    const double   stretch = 1000.0 * count / (lane_count * self->density); // [m]
    const uint32_t tenths = (uint32_t)(10.0 * stretch);
    for (uint32_t tries = 0; tries < places_max; ++tries) {
        const place at = { .lane = vg_random_below(random, lane_count),
                           .s = first_s + 0.1 * vg_random_below(random, tenths) };
        bool free_there = true;
        for (uint32_t i = 0; i < index; ++i) {
            free_there = free_there && (places[i].lane != at.lane
                                        || fabs(places[i].s - at.s) >= TRAFFIC_SPACING);
        }
        if (free_there) {
            places[index] = at;
            return true;
        }
    }
    return false;
}

static void vehicle_add(cJSON* vehicles, const traffic* self, vg_random* random, place at,
                        uint32_t index)
{
    cJSON* vehicle = must(cJSON_CreateObject());
    const double range = 10.0 * (self->speed_max - self->speed_min);
    const double speed = self->speed_min + 0.1 * vg_random_below(random, (uint32_t)range + 1);
    const bool   controlled = index < self->controlled;
    lab_set(vehicle, "id", cJSON_CreateNumber(index));
    lab_set(vehicle, "control", cJSON_CreateString(controlled ? "controlled" : "human"));
    lab_set(vehicle, "x", cJSON_CreateNumber(at.s));
    lab_set(vehicle, "y", cJSON_CreateNumber(lane_width * at.lane));
    lab_set(vehicle, "heading", cJSON_CreateNumber(0.0));
    lab_set(vehicle, "speed", cJSON_CreateNumber(speed));
    lab_set(vehicle, "acceleration", cJSON_CreateNumber(0.0));
    lab_set(vehicle, "length", cJSON_CreateNumber(5.0));
    lab_set(vehicle, "width", cJSON_CreateNumber(2.0));
    if (controlled) {
        const bool chance = vg_random_below(random, 2) == 0;
        const bool left = at.lane == 0 || (at.lane + 1 < lane_count && chance);
        lab_set(vehicle, "target_lane",
                cJSON_CreateNumber(left ? (double)at.lane + 1.0 : (double)at.lane - 1.0));
    }
    cJSON_AddItemToArray(vehicles, vehicle);
}
