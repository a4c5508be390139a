/// The first stage: the joint decision. It gives each controlled vehicle a sequence of actions.
///
///     verge_decider* decider;
///     verge_decider_init(&decider, &def, memory, verge_decider_memory_size(&def));
///     verge_decision decision = verge_decision_make(vehicles, 16);
///     static verge_commitment commitment; // all zero: there is no earlier decision
///     verge_decide(decider, &scene, &commitment, &decision);
///
/// A decision is plain data. The trajectory stage (trajectory.h) accepts a decision from
/// verge_decide(), from a message, or written by hand (apps/examples/own_decision.c).
///
/// Memory      The caller owns it; nothing is allocated. See verge_decider_memory_size().
/// Threads     One decider serves one thread at a time.
#ifndef VERGE_DECISION_H
#define VERGE_DECISION_H

#include "verge/scene.h"

#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/// One decision step of one vehicle: its action from t0 to t1 and the state expected at t1. A step
/// may have any length. Stages that read steps use action, lane, times, s, d, v and distance. The
/// rest informs people: it goes to the plan as it is, but the brake light is on also where the
/// trajectory brakes. In a plan the action of the present step, if it changes no lane, is the one
/// that its trajectory shows: more than 0.15 m/s^2 on average are accelerating or decelerating.
typedef struct verge_action_step {
    verge_action action;
    int32_t lane_id;        ///< the lane at t1
    double  t0, t1;         ///< [s] from the plan's utime
    double  s, d, v;        ///< [m], [m], [m/s] expected at t1, in lane_id
    double  distance;       ///< [m] driven along the lanes from t0 to t1
    bool    brake_light;
    int32_t turn_signal;    ///< -1 right, 0 none, 1 left
    int32_t ahead_id;       ///< nearest vehicle expected ahead in its path at t1, -1 none
    int32_t behind_id;      ///< nearest vehicle expected behind in its path at t1, -1 none
} verge_action_step;

/// Writes the step in words for a passenger ("changing to the right lane behind vehicle 3"): at
/// most size bytes, always null-terminated. Returns the length without the terminator.
size_t verge_action_say(const verge_action_step* step, char* text, size_t size);

/// Why a vehicle stands, waits, or does not make the lane change that it wants. Messages use the
/// same values. The comment says what vehicle and lane of a cause are.
typedef enum verge_why {
    VERGE_WHY_NONE = 0,         ///< nothing holds the vehicle back
    VERGE_WHY_LEADER = 1,       ///< vehicle: the one ahead, which stands or is slower
    VERGE_WHY_AREA = 2,         ///< vehicle: passes a conflict area first; lane: its lane there
    VERGE_WHY_EXIT = 3,         ///< no room behind a conflict area, which has to stay clear;
                                ///< vehicle: the last one there; lane: the one behind the area
    VERGE_WHY_MERGE = 4,        ///< vehicle: goes first where lanes merge, one by one; lane: its
                                ///< lane
    VERGE_WHY_LANE_END = 5,     ///< lane: it ends
    VERGE_WHY_SIGNAL = 6,       ///< lane: its signal is red or yellow, or about to be so
    VERGE_WHY_STOP_LINE = 7,    ///< lane: vehicles stop at its line before they go on
    VERGE_WHY_YIELD = 8,        ///< vehicle: has priority; lane: its lane
    VERGE_WHY_OBSTACLE = 9,     ///< vehicle: stands in the way without a cause, as a parked one
                                ///< does
    VERGE_WHY_ONCOMING = 10,    ///< vehicle: comes towards this one in its lane
    VERGE_WHY_HUMAN = 11,       ///< vehicle: nobody knows what this uncontrolled one will do
    VERGE_WHY_ROOM_AHEAD = 12,  ///< no change to the lane: too near behind the vehicle
    VERGE_WHY_ROOM_BEHIND = 13, ///< no change to the lane: too near ahead of the vehicle
    VERGE_WHY_BORDER = 14,      ///< no change to the lane: not allowed here
    VERGE_WHY_FREEZE = 15,      ///< no change to the lane: one has just ended or been given up
    VERGE_WHY_BEND = 16,        ///< lane: its bend is driven slowly
    VERGE_WHY_GAP = 17,         ///< vehicle: lets a gap open behind it, for a change to the lane
    VERGE_WHY_UNREACHABLE = 18, ///< lane: the target lane, which cannot be reached from here
    VERGE_WHY_BLOCKED = 19,     ///< stood without a cause, or in a circle of vehicles that waited
                                ///< for one another; vehicle: the one that it waited for
    VERGE_WHY_FALLBACK = 20,    ///< the plan is a fallback: no trajectory was acceptable
    VERGE_WHY_OFF_ROAD = 21,    ///< the vehicle is on no lane
} verge_why;
enum { VERGE_WHY_COUNT = 22 };

/// "leader", "area", ...: the word for a code in files; "??" for another value.
const char* verge_why_name(verge_why code);

/// A few words for a code ("no room behind it in the lane"), never null; static lifetime.
const char* verge_why_text(verge_why code);

/// A reason with the vehicle and the lane that it is about.
typedef struct verge_cause {
    verge_why code;
    int32_t   vehicle_id; ///< -1: none. Ignored with VERGE_WHY_NONE
    int32_t   lane_id;    ///< VERGE_NO_LANE: none. Ignored with VERGE_WHY_NONE
    int32_t   side;       ///< the lane runs on the left (1) or on the right (-1); 0: neither, or
                          ///< not known. For words
} verge_cause;

/// Writes a cause in words ("left lane: no room behind vehicle 7"): at most size bytes, always
/// null-terminated; nothing for VERGE_WHY_NONE. Returns the length without the terminator.
size_t verge_cause_say(const verge_cause* cause, char* text, size_t size);

/// One conflict area ahead of a vehicle, and the vehicle that passes it directly before.
typedef struct verge_pass {
    int32_t lane_id;       ///< lane of the vehicle there
    int32_t other_lane_id; ///< lane of the other vehicle there
    int32_t after_id;      ///< the other vehicle
} verge_pass;
enum { VERGE_PASSES_MAX = 4 };

/// The decision of one vehicle: consecutive steps; the first one starts at t0 = 0, each further one
/// where the one before ends (within 1e-6 s).
typedef struct verge_vehicle_decision {
    int32_t  vehicle_id;
    uint32_t step_count; ///< 1 .. VERGE_STEPS_MAX; together at least as long as a trajectory,
                         ///< (points - 1) * point_s, where one is planned
    verge_action_step steps[VERGE_STEPS_MAX];
    verge_cause why;                      ///< of waiting now, or of a change not made
    uint32_t    pass_count;               ///< 0 .. VERGE_PASSES_MAX
    verge_pass  passes[VERGE_PASSES_MAX]; ///< the nearest conflict areas, in the order of the way
} verge_vehicle_decision;

/// Statistics and result of the search.
typedef struct verge_search_report {
    uint32_t iterations;  ///< plans simulated: always the budget; with VERGE_SEARCH_POLICY 1 or 2,
                          ///< and at most 25 for each vehicle that these leave in a conflict or
                          ///< off its target lane
    uint32_t nodes;       ///< nodes created; this to unexpanded: 0 without a tree
    uint32_t nodes_first; ///< nodes created before the returned plan was found for the first time
    uint32_t depth;       ///< depth of the deepest node
    uint32_t pruned;      ///< joint actions rejected because of a conflict
    uint32_t unexpanded;  ///< iterations without a new node because the pool was full
    double   reward;      ///< [1] X_flow of the returned plan, in [0, 1] (Eq. 5)
    double   bound;       ///< [1] upper bound of X_flow for all plans of this cycle
    uint32_t conflicts;   ///< controlled vehicles that the returned plan leaves in a conflict with
                          ///< somebody at some step; 0: a joint plan without conflict was found
    bool     complete;    ///< all vehicles with a target lane are in it at the end of the plan
} verge_search_report;

/// The joint decision. The caller owns the arrays.
typedef struct verge_decision {
    int64_t  utime;                    ///< [us] instant t = 0 of all steps, as in the scene
    uint32_t vehicle_count;            ///< controlled vehicles on the road
    uint32_t vehicles_max;             ///< length of `vehicles`
    verge_vehicle_decision* vehicles;  ///< ascending ids
    verge_search_report search;        ///< zero where no search was made
    uint32_t reordered;                ///< circles of standing vehicles that got a new order
    uint32_t unstuck;                  ///< vehicles that stood without a cause, and go first now
} verge_decision;

/// An empty decision. vehicles: vehicles_max elements, which must outlive the decision.
static inline verge_decision verge_decision_make(verge_vehicle_decision* vehicles,
                                                 uint32_t vehicles_max)
{
    verge_decision decision;
    memset(&decision, 0, sizeof decision);
    decision.vehicles_max = vehicles_max;
    decision.vehicles = vehicles;
    return decision;
}

/// The decision of a vehicle, null if there is none. Valid as long as the array of the decision.
static inline const verge_vehicle_decision* verge_decision_of(const verge_decision* decision,
                                                              int32_t vehicle_id);

/// When a vehicle first expected to arrive at a conflict area, and since when it does not use its
/// turn there.
typedef struct verge_turn {
    int32_t vehicle_id;
    int64_t arrival;  ///< [us]
    int64_t standing; ///< [us] 0: it does not stand, or it is not its turn
    int64_t still;    ///< [us] since when it stands, for whatever reason; 0: it moves
    int64_t helped;   ///< [us] since when it goes first because nobody moved; 0: it does not
    int64_t stopped;  ///< [us] since when it stands, or stood, at a stop sign; 0: it did not
    int32_t stop_lane_id; ///< the lane of that sign
    bool    doubted;  ///< it is let go first until it shows that it waits
} verge_turn;

/// Who waits for conflict areas. Who comes first goes first, so this is kept from step to step.
typedef struct verge_turns {
    uint32_t   count;
    verge_turn of[VERGE_VEHICLES_MAX];
} verge_turns;

/// What an uncontrolled vehicle may be about to do. One that does not speed up, yield or insist
/// follows its lane and whom it has ahead.
typedef enum verge_hypothesis {
    VERGE_KEEPS_ON = 0,
    VERGE_SPEEDS_UP,
    VERGE_YIELDS,       ///< brakes for the line before an area in which it has to let others go
    VERGE_INSISTS,      ///< has to, and does not
    VERGE_CHANGES_LANE, ///< moves to a lane beside
} verge_hypothesis;
enum { VERGE_HYPOTHESIS_COUNT = 5 };

/// "keeps_on", "speeds_up", "yields", "insists", "changes_lane"; "??" for another value.
const char* verge_hypothesis_name(verge_hypothesis hypothesis);

/// How likely each hypothesis is, by what the vehicle did lately.
typedef struct verge_belief {
    int32_t vehicle_id;
    int64_t utime;                            ///< [us] of the last update
    double  speed;                            ///< [m/s] along its lane, then
    float   weights[VERGE_HYPOTHESIS_COUNT];  ///< [1] sum 1
    float   expected[VERGE_HYPOTHESIS_COUNT]; ///< [m/s^2] acceleration from then on
} verge_belief;

typedef struct verge_beliefs {
    uint32_t     count;
    verge_belief of[VERGE_VEHICLES_MAX];
} verge_beliefs;

/// Rounds the numbers of a decision to those that a plan message can hold: times to whole
/// milliseconds, upwards; d to millimetres; s, v and distance to single precision. Who plans from
/// rounded numbers and who plans from the message get the same trajectory, bit for bit.
/// verge_planner_step() rounds its decision. A number that is not finite stays as it is.
void verge_decision_round(verge_decision* decision);

/// The last decision. The next one keeps its lane changes unless a better plan gains more than
/// verge_planner_def.switch_margin. Zero-filled: there is no earlier decision. The caller keeps it
/// from step to step; verge_decide() reads and replaces it. A commitment with counts beyond the
/// capacities is ignored.
typedef struct verge_commitment {
    uint64_t decisions;     ///< decisions made so far; each uses its own random stream
    int64_t  utime;         ///< [us] instant at which the actions below were decided first
    uint32_t step_count, vehicle_count;
    int32_t  vehicle_ids[VERGE_CONTROLLED_MAX];
    uint8_t  actions[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX]; ///< verge_action
    verge_turns turns;
    verge_beliefs beliefs;
    /// Vehicles that have been in their target lane. They may leave it to overtake.
    uint32_t reached_count;
    int32_t  reached_ids[VERGE_CONTROLLED_MAX], reached_targets[VERGE_CONTROLLED_MAX];
} verge_commitment;

typedef struct verge_decider verge_decider;

/// Size of the memory for verge_decider_init() [B]; 0 if the def is not valid. It grows with
/// nodes_max, vehicles_max, controlled_max and road.lane_count (def.h). With VERGE_SEARCH_POLICY
/// nodes_max does not count.
size_t verge_decider_memory_size(const verge_planner_def* def);

/// Builds a decider in the caller's memory, which must be aligned to 64 bytes. The def is copied.
/// @retval VERGE_ERR_DEF, VERGE_ERR_CONFIG, VERGE_ERR_MEMORY  *decider is null
verge_status verge_decider_init(verge_decider** decider, const verge_planner_def* def, void* memory,
                                size_t size);

/// Decides joint actions (section 3.1 of the paper; verge_planner_def.search says how) for all
/// controlled vehicles of the scene that are on the road. The result depends on the arguments and
/// the def only.
/// @retval VERGE_ERR_CAPACITY  more vehicles than the def or the decision holds; nothing is changed
/// @retval VERGE_ERR_CONFIG    the caller was compiled with other capacities; nothing is changed
/// @retval VERGE_ERR_ARGUMENT  a null pointer, or the scene is not as scene.h says
static inline verge_status verge_decide(verge_decider* decider, const verge_scene* scene,
                                        verge_commitment* commitment, verge_decision* decision);
verge_status verge_decide_for(uint64_t config, verge_decider* decider, const verge_scene* scene,
                              verge_commitment* commitment, verge_decision* decision);

/// Largest number of nodes of all searches so far, and size of a node in the last search [B]; 0
/// where there is no tree.
void verge_decider_nodes(const verge_decider* decider, uint32_t* nodes_peak,
                         uint32_t* bytes_per_node);

// Compiled by the caller, with the sizes that the caller sees.

static inline verge_status verge_decide(verge_decider* decider, const verge_scene* scene,
                                        verge_commitment* commitment, verge_decision* decision)
{
    return verge_decide_for(VERGE_CONFIG, decider, scene, commitment, decision);
}

static inline const verge_vehicle_decision* verge_decision_of(const verge_decision* decision,
                                                              int32_t vehicle_id)
{
    const bool any = decision != NULL && decision->vehicles != NULL;
    const uint32_t count = any ? decision->vehicle_count : 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (decision->vehicles[i].vehicle_id == vehicle_id) {
            return &decision->vehicles[i];
        }
    }
    return NULL;
}

#ifdef __cplusplus
}
#endif

#endif
