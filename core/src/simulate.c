/// Moves uncontrolled vehicles for simulators: the model of the prediction, with the speed limit as
/// desired speed.
#include "verge/simulate.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "base/stage.h"
#include "geometry/trailer.h"
#include "road/road.h"
#include "traffic/advance.h"
#include "traffic/signals.h"
#include "traffic/traffic.h"

// A human that stood across its lane turns into it at this rate. [rad/s]
static const double yaw_rate_max = 2.0;

struct verge_humans {
    verge_planner_def def;
    verge_scene scene;
    vg_pairs* pairs;
    vg_model* model;
    vg_flow*  flows; // [2] at the start, and dt later
    vg_order* order; // who passes conflict areas first
    verge_turns turns;
    int64_t   utime;  // [us] counted from the first call
};

static void* take(vg_arena* arena, const verge_planner_def* def)
{
    const uint32_t vehicles_max = def->vehicles_max;
    verge_humans* self = vg_arena_take(arena, sizeof *self);
    verge_lane_position* positions = vg_arena_take(arena, vehicles_max * sizeof *positions);
    const vg_traffic traffic = vg_traffic_take(arena, def);
    if (self != NULL) {
        *self = (verge_humans){ .def = *def, .pairs = traffic.pairs, .model = traffic.model,
                                .flows = traffic.flows, .order = traffic.order };
        self->def.road = (verge_road_def){ NULL, 0 };
        self->scene = (verge_scene){ .positions = positions, .vehicles_max = vehicles_max };
    }
    return self;
}

size_t verge_humans_memory_size(const verge_planner_def* def)
{
    return vg_stage_size(def, take);
}

verge_status verge_humans_init(verge_humans** humans, const verge_planner_def* def, void* memory,
                               size_t size)
{
    if (humans == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    void* stage = NULL;
    const verge_status status = vg_stage_init(&stage, def, memory, size, take);
    *humans = stage;
    return status;
}

// A vehicle that verge_scene_place() would reject counts as on no lane.
static verge_lane_position position_of(const verge_road* road, const verge_vehicle* v)
{
    if (verge_road_check_vehicle(road, v, NULL) != VERGE_OK) {
        return (verge_lane_position){ .lane_id = VERGE_NO_LANE };
    }
    return verge_road_project(road, v->x, v->y, vg_wrap_angle(v->heading), VERGE_NO_LANE);
}

static void move(verge_humans* self, const vg_flow* next, uint32_t slot, double dt)
{
    const verge_scene* scene = &self->scene;
    const uint32_t i = self->model->input_index[slot];
    const verge_lane_position* on = &scene->positions[i];
    const int32_t lane = vg_road_lane_index(scene->road, on->lane_id);
    verge_vehicle* v = &scene->vehicles[i];
    VERGE_ASSERT(lane >= 0);
    // A vehicle that faces back does not begin to drive backwards.
    const bool back = self->model->faces_back[slot];
    const bool reverses = back && v->speed < 0.0;
    const double along = (double)next->v[slot];
    const double speed = !back ? along : reverses ? -along : vg_max(-along, 0.0);
    const double way = (back ? -0.5 : 0.5) * (v->speed + speed) * dt;
    const vg_reference at = vg_road_at(scene->road, (uint32_t)lane, -1, on->s + way);
    const double line = vg_atan2(at.sin_heading, at.cos_heading);
    const double course = back ? line + VG_PI : line;
    const double turn = vg_wrap_angle(course - v->heading);
    const bool stands = v->speed == 0.0 && speed == 0.0;
    const double most = stands ? 0.0 : yaw_rate_max * dt;
    const double heading = vg_wrap_angle(
        vg_abs(turn) <= most ? course : v->heading + vg_clamp(turn, -most, most));
    v->x = at.x - on->d * at.sin_heading;
    v->y = at.y + on->d * at.cos_heading;
    v->yaw_rate = vg_wrap_angle(heading - v->heading) / dt;
    v->heading = heading;
    v->acceleration = (speed - v->speed) / dt;
    v->speed = speed;
}

static bool rules_hold(const verge_human_rules* rules, const verge_road* road)
{
    return vg_signals_hold(road, rules->signals, rules->signal_count)
           && (rules->lawless_count == 0 || rules->lawless_ids != NULL);
}

// The slots of the vehicles with these ids (bits).
static uint64_t slots_of(const verge_humans* self, const int32_t* ids, uint32_t count)
{
    uint64_t slots = 0;
    for (uint32_t slot = self->model->controlled_count; slot < self->model->count; ++slot) {
        const int32_t id = self->scene.vehicles[self->model->input_index[slot]].id;
        for (uint32_t i = 0; i < count; ++i) {
            slots |= (uint64_t)(ids[i] == id) << slot;
        }
    }
    return slots;
}

verge_status verge_humans_advance(verge_humans* self, const verge_road* road,
                                  const verge_human_rules* rules, verge_vehicle* vehicles,
                                  uint32_t vehicle_count, double dt)
{
    static const verge_human_rules no_rules = { .signals = NULL };
    rules = rules != NULL ? rules : &no_rules;
    if (self == NULL || road == NULL || (vehicle_count > 0 && vehicles == NULL)
        || !rules_hold(rules, road)) {
        return VERGE_ERR_ARGUMENT;
    }
    if (!(dt > 0.0 && dt <= 1.0)) {
        return VERGE_ERR_DEF;
    }
    if (vehicle_count > self->def.vehicles_max || !vg_pairs_hold(self->pairs, road)) {
        return VERGE_ERR_CAPACITY;
    }
    verge_scene* scene = &self->scene;
    scene->road = road;
    scene->vehicle_count = vehicle_count;
    scene->vehicles = vehicles;
    scene->signals = rules->signals;
    scene->signal_count = rules->signal_count;
    const uint64_t controlled = vg_scene_controlled(scene);
    if (vg_bits(controlled) > self->def.controlled_max) {
        return VERGE_ERR_CAPACITY;
    }
    for (uint32_t i = 0; i < vehicle_count; ++i) {
        scene->positions[i] = position_of(road, &vehicles[i]);
    }
    vg_flow* next = &self->flows[1];
    vg_model_from(self->model, &self->flows[0], &self->def, self->pairs, scene, controlled);
    self->model->lawless = slots_of(self, rules->lawless_ids, rules->lawless_count);
    vg_model_free_humans(self->model, &self->flows[0]);
    self->utime += (int64_t)(dt * 1e6);
    scene->utime = self->utime;
    self->order->of_humans = true;
    vg_order_from(self->order, self->model, &self->flows[0], scene, &self->turns, NULL);
    vg_flow_follow(self->model, &self->flows[0], dt, next);
    for (uint32_t i = 0; i < vehicle_count; ++i) {
        verge_vehicle* v = &vehicles[i];
        const bool straight = scene->positions[i].lane_id == VERGE_NO_LANE && vg_finite(v->x)
                              && vg_finite(v->y) && vg_abs(v->heading) <= 1e6
                              && vg_finite(v->speed);
        if (straight && !v->controlled) {
            v->x += v->speed * dt * vg_cos(v->heading);
            v->y += v->speed * dt * vg_sin(v->heading);
        }
    }
    for (uint32_t slot = self->model->controlled_count; slot < self->model->count; ++slot) {
        move(self, next, slot, dt);
    }
    scene->vehicles = NULL;
    scene->signals = NULL;
    scene->signal_count = 0;
    return VERGE_OK;
}

static vg_rectangle pose_of(const verge_vehicle* v)
{
    vg_rectangle pose = { .x = v->x, .y = v->y };
    vg_sincos(v->heading, &pose.sin_heading, &pose.cos_heading);
    return pose;
}

double verge_vehicle_trailer_heading(const verge_vehicle* before, const verge_vehicle* after)
{
    if (before == NULL || after == NULL) {
        return __builtin_nan("");
    }
    if (vg_body_count(before) == 1) {
        return after->trailer_heading;
    }
    const vg_rectangle from = pose_of(before), to = pose_of(after);
    double cosine = from.cos_heading, sine = from.sin_heading;
    if (vg_finite(before->trailer_heading)) {
        vg_sincos(before->trailer_heading, &sine, &cosine);
    }
    vg_trailer_pull(&before->body, &from, &to, &cosine, &sine);
    return vg_atan2(sine, cosine);
}
