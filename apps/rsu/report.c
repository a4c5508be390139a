/// See report.h.
#include "report.h"

#include "common/message_json.h"
#include "daemon/page.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/// A counter that the status message has no field for.
typedef struct counter {
    const char* name;
    uint64_t    value;
    const char* help;
} counter;
enum { COUNTERS = 17 };

static void counters_of(const report_input* from, counter rows[COUNTERS])
{
    const cycle_counters* made = &from->cycle->counters;
    const inbox_counters* states = &from->cycle->inbox.counters;
    const transport_stats* bus = &from->bus;
    const counter all[COUNTERS] = {
        { "cycles_planned", made->planned, "Cycles with a vehicle to plan." },
        { "cycles_refused", made->refused, "Cycles that the planner refused: a defect of verge." },
        { "overruns", made->overruns, "Of the plans sent, those that replaced a late one." },
        { "plans_cancelled", made->cancelled, "Cancellations of plans." },
        { "messages_withheld", made->withheld,
          "Plans and cancellations not sent, because another unit plans." },
        { "vehicles_unusable", made->unusable,
          "Vehicles left out of a cycle, because the planner refuses their values." },
        { "reordered", made->reordered, "Circles of standing vehicles that got a new order." },
        { "unstuck", made->unstuck, "Vehicles that stood without a cause and go first now." },
        { "states_unknown_target", states->unknown_target,
          "States with a target lane that the road does not have; used without it." },
        { "states_incomplete", states->incomplete,
          "States without heading or speed; used as those of obstacles." },
        { "candidates", made->candidates, "Trajectories evaluated." },
        { "unexpanded", made->unexpanded,
          "Iterations of the search without a new node, because the tree was full." },
        { "bus_received", bus->received, "Messages received." },
        { "bus_published", bus->published, "Messages sent." },
        { "bus_foreign", bus->foreign, "Messages received of other channels or topics." },
        { "bus_errors", bus->errors, "Failed sends and receives." },
        { "bus_lost", bus->lost, "DDS: senders that left or fell silent, and missed deadlines." },
    };
    memcpy(rows, all, sizeof all);
}

static void add_counters(text* out, const report_input* from)
{
    counter rows[COUNTERS];
    counters_of(from, rows);
    text_add(out, ",\"counters\":{");
    for (uint32_t i = 0; i < COUNTERS; i++) {
        text_add(out, "%s\"%s\":%" PRIu64, i > 0 ? "," : "", rows[i].name, rows[i].value);
    }
    text_add(out, "}");
}

static void add_others_json(text* out, const report_input* from)
{
    const char* comma = "";
    text_add(out, ",\"standby\":%s,\"others\":[",
             peers_leader(from->peers, from->now) != NULL ? "true" : "false");
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        const peer* peer = &from->peers->peer[i];
        if (peers_audible(peer, from->now)) {
            text_add(out, "%s{\"rsu_id\":%" PRId32 ",\"start_utime\":%" PRId64 ",\"leads\":%s}",
                     comma, peer->rsu_id, peer->start_utime,
                     peers_leads(from->peers, peer) ? "true" : "false");
            comma = ",";
        }
    }
    text_add(out, "]");
}

void report_status(text* out, const report_input* from)
{
    const verge_rsu_status_t* status = &from->status;
    char buses[SITE_BUSES_MAX * SITE_BUS_SIZE];
    site_bus_list(&from->config->site, buses, sizeof buses);
    text_add(out, "{\"version\":\"%s\",\"state\":\"%s\",\"fault\":\"%s\",\"faults\":[",
             VERGE_VERSION_STRING, message_rsu_state(status->state),
             message_rsu_fault(status->fault));
    const char* comma = "";
    for (int32_t fault = RSU_FAULT_COUNT - 1; fault > RSU_FAULT_NONE; fault--) {
        if ((from->faults & 1u << fault) != 0) {
            text_add(out, "%s\"%s\"", comma, message_rsu_fault(fault));
            comma = ",";
        }
    }
    text_add(out, "],\"bus\":");
    text_add_string(out, buses);
    text_add(out, ",\"cycle_ms\":%u,\"log_dropped\":%" PRIu64 ",\"record_dropped\":%" PRIu64,
             from->config->site.cycle_ms, from->log_dropped, from->record_dropped);
    add_others_json(out, from);
    add_counters(out, from);
    page_strangers_json(out, &from->bus);
    text_add(out, ",\"status\":");
    message_json(out, TRANSPORT_STATUS, status);
    text_add(out, "}\n");
}

/// The valid plan of a vehicle; null: none.
static const verge_vehicle_plan_t* plan_of(const cycle* cycle, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < cycle->valid_count; i++) {
        if (cycle->valid_plans[i].vehicle_id == vehicle_id) {
            return &cycle->valid_plans[i];
        }
    }
    return NULL;
}

static void add_vehicle(text* out, const cycle* cycle, uint32_t index)
{
    const verge_vehicle* vehicle = &cycle->view.vehicles[index];
    const verge_lane_position on = verge_road_project(
        verge_planner_road(cycle->def.planner), vehicle->x, vehicle->y, vehicle->heading,
        VERGE_NO_LANE);
    const int64_t age_ms = (cycle->utime - cycle->view.state_utime[index]) / 1000;
    page_vehicle_json(out, vehicle, age_ms, on.lane_id, plan_of(cycle, vehicle->id));
}

void report_vehicles(text* out, const cycle* cycle)
{
    text_add(out, "{\"utime\":%" PRId64 ",\"vehicles\":[", cycle->number < 0 ? 0 : cycle->utime);
    for (uint32_t i = 0; i < cycle->view.count; i++) {
        text_add(out, "%s", i > 0 ? "," : "");
        add_vehicle(out, cycle, i);
    }
    text_add(out, "]}\n");
}

void report_plans(text* out, const cycle* cycle)
{
    text_add(out, "{\"plans\":[");
    for (uint32_t i = 0; i < cycle->valid_count; i++) {
        text_add(out, "%s", i > 0 ? "," : "");
        message_json(out, TRANSPORT_PLAN, &cycle->valid_plans[i]);
    }
    text_add(out, "]}\n");
}

// ---- Prometheus ---------------------------------------------------------------------------

static void add_faults(text* out, uint32_t faults)
{
    page_head(out, "verge_fault_active", "gauge", "1 for each fault that is active; see verge(7).");
    for (int32_t fault = RSU_FAULT_NONE + 1; fault < RSU_FAULT_COUNT; fault++) {
        text_add(out, "verge_fault_active{fault=\"%s\"} %u\n", message_rsu_fault(fault),
                 faults >> fault & 1u);
    }
}

static void add_received(text* out, const verge_rsu_status_t* status)
{
    const struct { const char* result; int32_t count; } rows[] = {
        { "accepted", status->rx_accepted },
        { "stale", status->rx_stale },
        { "future", status->rx_future },
        { "duplicate", status->rx_duplicate },
        { "out_of_order", status->rx_out_of_order },
        { "malformed", status->rx_malformed },
        { "out_of_range", status->rx_out_of_range },
        { "off_map", status->rx_off_map },
        { "over_capacity", status->rx_over_capacity },
        { "id_conflict", status->rx_id_conflict },
        { "dropped", status->rx_dropped },
        { "version", status->rx_version },
        { "other_map", status->rx_other_map },
    };
    page_head(out, "verge_rx_total", "counter", "Vehicle states received, by result.");
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        text_add(out, "verge_rx_total{result=\"%s\"} %" PRId32 "\n", rows[i].result,
                 rows[i].count);
    }
}

static void add_arena(text* out, const verge_rsu_status_t* status)
{
    page_head(out, "verge_arena_bytes", "gauge", "The planner's memory: its size, and the peak.");
    text_add(out, "verge_arena_bytes{stat=\"size\"} %" PRId64 "\n"
             "verge_arena_bytes{stat=\"peak\"} %" PRId64 "\n", status->arena_size_bytes,
             status->arena_peak_bytes);
}

static void add_totals(text* out, const report_input* from)
{
    counter rows[COUNTERS];
    counters_of(from, rows);
    for (uint32_t i = 0; i < COUNTERS; i++) {
        char name[64];
        (void)snprintf(name, sizeof name, "verge_%s_total", rows[i].name);
        page_value(out, name, "counter", rows[i].help, (int64_t)rows[i].value);
    }
}

void report_metrics(text* out, const report_input* from)
{
    const verge_rsu_status_t* status = &from->status;
    page_head(out, "verge_build_info", "gauge",
              "Always 1; the labels give version and configuration.");
    text_add(out, "verge_build_info{version=\"%s\",rsu_id=\"%" PRId32 "\",map_crc32=\"%08" PRIx32
             "\",config_crc32=\"%08" PRIx32 "\"} 1\n", VERGE_VERSION_STRING, status->rsu_id,
             (uint32_t)status->map_crc32, (uint32_t)status->config_crc32);
    page_head(out, "verge_start_time_seconds", "gauge", "When the daemon was started, Unix time.");
    text_add(out, "verge_start_time_seconds %.6f\n", (double)status->start_utime * 1e-6);
    page_value(out, "verge_state", "gauge",
               "0 starting, 1 waiting for input, 2 running, 3 degraded, 4 stopping.",
               status->state);
    page_value(out, "verge_fault", "gauge", "Worst active fault, 0 none; see verge(7).",
           status->fault);
    add_faults(out, from->faults);
    page_value(out, "verge_standby", "gauge", "1: no plan is sent, because another unit leads.",
           peers_leader(from->peers, from->now) != NULL ? 1 : 0);
    page_value(out, "verge_cycles_total", "counter", "Planning cycles begun.",
           (int64_t)from->cycle->number + 1);
    page_value(out, "verge_vehicles_seen", "gauge", "Vehicles in the last cycle.",
           status->vehicles_seen);
    page_value(out, "verge_vehicles_controlled", "gauge", "Of the vehicles seen, those planned.",
           status->vehicles_controlled);
    page_cycle_times(out, "Time of a planning cycle: the last, the 99th percentile of the last "
                     "1024, the longest.", (uint32_t)status->cycle_us_last,
                     (uint32_t)status->cycle_us_p99, (uint32_t)status->cycle_us_max);
    page_value(out, "verge_deadline_misses_total", "counter",
               "Ticks at which the planner was still running.", status->deadline_misses);
    page_value(out, "verge_plans_sent_total", "counter", "Plans sent, without cancellations.",
           status->plans_sent);
    page_value(out, "verge_fallbacks_total", "counter", "Of the plans sent, fallbacks.",
           status->fallbacks);
    page_value(out, "verge_log_dropped_total", "counter",
               "Lines of the log that were lost: it was not read, or could not be written.",
           (int64_t)from->log_dropped);
    page_value(out, "verge_record_dropped_total", "counter",
               "Events missing in the recording, for the same reasons.",
           (int64_t)from->record_dropped);
    add_received(out, status);
    page_strangers(out, &from->bus);
    add_totals(out, from);
    add_arena(out, status);
    page_value(out, "verge_nodes_peak", "gauge", "The most nodes that the search tree had.",
           status->nodes_peak);
}
