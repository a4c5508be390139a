#include "dds_types.h"

#include <assert.h>
#include <stddef.h>

// Both compilers give their types the same names; those of idlc get others here, and are known in
// this file only.
#define verge_vehicle_state_t idl_vehicle_state_t
#define verge_plan_action_t idl_plan_action_t
#define verge_plan_pass_t idl_plan_pass_t
#define verge_plan_stop_t idl_plan_stop_t
#define verge_plan_point_t idl_plan_point_t
#define verge_lane_signal_t idl_lane_signal_t
#define verge_vehicle_trajectory_t idl_vehicle_trajectory_t
#define verge_vehicle_plan_t idl_vehicle_plan_t
#define verge_rsu_status_t idl_rsu_status_t
#include "verge.h"
#undef verge_vehicle_state_t
#undef verge_plan_action_t
#undef verge_plan_pass_t
#undef verge_plan_stop_t
#undef verge_plan_point_t
#undef verge_lane_signal_t
#undef verge_vehicle_trajectory_t
#undef verge_vehicle_plan_t
#undef verge_rsu_status_t

#define SAME_SIZE(type) \
    static_assert(sizeof(idl_##type) == sizeof(verge_##type), #type ": the schemas differ")
#define SAME(type, field)                                                                     \
    static_assert(offsetof(idl_##type, field) == offsetof(verge_##type, field) &&             \
                      sizeof((idl_##type*)0)->field == sizeof((verge_##type*)0)->field,       \
                  #type "." #field ": the schemas differ")

#define MESSAGE(KIND, type, ...) SAME_SIZE(type);
#define PART(KIND, type, ...) SAME_SIZE(type);
#define STATE(type, name, ...) SAME(vehicle_state_t, name);
#define ACTION(type, name, ...) SAME(plan_action_t, name);
#define PASS(type, name, ...) SAME(plan_pass_t, name);
#define STOP(type, name, ...) SAME(plan_stop_t, name);
#define SIGNAL(type, name, ...) SAME(lane_signal_t, name);
#define TRAJECTORY(type, name, ...) SAME(vehicle_trajectory_t, name);
#define TRAJECTORY_ARRAY(part, name, ...) SAME(vehicle_trajectory_t, name);
#define POINT(type, name, ...) SAME(plan_point_t, name);
#define PLAN(type, name, ...) SAME(vehicle_plan_t, name);
#define PLAN_ARRAY(part, name, ...) SAME(vehicle_plan_t, name);
#define STATUS(type, name, ...) SAME(rsu_status_t, name);
#include "messages.def"

const dds_topic_descriptor_t* dds_type_of(transport_kind kind)
{
    switch (kind) {
#define MESSAGE(KIND, type, ...) \
    case TRANSPORT_##KIND: return &verge_##type##_desc;
#include "messages.def"
    case TRANSPORT_MARK:
    case TRANSPORT_NONE: break;
    }
    return NULL;
}
