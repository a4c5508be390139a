/// The traffic model: the states of all vehicles of a scene at one decision instant (vg_flow), in
/// single precision, and the quantities that stay constant during a search (vg_model).
///
/// Layout      Structure of arrays, the controlled vehicles first. The nearest vehicles are found
///             by a scan of a few arrays that stay in the first-level cache. For up to 64 vehicles
///             this is faster than an index. It is also faster than vectors of four, whose
///             selections cost more than the branches they save. The results are the same on every
///             machine.
#ifndef VG_FLOW_H
#define VG_FLOW_H

#include "base/arena.h"
#include "base/contract.h"
#include "road/local.h"
#include "verge/scene.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VG_ALIGNED __attribute__((aligned(16)))

/// Value of a lane that is n lane changes away from the target lane: this / n. The paper rewards
/// the target lane only. Then no vehicle would start towards a lane that it cannot reach within the
/// horizon. [1]
#define VG_VALUE_ONE_CHANGE 0.25
/// Largest |d| at which a vehicle counts as centred: a lane change starts from here. [m]
#define VG_CENTRED 0.3f
/// Largest |d| at which the target lane counts as reached. [m]
#define VG_REACHED_OFFSET 0.5f
/// Smallest desired speed: the IDM divides by it. [m/s]
#define VG_CRUISE_MIN 0.05f
/// A slower vehicle stands. [m/s]
#define VG_STANDING_SPEED 0.5f
/// Larger than any distance on a road: stands for an absent or unrelated vehicle. [m]
#define VG_FAR_AWAY 1e9f

static_assert(VERGE_VEHICLES_MAX <= 64, "sets of vehicles are 64-bit masks");

/// All vehicles at one instant. Slots 0 .. controlled_count - 1 are controlled.
typedef struct vg_flow {
    VG_ALIGNED float station[VERGE_VEHICLES_MAX]; ///< [m] on the axis of the lane's bundle
    VG_ALIGNED float d[VERGE_VEHICLES_MAX];       ///< [m] from the lane's centre
    VG_ALIGNED float v[VERGE_VEHICLES_MAX];       ///< [m/s] along the lane; uncontrolled vehicles
                                                  ///< may move against it: below 0
    int32_t lane[VERGE_VEHICLES_MAX];             ///< index
    // Properties of the road at each vehicle, looked up once per state.
    VG_ALIGNED float y[VERGE_VEHICLES_MAX];         ///< [m] on the bundle's lateral axis
    VG_ALIGNED float rate[VERGE_VEHICLES_MAX];      ///< [1] metres of lane per metre of station
    VG_ALIGNED float slope[VERGE_VEHICLES_MAX];     ///< [1] change of the lane's y with station
    VG_ALIGNED float left_gap[VERGE_VEHICLES_MAX];  ///< [m] to the left lane's centre, 0: no change
    VG_ALIGNED float right_gap[VERGE_VEHICLES_MAX]; ///< [m] to the right lane's centre
    VG_ALIGNED float limit[VERGE_VEHICLES_MAX];     ///< [m/s] speed limit there, see vg_bin
    float    t;       ///< [s] from the root
    uint64_t stopped; ///< slots (bits) that stood at their stop sign since the root
    // Rewards of the controlled vehicles so far.
    float   credit[VERGE_CONTROLLED_MAX];   ///< [1] of lane and consistency parts of R_i
    float   driven[VERGE_CONTROLLED_MAX];   ///< [m] in the target lane
    uint8_t previous[VERGE_CONTROLLED_MAX]; ///< action that led here; VERGE_ACTION_COUNT: none yet
} vg_flow;

/// Does a vehicle stand, and is it expected to go on? Controlled vehicles are never static.
typedef enum vg_standing {
    VG_MOVING = 0,
    VG_TEMPORARILY_STOPPED, ///< behind another one, before a junction or a lane's end, setting off
    VG_STATIC,              ///< without a cause, beside the lane's centre, across it or facing back
} vg_standing;

/// A static body that reaches into a lane, in the terms of that lane.
typedef struct vg_body_beside {
    int32_t lane;      ///< index
    float   from, to;  ///< [m] stations
    float   low, high; ///< [m] d of its sides
    bool    narrow;    ///< less than 1 m wide
} vg_body_beside;
enum { VG_BODIES_MAX = 32 }; ///< of a scene; more are not passed within the lane

/// Converts the station and y of another vehicle to the axes of the observing vehicle.
typedef struct vg_pair {
    float offset;  ///< [m] add to the other's station
    float lateral; ///< [m] add to the other's y
    float touch;   ///< [m] see vg_relation
    float period;  ///< [m] see vg_relation
} vg_pair;

/// All pairs of vehicles. They are kept from step to step; only rows and columns of vehicles that
/// changed lane are computed again.
typedef struct vg_pairs {
    uint32_t stride; ///< vehicles in a row
    vg_pair* of;     ///< [observer * stride + other]
    int32_t* lane;   ///< [stride] the lanes for which the pairs are valid, -1 none
    vg_local* local; ///< relations of the lanes near the vehicles
    uint32_t lanes_max; ///< of a road, 0: any
} vg_pairs;

/// Takes memory for the pairs of the vehicles and lanes of a def, without the scratch memory of
/// `local`. Null: they do not fit, or the arena is measuring.
vg_pairs* vg_pairs_take(vg_arena* arena, const verge_planner_def* def);

/// Does the road have no more lanes than the pairs were taken for?
static inline bool vg_pairs_hold(const vg_pairs* pairs, const verge_road* road)
{
    return pairs->lanes_max == 0 || road->lane_count <= pairs->lanes_max;
}

struct vg_value; // value.h

/// The quantities that stay constant during a search.
typedef struct vg_model {
    const verge_planner_def* def;
    const verge_road* road;
    uint32_t count, controlled_count;
    bool     best;        ///< BEST in comments: not VERGE_SEARCH_PAPER: drives as traffic does, not
                          ///< only as the paper's rules
    bool     single_axis; ///< one bundle, no successors, no conflicts: stations compare as they are
    bool     rings;   ///< some relation has a period
    bool     conflicts; ///< some lanes conflict
    uint32_t input_index[VERGE_VEHICLES_MAX];  ///< in the step's sorted vehicles
    VG_ALIGNED float half_length[VERGE_VEHICLES_MAX]; ///< [m] with margin
    VG_ALIGNED float half_width[VERGE_VEHICLES_MAX];  ///< [m] with margin
    VG_ALIGNED float cruise[VERGE_VEHICLES_MAX];      ///< [m/s] desired speed of the IDM
    /// [m/s^2] largest deceleration of the IDM. 0 of a vehicle that moves against its lane: it is
    /// expected to go on
    VG_ALIGNED float braking[VERGE_VEHICLES_MAX];
    bool     faces_back[VERGE_VEHICLES_MAX];   ///< the body points against its lane
    bool     turned[VERGE_VEHICLES_MAX];       ///< by more than 30 degrees to its lane
    uint8_t  standing[VERGE_VEHICLES_MAX];     ///< vg_standing, of the scene
    vg_body_beside bodies[VG_BODIES_MAX];      ///< see goal.h
    uint32_t body_count;                       ///< 0 in most scenes, and in that of the paper
    float    gain[VERGE_CONTROLLED_MAX];       ///< [m/s] speed gained by AC in a step
    float    loss[VERGE_CONTROLLED_MAX];       ///< [m/s] speed lost by DC in a step
    float    stop[VERGE_CONTROLLED_MAX];       ///< [s^2/m] stopping distance of DC over v squared
    float    speed_max[VERGE_CONTROLLED_MAX];  ///< [m/s] of the body; AC is not legal above it
    // Not of PAPER.
    float    braking_hard[VERGE_VEHICLES_MAX]; ///< [m/s^2] that the body can brake
    float    time_gap[VERGE_CONTROLLED_MAX];   ///< [s] to a vehicle ahead that verge does not plan
    const struct vg_value* value;              ///< value-to-go of the controlled vehicles, or null
    float    wrong_lane[VERGE_CONTROLLED_MAX];   ///< [1] cost of each second off the target lane
    float    loss_at_root[VERGE_CONTROLLED_MAX]; ///< [s] vg_flow_loss() without other vehicles
    double   acceleration[VERGE_CONTROLLED_MAX]; ///< [m/s^2] of AC
    /// [m] along the lane from the middle of vehicle and trailer to the centre of the vehicle,
    /// below 0 where it faces back. Stations of the flow are those of the middle.
    double   back[VERGE_VEHICLES_MAX];
    int32_t  target[VERGE_CONTROLLED_MAX];     ///< lane index, -1 none
    const vg_way* ways[VERGE_CONTROLLED_MAX];  ///< [lane] to the target, null: none
    uint8_t  column[VERGE_VEHICLES_MAX];       ///< of the target, see vg_local_matters()
    float    gap_weight[VERGE_CONTROLLED_MAX]; ///< [1] of the penalty for a change with a small gap
    float    weight[VERGE_CONTROLLED_MAX];     ///< [1] of R_i in X_flow, Eq. 5; the sum is <= 1
    float    cruise_share;                     ///< [1]
    float    reaction, headway;                       ///< [s] Eq. 2
    float    change_gap, change_gap_wanted;           ///< [m]
    float    per_reaction, per_headway, per_both;     ///< [1/s] 1 / reaction, 1 / headway, 1 / sum
    /// Uncontrolled slots (bits) that yield to nobody and pass red signals. None in a plan: the
    /// planner expects everybody to keep the rules; simulate.c sets it.
    uint64_t lawless;
    vg_pairs* pairs;
    struct vg_order* order; ///< who passes conflict areas first (order.h); null: nobody has said
} vg_model;

/// Model and first flow of a scene. Bit i of `controlled`: vehicles[i] has actions and takes one of
/// the first slots, if it moves along its lane. All other vehicles are predicted. Vehicles off the
/// road are left out.
void vg_model_from(vg_model* model, vg_flow* flow, const verge_planner_def* def, vg_pairs* pairs,
                   const verge_scene* scene, uint64_t controlled);

/// Does a scene hold what scene.h says of it? A caller may have filled it by hand.
bool vg_scene_holds(const verge_scene* scene);

/// The controlled vehicles of a scene (bits).
uint64_t vg_scene_controlled(const verge_scene* scene);

/// Can vehicles[i] be planned: is it on a lane, faces along it, and does not move backwards?
bool vg_scene_moves_along(const verge_scene* scene, uint32_t i);

/// Sets the desired speed of uncontrolled vehicles to the speed limit of their lane. Before this
/// call they continue as measured. For simulators.
void vg_model_free_humans(vg_model* model, const vg_flow* flow);

/// How many bodies a vehicle has: 2 with a trailer, else 1.
uint32_t vg_body_count(const verge_vehicle* vehicle);
uint32_t vg_scene_bodies(const verge_scene* scene);

/// s [m] of the centre of a vehicle, without its trailer, on its lane.
static inline double vg_flow_s(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    return vg_lane_s(lane, (double)flow->station[slot]) + model->back[slot];
}

/// Looks up the road fields of all slots. Call it after station, d, v or lane were set.
void vg_flow_derive(const vg_model* model, vg_flow* flow);

/// True if every slot is on a lane of the road with finite coordinates, controlled ones with a
/// speed of 0 or more: what each step of a search expects and leaves. For assertions and tests.
bool vg_flow_holds(const vg_model* model, const vg_flow* flow);

/// y of a lane's centre at a station [m].
float vg_lane_lateral(const vg_lane* lane, float station);

// ---------------------------------------------------------------------------- shared by traffic/

#define VG_INLINE static inline __attribute__((always_inline))

VG_INLINE float vg_fabsf(float x) { return x < 0.0f ? -x : x; }
VG_INLINE float vg_minf(float a, float b) { return a < b ? a : b; }
VG_INLINE float vg_maxf(float a, float b) { return a > b ? a : b; }

/// The place of a station among the bins of a lane. Stations beyond the ends are clamped.
typedef struct vg_bin_place {
    const vg_bin* here;
    float t;      ///< [1] fraction of the distance from this bin to the next
    bool  inside; ///< the station is within the lane
} vg_bin_place;

VG_INLINE vg_bin_place vg_bin_at(const vg_lane* lane, float station)
{
    const float at = (station - (float)lane->station_start) * (float)(1.0 / VG_BIN);
    const float last = (float)(lane->bin_count - 1u);
    VERGE_ASSERT(lane->bin_count >= 2 && at == at);
    const float clamped = at < 0.0f ? 0.0f : at > last ? last : at;
    uint32_t bin = (uint32_t)clamped;
    bin = bin > lane->bin_count - 2u ? lane->bin_count - 2u : bin;
    return (vg_bin_place){ &lane->bins[bin], clamped - (float)bin, at >= 0.0f && at <= last };
}

VG_INLINE float vg_bin_centre(vg_bin_place place)
{
    return place.here[0].lateral + place.t * (place.here[1].lateral - place.here[0].lateral);
}

/// [1] metres of lane per metre of station.
VG_INLINE float vg_bin_rate(vg_bin_place place)
{
    return (place.here[1].s - place.here[0].s) * (float)(1.0 / VG_BIN);
}

VG_INLINE void vg_flow_set_road_fields(vg_flow* flow, uint32_t slot, vg_bin_place place)
{
    const vg_bin* nearest = place.t < 0.5f ? place.here : place.here + 1;
    const float lateral_step = place.here[1].lateral - place.here[0].lateral;
    flow->y[slot] = vg_bin_centre(place) + flow->d[slot];
    flow->rate[slot] = vg_bin_rate(place);
    flow->slope[slot] = place.inside ? lateral_step * (float)(1.0 / VG_BIN) : 0.0f;
    flow->left_gap[slot] = place.inside ? nearest->left_gap : 0.0f;
    flow->right_gap[slot] = place.inside ? nearest->right_gap : 0.0f;
    flow->limit[slot] = vg_minf(place.here[0].speed, place.here[1].speed);
}

#ifdef __cplusplus
}
#endif

#endif
