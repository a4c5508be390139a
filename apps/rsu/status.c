#include "status.h"

#include "common/message_json.h"
#include "common/text.h"

#include <string.h>

/// Counters on the wire stop at the largest number instead of wrapping to a negative one.
static int32_t clamp_i32(uint64_t value)
{
    return value > INT32_MAX ? INT32_MAX : (int32_t)value;
}

static int32_t bits_i32(uint32_t bits)
{
    int32_t value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

const char* rsu_fault_name(rsu_fault fault)
{
    return message_rsu_fault((int32_t)fault);
}

void rsu_fault_names(uint32_t faults, char names[RSU_FAULTS_SIZE])
{
    text out = text_in(names, RSU_FAULTS_SIZE);
    for (uint32_t fault = RSU_FAULT_COUNT - 1; fault > RSU_FAULT_NONE; fault--) {
        if ((faults & 1u << fault) != 0) {
            text_add(&out, "%s%s", out.size > 0 ? "," : "", rsu_fault_name((rsu_fault)fault));
        }
    }
    if (faults == 0) {
        text_add(&out, "%s", rsu_fault_name(RSU_FAULT_NONE));
    }
}

const char* rsu_state_name(rsu_state state)
{
    return message_rsu_state((int32_t)state);
}

void status_fault(status* self, rsu_fault fault, int64_t now, bool lasting)
{
    const bool lasts = self->fault_given[fault] && self->fault_until[fault] == INT64_MAX;
    self->fault_given[fault] = true;
    self->fault_until[fault] = lasting || lasts ? INT64_MAX : now + STATUS_FAULT_HOLD_US;
}

void status_fault_clear(status* self, rsu_fault fault)
{
    self->fault_given[fault] = false;
}

uint32_t status_faults(const status* self, int64_t now)
{
    uint32_t faults = 0;
    for (uint32_t fault = RSU_FAULT_NONE + 1; fault < RSU_FAULT_COUNT; fault++) {
        const bool active = self->fault_given[fault] && now < self->fault_until[fault];
        faults |= active ? 1u << fault : 0;
    }
    return faults;
}

rsu_fault status_worst(const status* self, int64_t now)
{
    const uint32_t faults = status_faults(self, now);
    uint32_t fault = RSU_FAULT_COUNT - 1;
    while (fault > RSU_FAULT_NONE && (faults & 1u << fault) == 0) {
        fault--;
    }
    return (rsu_fault)fault;
}

rsu_state status_state(const status* self, int64_t now)
{
    if (self->stopping) {
        return RSU_STOPPING;
    }
    if (status_worst(self, now) != RSU_FAULT_NONE) {
        return RSU_DEGRADED;
    }
    return self->has_vehicles ? RSU_RUNNING : RSU_WAITING;
}

verge_rsu_status_t status_message(const status* self, const config* config, const cycle* cycle,
                                  const transport_stats* bus, int64_t utime, int64_t now)
{
    verge_rsu_status_t message;
    memset(&message, 0, sizeof message);
    message.utime = utime;
    message.start_utime = self->start_utime;
    message.rsu_id = config->rsu_id;
    message.version =
        VERGE_VERSION_MAJOR * 10000 + VERGE_VERSION_MINOR * 100 + VERGE_VERSION_PATCH;
    message.map_crc32 = bits_i32(config->site.map_crc32);
    message.config_crc32 = bits_i32(config->site.config_crc32);
    message.cycle = (int32_t)cycle->number;
    message.state = (int16_t)status_state(self, now);
    message.fault = (int16_t)status_worst(self, now);
    message.vehicles_seen = (int32_t)cycle->view.count;
    message.vehicles_controlled = (int32_t)cycle->view.controlled_count;
    message.cycle_us_last = clamp_i32(self->cycle_time.last);
    message.cycle_us_p99 = clamp_i32(timing_p99(&self->cycle_time));
    message.cycle_us_max = clamp_i32(self->cycle_time.max);
    message.deadline_misses = clamp_i32(self->deadline_misses);
    message.plans_sent = clamp_i32(cycle->counters.plans);
    message.fallbacks = clamp_i32(cycle->counters.fallbacks);
    inbox_fill_status(&cycle->inbox, bus, &message);
    message.arena_size_bytes = (int64_t)cycle->planner_counters.arena_size;
    message.arena_peak_bytes = (int64_t)cycle->planner_counters.arena_peak;
    message.nodes_peak = clamp_i32(cycle->planner_counters.nodes_peak);
    return message;
}
