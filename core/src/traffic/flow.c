/// Moves of a whole flow. See flow.h.

#include "traffic/flow.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))

// Another vehicle counts as in the path when the bodies, with this much air, overlap laterally:
// 2.4 m between centres of two cars of 2 m, 0.6 lane widths, as findings/paper.md has it.
static const float path_air = 0.4f;
// Air that joint actions must leave between bodies on their ways. [m]
static const float joint_air_along = 1.0f;
static const float joint_air_across = 0.3f;
// A measured acceleration is taken to last this long; from speeding_up on, to the limit.
static const double trend_s = 2.0;     // [s]
static const double speeding_up = 0.1; // [m/s^2] more than a foot that is held still
// Desired speed of one who stands: the IDM divides by it. [m/s]
static const double cruise_min = 0.05;
// Merging vehicles see each other from this far before their lanes come close. [m]
static const float merge_sight = 40.0f;
// Beyond all roads: a vehicle that is not there, or not seen. [m]
static const float nowhere = 1e9f;
// Nearer by this to the next lane's centre a vehicle is on the next lane. [m]
static const float border_air = 0.1f;
// Within this of a lane's centre a change of lane starts from that lane. [m]
static const float centred = 0.3f;
// Paper, section 4: lane changes are planned for steps of 1.5 s, half a lane each.
static const float change_step_s = 1.5f;
// A lane change is not steeper than one in two (d per s), and none is begun nearly standing.
static const float change_slope = 0.5f;
static const float change_speed_min = 0.5f; // [m/s]
// A leader this near, and slower than this share of the speed one could drive, is
// worth a change away from the target. [m], [1]
static const float overtake_sight = 60.0f;
static const float overtake_pace = 0.6f;
// Kept free before a lane's end, to merge from standstill. Who is slower than this may use it as
// soon as there is room beside. [m], [m/s]
static const float merge_reserve = 8.0f;
static const float merge_speed = 2.0f;
// Table 2: who cooperates more than the normal habit minds more how little room it leaves. [1]
static const double normal_cooperation = 0.5;
// Reached: the contract's |d| for "in the target lane". [m]
static const float reached_offset = 0.5f;

static void  lookup(const vg_scene* scene, vg_flow* flow, uint32_t slot);
static void  renew_sight(const vg_scene* scene, const vg_flow* flow);
static void  longitudinal_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);
static void  lateral_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);
static void  human_moves(const vg_scene* scene, const vg_flow* flow, float dt, float* station_to,
                            float* v_to, float* y_to);
static void  keep_window(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t slot);
static void  settle(const vg_scene* scene, const vg_flow* flow, vg_flow* next, uint32_t slot,
                       uint8_t action);
static void  earn(const vg_scene* scene, const vg_flow* before, const vg_moves* moves, vg_flow* next,
                  uint32_t slot, uint8_t action);
static bool  areas_conflict(const vg_scene* scene, const vg_flow* flow, const float* station1,
                            uint32_t i, uint32_t j);

INLINE float fabs_of(float x)
{
    return x < 0.0f ? -x : x;
}
INLINE float least(float a, float b)
{
    return a < b ? a : b;
}
INLINE float most(float a, float b)
{
    return a > b ? a : b;
}

// ---------------------------------------------------------------------------- scene

static void place(vg_scene* scene, vg_flow* flow, const verge_vehicle* vehicle, const vg_placed* at,
                  uint32_t input_index, uint32_t slot)
{
    const vg_lane* lane = &scene->road->lanes[at->lane];
    scene->input_index[slot] = input_index;
    scene->half_length[slot] = (float)(0.5 * vehicle->length + vehicle->margin);
    scene->half_width[slot] = (float)(0.5 * vehicle->width + vehicle->margin);
    // A human goes on as measured: one that speeds up does so to the limit, any other to the speed
    // its acceleration leads to soon, not to a limit it shows no wish for. One that stands stays;
    // one that brakes brakes on. The IDM does the rest.
    const double most = vg_max(lane->speed_limit, vehicle->speed);
    const double soon = vehicle->acceleration > speeding_up
                            ? most : vehicle->speed + trend_s * vehicle->acceleration;
    scene->cruise[slot] = (float)vg_clamp(soon, cruise_min, most);
    scene->braking[slot] = (float)vg_max(scene->def->idm_braking_max, -vehicle->acceleration);
    flow->station[slot] = (float)vg_lane_station(lane, at->s);
    flow->d[slot] = (float)at->d;
    flow->v[slot] = (float)vehicle->speed;
    flow->lane[slot] = (int32_t)at->lane;
}

void vg_scene_free_humans(vg_scene* scene, const vg_flow* flow)
{
    for (uint32_t i = scene->controlled_count; i < scene->count; ++i) {
        const double limit = scene->road->lanes[flow->lane[i]].speed_limit;
        scene->cruise[i] = (float)vg_max(vg_max(limit, (double)flow->v[i]), 1.0);
        scene->braking[i] = (float)scene->def->idm_braking_max;
    }
}

static void intend(vg_scene* scene, const verge_vehicle* vehicle, uint32_t slot)
{
    const verge_road* road = scene->road;
    const int32_t target =
        vehicle->target_lane < 0 ? -1 : vg_road_lane_index(road, vehicle->target_lane);
    scene->target[slot] = target;
    uint64_t good = target < 0 ? ~(uint64_t)0 : road->continues[target];
    for (uint32_t lane = 0; target >= 0 && lane < road->lane_count; ++lane) {
        if ((uint8_t)vg_road_changes(road, lane, (uint32_t)target) == 0) {
            good |= (uint64_t)1 << lane;
        }
    }
    scene->good_lanes[slot] = good;
    scene->care[slot] = (float)(vehicle->habit.cooperation / normal_cooperation);
    for (uint32_t lane = 0; lane < road->lane_count; ++lane) {
        const uint8_t changes =
            target < 0 ? 0 : (uint8_t)vg_road_changes(road, lane, (uint32_t)target);
        scene->nearness[slot][lane] = ((good >> lane) & 1u) != 0 ? 1.0f
                                      : changes == 255 ? 0.0f : (float)VG_NEARNESS_ONE_CHANGE / (float)changes;
    }
}

// Eq. 5 is linear in the R_j: X_flow = sum_j weight_j R_j.
static void weigh(vg_scene* scene, const verge_vehicle* vehicles)
{
    const uint32_t count = scene->controlled_count;
    for (uint32_t j = 0; j < count; ++j) {
        double weight = 0.0;
        for (uint32_t i = 0; i < count; ++i) {
            const double gamma = vehicles[scene->input_index[i]].habit.cooperation;
            weight += (i == j ? 1.0 : gamma) / (1.0 + (double)(count - 1) * gamma);
        }
        scene->weight[j] = (float)(weight / (double)count);
    }
}

static bool is_plain(const vg_scene* scene, const vg_flow* flow)
{
    const verge_road* road = scene->road;
    for (uint32_t lane = 0; lane < road->lane_count; ++lane) {
        if (road->lanes[lane].successor_count > 0) {
            return false;
        }
    }
    for (uint32_t i = 1; i < scene->count; ++i) {
        if (road->lanes[flow->lane[i]].bundle != road->lanes[flow->lane[0]].bundle) {
            return false;
        }
    }
    return road->conflict_lanes == 0;
}

void vg_scene_from(vg_scene* scene, vg_flow* flow, const verge_planner_def* def, const verge_road* road,
                   vg_sight* sight, const verge_vehicle* vehicles, const vg_placed* placed,
                   uint32_t vehicle_count)
{
    VERGE_ASSERT(vehicle_count <= VERGE_VEHICLES_MAX);
    memset(scene, 0, sizeof *scene);
    memset(flow, 0, sizeof *flow);
    scene->def = def;
    scene->road = road;
    scene->sight = sight;
    for (uint32_t pass = 0; pass < 2; ++pass) { // planned ones first
        for (uint32_t i = 0; i < vehicle_count; ++i) {
            if (!placed[i].on_road || vehicles[i].controlled != (pass == 0)) {
                continue;
            }
            const uint32_t slot = scene->count++;
            place(scene, flow, &vehicles[i], &placed[i], i, slot);
            if (pass == 0) {
                intend(scene, &vehicles[i], slot);
                flow->previous[slot] = VERGE_ACTION_COUNT;
                scene->controlled_count++;
            }
        }
    }
    VERGE_ASSERT(scene->controlled_count <= VERGE_CONTROLLED_MAX);
    scene->cruise_share = (float)def->cruise_share;
    for (uint32_t k = 0; k < road->lane_count * road->lane_count; ++k) {
        scene->rings = scene->rings || road->relations[k].period > 0.0f;
    }
    scene->reaction = (float)def->reaction_s;
    scene->headway = (float)def->headway_s;
    scene->change_gap = (float)def->change_gap;
    scene->change_gap_wanted = (float)def->change_gap_wanted;
    scene->per_reaction = 1.0f / scene->reaction;
    scene->per_headway = 1.0f / scene->headway;
    scene->per_both = 1.0f / (float)(def->reaction_s + def->headway_s);
    weigh(scene, vehicles);
    for (uint32_t slot = 0; slot < VERGE_VEHICLES_MAX; ++slot) {
        sight->lane[slot] = -1;
    }
    scene->plain = is_plain(scene, flow);
    vg_flow_derive(scene, flow);
}

// ---------------------------------------------------------------------------- where they are

void vg_flow_derive(const vg_scene* scene, vg_flow* flow)
{
    for (uint32_t slot = 0; slot < scene->count; ++slot) {
        lookup(scene, flow, slot);
    }
}

// Where a station falls among a lane's bins, held at the ends.
typedef struct bin_place {
    const vg_bin* here;
    float t;      // [1] from this bin to the next
    bool  inside; // not beyond the lane's ends
} bin_place;

INLINE bin_place bin_of(const vg_lane* lane, float station)
{
    const float at = (station - (float)lane->station_start) * (float)(1.0 / VG_BIN);
    const float last = (float)(lane->bin_count - 1u);
    VERGE_ASSERT(lane->bin_count >= 2 && at == at);
    const float clamped = at < 0.0f ? 0.0f : at > last ? last : at;
    uint32_t bin = (uint32_t)clamped;
    bin = bin > lane->bin_count - 2u ? lane->bin_count - 2u : bin;
    return (bin_place){ &lane->bins[bin], clamped - (float)bin, at >= 0.0f && at <= last };
}

INLINE float centre_at(bin_place place)
{
    return place.here[0].lateral + place.t * (place.here[1].lateral - place.here[0].lateral);
}

float vg_lane_lateral(const vg_lane* lane, float station)
{
    return centre_at(bin_of(lane, station));
}

INLINE void note_place(vg_flow* flow, uint32_t slot, bin_place place)
{
    const vg_bin* nearest = place.t < 0.5f ? place.here : place.here + 1;
    flow->y[slot] = centre_at(place) + flow->d[slot];
    flow->rate[slot] = (place.here[1].s - place.here[0].s) * (float)(1.0 / VG_BIN);
    flow->lean[slot] = place.inside ? (place.here[1].lateral - place.here[0].lateral) * (float)(1.0 / VG_BIN)
                                    : 0.0f;
    flow->left_gap[slot] = place.inside ? nearest->left_gap : 0.0f;
    flow->right_gap[slot] = place.inside ? nearest->right_gap : 0.0f;
    flow->limit[slot] = least(place.here[0].speed, place.here[1].speed);
}

static void lookup(const vg_scene* scene, vg_flow* flow, uint32_t slot)
{
    note_place(flow, slot, bin_of(&scene->road->lanes[flow->lane[slot]], flow->station[slot]));
}

static void see(const vg_scene* scene, const vg_flow* flow, uint32_t seen, uint32_t looker)
{
    const verge_road* road = scene->road;
    const uint32_t from = (uint32_t)flow->lane[looker];
    const uint32_t to = (uint32_t)flow->lane[seen];
    const vg_relation* relation = vg_road_relation(road, from, to);
    const int32_t target = looker < scene->controlled_count ? scene->target[looker] : -1;
    const bool visible = relation->kind != VG_UNRELATED && vg_road_matters(road, from, target, to);
    vg_sight* sight = scene->sight;
    sight->offset[looker][seen] = visible ? relation->offset : nowhere;
    sight->lateral[looker][seen] = relation->lateral;
    sight->touch[looker][seen] =
        relation->kind == VG_MERGING ? relation->touch : -nowhere;
    sight->period[looker][seen] = visible ? relation->period : 0.0f;
}

static void renew_sight(const vg_scene* scene, const vg_flow* flow)
{
    vg_sight* sight = scene->sight;
    for (uint32_t slot = 0; slot < scene->count; ++slot) {
        if (sight->lane[slot] == flow->lane[slot]) {
            continue;
        }
        for (uint32_t other = 0; other < scene->count; ++other) {
            see(scene, flow, slot, other);
            see(scene, flow, other, slot);
        }
        sight->lane[slot] = flow->lane[slot];
    }
}

static float wrapped(float ahead, float ring)
{
    const float half = 0.5f * ring;
    return ring <= 0.0f ? ahead : ahead > half ? ahead - ring : ahead < -half ? ahead + ring : ahead;
}

// Metres from slot i, at station_i, ahead to slot j, at station_j, centre to centre.
INLINE float ahead_of(const vg_scene* scene, uint32_t i, uint32_t j, float rate, float station_i,
                      float station_j)
{
    if (scene->plain) {
        return (station_j - station_i) * rate;
    }
    const float ahead = (station_j + scene->sight->offset[i][j] - station_i) * rate;
    return scene->rings ? wrapped(ahead, scene->sight->period[i][j] * rate) : ahead;
}

// Metres from y_i to the left to y_j.
INLINE float left_of(const vg_scene* scene, uint32_t i, uint32_t j, float y_i, float y_j)
{
    return scene->plain ? y_j - y_i : y_j - y_i + scene->sight->lateral[i][j];
}

// Merging vehicles are out of sight until the lanes come close.
INLINE bool in_sight(const vg_scene* scene, const vg_flow* flow, uint32_t i, uint32_t j)
{
    return scene->plain || flow->station[i] > scene->sight->touch[i][j] - merge_sight;
}

// ---------------------------------------------------------------------------- moves

void vg_flow_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    vg_flow_outline(scene, flow, moves);
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        (void)vg_flow_may_change(scene, flow, moves, i, VERGE_CHANGE_LEFT);
        (void)vg_flow_may_change(scene, flow, moves, i, VERGE_CHANGE_RIGHT);
    }
}

void vg_flow_outline(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    if (!scene->plain) {
        renew_sight(scene, flow);
    }
    longitudinal_moves(scene, flow, moves);
    lateral_moves(scene, flow, moves);
    human_moves(scene, flow, (float)scene->def->step_s, moves->station[0], moves->v[0], moves->y[0]);
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        keep_window(scene, flow, moves, i);
    }
}

// Table 1. A deceleration that reaches standstill stops there.
static void longitudinal_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    const float dt = (float)scene->def->step_s;
    const float gain = (float)scene->def->acceleration * dt;
    const float loss = (float)scene->def->deceleration * dt;
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        const float v = flow->v[i], station = flow->station[i];
        const float per_metre = 1.0f / flow->rate[i];
        const float v_dc = most(v - loss, 0.0f);
        const float stopping = v * v * (0.5f * dt / loss);
        const float way_dc = v < loss ? stopping : (v + v_dc) * (0.5f * dt);
        moves->station[0][i] = station + v * dt * per_metre;
        moves->station[1][i] = station + (v + 0.5f * gain) * dt * per_metre;
        moves->station[2][i] = station + way_dc * per_metre;
        moves->v[0][i] = v;
        moves->v[1][i] = v + gain;
        moves->v[2][i] = v_dc;
    }
}

// How far a change goes in one step where speed does not limit it: half the distance between two
// centrelines, and never past the next centre. d beyond `centred` on the far side: completing a
// change comes first. [m] to the side in question
INLINE float change_way(const vg_flow* flow, uint32_t i, bool to_left, float room)
{
    const float d = to_left ? flow->d[i] : -flow->d[i];
    const float gap = to_left ? flow->left_gap[i] : flow->right_gap[i];
    return least(d < -centred ? -d : gap - d, room);
}

INLINE float change_room(const vg_scene* scene, const vg_flow* flow, uint32_t i)
{
    const float part = 0.5f * (float)scene->def->step_s / change_step_s;
    return most(most(flow->left_gap[i], flow->right_gap[i]), 3.0f) * part;
}

// Keeping: back to the lane's centre. Nobody gets across steeper than change_slope.
static void lateral_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        const float d = flow->d[i], y = flow->y[i];
        const float slope = change_slope * flow->v[i] * (float)scene->def->step_s;
        const float room = least(change_room(scene, flow, i), slope);
        moves->y[0][i] = y + most(least(-d, room), -room);
        moves->y[1][i] = y + change_way(flow, i, true, room);
        moves->y[2][i] = y - change_way(flow, i, false, room);
    }
}

// Nearest vehicles ahead and behind in the path of one lateral option.
typedef struct window {
    float gap_l, v_l; // [m] from its centre to the leader's tail, [m/s]
    float gap_f, v_f; // [m] from its centre to the follower's nose, [m/s]
} window;

// Looks from slot i, at a station and y, at everyone at `stations` with speeds v: the innermost
// loop of the search, with everything it reads in locals and the plain case compiled apart.
INLINE window scan(const vg_scene* scene, const vg_flow* flow, uint32_t i, float station, float y,
                   const float* restrict stations, const float* restrict v, window w, bool plain)
{
    const float* restrict ys = flow->y;
    const float* restrict half_width = scene->half_width;
    const float* restrict lateral = scene->sight->lateral[i];
    const float width = scene->half_width[i] + path_air, rate = flow->rate[i];
    const uint32_t count = scene->count;
    for (uint32_t j = 0; j < count; ++j) {
        const float dy = plain ? ys[j] - y : ys[j] - y + lateral[j];
        const float reach = width + half_width[j];
        if (dy >= reach || dy <= -reach || j == i || (!plain && !in_sight(scene, flow, i, j))) {
            continue;
        }
        const float ds = plain ? (stations[j] - station) * rate
                               : ahead_of(scene, i, j, rate, station, stations[j]);
        const float gap = fabs_of(ds) - scene->half_length[j];
        if (ds > 0.0f && gap < w.gap_l) {
            w.gap_l = gap;
            w.v_l = v[j];
        } else if (ds <= 0.0f && gap < w.gap_f) {
            w.gap_f = gap;
            w.v_f = v[j];
        }
    }
    return w;
}

static window look(const vg_scene* scene, const vg_flow* flow, uint32_t i, float station, float y,
                   const float* stations, const float* v, float free_ahead)
{
    const window open = { .gap_l = free_ahead, .gap_f = nowhere };
    return scene->plain ? scan(scene, flow, i, station, y, stations, v, open, true)
                        : scan(scene, flow, i, station, y, stations, v, open, false);
}

// The IDM's acceleration [m/s^2]: Treiber 2000, with a limit of the braking and the gap taken as
// 1 m at least. What is divided by all the time is given as its inverse.
INLINE float idm(const verge_planner_def* def, float per_closing, float braking, float v,
                 float per_desired, float gap,
                 float v_lead)
{
    const float s0 = (float)def->idm_gap;
    const float closing = v * (v - v_lead) * per_closing;
    const float wanted = most(s0 + v * (float)def->idm_headway_s + closing, s0);
    const float ratio = wanted / most(gap, 1.0f);
    const float pace = v * per_desired;
    const float pace2 = pace * pace;
    const float a = (float)def->idm_acceleration * (1.0f - pace2 * pace2 - ratio * ratio);
    return most(a, -braking);
}

// KL: the IDM behind the nearest vehicle in the path, planned or not; the lane is kept as driven.
static void human_moves(const vg_scene* scene, const vg_flow* flow, float dt, float* station_to,
                        float* v_to, float* y_to)
{
    const float per_closing = 0.5f / (float)scene->def->idm_comfort;
    for (uint32_t i = scene->controlled_count; i < scene->count; ++i) {
        const window w =
            look(scene, flow, i, flow->station[i], flow->y[i], flow->station, flow->v, nowhere);
        const float per_desired = 1.0f / scene->cruise[i];
        const float gap = w.gap_l - scene->half_length[i];
        const float v = flow->v[i];
        const float v_lead = w.gap_l < 0.5f * nowhere ? w.v_l : v; // free road: nobody closes in
        const float a = idm(scene->def, per_closing, scene->braking[i], v, per_desired, gap, v_lead);
        const float v1 = v + a * dt;
        // One who stops goes no farther than to the stop.
        const float way = v1 < 0.0f ? v * v / (-2.0f * a) : (v + v1) * (0.5f * dt);
        station_to[i] = flow->station[i] + way / flow->rate[i];
        v_to[i] = most(v1, 0.0f);
        y_to[i] = flow->y[i];
    }
}

// Eq. 3: how far a new speed lies inside the window, >= 0 if it holds. Two margins: to the
// leader (upper bounds) and to the follower (lower bound). `way`: metres beyond KS.
typedef struct margins {
    float upper, lower;
} margins;

static margins margins_of(const vg_scene* scene, const window* w, float half, float v, float way)
{
    const float tau = scene->reaction, mth = scene->headway;
    const float gap_l = w->gap_l - half - way;
    const float gap_f = w->gap_f - half + way;
    const float upper =
        least((mth * w->v_l + gap_l) * scene->per_both, gap_l * scene->per_reaction);
    const float lower = w->v_f - (gap_f - tau * w->v_f) * scene->per_headway;
    return (margins){ upper - v, v - lower };
}

static bool fits(margins m)
{
    return m.upper >= 0.0f && m.lower >= 0.0f;
}

// The end of a lane that leads nowhere is a standing leader, a little before the end: whoever has
// to wait there needs way to get going and across.
static float dead_end_ahead(const vg_scene* scene, const vg_flow* flow, uint32_t slot, float station)
{
    const vg_lane* lane = &scene->road->lanes[flow->lane[slot]];
    return lane->dead_end ? (float)lane->station_end - merge_reserve - station : nowhere;
}

// Where nothing in the lane fits the window, the least harmful stays: brake for a leader, else
// make way for a follower. A vehicle always has a move.
static uint32_t least_harm(margins ks, margins ac, margins dc)
{
    if (ks.upper < 0.0f || dc.lower >= 0.0f) {
        return 1u << VERGE_DECELERATE;
    }
    return ac.upper >= 0.0f ? 1u << VERGE_ACCELERATE : 1u << VERGE_KEEP_SPEED;
}

// Borders, stretches and direction: changes lead towards the target, or around a slower leader.
static uint32_t changes_allowed(const vg_scene* scene, const vg_flow* flow, const window* keep, uint32_t slot)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const float d = flow->d[slot];
    const float left_gap = flow->left_gap[slot], right_gap = flow->right_gap[slot];
    if (flow->v[slot] < change_speed_min) {
        return 0;
    }
    const bool finish_left = d < -centred;
    const bool finish_right = d > centred;
    bool left = finish_left || left_gap > 0.0f;
    bool right = finish_right || right_gap > 0.0f;
    const int32_t target = scene->target[slot];
    const int8_t way = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool overtake = keep->gap_l < overtake_sight
                          && keep->v_l < overtake_pace * flow->limit[slot];
    if (!overtake) {
        left = left && (way > 0 || finish_left);
        right = right && (way < 0 || finish_right);
    }
    return (left ? 1u << VERGE_CHANGE_LEFT : 0u) | (right ? 1u << VERGE_CHANGE_RIGHT : 0u);
}

// Free way that is enough where everyone crawls. [m]
INLINE float crawling_gap(const vg_scene* scene, float v)
{
    return (float)scene->def->idm_gap + (float)scene->def->idm_headway_s * v;
}

// Does a change that comes to y fit the window among those in both lanes it touches? room: the
// free way that it leaves, ahead or behind. [m]
static bool change_fits(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves, uint32_t slot,
                        float y, float* room)
{
    const window w = look(scene, flow, slot, moves->station[0][slot], y, moves->station[0],
                          moves->v[0], nowhere);
    const float half = scene->half_length[slot];
    // Eq. 3 lets one cut in a hair ahead of a slower one: room on both sides is asked for too,
    // less of it where everyone crawls.
    *room = least(w.gap_l, w.gap_f) - half;
    return fits(margins_of(scene, &w, half, flow->v[slot], 0.0f))
           && *room >= least(scene->change_gap, crawling_gap(scene, flow->v[slot]));
}

bool vg_flow_may_change(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t slot,
                        uint8_t action)
{
    const uint8_t bit = (uint8_t)(1u << action);
    if ((moves->open[slot] & bit) != 0) {
        // Who is slow gets across in more steps, but looks as far as the others do.
        const bool to_left = action == VERGE_CHANGE_LEFT;
        const float way = change_way(flow, slot, to_left, change_room(scene, flow, slot));
        const float y = flow->y[slot] + (to_left ? way : -way);
        const bool legal = change_fits(scene, flow, moves, slot, y, &moves->room[to_left ? 0 : 1][slot]);
        moves->open[slot] = (uint8_t)(moves->open[slot] & ~bit);
        moves->legal[slot] = (uint8_t)(moves->legal[slot] | (legal ? bit : 0u));
    }
    return (moves->legal[slot] & bit) != 0;
}

// Who waits at a lane's end sets off once there is room beside and way enough to get across.
static bool may_set_off(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves, uint32_t slot)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const int32_t target = scene->target[slot];
    if (!road->lanes[lane].dead_end || flow->v[slot] >= merge_speed) {
        return false;
    }
    const float rate = flow->rate[slot];
    const float left = ((float)road->lanes[lane].station_end - moves->station[1][slot]) * rate;
    const int8_t way = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool to_left = way > 0 || (way == 0 && flow->left_gap[slot] > 0.0f);
    const float across = to_left ? flow->left_gap[slot] : -flow->right_gap[slot];
    float room;
    return across != 0.0f && left - scene->half_length[slot] > moves->v[1][slot]
           && change_fits(scene, flow, moves, slot, flow->y[slot] + 0.5f * across, &room);
}

// The single pruning of section 3.1.3. Everyone's neighbours are taken at the same instant as
// the new state, t + 1, planned ones at their present speed.
static void keep_window(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t slot)
{
    const float station = moves->station[0][slot], rate = flow->rate[slot];
    const float half = scene->half_length[slot];
    const window keep = look(scene, flow, slot, station, moves->y[0][slot], moves->station[0],
                             moves->v[0], dead_end_ahead(scene, flow, slot, station));
    const margins ks = margins_of(scene, &keep, half, moves->v[0][slot], 0.0f);
    const margins ac = margins_of(scene, &keep, half, moves->v[1][slot],
                                  (moves->station[1][slot] - station) * rate);
    const margins dc = margins_of(scene, &keep, half, moves->v[2][slot],
                                  (moves->station[2][slot] - station) * rate);
    uint32_t legal = fits(ks) ? 1u << VERGE_KEEP_SPEED : 0u;
    if (fits(ac) && moves->v[1][slot] <= flow->limit[slot]) {
        legal |= 1u << VERGE_ACCELERATE;
    }
    if (fits(dc) && flow->v[slot] > 0.0f) {
        legal |= 1u << VERGE_DECELERATE;
    }
    if (legal == 0) {
        legal = least_harm(ks, ac, dc);
    }
    if (may_set_off(scene, flow, moves, slot)) {
        legal |= 1u << VERGE_ACCELERATE;
    }
    moves->legal[slot] = (uint8_t)legal;
    moves->open[slot] = (uint8_t)changes_allowed(scene, flow, &keep, slot);
}

// ---------------------------------------------------------------------------- joint actions

static const uint8_t along_of[VERGE_ACTION_COUNT] = { 0, 1, 2, 0, 0 };
static const uint8_t across_of[VERGE_ACTION_COUNT] = { 0, 0, 0, 1, 2 };

// Does the straight way from (x0, y0) to (x1, y1) meet the box |x| < ex, |y| < ey? Exactly: only
// the box's two axes and the way's own normal could keep them apart.
static bool crosses(float x0, float y0, float x1, float y1, float ex, float ey)
{
    const float dx = x1 - x0, dy = y1 - y0;
    return least(x0, x1) < ex && most(x0, x1) > -ex && least(y0, y1) < ey && most(y0, y1) > -ey
           && fabs_of(x0 * dy - y0 * dx) <= ex * fabs_of(dy) + ey * fabs_of(dx);
}

// Where everyone is after these actions, before they settle on lanes.
typedef struct chosen {
    float station[VERGE_VEHICLES_MAX], y[VERGE_VEHICLES_MAX];
} chosen;

// An acceleration lane comes nearer to its neighbour by itself.
static void choose_moves(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                         const uint8_t* actions, chosen* restrict to)
{
    for (uint32_t i = 0; i < scene->count; ++i) {
        const uint8_t action = i < scene->controlled_count ? actions[i] : (uint8_t)VERGE_KEEP_SPEED;
        const float station = moves->station[along_of[action]][i];
        to->station[i] = station;
        to->y[i] = moves->y[across_of[action]][i] + flow->lean[i] * (station - flow->station[i]);
    }
}

// Do the ways of two vehicles that pass near each other come too close between the two instants?
// x0, x1: metres from i ahead to j. Relative motion is linear. Bodies that have less air than the
// margin already may go on without contact; bodies in contact may do all but press on.
static bool too_close(const vg_scene* scene, const vg_flow* flow, const chosen* to, uint32_t i, uint32_t j,
                      float x0, float x1)
{
    if (!scene->plain && to->station[i] <= scene->sight->touch[i][j]) {
        return false;
    }
    const float y0 = left_of(scene, i, j, flow->y[i], flow->y[j]);
    const float y1 = left_of(scene, i, j, to->y[i], to->y[j]);
    const float length = scene->half_length[i] + scene->half_length[j];
    const float width = scene->half_width[i] + scene->half_width[j];
    const float ex = length + joint_air_along, ey = width + joint_air_across;
    if (!scene->plain && flow->station[i] <= scene->sight->touch[i][j]) {
        // Their lanes come close in this step only: how near they were on one axis says nothing.
        return crosses(x0, y0, x1, y1, ex, ey);
    }
    if (fabs_of(x0) < length && fabs_of(y0) < width) {
        return fabs_of(x1) < length && fabs_of(y1) < width && fabs_of(x1) <= fabs_of(x0)
               && fabs_of(y1) <= fabs_of(y0);
    }
    if (fabs_of(x0) < ex && fabs_of(y0) < ey) {
        return crosses(x0, y0, x1, y1, length, width);
    }
    return crosses(x0, y0, x1, y1, ex, ey);
}

// Conflicts of slot i with the slots after it. Most pairs are settled by one being ahead of the
// other all the way.
INLINE uint32_t conflicts_after(const vg_scene* scene, const vg_flow* flow, const chosen* to, uint32_t i,
                                bool plain)
{
    const float* restrict before = flow->station;
    const float* restrict after = to->station;
    const float* restrict half_length = scene->half_length;
    const float rate = flow->rate[i], station0 = before[i], station1 = after[i];
    const float ex = half_length[i] + joint_air_along;
    const uint32_t count = scene->count;
    uint32_t conflicts = 0;
    for (uint32_t j = i + 1u; j < count; ++j) {
        const float x0 = plain ? (before[j] - station0) * rate
                               : ahead_of(scene, i, j, rate, station0, before[j]);
        const float x1 = plain ? (after[j] - station1) * rate
                               : ahead_of(scene, i, j, rate, station1, after[j]);
        const float reach = ex + half_length[j];
        if ((x0 >= reach && x1 >= reach) || (x0 <= -reach && x1 <= -reach)) {
            continue;
        }
        if (too_close(scene, flow, to, i, j, x0, x1)) {
            conflicts |= 1u << i | (j < scene->controlled_count ? 1u << j : 0u);
        }
    }
    return conflicts;
}

uint32_t vg_flow_conflicts(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                           const uint8_t* actions)
{
    uint32_t conflicts = 0;
    chosen to;
    choose_moves(scene, flow, moves, actions, &to);
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        conflicts |= scene->plain ? conflicts_after(scene, flow, &to, i, true)
                                  : conflicts_after(scene, flow, &to, i, false);
    }
    for (uint32_t i = 0; scene->road->conflict_lanes != 0 && i < scene->controlled_count; ++i) {
        for (uint32_t j = 0; j < scene->count; ++j) {
            if (i != j && areas_conflict(scene, flow, to.station, i, j)) {
                conflicts |= 1u << i;
            }
        }
    }
    return conflicts;
}

static bool sweeps(float from, float to, float half, float area_from, float area_to)
{
    return to + half > area_from && from - half < area_to;
}

// Two bodies in one area that is not a lane of either: whoever was in it before may leave.
static bool areas_conflict(const vg_scene* scene, const vg_flow* flow, const float* station1, uint32_t i,
                           uint32_t j)
{
    const verge_road* road = scene->road;
    const uint32_t lane_i = (uint32_t)flow->lane[i], lane_j = (uint32_t)flow->lane[j];
    if (!vg_road_has_conflicts(road, lane_i) || !vg_road_has_conflicts(road, lane_j)) {
        return false;
    }
    const float half_i = scene->half_length[i], half_j = scene->half_length[j];
    for (uint32_t k = 0; k < road->conflict_count; ++k) {
        const vg_conflict* area = &road->conflicts[k];
        if (area->lane != lane_i || area->other != lane_j) {
            continue;
        }
        const bool in_i = sweeps(flow->station[i], flow->station[i], half_i, area->from, area->to);
        const bool will_i = sweeps(flow->station[i], station1[i], half_i, area->from, area->to);
        const bool will_j =
            sweeps(flow->station[j], station1[j], half_j, area->other_from, area->other_to);
        if (!in_i && will_i && will_j) {
            return true;
        }
    }
    return false;
}

void vg_flow_advance(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                     const uint8_t* actions, vg_flow* next)
{
    for (uint32_t slot = 0; slot < scene->count; ++slot) {
        const uint8_t action = slot < scene->controlled_count ? actions[slot] : 0;
        next->station[slot] = moves->station[along_of[action]][slot];
        next->v[slot] = moves->v[along_of[action]][slot];
        next->y[slot] = moves->y[across_of[action]][slot];
        next->lane[slot] = flow->lane[slot];
        next->rate[slot] = flow->rate[slot];
        settle(scene, flow, next, slot, action);
    }
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        earn(scene, flow, moves, next, i, actions[i]);
    }
}

void vg_flow_follow(const vg_scene* scene, const vg_flow* flow, double dt, vg_flow* next)
{
    if (!scene->plain) {
        renew_sight(scene, flow);
    }
    memcpy(next, flow, sizeof *next);
    human_moves(scene, flow, (float)dt, next->station, next->v, next->y);
    for (uint32_t slot = scene->controlled_count; slot < scene->count; ++slot) {
        settle(scene, flow, next, slot, VERGE_KEEP_SPEED);
    }
}

void vg_flow_neighbours(const vg_scene* scene, const vg_flow* flow, uint32_t slot, int32_t* ahead,
                        int32_t* behind)
{
    float lead = 0.1f * nowhere, back = -0.1f * nowhere;
    *ahead = *behind = -1;
    if (!scene->plain) {
        renew_sight(scene, flow);
    }
    for (uint32_t j = 0; j < scene->count; ++j) {
        const float width = scene->half_width[slot] + scene->half_width[j] + path_air;
        const float dy = left_of(scene, slot, j, flow->y[slot], flow->y[j]);
        const float ds = ahead_of(scene, slot, j, 1.0f, flow->station[slot], flow->station[j]);
        if (fabs_of(dy) >= width || j == slot) {
            continue;
        }
        if (ds > 0.0f && ds < lead) {
            lead = ds;
            *ahead = (int32_t)j;
        } else if (ds <= 0.0f && ds > back) {
            back = ds;
            *behind = (int32_t)j;
        }
    }
}

// On to the lane that continues this one, or through it to a later one: lanes may be short.
static void pass_seams(const vg_scene* scene, vg_flow* next, uint32_t slot)
{
    const verge_road* road = scene->road;
    const vg_lane* lane = &road->lanes[next->lane[slot]];
    const int32_t target = slot < scene->controlled_count ? scene->target[slot] : -1;
    float beyond = (next->station[slot] - (float)lane->station_end) * next->rate[slot]; // [m]
    vg_walk walk = vg_walk_from(road, (uint32_t)next->lane[slot], target);
    while (beyond > 0.0f && vg_walk_on(&walk)) {
        next->lane[slot] = (int32_t)walk.lane;
        next->station[slot] = (float)vg_lane_station(&road->lanes[walk.lane], (double)beyond);
        beyond -= (float)road->lanes[walk.lane].length;
    }
}

// From (station, y) back to a lane and its d: over the border after a change, over the seam
// after a lane's end. y tells the move within the lane; the lane itself may lead aside.
static void settle(const vg_scene* scene, const vg_flow* flow, vg_flow* next, uint32_t slot,
                   uint8_t action)
{
    const verge_road* road = scene->road;
    const vg_lane* lane = &road->lanes[next->lane[slot]];
    const float station = next->station[slot];
    bin_place place = bin_of(lane, station);
    next->d[slot] = flow->d[slot] + (next->y[slot] - flow->y[slot]);
    if (action == VERGE_CHANGE_LEFT || action == VERGE_CHANGE_RIGHT) {
        const int32_t beside = action == VERGE_CHANGE_LEFT ? lane->left : lane->right;
        if (beside >= 0) {
            const bin_place there = bin_of(&road->lanes[beside], station);
            const float other = next->d[slot] + (centre_at(place) - centre_at(there));
            // Clearly beyond half the way: a partial change that ends on the border has not crossed.
            if (fabs_of(other) < fabs_of(next->d[slot]) - border_air) {
                next->lane[slot] = beside;
                next->d[slot] = other;
                lane = &road->lanes[beside];
                place = there;
            }
        }
    }
    if (!scene->plain && station > (float)lane->station_end) {
        pass_seams(scene, next, slot);
        place = bin_of(&road->lanes[next->lane[slot]], next->station[slot]);
    }
    note_place(next, slot, place);
}

// How near to the target a vehicle is that keeps to its lane's centre. [1] 0 .. 1
static float worth(const vg_scene* scene, const vg_flow* flow, uint32_t slot)
{
    return fabs_of(flow->d[slot]) <= reached_offset ? scene->nearness[slot][flow->lane[slot]] : 0.0f;
}

// Speed in parts of what the place asks for, see cruise_share; too fast is as bad. [1] 0 .. 1
static float pace_of(const vg_scene* scene, const vg_flow* flow, uint32_t slot)
{
    const float v = flow->v[slot], limit = flow->limit[slot];
    return v > limit ? limit / v : least(v, scene->cruise_share * limit) / (scene->cruise_share * limit);
}

// What setting out for another lane costs where it leaves less room than wanted. [1] 0 .. 1
static float tightness(const vg_scene* scene, const vg_flow* before, const vg_moves* moves, uint32_t slot,
                       uint8_t action)
{
    const float d = before->d[slot];
    if (along_of[action] != 0 || across_of[action] == 0 || d > centred || d < -centred) {
        return 0.0f;
    }
    const float room = moves->room[across_of[action] - 1u][slot];
    const float wanted = least(scene->change_gap_wanted, 2.0f * crawling_gap(scene, before->v[slot]));
    return room < wanted ? 1.0f - room / wanted : 0.0f;
}

static void earn(const vg_scene* scene, const vg_flow* before, const vg_moves* moves, vg_flow* next,
                 uint32_t slot, uint8_t action)
{
    const verge_planner_def* def = scene->def;
    const float share = 1.0f / (float)def->steps;
    float credit = before->credit[slot];
    float driven = 0.0f;
    credit += (float)def->reward_lane * share * worth(scene, next, slot) * pace_of(scene, next, slot);
    if (vg_flow_in_target(scene, next, slot)) {
        driven = before->driven[slot] + next->v[slot] * (float)def->step_s;
    }
    if (action == before->previous[slot] || before->previous[slot] == VERGE_ACTION_COUNT) {
        credit += (float)def->reward_consistency * share;
    }
    credit -= (float)def->reward_room * share * scene->care[slot]
              * tightness(scene, before, moves, slot, action);
    next->credit[slot] = credit;
    next->driven[slot] = driven;
    next->previous[slot] = action;
}

// ---------------------------------------------------------------------------- reward

bool vg_flow_in_target(const vg_scene* scene, const vg_flow* flow, uint32_t slot)
{
    const float d = flow->d[slot];
    return ((scene->good_lanes[slot] >> flow->lane[slot]) & 1u) != 0 && d <= reached_offset
           && d >= -reached_offset;
}

bool vg_flow_terminal(const vg_scene* scene, const vg_flow* flow)
{
    bool wanted = false;
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        if (scene->target[i] >= 0 && flow->driven[i] < (float)scene->def->target_distance) {
            return false;
        }
        wanted = wanted || scene->target[i] >= 0;
    }
    return wanted;
}

// A terminal flow drives on as it is: its remaining steps earn what the last one would.
double vg_flow_reward(const vg_scene* scene, const vg_flow* flow, uint32_t step, bool whole)
{
    const verge_planner_def* def = scene->def;
    VERGE_ASSERT(step <= def->steps);
    const double rest = (double)(def->steps - step) / (double)def->steps;
    double sum = 0.0;
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        double reward = (double)flow->credit[i];
        if (whole) {
            const double pace = (double)pace_of(scene, flow, i);
            reward += (def->reward_target + def->reward_lane * rest * pace) * (double)worth(scene, flow, i)
                      + def->reward_consistency * rest;
        }
        sum += (double)scene->weight[i] * reward;
    }
    return vg_clamp(sum, 0.0, 1.0);
}
