/// See predict.h. Longitudinal motion inside a decision step has constant acceleration; lateral
/// motion is a cubic through the steps' ends, at rest where a run of changes begins or ends.

#include "motion/predict.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/advance.h"

#include <string.h>

// Below this the direction of the body is the lane's. [m/s]
static const double standing = 0.5;

// A human that drifts slower than this keeps its place in the lane. [m/s]
static const double drift_min = 0.4;
// Where no lane is beside, a drift ends after this. [m]
static const double drift_free = 0.5;

// A human's way across its lane: as measured, until it reaches the next centre in that direction.
typedef struct drift {
    double rate;  // [m/s] to the left
    double until; // [m] d
} drift;

static drift drift_of(const vg_model* scene, const vg_flow* root, const verge_vehicle* vehicle, uint32_t slot);
static double go_across(const drift* way, double dt, float* d);
static void start_pose(vg_track* track, const verge_vehicle* vehicle);
static void drive_straight(vg_track* track, const verge_vehicle* vehicle, const verge_planner_def* def);
static void decided_state(const vg_model* scene, const vg_decision* decision, uint32_t slot, double t,
                          vg_flow* now, double* d_rate);
static void note(vg_track* track, const vg_model* scene, const vg_flow* now, uint32_t slot, double d_rate,
                 uint32_t k);

void vg_predict_tracks(vg_tracks* tracks, const vg_model* scene, const vg_flow* root,
                       const vg_decision* decision, const verge_vehicle* vehicles,
                       const vg_placed* placed, uint32_t vehicle_count)
{
    VERGE_ASSERT(vehicle_count <= VERGE_VEHICLES_MAX);
    const verge_planner_def* def = scene->def;
    tracks->count = vehicle_count;
    for (uint32_t i = 0; i < vehicle_count; ++i) {
        start_pose(&tracks->of[i], &vehicles[i]);
        if (!placed[i].on_road) {
            drive_straight(&tracks->of[i], &vehicles[i], def);
        }
    }
    drift drifts[VERGE_VEHICLES_MAX];
    for (uint32_t slot = 0; slot < scene->count; ++slot) {
        drifts[slot] = drift_of(scene, root, &vehicles[scene->input_index[slot]], slot);
    }
    vg_flow now, next;
    memcpy(&now, root, sizeof now);
    for (uint32_t k = 1; k < def->points; ++k) {
        vg_flow_follow(scene, &now, def->point_s, &next);
        memcpy(&now, &next, sizeof now);
        for (uint32_t slot = 0; slot < scene->count; ++slot) {
            double d_rate = 0.0;
            if (slot < scene->controlled_count) {
                decided_state(scene, decision, slot, (double)k * def->point_s, &now, &d_rate);
            } else if (drifts[slot].rate != 0.0) {
                d_rate = go_across(&drifts[slot], def->point_s, &now.d[slot]);
            }
            note(&tracks->of[scene->input_index[slot]], scene, &now, slot, d_rate, k);
        }
        vg_flow_derive(scene, &now);
    }
}

static drift drift_of(const vg_model* scene, const vg_flow* root, const verge_vehicle* vehicle, uint32_t slot)
{
    const vg_lane* lane = &scene->road->lanes[root->lane[slot]];
    const vg_reference at = vg_lane_at(lane, vg_lane_s(lane, (double)root->station[slot]));
    double sine = 0.0, cosine = 1.0;
    vg_sincos(vehicle->heading, &sine, &cosine);
    const double rate = vehicle->speed * (sine * at.cos_heading - cosine * at.sin_heading);
    const double d = (double)root->d[slot];
    if (vg_abs(rate) < drift_min) {
        return (drift){ 0.0, d };
    }
    const double side = rate > 0.0 ? 1.0 : -1.0;
    const double gap = (double)(rate > 0.0 ? root->left_gap[slot] : root->right_gap[slot]);
    const double beyond = gap > 0.0 ? gap : d * side + drift_free;
    return (drift){ rate, d * side < -drift_min ? 0.0 : side * vg_max(beyond, d * side) };
}

// One instant on; returns the rate it had. [m/s]
static double go_across(const drift* way, double dt, float* d)
{
    const double left = (way->until - (double)*d) * (way->rate > 0.0 ? 1.0 : -1.0);
    const double step = vg_min(vg_abs(way->rate) * dt, vg_max(left, 0.0));
    *d += (float)(way->rate > 0.0 ? step : -step);
    return (way->rate > 0.0 ? step : -step) / dt;
}

static void start_pose(vg_track* track, const verge_vehicle* vehicle)
{
    track->vehicle_id = vehicle->id;
    track->controlled = vehicle->controlled;
    track->half_length = 0.5 * vehicle->length + vehicle->margin;
    track->half_width = 0.5 * vehicle->width + vehicle->margin;
    track->x[0] = vehicle->x;
    track->y[0] = vehicle->y;
    track->speed[0] = vehicle->speed;
    vg_sincos(vehicle->heading, &track->sin_heading[0], &track->cos_heading[0]);
}

// Off every lane nothing is known but the motion itself.
static void drive_straight(vg_track* track, const verge_vehicle* vehicle, const verge_planner_def* def)
{
    for (uint32_t k = 1; k < def->points; ++k) {
        const double way = vehicle->speed * def->point_s * (double)k;
        track->x[k] = vehicle->x + way * track->cos_heading[0];
        track->y[k] = vehicle->y + way * track->sin_heading[0];
        track->cos_heading[k] = track->cos_heading[0];
        track->sin_heading[k] = track->sin_heading[0];
        track->speed[k] = vehicle->speed;
    }
}

// Lateral position at the end of step m on the axis of its start.
static double lateral_end(const vg_model* scene, const vg_decision* decision, uint32_t slot, uint32_t m)
{
    const vg_flow* from = &decision->flows[m];
    const vg_flow* to = &decision->flows[m + 1u];
    const verge_road* road = scene->road;
    if (road->lanes[from->lane[slot]].bundle == road->lanes[to->lane[slot]].bundle) {
        return (double)to->y[slot];
    }
    return (double)(from->y[slot] - from->d[slot] + to->d[slot]);
}

// Rate of y [m/s] at the joint before step m.
static double joint_slope(const vg_model* scene, const vg_decision* decision, uint32_t slot, uint32_t m)
{
    const vg_joint_actions* line = &decision->line;
    if (m == 0 || m >= line->step_count || line->actions[m][slot] != line->actions[m - 1u][slot]
        || !vg_action_changes_lane(line->actions[m][slot])) {
        return 0.0;
    }
    const double before = lateral_end(scene, decision, slot, m - 1u)
                          - (double)decision->flows[m - 1u].y[slot];
    const double after =
        lateral_end(scene, decision, slot, m) - (double)decision->flows[m].y[slot];
    return (before + after) / (2.0 * scene->def->step_s);
}

static void decided_state(const vg_model* scene, const vg_decision* decision, uint32_t slot, double t,
                          vg_flow* now, double* d_rate)
{
    const double step_s = scene->def->step_s;
    uint32_t m = 0; // the step t lies in
    while (m + 1u < decision->line.step_count && (double)(m + 1u) * step_s <= t) {
        ++m;
    }
    const vg_flow* from = &decision->flows[m];
    const double into = vg_clamp(t - (double)m * step_s, 0.0, step_s);
    const double u = into / step_s;
    const double v0 = (double)from->v[slot];
    const double v1 = (double)decision->flows[m + 1u].v[slot];
    const double whole = 0.5 * (v0 + v1) * step_s;
    const double part = v0 * into + 0.5 * (v1 - v0) * into * u;
    const double way = whole > 1e-9 ? (double)decision->way[m][slot] * part / whole : 0.0;
    const double y0 = (double)from->y[slot];
    const double rise = lateral_end(scene, decision, slot, m) - y0;
    const double m0 = joint_slope(scene, decision, slot, m) * step_s;
    const double m1 = joint_slope(scene, decision, slot, m + 1u) * step_s;
    const double y = y0 + u * (m0 + u * (3.0 * rise - 2.0 * m0 - m1 + u * (m0 + m1 - 2.0 * rise)));
    *d_rate = (m0 + u * (2.0 * (3.0 * rise - 2.0 * m0 - m1) + u * 3.0 * (m0 + m1 - 2.0 * rise))) / step_s;
    now->lane[slot] = from->lane[slot];
    now->station[slot] = from->station[slot] + (float)way / from->rate[slot];
    now->v[slot] = (float)(v0 + (v1 - v0) * u);
    now->d[slot] =
        (float)y - vg_lane_lateral(&scene->road->lanes[now->lane[slot]], now->station[slot]);
}

void vg_road_pose(const verge_road* road, uint32_t lane, int32_t target, double s, double d, double* x,
                  double* y, double* cos_heading, double* sin_heading)
{
    lane = vg_road_follow(road, lane, target, &s);
    const vg_reference at = vg_lane_at(&road->lanes[lane], s);
    *x = at.x - d * at.sin_heading;
    *y = at.y + d * at.cos_heading;
    *cos_heading = at.cos_heading;
    *sin_heading = at.sin_heading;
}

static void note(vg_track* track, const vg_model* scene, const vg_flow* now, uint32_t slot, double d_rate,
                 uint32_t k)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)now->lane[slot];
    const int32_t target = slot < scene->controlled_count ? scene->target[slot] : -1;
    const double s = vg_lane_s(&road->lanes[lane], (double)now->station[slot]);
    double c = 1.0, n = 0.0;
    vg_road_pose(road, lane, target, s, (double)now->d[slot], &track->x[k], &track->y[k], &c, &n);
    const double v = (double)now->v[slot];
    if (v > standing) {
        const double norm = 1.0 / vg_sqrt(v * v + d_rate * d_rate);
        const double along = v * norm, across = d_rate * norm;
        track->cos_heading[k] = c * along - n * across;
        track->sin_heading[k] = n * along + c * across;
    } else {
        track->cos_heading[k] = c;
        track->sin_heading[k] = n;
    }
    track->speed[k] = v;
}
