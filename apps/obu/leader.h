/// The plans of the roadside unit that an on-vehicle unit follows: which unit that is, the newest
/// plan of each of its vehicles, and whether the own plan can be followed now.
///
///     leader_init(&leader, &def);
///     leader_offer(&leader, &message.as.plan, source, now_utime);   // each VERGE_PLAN
///     plan = leader_plan(&leader, now_utime, &why_not);              // each cycle
///
/// Several     One roadside unit is followed at a time: the one that the configuration names, or
/// units       else the lowest id of those that plan the own vehicle. Another one takes its place
///             when it has not planned the own vehicle for three of its cycles. On each bus an id
///             belongs to the first sender of it, until that one is silent for three cycles.
/// Refused     A plan changes only a counter if it is of another protocol version or road, older than
///             what is known, from the future, over already, too soon after the last one, or if it
///             contradicts another plan of its cycle.
/// Memory      All in the struct, about 40 kB; nothing allocates.
/// Time        No clock is read.
#ifndef VERGE_OBU_LEADER_H
#define VERGE_OBU_LEADER_H

#include "verge/inbox.h"
#include "verge/wire.h"

/// The result for an offered plan. The rules are checked in the order of this list.
typedef enum leader_verdict {
    LEADER_ACCEPTED = 0,
    LEADER_OTHER_VERSION, ///< an unknown protocol_version
    LEADER_OUT_OF_RANGE,  ///< by wire_plan_check()
    LEADER_OTHER_MAP,     ///< made with another road
    LEADER_OTHER_RSU,     ///< of a roadside unit that is not followed
    LEADER_SAME_ID,       ///< of another sender with the id of the roadside unit that is followed
    LEADER_FUTURE,        ///< begins more than future_ms ahead of the clock
    LEADER_OVER,          ///< ended already
    LEADER_OLD,           ///< not newer than the plan that is known
    LEADER_TOO_SOON,      ///< begins less than LEADER_CYCLE_US_MIN after it
    LEADER_CONTRADICTS,   ///< another digest or number of plans than another plan of the same cycle
    LEADER_NO_ROOM,       ///< of one vehicle more than there is room for
    LEADER_VERDICTS,
} leader_verdict;

/// "accepted", "other_version", ... Never null.
const char* leader_verdict_name(leader_verdict verdict);

enum {
    LEADER_CYCLE_US_MIN = 10000,      ///< [us] the shortest cycle of a roadside unit
    LEADER_CYCLE_US_DEFAULT = 500000, ///< [us] until two of its cycles were heard
    LEADER_CYCLE_US_MAX = 5000000,    ///< [us]
    LEADER_SILENT_CYCLES = 3,         ///< a unit that is silent for longer is not followed any more
};

typedef struct leader_def {
    int32_t  vehicle_id; ///< the own vehicle
    int32_t  rsu_id;     ///< the roadside unit to follow, -1: the lowest id
    uint32_t map_crc32;  ///< of the own road
    int64_t  future_us;  ///< [us]
} leader_def;

/// All zero with leader_init().
typedef struct leader {
    leader_def def;
    int32_t    rsu_id;    ///< that is followed, -1: none
    uint64_t   senders[INBOX_BUSES_MAX]; ///< that own this id; 0: not known
    int64_t    heard;     ///< [us] arrival of its last accepted plan, for any vehicle
    int64_t    heard_own; ///< [us] the same, for the own vehicle
    int64_t    cycle_us;  ///< [us] its period
    int64_t    seen_us;   ///< [us] between its last two plans; 0: not known
    bool       ever;      ///< was a plan for the own vehicle ever accepted?
    int64_t    other_map, other_version; ///< [us] arrival of the last plan for the own vehicle that
                                         ///< was refused for it; 0: none
    uint32_t   plan_count;
    verge_vehicle_plan_t plans[VERGE_CONTROLLED_MAX]; ///< the newest of each vehicle
    uint64_t   counters[LEADER_VERDICTS];
    int32_t    refused_rsu_id; ///< of the last plan that was refused
} leader;

void leader_init(leader* self, const leader_def* def);

/// Offers a plan that was received, of any vehicle, at now_utime [us].
leader_verdict leader_offer(leader* self, const verge_vehicle_plan_t* plan, inbox_source source,
                            int64_t now_utime);

/// The plan of the own vehicle, if there is one to follow; else null, and *why_not says why.
const verge_vehicle_plan_t* leader_plan(const leader* self, int64_t now_utime,
                                        wire_unit_reason* why_not);

/// The valid plan of a vehicle, from the roadside unit that is followed; null: none.
const verge_vehicle_plan_t* leader_plan_of(const leader* self, int32_t vehicle_id,
                                           int64_t now_utime);

/// Forgets all plans and the roadside unit, for a clock that has stepped. Counters stay.
void leader_forget(leader* self);

#endif
