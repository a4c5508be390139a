/// See state_message.h.
#include "state_message.h"

#include "verge/verge.h"
#include "verge/wire.h"

#include <math.h>
#include <string.h>

static verge_habit_kind habit_kind_of(const verge_vehicle* vehicle)
{
    for (int kind = VERGE_AGGRESSIVE; kind <= VERGE_CONSERVATIVE; ++kind) {
        const double cooperation = verge_habit_of((verge_habit_kind)kind).cooperation;
        if (fabs(cooperation - vehicle->habit.cooperation) < 1e-9) {
            return (verge_habit_kind)kind;
        }
    }
    return VERGE_NORMAL;
}

verge_vehicle_state_t state_message(const verge_vehicle* vehicle, int64_t utime, int32_t sequence,
                                    int32_t followed_cycle, uint32_t map_crc32)
{
    verge_vehicle_state_t state = wire_state_from_vehicle(vehicle, habit_kind_of(vehicle), utime,
                                                          sequence, followed_cycle);
    state.map_crc32 = (int32_t)map_crc32;
    return state;
}

verge_lane_signal_t signal_message(const verge_signal* signal, int64_t utime, uint32_t map_crc32)
{
    const bool timed = signal->change_s >= 0.0;
    return (verge_lane_signal_t){
        .utime = utime,
        .change_utime = timed ? utime + llround(signal->change_s * 1e6) : 0,
        .lane = signal->lane_id,
        .state = (int16_t)signal->state,
        .protocol_version = WIRE_PROTOCOL_VERSION,
        .map_crc32 = (int32_t)map_crc32,
    };
}

verge_vehicle_plan trajectory_plan(const verge_vehicle_trajectory_t* message)
{
    verge_vehicle_plan plan;
    memset(&plan, 0, sizeof plan);
    plan.vehicle_id = message->vehicle_id;
    plan.status = (verge_plan_status)message->status;
    plan.reason = (verge_reason)message->reason;
    plan.point_count = wire_points_from_trajectory(message, plan.points);
    plan.cost = (verge_cost){ NAN, NAN, NAN, NAN, NAN, NAN, NAN };
    plan.action_count = 1;
    plan.actions[0] = (verge_action_step){
        .action = (verge_action)message->action,
        .lane_id = message->lane,
        .t1 = plan.points[plan.point_count - 1].t,
        .s = NAN, .d = NAN, .v = NAN, .distance = NAN,
        .brake_light = message->brake_light != 0,
        .turn_signal = message->turn_signal,
        .ahead_id = -1,
        .behind_id = -1,
    };
    return plan;
}
