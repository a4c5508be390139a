/// Who passes a conflict area before whom. One total order (the rank) holds for all vehicles of a
/// scene and for all areas, so the order has no circle. It is made at the start of a decision and
/// stays the same during the search; vg_order_wall() says where a vehicle has to stop for it.
///
/// Areas       Lanes that cross or part (vg_conflict), lanes that lead to a common lane (merge), and
///             the ends of lanes beside others (zipper.c). Each vehicle has a route: its lane and
///             the lanes that continue it towards its target. Two routes share an area where one
///             crosses or joins the other.
/// Rank        By the time of arrival (rank.c), with these exceptions, which are facts or rules:
///             a leader before its follower; a vehicle in an area, or one that cannot stop before
///             it, before others; an uncontrolled vehicle before one that would not clear the
///             area early enough. Priority rules delay the time of arrival. A vehicle keeps its
///             first time of arrival while it waits, so waiting longer means to be earlier.
///             An uncontrolled vehicle that has to wait, by priority or a signal, is expected to
///             do so unless it comes near without braking, and as long as the planned one can
///             still stop gently itself. Once it was doubted it has to show that it waits.
/// Waiting     A vehicle waits before an area until all vehicles with a lower rank have left it. It
///             also waits before a crossing while there is no room for it beyond (the box stays
///             clear), and before a ring that it would fill completely. A ring that it meets at an
///             angle it enters 0.5 s after a planned body, 1 s after another one. Whoever else is
///             there, it waits before a signal and stops at a stop sign (stops.c).
///
/// The order cannot lock controlled vehicles that stand:
///             (1) The rank is total, and each vehicle waits for lower ranks only, so among
///             vehicles that wait for an area there is one that waits for nobody: the one of
///             lowest rank.
///             (2) It could still be held by a vehicle of higher rank that stands in its area or
///             behind it. That vehicle entered with room beyond the area, so it drives out. A
///             vehicle without room beyond its area ranks after all others, so nobody waits for
///             it.
///             (3) On a ring each vehicle is behind another one. Entering leaves a free place of
///             one vehicle on it; this place moves backwards round the ring, and all vehicles
///             move. Hence some vehicle moves while any waits. Vehicles and areas are finite, so
///             all get through. Outside causes remain: an uncontrolled vehicle, an obstacle, a
///             signal, a full exit. vg_order_reason() names them. Facts can contradict one
///             another where vehicles begin inside areas: then progress.c finds the circle and
///             puts one vehicle first.
///             Limit: a before b in one area and b before a in another cannot be expressed.
#ifndef VG_ORDER_H
#define VG_ORDER_H

#include "traffic/flow.h"
#include "verge/decision.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    VG_LEGS_MAX = VG_WALK_LANES + 1, ///< lanes of a route
    VG_SHARES_MAX = 48,              ///< areas that one vehicle shares with others
    VG_PAIR_SHARES_MAX = 2,          ///< areas that it shares with one other
    VG_BOXES_MAX = 3,                ///< crossings of one route that are kept clear
};

typedef enum vg_share_kind {
    VG_SHARE_CROSS, ///< bodies on both stretches can touch: one passes after the other
    VG_SHARE_MERGE, ///< both lead to a common lane: one follows the other
    VG_SHARE_PART,  ///< both come from a common lane: one follows the other until they have parted
    VG_SHARE_ZIP,   ///< one of them is on a lane that ends beside the lane of the other
} vg_share_kind;

/// One lane of a route. Positions on a route are metres from where the vehicle is at the root.
typedef struct vg_route_leg {
    int32_t lane;         ///< index
    float   begin, scale; ///< [m], [1] position = begin + station * scale
} vg_route_leg;

/// An area that the routes of two vehicles share, as one of them sees it.
typedef struct vg_share {
    float    enter, leave;             ///< [m] on the own route
    float    other_enter, other_leave; ///< [m] on the route of the other
    uint16_t lane, other_lane;         ///< indices
    uint8_t  other;                    ///< slot
    uint8_t  kind;                     ///< vg_share_kind
    bool     steep;                    ///< a merge into a ring, where bodies meet at an angle
} vg_share;

/// A front waits this far before an area. [m]
#define VG_STOP_BEFORE 1.5f
/// The same where lanes merge: at a small angle they are close before bodies can touch. [m]
#define VG_STOP_BEFORE_MERGE 3.0f
static inline float vg_share_margin(const vg_share* share)
{
    return share->kind == VG_SHARE_CROSS ? VG_STOP_BEFORE : VG_STOP_BEFORE_MERGE;
}

/// A stretch of a route on which nobody should stop: crossings with no room to stop between them.
typedef struct vg_box {
    float enter, leave; ///< [m] on the route
    int32_t exit_lane;  ///< index of the lane at its end
} vg_box;

/// The traffic signal of a lane of a route.
typedef struct vg_light {
    float    line;   ///< [m] stop line on the route
    float    wait;   ///< [m] where the front waits for it
    float    change; ///< [s] from the root to its next change, VG_FAR_AWAY: not known
    uint16_t lane;   ///< index
    uint8_t  state;  ///< verge_signal_state at the root
    bool     passes; ///< the slot does not stop for this state: it cannot any more
} vg_light;
enum { VG_LIGHTS_MAX = 2 }; ///< of a route; those beyond are found later

typedef struct vg_course {
    vg_route_leg legs[VG_LEGS_MAX];
    vg_box   boxes[VG_BOXES_MAX];
    vg_light lights[VG_LIGHTS_MAX];
    uint8_t  leg_count, box_count, light_count;
    uint8_t  share_count, bind_count; ///< the first bind_count shares are with lower ranks
    uint16_t sign_lane;  ///< index of the lane of the first stop sign
    float    sign;       ///< [m] where the front waits at that sign, VG_FAR_AWAY: there is none
    float    red;        ///< [m] line of the first signal that stops it at the root, VG_FAR_AWAY:
                         ///< none
    float    red_opens;  ///< [s] from the root until that one opens, VG_FAR_AWAY: not known
    float    ring_enter; ///< [m] where the route joins a ring, VG_FAR_AWAY: nowhere
    int32_t  ring_lane;  ///< index of the lane there
    int64_t  stopped;    ///< [us] since when it stands at its sign, 0: it did not stop there
} vg_course;

typedef struct vg_order {
    uint32_t   vehicles_max, shares_max; ///< shares_max: of one vehicle
    uint32_t   slots;      ///< of the scene; 0: no order is needed
    bool       believes;   ///< with beliefs about those that are not planned
    bool       of_humans;  ///< made by a simulator, to move the uncontrolled vehicles
    vg_course* courses;    ///< [vehicles_max]
    vg_share*  shares;     ///< [vehicles_max][shares_max] by own position, binding ones first
    uint64_t*  before;     ///< [vehicles_max] slots (bits) that pass a shared area first; before
                           ///< there are ranks: those that have to, at the ends of lanes
    uint64_t*  cedes;      ///< [vehicles_max] slots (bits) on merging lanes that this one need not
                           ///< follow: they go after it
    uint8_t*   rank;       ///< [vehicles_max] 0: first
    float*     insists;    ///< [vehicles_max] [1] weight of VERGE_INSISTS
    uint64_t*  through;    ///< [VERGE_LANES_NEAR_MAX] slots (bits) whose route has a near lane
    uint32_t   reordered;  ///< circles found in this scene: see progress.c
    uint32_t   unstuck;    ///< vehicles found that stand without a cause
    uint64_t   blocked;    ///< slots (bits) of these
    uint64_t   helped;     ///< slots (bits) that go first because nobody moved
    uint64_t   signs;      ///< slots (bits) that have yet to stop at a stop sign
} vg_order;

/// Takes the arrays of an order of vehicles_max vehicles. Nothing stays in them from scene to
/// scene. order: null with a measuring arena.
void vg_order_take(vg_order* order, vg_arena* arena, uint32_t vehicles_max);

/// The order of a scene, from the arrival times kept in `turns` (may be null: nothing is kept).
/// It becomes model->order.
/// beliefs: about the uncontrolled vehicles, updated here; null: what they do now counts alone.
void vg_order_from(vg_order* order, vg_model* model, const vg_flow* flow, const verge_scene* scene,
                   verge_turns* turns, verge_beliefs* beliefs);
/// The order that a decision states: its passes are kept, the rest is by arrival.
void vg_order_decided(vg_order* order, vg_model* model, const vg_flow* flow,
                      const verge_scene* scene, const verge_decision* decision);

/// Distance from the slot's centre along its lane to the point where its front has to stop [m];
/// VG_FAR_AWAY: nowhere. Negative where the front is past that point. A vehicle that cannot stop
/// there any more has no such point, so a legal action remains.
float vg_order_wall(const vg_model* model, const vg_flow* flow, uint32_t slot);

/// The same with its cause: what the wall is, and the slot that is waited for, -1 none.
typedef struct vg_wall {
    float     distance; ///< [m]
    verge_why why;
    int32_t   slot;     ///< -1 none
    int32_t   lane;     ///< index, -1 none
    float     opens;    ///< [s] from the flow until a red signal opens, VG_FAR_AWAY: not known
} vg_wall;
vg_wall vg_order_wall_why(const vg_model* model, const vg_flow* flow, uint32_t slot);
/// The distance to the wall that there were without traffic signals.
float vg_order_wall_beyond(const vg_model* model, const vg_flow* flow, uint32_t slot);

/// Would slot i enter an area between two flows while a slot of lower rank is in it?
/// station1: stations after the step.
bool vg_order_conflict(const vg_model* model, const vg_flow* flow, const float* station1,
                       uint32_t i);

/// Need slot i follow slot j, where their lanes merge further on?
static inline bool vg_order_cedes(const vg_order* order, uint32_t i, uint32_t j)
{
    return order != NULL && order->slots > 0 && (order->cedes[i] >> j & 1u) != 0;
}

/// What a slot waits for, now or soon; VERGE_WHY_NONE: for nothing that the order knows.
verge_cause vg_order_reason(const vg_model* model, const vg_flow* flow, const verge_scene* scene,
                            uint32_t slot);

/// Does the slot go first because nobody moved? It drives on wherever it can.
static inline bool vg_order_helps(const vg_order* order, uint32_t slot)
{
    return order != NULL && order->slots > 0 && (order->helped >> slot & 1u) != 0;
}

/// The areas ahead of a slot and whom it passes them after. Returns their number.
uint32_t vg_order_passes(const vg_model* model, const verge_scene* scene, uint32_t slot,
                         verge_pass passes[VERGE_PASSES_MAX]);

/// Position of a slot on its route [m]; -VG_FAR_AWAY where it has left it.
float vg_order_position(const vg_model* model, const vg_flow* flow, uint32_t slot);

/// Is there room for the slot behind the first crossing ahead of it? True within one.
bool vg_order_has_room(const vg_order* order, const vg_model* model, const vg_flow* flow,
                       uint32_t slot);

// ---------------------------------------------------------------------------- shared

/// Position on a route [m] of a station of one of its lanes, and of the start of that lane.
static inline float vg_on_leg(const vg_route_leg* leg, float station)
{
    return leg->begin + station * leg->scale;
}
static inline float vg_leg_start(const vg_route_leg* leg, const verge_road* road)
{
    return vg_on_leg(leg, (float)road->lanes[leg->lane].station_start);
}

/// Adds an area to those of a slot. Where there are more than VG_SHARES_MAX, or more than
/// VG_PAIR_SHARES_MAX with one other, the nearest ones are kept.
void vg_order_share(vg_order* order, uint32_t slot, const vg_share* share);

// ---------------------------------------------------------------------------- progress.c

/// Finds vehicles that stand for 3 s in a circle or without a cause, and notes in their turns that
/// they go first from the next scene on.
void vg_order_watch(vg_order* order, const vg_model* model, const vg_flow* flow,
                    const verge_scene* scene, verge_turns* turns);

/// The turn of a vehicle, null: it has none, or turns is null.
verge_turn* vg_turn_of(verge_turns* turns, int32_t id);

// ---------------------------------------------------------------------------- stops.c

/// Finds the signals and the stop sign on the route of a slot. turns: who has stopped, or null.
void vg_order_find_stops(vg_order* order, const vg_model* model, const vg_flow* flow,
                         const verge_scene* scene, uint32_t slot, verge_turns* turns);
/// Notes in a flow who stands at its stop sign. Call it for each new flow.
void vg_order_note_stops(const vg_model* model, vg_flow* flow);
/// Has the slot yet to stop at a stop sign?
bool vg_order_stops_first(const vg_order* order, const vg_flow* flow, uint32_t slot);
/// Has the slot to stop at a line ahead, at the speed that it has?
bool vg_order_stops_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot);
/// Distance to the line of a signal that stops the slot up to the horizon; 0: there is none. [m]
float vg_order_to_red(const vg_model* model, const vg_flow* flow, uint32_t slot);
/// Takes the wall of a signal or of a stop sign, if it is nearer. signals: false: of signs alone.
/// A slot that has stopped at a sign waits at its line, and not again before the area behind it.
void vg_order_stop_wall(const vg_model* model, const vg_flow* flow, uint32_t slot, float r,
                        bool signals, vg_wall* wall);

// ---------------------------------------------------------------------------- zipper.c

/// Distance in which a vehicle of this speed stops with comfortable braking after one decision
/// step: so far one may follow it. [m]
static inline float vg_order_stopping(const vg_model* model, float v)
{
    static const float braking = 2.0f; // [m/s^2]
    return v <= 0.0f ? 0.0f : v * (float)model->def->step_s + v * v / (2.0f * braking);
}

/// Adds the sequences at the ends of lanes.
void vg_order_zip(vg_order* order, const vg_model* model, const vg_flow* flow);
/// The wall behind a vehicle in the lane beside that goes first: where a vehicle that follows it
/// would stop, but never so near that more than light braking is needed. VG_FAR_AWAY: none. [m]
float vg_order_zip_wall(const vg_model* model, const vg_flow* flow, uint32_t slot, uint32_t first);

// ---------------------------------------------------------------------------- rank.c

/// Does the slot have to yield in an area that begins there on its route, by its lane's priority?
bool vg_order_yields(const vg_order* order, const vg_model* model, uint32_t slot, float enter);

/// Distance from the front of a slot that is not planned to the line at which it has to stop, or to
/// let a planned one go, by the rules of the road. VG_FAR_AWAY: there is none. [m]
float vg_order_line_to_yield(const vg_order* order, const vg_model* model, uint32_t slot);

/// Gives each slot its rank. decision: passes to keep, or null.
void vg_order_rank(vg_order* order, const vg_model* model, const vg_flow* flow,
                   const verge_scene* scene, verge_turns* turns, const verge_decision* decision);

#ifdef __cplusplus
}
#endif

#endif
