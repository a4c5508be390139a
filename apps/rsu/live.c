/// A cycle begins at a tick of the timer: the waiting messages are received, the snapshot is made
/// and the worker starts. While it plans, the loop receives states for the next cycle. When it is
/// done, the plans are sent. A tick while the worker is busy is a missed deadline: the rest of the
/// last plans is sent, or fallbacks (cycle_overrun()). The late plan is still sent when it is
/// ready, from its first point in the future, and the next tick begins a new cycle.
#define _GNU_SOURCE
#include "live.h"

#include "cycle.h"
#include "monitor.h"
#include "report.h"
#include "status.h"

#include "common/floating.h"
#include "common/vehicle_fault.h"
#include "daemon/events.h"
#include "daemon/log.h"
#include "daemon/notify.h"
#include "daemon/operators.h"
#include "daemon/realtime.h"
#include "daemon/recorder.h"
#include "daemon/reload.h"
#include "daemon/start.h"
#include "daemon/worker.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    DRAIN_BATCH = 64,
    DRAIN_ROUNDS_MAX = 64,   // before a cycle: empties the socket's buffer, but ends in a flood
    OWN_ENDS = 5,            // descriptors of the loop itself: signals, planning, reload, timers
    STATUS_PERIOD_MS = 1000, // and on each change of state or fault
    // For the last events and lines. At SIGTERM everything has to be over within one second.
    RECORD_PATIENCE_US = 300000,
    LOG_PATIENCE_US = 200000,
    FAIL_PATIENCE_US = 5000000, // for the reason of a start that has failed
};

static const char NAME[] = "verge-rsu";

typedef struct live {
    const live_options* options;
    setup          now;          // the configuration in effect
    reloader       reloader;     // prepares the next one
    uint64_t       record_dropped; // by recordings that have ended
    worker*        worker;
    int            signal_fd, cycle_fd, status_fd;
    int64_t        cycle_count;  // cycles begun
    int64_t        begun;        // [us] monotonic, of the running cycle
    bool           corrected;    // the floating-point mode was wrong in the running cycle
    bool           correction_logged;
    bool           late;         // a tick came while the running cycle was planning
    monitor         monitor;
    notify         notify;       // the service manager
    operators      operators;
    status         status;
    peers          peers;        // other roadside units
    int32_t        leader_id;    // for which it stands by, as logged; -1: none
    bool           announce;     // another unit waits for a status
    cycle          cycle;
    transport_message inbound[DRAIN_BATCH];
} live;

static int  start(live* self);
static void loop(live* self);
static int  stop(live* self);
static void release(live* self);

int live_run(const live_options* options)
{
    static live self; // large; there is one daemon in a process
    memset(&self, 0, sizeof self);
    self.options = options;
    self.monitor = (monitor){ .setup = &self.now, .cycle = &self.cycle, .status = &self.status,
                            .notify = &self.notify };
    self.signal_fd = self.cycle_fd = self.status_fd = self.notify.fd = -1;
    const int code = start(&self);
    if (code != 0) {
        log_stop(FAIL_PATIENCE_US);
        release(&self);
        return code;
    }
    loop(&self);
    return stop(&self);
}

// ---- start --------------------------------------------------------------------------------

static int  load(live* self);
static int  open_ends(live* self);
static int  open_descriptors(live* self);
static int  open_operators(live* self);
static void open_notify(live* self);
static int  fail(int code, const char* line);

static int start(live* self)
{
    signals_block(); // before the first thread, because threads inherit it
    int code = load(self);
    if (code == 0) {
        code = open_ends(self);
    }
    if (code == 0) {
        code = open_descriptors(self);
    }
    if (code == 0) {
        code = open_operators(self);
    }
    if (code != 0) {
        return code;
    }
    open_notify(self);
    self->status.start_utime = clock_us(CLOCK_REALTIME);
    const cycle_def def = config_cycle_def(config_of(self->now.site), &self->now.planner);
    cycle_init(&self->cycle, &def);
    const peers_def peers = config_peers_def(config_of(self->now.site), self->status.start_utime);
    peers_init(&self->peers, &peers);
    self->leader_id = -1;
    const site* site = self->now.site;
    timer_arm(self->cycle_fd, site->cycle_ms);
    timer_arm(self->status_fd, STATUS_PERIOD_MS);
    char buses[SITE_BUSES_MAX * SITE_BUS_SIZE];
    site_bus_list(site, buses, sizeof buses);
    log_event(LOG_ALWAYS, "READY",
              "version=%s rsu_id=%d bus=%s cycle_ms=%u planner_bytes=%zu map_crc32=0x%08x "
              "config_crc32=0x%08x",
              VERGE_VERSION_STRING, config_of(site)->rsu_id, buses, site->cycle_ms,
              self->now.planner.size, site->map_crc32, site->config_crc32);
    notify_send(&self->notify, "READY=1");
    return 0;
}

static void check_patience(const live* self);

static void open_notify(live* self)
{
    if (!notify_open(&self->notify)) {
        log_event(LOG_WARNING, "notify_unusable",
                  "reason=\"NOTIFY_SOCKET is neither a short path nor an abstract name\"");
    }
    check_patience(self);
}

/// Completed cycles feed the watchdog, so its period must be longer than one cycle.
static void check_patience(const live* self)
{
    const int64_t patience_us = self->notify.watchdog_us;
    if (patience_us > 0 && patience_us < 2000 * (int64_t)self->now.site->cycle_ms) {
        log_event(LOG_WARNING, "watchdog_short",
                  "watchdog_us=%" PRId64 " cycle_ms=%u expected=\"WatchdogSec of at least two "
                  "cycles\"", patience_us, self->now.site->cycle_ms);
    }
}

/// Logged once, because whatever changes the mode usually does so again and again.
static void log_correction(live* self, const char* when)
{
    if (!self->correction_logged) {
        self->correction_logged = true;
        log_event(LOG_WARNING, "floating_corrected",
                  "when=%s words=\"something in this process had changed the rounding mode or "
                  "disabled subnormal numbers, as libraries built with -Ofast do\"", when);
    }
}

static setup_def make_def(const live* self)
{
    return (setup_def){ .path = self->options->start.config_path, .site = &CONFIG_DEF,
                        .bus_use = CONFIG_BUS_USE, .log = start_complaint };
}

static int load(live* self)
{
    const setup_def def = make_def(self);
    int code = start_load(&self->now, &def, &self->options->start, NAME);
    if (code != 0) {
        return code;
    }
    if (self->options->start.floating_corrected) {
        log_correction(self, "start");
    }
    char error[CONFIG_ERROR_SIZE];
    code = setup_plan(&self->now, &def, error);
    return code == 0 ? 0 : fail(code, error);
}

static int open_ends(live* self)
{
    char error[CONFIG_ERROR_SIZE];
    const setup_def def = make_def(self);
    const int code = setup_connect(&self->now, &def, error);
    if (code != 0) {
        return fail(code, error);
    }
    if (self->options->record_path == NULL) {
        return 0;
    }
    const char* path = self->options->record_path;
    return recorder_open(&self->now.record, path, error, sizeof error) ? 0 : fail(EXIT_OS, error);
}

static int open_descriptors(live* self)
{
    self->signal_fd = signals_open();
    self->cycle_fd = timer_open();
    self->status_fd = timer_open();
    if (self->signal_fd < 0 || self->cycle_fd < 0 || self->status_fd < 0) {
        return fail(EXIT_OS, "the system refused a descriptor, expected a higher LimitNOFILE");
    }
    char error[CONFIG_ERROR_SIZE];
    const service* service = &self->now.site->service;
    self->worker = worker_create("verge-plan", &service->planning);
    if (self->worker == NULL) {
        realtime_explain(service, errno, error, sizeof error);
        return fail(EXIT_OS, error);
    }
    const reloader_def def = { .setup = make_def(self), .now = &self->now };
    if (!reloader_open(&self->reloader, &def)) {
        return fail(EXIT_OS, "the system refused a thread for reloads, expected a higher "
                             "LimitNPROC or TasksMax");
    }
    return 0;
}

static void answer_status(void* context, text* answer);
static void answer_vehicles(void* context, text* answer);
static void answer_plans(void* context, text* answer);
static void answer_metrics(void* context, text* page);
static reload_result reload(void* context, uint64_t* ticket, const char** reason);

static const operators_request REQUESTS[] = {
    { "status", answer_status },
    { "vehicles", answer_vehicles },
    { "plans", answer_plans },
    { NULL, NULL },
};

/// Opens what serves operators. Then everything is allocated, and memory is locked.
static int open_operators(live* self)
{
    char error[CONFIG_ERROR_SIZE];
    const service*      service = &self->now.site->service;
    const operators_def def = { .context = self, .requests = REQUESTS, .metrics = answer_metrics,
                                .answer_size = REPORT_SIZE, .reload = reload };
    const int code = operators_open(&self->operators, service, &def, error);
    if (code != 0) {
        return fail(code, error);
    }
    return realtime_lock(service, error, sizeof error) ? 0 : fail(EXIT_OS, error);
}

static int fail(int code, const char* line)
{
    return start_fail(NAME, code, line);
}

// ---- the loop -----------------------------------------------------------------------------

static bool on_signals(live* self);
static void on_bus(live* self);
static void on_planned(live* self);
static void on_reload_over(live* self);
static void on_tick(live* self);
static void on_status_due(live* self);
static void check_record(live* self);
static void check_peers(live* self);
static void announce(live* self);

static void loop(live* self)
{
    const int64_t limit = self->options->start.cycles;
    for (;;) {
        struct pollfd ends[OWN_ENDS + SITE_BUSES_MAX + OPERATORS_ENDS] = {
            { .fd = self->signal_fd, .events = POLLIN },
            { .fd = worker_fd(self->worker), .events = POLLIN },
            { .fd = reloader_fd(&self->reloader), .events = POLLIN },
            { .fd = self->cycle_fd, .events = POLLIN },
            { .fd = self->status_fd, .events = POLLIN },
        };
        uint32_t count = OWN_ENDS;
        count += buses_poll(&self->now.buses, ends + count);
        count += operators_ends(&self->operators, ends + count);
        if (poll(ends, count, STATUS_PERIOD_MS) < 0 && errno != EINTR) {
            log_event(LOG_ERROR, "poll", "error=%s", strerror(errno));
        }
        if (on_signals(self)) {
            return;
        }
        // A plan that is ready is sent first. Messages are received before a new cycle begins.
        on_planned(self);
        check_record(self);
        on_reload_over(self);
        if (limit > 0 && self->cycle_count >= limit && !worker_busy(self->worker)) {
            return;
        }
        on_bus(self);
        on_tick(self);
        on_status_due(self);
        check_peers(self);
        monitor_update(&self->monitor, instant_now());
        announce(self);
        // Last, because operators can wait.
        operators_serve(&self->operators, clock_us(CLOCK_MONOTONIC));
    }
}

static void count_dropped(live* self)
{
    self->status.log_dropped = log_dropped();
    self->status.record_dropped =
        self->record_dropped + recorder_dropped(self->now.record);
}

static void on_status_due(live* self)
{
    if (timer_expirations(self->status_fd) > 0) {
        count_dropped(self);
        monitor_each_second(&self->monitor, instant_now());
        operators_write(&self->operators);
    }
}

// ---- receiving ----------------------------------------------------------------------------

static void record_message(live* self, int64_t utime, const transport_message* message);

static void receive_peer(live* self, const transport_message* message);

static void receive_message(live* self, const transport_message* message)
{
    if (message->kind == TRANSPORT_STATUS || message->kind == TRANSPORT_PLAN) {
        receive_peer(self, message);
        return;
    }
    const uint64_t conflicts = self->cycle.inbox.counters.rx_id_conflict;
    const int32_t vehicle = message->as.state.vehicle_id;
    if (cycle_offer(&self->cycle, message)) {
        record_message(self, message->arrival_utime, message);
    } else if (self->cycle.inbox.counters.rx_id_conflict > conflicts) {
        char sender[64];
        transport_sender_text(self->now.buses.bus[message->bus], message->sender, sender,
                              sizeof sender);
        status_fault(&self->status, RSU_FAULT_ID_CONFLICT, clock_us(CLOCK_MONOTONIC), false);
        const uint32_t cause = (uint32_t)vehicle * SITE_BUSES_MAX + message->bus;
        log_repeated(LOG_WARNING, "id_conflict", cause,
                     "vehicle=%d bus=%s refused_sender=%s", vehicle,
                     self->now.site->bus[message->bus], sender);
    } else {
        log_event(LOG_DEBUG, "state_refused", "vehicle=%d", vehicle);
    }
}

/// A message of another unit, or of this one.
static void receive_peer(live* self, const transport_message* message)
{
    const peer* peer = peers_offer(&self->peers, message, clock_us(CLOCK_MONOTONIC));
    if (peer == NULL) {
        return;
    }
    const bool same_id = peer->rsu_id == self->peers.def.rsu_id;
    char sender[64], vehicle[32] = "";
    transport_sender_text(self->now.buses.bus[message->bus], message->sender, sender,
                          sizeof sender);
    if (peer->shares) {
        snprintf(vehicle, sizeof vehicle, " vehicle=%" PRId32, peer->vehicle_id);
    }
    log_event(same_id || peer->shares ? LOG_WARNING : LOG_INFO, "other_rsu",
              "rsu_id=%" PRId32 " same_id=%s leads=%s start_utime=%" PRId64 "%s bus=%s sender=%s",
              peer->rsu_id, same_id ? "true" : "false",
              peers_leads(&self->peers, peer) ? "true" : "false", peer->start_utime, vehicle,
              self->now.site->bus[message->bus], sender);
    self->announce = true;
}

/// Logs which units have become silent and whether this one stands by, and sets its fault.
static void check_peers(live* self)
{
    const instant at = instant_now();
    for (const peer* peer; (peer = peers_silent(&self->peers, at.now)) != NULL;) {
        log_event(LOG_INFO, "other_rsu_silent", "rsu_id=%" PRId32 " start_utime=%" PRId64,
                  peer->rsu_id, peer->start_utime);
    }
    const peer*   leader = peers_leader(&self->peers, at.now);
    const int32_t leader_id = leader != NULL ? leader->rsu_id : -1;
    if (leader_id != self->leader_id) {
        log_event(LOG_WARNING, leader != NULL ? "stands_by" : "takes_over",
                  "cycle=%" PRId64 " %s=%" PRId32, self->cycle.number,
                  leader != NULL ? "leader" : "after",
                  leader != NULL ? leader_id : self->leader_id);
        self->leader_id = leader_id;
    }
    if (peers_fault(&self->peers, at.now)) {
        status_fault(&self->status, RSU_FAULT_OTHER_RSU, at.now, false);
    }
}

/// Another unit waits for a sign of this one: its first one, or that of a cycle.
static void announce(live* self)
{
    if (self->announce) {
        self->announce = false;
        monitor_publish(&self->monitor, instant_now());
    }
}

/// Receives a batch from each bus. Returns the size of the largest batch.
static uint32_t receive(live* self)
{
    uint32_t most = 0;
    for (uint32_t bus = 0; bus < self->now.buses.count; bus++) {
        const uint32_t count = buses_drain(&self->now.buses, bus, self->inbound, DRAIN_BATCH);
        for (uint32_t i = 0; i < count; i++) {
            receive_message(self, &self->inbound[i]);
        }
        most = count > most ? count : most;
    }
    return most;
}

static void on_bus(live* self)
{
    receive(self);
}

static void record_message(live* self, int64_t utime, const transport_message* message)
{
    if (self->now.record != NULL) {
        recorder_put(self->now.record, utime, message);
    }
}

/// False: the last events could not be written in time.
static bool end_record(live* self)
{
    self->record_dropped += recorder_dropped(self->now.record);
    const bool whole = recorder_close(self->now.record, RECORD_PATIENCE_US);
    self->now.record = NULL;
    return whole;
}

/// A recording that cannot be written ends; planning continues.
static void check_record(live* self)
{
    const int fault = recorder_fault(self->now.record);
    if (fault != 0) {
        log_event(LOG_ERROR, "record_ended", "reason=write_failed error=\"%s\"", strerror(fault));
        status_fault(&self->status, RSU_FAULT_RECORD, 0, true);
        end_record(self);
    }
}

static void record_mark(live* self, int64_t utime, bool overrun)
{
    transport_message message;
    memset(&message, 0, sizeof message);
    message.kind = TRANSPORT_MARK;
    message.as.mark.utime = utime;
    message.as.mark.cycle = self->cycle.number;
    message.as.mark.overrun = overrun ? 1 : 0;
    record_message(self, utime, &message);
}

// ---- a cycle ------------------------------------------------------------------------------

static void apply_next(live* self);
static void send_messages(live* self);
static void log_waiting(const live* self);
static void send_overrun(live* self);

/// Runs in the planning thread. Its helpers run nothing but planning tasks, so their floating-point
/// mode stays what it was at their start.
static void plan_job(void* arg)
{
    live* self = arg;
    self->corrected = floating_correct() || self->corrected;
    cycle_plan(&self->cycle);
}

static void on_tick(live* self)
{
    const uint64_t ticks = timer_expirations(self->cycle_fd);
    if (ticks == 0) {
        return;
    }
    const bool busy = worker_busy(self->worker);
    const uint64_t missed = busy ? ticks : ticks - 1;
    if (missed > 0) {
        self->status.deadline_misses += missed;
        status_fault(&self->status, RSU_FAULT_DEADLINE, clock_us(CLOCK_MONOTONIC), false);
        log_repeated(LOG_WARNING, "deadline_missed", 0,
                     "cycle=%" PRId64 " cycle_ms=%u total=%" PRIu64, self->cycle.number,
                     self->now.site->cycle_ms, self->status.deadline_misses);
    }
    if (busy) {
        send_overrun(self);
        return;
    }
    if (self->options->start.cycles > 0 && self->cycle_count >= self->options->start.cycles) {
        return;
    }
    apply_next(self);
    for (uint32_t round = 0; round < DRAIN_ROUNDS_MAX && receive(self) == DRAIN_BATCH; round++) {
    }
    self->begun = clock_us(CLOCK_MONOTONIC);
    self->late = false;
    self->corrected = floating_correct(); // this thread projects states
    const uint64_t unusable = self->cycle.counters.unusable;
    cycle_begin(&self->cycle, self->cycle_count++, clock_us(CLOCK_REALTIME));
    if (self->cycle.counters.unusable > unusable) {
        char words[VEHICLE_FAULT_SIZE];
        vehicle_fault_text(&self->cycle.fault, words);
        log_repeated(LOG_WARNING, "vehicle_unusable", (uint32_t)self->cycle.fault.vehicle_id,
                     "vehicle=%d reason=\"%s\"", self->cycle.fault.vehicle_id, log_words(words));
    }
    record_mark(self, self->cycle.utime, false);
    worker_start(self->worker, plan_job, self);
}

/// The messages of a tick at which planning is not over: the rest of the last plans, or fallbacks.
static void send_overrun(live* self)
{
    const int64_t utime = clock_us(CLOCK_REALTIME);
    self->late = true;
    record_mark(self, utime, true);
    cycle_overrun(&self->cycle, utime);
    send_messages(self);
}

static void on_planned(live* self)
{
    if (!worker_collect(self->worker)) {
        return;
    }
    const cycle_counters before = self->cycle.counters;
    cycle_end(&self->cycle);
    if (self->late) {
        cycle_retime(&self->cycle, clock_us(CLOCK_REALTIME));
    }
    send_messages(self);
    const int64_t now = clock_us(CLOCK_MONOTONIC);
    self->announce = self->announce || peers_any(&self->peers, now);
    timing_add(&self->status.cycle_time, now - self->begun);
    if (self->notify.watchdog_us > 0) {
        notify_send(&self->notify, "WATCHDOG=1");
    }
    self->status.has_vehicles = self->cycle.view.count > 0;
    if (self->corrected) {
        log_correction(self, "cycle");
    }
    const cycle_counters* counters = &self->cycle.counters;
    if (counters->refused > before.refused) {
        status_fault(&self->status, RSU_FAULT_PLANNER, now, false);
        log_repeated(LOG_ERROR, "planner_refused", (uint32_t)self->cycle.status,
                     "cycle=%" PRId64 " reason=\"%s\"", self->cycle.number,
                     verge_status_text(self->cycle.status));
    }
    log_event(LOG_DEBUG, "cycle",
              "number=%" PRId64 " vehicles=%u controlled=%u fallbacks=%u us=%u "
              "digest=0x%016" PRIx64,
              self->cycle.number, self->cycle.view.count, self->cycle.view.controlled_count,
              self->cycle.plan.fallback_count, self->status.cycle_time.last,
              self->cycle.plan.digest);
    log_waiting(self);
}

/// Who waits for something else than in the cycle before.
static void log_waiting(const live* self)
{
    for (uint32_t i = 0; i < self->cycle.plan.vehicle_count; i++) {
        const verge_vehicle_plan* plan = &self->cycle.plan.vehicles[i];
        if (plan->why.code != VERGE_WHY_NONE && (plan->changed & VERGE_CHANGED_WHY) != 0) {
            char words[128];
            verge_cause_say(&plan->why, words, sizeof words);
            log_event(LOG_DEBUG, "waits", "vehicle=%d why=%s words=\"%s\"", plan->vehicle_id,
                      verge_why_name(plan->why.code), words);
        }
    }
}

static void send_message(live* self, uint32_t index, int64_t now)
{
    const verge_vehicle_plan_t* plan = &self->cycle.messages[index];
    const bool cancels = plan->status == VERGE_CANCELLED;
    if (!(cancels ? peers_cancels : peers_sends)(&self->peers, plan->vehicle_id, now)) {
        cycle_withhold(&self->cycle, index);
        return;
    }
    buses_publish(&self->now.buses, TRANSPORT_PLAN, plan);
    if (cancels) {
        log_event(LOG_INFO, "plan_cancelled", "vehicle=%d reason=%d", plan->vehicle_id,
                  plan->reason);
    }
}

/// Broadcasts the messages of the cycle, unless another unit leads, and records them all.
static void send_messages(live* self)
{
    const int64_t now = clock_us(CLOCK_MONOTONIC);
    peers_begin(&self->peers, now);
    for (uint32_t i = 0; i < self->cycle.message_count; i++) {
        send_message(self, i, now);
        if (self->now.record != NULL) {
            static transport_message message; // large; only the main thread is here
            message.kind = TRANSPORT_PLAN;
            message.as.plan = self->cycle.messages[i];
            record_message(self, clock_us(CLOCK_REALTIME), &message);
        }
    }
}

// ---- operators ----------------------------------------------------------------------------

static report_input view(live* self)
{
    const instant at = instant_now();
    count_dropped(self);
    return (report_input){
        .config = config_of(self->now.site),
        .cycle = &self->cycle,
        .status = monitor_message(&self->monitor, at),
        .bus = buses_statistics(&self->now.buses),
        .peers = &self->peers,
        .now = at.now,
        .faults = status_faults(&self->status, at.now),
        .log_dropped = self->status.log_dropped,
        .record_dropped = self->status.record_dropped,
    };
}

static void answer_status(void* context, text* answer)
{
    const report_input from = view(context);
    report_status(answer, &from);
}

static void answer_vehicles(void* context, text* answer)
{
    report_vehicles(answer, &((live*)context)->cycle);
}

static void answer_plans(void* context, text* answer)
{
    report_plans(answer, &((live*)context)->cycle);
}

static void answer_metrics(void* context, text* page)
{
    const report_input from = view(context);
    report_metrics(page, &from);
}

// ---- signals, new configuration -----------------------------------------------------------

/// True: the daemon has to stop.
static bool on_signals(live* self)
{
    for (;;) {
        switch (signals_next(self->signal_fd)) {
        case 0: return false;
        case SIGHUP: reloader_begin(&self->reloader, &self->notify); break;
        case SIGUSR1: monitor_log_statistics(&self->monitor, instant_now()); break;
        case SIGTERM: log_event(LOG_INFO, "stopping", "signal=SIGTERM"); return true;
        default: log_event(LOG_INFO, "stopping", "signal=SIGINT"); return true;
        }
    }
}

static reload_result reload(void* context, uint64_t* ticket, const char** reason)
{
    live* self = context;
    return reloader_serve(&self->reloader, &self->notify, ticket, reason);
}

/// An accepted configuration waits for apply_next(); a refused one is a fault.
static void on_reload_over(live* self)
{
    if (reloader_over(&self->reloader, &self->notify)) {
        status_fault(&self->status, RSU_FAULT_CONFIG, 0, true);
    }
}

/// Between two cycles: the accepted configuration takes effect.
static void apply_next(live* self)
{
    const setup* next = reloader_next(&self->reloader);
    if (next == NULL) {
        return;
    }
    const cycle_def def = config_cycle_def(config_of(next->site), &next->planner);
    cycle_swap(&self->cycle, &def);
    const peers_def peers = config_peers_def(config_of(next->site), self->status.start_utime);
    peers_set(&self->peers, &peers);
    const bool period_changed = next->site->cycle_ms != self->now.site->cycle_ms;
    const bool buses_changed = next->buses.count > 0;
    // A recording holds one configuration, because a replay works with one.
    if (self->now.record != NULL) {
        log_event(LOG_WARNING, "record_ended", "reason=configuration_changed");
        self->record_dropped += recorder_dropped(self->now.record);
    }
    reloader_install(&self->reloader);
    if (buses_changed) {
        inbox_forget_senders(&self->cycle.inbox); // new buses give new numbers to senders
    }
    if (period_changed) {
        timer_arm(self->cycle_fd, self->now.site->cycle_ms);
        check_patience(self);
    }
    start_log_format(&self->options->start, self->now.site);
    status_fault_clear(&self->status, RSU_FAULT_CONFIG);
    reloader_applied(&self->reloader, &self->notify);
}

// ---- stop ---------------------------------------------------------------------------------

static int stop(live* self)
{
    notify_send(&self->notify, "STOPPING=1");
    cycle_cancel_all(&self->cycle, self->cycle_count, clock_us(CLOCK_REALTIME));
    send_messages(self);
    self->status.stopping = true;
    monitor_publish(&self->monitor, instant_now());
    operators_write(&self->operators);
    log_event(LOG_INFO, "stopped",
              "cycles=%" PRId64 " plans=%" PRIu64 " fallbacks=%" PRIu64 " deadline_misses=%" PRIu64,
              self->cycle_count, self->cycle.counters.plans, self->cycle.counters.fallbacks,
              self->status.deadline_misses);
    if (!end_record(self)) {
        log_event(LOG_WARNING, "record_cut",
                  "reason=\"the last events could not be written in time\"");
    }
    if (worker_busy(self->worker) || reloader_busy(&self->reloader)) {
        // The daemon stops within one second. A planning step or a reload may take longer, and its
        // result is not needed any more. The recording is complete without it.
        operators_close(&self->operators);
        log_stop(LOG_PATIENCE_US);
        _exit(0);
    }
    release(self);
    return 0;
}

static void release(live* self)
{
    notify_close(&self->notify);
    operators_close(&self->operators);
    worker_destroy(self->worker);
    reloader_close(&self->reloader);
    end_record(self);
    setup_free(&self->now);
    const int ends[] = { self->signal_fd, self->cycle_fd, self->status_fd };
    for (unsigned i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        if (ends[i] >= 0) {
            close(ends[i]);
        }
    }
    log_stop(LOG_PATIENCE_US);
}
