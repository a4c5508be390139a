/// The flow: all vehicles at one decision instant, and how joint actions move it on.
///
/// Carried out here: the states [s, d, v] and the actions of Table 1, the safe distance and
/// speed window of Eq. 2 and 3, lane keeping (KL) of uncontrolled vehicles by the IDM, the
/// pruning of single and joint actions (section 3.1.3) and the three parts of R_i (3.1.4).
///
/// Layout      Structure of arrays, the vehicles planned first. Who is ahead, behind or beside is
///             a scan of a few arrays that stay in the first cache: cheaper than any index up to
///             the 64 vehicles there can be, and than vectors of four, whose selects cost more
///             than the branches they save. The same bits on every machine.
/// Cost        One step of 8 vehicles, 4 of them planned: see tools in README, verge-bench.
#ifndef VG_FLOW_H
#define VG_FLOW_H

#include "base/random.h"
#include "road/road.h"
#include "verge/planner.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VG_ALIGNED __attribute__((aligned(16)))

/// What a lane is worth from which n changes lead to the target: this / n. The paper rewards the
/// target lane only; then nobody would set out for one that lies beyond the horizon. [1]
#define VG_NEARNESS_ONE_CHANGE 0.25

static_assert(VERGE_VEHICLES_MAX <= 64 && VERGE_LANES_MAX <= 64, "sets are 64-bit masks");

/// All vehicles at one instant. Slots 0 .. controlled_count - 1 are planned.
typedef struct vg_flow {
    VG_ALIGNED float station[VERGE_VEHICLES_MAX]; ///< [m] on the axis of the lane's bundle
    VG_ALIGNED float d[VERGE_VEHICLES_MAX];       ///< [m] from the lane's centre
    VG_ALIGNED float v[VERGE_VEHICLES_MAX];       ///< [m/s]
    int32_t lane[VERGE_VEHICLES_MAX];             ///< index
    // What the road is like there, looked up once per state.
    VG_ALIGNED float y[VERGE_VEHICLES_MAX];         ///< [m] on the bundle's lateral axis
    VG_ALIGNED float rate[VERGE_VEHICLES_MAX];      ///< [1] metres of way per metre of station
    VG_ALIGNED float lean[VERGE_VEHICLES_MAX];      ///< [1] metres of y the lane goes aside a metre
    VG_ALIGNED float left_gap[VERGE_VEHICLES_MAX];  ///< [m] to the left lane's centre, 0: no change
    VG_ALIGNED float right_gap[VERGE_VEHICLES_MAX]; ///< [m]
    VG_ALIGNED float limit[VERGE_VEHICLES_MAX];     ///< [m/s] to drive there, see vg_bin
    // What the planned ones have earned so far.
    float   credit[VERGE_CONTROLLED_MAX];   ///< [1] of lane and consistency parts of R_i
    float   driven[VERGE_CONTROLLED_MAX];   ///< [m] in the target lane
    uint8_t previous[VERGE_CONTROLLED_MAX]; ///< action that led here; VERGE_ACTION_COUNT: none yet
} vg_flow;

/// What each vehicle could do from one flow. Uncontrolled ones have one move, in KS's place.
typedef struct vg_moves {
    VG_ALIGNED float station[3][VERGE_VEHICLES_MAX]; ///< after KS, AC, DC
    VG_ALIGNED float v[3][VERGE_VEHICLES_MAX];       ///< after KS, AC, DC
    VG_ALIGNED float y[3][VERGE_VEHICLES_MAX];       ///< keeping, changing left, changing right
    float   room[2][VERGE_CONTROLLED_MAX];           ///< [m] that a legal change left, right leaves
    uint8_t legal[VERGE_CONTROLLED_MAX];             ///< set of actions (bits), never empty
    uint8_t open[VERGE_CONTROLLED_MAX];              ///< changes (bits) wanted but not looked at yet
} vg_moves;

/// How each vehicle (column) appears on the axes of the one who looks (row). Kept
/// from step to step; only rows and columns of vehicles that changed lane are renewed.
typedef struct vg_sight {
    VG_ALIGNED float offset[VERGE_VEHICLES_MAX][VERGE_VEHICLES_MAX];  ///< [m] add to station
    VG_ALIGNED float lateral[VERGE_VEHICLES_MAX][VERGE_VEHICLES_MAX]; ///< [m] add to y
    VG_ALIGNED float touch[VERGE_VEHICLES_MAX][VERGE_VEHICLES_MAX];   ///< [m] see vg_relation
    VG_ALIGNED float period[VERGE_VEHICLES_MAX][VERGE_VEHICLES_MAX];  ///< [m] see vg_relation
    int32_t lane[VERGE_VEHICLES_MAX]; ///< the lanes it was made for, -1 none
} vg_sight;

/// What stays the same during a search.
typedef struct vg_scene {
    const verge_planner_def* def;
    const verge_road* road;
    uint32_t count, controlled_count;
    bool     plain;   ///< one bundle, no seams, no conflicts: stations compare as they are
    bool     rings;   ///< some relation has a period
    uint32_t input_index[VERGE_VEHICLES_MAX];  ///< in the step's sorted vehicles
    VG_ALIGNED float half_length[VERGE_VEHICLES_MAX]; ///< [m] with margin
    VG_ALIGNED float half_width[VERGE_VEHICLES_MAX];  ///< [m] with margin
    VG_ALIGNED float cruise[VERGE_VEHICLES_MAX];      ///< [m/s] the IDM's desired speed
    VG_ALIGNED float braking[VERGE_VEHICLES_MAX];     ///< [m/s^2] the IDM's hardest
    int32_t  target[VERGE_CONTROLLED_MAX];     ///< lane index, -1 none
    uint64_t good_lanes[VERGE_CONTROLLED_MAX]; ///< lanes that count as the target lane
    float    nearness[VERGE_CONTROLLED_MAX][VERGE_LANES_MAX]; ///< [1] 1 on a good lane, less before it
    float    care[VERGE_CONTROLLED_MAX];       ///< [1] how much it minds the room that its changes leave
    float    weight[VERGE_CONTROLLED_MAX];     ///< [1] of R_i in X_flow, Eq. 5; they sum to <= 1
    float    cruise_share;                     ///< [1]
    float    reaction, headway;                       ///< [s] Eq. 2
    float    change_gap, change_gap_wanted;           ///< [m]
    float    per_reaction, per_headway, per_both;     ///< [1/s] inverses of these and of their sum
    vg_sight* sight;
} vg_scene;

/// A vehicle placed on the road.
typedef struct vg_placed {
    bool     on_road;
    uint32_t lane;  ///< index
    double   s, d;  ///< [m] of the centre
} vg_placed;

/// Scene and first flow from vehicles sorted by id. Vehicles off the road take no part.
void vg_scene_from(vg_scene* scene, vg_flow* flow, const verge_planner_def* def, const verge_road* road,
                   vg_sight* sight, const verge_vehicle* vehicles, const vg_placed* placed,
                   uint32_t vehicle_count);

/// From now on uncontrolled ones want to drive at their lane's limit, as the IDM has it; before,
/// they go on as measured. For simulators.
void vg_scene_free_humans(vg_scene* scene, const vg_flow* flow);

/// Every vehicle's moves from here, each legal on its own; nothing is left open.
void vg_flow_moves(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);

/// The same, with the look into other lanes left for later: a simulation draws one action in a
/// handful, so most changes never need it.
void vg_flow_outline(const vg_scene* scene, const vg_flow* flow, vg_moves* moves);

/// Looks whether an open change is legal, and moves it to the legal ones if so.
bool vg_flow_may_change(const vg_scene* scene, const vg_flow* flow, vg_moves* moves, uint32_t slot,
                        uint8_t action);

/// Which planned vehicles (bits) would come too close to another on these actions' ways.
uint32_t vg_flow_conflicts(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                           const uint8_t* actions);

/// The flow after these actions; flow and next may not be the same.
void vg_flow_advance(const vg_scene* scene, const vg_flow* flow, const vg_moves* moves,
                     const uint8_t* actions, vg_flow* next);

/// Moves the uncontrolled ones on by dt [s], as KL; planned ones stay as they are.
void vg_flow_follow(const vg_scene* scene, const vg_flow* flow, double dt, vg_flow* next);

/// Slots of the nearest vehicles in the path of this one, -1 none.
void vg_flow_neighbours(const vg_scene* scene, const vg_flow* flow, uint32_t slot, int32_t* ahead,
                        int32_t* behind);

/// y of a lane's centre at a station [m].
float vg_lane_lateral(const vg_lane* lane, float station);

/// Looks up the derived fields of slots after their station, d, v or lane were set.
void vg_flow_derive(const vg_scene* scene, vg_flow* flow);

/// All have driven target_distance in their target lanes (or have no target).
bool vg_flow_terminal(const vg_scene* scene, const vg_flow* flow);

/// In its target lane (or one that continues it) and within 0.5 m of its centre.
bool vg_flow_in_target(const vg_scene* scene, const vg_flow* flow, uint32_t slot);

/// X_flow (Eq. 5) of a simulation that ended in this flow after `step` of def->steps steps.
/// whole: it ended well (horizon or terminal); else the remaining steps earn nothing.
double vg_flow_reward(const vg_scene* scene, const vg_flow* flow, uint32_t step, bool whole);

#ifdef __cplusplus
}
#endif

#endif
