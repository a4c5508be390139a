/// The traffic model: all vehicles of a scene at one decision instant, in single precision, and
/// what stays the same while joint actions move them on.
///
/// Layout      Structure of arrays, the controlled vehicles first. Who is ahead, behind or beside
///             is a scan of a few arrays that stay in the first cache: cheaper than an index up to
///             the 64 vehicles there can be, and than vectors of four, whose selections cost more
///             than the branches they save. The same bits on every machine.
#ifndef VG_FLOW_H
#define VG_FLOW_H

#include "base/arena.h"
#include "base/contract.h"
#include "road/road.h"
#include "verge/scene.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VG_ALIGNED __attribute__((aligned(16)))

/// Value of a lane from which n changes lead to the target: this / n. The paper rewards the
/// target lane only; then no vehicle would set out for a lane that lies beyond the horizon. [1]
#define VG_VALUE_ONE_CHANGE 0.25
/// Within this of a lane's centre a lane change starts from that lane. [m]
#define VG_CENTRED 0.3f
/// A target lane counts as reached within this of its centre. [m]
#define VG_REACHED_OFFSET 0.5f
/// Beyond all roads: a vehicle that is absent or not related. [m]
#define VG_FAR_AWAY 1e9f

static_assert(VERGE_VEHICLES_MAX <= 64 && VERGE_LANES_MAX <= 64, "sets are 64-bit masks");

/// All vehicles at one instant. Slots 0 .. controlled_count - 1 are controlled.
typedef struct vg_flow {
    VG_ALIGNED float station[VERGE_VEHICLES_MAX]; ///< [m] on the axis of the lane's bundle
    VG_ALIGNED float d[VERGE_VEHICLES_MAX];       ///< [m] from the lane's centre
    VG_ALIGNED float v[VERGE_VEHICLES_MAX];       ///< [m/s]
    int32_t lane[VERGE_VEHICLES_MAX];             ///< index
    // What the road is like there, looked up once per state.
    VG_ALIGNED float y[VERGE_VEHICLES_MAX];         ///< [m] on the bundle's lateral axis
    VG_ALIGNED float rate[VERGE_VEHICLES_MAX];      ///< [1] metres of lane per metre of station
    VG_ALIGNED float slope[VERGE_VEHICLES_MAX];     ///< [1] change of the lane's y per metre of station
    VG_ALIGNED float left_gap[VERGE_VEHICLES_MAX];  ///< [m] to the left lane's centre, 0: no change
    VG_ALIGNED float right_gap[VERGE_VEHICLES_MAX]; ///< [m]
    VG_ALIGNED float limit[VERGE_VEHICLES_MAX];     ///< [m/s] to drive there, see vg_bin
    // What the controlled vehicles have earned so far.
    float   credit[VERGE_CONTROLLED_MAX];   ///< [1] of lane and consistency parts of R_i
    float   driven[VERGE_CONTROLLED_MAX];   ///< [m] in the target lane
    uint8_t previous[VERGE_CONTROLLED_MAX]; ///< action that led here; VERGE_ACTION_COUNT: none yet
} vg_flow;

/// How one vehicle appears on the axes of an observing one.
typedef struct vg_pair {
    float offset;  ///< [m] add to the other's station
    float lateral; ///< [m] add to the other's y
    float touch;   ///< [m] see vg_relation
    float period;  ///< [m] see vg_relation
} vg_pair;

/// All pairs of vehicles. Kept from step to step; only rows and columns of vehicles that changed lane
/// are computed again.
typedef struct vg_pairs {
    uint32_t stride; ///< vehicles in a row
    vg_pair* of;     ///< [observer * stride + other]
    int32_t* lane;   ///< [stride] the lanes it was made for, -1 none
} vg_pairs;

/// Takes the pairs of vehicles_max vehicles; null where they do not fit or the arena is measuring.
vg_pairs* vg_pairs_take(vg_arena* arena, uint32_t vehicles_max);

/// What stays the same during a search.
typedef struct vg_model {
    const verge_planner_def* def;
    const verge_road* road;
    uint32_t count, controlled_count;
    bool     single_axis; ///< one bundle, no successors, no conflicts: stations compare as they are
    bool     rings;   ///< some relation has a period
    uint32_t input_index[VERGE_VEHICLES_MAX];  ///< in the step's sorted vehicles
    VG_ALIGNED float half_length[VERGE_VEHICLES_MAX]; ///< [m] with margin
    VG_ALIGNED float half_width[VERGE_VEHICLES_MAX];  ///< [m] with margin
    VG_ALIGNED float cruise[VERGE_VEHICLES_MAX];      ///< [m/s] the IDM's desired speed
    VG_ALIGNED float braking[VERGE_VEHICLES_MAX];     ///< [m/s^2] the IDM's hardest
    float    gain[VERGE_CONTROLLED_MAX];       ///< [m/s] of AC in a step, as the body can
    float    loss[VERGE_CONTROLLED_MAX];       ///< [m/s] of DC in a step
    float    stop[VERGE_CONTROLLED_MAX];       ///< [s^2/m] distance of a stop by DC over speed squared
    float    speed_max[VERGE_CONTROLLED_MAX];  ///< [m/s] of the body; no AC beyond
    double   acceleration[VERGE_CONTROLLED_MAX]; ///< [m/s^2] of AC
    double   back[VERGE_VEHICLES_MAX];         ///< [m] the middle of vehicle and trailer lies behind
                                               ///< the vehicle's; the flow's stations are the middle's
    int32_t  target[VERGE_CONTROLLED_MAX];     ///< lane index, -1 none
    uint64_t target_lanes[VERGE_CONTROLLED_MAX]; ///< lanes that count as the target lane
    float    lane_value[VERGE_CONTROLLED_MAX][VERGE_LANES_MAX]; ///< [1] 1 on a target lane, less before it
    float    gap_weight[VERGE_CONTROLLED_MAX]; ///< [1] of the penalty for a lane change with a small gap
    float    weight[VERGE_CONTROLLED_MAX];     ///< [1] of R_i in X_flow, Eq. 5; they sum to <= 1
    float    cruise_share;                     ///< [1]
    float    reaction, headway;                       ///< [s] Eq. 2
    float    change_gap, change_gap_wanted;           ///< [m]
    float    per_reaction, per_headway, per_both;     ///< [1/s] inverses of these and of their sum
    vg_pairs* pairs;
} vg_model;

/// Model and first flow of a scene. Bit i of `planned`: vehicles[i] has actions of its own (one of the
/// first slots); all other vehicles are predicted. Vehicles off the road take no part.
void vg_model_from(vg_model* model, vg_flow* flow, const verge_planner_def* def, vg_pairs* pairs,
                   const verge_scene* scene, uint64_t planned);

/// The controlled vehicles of a scene (bits).
uint64_t vg_scene_controlled(const verge_scene* scene);

/// From now on uncontrolled vehicles want to drive at their lane's limit, as the IDM has it; before,
/// they go on as measured. For simulators.
void vg_model_free_humans(vg_model* model, const vg_flow* flow);

/// How many bodies a vehicle has: 2 with a trailer, else 1.
uint32_t vg_body_count(const verge_vehicle* vehicle);
uint32_t vg_scene_bodies(const verge_scene* scene);

/// s [m] of a vehicle's own centre on its lane; that of the flow's stations where it has no trailer.
static inline double vg_flow_s(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    return vg_lane_s(lane, (double)flow->station[slot]) + model->back[slot];
}

/// Looks up the derived fields of all slots after their station, d, v or lane were set.
void vg_flow_derive(const vg_model* model, vg_flow* flow);

/// y of a lane's centre at a station [m].
float vg_lane_lateral(const vg_lane* lane, float station);

// ---------------------------------------------------------------------------- shared by traffic/

#define VG_INLINE static inline __attribute__((always_inline))

VG_INLINE float vg_fabsf(float x) { return x < 0.0f ? -x : x; }
VG_INLINE float vg_minf(float a, float b) { return a < b ? a : b; }
VG_INLINE float vg_maxf(float a, float b) { return a > b ? a : b; }

/// Where a station falls among a lane's bins, held at the ends.
typedef struct vg_bin_place {
    const vg_bin* here;
    float t;      ///< [1] from this bin to the next
    bool  inside; ///< not beyond the lane's ends
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
    flow->y[slot] = vg_bin_centre(place) + flow->d[slot];
    flow->rate[slot] = vg_bin_rate(place);
    flow->slope[slot] = place.inside ? (place.here[1].lateral - place.here[0].lateral) * (float)(1.0 / VG_BIN)
                                    : 0.0f;
    flow->left_gap[slot] = place.inside ? nearest->left_gap : 0.0f;
    flow->right_gap[slot] = place.inside ? nearest->right_gap : 0.0f;
    flow->limit[slot] = vg_minf(place.here[0].speed, place.here[1].speed);
}

#ifdef __cplusplus
}
#endif

#endif
