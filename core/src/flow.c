/// Moves of a whole flow, four vehicles side by side. See flow.h.

#include "flow.h"

#include "contract.h"
#include "scalar.h"

#include <string.h>

// Vectors are passed between static inline functions only; the ABI note does not concern us.
#pragma GCC diagnostic ignored "-Wpsabi"

typedef float   f4 __attribute__((vector_size(16)));
typedef int32_t i4 __attribute__((vector_size(16)));

#define INLINE static inline __attribute__((always_inline))

// Another vehicle counts as in the path when the bodies, with this much air, overlap laterally:
// 2.4 m between centres of two cars of 2 m, 0.6 lane widths, as findings/paper.md has it.
static const float path_air = 0.4f;
// Air that joint actions must leave between bodies on their ways. [m]
static const float joint_air_along = 1.0f;
static const float joint_air_across = 0.3f;
// Merging vehicles see each other from this far before their lanes come close. [m]
static const float merge_sight = 40.0f;
// Lanes passed in one step, at most: the end of the last one is waited for.
enum { seams_max = 8 };
// Beyond all roads: a vehicle that is not there, or not seen. [m]
static const float nowhere = 1e9f;
// Nearer by this to the next lane's centre a vehicle is on the next lane. [m]
static const float border_air = 0.1f;
// Within this of a lane's centre a change of lane starts from that lane. [m]
static const float centred = 0.3f;
// Paper, section 4: lane changes are planned for steps of 1.5 s, half a lane each.
static const float change_step_s = 1.5f;
// A lane change is not steeper than one in two (d per s).
static const float change_slope = 0.5f;
// A leader this near, and slower than this share of the pace below which steps earn less, is
// worth a change away from the target. [m], [1]
static const float overtake_sight = 60.0f;
static const float overtake_pace = 0.7f;
// Reached: the contract's |d| for "in the target lane". [m]
static const float reached_offset = 0.5f;

static void  lookup(const vg_scene* scene, vg_flow* flow, uint32_t slot);
static void  renew_sight(const vg_scene* scene, const vg_flow* flow);
static void  longitudinal_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);
static void  lateral_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);
static void  human_moves(const vg_scene* scene, const vg_flow* flow, float dt, float* station_to,
                         float* v_to, float* y_to);
static void  speed_windows(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t block);
static void  settle(const vg_scene* scene, const vg_flow* flow, vg_flow* next, uint32_t slot,
                    uint8_t action);
static void  earn(const vg_scene* scene, const vg_flow* before, vg_flow* next, uint32_t slot,
                  uint8_t action);
static bool  areas_conflict(const vg_scene* scene, const vg_flow* flow, const float* station1, uint32_t i,
                            uint32_t j);

INLINE f4 splat(float x)
{
    return (f4){ x, x, x, x };
}
INLINE f4 load(const float* from)
{
    f4 x;
    memcpy(&x, from, sizeof x);
    return x;
}
INLINE void store(float* to, f4 x)
{
    memcpy(to, &x, sizeof x);
}
INLINE f4 choose(i4 mask, f4 yes, f4 no)
{
    return (f4)((mask & (i4)yes) | (~mask & (i4)no));
}
INLINE f4 magnitude(f4 x)
{
    return (f4)((i4)x & 0x7fffffff);
}
INLINE f4 least(f4 a, f4 b)
{
    return choose(a < b, a, b);
}
INLINE f4 most(f4 a, f4 b)
{
    return choose(a > b, a, b);
}

INLINE float fabs_of(float x)
{
    return x < 0.0f ? -x : x;
}
INLINE bool any_of(i4 mask)
{
    uint64_t halves[2];
    memcpy(halves, &mask, sizeof halves);
    return (halves[0] | halves[1]) != 0;
}

// ---------------------------------------------------------------------------- scene

static void place(vg_scene* scene, vg_flow* flow, const verge_vehicle* vehicle, const vg_placed* at,
                  uint32_t input_index, uint32_t slot)
{
    const vg_lane* lane = &scene->road->lanes[at->lane];
    scene->input_index[slot] = input_index;
    scene->half_length[slot] = (float)(0.5 * vehicle->length + vehicle->margin);
    scene->half_width[slot] = (float)(0.5 * vehicle->width + vehicle->margin);
    scene->cruise[slot] = (float)vg_max(vg_max(lane->speed_limit, vehicle->speed), 1.0);
    flow->station[slot] = (float)vg_lane_station(lane, at->s);
    flow->d[slot] = (float)at->d;
    flow->v[slot] = (float)vehicle->speed;
    flow->lane[slot] = (int32_t)at->lane;
}

static void intend(vg_scene* scene, const verge_vehicle* vehicle, uint32_t slot)
{
    const verge_road* road = scene->road;
    const int32_t target =
        vehicle->target_lane < 0 ? -1 : vg_road_lane_index(road, vehicle->target_lane);
    scene->target[slot] = target;
    uint64_t good = target < 0 ? ~(uint64_t)0 : road->continues[target];
    for (uint32_t lane = 0; target >= 0 && lane < road->lane_count; ++lane) {
        if (road->changes[lane * road->lane_count + (uint32_t)target] == 0) {
            good |= (uint64_t)1 << lane;
        }
    }
    scene->good_lanes[slot] = good;
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

static void fill_empty_slots(vg_scene* scene, vg_flow* flow)
{
    const uint32_t padded = scene->block_count * VG_LANES;
    for (uint32_t slot = scene->count; slot < padded; ++slot) {
        flow->station[slot] = flow->d[slot] = flow->v[slot] = 0.0f;
        flow->y[slot] = flow->left_gap[slot] = flow->right_gap[slot] = 0.0f;
        flow->rate[slot] = 1.0f;
        flow->lane[slot] = 0;
        scene->half_length[slot] = scene->half_width[slot] = scene->cruise[slot] = 1.0f;
    }
    for (uint32_t slot = 0; slot < VERGE_VEHICLES_MAX; ++slot) {
        scene->self[slot] = (float)slot;
        scene->sight->lane[slot] = -1;
    }
}

void vg_scene_from(vg_scene* scene, vg_flow* flow, const verge_planner_def* def, const verge_road* road,
                   vg_sight* sight, const verge_vehicle* vehicles, const vg_placed* placed,
                   uint32_t vehicle_count, const uint8_t* previous)
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
                flow->previous[slot] =
                    previous[i] < VERGE_ACTION_COUNT ? previous[i] : (uint8_t)VERGE_KEEP_SPEED;
                scene->controlled_count++;
            }
        }
    }
    VERGE_ASSERT(scene->controlled_count <= VERGE_CONTROLLED_MAX);
    scene->block_count = (scene->count + VG_LANES - 1) / VG_LANES;
    for (uint32_t lane = 0; lane < road->lane_count; ++lane) {
        scene->limit[lane] = (float)road->lanes[lane].speed_limit;
        scene->limit_share[lane] = (float)(def->cruise_share * road->lanes[lane].speed_limit);
    }
    for (uint32_t k = 0; k < road->lane_count * road->lane_count; ++k) {
        scene->rings = scene->rings || road->relations[k].period > 0.0f;
    }
    weigh(scene, vehicles);
    fill_empty_slots(scene, flow);
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
    flow->left_gap[slot] = place.inside ? nearest->left_gap : 0.0f;
    flow->right_gap[slot] = place.inside ? nearest->right_gap : 0.0f;
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
    const vg_relation* relation = &road->relations[from * road->lane_count + to];
    const int32_t target = looker < scene->controlled_count ? scene->target[looker] : -1;
    const uint64_t route = road->on_route[from * (road->lane_count + 1u) + (uint32_t)(target + 1)];
    const bool visible = relation->kind != VG_UNRELATED && ((route >> to) & 1u) != 0;
    vg_sight* sight = scene->sight;
    sight->offset[seen][looker] = visible ? relation->offset : nowhere;
    sight->lateral[seen][looker] = relation->lateral;
    sight->touch[seen][looker] =
        relation->kind == VG_MERGING ? relation->touch : -nowhere;
    sight->period[seen][looker] = visible ? relation->period : 0.0f;
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

// Station of `seen` less that of the four lookers, on the lookers' axes. [m of station]
INLINE f4 ahead_by(const vg_scene* scene, float station, f4 lookers, uint32_t seen, uint32_t block)
{
    if (scene->plain) {
        return splat(station) - lookers;
    }
    const vg_sight* sight = scene->sight;
    f4 ds = splat(station) + load(&sight->offset[seen][block * VG_LANES]) - lookers;
    if (scene->rings) {
        const f4 period = load(&sight->period[seen][block * VG_LANES]);
        const f4 half = period * splat(0.5f);
        ds = choose((ds > half) & (period > splat(0.0f)), ds - period, ds);
        ds = choose((ds < -half) & (period > splat(0.0f)), ds + period, ds);
    }
    return ds;
}

INLINE f4 left_by(const vg_scene* scene, float y, f4 lookers, uint32_t seen, uint32_t block)
{
    const f4 dy = splat(y) - lookers;
    return scene->plain ? dy : dy + load(&scene->sight->lateral[seen][block * VG_LANES]);
}

// ---------------------------------------------------------------------------- moves

void vg_flow_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    if (!scene->plain) {
        renew_sight(scene, flow);
    }
    longitudinal_moves(scene, flow, moves);
    lateral_moves(scene, flow, moves);
    human_moves(scene, flow, (float)scene->def->step_s, moves->station[0], moves->v[0], moves->y[0]);
    for (uint32_t block = 0; block * VG_LANES < scene->controlled_count; ++block) {
        speed_windows(scene, flow, moves, block);
    }
}

// Table 1. A deceleration that reaches standstill stops there.
static void longitudinal_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    const float dt = (float)scene->def->step_s;
    const float gain = (float)scene->def->acceleration * dt;
    const float loss = (float)scene->def->deceleration * dt;
    for (uint32_t at = 0; at < scene->block_count * VG_LANES; at += VG_LANES) {
        const f4 v = load(&flow->v[at]);
        const f4 station = load(&flow->station[at]);
        const f4 per_metre = splat(1.0f) / load(&flow->rate[at]);
        const f4 v_dc = most(v - splat(loss), splat(0.0f));
        const f4 stopping = v * v * splat(0.5f * dt / loss);
        const f4 way_dc =
            choose(v < splat(loss), stopping, (v + v_dc) * splat(0.5f * dt));
        store(&moves->station[0][at], station + v * splat(dt) * per_metre);
        store(&moves->station[1][at], station + (v + splat(0.5f * gain)) * splat(dt) * per_metre);
        store(&moves->station[2][at], station + way_dc * per_metre);
        store(&moves->v[0][at], v);
        store(&moves->v[1][at], v + splat(gain));
        store(&moves->v[2][at], v_dc);
    }
}

// Keeping: back to the lane's centre. Changing: half the distance between two centrelines, and
// never past the next centre. d beyond `centred` on the far side: completing a change comes first.
static void lateral_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves)
{
    const float part = 0.5f * (float)scene->def->step_s / change_step_s;
    for (uint32_t at = 0; at < scene->block_count * VG_LANES; at += VG_LANES) {
        const f4 d = load(&flow->d[at]);
        const f4 y = load(&flow->y[at]);
        const f4 left = load(&flow->left_gap[at]);
        const f4 right = load(&flow->right_gap[at]);
        const f4 room = most(most(left, right), splat(3.0f)) * splat(part);
        const f4 keep = most(least(-d, room), -room);
        const f4 left_rest = choose(d < splat(-centred), -d, left - d);
        const f4 right_rest = choose(d > splat(centred), d, right + d);
        store(&moves->y[0][at], y + keep);
        store(&moves->y[1][at], y + least(left_rest, room));
        store(&moves->y[2][at], y - least(right_rest, room));
    }
}

INLINE f4 idm(const verge_planner_def* def, f4 v, f4 desired, f4 gap, f4 v_lead)
{
    const f4 closing = v * (v - v_lead) / splat((float)(2.0 * def->idm_comfort));
    const f4 s0 = splat((float)def->idm_gap);
    const f4 wanted = most(s0 + v * splat((float)def->idm_headway_s) + closing, s0);
    const f4 ratio = wanted / most(gap, splat(1.0f));
    const f4 pace = v / desired;
    const f4 pace2 = pace * pace;
    const f4 a = splat((float)def->idm_acceleration)
                 * (splat(1.0f) - pace2 * pace2 - ratio * ratio);
    return most(a, splat(-(float)def->idm_braking_max));
}

double vg_idm_acceleration(const verge_planner_def* def, double v, double desired, double gap, double v_lead)
{
    const double closing = v * (v - v_lead) / (2.0 * def->idm_comfort);
    const double wanted = vg_max(def->idm_gap + v * def->idm_headway_s + closing, def->idm_gap);
    const double ratio = wanted / vg_max(gap, 1.0);
    const double pace = v / desired;
    const double a =
        def->idm_acceleration * (1.0 - pace * pace * pace * pace - ratio * ratio);
    return vg_max(a, -def->idm_braking_max);
}

// KL: the IDM behind the nearest vehicle in the path, planned or not; the lane is kept as driven.
static void human_moves(const vg_scene* scene, const vg_flow* flow, float dt, float* station_to,
                        float* v_to, float* y_to)
{
    const uint32_t first = scene->controlled_count / VG_LANES;
    for (uint32_t block = first; block < scene->block_count; ++block) {
        const uint32_t at = block * VG_LANES;
        const f4 station = load(&flow->station[at]);
        const f4 y = load(&flow->y[at]);
        const f4 width = load(&scene->half_width[at]) + splat(path_air);
        f4 lead = splat(nowhere), lead_v = splat(0.0f), lead_half = splat(0.0f);
        for (uint32_t j = 0; j < scene->count; ++j) {
            const f4 ds = ahead_by(scene, flow->station[j], station, j, block);
            const f4 dy = left_by(scene, flow->y[j], y, j, block);
            i4 in = magnitude(dy) < width + splat(scene->half_width[j]);
            in &= (ds > splat(0.0f)) & (ds < lead);
            if (!scene->plain) {
                in &= station > load(&scene->sight->touch[j][at]) - splat(merge_sight);
            }
            lead = choose(in, ds, lead);
            lead_v = choose(in, splat(flow->v[j]), lead_v);
            lead_half = choose(in, splat(scene->half_length[j]), lead_half);
        }
        const f4 rate = load(&flow->rate[at]);
        const f4 v = load(&flow->v[at]);
        const f4 gap = lead * rate - lead_half - load(&scene->half_length[at]);
        const f4 free_road = lead > splat(0.5f * nowhere);
        const f4 a = idm(scene->def, v, load(&scene->cruise[at]), gap,
                         choose((i4)free_road, v, lead_v));
        const f4 wanted = v + a * splat(dt);
        const f4 v1 = most(wanted, splat(0.0f));
        // One who stops within the step goes no farther than to the stop.
        const f4 way = choose(wanted < splat(0.0f), v * v / (splat(-2.0f) * a),
                              (v + v1) * splat(0.5f * dt));
        const i4 human = load(&scene->self[at]) >= splat((float)scene->controlled_count);
        store(&station_to[at], choose(human, station + way / rate, load(&station_to[at])));
        store(&v_to[at], choose(human, v1, load(&v_to[at])));
        store(&y_to[at], choose(human, y, load(&y_to[at])));
    }
}

// Nearest vehicles ahead and behind in the path of one lateral option.
typedef struct window {
    f4 y;          // of the one who looks
    f4 gap_l, v_l; // [m] from its centre to the leader's tail, [m/s]
    f4 gap_f, v_f; // [m] from its centre to the follower's nose, [m/s]
} window;

// ds: metres ahead, centre to centre.
INLINE void look(window* w, f4 ds, f4 yj, i4 may, f4 width, float v, float half)
{
    const i4 in = may & (magnitude(yj - w->y) < width);
    const i4 fore = ds > splat(0.0f);
    const f4 gap = magnitude(ds) - splat(half);
    const i4 ahead = in & fore & (gap < w->gap_l);
    const i4 behind = in & ~fore & (gap < w->gap_f);
    w->gap_l = choose(ahead, gap, w->gap_l);
    w->v_l = choose(ahead, splat(v), w->v_l);
    w->gap_f = choose(behind, gap, w->gap_f);
    w->v_f = choose(behind, splat(v), w->v_f);
}

// Eq. 3: how far a new speed lies inside the window, >= 0 if it holds. Two margins: to the
// leader (upper bounds) and to the follower (lower bound). `way`: metres beyond KS.
typedef struct margins {
    f4 upper, lower;
} margins;

INLINE margins margins_of(const verge_planner_def* def, const window* w, f4 half, f4 v, f4 way)
{
    const f4 tau = splat((float)def->reaction_s);
    const f4 mth = splat((float)def->headway_s);
    const f4 per_reaction = splat(1.0f / (float)def->reaction_s);
    const f4 per_headway = splat(1.0f / (float)def->headway_s);
    const f4 per_both = splat(1.0f / (float)(def->reaction_s + def->headway_s));
    const f4 gap_l = w->gap_l - half - way;
    const f4 gap_f = w->gap_f - half + way;
    const f4 upper = least((mth * w->v_l + gap_l) * per_both, gap_l * per_reaction);
    const f4 lower = w->v_f - (gap_f - tau * w->v_f) * per_headway;
    return (margins){ upper - v, v - lower };
}

// The end of a lane that leads nowhere is a standing leader.
static float dead_end_ahead(const vg_scene* scene, const vg_flow* flow, uint32_t slot, float station)
{
    const vg_lane* lane = &scene->road->lanes[flow->lane[slot]];
    return lane->dead_end ? (float)lane->station_end - station : nowhere;
}

INLINE uint32_t bits_of(i4 mask, uint32_t lane)
{
    return mask[lane] != 0 ? 1u : 0u;
}

// Where nothing in the lane fits the window, the least harmful stays: brake for a leader, else
// make way for a follower. A vehicle always has a move.
static uint32_t least_harm(margins ks, margins ac, margins dc, uint32_t lane)
{
    if (ks.upper[lane] < 0.0f || dc.lower[lane] >= 0.0f) {
        return 1u << VERGE_DECELERATE;
    }
    return ac.upper[lane] >= 0.0f ? 1u << VERGE_ACCELERATE : 1u << VERGE_KEEP_SPEED;
}

// Borders, stretches and direction: changes lead towards the target, or around a slower leader.
static uint32_t changes_allowed(const vg_scene* scene, const vg_flow* flow, const window* keep, uint32_t slot)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const float d = flow->d[slot];
    const float left_gap = flow->left_gap[slot], right_gap = flow->right_gap[slot];
    const float room = left_gap > right_gap ? left_gap : right_gap;
    const float width = room > 0.0f ? room : 3.0f;
    if (flow->v[slot] * change_step_s * change_slope < 0.5f * width) {
        return 0; // too slow to get across
    }
    const bool finish_left = d < -centred;
    const bool finish_right = d > centred;
    bool left = finish_left || left_gap > 0.0f;
    bool right = finish_right || right_gap > 0.0f;
    const int32_t target = scene->target[slot];
    const int8_t way = target < 0 ? 0 : road->move[lane * road->lane_count + (uint32_t)target];
    const bool overtake = keep->gap_l[slot % VG_LANES] < overtake_sight
                          && keep->v_l[slot % VG_LANES] < overtake_pace * scene->limit_share[lane];
    if (!overtake) {
        left = left && (way > 0 || finish_left);
        right = right && (way < 0 || finish_right);
    }
    return (left ? 1u << VERGE_CHANGE_LEFT : 0u) | (right ? 1u << VERGE_CHANGE_RIGHT : 0u);
}

// What is in the path of up to two lateral options of four vehicles at t + 1: everyone's
// neighbours are taken at the same instant as the new state, planned ones at their present speed.
INLINE void look_round(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                       uint32_t block, window* first, window* second)
{
    const uint32_t at = block * VG_LANES;
    const f4 station = load(&moves->station[0][at]);
    const f4 now = load(&flow->station[at]);
    const f4 rate = load(&flow->rate[at]);
    const f4 half_width = load(&scene->half_width[at]) + splat(path_air);
    const f4 self = load(&scene->self[at]);
    for (uint32_t j = 0; j < scene->count; ++j) {
        const f4 ds = ahead_by(scene, moves->station[0][j], station, j, block) * rate;
        f4 yj = splat(flow->y[j]);
        i4 may = self != splat((float)j);
        if (!scene->plain) {
            yj += load(&scene->sight->lateral[j][at]);
            may &= now > load(&scene->sight->touch[j][at]) - splat(merge_sight);
        }
        const f4 width = half_width + splat(scene->half_width[j]);
        look(first, ds, yj, may, width, moves->v[0][j], scene->half_length[j]);
        if (second != NULL) {
            look(second, ds, yj, may, width, moves->v[0][j], scene->half_length[j]);
        }
    }
}

static window open_window(f4 y)
{
    return (window){ .y = y, .gap_l = splat(nowhere), .gap_f = splat(nowhere) };
}

// Which of four vehicles' changes fit the window on both sides of the border.
static uint32_t changes_that_fit(const vg_scene* scene, const vg_flow* flow, uint32_t block, uint32_t lane,
                                 const window* left, const window* right)
{
    const uint32_t at = block * VG_LANES;
    const f4 half = load(&scene->half_length[at]);
    const f4 v = load(&flow->v[at]);
    const margins lcl = margins_of(scene->def, left, half, v, splat(0.0f));
    const margins lcr = margins_of(scene->def, right, half, v, splat(0.0f));
    return (lcl.upper[lane] >= 0.0f && lcl.lower[lane] >= 0.0f ? 1u << VERGE_CHANGE_LEFT : 0u)
           | (lcr.upper[lane] >= 0.0f && lcr.lower[lane] >= 0.0f ? 1u << VERGE_CHANGE_RIGHT : 0u);
}

// The single pruning of section 3.1.3 for four vehicles.
static void speed_windows(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t block)
{
    const verge_planner_def* def = scene->def;
    const uint32_t at = block * VG_LANES;
    const uint32_t here = scene->controlled_count - at < VG_LANES ? scene->controlled_count - at
                                                                  : VG_LANES;
    const f4 station = load(&moves->station[0][at]);
    window keep = open_window(load(&moves->y[0][at]));
    for (uint32_t lane = 0; lane < here; ++lane) {
        keep.gap_l[lane] = dead_end_ahead(scene, flow, at + lane, station[lane]);
    }
    look_round(scene, flow, moves, block, &keep, NULL);
    const f4 rate = load(&flow->rate[at]);
    const f4 half = load(&scene->half_length[at]);
    const f4 v = load(&flow->v[at]);
    const f4 v_ac = load(&moves->v[1][at]);
    const f4 zero = splat(0.0f);
    const margins ks = margins_of(def, &keep, half, v, zero);
    const margins ac =
        margins_of(def, &keep, half, v_ac, (load(&moves->station[1][at]) - station) * rate);
    const margins dc = margins_of(def, &keep, half, load(&moves->v[2][at]),
                                  (load(&moves->station[2][at]) - station) * rate);
    uint32_t wanted[VG_LANES], any = 0;
    for (uint32_t lane = 0; lane < here; ++lane) {
        any |= wanted[lane] = changes_allowed(scene, flow, &keep, at + lane);
    }
    window left = keep, right = keep;
    if (any != 0) { // most states of a simulation want no change: half of the work is saved here
        left = open_window(load(&moves->y[1][at]));
        right = open_window(load(&moves->y[2][at]));
        look_round(scene, flow, moves, block, &left, &right);
    }
    const i4 ok_ks = (ks.upper >= zero) & (ks.lower >= zero);
    const i4 ok_ac = (ac.upper >= zero) & (ac.lower >= zero);
    const i4 ok_dc = (dc.upper >= zero) & (dc.lower >= zero) & (v > zero);
    for (uint32_t lane = 0; lane < here; ++lane) {
        const bool may_gain = v_ac[lane] <= scene->limit[flow->lane[at + lane]];
        uint32_t legal = bits_of(ok_ks, lane) << VERGE_KEEP_SPEED
                         | bits_of(ok_dc, lane) << VERGE_DECELERATE
                         | (may_gain ? bits_of(ok_ac, lane) << VERGE_ACCELERATE : 0u);
        if (legal == 0) {
            legal = least_harm(ks, ac, dc, lane);
        }
        if (wanted[lane] != 0) {
            legal |= wanted[lane]
                     & changes_that_fit(scene, flow, block, lane, &left, &right);
        }
        moves->legal[at + lane] = (uint8_t)legal;
    }
}

// ---------------------------------------------------------------------------- joint actions

typedef struct chosen {
    VG_ALIGNED float station[VERGE_VEHICLES_MAX];
    VG_ALIGNED float y[VERGE_VEHICLES_MAX];
} chosen;

static const uint8_t along_of[VERGE_ACTION_COUNT] = { 0, 1, 2, 0, 0 };
static const uint8_t across_of[VERGE_ACTION_COUNT] = { 0, 0, 0, 1, 2 };

static void choose_moves(const vg_scene* scene, const vg_moves* moves, const uint8_t* actions, chosen* to)
{
    const size_t bytes = scene->block_count * VG_LANES * sizeof(float);
    memcpy(to->station, moves->station[0], bytes);
    memcpy(to->y, moves->y[0], bytes);
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        to->station[i] = moves->station[along_of[actions[i]]][i];
        to->y[i] = moves->y[across_of[actions[i]]][i];
    }
}

// Does the straight way from (x0, y0) to (x1, y1) meet the box |x| < ex, |y| < ey? Exactly: only
// the box's two axes and the way's own normal could keep them apart.
INLINE i4 crosses(f4 x0, f4 y0, f4 x1, f4 y1, f4 ex, f4 ey)
{
    const f4 dx = x1 - x0, dy = y1 - y0;
    const i4 along = (least(x0, x1) < ex) & (most(x0, x1) > -ex);
    const i4 across = (least(y0, y1) < ey) & (most(y0, y1) > -ey);
    const f4 reach = ex * magnitude(dy) + ey * magnitude(dx);
    return along & across & (magnitude(x0 * dy - y0 * dx) <= reach);
}

// Do the ways of four vehicles and vehicle j come too close between the two instants? Relative
// motion is linear. Bodies that have less air than the margin already may go on without contact;
// bodies in contact may do all but press on.
INLINE i4 too_close(const vg_scene* scene, const vg_flow* flow, const chosen* to, uint32_t block, uint32_t j)
{
    const uint32_t at = block * VG_LANES;
    const f4 rate = load(&flow->rate[at]);
    const f4 ds0 = ahead_by(scene, flow->station[j], load(&flow->station[at]), j, block) * rate;
    const f4 ds1 = ahead_by(scene, to->station[j], load(&to->station[at]), j, block) * rate;
    const f4 length = load(&scene->half_length[at]) + splat(scene->half_length[j]);
    const f4 ex = length + splat(joint_air_along);
    const i4 passing = (ds0 > splat(0.0f)) ^ (ds1 > splat(0.0f));
    if (!any_of((magnitude(ds0) < ex) | (magnitude(ds1) < ex) | passing)) {
        return passing; // far apart all the way: none
    }
    const f4 dy0 = left_by(scene, flow->y[j], load(&flow->y[at]), j, block);
    const f4 dy1 = left_by(scene, to->y[j], load(&to->y[at]), j, block);
    const f4 width = load(&scene->half_width[at]) + splat(scene->half_width[j]);
    const f4 ey = width + splat(joint_air_across);
    const i4 inside = (magnitude(ds0) < ex) & (magnitude(dy0) < ey);
    const i4 touching = (magnitude(ds0) < length) & (magnitude(dy0) < width);
    const i4 pressing = (magnitude(ds1) < length) & (magnitude(dy1) < width)
                        & (magnitude(ds1) <= magnitude(ds0)) & (magnitude(dy1) <= magnitude(dy0));
    i4 hit = (touching & pressing)
             | (~touching & inside & crosses(ds0, dy0, ds1, dy1, length, width))
             | (~inside & crosses(ds0, dy0, ds1, dy1, ex, ey));
    if (!scene->plain) {
        hit &= load(&to->station[at]) > load(&scene->sight->touch[j][at]);
    }
    return hit & (load(&scene->self[at]) != splat((float)j));
}

uint32_t vg_flow_conflicts(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                           const uint8_t* actions)
{
    chosen to;
    choose_moves(scene, moves, actions, &to);
    uint32_t conflicts = 0;
    for (uint32_t block = 0; block * VG_LANES < scene->controlled_count; ++block) {
        i4 hit = (i4){ 0 };
        for (uint32_t j = 0; j < scene->count; ++j) {
            hit |= too_close(scene, flow, &to, block, j);
        }
        for (uint32_t lane = 0; lane < VG_LANES; ++lane) {
            conflicts |= bits_of(hit, lane) << (block * VG_LANES + lane);
        }
    }
    conflicts &= scene->controlled_count < 32 ? (1u << scene->controlled_count) - 1u : ~0u;
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
    if (((road->conflict_lanes >> lane_i) & (road->conflict_lanes >> lane_j) & 1u) == 0) {
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
    const size_t bytes = scene->block_count * VG_LANES * sizeof(float);
    memcpy(next->station, moves->station[0], bytes);
    memcpy(next->y, moves->y[0], bytes);
    memcpy(next->v, moves->v[0], bytes);
    memcpy(next->lane, flow->lane, scene->block_count * VG_LANES * sizeof next->lane[0]);
    memcpy(next->rate, flow->rate, bytes);
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        next->station[i] = moves->station[along_of[actions[i]]][i];
        next->v[i] = moves->v[along_of[actions[i]]][i];
        next->y[i] = moves->y[across_of[actions[i]]][i];
    }
    for (uint32_t slot = 0; slot < scene->count; ++slot) {
        settle(scene, flow, next, slot, slot < scene->controlled_count ? actions[slot] : 0);
    }
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        earn(scene, flow, next, i, actions[i]);
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
    const uint32_t block = slot / VG_LANES, lane = slot % VG_LANES;
    const f4 station = load(&flow->station[block * VG_LANES]);
    const f4 y = load(&flow->y[block * VG_LANES]);
    float lead = 0.1f * nowhere, back = -0.1f * nowhere;
    *ahead = *behind = -1;
    if (!scene->plain) {
        renew_sight(scene, flow);
    }
    for (uint32_t j = 0; j < scene->count; ++j) {
        const float ds = ahead_by(scene, flow->station[j], station, j, block)[lane];
        const float dy = left_by(scene, flow->y[j], y, j, block)[lane];
        const float width = scene->half_width[slot] + scene->half_width[j] + path_air;
        if (j == slot || dy >= width || dy <= -width) {
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
    for (uint32_t seams = 0; seams < seams_max && beyond > 0.0f; ++seams) {
        const uint32_t here = (uint32_t)next->lane[slot];
        const int32_t on = road->next[here * (road->lane_count + 1u) + (uint32_t)(target + 1)];
        if (on < 0) {
            return;
        }
        next->lane[slot] = on;
        next->station[slot] = (float)vg_lane_station(&road->lanes[on], (double)beyond);
        beyond -= (float)road->lanes[on].length;
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

static void earn(const vg_scene* scene, const vg_flow* before, vg_flow* next, uint32_t slot, uint8_t action)
{
    const verge_planner_def* def = scene->def;
    const float share = 1.0f / (float)def->steps;
    float credit = before->credit[slot];
    float driven = 0.0f;
    if (vg_flow_in_target(scene, next, slot)) {
        const float pace = next->v[slot] / scene->limit_share[next->lane[slot]];
        credit += (float)def->reward_lane * share * (pace < 1.0f ? pace : 1.0f);
        driven = before->driven[slot] + next->v[slot] * (float)def->step_s;
    }
    if (action == before->previous[slot]) {
        credit += (float)def->reward_consistency * share;
    }
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
        if (whole && vg_flow_in_target(scene, flow, i)) {
            const double pace = (double)(flow->v[i] / scene->limit_share[flow->lane[i]]);
            reward += def->reward_target + def->reward_lane * rest * vg_min(pace, 1.0);
        }
        if (whole) {
            reward += def->reward_consistency * rest;
        }
        sum += (double)scene->weight[i] * reward;
    }
    return vg_clamp(sum, 0.0, 1.0);
}
