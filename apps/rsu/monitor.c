#include "monitor.h"

#include "daemon/log.h"

#include <inttypes.h>
#include <stdio.h>

verge_rsu_status_t monitor_message(const monitor* self, instant at)
{
    const transport_stats stats = buses_statistics(&self->setup->buses);
    return status_message(self->status, config_of(self->setup->site), self->cycle, &stats, at.utime,
                          at.now);
}

void monitor_publish(monitor* self, instant at)
{
    const verge_rsu_status_t message = monitor_message(self, at);
    buses_publish(&self->setup->buses, TRANSPORT_STATUS, &message);
    self->state = (rsu_state)message.state;
    self->faults = status_faults(self->status, at.now);
}

void monitor_update(monitor* self, instant at)
{
    const rsu_state state = status_state(self->status, at.now);
    const uint32_t faults = status_faults(self->status, at.now);
    if (state != self->state || faults != self->faults) {
        char names[RSU_FAULTS_SIZE];
        rsu_fault_names(faults, names);
        log_event(LOG_INFO, "state", "from=%s to=%s faults=%s", rsu_state_name(self->state),
                  rsu_state_name(state), names);
        monitor_publish(self, at);
    }
}

// ---- once a second ------------------------------------------------------------------------

static void log_bus_errors(monitor* self, instant at);
static void log_losses(monitor* self, instant at);
static void log_over_capacity(monitor* self, instant at);
static void log_foreign(monitor* self);
static void log_refusals(monitor* self);
static void log_lacking(monitor* self);
static void log_standstills(monitor* self);
static void log_expiry(monitor* self, instant at);
static void notify_manager(monitor* self, instant at);

void monitor_each_second(monitor* self, instant at)
{
    log_bus_errors(self, at);
    log_losses(self, at);
    log_over_capacity(self, at);
    log_refusals(self);
    log_lacking(self);
    log_standstills(self);
    log_foreign(self);
    log_expiry(self, at);
    monitor_publish(self, at);
    notify_manager(self, at);
}

/// A bus that was lost is opened again by the transport. This only logs it.
static void log_bus_errors(monitor* self, instant at)
{
    for (uint32_t bus = 0; bus < self->setup->buses.count; bus++) {
        const uint64_t errors = buses_new_errors(&self->setup->buses, bus);
        if (errors > 0) {
            status_fault(self->status, RSU_FAULT_BUS, at.now, false);
            log_repeated(LOG_WARNING, "bus_trouble", bus,
                         "errors=%" PRIu64 " bus=%s action=keeps_trying", errors,
                         self->setup->site->bus[bus]);
        }
    }
}

/// Losses of log and recording are logged when writing works again: nothing was lost for one
/// second.
static void log_losses(monitor* self, instant at)
{
    log_report_dropped();
    const uint64_t dropped = self->status->record_dropped;
    if (dropped > self->record_dropped) {
        status_fault(self->status, RSU_FAULT_RECORD, at.now, false);
    } else if (dropped > self->record_dropped_logged) {
        log_event(LOG_WARNING, "record_dropped", "events=%" PRIu64 " total=%" PRIu64,
                  dropped - self->record_dropped_logged, dropped);
        self->record_dropped_logged = dropped;
    }
    self->record_dropped = dropped;
}

static void log_over_capacity(monitor* self, instant at)
{
    const uint64_t over_capacity = self->cycle->inbox.counters.rx_over_capacity;
    if (over_capacity > self->over_capacity) {
        self->over_capacity = over_capacity;
        status_fault(self->status, RSU_FAULT_CAPACITY, at.now, false);
        log_repeated(LOG_WARNING, "over_capacity", 0, "vehicles_max=%u controlled_max=%u",
                     self->cycle->def.vehicles_max, self->cycle->def.controlled_max);
    }
}

/// Messages of another version of the protocol, or made with another road.
static void log_foreign(monitor* self)
{
    const inbox* from = &self->cycle->inbox;
    if (from->counters.rx_version > self->version) {
        log_repeated(LOG_WARNING, "unknown_version", 0, "protocol_version=%" PRId32 " expected=%d",
                     from->fault_version, (int)WIRE_PROTOCOL_VERSION);
    }
    if (from->counters.rx_other_map > self->other_map) {
        log_repeated(LOG_WARNING, "other_map", 0,
                     "map_crc32=0x%08" PRIx32 " action=ignores_target_lanes_and_signals",
                     from->map_crc32);
    }
    self->version = from->counters.rx_version;
    self->other_map = from->counters.rx_other_map;
}

/// At most one line a second, with the number of states refused for each reason.
static void log_refusals(monitor* self)
{
    const transport_stats stats = buses_statistics(&self->setup->buses);
    const inbox_counters* rx = &self->cycle->inbox.counters;
    // With several buses duplicates are normal: a vehicle may send on two of them.
    const bool several = self->setup->buses.count > 1;
    const uint64_t refusals = rx->rx_stale + rx->rx_future + (several ? 0 : rx->rx_duplicate) +
                              rx->rx_out_of_order + rx->rx_out_of_range + rx->rx_off_map +
                              rx->rx_over_capacity + rx->rx_id_conflict + rx->rx_version +
                              stats.malformed + stats.dropped + transport_refused(&stats);
    if (refusals > self->refusals) {
        log_event(LOG_WARNING, "states_refused",
                  "new=%" PRIu64 " stale=%" PRIu64 " future=%" PRIu64 " duplicate=%" PRIu64
                  " out_of_order=%" PRIu64 " out_of_range=%" PRIu64 " off_map=%" PRIu64
                  " over_capacity=%" PRIu64 " id_conflict=%" PRIu64 " malformed=%" PRIu64
                  " dropped=%" PRIu64 " version=%" PRIu64 " strangers=%" PRIu64,
                  refusals - self->refusals, rx->rx_stale, rx->rx_future, rx->rx_duplicate,
                  rx->rx_out_of_order, rx->rx_out_of_range, rx->rx_off_map, rx->rx_over_capacity,
                  rx->rx_id_conflict, stats.malformed, stats.dropped, rx->rx_version,
                  transport_refused(&stats));
    }
    self->refusals = refusals;
}

/// At most one line a second: states that are used without what they do not say.
static void log_lacking(monitor* self)
{
    const inbox* inbox = &self->cycle->inbox;
    const inbox_counters* rx = &inbox->counters;
    const uint64_t lacking = rx->unknown_target + rx->incomplete;
    if (lacking > self->lacking) {
        log_event(LOG_WARNING, "states_incomplete",
                  "new=%" PRIu64 " unknown_target=%" PRIu64 " no_heading_or_speed=%" PRIu64
                  " last_vehicle=%" PRId32,
                  lacking - self->lacking, rx->unknown_target, rx->incomplete, inbox->lacking_id);
    }
    self->lacking = lacking;
}

/// At most one line a second: vehicles that stood without a cause or for one another, which the
/// planner has given another order. Their plans name the cause (why, code blocked).
static void log_standstills(monitor* self)
{
    const cycle_counters* made = &self->cycle->counters;
    const uint64_t standstills = made->reordered + made->unstuck;
    if (standstills > self->standstills) {
        log_event(LOG_WARNING, "standstill",
                  "new=%" PRIu64 " reordered=%" PRIu64 " unstuck=%" PRIu64,
                  standstills - self->standstills, made->reordered, made->unstuck);
    }
    self->standstills = standstills;
}

/// Once a day: certificates or permissions end soon.
static void log_expiry(monitor* self, instant at)
{
    buses* buses = &self->setup->buses;
    if (buses_expiring(buses, at.utime)) {
        log_event(LOG_WARNING, "certificate_expires", "days=%" PRId64 " words=\"%s\"",
                  buses_days_left(buses->expiry, at.utime), log_words(buses->expiry_text));
    }
}

/// What `systemctl status` shows.
static void notify_manager(monitor* self, instant at)
{
    const uint32_t faults = status_faults(self->status, at.now);
    char names[RSU_FAULTS_SIZE], text[64 + RSU_FAULTS_SIZE];
    rsu_fault_names(faults, names);
    snprintf(text, sizeof text, "%s: %u of %u vehicles planned%s%s",
             rsu_state_name(status_state(self->status, at.now)), self->cycle->view.controlled_count,
             self->cycle->view.count, faults != 0 ? ", fault " : "", faults != 0 ? names : "");
    notify_status(self->notify, text);
}

// ---- when asked ---------------------------------------------------------------------------

void monitor_log_statistics(const monitor* self, instant at)
{
    const verge_rsu_status_t status = monitor_message(self, at);
    const transport_stats stats = buses_statistics(&self->setup->buses);
    const cycle_counters* made = &self->cycle->counters;
    const inbox_counters* rx = &self->cycle->inbox.counters;
    char faults[RSU_FAULTS_SIZE];
    rsu_fault_names(status_faults(self->status, at.now), faults);
    log_event(LOG_ALWAYS, "statistics",
              "state=%s faults=%s cycle=%d vehicles=%d controlled=%d cycle_us_p99=%d "
              "cycle_us_max=%d deadline_misses=%d plans=%d fallbacks=%d overruns=%" PRIu64
              " cancelled=%" PRIu64 " withheld=%" PRIu64 " unusable=%" PRIu64 " refused=%" PRIu64
              " reordered=%" PRIu64
              " unstuck=%" PRIu64 " rx_accepted=%d unknown_target=%" PRIu64
              " incomplete=%" PRIu64 " bus_errors=%" PRIu64
              " arena_peak_bytes=%" PRId64 " nodes_peak=%d unexpanded=%" PRIu64,
              rsu_state_name((rsu_state)status.state), faults, status.cycle, status.vehicles_seen,
              status.vehicles_controlled, status.cycle_us_p99, status.cycle_us_max,
              status.deadline_misses, status.plans_sent, status.fallbacks, made->overruns,
              made->cancelled, made->withheld, made->unusable, made->refused, made->reordered,
              made->unstuck,
              status.rx_accepted, rx->unknown_target, rx->incomplete, stats.errors,
              status.arena_peak_bytes, status.nodes_peak, made->unexpanded);
}
