/// The model of a scene: vehicles, their target lanes and their weights in X_flow. See flow.h.
#include "traffic/flow.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/goal.h"
#include "traffic/standing.h"

#include <string.h>

// A measured acceleration is assumed to last for `trend_s`. Above `speeding_up` it lasts until the
// speed limit is reached.
static const double trend_s = 2.0;     // [s]
static const double speeding_up = 0.1; // [m/s^2] above the noise of constant speed
// BEST: comfortable acceleration of a car [m/s^2]; share of the largest acceleration that is the
// mean of a step, because a trajectory takes it up and ends it smoothly [1].
static const double comfort_acceleration = 1.5, mean_of_peak = 0.65;
// BEST: time gap to a vehicle that verge does not plan, by the cooperation factor of the habit:
// 1.0 s aggressive, 1.5 s normal, 2.0 s conservative. [s]
static const double gap_least = 1.0, gap_most = 2.0, gap_normal = 1.5, gap_by_cooperation = 1.25;
// Cooperation factor of the normal habit (Table 2). The penalty for a lane change with a small gap
// scales with the cooperation factor of the vehicle relative to this one. [1]
static const double normal_cooperation = 0.5;

// Distance from the centre to the rear end of the vehicle or of its trailer. [m]
static double length_behind(const verge_body* body)
{
    const double rear = 0.5 * body->length;
    return body->trailer_length > 0.0
               ? vg_max(rear, body->hitch + body->trailer_length - body->trailer_front) : rear;
}

// A vehicle that reverses is no faster. [m/s]
static const double reverse_max = -(VERGE_LIMIT_SPEED_MIN);
// A body turned by more than this does not move the way its lane runs. [1] cosine of 30 degrees
static const double turned_cosine = 0.866;

// The body in lane terms: its reach along and across, and where the middle of vehicle and trailer
// lies. One that drives is as long and wide as it is: a small angle to its lane is that of a lane
// change. One that stands reaches as far as its corners do.
static void set_body(vg_model* model, const verge_vehicle* vehicle, double turn, uint32_t slot)
{
    double sine, cosine;
    vg_sincos(vg_wrap_angle(turn), &sine, &cosine);
    const verge_body body = verge_vehicle_body(vehicle);
    const double back = 0.5 * (length_behind(&body) - 0.5 * vehicle->length);
    double half_length = 0.5 * vehicle->length + back, half_width = 0.5 * vehicle->width;
    const bool stands = vg_abs(vehicle->speed) <= (double)VG_STANDING_SPEED;
    model->faces_back[slot] = cosine < 0.0;
    model->turned[slot] = cosine < turned_cosine;
    model->back[slot] = cosine < 0.0 ? -back : back;
    if (model->best && !vehicle->controlled && (stands || vg_abs(cosine) < turned_cosine)) {
        const double along = vg_abs(cosine), across = vg_abs(sine), length = half_length;
        half_length = length * along + half_width * across;
        half_width = length * across + half_width * along;
    }
    model->half_length[slot] = (float)(half_length + vehicle->margin);
    model->half_width[slot] = (float)(half_width + vehicle->margin);
}

static void place(vg_model* model, vg_flow* flow, const verge_scene* scene, uint32_t input_index,
                  uint32_t slot)
{
    const verge_vehicle* vehicle = &scene->vehicles[input_index];
    const verge_lane_position* at = &scene->positions[input_index];
    const int32_t index = vg_road_lane_index(model->road, at->lane_id);
    VERGE_ASSERT(index >= 0);
    const vg_lane* lane = &model->road->lanes[index];
    model->input_index[slot] = input_index;
    set_body(model, vehicle, vehicle->heading - at->heading, slot);
    const double along = model->faces_back[slot] ? -1.0 : 1.0;
    const double speed = along * vehicle->speed, acceleration = along * vehicle->acceleration;
    // Desired speed of an uncontrolled vehicle: the limit if the vehicle speeds up, else the speed
    // that it has after trend_s at its present acceleration. A standing vehicle stays standing, and
    // a braking one continues to brake. The IDM takes the vehicles ahead into account.
    const double limit =
        model->faces_back[slot] ? vg_min(lane->speed_limit, reverse_max) : lane->speed_limit;
    const double fastest = vg_max(limit, speed);
    const double soon = acceleration > speeding_up ? fastest : speed + trend_s * acceleration;
    model->cruise[slot] = (float)vg_clamp(soon, (double)VG_CRUISE_MIN, fastest);
    model->braking[slot] =
        speed < 0.0 ? 0.0f : (float)vg_max(model->def->idm_braking_max, -acceleration);
    model->braking_hard[slot] = (float)verge_vehicle_body(vehicle).braking_max;
    flow->station[slot] = (float)vg_lane_station(lane, at->s - model->back[slot]);
    flow->d[slot] = (float)at->d;
    flow->v[slot] = (float)speed;
    flow->lane[slot] = index;
}

void vg_model_free_humans(vg_model* model, const vg_flow* flow)
{
    for (uint32_t i = model->controlled_count; i < model->count; ++i) {
        const double allowed = model->road->lanes[flow->lane[i]].speed_limit;
        const double limit = model->faces_back[i] ? vg_min(allowed, reverse_max) : allowed;
        model->cruise[i] = (float)vg_max(vg_max(limit, (double)flow->v[i]), 1.0);
        model->braking[i] = (float)model->def->idm_braking_max;
    }
}

// The accelerations of Table 1, limited to those of the vehicle's body.
static void limit_actions(vg_model* model, const verge_vehicle* vehicle, uint32_t slot)
{
    const verge_planner_def* def = model->def;
    const verge_body body = verge_vehicle_body(vehicle);
    const double fade = vg_min(1.0, body.speed_switch / vg_max(vehicle->speed, 1e-3));
    const double wanted = model->best ? comfort_acceleration : def->acceleration;
    const double share = model->best ? mean_of_peak : 1.0;
    const double a = vg_min(wanted, share * body.acceleration_max * fade);
    const float dt = (float)def->step_s;
    model->acceleration[slot] = a;
    model->gain[slot] = (float)a * dt;
    model->loss[slot] = (float)vg_min(def->deceleration, body.braking_max) * dt;
    model->stop[slot] = 0.5f * dt / model->loss[slot];
    model->speed_max[slot] = (float)body.speed_max;
    model->time_gap[slot] = (float)vg_clamp(
        gap_normal + gap_by_cooperation * (vehicle->habit.cooperation - normal_cooperation),
        gap_least, gap_most);
}

static void set_target(vg_model* model, const verge_vehicle* vehicle, uint32_t slot)
{
    const verge_road* road = model->road;
    const int32_t target =
        vehicle->target_lane < 0 ? -1 : vg_road_lane_index(road, vehicle->target_lane);
    model->target[slot] = target;
    model->ways[slot] = target < 0 ? NULL : &road->ways[(uint32_t)target * road->lane_count];
    model->gap_weight[slot] = (float)(vehicle->habit.cooperation / normal_cooperation);
}

// Eq. 5 is linear in the R_j: X_flow = sum_j weight_j R_j.
static void set_weights(vg_model* model, const verge_vehicle* vehicles)
{
    const uint32_t count = model->controlled_count;
    for (uint32_t j = 0; j < count; ++j) {
        double weight = 0.0;
        for (uint32_t i = 0; i < count; ++i) {
            const double gamma = vehicles[model->input_index[i]].habit.cooperation;
            weight += (i == j ? 1.0 : gamma) / (1.0 + (double)(count - 1) * gamma);
        }
        model->weight[j] = (float)(weight / (double)count);
    }
}

static bool has_single_axis(const vg_model* model, const vg_flow* flow)
{
    const verge_road* road = model->road;
    if (road->has_successors) {
        return false;
    }
    for (uint32_t i = 1; i < model->count; ++i) {
        if (road->lanes[flow->lane[i]].bundle != road->lanes[flow->lane[0]].bundle) {
            return false;
        }
    }
    return !model->conflicts;
}

uint64_t vg_scene_controlled(const verge_scene* scene)
{
    uint64_t set = 0;
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        set |= (uint64_t)scene->vehicles[i].controlled << i;
    }
    return set;
}

// Chooses and relates the lanes near the vehicles.
static void look_around(vg_model* model, const vg_flow* flow)
{
    const verge_road* road = model->road;
    vg_local* local = model->pairs->local;
    vg_source sources[VERGE_VEHICLES_MAX];
    for (uint32_t i = 0; i < model->count; ++i) {
        const uint32_t lane = (uint32_t)flow->lane[i];
        sources[i] = (vg_source){ .lane = lane, .controlled = i < model->controlled_count,
                                  .s = vg_lane_s(&road->lanes[lane], (double)flow->station[i]) };
    }
    vg_local_cover(local, road, sources, model->count);
    for (uint32_t i = 0; i < model->count; ++i) {
        const int32_t target = i < model->controlled_count ? model->target[i] : -1;
        model->column[i] = (uint8_t)vg_local_column(local, target);
    }
    model->rings = local->rings;
    model->conflicts = road->conflicts_from[road->lane_count] > 0;
}

void vg_model_from(vg_model* model, vg_flow* flow, const verge_planner_def* def, vg_pairs* pairs,
                   const verge_scene* scene, uint64_t controlled)
{
    VERGE_ASSERT(scene->vehicle_count <= pairs->stride && pairs->stride <= VERGE_VEHICLES_MAX);
    const verge_road* road = scene->road;
    memset(model, 0, sizeof *model);
    memset(flow, 0, sizeof *flow);
    model->def = def;
    model->best = def->search != VERGE_SEARCH_PAPER;
    model->road = road;
    model->pairs = pairs;
    for (uint32_t pass = 0; pass < 2; ++pass) { // controlled vehicles first
        for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
            const bool planned = (controlled >> i & 1u) != 0 && vg_scene_moves_along(scene, i);
            if (scene->positions[i].lane_id == VERGE_NO_LANE || planned != (pass == 0)) {
                continue;
            }
            const uint32_t slot = model->count++;
            place(model, flow, scene, i, slot);
            if (pass == 0) {
                VERGE_ASSERT(slot < VERGE_CONTROLLED_MAX);
                set_target(model, &scene->vehicles[i], slot);
                limit_actions(model, &scene->vehicles[i], slot);
                flow->previous[slot] = VERGE_ACTION_COUNT;
                model->controlled_count++;
            }
        }
    }
    VERGE_ASSERT(model->controlled_count <= VERGE_CONTROLLED_MAX);
    model->cruise_share = (float)def->cruise_share;
    look_around(model, flow);
    model->reaction = (float)def->reaction_s;
    model->headway = (float)def->headway_s;
    model->change_gap = (float)def->change_gap;
    model->change_gap_wanted = (float)def->change_gap_wanted;
    model->per_reaction = 1.0f / model->reaction;
    model->per_headway = 1.0f / model->headway;
    model->per_both = 1.0f / (float)(def->reaction_s + def->headway_s);
    set_weights(model, scene->vehicles);
    for (uint32_t slot = 0; slot < pairs->stride; ++slot) {
        pairs->lane[slot] = -1;
    }
    model->single_axis = has_single_axis(model, flow);
    vg_flow_derive(model, flow);
    if (model->best) {
        vg_model_classify(model, flow);
        vg_model_find_bodies(model, flow);
        if (model->body_count > 0) { // once more: bodies lower speed limits
            vg_flow_derive(model, flow);
        }
    }
}

void vg_flow_derive(const vg_model* model, vg_flow* flow)
{
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        vg_flow_set_road_fields(flow, slot, vg_bin_at(&model->road->lanes[flow->lane[slot]],
                                                      flow->station[slot]));
        if (model->body_count > 0 && slot < model->controlled_count) {
            vg_goal_limit(model, flow, slot);
        }
    }
}

float vg_lane_lateral(const vg_lane* lane, float station)
{
    return vg_bin_centre(vg_bin_at(lane, station));
}

bool vg_flow_holds(const vg_model* model, const vg_flow* flow)
{
    bool holds = model->controlled_count <= model->count && model->count <= VERGE_VEHICLES_MAX;
    for (uint32_t slot = 0; holds && slot < model->count; ++slot) {
        holds = flow->lane[slot] >= 0 && flow->lane[slot] < (int32_t)model->road->lane_count
                && vg_finite((double)flow->station[slot]) && vg_finite((double)flow->d[slot])
                && vg_finite((double)flow->v[slot]) && flow->rate[slot] > 0.0f
                && (slot >= model->controlled_count || flow->v[slot] >= 0.0f);
    }
    return holds;
}
