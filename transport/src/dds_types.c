#include "dds_types.h"

#include <stddef.h>

// Both compilers give their types the same names; those of idlc get others here, and are known in
// this file only.
#define verge_vehicle_state_t idl_vehicle_state_t
#define verge_plan_action_t idl_plan_action_t
#define verge_plan_point_t idl_plan_point_t
#define verge_vehicle_plan_t idl_vehicle_plan_t
#define verge_rsu_status_t idl_rsu_status_t
#include "verge.h"
#undef verge_vehicle_state_t
#undef verge_plan_action_t
#undef verge_plan_point_t
#undef verge_vehicle_plan_t
#undef verge_rsu_status_t

#define SAME_SIZE(type) \
    _Static_assert(sizeof(idl_##type) == sizeof(verge_##type), #type ": the schemas differ")
#define SAME(type, field)                                                                     \
    _Static_assert(offsetof(idl_##type, field) == offsetof(verge_##type, field) &&            \
                       sizeof ((idl_##type*)0)->field == sizeof ((verge_##type*)0)->field,    \
                   #type "." #field ": the schemas differ")

SAME_SIZE(vehicle_state_t);
SAME(vehicle_state_t, utime);
SAME(vehicle_state_t, vehicle_id);
SAME(vehicle_state_t, sequence);
SAME(vehicle_state_t, controlled);
SAME(vehicle_state_t, x);
SAME(vehicle_state_t, y);
SAME(vehicle_state_t, heading);
SAME(vehicle_state_t, speed);
SAME(vehicle_state_t, acceleration);
SAME(vehicle_state_t, yaw_rate);
SAME(vehicle_state_t, length);
SAME(vehicle_state_t, width);
SAME(vehicle_state_t, position_sigma);
SAME(vehicle_state_t, target_lane);
SAME(vehicle_state_t, habit);
SAME(vehicle_state_t, cooperation);
SAME(vehicle_state_t, followed_cycle);
SAME(vehicle_state_t, crc32);

SAME_SIZE(plan_action_t);
SAME(plan_action_t, action);
SAME(plan_action_t, lane);
SAME(plan_action_t, brake_light);
SAME(plan_action_t, turn_signal);
SAME(plan_action_t, t0_ms);
SAME(plan_action_t, t1_ms);
SAME(plan_action_t, speed);

SAME_SIZE(plan_point_t);
SAME(plan_point_t, x);
SAME(plan_point_t, y);
SAME(plan_point_t, heading);
SAME(plan_point_t, speed);
SAME(plan_point_t, acceleration);
SAME(plan_point_t, curvature);

SAME_SIZE(vehicle_plan_t);
SAME(vehicle_plan_t, utime);
SAME(vehicle_plan_t, valid_until_utime);
SAME(vehicle_plan_t, rsu_id);
SAME(vehicle_plan_t, cycle);
SAME(vehicle_plan_t, plans_in_cycle);
SAME(vehicle_plan_t, vehicle_id);
SAME(vehicle_plan_t, state_utime);
SAME(vehicle_plan_t, status);
SAME(vehicle_plan_t, reason);
SAME(vehicle_plan_t, action_count);
SAME(vehicle_plan_t, actions);
SAME(vehicle_plan_t, point_count);
SAME(vehicle_plan_t, dt_ms);
SAME(vehicle_plan_t, points);
SAME(vehicle_plan_t, digest);
SAME(vehicle_plan_t, crc32);

SAME_SIZE(rsu_status_t);
SAME(rsu_status_t, utime);
SAME(rsu_status_t, start_utime);
SAME(rsu_status_t, rsu_id);
SAME(rsu_status_t, version);
SAME(rsu_status_t, map_crc32);
SAME(rsu_status_t, config_crc32);
SAME(rsu_status_t, cycle);
SAME(rsu_status_t, state);
SAME(rsu_status_t, fault);
SAME(rsu_status_t, vehicles_seen);
SAME(rsu_status_t, vehicles_controlled);
SAME(rsu_status_t, cycle_us_last);
SAME(rsu_status_t, cycle_us_p99);
SAME(rsu_status_t, cycle_us_max);
SAME(rsu_status_t, deadline_misses);
SAME(rsu_status_t, plans_sent);
SAME(rsu_status_t, fallbacks);
SAME(rsu_status_t, rx_accepted);
SAME(rsu_status_t, rx_stale);
SAME(rsu_status_t, rx_future);
SAME(rsu_status_t, rx_duplicate);
SAME(rsu_status_t, rx_out_of_order);
SAME(rsu_status_t, rx_malformed);
SAME(rsu_status_t, rx_out_of_range);
SAME(rsu_status_t, rx_off_map);
SAME(rsu_status_t, rx_over_capacity);
SAME(rsu_status_t, rx_id_conflict);
SAME(rsu_status_t, rx_dropped);
SAME(rsu_status_t, arena_size_bytes);
SAME(rsu_status_t, arena_peak_bytes);
SAME(rsu_status_t, nodes_peak);
SAME(rsu_status_t, crc32);

const dds_topic_descriptor_t* dds_type_of(transport_kind kind)
{
    switch (kind) {
    case TRANSPORT_STATE: return &verge_vehicle_state_t_desc;
    case TRANSPORT_PLAN: return &verge_vehicle_plan_t_desc;
    case TRANSPORT_STATUS: return &verge_rsu_status_t_desc;
    case TRANSPORT_MARK:
    case TRANSPORT_NONE: break;
    }
    return NULL;
}
