/// See report.h.
#include "report.h"

#include "common/message_json.h"
#include "daemon/page.h"

#include <inttypes.h>

/// A counter: a member of "counters" in the status, the metric verge_unit_NAME_total.
typedef struct counter {
    const char* name;
    uint64_t    value;
    const char* help;
} counter;
enum { COUNTERS = 17 };

static void counters_of(const obu_report* from, counter rows[COUNTERS])
{
    const unit_counters made = unit_count(from->unit);
    const transport_stats* bus = &from->bus;
    const counter all[COUNTERS] = {
        { "cycles", made.cycles, "Cycles begun." },
        { "without_trajectory", made.without, "Cycles before the first position: no trajectory." },
        { "mode_changes", made.mode_changes, "Changes of mode." },
        { "tracked", made.tracked,
          "Trajectories that are the points of the roadside unit's plan." },
        { "fallbacks", made.fallbacks, "Own trajectories that are fallbacks." },
        { "own_id_elsewhere", made.own_id_elsewhere,
          "States with the vehicle's own id from another bus than its own." },
        { "left_out", made.left_out, "Neighbours beyond vehicles_max, summed over the cycles." },
        { "unusable", made.unusable, "Neighbours with values that the planner refuses." },
        { "clock_steps", made.clock_steps, "Times the clock has stepped." },
        { "plans_repeated", made.repeated, "Plans of the roadside unit planned again." },
        { "plans_repeated_same", made.repeated_same,
          "Of the plans planned again, those equal to the message, bit for bit." },
        { "bus_received", bus->received, "Messages received." },
        { "bus_published", bus->published, "Messages sent." },
        { "bus_malformed", bus->malformed, "Messages that cannot be read." },
        { "bus_foreign", bus->foreign, "Messages received of other channels or topics." },
        { "bus_errors", bus->errors, "Failed sends and receives." },
        { "bus_lost", bus->lost, "DDS: senders that left or fell silent, and missed deadlines." },
    };
    memcpy(rows, all, sizeof all);
}

/// The results of received states, with their counters.
enum { STATE_RESULTS = 11 };
static void states_of(const obu_report* from, counter rows[STATE_RESULTS])
{
    const inbox_counters* rx = &unit_inbox(from->unit)->counters;
    const counter all[STATE_RESULTS] = {
        { "accepted", rx->rx_accepted, "" },         { "stale", rx->rx_stale, "" },
        { "future", rx->rx_future, "" },             { "duplicate", rx->rx_duplicate, "" },
        { "out_of_order", rx->rx_out_of_order, "" }, { "out_of_range", rx->rx_out_of_range, "" },
        { "off_map", rx->rx_off_map, "" },           { "over_capacity", rx->rx_over_capacity, "" },
        { "id_conflict", rx->rx_id_conflict, "" },   { "version", rx->rx_version, "" },
        { "other_map", rx->rx_other_map, "" },
    };
    memcpy(rows, all, sizeof all);
}

static void add_members(text* out, const char* key, const counter* rows, uint32_t count)
{
    text_add(out, ",\"%s\":{", key);
    for (uint32_t i = 0; i < count; i++) {
        text_add(out, "%s\"%s\":%" PRIu64, i > 0 ? "," : "", rows[i].name, rows[i].value);
    }
    text_add(out, "}");
}

static void plans_of(const obu_report* from, counter rows[LEADER_VERDICTS])
{
    for (uint32_t i = 0; i < LEADER_VERDICTS; i++) {
        rows[i] = (counter){ leader_verdict_name((leader_verdict)i),
                             unit_leader(from->unit)->counters[i], "" };
    }
}

static void modes_of(const obu_report* from, counter rows[WIRE_UNIT_MODES])
{
    const unit_counters made = unit_count(from->unit);
    for (int32_t i = 0; i < WIRE_UNIT_MODES; i++) {
        rows[i] = (counter){ wire_unit_mode_name(i), made.by_mode[i], "" };
    }
}

void obu_report_status(text* out, const obu_report* from)
{
    const unit_view view = unit_look(from->unit);
    const leader* leader = unit_leader(from->unit);
    const site* site = &from->config->site;
    wire_unit_reason why_not;
    const verge_vehicle_plan_t* plan = leader_plan(leader, from->utime, &why_not);
    char buses[SITE_BUSES_MAX * SITE_BUS_SIZE];
    site_bus_list(site, buses, sizeof buses);
    text_add(out, "{\"version\":\"%s\",\"vehicle_id\":%" PRId32 ",\"mode\":\"%s\"",
             VERGE_VERSION_STRING, from->config->vehicle_id,
             wire_unit_mode_name((int32_t)view.mode));
    text_add(out, ",\"reason\":\"%s\"", wire_unit_reason_name((int32_t)view.reason));
    text_add(out, ",\"about\":%" PRId32 ",\"rsu_id\":%" PRId32 ",\"followed_cycle\":%" PRId32,
             view.vehicle, leader->rsu_id, plan != NULL ? plan->cycle : -1);
    text_add(out, ",\"bus\":");
    text_add_string(out, buses);
    text_add(out, ",\"cycle_ms\":%u,\"utime\":%" PRId64 ",\"start_utime\":%" PRId64
             ",\"map_crc32\":\"%08" PRIx32 "\",\"config_crc32\":\"%08" PRIx32 "\"", site->cycle_ms,
             from->utime, from->start_utime, site->map_crc32, site->config_crc32);
    text_add(out, ",\"state_age_ms\":%" PRId64 ",\"neighbours\":%u,\"cycle_us\":{\"last\":%" PRIu32
             ",\"p99\":%" PRIu32 ",\"max\":%" PRIu32 "},\"deadline_misses\":%" PRIu64
             ",\"log_dropped\":%" PRIu64,
             view.state_utime > 0 ? (from->utime - view.state_utime) / 1000 : -1, view.neighbours,
             from->cycle_time->last, timing_p99(from->cycle_time), from->cycle_time->max,
             from->deadline_misses, from->log_dropped);
    counter rows[COUNTERS], modes[WIRE_UNIT_MODES], plans[LEADER_VERDICTS], states[STATE_RESULTS];
    modes_of(from, modes);
    counters_of(from, rows);
    plans_of(from, plans);
    states_of(from, states);
    add_members(out, "trajectories", modes, WIRE_UNIT_MODES);
    add_members(out, "counters", rows, COUNTERS);
    add_members(out, "plans", plans, LEADER_VERDICTS);
    add_members(out, "states", states, STATE_RESULTS);
    page_strangers_json(out, &from->bus);
    text_add(out, "}\n");
}

static void add_vehicle(text* out, const obu_report* from, const verge_scene* scene, uint32_t i)
{
    const verge_vehicle* vehicle = &scene->vehicles[i];
    const verge_vehicle_plan_t* plan =
        leader_plan_of(unit_leader(from->unit), vehicle->id, scene->utime);
    page_vehicle_json(out, vehicle, 0, scene->positions[i].lane_id, plan);
}

void obu_report_vehicles(text* out, const obu_report* from)
{
    const unit_view view = unit_look(from->unit);
    text_add(out, "{\"utime\":%" PRId64 ",\"vehicles\":[", view.utime);
    for (uint32_t i = 0; i < view.scene->vehicle_count; i++) {
        text_add(out, "%s", i > 0 ? "," : "");
        add_vehicle(out, from, view.scene, i);
    }
    text_add(out, "]}\n");
}

void obu_report_plans(text* out, const obu_report* from)
{
    wire_unit_reason why_not;
    const verge_vehicle_plan_t* plan = leader_plan(unit_leader(from->unit), from->utime, &why_not);
    text_add(out, "{\"plans\":[");
    if (plan != NULL) {
        message_json(out, TRANSPORT_PLAN, plan);
    }
    text_add(out, "]}\n");
}

// ---- Prometheus ---------------------------------------------------------------------------

static void add_labelled(text* out, const char* name, const char* label, const char* help,
                         const counter* rows, uint32_t count)
{
    page_head(out, name, "counter", help);
    for (uint32_t i = 0; i < count; i++) {
        page_labelled(out, name, label, rows[i].name, rows[i].value);
    }
}

void obu_report_metrics(text* out, const obu_report* from)
{
    const unit_view view = unit_look(from->unit);
    const site* site = &from->config->site;
    page_head(out, "verge_build_info", "gauge",
              "Always 1; the labels give version and configuration.");
    text_add(out, "verge_build_info{version=\"%s\",vehicle_id=\"%" PRId32 "\"",
             VERGE_VERSION_STRING, from->config->vehicle_id);
    text_add(out, ",map_crc32=\"%08" PRIx32 "\",config_crc32=\"%08" PRIx32 "\"} 1\n",
             site->map_crc32, site->config_crc32);
    page_head(out, "verge_start_time_seconds", "gauge", "When the daemon was started, Unix time.");
    text_add(out, "verge_start_time_seconds %.6f\n", (double)from->start_utime * 1e-6);
    page_value(out, "verge_unit_mode", "gauge", "0 following, 1 departing, 2 alone, 3 stopping.",
               (int64_t)view.mode);
    page_value(out, "verge_unit_reason", "gauge", "Why this mode; the codes are in verge(7).",
               (int64_t)view.reason);
    page_value(out, "verge_unit_neighbours", "gauge", "Other vehicles in the last cycle.",
               (int64_t)view.neighbours);
    counter rows[COUNTERS], modes[WIRE_UNIT_MODES], plans[LEADER_VERDICTS], states[STATE_RESULTS];
    modes_of(from, modes);
    counters_of(from, rows);
    plans_of(from, plans);
    states_of(from, states);
    add_labelled(out, "verge_unit_trajectories_total", "mode", "Trajectories sent, by mode.", modes,
                 WIRE_UNIT_MODES);
    add_labelled(out, "verge_unit_plans_total", "result", "Plans received, by result.", plans,
                 LEADER_VERDICTS);
    add_labelled(out, "verge_rx_total", "result", "Vehicle states received, by result.", states,
                 STATE_RESULTS);
    page_strangers(out, &from->bus);
    page_cycle_times(out, "Time of a cycle: the last, the 99th percentile of the last 1024, the "
                     "longest.", from->cycle_time->last, timing_p99(from->cycle_time),
                     from->cycle_time->max);
    page_value(out, "verge_deadline_misses_total", "counter", "Ticks without a trajectory in time.",
               (int64_t)from->deadline_misses);
    page_value(out, "verge_log_dropped_total", "counter",
               "Lines of the log that were lost: it was not read, or could not be written.",
               (int64_t)from->log_dropped);
    for (uint32_t i = 0; i < COUNTERS; i++) {
        char name[64];
        (void)snprintf(name, sizeof name, "verge_unit_%s_total", rows[i].name);
        page_value(out, name, "counter", rows[i].help, (int64_t)rows[i].value);
    }
}
