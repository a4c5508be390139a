/// Predicts every vehicle at the instants of a trajectory (section 3.2.2: "first predicts").
/// Vehicles with a decision move along their action steps, all others by lane keeping behind the
/// vehicle ahead. Within a decision step the acceleration is constant, and lateral motion is a
/// cubic between the ends of the step, at rest where a run of lane changes begins or ends.
#include "verge/trajectory.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "base/stage.h"
#include "motion/expected.h"
#include "motion/predictor.h"
#include "motion/trailer.h"
#include "traffic/advance.h"

#include <string.h>

// Below this speed the body keeps the heading that it has. [m/s]
static const double standing_speed = 0.5;
// An uncontrolled vehicle with a lower lateral speed keeps its offset in the lane. [m/s]
static const double drift_min = 0.4;
// Distance after which lateral motion ends where there is no neighbouring lane. [m]
static const double drift_distance = 0.5;

// Lateral motion of an uncontrolled vehicle: as measured, up to the next lane centre.
typedef struct drift {
    double rate;  // [m/s] to the left
    double until; // [m] d at its end
    bool   back;  // the body points against its lane
} drift;

struct verge_predictor {
    verge_planner_def def;
    vg_pairs*    pairs;
    vg_model*    model;
    vg_flow*     flows;    // [3] at t = 0, now and one instant later
    vg_expected* expected; // [controlled_max]
    drift*       drifts;   // [vehicles_max]
    vg_order*    order;    // who passes conflict areas first
};

static void* take(vg_arena* arena, const verge_planner_def* def);
static void* take_own(vg_arena* arena, const verge_planner_def* def);
static bool read_decision(verge_predictor* self, const verge_scene* scene,
                          const verge_decision* decision);
static drift drift_of(const verge_predictor* self, const verge_vehicle* vehicle, uint32_t slot);
static double drift_step(const drift* across, double dt, float* d);
static void drive_straight(verge_track* track, const verge_vehicle* vehicle,
                           const verge_planner_def* def);
static void set_decided_state(const verge_predictor* self, uint32_t slot, double t, vg_flow* now,
                              double* d_rate);
static void set_pose(const verge_predictor* self, verge_track* track, const vg_flow* now,
                     uint32_t slot, double d_rate, uint32_t k);

// ---------------------------------------------------------------------------- memory

size_t verge_predictor_memory_size(const verge_planner_def* def)
{
    return vg_stage_size(def, take);
}

size_t verge_predictor_shared_memory_size(const verge_planner_def* def)
{
    return vg_stage_size(def, take_own);
}

verge_status verge_predictor_init(verge_predictor** predictor, const verge_planner_def* def,
                                  void* memory, size_t size)
{
    if (predictor == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    void* stage = NULL;
    const verge_status status = vg_stage_init(&stage, def, memory, size, take);
    *predictor = stage;
    return status;
}

static void use(verge_predictor* self, const vg_traffic* traffic)
{
    self->pairs = traffic->pairs;
    self->model = traffic->model;
    self->flows = traffic->flows;
    self->order = traffic->order;
}

verge_status vg_predictor_init_with(verge_predictor** predictor, const verge_planner_def* def,
                                    const vg_traffic* traffic, void* memory, size_t size)
{
    void* stage = NULL;
    const verge_status status = vg_stage_init(&stage, def, memory, size, take_own);
    *predictor = stage;
    if (status == VERGE_OK) {
        use(*predictor, traffic);
    }
    return status;
}

static void* take(vg_arena* arena, const verge_planner_def* def)
{
    verge_predictor* self = take_own(arena, def);
    const vg_traffic traffic = vg_traffic_take(arena, def);
    if (self != NULL) {
        use(self, &traffic);
    }
    return self;
}

// All but the traffic.
static void* take_own(vg_arena* arena, const verge_planner_def* def)
{
    verge_predictor* self = vg_arena_take(arena, sizeof *self);
    vg_expected* expected = vg_arena_take(arena, def->controlled_max * sizeof *expected);
    drift* drifts = vg_arena_take(arena, def->vehicles_max * sizeof *drifts);
    if (self != NULL) {
        *self = (verge_predictor){ .def = *def, .expected = expected, .drifts = drifts };
        self->def.road = (verge_road_def){ NULL, 0 };
    }
    return self;
}

// ---------------------------------------------------------------------------- tracks

// Vehicles of the scene that have a decision (bits).
static uint64_t decided_vehicles(const verge_scene* scene, const verge_decision* decision)
{
    uint64_t set = 0;
    for (uint32_t i = 0; decision != NULL && i < decision->vehicle_count; ++i) {
        const int32_t k = verge_scene_find(scene, decision->vehicles[i].vehicle_id);
        set |= k >= 0 && vg_scene_moves_along(scene, (uint32_t)k) ? (uint64_t)1 << k : 0;
    }
    return set;
}

void verge_sincos(double angle, double* sine, double* cosine)
{
    double s = __builtin_nan(""), c = s;
    if (vg_abs(angle) <= 1e6) {
        vg_sincos(angle, &s, &c);
    }
    if (sine != NULL) {
        *sine = s;
    }
    if (cosine != NULL) {
        *cosine = c;
    }
}

verge_status verge_predict_for(uint64_t config, verge_predictor* self, const verge_scene* scene,
                               const verge_decision* decision, verge_tracks* tracks)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    if (self == NULL || tracks == NULL || !vg_scene_holds(scene)
        || (tracks->of == NULL && tracks->tracks_max > 0)
        || (decision != NULL && decision->vehicles == NULL && decision->vehicle_count > 0)) {
        return VERGE_ERR_ARGUMENT;
    }
    const verge_planner_def* def = &self->def;
    const uint32_t count = scene->vehicle_count;
    if (!vg_pairs_hold(self->pairs, scene->road)
        || count > def->vehicles_max // before any set of vehicles, which has 64 bits
        || (decision != NULL && decision->vehicle_count > decision->vehicles_max)) {
        return VERGE_ERR_CAPACITY;
    }
    const uint64_t decided = decided_vehicles(scene, decision);
    const uint32_t bodies = vg_scene_bodies(scene);
    if (bodies > def->vehicles_max || bodies > tracks->tracks_max
        || vg_bits(decided) > def->controlled_max) {
        return VERGE_ERR_CAPACITY;
    }
    vg_flow *root = &self->flows[0], *now = &self->flows[1], *next = &self->flows[2];
    vg_model_from(self->model, root, def, self->pairs, scene, decided);
    if (decided != 0 && !read_decision(self, scene, decision)) {
        return VERGE_ERR_DEF;
    }
    if (self->model->best) {
        vg_order_decided(self->order, self->model, root, scene, decision);
    }
    tracks->count = count;
    for (uint32_t i = 0; i < count; ++i) {
        verge_track_begin(&tracks->of[i], &scene->vehicles[i]);
        if (scene->positions[i].lane_id == VERGE_NO_LANE) {
            drive_straight(&tracks->of[i], &scene->vehicles[i], def);
        }
    }
    for (uint32_t slot = 0; slot < self->model->count; ++slot) {
        self->drifts[slot] = drift_of(self, &scene->vehicles[self->model->input_index[slot]], slot);
    }
    memcpy(now, root, sizeof *now);
    for (uint32_t k = 1; k < def->points; ++k) {
        vg_flow_follow(self->model, now, def->point_s, next);
        memcpy(now, next, sizeof *now);
        for (uint32_t slot = 0; slot < self->model->count; ++slot) {
            double d_rate = 0.0;
            if (slot < self->model->controlled_count) {
                set_decided_state(self, slot, (double)k * def->point_s, now, &d_rate);
            } else if (self->drifts[slot].rate != 0.0) {
                d_rate = drift_step(&self->drifts[slot], def->point_s, &now->d[slot]);
            }
            set_pose(self, &tracks->of[self->model->input_index[slot]], now, slot, d_rate, k);
        }
        vg_flow_derive(self->model, now);
    }
    vg_trailers_predict(tracks, scene->vehicles, count, def->points);
    return VERGE_OK;
}

static bool read_decision(verge_predictor* self, const verge_scene* scene,
                          const verge_decision* decision)
{
    for (uint32_t slot = 0; slot < self->model->controlled_count; ++slot) {
        const uint32_t i = self->model->input_index[slot];
        const verge_vehicle_decision* own = verge_decision_of(decision, scene->vehicles[i].id);
        if (own == NULL || !vg_expected_from(&self->expected[slot], scene, i, own)) {
            return false;
        }
    }
    return true;
}

// A vehicle on no lane moves straight ahead at constant speed.
static void drive_straight(verge_track* track, const verge_vehicle* vehicle,
                           const verge_planner_def* def)
{
    for (uint32_t k = 1; k < def->points; ++k) {
        const double distance = vehicle->speed * def->point_s * (double)k;
        track->x[k] = vehicle->x + distance * track->cos_heading[0];
        track->y[k] = vehicle->y + distance * track->sin_heading[0];
        track->cos_heading[k] = track->cos_heading[0];
        track->sin_heading[k] = track->sin_heading[0];
        track->speed[k] = vehicle->speed;
    }
}

static void set_pose(const verge_predictor* self, verge_track* track, const vg_flow* now,
                     uint32_t slot, double d_rate, uint32_t k)
{
    VERGE_ASSERT(k > 0);
    const verge_road* road = self->model->road;
    const uint32_t lane = (uint32_t)now->lane[slot];
    const int32_t target = slot < self->model->controlled_count ? self->model->target[slot] : -1;
    const double s = vg_flow_s(self->model, now, slot);
    const vg_reference at = vg_road_at(road, lane, target, s);
    const double c = at.cos_heading, n = at.sin_heading, d = (double)now->d[slot];
    track->x[k] = at.x - d * n;
    track->y[k] = at.y + d * c;
    const double v = (double)now->v[slot];
    const double forwards = self->drifts[slot].back ? -v : v; // speed along the heading
    track->speed[k] = forwards;
    track->cos_heading[k] = track->cos_heading[k - 1u];
    track->sin_heading[k] = track->sin_heading[k - 1u];
    if (vg_abs(v) > standing_speed) {
        const double length = vg_sqrt(v * v + d_rate * d_rate);
        const double norm = forwards > 0.0 ? 1.0 / length : -1.0 / length;
        const double along = v * norm, across = d_rate * norm;
        track->cos_heading[k] = c * along - n * across;
        track->sin_heading[k] = n * along + c * across;
    }
}

// ---------------------------------------------------------------------------- lateral motion

static drift drift_of(const verge_predictor* self, const verge_vehicle* vehicle, uint32_t slot)
{
    const vg_flow* root = &self->flows[0];
    const vg_lane* lane = &self->model->road->lanes[root->lane[slot]];
    const vg_reference at = vg_lane_at(lane, vg_flow_s(self->model, root, slot));
    double sine = 0.0, cosine = 1.0;
    vg_sincos(vehicle->heading, &sine, &cosine);
    const double rate = vehicle->speed * (sine * at.cos_heading - cosine * at.sin_heading);
    const double d = (double)root->d[slot];
    const bool back = self->model->faces_back[slot];
    if (vg_abs(rate) < drift_min) {
        return (drift){ 0.0, d, back };
    }
    const double side = rate > 0.0 ? 1.0 : -1.0;
    const double gap = (double)(rate > 0.0 ? root->left_gap[slot] : root->right_gap[slot]);
    const double beyond = gap > 0.0 ? gap : d * side + drift_distance;
    return (drift){ rate, d * side < -drift_min ? 0.0 : side * vg_max(beyond, d * side), back };
}

// Moves d by one instant; returns the lateral speed. [m/s]
static double drift_step(const drift* across, double dt, float* d)
{
    const double left = (across->until - (double)*d) * (across->rate > 0.0 ? 1.0 : -1.0);
    const double step = vg_min(vg_abs(across->rate) * dt, vg_max(left, 0.0));
    *d += (float)(across->rate > 0.0 ? step : -step);
    return (across->rate > 0.0 ? step : -step) / dt;
}

// ---------------------------------------------------------------------------- decided motion

// Lateral position at the end of step m on the axis of its start.
static double lateral_end(const verge_road* road, const vg_expected* expected, uint32_t m)
{
    const vg_expected_state* from = &expected->states[m];
    const vg_expected_state* to = &expected->states[m + 1u];
    if (road->lanes[from->lane].bundle == road->lanes[to->lane].bundle) {
        return (double)to->y;
    }
    return (double)(from->y - from->d + to->d);
}

// Rate of y [m/s] at the joint before step m.
static double joint_slope(const verge_road* road, const vg_expected* expected, uint32_t m)
{
    const uint8_t* actions = expected->actions;
    if (m == 0 || m >= expected->step_count || actions[m] != actions[m - 1u]
        || !vg_action_changes_lane(actions[m])) {
        return 0.0;
    }
    const double before = lateral_end(road, expected, m - 1u) - (double)expected->states[m - 1u].y;
    const double after = lateral_end(road, expected, m) - (double)expected->states[m].y;
    return (before + after) / (expected->t[m + 1u] - expected->t[m - 1u]);
}

static void set_decided_state(const verge_predictor* self, uint32_t slot, double t, vg_flow* now,
                              double* d_rate)
{
    VERGE_ASSERT(slot < self->model->controlled_count);
    VERGE_ASSERT(t >= 0.0);
    const verge_road* road = self->model->road;
    const vg_expected* expected = &self->expected[slot];
    uint32_t m = 0; // the step t lies in
    while (m + 1u < expected->step_count && expected->t[m + 1u] <= t) {
        ++m;
    }
    const double step_s = expected->t[m + 1u] - expected->t[m];
    const vg_expected_state* from = &expected->states[m];
    const double into = vg_clamp(t - expected->t[m], 0.0, step_s);
    const double u = into / step_s;
    const double v0 = (double)from->v;
    const double v1 = (double)expected->states[m + 1u].v;
    const double whole = 0.5 * (v0 + v1) * step_s;
    const double part = v0 * into + 0.5 * (v1 - v0) * into * u;
    const double distance = whole > 1e-9 ? (double)expected->distance[m] * part / whole : 0.0;
    const double y0 = (double)from->y;
    const double rise = lateral_end(road, expected, m) - y0;
    const double m0 = joint_slope(road, expected, m) * step_s;
    const double m1 = joint_slope(road, expected, m + 1u) * step_s;
    const double y = y0 + u * (m0 + u * (3.0 * rise - 2.0 * m0 - m1 + u * (m0 + m1 - 2.0 * rise)));
    *d_rate =
        (m0 + u * (2.0 * (3.0 * rise - 2.0 * m0 - m1) + u * 3.0 * (m0 + m1 - 2.0 * rise))) / step_s;
    now->lane[slot] = (int32_t)from->lane;
    // Stations of the flow are those of the middle of vehicle and trailer.
    now->station[slot] = from->station + (float)distance / from->rate
                         - (float)self->model->back[slot] / from->rate;
    now->v[slot] = (float)(v0 + (v1 - v0) * u);
    const float station = from->station + (float)distance / from->rate; // of the vehicle
    now->d[slot] = (float)y - vg_lane_lateral(&road->lanes[from->lane], station);
}
