/// The vehicles on the road: checked, ordered by id, each with the lane it drives along.
#include "verge/scene.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "geometry/trailer.h"
#include "road/road.h"
#include "traffic/flow.h"
#include "traffic/signals.h"

// Error of a measured speed at standstill. [m/s]
static const double speed_noise = 0.2;
// A lane runs in the direction of a vehicle up to this angle, 60 degrees; what other lanes fit
// worse. [1], [m]
static const double same_direction = 0.5;
static const double other_direction = 1e3;
// Lanes whose misfit differs by less fit as well. [m]
static const double tie = 0.5;
// Between the lanes of a junction a vehicle is at most this far from the centre of its own. [m]
static const double junction_reach = 6.0;

static bool vehicle_holds(const verge_road* road, const verge_vehicle* v,
                          verge_vehicle_fault* fault);
static bool arrays_hold(const verge_scene* scene);
static verge_status accept(verge_scene* scene, const verge_vehicle* vehicles, uint32_t count);
static verge_lane_position locate(const verge_road* road, const verge_vehicle* v,
                                  int32_t lane_before);

verge_status verge_scene_place(verge_scene* scene, int64_t utime, const verge_vehicle* vehicles,
                               uint32_t vehicle_count, const verge_scene* before)
{
    if (scene == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    scene->vehicle_count = 0;
    if (scene == before || !arrays_hold(scene) || (vehicles == NULL && vehicle_count > 0)
        || (before != NULL && !arrays_hold(before))) {
        return VERGE_ERR_ARGUMENT;
    }
    const verge_status status = accept(scene, vehicles, vehicle_count);
    if (status != VERGE_OK) {
        return status;
    }
    for (uint32_t i = 0; i < vehicle_count; ++i) {
        const verge_vehicle* v = &scene->vehicles[i];
        const int32_t k = before != NULL ? verge_scene_find(before, v->id) : -1;
        scene->positions[i] =
            locate(scene->road, v, k < 0 ? VERGE_NO_LANE : before->positions[k].lane_id);
    }
    scene->utime = utime;
    scene->vehicle_count = vehicle_count;
    return VERGE_OK;
}

static bool arrays_hold(const verge_scene* scene)
{
    return scene->road != NULL && scene->vehicle_count <= scene->vehicles_max
           && (scene->vehicles_max == 0 || (scene->vehicles != NULL && scene->positions != NULL))
           && vg_signals_hold(scene->road, scene->signals, scene->signal_count);
}

static bool position_holds(const verge_road* road, const verge_lane_position* at)
{
    return at->lane_id == VERGE_NO_LANE
           || (vg_road_lane_index(road, at->lane_id) >= 0 && vg_abs(at->s) <= 1e7
               && vg_abs(at->d) <= 1e7 && vg_finite(at->heading));
}

bool vg_scene_holds(const verge_scene* scene)
{
    if (scene == NULL || !arrays_hold(scene)) {
        return false;
    }
    bool holds = true;
    for (uint32_t i = 0; i < scene->vehicle_count && holds; ++i) {
        const verge_vehicle* v = &scene->vehicles[i];
        holds = (i == 0 || v[-1].id < v->id) && vehicle_holds(scene->road, v, NULL)
                && position_holds(scene->road, &scene->positions[i]);
    }
    return holds;
}

bool vg_scene_moves_along(const verge_scene* scene, uint32_t i)
{
    VERGE_ASSERT(i < scene->vehicle_count);
    const verge_vehicle* v = &scene->vehicles[i];
    const verge_lane_position* at = &scene->positions[i];
    return at->lane_id != VERGE_NO_LANE && v->speed >= 0.0
           && vg_cos(vg_wrap_angle(v->heading - at->heading)) > 0.0;
}

int32_t verge_scene_find(const verge_scene* scene, int32_t vehicle_id)
{
    if (scene == NULL || scene->vehicles == NULL) {
        return -1;
    }
    uint32_t low = 0, high = scene->vehicle_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        if (scene->vehicles[middle].id < vehicle_id) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < scene->vehicle_count && scene->vehicles[low].id == vehicle_id ? (int32_t)low : -1;
}

verge_status verge_road_check_vehicle(const verge_road* road, const verge_vehicle* vehicle,
                                      verge_vehicle_fault* fault)
{
    if (road == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    if (!vehicle_holds(road, vehicle, fault)) {
        return VERGE_ERR_VEHICLE;
    }
    const verge_lane_position at = verge_road_project(
        road, vehicle->x, vehicle->y, vg_wrap_angle(vehicle->heading), VERGE_NO_LANE);
    return at.lane_id == VERGE_NO_LANE ? VERGE_ERR_OFF_ROAD : VERGE_OK;
}

static bool id_is_taken(const verge_vehicle* vehicles, uint32_t index)
{
    uint32_t other = 0;
    while (vehicles[other].id != vehicles[index].id) {
        ++other;
    }
    return other < index;
}

verge_status verge_vehicles_check(const verge_road* road, const verge_vehicle* vehicles,
                                  uint32_t vehicle_count, verge_vehicle_fault* fault)
{
    verge_vehicle_fault found = { .field = NULL };
    verge_status status = VERGE_OK;
    if (road == NULL || (vehicles == NULL && vehicle_count > 0)) {
        return VERGE_ERR_ARGUMENT;
    }
    for (uint32_t i = 0; i < vehicle_count && status == VERGE_OK; ++i) {
        if (!vehicle_holds(road, &vehicles[i], &found)) {
            status = VERGE_ERR_VEHICLE;
        } else if (id_is_taken(vehicles, i)) {
            status = VERGE_ERR_DUPLICATE;
            found = (verge_vehicle_fault){
                .vehicle_id = vehicles[i].id, .field = "id", .unit = "1",
                .value = (double)vehicles[i].id, .max = (double)INT32_MAX,
                .expected = "an id that no other vehicle has",
            };
        }
        found.vehicle_index = i;
    }
    if (fault != NULL) {
        *fault = status == VERGE_OK ? (verge_vehicle_fault){ .field = NULL } : found;
    }
    return status;
}

static bool vehicle_holds(const verge_road* road, const verge_vehicle* v,
                          verge_vehicle_fault* fault)
{
    if (!verge_vehicle_check(v, fault)) {
        return false;
    }
    const bool known =
        v->target_lane == VERGE_NO_LANE || vg_road_lane_index(road, v->target_lane) >= 0;
    if (!known && fault != NULL) {
        *fault = (verge_vehicle_fault){ .vehicle_id = v->id, .field = "target_lane", .unit = "1",
                                        .value = (double)v->target_lane, .max = (double)INT32_MAX,
                                        .expected = "the id of a lane of the road, or none" };
    }
    return known;
}

// Headings within a turn. A controlled vehicle that stands may be measured as rolling backwards.
static void normalise(verge_vehicle* v)
{
    v->heading = vg_wrap_angle(v->heading);
    if (vg_finite(v->trailer_heading)) {
        v->trailer_heading = vg_wrap_angle(v->trailer_heading);
    }
    if (v->controlled && v->speed < 0.0 && v->speed >= -speed_noise) {
        v->speed = 0.0;
    }
}

// Copies the vehicles in the order of their ids. Insertion sort: they are few and often sorted.
static verge_status accept(verge_scene* scene, const verge_vehicle* vehicles, uint32_t count)
{
    verge_vehicle* sorted = scene->vehicles;
    if (count > scene->vehicles_max) {
        return VERGE_ERR_CAPACITY;
    }
    for (uint32_t i = 0; i < count; ++i) {
        if (!vehicle_holds(scene->road, &vehicles[i], NULL)) {
            return VERGE_ERR_VEHICLE;
        }
        uint32_t at = i;
        for (; at > 0 && sorted[at - 1u].id > vehicles[i].id; --at) {
            sorted[at] = sorted[at - 1u];
        }
        sorted[at] = vehicles[i];
        normalise(&sorted[at]);
        if (at > 0 && sorted[at - 1u].id == vehicles[i].id) {
            return VERGE_ERR_DUPLICATE;
        }
    }
    return VERGE_OK;
}

// Position on the lane that the vehicle had before, else on the lane that continues it.
static verge_lane_position locate_from(const verge_road* road, const verge_vehicle* v,
                                       int32_t lane_before)
{
    const verge_lane_position at = verge_road_project(road, v->x, v->y, v->heading, lane_before);
    if (lane_before == VERGE_NO_LANE || at.lane_id == lane_before) {
        return at;
    }
    const int32_t next =
        verge_road_next(road, lane_before, v->controlled ? v->target_lane : VERGE_NO_LANE);
    return next == VERGE_NO_LANE ? at : verge_road_project(road, v->x, v->y, v->heading, next);
}

// How badly a vehicle fits on a lane that contains it: its distance from the centre, and an angle
// that counts as metres. Lanes in another direction fit only where no other lane does. [m]
static double misfit(const verge_vehicle* v, const verge_lane_position* at)
{
    const double cosine = vg_cos(vg_wrap_angle(v->heading - at->heading));
    return vg_abs(at->d) + 4.0 * (1.0 - cosine) + (cosine < same_direction ? other_direction : 0.0);
}

// The lane that fits best among those that contain the vehicle; none: `found`.
static verge_lane_position best_fit(const verge_road* road, const verge_vehicle* v,
                                    verge_lane_position found)
{
    double least = found.contained ? misfit(v, &found) : VG_HUGE;
    vg_nearby nearby = vg_road_nearby(road, v->x, v->y);
    while (vg_nearby_next(&nearby) >= 0) {
        const verge_lane_position at = vg_nearby_position(&nearby, v->heading);
        const double here = at.contained ? misfit(v, &at) : VG_HUGE;
        if (here < least) {
            found = at;
            least = here;
        }
    }
    return found;
}

// A lane that fits as well as `at`, and from which the target is reached with the fewest changes.
static verge_lane_position towards_target(const verge_road* road, const verge_vehicle* v,
                                          verge_lane_position at)
{
    const int32_t lane = vg_road_lane_index(road, at.lane_id);
    const int32_t target = v->controlled ? vg_road_lane_index(road, v->target_lane) : -1;
    if (target < 0 || vg_road_changes(road, (uint32_t)lane, (uint32_t)target) != VG_NEVER) {
        return at;
    }
    const double most = misfit(v, &at) + tie;
    uint32_t fewest = VG_NEVER;
    vg_nearby nearby = vg_road_nearby(road, v->x, v->y);
    for (int32_t i = vg_nearby_next(&nearby); i >= 0; i = vg_nearby_next(&nearby)) {
        const uint32_t changes = vg_road_changes(road, (uint32_t)i, (uint32_t)target);
        const verge_lane_position other = vg_nearby_position(&nearby, v->heading);
        if (changes < fewest && other.contained && misfit(v, &other) <= most) {
            at = other;
            fewest = changes;
        }
    }
    return at;
}

// Between the lanes of a junction a vehicle is on the lane it had, or on the one that continues it.
static verge_lane_position keep_route(const verge_road* road, const verge_vehicle* v,
                                      int32_t lane_before)
{
    const int32_t next =
        verge_road_next(road, lane_before, v->controlled ? v->target_lane : VERGE_NO_LANE);
    const int32_t lanes[] = { lane_before, next };
    for (uint32_t i = 0; i < 2; ++i) {
        const int32_t lane = vg_road_lane_index(road, lanes[i]);
        if (lane >= 0 && vg_road_has_conflicts(road, (uint32_t)lane)) {
            const verge_lane_position at = verge_road_project_on(road, lanes[i], v->x, v->y);
            if (at.s >= 0.0 && at.s <= road->lanes[lane].length && vg_abs(at.d) <= junction_reach
                && vg_cos(vg_wrap_angle(v->heading - at.heading)) >= same_direction) {
                return at;
            }
        }
    }
    return (verge_lane_position){ .lane_id = VERGE_NO_LANE };
}

// Position on the lane that the vehicle drives along: the lane of its route while it is on it and
// heads along it, else the lane that fits best. Among lanes that fit as well the target decides.
static verge_lane_position locate(const verge_road* road, const verge_vehicle* v,
                                  int32_t lane_before)
{
    verge_lane_position at = locate_from(road, v, lane_before);
    if (at.lane_id == VERGE_NO_LANE) {
        return keep_route(road, v, lane_before);
    }
    if (vg_cos(vg_wrap_angle(v->heading - at.heading)) < same_direction) {
        at = best_fit(road, v, at);
    }
    return at.contained ? towards_target(road, v, at) : at;
}

static vg_rectangle body_of(const verge_vehicle* v)
{
    vg_rectangle body = { .x = v->x, .y = v->y, .half_length = 0.5 * v->length + v->margin,
                          .half_width = 0.5 * v->width + v->margin };
    vg_sincos(vg_wrap_angle(v->heading), &body.sin_heading, &body.cos_heading);
    return body;
}

uint32_t vg_body_count(const verge_vehicle* vehicle)
{
    return vehicle->body.trailer_length > 0.0 ? 2 : 1;
}

uint32_t vg_scene_bodies(const verge_scene* scene)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        count += vg_body_count(&scene->vehicles[i]);
    }
    return count;
}

// Rectangles of a vehicle and of its trailer, if it has one. Returns their number.
static uint32_t bodies_of(const verge_vehicle* v, vg_rectangle bodies[2])
{
    bodies[0] = body_of(v);
    if (vg_body_count(v) == 1) {
        return 1;
    }
    double sine, cosine;
    vg_sincos(vg_wrap_angle(vg_finite(v->trailer_heading) ? v->trailer_heading : v->heading),
              &sine, &cosine);
    bodies[1] = vg_trailer_at(&v->body, &bodies[0], cosine, sine);
    bodies[1].half_length += v->margin;
    bodies[1].half_width += v->margin;
    return 2;
}

bool verge_vehicles_overlap(const verge_vehicle* a, const verge_vehicle* b)
{
    if (a == NULL || b == NULL) {
        return false;
    }
    vg_rectangle first[2], second[2];
    const uint32_t first_count = bodies_of(a, first), second_count = bodies_of(b, second);
    bool overlap = false;
    for (uint32_t i = 0; i < first_count * second_count; ++i) {
        overlap =
            overlap || vg_rectangle_overlap(&first[i / second_count], &second[i % second_count]);
    }
    return overlap;
}

double verge_vehicles_distance(const verge_vehicle* a, const verge_vehicle* b)
{
    if (a == NULL || b == NULL) {
        return 0.0;
    }
    vg_rectangle first[2], second[2];
    const uint32_t first_count = bodies_of(a, first), second_count = bodies_of(b, second);
    double least = VG_HUGE;
    for (uint32_t i = 0; i < first_count * second_count; ++i) {
        least = vg_min(least,
                       vg_rectangle_distance(&first[i / second_count], &second[i % second_count]));
    }
    return least;
}
