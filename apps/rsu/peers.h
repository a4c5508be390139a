/// The other roadside units on the buses, and which of them sends the plans of a vehicle.
///
///     peers_init(&peers, &def);
///     peers_offer(&peers, &message, now);              // each status and plan that is received
///     peers_begin(&peers, now);                        // before the messages of a cycle are sent:
///     if (peers_sends(&peers, vehicle_id, now)) ...    // a plan
///     if (peers_cancels(&peers, vehicle_id, now)) ...  // a cancellation
///
/// Same id     Of two units with one rsu_id, the one that was started first sends all plans.
/// Other id    A vehicle that two units plan gets the plans of the unit with the lower rsu_id,
///             unless def.never. On the same road a vehicle that is new waits for the first plan
///             of a unit with a lower id, until that unit is silent about it.
/// Silence     A unit is silent about a vehicle, or altogether, if it sent nothing for two and a
///             half of its cycles. Then the other one sends, with the first of its own cycles: at
///             most three and a half cycles after the last message.
/// Return      A unit that sends goes on until the other one was heard in PEERS_RETURN_CYCLES
///             cycles without silence, so that a weak link does not switch the sender back and
///             forth. Until then both send.
/// Stand-by    A unit that stands by goes on planning. It cancels a vehicle's plan only if it has
///             sent that plan itself, because a cancellation would replace the other unit's plan.
/// Own         A program on LCM receives its own messages. A unit knows its statuses by their
///             start_utime, and uses no plan with its own rsu_id. Plans count only if the status of
///             their sender was heard.
/// Time        now [us] of a clock that never steps back; the caller gives it.
/// Memory      All in the struct.
#ifndef VERGE_RSU_PEERS_H
#define VERGE_RSU_PEERS_H

#include "verge/transport.h"
#include "verge/verge.h"

enum {
    PEERS_MAX = 8, ///< other units; of more, those heard last
    PEERS_VEHICLES_MAX = 4 * VERGE_CONTROLLED_MAX,
    PEERS_RETURN_CYCLES = 3,
    PEERS_STATUS_US = 1000000, ///< [us] between two statuses of a unit that hears no other
    PEERS_GAP_MAX_US = 5000000, ///< [us] the longest cycle
};

typedef struct peers_def {
    int32_t  rsu_id;
    int64_t  start_utime; ///< [us] of this unit, as in its statuses
    uint32_t map_crc32;
    int64_t  period_us;   ///< of this unit's cycles
    bool     never;       ///< never stands by for a unit with another rsu_id
} peers_def;

/// Another unit. Units with this unit's rsu_id are told apart by their start_utime.
typedef struct peer {
    int32_t  rsu_id;
    int64_t  start_utime;
    uint32_t map_crc32;
    bool     audible;   ///< not silent when it was last looked at
    int64_t  heard;     ///< [us] its last message
    uint32_t cycles;    ///< heard without silence
    int32_t  cycle;     ///< of its last message
    int64_t  utime;     ///< [us] of the first message of that cycle, by the sender's clock
    int64_t  gap_us;    ///< between the last two cycles that were heard
    bool     shares;    ///< it has planned a vehicle that this unit plans
    int32_t  vehicle_id; ///< the first of them
} peer;

typedef struct peers_vehicle {
    int32_t  id;
    bool     used;
    bool     sent;         ///< the last plan that this unit made for it was sent
    int64_t  since;        ///< [us] when this unit began to plan it
    int64_t  planned;      ///< [us] when this unit last planned it
    uint32_t by;           ///< the other unit that plans it: index of a peer
    uint32_t claims;       ///< plans of that unit, of different cycles without silence; 0: none
    int32_t  claim_cycle;
    int64_t  claimed;      ///< [us] when the last one came
} peers_vehicle;

typedef struct peers {
    peers_def     def;
    peer          peer[PEERS_MAX];
    peers_vehicle vehicle[PEERS_VEHICLES_MAX];
    bool          led;      ///< a unit with the same id sends
    bool          sends;    ///< this unit was not led in the last cycle
    uint32_t      sent, withheld; ///< plans since peers_begin()
    const peer*   leader;   ///< because of which a plan was last withheld; null: none yet
} peers;

void peers_init(peers* self, const peers_def* def);
/// Another configuration of the same run.
void peers_set(peers* self, const peers_def* def);

/// A status or a plan, of this unit or another one. Returns the other unit when it is heard for the
/// first time or after silence, and when it has planned its first vehicle that this unit plans,
/// too; otherwise null.
const peer* peers_offer(peers* self, const transport_message* message, int64_t now);
/// The next unit that has become silent since it was last looked at; null: none.
const peer* peers_silent(peers* self, int64_t now);

/// Before the plans and cancellations of a cycle.
void peers_begin(peers* self, int64_t now);
/// Is this unit to send its plan for a vehicle?
bool peers_sends(peers* self, int32_t vehicle_id, int64_t now);
/// Is this unit to cancel its plan for a vehicle?
bool peers_cancels(peers* self, int32_t vehicle_id, int64_t now);

/// Is the other unit one that this unit stands by for, where both plan?
bool peers_leads(const peers* self, const peer* peer);
/// Is it not silent?
bool peers_audible(const peer* peer, int64_t now);
/// Is any other unit audible?
bool peers_any(const peers* self, int64_t now);
/// The unit that this one stands by for, which means that it sends no plan at all because that one
/// leads: the last cycle's plans were all withheld, or there are none and both have the same road.
/// Null: this unit does not stand by.
const peer* peers_leader(const peers* self, int64_t now);
/// Has another unit the same rsu_id, or does this unit stand by, or do both send plans for one
/// vehicle?
bool peers_fault(const peers* self, int64_t now);

#endif
