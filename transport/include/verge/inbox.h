/// The latest state of every vehicle, extrapolated to the instant of a plan.
///
///     inbox_init(&inbox, &limits, vehicles_max, controlled_max);
///     inbox_offer_from(&inbox, &message.as.state, source, utime_now, road); // each message
///     inbox_snapshot(&inbox, plan_utime, &view);                // once a cycle
///     verge_planner_step(planner, plan_utime, view.vehicles, view.count, &plan);
///
/// Unknown     A target lane that the road does not have costs a vehicle its target only. A state
///             without heading or speed (NaN) is used with the last ones known, else with the
///             direction of the lane and standing; its vehicle is an obstacle and gets no plan.
/// Isolation   A refused message changes only a counter: the vehicle keeps its last accepted state
///             until that is too old, and no other vehicle is affected.
/// Senders     On each bus an id belongs to the first sender that uses it, until that sender is
///             silent for obstacle_ms. Senders of different buses are not compared: the same
///             vehicle may send on two buses.
/// Memory      All in the struct (about 20 KiB); nothing allocates.
/// Threads     One at a time.
/// Time        No clock is read. The same offers and snapshots in the same order give the same
///             views, bit for bit, so a recording of accepted states repeats the run.
#ifndef VERGE_INBOX_H
#define VERGE_INBOX_H

#include "verge/road.h"
#include "verge/transport.h"
#include "verge/wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The daemon's "freshness" object; names, units, ranges and meaning: inbox_params().
/// An age is the plan's instant minus the state's utime; each limit belongs to the younger class.
typedef struct inbox_limits {
    double fresh_ms;          ///< [ms] up to this age a state is used and its vehicle planned
    double obstacle_ms;       ///< [ms] then an obstacle with obstacle_margin_m, not planned
    double drop_ms;           ///< [ms] then one with old_margin_m; beyond this age forgotten
    double future_ms;         ///< [ms] a state further ahead of the local clock is refused
    double obstacle_margin_m; ///< [m]  on every side of the body
    double old_margin_m;      ///< [m]
    double jump_m;            ///< [m]  further than this from every reachable position: another
                              ///<      vehicle with the same id
} inbox_limits;

inbox_limits inbox_default_limits(void);

/// One field of inbox_limits, for programs that read them by name. All are doubles.
typedef struct inbox_param {
    const char* name;     ///< the field's name, also the JSON key
    const char* unit;
    size_t      offset;   ///< in inbox_limits
    double      min, max; ///< both inclusive
    const char* text;     ///< one sentence
} inbox_param;

/// The table of all fields, in the order of the struct. Static lifetime.
const inbox_param* inbox_params(uint32_t* count);

/// Null: the limits are in their ranges and in order. Otherwise the field that is not.
const char* inbox_limits_check(const inbox_limits* limits);

/// The result for an offered state. The rules are checked in the order of this list.
typedef enum inbox_verdict {
    INBOX_ACCEPTED = 0,
    INBOX_VERSION,       ///< a protocol_version that this program does not know
    INBOX_OUT_OF_RANGE,  ///< by wire_state_check()
    INBOX_FUTURE,        ///< utime more than future_ms ahead
    INBOX_STALE,         ///< older than drop_ms on arrival
    INBOX_ID_TAKEN,      ///< same id from another sender of the same bus; the first one keeps it
                         ///< until its last state is older than obstacle_ms
    INBOX_DUPLICATE,     ///< same utime and position as the stored state
    INBOX_OUT_OF_ORDER,  ///< older than the stored state
    INBOX_ID_CONFLICT,   ///< same id, but a body that cannot be the same one (jump_m)
    INBOX_OFF_MAP,       ///< its centre lies on no lane; not checked for vehicles of inbox_placed()
    INBOX_OVER_CAPACITY, ///< a new vehicle, and no slot is free or forgotten
    INBOX_OTHER_MAP,     ///< a signal of another road; a state of one is accepted, see
                         ///< inbox_set_map()
} inbox_verdict;

/// The rx_ fields of rsu_status_t. The bus counts rx_malformed and rx_dropped. rx_over_capacity
/// also counts, in each snapshot, the vehicles that ask for a plan beyond controlled_max.
/// unknown_target and incomplete are part of rx_accepted. rx_other_map counts refused signals, and
/// states besides their result.
typedef struct inbox_counters {
    uint64_t rx_accepted, rx_stale, rx_future, rx_duplicate, rx_out_of_order, rx_malformed;
    uint64_t rx_out_of_range, rx_off_map, rx_over_capacity, rx_id_conflict, rx_dropped;
    uint64_t unknown_target; ///< states with a target lane that the road does not have
    uint64_t incomplete;     ///< states without heading or speed: of an obstacle, not to be planned
    uint64_t rx_version, rx_other_map;
} inbox_counters;

enum { INBOX_BUSES_MAX = 4, INBOX_SIGNALS_MAX = 256 };

/// Bus and sender of a state. sender 0: unknown (a recording).
typedef struct inbox_source {
    uint64_t sender; ///< transport_message.sender
    uint32_t bus;    ///< below INBOX_BUSES_MAX
} inbox_source;

/// The slot of one vehicle. Private to inbox.c.
typedef struct inbox_slot {
    verge_vehicle_state_t state;
    bool used;
    bool planned; ///< controlled in the last snapshot: gets a cancellation when that ends
    bool placed;  ///< the last plan found it on a lane, see inbox_placed()
    bool incomplete; ///< heading or speed of `state` is a guess: it gets no plan
    struct {
        uint64_t sender; ///< 0: unknown
        int64_t  utime;  ///< [us] of its last state
    } owners[INBOX_BUSES_MAX]; ///< the sender that owns the id, on each bus
} inbox_slot;

typedef struct inbox {
    inbox_limits   limits;
    uint32_t       vehicles_max, controlled_max;
    inbox_counters counters;
    const char*    fault_field; ///< of the last INBOX_OUT_OF_RANGE, for logs
    int32_t        lacking_id;  ///< the last vehicle with an unknown target or an incomplete state
    int32_t        fault_version; ///< of the last INBOX_VERSION
    uint32_t       map_crc32;   ///< of the road; 0: not known
    inbox_slot     slots[VERGE_VEHICLES_MAX];
    uint32_t       signal_count;
    verge_lane_signal_t signals[INBOX_SIGNALS_MAX]; ///< the last one of each lane, ascending
} inbox;

/// limits must pass inbox_limits_check(); 1 <= controlled_max <= vehicles_max <=
/// VERGE_VEHICLES_MAX, as in the planner, which refuses a step with more vehicles.
void inbox_init(inbox* self, const inbox_limits* limits, uint32_t vehicles_max,
                uint32_t controlled_max);

/// Changes the limits and keeps the vehicles.
void inbox_set_limits(inbox* self, const inbox_limits* limits);

/// Offers a state that was received. road null: position and target lane are not checked. A vehicle
/// received on two buses is one vehicle: the same state from the second bus is a duplicate.
inbox_verdict inbox_offer_from(inbox* self, const verge_vehicle_state_t* state,
                               inbox_source source, int64_t now_utime, const verge_road* road);
/// The same from an unknown sender on bus 0.
inbox_verdict inbox_offer(inbox* self, const verge_vehicle_state_t* state, int64_t now_utime,
                          const verge_road* road);

/// Says which road this is. The target lane of a state that states another road is not used; the
/// state itself is, and it counts as rx_other_map. 0, as at first: no state is compared.
void inbox_set_map(inbox* self, uint32_t map_crc32);

/// Offers the signal of a lane that was received. A refused one counts as a refused state does.
inbox_verdict inbox_offer_signal(inbox* self, const verge_lane_signal_t* signal, int64_t now_utime,
                                 const verge_road* road);

/// What the signals show at an instant, ascending by lane; returns their number. A signal whose
/// change has passed with no newer message is red, and so is one without a time of change that is
/// silent for longer than drop_ms. A signal is never forgotten, but with the road.
uint32_t inbox_signals(const inbox* self, int64_t utime, verge_signal signals[INBOX_SIGNALS_MAX]);

/// Empties the inbox, for a clock that has stepped back or fewer slots. Limits, map and counters
/// are kept. Signals are red until they are heard again.
void inbox_forget(inbox* self, uint32_t vehicles_max, uint32_t controlled_max);

/// Reports the vehicles that the last plan found on a lane; to be called before each snapshot, with
/// count 0 if there was no plan. A state of a reported vehicle is not projected on the road when it
/// arrives: the plan that uses it does that, at its own instant. The states of all other vehicles
/// are projected on arrival, so that vehicles off the map, of which a roadside unit may receive
/// many, never take a slot. A vehicle that leaves the map is therefore used once more, as a vehicle
/// off the road; its next states are refused.
void inbox_placed(inbox* self, const int32_t* ids, uint32_t count);

/// The utime of the stored state of a vehicle; 0: there is none.
int64_t inbox_held_utime(const inbox* self, int32_t vehicle_id);

/// Of a full inbox, the vehicle that is farthest from a place, and its distance [m]. False: there is
/// room for one more.
bool inbox_farthest(const inbox* self, double x, double y, int32_t* vehicle_id, double* distance);

/// Forgets a vehicle, without a cancellation.
void inbox_forget_vehicle(inbox* self, int32_t vehicle_id);

/// Releases the ownership of all ids. For a change of the buses.
void inbox_forget_senders(inbox* self);

/// For a change of the road: forgets the vehicles that are off the new road, and target lanes and
/// signals of lanes that it lacks. No counter changes; planned vehicles that are forgotten get their
/// cancellation in the next snapshot.
void inbox_review(inbox* self, const verge_road* road);

/// "accepted", "stale", ...: the name of the counter without rx_.
const char* inbox_verdict_name(inbox_verdict verdict);

/// The vehicles at one instant, ordered by id. About 19 KiB.
typedef struct inbox_view {
    uint32_t      count;
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];    ///< projected to the instant
    int64_t       state_utime[VERGE_VEHICLES_MAX]; ///< [us] of the received state of each
    uint32_t      controlled_count;                ///< vehicles with controlled == true
    uint32_t      cancelled_count;
    int32_t       cancelled[VERGE_VEHICLES_MAX];   ///< ids controlled in the last view, not in this
} inbox_view;

/// Extrapolates every state to plan_utime with constant acceleration, until the vehicle stands, and
/// constant curvature (0 if the yaw rate is unknown, and backwards; at most 0.5 1/m). Vehicles that
/// request a plan and are fresh are controlled; if there are more than controlled_max, those of the
/// last view first, then by id. Forgets vehicles older than drop_ms. Each cancellation appears in
/// exactly one view.
void inbox_snapshot(inbox* self, int64_t plan_utime, inbox_view* view);

/// The stored state of one vehicle, extrapolated to an instant. False: none, or not fresh then.
bool inbox_latest(const inbox* self, int32_t id, int64_t utime, verge_vehicle* vehicle,
                  int64_t* state_utime);

/// A vehicle's motion from its own instant to dt [s] later (or, dt < 0, earlier). Its rear axle
/// moves along the heading (body.h), so in a turn its centre does not.
void inbox_project(verge_vehicle* vehicle, double dt);

/// Writes the rx_ fields of a status, capped at INT32_MAX: those of the inbox and, for
/// rx_malformed and rx_dropped, those of the bus. Messages that the bus refused count as malformed.
void inbox_fill_status(const inbox* self, const transport_stats* bus, verge_rsu_status_t* status);

#ifdef __cplusplus
}
#endif

#endif
